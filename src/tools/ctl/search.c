/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/search.h"
#include "ctl/ctl_private.h"
#include "ctl/say.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

struct stream {
	const struct db_ctl *ctl;
	struct db_ctl_search *search;
	enum db_ctl_status status;
	bool ended;
	bool progress; /* show the progress in a line on the terminal */
};

void db_ctl_search_clear(struct db_ctl_search *search)
{
	json_decref(search->finds);
	json_decref(search->foreign);
	*search = (struct db_ctl_search){ .finds = NULL };
}

const json_t *db_ctl_find_bus(const struct db_ctl *ctl, const char *name)
{
	return db_ctl_find(ctl, json_object_get(ctl->description, "buses"), name,
	                   DB_CLIENT_SERVICE "NoSuchBus", "no bus is called");
}

static void take_answer(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct stream *stream = data;
	struct db_ctl_search *search = stream->search;

	stream->ended = !more;
	if (error) {
		if (stream->progress)
			fputs("\r\033[K", stderr);
		stream->status = db_ctl_fail(stream->ctl, error);
		return;
	}
	(void)json_array_extend(search->finds, json_object_get(parameters, "finds"));
	(void)json_array_extend(search->foreign, json_object_get(parameters, "foreign"));
	search->wait_us = json_integer_value(json_object_get(parameters, "wait_us"));
	if (!stream->progress)
		return;
	fputs("\r\033[K", stderr);
	fprintf(stderr, db_ctl_say("%lld of %lld addresses asked, %zu found; at %lld bit/s"),
	        (long long)json_integer_value(json_object_get(parameters, "asked")),
	        (long long)json_integer_value(json_object_get(parameters, "total")),
	        json_array_size(search->finds),
	        (long long)json_integer_value(json_object_get(parameters, "speed")));
	(void)fflush(stderr);
}

enum db_ctl_status db_ctl_search(struct db_ctl *ctl, json_t *parameters,
                                 struct db_ctl_search *search)
{
	struct stream stream = { .ctl = ctl,
		                 .search = search,
		                 .progress = !ctl->json && isatty(STDERR_FILENO) };
	int signals;

	*search = (struct db_ctl_search){ .finds = json_array(), .foreign = json_array() };
	if (db_client_send(ctl->client, "Scan", parameters, true, take_answer, &stream) != 0)
		return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
		                       "the service has closed the connection");
	signals = db_ctl_signals_open();
	while (!stream.ended && !search->interrupted)
		search->interrupted = db_ctl_follow(ctl, signals, -1) < 0;
	db_ctl_signals_close(signals);
	if (stream.progress)
		fputs("\r\033[K", stderr);
	/* Takes the finds that have already arrived; closing the connection then ends the scan. */
	if (search->interrupted) {
		(void)db_client_handle(ctl->client);
		db_client_close(ctl->client);
		ctl->client = NULL;
	}
	return stream.status;
}
