/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/grid.h"
#include "ctl/say.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

struct stream {
	const struct db_ctl *ctl;
	enum db_ctl_status status;
	bool ended;
};

static void print_event(const struct db_ctl *ctl, const json_t *event)
{
	const char *level = db_words_text(event, "level");
	enum db_ctl_colour colour = strcmp(level, "error") == 0   ? DB_CTL_RED :
	                            strcmp(level, "warning") == 0 ? DB_CTL_YELLOW :
	                                                            DB_CTL_PLAIN;
	static const char *const whom[] = { DB_CTL_TEXT("bus"), DB_CTL_TEXT("drive"),
		                            DB_CTL_TEXT("client") };
	size_t used = 0;
	char when[DB_WORDS_TIME_MAX];
	char text[DB_WORDS_TEXT_MAX];
	char room[DB_WORDS_TEXT_MAX];
	const char *rank = db_ctl_say_name(level);
	unsigned columns = db_words_columns(rank, strlen(rank));

	if (ctl->json) {
		db_ctl_print_json(event);
		return;
	}
	db_words_write_time(json_integer_value(json_object_get(event, "time_us")), when);
	/* The event's subject, as the log writes it. */
	for (size_t i = 0; i < sizeof(whom) / sizeof(whom[0]); i++) {
		const char *name = db_words_text(event, whom[i]);

		if (name[0] && used < sizeof(text))
			used += (size_t)snprintf(text + used, sizeof(text) - used,
			                         "%s %s: ", db_ctl_say(whom[i]), name);
	}
	if (used < sizeof(text))
		snprintf(text + used, sizeof(text) - used, "%s",
		         db_ctl_translate(db_words_text(event, "text"), room));
	db_words_clean(text);
	printf("%s  %s%s%*s  %s%s\n", when, db_ctl_colour_begin(ctl->colour, colour), rank,
	       columns < 7 ? 7 - (int)columns : 0, "", text,
	       db_ctl_colour_end(ctl->colour, colour));
	(void)fflush(stdout);
}

static void take_events(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct stream *stream = data;
	json_int_t skipped = json_integer_value(json_object_get(parameters, "skipped"));
	size_t i;
	const json_t *event;

	stream->ended = !more;
	if (error) {
		stream->status = db_ctl_fail(stream->ctl, error);
		return;
	}
	json_array_foreach(json_object_get(parameters, "events"), i, event)
		print_event(stream->ctl, event);
	if (skipped > 0 && !stream->ctl->json)
		db_ctl_say_line(stdout, "(%lld events were left out)", (long long)skipped);
}

enum db_ctl_status db_ctl_events(struct db_ctl *ctl, int count, char **arguments)
{
	struct stream stream = { .ctl = ctl };
	int signals;
	int turn = 1;

	(void)count;
	(void)arguments;
	if (db_client_send(ctl->client, "Events", NULL, ctl->follow, take_events, &stream) != 0)
		return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
		                       "the service has closed the connection");
	signals = db_ctl_signals_open();
	/* Reading the kept events does not wait for a drive. A pipe without a reader ends the
	 * command too. */
	while (!stream.ended && turn > 0 && !ferror(stdout))
		turn = db_ctl_follow(ctl, signals, ctl->follow ? -1 : DB_CTL_TIMEOUT_MS);
	if (turn == 0 && !stream.ended)
		stream.status = db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_TIMEOUT,
		                                "the service does not answer within %d ms",
		                                DB_CTL_TIMEOUT_MS);
	if (signals >= 0)
		(void)close(signals);
	return stream.status;
}
