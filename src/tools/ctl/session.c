/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/session.h"
#include "ctl/ctl_private.h"
#include "ctl/say.h"
#include "words/nearest.h"

#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

void db_ctl_print_json(const json_t *value)
{
	(void)json_dumpf(value, stdout, JSON_COMPACT | JSON_REAL_PRECISION(10));
	putchar('\n');
	(void)fflush(stdout);
}

enum db_ctl_status db_ctl_fail_file(const struct db_ctl *ctl, const char *path)
{
	return db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.File", "%s: %s", path,
	                       strerror(errno));
}

enum db_ctl_status db_ctl_fail(const struct db_ctl *ctl, const struct db_client_error *error)
{
	bool of_client = strncmp(error->name, "io.drivebridge.Client.",
	                         strlen("io.drivebridge.Client.")) == 0;
	char room[DB_WORDS_TEXT_MAX];
	json_t *object;

	if (ctl->json) {
		object = json_pack("{s:s, s:O?, s:s}", "error", error->name, "parameters",
		                   error->parameters, "text", error->text);
		db_ctl_print_json(object);
		json_decref(object);
	} else {
		(void)fflush(stdout);
		/* "refused: ...": the result is a word of the service, and the reason a text. */
		if (strcmp(error->name, DB_CLIENT_SERVICE "Refused") == 0 && error->parameters)
			fprintf(stderr, "drivebridgectl: %s: %s\n",
			        db_ctl_say_name(db_words_text(error->parameters, "result")),
			        db_ctl_translate(db_words_text(error->parameters, "reason"), room));
		else
			fprintf(stderr, "drivebridgectl: %s\n",
			        db_ctl_translate(error->text, room));
	}
	return of_client ? DB_CTL_UNREACHABLE : DB_CTL_NO;
}

enum db_ctl_status db_ctl_complain(const struct db_ctl *ctl, enum db_ctl_status status,
                                   const char *name, const char *format, ...)
{
	struct db_client_error error = { .parameters = NULL };
	char text[sizeof(error.text)];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	db_client_error_set(&error, name, "%s", text);
	(void)db_ctl_fail(ctl, &error);
	return status;
}

enum db_ctl_status db_ctl_open(struct db_ctl *ctl)
{
	struct db_client_error error = { .parameters = NULL };
	enum db_ctl_status status = DB_CTL_OK;

	if (db_client_open(ctl->socket, &ctl->client, &error) != 0)
		return db_ctl_fail(ctl, &error);
	ctl->description = db_ctl_call(ctl, "Describe", NULL, DB_CTL_TIMEOUT_MS, &status);
	ctl->gateway = json_pack("{s:s}", "name", "");
	return status;
}

void db_ctl_close(struct db_ctl *ctl)
{
	json_decref(ctl->description);
	ctl->description = NULL;
	json_decref(ctl->gateway);
	ctl->gateway = NULL;
	db_client_close(ctl->client);
	ctl->client = NULL;
}

json_t *db_ctl_call(struct db_ctl *ctl, const char *method, json_t *parameters, int timeout_ms,
                    enum db_ctl_status *status)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *answer = NULL;

	*status = DB_CTL_OK;
	if (db_client_call(ctl->client, method, parameters, timeout_ms, &answer, &error) != 0)
		*status = db_ctl_fail(ctl, &error);
	db_client_error_clear(&error);
	return answer;
}

json_t *db_ctl_find(const struct db_ctl *ctl, const json_t *list, const char *name,
                    const char *error, const char *unknown)
{
	json_t *found = db_words_look_up(list, name);
	char nearest[256];

	if (found)
		return found;
	db_words_nearest_names(list, name, nearest, sizeof(nearest));
	(void)db_ctl_complain(ctl, DB_CTL_USAGE, error, "%s \"%s\"%s", unknown, name, nearest);
	return NULL;
}

json_t *db_ctl_find_drive(const struct db_ctl *ctl, const char *name)
{
	return db_ctl_find(ctl, json_object_get(ctl->description, "drives"), name,
	                   DB_CLIENT_SERVICE "NoSuchDrive", "no drive is called");
}

json_t *db_ctl_look_up_unit(const struct db_ctl *ctl, const char *name)
{
	json_t *drive = db_words_look_up(json_object_get(ctl->description, "drives"), name);

	return drive || strcmp(name, "gateway") != 0 ? drive : ctl->gateway;
}

json_t *db_ctl_find_unit(const struct db_ctl *ctl, const char *name)
{
	json_t *unit = db_ctl_look_up_unit(ctl, name);

	return unit ? unit : db_ctl_find_drive(ctl, name);
}

json_t *db_ctl_read_registers(struct db_ctl *ctl, const char *drive, enum db_ctl_status *status)
{
	static const char words[] = "codes as in ";
	json_t *answer = db_ctl_call(ctl, "Registers", json_pack("{s:s}", "drive", drive),
	                             DB_CTL_TIMEOUT_MS, status);
	json_t *registers = json_incref(json_object_get(answer, "registers"));
	size_t i;
	json_t *reg;

	json_decref(answer);
	if (*status == DB_CTL_OK && !registers)
		*status = db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_BAD_ANSWER,
		                          "the service does not say which registers there are");
	/* A register whose description has "codes as in NAME" gets those of the register of that
	 * name. */
	json_array_foreach(registers, i, reg)
	{
		const char *at = strstr(db_words_text(reg, "description"), words);
		char name[64];
		json_t *codes;

		if (!at || json_object_get(reg, "codes"))
			continue;
		at += strlen(words);
		snprintf(name, sizeof(name), "%.*s",
		         (int)strspn(at, "abcdefghijklmnopqrstuvwxyz0123456789_"), at);
		codes = json_object_get(db_words_look_up(registers, name), "codes");
		if (codes)
			(void)json_object_set(reg, "codes", codes);
	}
	return registers;
}

enum db_ctl_status db_ctl_ask(const struct db_ctl *ctl, const char *format, ...)
{
	/* The letter of the language is right as well as the English one. */
	const char *yes = db_ctl_say("y");
	char answer[16] = "";
	va_list arguments;

	if (ctl->yes)
		return DB_CTL_OK;
	if (ctl->json || !isatty(STDIN_FILENO))
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "nobody can be asked here; --yes does it without");
	va_start(arguments, format);
	vprintf(db_ctl_say(format), arguments);
	va_end(arguments);
	printf(" [%s/N] ", yes);
	(void)fflush(stdout);
	if (fgets(answer, sizeof(answer), stdin) && (tolower((unsigned char)answer[0]) == 'y' ||
	                                             tolower((unsigned char)answer[0]) == yes[0]))
		return DB_CTL_OK;
	return db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
	                       "nothing was done");
}
