/* SPDX-License-Identifier: Apache-2.0 */
#include "audit/audit_private.h"

#include <string.h>

/* A segment's first line has the seal of the line before it, which is the chain's begin where that
 * line is no longer there. */
static const char *take_head(struct db_lines *lines, const json_t *head)
{
	const char *before = json_string_value(json_object_get(head, "before"));
	uint64_t segment = db_record_number(head, "segment");
	const char *why = NULL;

	if (!before || strlen(before) != DB_SEAL_MAX - 1 || segment == 0)
		return "the head of this file is damaged";
	if (!lines->begun)
		memcpy(lines->chain.seal, before, DB_SEAL_MAX);
	else if (segment != lines->segment + 1 || strcmp(lines->chain.seal, before) != 0)
		why = "what was before this file is missing or was changed";
	lines->segment = segment;
	lines->line = 1;
	return why;
}

static const char *take_record(struct db_lines *lines, const json_t *record)
{
	uint64_t number = db_record_number(record, "number");
	const char *kind = json_string_value(json_object_get(record, "kind"));
	uint64_t before = lines->number;

	if (number == 0)
		return "this record has no number";
	lines->number = number;
	/* The record that says so explains the numbers that are missing. */
	if (before == 0 || number == before + 1 ||
	    (number > before && kind && strcmp(kind, db_audit_kind_name(DB_AUDIT_LOST)) == 0))
		return NULL;
	return "records before this one are missing";
}

size_t db_lines_read(struct db_lines *lines, const char *bytes, size_t length, db_lines_fn *take,
                     void *context)
{
	const char *text = bytes;
	const char *end;

	for (; (end = memchr(text, '\n', (size_t)(bytes + length - text))) != NULL;
	     text = end + 1) {
		size_t size = (size_t)(end - text);
		json_t *object = size <= DB_TRAIL_LINE_MAX ?
		                         json_loadb(text, size, JSON_REJECT_DUPLICATES, NULL) :
		                         NULL;
		bool head = json_is_string(json_object_get(object, "audit"));
		const char *why = NULL;

		lines->line++;
		if (head)
			why = take_head(lines, object);
		switch (db_chain_check(&lines->chain, text, size)) {
		case DB_CHAIN_GOOD:
			lines->begun = true;
			break;
		case DB_CHAIN_WRONG:
			/* Without its head the first line of what is left cannot be judged. */
			if (lines->begun || head)
				why = "its seal does not fit: it was changed, or a line before it "
				      "was";
			lines->begun = true;
			break;
		case DB_CHAIN_NO_LINE:
		default:
			why = "this is no record";
			break;
		}
		if (!object)
			why = "this is no record";
		else if (!head && !why)
			why = take_record(lines, object);
		else if (!head && db_record_number(object, "number") != 0)
			lines->number = db_record_number(object, "number");
		take(context, lines, head ? NULL : object, text, size, why);
		json_decref(object);
	}
	return (size_t)(text - bytes);
}
