/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/command.h"

#include "mqtt/moment.h"

#include <stdio.h>
#include <string.h>

/* A text, or a whole number. False: neither, or too long. */
static bool read_id(const json_t *json, char id[DB_MQTT_ID_MAX + 1])
{
	const char *text = json_string_value(json);
	int length = text                  ? snprintf(id, DB_MQTT_ID_MAX + 1, "%s", text) :
	             json_is_integer(json) ? snprintf(id, DB_MQTT_ID_MAX + 1, "%lld",
	                                              (long long)json_integer_value(json)) :
	                                     0;

	if (length > 0 && length <= DB_MQTT_ID_MAX &&
	    (!text || json_string_length(json) == (size_t)length))
		return true;
	id[0] = '\0';
	return false;
}

bool db_mqtt_command_user_is_good(const json_t *user)
{
	const char *text = json_string_value(user);
	size_t length = json_string_length(user);

	if (!text || length == 0 || length > DB_MQTT_USER_MAX)
		return false;
	for (size_t i = 0; i < length; i++) {
		if ((unsigned char)text[i] < ' ' || text[i] == 0x7F)
			return false;
	}
	return true;
}

static const char *read_members(struct db_mqtt_command *command)
{
	static const char *const known[] = { "id",      "time",      "user", "token",
		                             "command", "arguments", "write" };
	json_t *name = json_object_get(command->message, "command");
	json_t *values = json_object_get(command->message, "write");
	json_t *time = json_object_get(command->message, "time");
	json_t *id = json_object_get(command->message, "id");
	json_t *user = json_object_get(command->message, "user");
	json_t *token = json_object_get(command->message, "token");
	const char *key;
	const json_t *value;

	if (id && !read_id(id, command->id))
		return "id is a text of 1 to 64 bytes or a whole number";
	json_object_foreach(command->message, key, value)
	{
		bool found = false;

		for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++)
			found = found || strcmp(key, known[i]) == 0;
		if (!found)
			return "there are id, time, user, token, command, arguments and write, "
			       "nothing else";
	}
	if (time &&
	    (!json_is_string(time) || !db_mqtt_moment_read(json_string_value(time), &command->us)))
		return "time is a text such as 2026-03-01T12:00:00Z";
	command->timed = time != NULL;
	if (user && !db_mqtt_command_user_is_good(user))
		return "user is a text of 1 to 32 bytes";
	command->user = user ? json_string_value(user) : "";
	if (token && !json_is_string(token))
		return "token is a text of the service's clock";
	command->token = json_string_value(token);
	command->arguments = json_object_get(command->message, "arguments");
	if (!name == !values)
		return "either command or write is needed";
	if (command->arguments && (values || !json_is_object(command->arguments)))
		return "arguments is an object, and belongs to command";
	if (name && !json_is_string(name))
		return "command is a text";
	if (values && !json_is_object(values))
		return "write is an object";
	command->name = json_string_value(name);
	if (values)
		command->arguments = values;
	return NULL;
}

const char *db_mqtt_command_parse(const char *text, size_t length, const json_t *stops,
                                  struct db_mqtt_command *command)
{
	const char *wrong;

	*command = (struct db_mqtt_command){ .message = NULL };
	if (length > DB_MQTT_COMMAND_MAX)
		return "the message is too long";
	command->message = json_loadb(text, length, JSON_REJECT_DUPLICATES, NULL);
	if (!json_is_object(command->message))
		return "the message is no JSON object";
	wrong = read_members(command);
	command->stops = command->name && json_object_get(stops, command->name);
	return wrong;
}

const char *db_mqtt_command_parse_stop(const char *text, size_t length, const json_t *stops,
                                       struct db_mqtt_command *command)
{
	if (!db_mqtt_command_parse(text, length, stops, command))
		return command->stops ? NULL :
		                        "only stops belong here: stop, quick_stop and disable";
	command->name = "stop";
	command->stops = true;
	command->arguments = NULL;
	if (!command->user)
		command->user = "";
	return NULL;
}

void db_mqtt_command_clear(struct db_mqtt_command *command)
{
	json_decref(command->message);
	*command = (struct db_mqtt_command){ .message = NULL };
}
