/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/commission_talk.h"
#include "ctl/say.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Without spaces at both ends. */
static char *trim(char *text)
{
	char *end = text + strlen(text);

	while (isspace((unsigned char)*text))
		text++;
	while (end > text && isspace((unsigned char)end[-1]))
		*--end = '\0';
	return text;
}

enum db_ctl_status db_ctl_talk_open(struct db_ctl_talk *talk, const struct db_ctl *ctl)
{
	char *line = NULL;
	size_t size = 0;
	FILE *file;

	*talk = (struct db_ctl_talk){ .ctl = ctl };
	if (!ctl->answers && !isatty(STDIN_FILENO))
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "nobody can be asked here; --answers FILE has the answers");
	if (!ctl->answers || strcmp(ctl->answers, "-") == 0)
		return DB_CTL_OK;
	file = fopen(ctl->answers, "re");
	if (!file)
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage", "%s: %s",
		                       ctl->answers, strerror(errno));
	talk->prepared = json_object();
	while (getline(&line, &size, file) > 0) {
		char *equals = strchr(line, '=');

		line[strcspn(line, "#")] = '\0';
		if (!equals || equals >= line + strlen(line))
			continue;
		*equals = '\0';
		(void)json_object_set_new(talk->prepared, trim(line),
		                          json_string(trim(equals + 1)));
	}
	free(line);
	(void)fclose(file);
	return DB_CTL_OK;
}

void db_ctl_talk_close(struct db_ctl_talk *talk)
{
	json_decref(talk->prepared);
	talk->prepared = NULL;
}

/* The next line of standard input without its outer spaces. False at the end of input or after
 * Ctrl-C. */
static bool read_line(struct db_ctl_talk *talk, struct db_commission_act *act, char *line)
{
	char *end;
	ssize_t count;
	size_t used;

	while ((end = memchr(talk->line, '\n', talk->length)) == NULL) {
		if (talk->length == sizeof(talk->line))
			talk->length = 0;
		if (db_commission_act_wait(act, STDIN_FILENO, 100)) {
			count = read(STDIN_FILENO, talk->line + talk->length,
			             sizeof(talk->line) - talk->length);
			if (count <= 0)
				act->interrupted = true;
			else
				talk->length += (size_t)count;
		}
		if (act->interrupted)
			return false;
	}
	*end = '\0';
	used = (size_t)(end - talk->line) + 1;
	snprintf(line, sizeof(talk->line), "%s", talk->line);
	talk->length -= used;
	memmove(talk->line, talk->line + used, talk->length);
	return true;
}

static void print_question(const struct db_ctl *ctl, const struct db_commission_action *question)
{
	char room[DB_WORDS_TEXT_MAX];
	json_t *object;

	if (ctl->json) {
		object = json_pack("{s:s, s:s, s:s}", "ask", question->id, "text", question->text,
		                   "choices", question->choices);
		db_ctl_print_json(object);
		json_decref(object);
		return;
	}
	printf("? %s\n  [%s] ", db_ctl_translate(question->text, room),
	       question->choices[0] ? question->choices : db_ctl_say("a number; empty: skip"));
	(void)fflush(stdout);
}

const char *db_ctl_talk_ask(struct db_ctl_talk *talk, struct db_commission_act *act,
                            const struct db_commission_action *question)
{
	const struct db_ctl *ctl = talk->ctl;
	const char *given = json_string_value(json_object_get(talk->prepared, question->id));
	char typed[sizeof(talk->line)];
	const char *line;

	print_question(ctl, question);
	if (talk->prepared) {
		if (!ctl->json)
			printf("%s\n", given ? given : "");
		if (!given || strcmp(given, "skip") == 0)
			return NULL;
		if (db_commission_choose(question->choices, given, talk->answer,
		                         sizeof(talk->answer)))
			return talk->answer;
		(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                      "%s = %s is no answer; %s is right", question->id, given,
		                      question->choices[0] ? question->choices :
		                                             DB_CTL_TEXT("a number"));
		act->interrupted = true;
		return NULL;
	}
	while (read_line(talk, act, typed)) {
		line = trim(typed);
		if (db_commission_choose(question->choices, line, talk->answer,
		                         sizeof(talk->answer)))
			return talk->answer;
		if (line[0] == '\0' || strcmp(line, "skip") == 0)
			return NULL;
		print_question(ctl, question);
	}
	return NULL;
}
