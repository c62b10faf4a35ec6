/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Any bytes as a file of the audit trail, whole and in pieces.
 *
 * What must hold: the result is the same wherever the input is cut into pieces. An input does not know the key, so no line
 * of it fits the chain; a line that is sealed after it does. Each record that was read can be written again, and is then
 * read as the same.
 */
#include "audit/audit_private.h"

#include "fakes/must.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct told {
	unsigned lines;
	unsigned fitting;
	uint64_t number;
};

static void take_record(const json_t *object)
{
	struct db_audit_entry entry;
	struct db_audit_entry again;
	struct db_audit_value value;
	char *fields[DB_RECORD_FIELDS_MAX];
	json_t *written;
	char *who;

	if (!db_record_read(object, &entry, &value))
		return;
	who = db_record_who(object);
	must(who);
	free(who);
	(void)db_record_is_refused(object);
	/* Of values only the name is known. */
	entry.value_count = 0;
	written = db_record_write(&entry);
	for (size_t count = db_record_fields(&entry, written, fields); count > 0; count--)
		free(fields[count - 1]);
	must(db_record_read(written, &again, &value));
	must(again.number == entry.number && again.kind == entry.kind && again.of == entry.of);
	must(again.command == entry.command && again.port == entry.port);
	must(strcmp(again.drive, entry.drive) == 0);
	must(memcmp(again.address, entry.address, sizeof(entry.address)) == 0);
	json_decref(written);
}

static void take(void *context, const struct db_lines *lines, json_t *object, const char *text,
                 size_t length, const char *why)
{
	struct told *told = context;

	must(text[length] == '\n');
	told->lines++;
	told->fitting += !why;
	told->number = lines->number;
	if (object)
		take_record(object);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static const uint8_t key[DB_CHAIN_KEY] = "a key that no input has";
	static const char body[] = "{\"number\":1,\"kind\":\"service\"";
	char *bytes = malloc(size + 1);
	char end[DB_CHAIN_END_MAX];
	struct told whole = { 0 };
	struct told pieces = { 0 };
	struct db_lines lines;
	struct db_chain chain;
	size_t used = 0;

	must(bytes);
	memcpy(bytes, data, size);
	db_chain_init(&chain, key);
	lines = (struct db_lines){ .chain = chain };
	lines.begun = true;
	must(db_lines_read(&lines, bytes, size, take, &whole) <= size);
	must(whole.fitting == 0);

	lines = (struct db_lines){ .chain = chain };
	lines.begun = true;
	for (size_t to = 1; to <= size; to += 1 + to / 7)
		used += db_lines_read(&lines, bytes + used, to - used, take, &pieces);
	used += db_lines_read(&lines, bytes + used, size - used, take, &pieces);
	must(pieces.lines == whole.lines && pieces.number == whole.number);

	chain = lines.chain;
	db_chain_seal(&chain, body, sizeof(body) - 1, end);
	free(bytes);
	bytes = malloc(sizeof(body) + sizeof(end));
	must(bytes);
	strcpy(bytes, body);
	strcat(bytes, end);
	must(db_chain_check(&lines.chain, bytes, strlen(bytes)) == DB_CHAIN_GOOD);
	free(bytes);
	return 0;
}
