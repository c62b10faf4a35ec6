/* SPDX-License-Identifier: Apache-2.0 */
#include "control/message.h"

#include <string.h>

static bool take_flag(const json_t *root, const char *name, bool *flag)
{
	const json_t *value = json_object_get(root, name);

	*flag = json_is_true(value);
	return !value || json_is_boolean(value) || json_is_null(value);
}

const char *db_message_parse(const char *text, size_t length, struct db_message *message)
{
	const char *wrong = NULL;
	json_error_t error;
	json_t *upgrade;

	*message = (struct db_message){ .root = json_loadb(text, length, JSON_REJECT_DUPLICATES,
		                                           &error) };
	if (!message->root)
		return "the message is no JSON object";
	message->method = json_string_value(json_object_get(message->root, "method"));
	message->parameters = json_object_get(message->root, "parameters");
	if (json_is_null(message->parameters))
		message->parameters = NULL;
	upgrade = json_object_get(message->root, "upgrade");
	if (!message->method)
		wrong = "method";
	else if (message->parameters && !json_is_object(message->parameters))
		wrong = "parameters";
	else if (!take_flag(message->root, "more", &message->more))
		wrong = "more";
	else if (!take_flag(message->root, "oneway", &message->oneway))
		wrong = "oneway";
	else if (json_is_true(upgrade))
		wrong = "upgrade";
	if (wrong)
		db_message_clear(message);
	return wrong;
}

void db_message_clear(struct db_message *message)
{
	json_decref(message->root);
	*message = (struct db_message){ .root = NULL };
}

char *db_message_text(json_t *value)
{
	/* 15 digits show every f32 and every u32 as people write them. */
	char *text = json_dumps(value, JSON_COMPACT | JSON_REAL_PRECISION(15));

	json_decref(value);
	return text;
}

json_t *db_message_lines(const char *lines)
{
	json_t *texts = json_array();

	while (*lines) {
		size_t length = strcspn(lines, "\n");
		json_t *text = json_stringn(lines, length);

		json_array_append_new(texts, text ? text : json_string("?"));
		lines += length + (lines[length] == '\n');
	}
	return texts;
}

char *db_message_answer(const char *error, json_t *parameters, bool continues, size_t *length)
{
	json_t *root = json_object();
	char *text;

	if (error)
		json_object_set_new(root, "error", json_string(error));
	json_object_set_new(root, "parameters", parameters ? parameters : json_object());
	if (continues)
		json_object_set_new(root, "continues", json_true());
	text = db_message_text(root);
	*length = text ? strlen(text) + 1 : 0;
	return text;
}
