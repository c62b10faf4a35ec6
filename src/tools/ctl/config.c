/* SPDX-License-Identifier: Apache-2.0 */
/* The part of the configuration that is edited over the control socket. */
#include "ctl/ctl_private.h"
#include "ctl/say.h"
#include "words/value.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* More than the service takes, which then says what is right. */
#define TEXT_MAX 30000

/* A file, or standard input for "-". To be freed; NULL: the reason is printed. */
static char *read_file(const struct db_ctl *ctl, const char *path, enum db_ctl_status *status)
{
	bool given = strcmp(path, "-") != 0;
	FILE *in = given ? fopen(path, "re") : stdin;
	const char *why = in ? NULL : strerror(errno);
	char *text = calloc(1, TEXT_MAX + 1);
	size_t length;

	if (in && text) {
		length = fread(text, 1, TEXT_MAX, in);
		if (ferror(in))
			why = strerror(errno);
		else if (length == TEXT_MAX || memchr(text, '\0', length))
			why = "it is too long, or no text";
	} else if (!why) {
		why = strerror(ENOMEM);
	}
	/* gcc's analyzer takes standard input for a file that is left open. */
	if (in && given)
		(void)fclose(in);
	*status = DB_CTL_OK;
	if (!why)
		return text;
	free(text);
	*status = db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.File", "%s: %s", path,
	                          why);
	return NULL;
}

static void print_messages(const json_t *answer)
{
	const json_t *message;
	size_t i;

	json_array_foreach(json_object_get(answer, "messages"), i, message)
	{
		db_ctl_translate_lines(stderr, json_string_value(message));
		fputc('\n', stderr);
	}
}

/* Returns whether something moves that would be stopped. */
static bool print_effects(const json_t *answer)
{
	char room[DB_WORDS_TEXT_MAX];
	const json_t *effect;
	bool moves = false;
	size_t i;

	json_array_foreach(json_object_get(answer, "effects"), i, effect)
	{
		bool one = json_is_true(json_object_get(effect, "moves"));
		const char *drive = db_words_text(effect, "drive");

		moves = moves || one;
		printf("%s%s%s%s%s: %s\n", drive[0] ? "" : db_ctl_say("bus "),
		       drive[0] ? drive : db_words_text(effect, "bus"), one ? " (" : "",
		       one ? db_ctl_say("MOVES NOW") : "", one ? ")" : "",
		       db_ctl_translate(db_words_text(effect, "text"), room));
	}
	db_ctl_say_line(stdout, i > 0 ? DB_CTL_TEXT("all other drives go on") :
	                                DB_CTL_TEXT("no drive changes"));
	return moves;
}

/* Says what the service says of a text. The answer, to be freed; NULL when it is wrong. */
static json_t *check_text(struct db_ctl *ctl, const char *text, bool *moves,
                          enum db_ctl_status *status)
{
	json_t *parameters = json_pack("{s:s}", "text", text);
	json_t *answer;

	if (!parameters) {
		*status = db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.File",
		                          "the text is no UTF-8");
		return NULL;
	}
	answer = db_ctl_call(ctl, "CheckConfiguration", parameters, DB_CTL_DRIVE_TIMEOUT_MS,
	                     status);
	if (!answer)
		return NULL;
	if (!ctl->json)
		print_messages(answer);
	if (json_is_true(json_object_get(answer, "good"))) {
		*moves = !ctl->json && print_effects(answer);
		return answer;
	}
	*status = DB_CTL_NO;
	if (ctl->json)
		db_ctl_print_json(answer);
	json_decref(answer);
	return NULL;
}

enum db_ctl_status db_ctl_config_show(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	json_t *answer = db_ctl_call(ctl, "Configuration", NULL, DB_CTL_DRIVE_TIMEOUT_MS, &status);

	(void)count;
	(void)arguments;
	if (answer && ctl->json)
		db_ctl_print_json(answer);
	else if (answer)
		fputs(db_words_text(answer, "text"), stdout);
	json_decref(answer);
	return status;
}

enum db_ctl_status db_ctl_config_check(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	char *text = read_file(ctl, arguments[0], &status);
	bool moves = false;
	json_t *answer = text ? check_text(ctl, text, &moves, &status) : NULL;

	(void)count;
	if (answer && ctl->json)
		db_ctl_print_json(answer);
	json_decref(answer);
	free(text);
	return status;
}

/* Checks a text, asks, has it written and loaded. `version`: of which the text is to be the next.
 */
static enum db_ctl_status apply(struct db_ctl *ctl, const char *text, const char *version)
{
	enum db_ctl_status status = DB_CTL_OK;
	bool moves = false;
	json_t *answer = check_text(ctl, text, &moves, &status);

	if (!answer)
		return status;
	json_decref(answer);
	status = moves ? db_ctl_ask(ctl, "save this and load it, also what moves now?") :
	                 db_ctl_ask(ctl, "save this and load it?");
	if (status != DB_CTL_OK)
		return status;
	answer = db_ctl_call(ctl, "SetConfiguration",
	                     json_pack("{s:s, s:s}", "text", text, "version", version),
	                     DB_CTL_DRIVE_TIMEOUT_MS, &status);
	if (answer && !json_is_true(json_object_get(answer, "good"))) {
		print_messages(answer);
		status = DB_CTL_NO;
	}
	json_decref(answer);
	return status == DB_CTL_OK ? db_ctl_reload(ctl, 0, NULL) : status;
}

enum db_ctl_status db_ctl_config_set(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	char *text = read_file(ctl, arguments[0], &status);
	json_t *now = text ? db_ctl_call(ctl, "Configuration", NULL, DB_CTL_DRIVE_TIMEOUT_MS,
	                                 &status) :
	                     NULL;

	(void)count;
	if (now)
		status = apply(ctl, text, db_words_text(now, "version"));
	json_decref(now);
	free(text);
	return status;
}

enum db_ctl_status db_ctl_config_back(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	json_t *now = db_ctl_call(ctl, "Configuration", NULL, DB_CTL_DRIVE_TIMEOUT_MS, &status);
	const json_t *former = json_array_get(json_object_get(now, "formers"), 0);
	json_t *text;

	(void)count;
	(void)arguments;
	if (now && !former)
		status = db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.NoFormer",
		                         "there is no former text");
	text = former ? db_ctl_call(ctl, "Configuration",
	                            json_pack("{s:O}", "former", json_object_get(former, "number")),
	                            DB_CTL_DRIVE_TIMEOUT_MS, &status) :
	                NULL;
	if (text)
		status = apply(ctl, db_words_text(text, "text"), db_words_text(now, "version"));
	json_decref(text);
	json_decref(now);
	return status;
}
