/* SPDX-License-Identifier: Apache-2.0 */
#include "web/trail.h"
#include "client/link.h"
#include "web/service.h"

#include <stdlib.h>

/* A page is some milliseconds of work for the service; a disk that fails takes seconds. */
#define ANSWER_WITHIN (10 * DB_NS_PER_S)

/* Closes the link; also called when it is lost, after its question was answered with an error. */
static void drop_link(void *data)
{
	struct db_web_trail *trail = &((struct db_web_server *)data)->trail;
	struct db_link *link = trail->link;

	trail->link = NULL;
	trail->asked = false;
	db_link_drop(link);
}

static void fail(struct db_web_server *server, const char *name, const char *text)
{
	struct db_client_error error = { .parameters = NULL };

	drop_link(server);
	db_client_error_set(&error, name, "%s", text);
	if (server->trail.first)
		server->trail.first->take(server->trail.first, NULL, &error);
	db_client_error_clear(&error);
}

static void on_page(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	struct db_web_trail *trail = &((struct db_web_server *)data)->trail;

	(void)more;
	trail->asked = false;
	trail->first->take(trail->first, parameters, error);
}

void db_web_trail_ask(struct db_web_server *server, json_t *query)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_web_trail *trail = &server->trail;

	if (!trail->link && !trail->ended)
		trail->link = db_web_service_open(server->service, drop_link, server, &error);
	if (!trail->link)
		json_decref(query);
	else
		trail->asked = db_link_send(trail->link, "Audit", query, false, on_page, server) ==
		               0;
	trail->answer_by = db_client_now() + ANSWER_WITHIN;
	if (!trail->asked)
		fail(server, DB_CLIENT_UNREACHABLE,
		     error.text[0] ? error.text : "drivebridged cannot be reached");
	db_client_error_clear(&error);
}

void db_web_trail_enter(struct db_web_server *server, struct db_web_trail_reader *reader)
{
	struct db_web_trail_reader **at = &server->trail.first;

	while (*at)
		at = &(*at)->next;
	*at = reader;
	reader->next = NULL;
	if (server->trail.first == reader)
		reader->turn(reader);
}

void db_web_trail_leave(struct db_web_server *server, struct db_web_trail_reader *reader)
{
	struct db_web_trail *trail = &server->trail;
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
		drop_link(server);
	if (trail->first)
		trail->first->turn(trail->first);
}

void db_web_trail_end(struct db_web_server *server)
{
	server->trail.ended = true;
	if (server->trail.first)
		fail(server, DB_CLIENT_LOST, "this server is being stopped");
}

void db_web_trail_tick(struct db_web_server *server, db_time now)
{
	if (server->trail.asked && now >= server->trail.answer_by)
		fail(server, DB_CLIENT_TIMEOUT, "the service does not read the trail in time");
}
