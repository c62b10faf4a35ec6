/* SPDX-License-Identifier: Apache-2.0 */
#include "web/trail.h"
#include "client/link.h"
#include "web/service.h"

#include <stdlib.h>

/* A page is some milliseconds of work for the service; a disk that fails takes seconds. */
#define ANSWER_WITHIN (10 * DB_NS_PER_S)

struct db_web_trail {
	struct db_web_server *server;
	struct db_link *link;              /* NULL: nobody reads */
	struct db_web_trail_reader *first; /* whose turn it is; the others wait behind it */
	bool asked;
	bool ended;
	db_time answer_by;
};

struct db_web_trail *db_web_trail_new(struct db_web_server *server)
{
	struct db_web_trail *trail = calloc(1, sizeof(*trail));

	if (trail)
		trail->server = server;
	return trail;
}

void db_web_trail_free(struct db_web_trail *trail)
{
	if (!trail)
		return;
	db_link_drop(trail->link);
	free(trail);
}

/* Closes the link; also called when it is lost, after its question was answered with an error. */
static void drop_link(void *data)
{
	struct db_web_trail *trail = data;
	struct db_link *link = trail->link;

	trail->link = NULL;
	trail->asked = false;
	db_link_drop(link);
}

static void fail(struct db_web_trail *trail, const char *name, const char *text)
{
	struct db_client_error error = { .parameters = NULL };

	drop_link(trail);
	db_client_error_set(&error, name, "%s", text);
	if (trail->first)
		trail->first->take(trail->first, NULL, &error);
	db_client_error_clear(&error);
}

static void on_page(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	struct db_web_trail *trail = data;

	(void)more;
	trail->asked = false;
	trail->first->take(trail->first, parameters, error);
}

void db_web_trail_ask(struct db_web_trail *trail, json_t *query)
{
	struct db_client_error error = { .parameters = NULL };

	if (!trail->link && !trail->ended)
		trail->link = db_web_service_open(trail->server->service, drop_link, trail, &error);
	if (!trail->link)
		json_decref(query);
	else
		trail->asked = db_link_send(trail->link, "Audit", query, false, on_page, trail) ==
		               0;
	trail->answer_by = db_client_now() + ANSWER_WITHIN;
	if (!trail->asked)
		fail(trail, DB_CLIENT_UNREACHABLE,
		     error.text[0] ? error.text : "drivebridged cannot be reached");
	db_client_error_clear(&error);
}

void db_web_trail_enter(struct db_web_trail *trail, struct db_web_trail_reader *reader)
{
	struct db_web_trail_reader **at = &trail->first;

	while (*at)
		at = &(*at)->next;
	*at = reader;
	reader->next = NULL;
	if (trail->first == reader)
		reader->turn(reader);
}

void db_web_trail_leave(struct db_web_trail *trail, struct db_web_trail_reader *reader)
{
	struct db_web_trail_reader **at = &trail->first;
	bool had_turn = trail->first == reader;

	while (*at && *at != reader)
		at = &(*at)->next;
	if (!*at)
		return;
	*at = reader->next;
	if (!had_turn)
		return;
	/* A page that is still to come is nobody's. */
	if (trail->asked || !trail->first)
		drop_link(trail);
	if (trail->first)
		trail->first->turn(trail->first);
}

void db_web_trail_end(struct db_web_trail *trail)
{
	if (!trail)
		return;
	trail->ended = true;
	if (trail->first)
		fail(trail, DB_CLIENT_LOST, "this server is being stopped");
}

void db_web_trail_tick(struct db_web_trail *trail, db_time now)
{
	if (trail->asked && now >= trail->answer_by)
		fail(trail, DB_CLIENT_TIMEOUT, "the service does not read the trail in time");
}
