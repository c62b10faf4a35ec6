/* SPDX-License-Identifier: Apache-2.0 */
#include "client/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* {name} stands for the parameter of that name. */
static const struct {
	const char *name;
	const char *text;
} texts[] = {
	{ DB_CLIENT_SERVICE "NoSuchDrive", "no drive is called \"{drive}\"" },
	{ DB_CLIENT_SERVICE "NoSuchRegister", "{drive} has no register \"{name}\"" },
	{ DB_CLIENT_SERVICE "NoSuchBus", "no bus is called \"{bus}\"" },
	{ DB_CLIENT_SERVICE "NoSuchTrace", "this trace is not kept any more" },
	{ DB_CLIENT_SERVICE "NoSuchAlarm", "no such alarm of this drive is kept" },
	{ DB_CLIENT_SERVICE "NoSuchCommand", "{drive} has no command \"{command}\"" },
	{ DB_CLIENT_SERVICE "ScanFailed", "{text}" },
	{ DB_CLIENT_SERVICE "EditFailed", "{text}" },
	{ DB_CLIENT_SERVICE "NoSuchPosition", "{drive} has no position \"{name}\"" },
	{ DB_CLIENT_SERVICE "PositionRefused", "{text}" },
	{ DB_CLIENT_SERVICE "BadValue", "{name}: {reason}" },
	{ DB_CLIENT_SERVICE "NotAllowed", "not allowed: {reason}" },
	{ DB_CLIENT_SERVICE "Refused", "{result}: {reason}" },
	{ DB_CLIENT_SERVICE "TooOld",
	  "it came too late to the service, so nothing was started; try again" },
	{ DB_CLIENT_SERVICE "NotHeld", "{drive}: its motion is not held any more" },
	{ DB_CLIENT_SERVICE "Moving", "{drive} moves; stop it first" },
	{ DB_CLIENT_SERVICE "StoppedSince",
	  "{drive} was stopped after this was asked for; try again" },
	{ DB_CLIENT_SERVICE "Late", "{reason}" },
	{ DB_CLIENT_SERVICE "Busy", "the service has too much to do at once; try again" },
	{ "org.varlink.service.MethodNotFound",
	  "the service does not know {method}; it is of another version than this program" },
	{ "org.varlink.service.MethodNotImplemented",
	  "the service cannot do {method}; it is of another version than this program" },
	{ "org.varlink.service.InterfaceNotFound",
	  "{interface} is not served there; is it the control socket of drivebridged?" },
	{ "org.varlink.service.InvalidParameter",
	  "the service does not take {parameter}; it is of another version than this program" },
};

void db_client_error_clear(struct db_client_error *error)
{
	json_decref(error->parameters);
	*error = (struct db_client_error){ .parameters = NULL };
}

void db_client_error_set(struct db_client_error *error, const char *name, const char *format, ...)
{
	va_list arguments;

	db_client_error_clear(error);
	snprintf(error->name, sizeof(error->name), "%s", name);
	va_start(arguments, format);
	vsnprintf(error->text, sizeof(error->text), format, arguments);
	va_end(arguments);
}

/* The text with its parameters filled in, cut off at `size`. */
static void fill_in(char *text, size_t size, const char *format, const json_t *parameters)
{
	size_t used = 0;

	while (*format && used + 1 < size) {
		const char *end = *format == '{' ? strchr(format, '}') : NULL;
		const json_t *value = NULL;
		char name[32] = "";

		if (!end) {
			text[used++] = *format++;
			continue;
		}
		snprintf(name, sizeof(name), "%.*s", (int)(end - format - 1), format + 1);
		value = json_object_get(parameters, name);
		used += (size_t)snprintf(text + used, size - used, "%s",
		                         json_is_string(value) ? json_string_value(value) : "?");
		format = end + 1;
	}
	text[used < size ? used : size - 1] = '\0';
}

void db_client_error_read(struct db_client_error *error, const char *name, json_t *parameters)
{
	db_client_error_set(error, name, "the service answers %s", name);
	error->parameters = json_incref(parameters);
	for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
		if (strcmp(texts[i].name, name) == 0)
			fill_in(error->text, sizeof(error->text), texts[i].text, parameters);
	}
}

const char *db_client_error_short(const struct db_client_error *error)
{
	const char *last = strrchr(error->name, '.');

	return last ? last + 1 : error->name;
}

bool db_client_error_may_move(const struct db_client_error *error)
{
	static const char *const unsure[] = { "timeout", "indeterminate", "failed",
		                              "runs_on", "cancelled",     "pending" };
	const char *result = json_string_value(json_object_get(error->parameters, "result"));

	for (size_t i = 0; result && i < sizeof(unsure) / sizeof(unsure[0]); i++) {
		if (strcmp(result, unsure[i]) == 0)
			return true;
	}
	return false;
}
