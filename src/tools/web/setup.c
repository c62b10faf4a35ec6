/* SPDX-License-Identifier: Apache-2.0 */
#include "web/setup.h"
#include "client/link.h"
#include "client/log.h"
#include "setup/move.h"
#include "web/call.h"
#include "web/service.h"
#include "web/stream.h"
#include "web/tabs.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ANSWER_WITHIN (30 * DB_NS_PER_S)
#define NUMBER_MOST 4000000

struct db_web_setup {
	struct db_web_setup *next;
	struct db_web_server *server;
	struct db_web_caller caller;
	struct db_web_stream *stream; /* NULL: the page has closed it */
	struct db_web_request *page;  /* valid as long as the stream */
	json_t *bus;
	struct db_setup_move move;
	struct db_link *scan; /* closing it ends a scan; NULL: none goes on */
	json_t *finds;
	bool setting; /* an answer of the service is awaited, which frees it if it has ended */
	bool ended;
	bool stopping;       /* the user has ended it while the service was setting */
	json_int_t question; /* the number of the latest */
	bool asks;
	db_time until; /* of a pause, or of an answer; DB_TIME_NEVER */
};

static void go_on(struct db_web_setup *setup);

static void dispose(struct db_web_setup *setup)
{
	struct db_web_setup **at = &setup->server->setups;

	while (*at && *at != setup)
		at = &(*at)->next;
	if (*at)
		*at = setup->next;
	json_decref(setup->bus);
	json_decref(setup->finds);
	db_client_error_clear(&setup->move.error);
	free(setup);
}

static void end_scan(struct db_web_setup *setup)
{
	db_link_drop(setup->scan);
	setup->scan = NULL;
}

/* It could not be done; goes on with what is said about that. */
static void fail(struct db_web_setup *setup, const char *name, const char *text)
{
	struct db_client_error error = { .parameters = NULL };

	db_client_error_set(&error, name, "%s", text);
	(void)db_setup_move_fail(&setup->move, &error);
	db_client_error_clear(&error);
	go_on(setup);
}

/* --- looking ---------------------------------------------------------------------------------- */

static void lose_scan(void *data)
{
	struct db_web_setup *setup = data;

	end_scan(setup);
	fail(setup, DB_CLIENT_LOST, "the service has closed the connection");
}

static void take_finds(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct db_web_setup *setup = data;

	if (error) {
		/* A lost connection is reported by lose_scan(), too. */
		end_scan(setup);
		(void)db_setup_move_fail(&setup->move, error);
		go_on(setup);
		return;
	}
	(void)json_array_extend(setup->finds, json_object_get(parameters, "finds"));
	if (more)
		return;
	end_scan(setup);
	db_setup_move_take(&setup->move, setup->finds, false, db_client_now());
	go_on(setup);
}

static void look(struct db_web_setup *setup, const struct db_setup_action *action)
{
	json_t *parameters = json_pack("{s:s, s:I, s:I}", "bus", db_words_text(setup->bus, "name"),
	                               "first", action->address, "last", action->address);
	struct db_client_error error = { .parameters = NULL };

	if (action->speed != 0)
		(void)json_object_set_new(parameters, "speeds", json_pack("[I]", action->speed));
	(void)json_array_clear(setup->finds);
	setup->scan = db_web_service_open(setup->server->service, lose_scan, setup, &error);
	if (!setup->scan)
		json_decref(parameters);
	if (!setup->scan ||
	    db_link_send(setup->scan, "Scan", parameters, true, take_finds, setup) != 0) {
		end_scan(setup);
		fail(setup, DB_CLIENT_UNREACHABLE, "drivebridged cannot be reached");
	}
	db_client_error_clear(&error);
}

/* --- setting ---------------------------------------------------------------------------------- */

static void take_setting(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_web_setup *setup = data;

	(void)parameters;
	(void)more;
	setup->setting = false;
	setup->until = DB_TIME_NEVER;
	if (setup->ended) {
		dispose(setup);
		return;
	}
	if (error)
		db_client_log(DB_CLIENT_NOTICE, "%s: SetUp failed: %s", setup->caller.text,
		              error->text);
	if (error)
		(void)db_setup_move_fail(&setup->move, error);
	else
		db_setup_move_take(&setup->move, NULL, false, db_client_now());
	if (setup->stopping && !error)
		fail(setup, "io.drivebridge.Client.Interrupted", "it was ended");
	else
		go_on(setup);
}

/* Over the page's own connection: what other clients control is refused. */
static void set(struct db_web_setup *setup, const struct db_setup_action *action)
{
	const char *why = NULL;
	struct db_link *link = db_web_tabs_link(setup->page, NULL, &why);
	json_t *parameters;

	if (why) {
		fail(setup, "io.drivebridge.Client.Interrupted", why);
		return;
	}
	parameters = json_pack("{s:s, s:I, s:s}", "bus", db_words_text(setup->bus, "name"),
	                       "address", action->address, "what", action->what);
	if (action->has_value)
		(void)json_object_set_new(parameters, "value", json_integer(setup->move.to));
	if (action->speed != 0)
		(void)json_object_set_new(parameters, "speeds", json_pack("[I]", action->speed));
	db_web_log_action(setup->page, "SetUp", parameters);
	setup->until = db_client_now() + ANSWER_WITHIN;
	setup->setting = true;
	if (db_link_send(link, "SetUp", parameters, false, take_setting, setup) == 0)
		return;
	setup->setting = false;
	fail(setup, DB_CLIENT_LOST, "drivebridged cannot be reached");
}

/* --- what comes next -------------------------------------------------------------------------- */

static void finish(struct db_web_setup *setup)
{
	struct db_web_stream *stream = setup->stream;

	setup->stream = NULL;
	if (stream)
		db_web_stream_finish(stream);
	setup->ended = true;
	end_scan(setup);
	if (!setup->setting)
		dispose(setup);
}

/* Until something is awaited, or it has ended. */
static void go_on(struct db_web_setup *setup)
{
	for (;;) {
		struct db_setup_action action = db_setup_move_next(&setup->move, db_client_now());

		switch (action.kind) {
		case DB_SETUP_LOOK:
			look(setup, &action);
			return;
		case DB_SETUP_SET:
			set(setup, &action);
			return;
		case DB_SETUP_SAY:
			db_web_stream_tell(setup->stream, "say",
			                   json_pack("{s:s, s:s}", "text", action.text,
			                             "configuration", action.configuration));
			break;
		case DB_SETUP_ASK:
			setup->asks = true;
			db_web_stream_tell(
				setup->stream, "ask",
				json_pack("{s:I, s:s, s:s}", "question", ++setup->question, "text",
			                  action.text, "yes",
			                  action.question ? action.question : "it was off and on"));
			return;
		case DB_SETUP_PAUSE:
			setup->until = db_client_now() + DB_SETUP_PAUSE_MS * DB_NS_PER_MS;
			return;
		case DB_SETUP_FAIL:
			db_web_stream_tell(setup->stream, "problem",
			                   json_pack("{s:s, s:s}", "error", action.error, "text",
			                             action.text));
			break;
		case DB_SETUP_END:
		default:
			finish(setup);
			return;
		}
	}
}

/* --- requests of pages ------------------------------------------------------------------------ */

static void lose_page(void *data)
{
	struct db_web_setup *setup = data;

	setup->stream = NULL;
	finish(setup);
}

static bool is_number(const json_t *value)
{
	return json_is_integer(value) && json_integer_value(value) >= 0 &&
	       json_integer_value(value) <= NUMBER_MOST;
}

/* False: the request is answered with the mistake. */
static bool read_move(struct db_web_request *request, struct db_setup_move *move)
{
	const json_t *parameters = request->parameters;
	const json_t *description = request->server->service->description;
	const char *bus = db_words_text(parameters, "bus");
	const char *what = db_words_text(parameters, "what");
	const json_t *from = json_object_get(parameters, "from");
	const json_t *to = json_object_get(parameters, "to");
	const json_t *speed = json_object_get(parameters, "speed");
	const char *mistake;

	*move = (struct db_setup_move){
		.bus = db_words_look_up(json_object_get(description, "buses"), bus),
		.is_address = strcmp(what, "address") == 0,
		.from = json_integer_value(from),
		.to = json_integer_value(to),
		.speed = json_integer_value(speed),
		.on_page = true,
	};
	if ((!move->is_address && strcmp(what, "speed") != 0) || !is_number(from) ||
	    !is_number(to) || (speed && !is_number(speed))) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "right is {\"bus\": ..., \"what\": address or speed, "
		                      "\"from\": its address, \"to\": ..., \"speed\": at which it "
		                      "communicates now, 0 for the bus's}");
		return false;
	}
	if (!move->bus) {
		db_web_request_refuse(request, MHD_HTTP_NOT_FOUND, "NoSuchBus",
		                      "no bus is called \"%.64s\"", bus);
		return false;
	}
	mistake = db_setup_move_check(move);
	if (mistake)
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadValue", "%s", mistake);
	return !mistake;
}

void db_web_setup_begin(struct db_web_request *request)
{
	struct db_web_server *server = request->server;
	struct db_web_setup *setup;
	struct db_setup_move move;

	if (!read_move(request, &move))
		return;
	if (server->setups) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "%s sets up a drive already", server->setups->caller.text);
		return;
	}
	if (!db_web_tabs_begin(request, NULL))
		return;
	setup = calloc(1, sizeof(*setup));
	if (!setup) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	setup->server = server;
	setup->caller = db_web_request_caller(request);
	setup->move = move;
	setup->page = request;
	setup->until = DB_TIME_NEVER;
	setup->finds = json_array();
	/* The description may change meanwhile. */
	setup->bus = json_deep_copy(move.bus);
	setup->move.bus = setup->bus;
	setup->next = server->setups;
	server->setups = setup;
	setup->stream = db_web_stream_begin_own(request, NULL, lose_page, setup);
	if (setup->stream && setup->bus && setup->finds)
		go_on(setup);
	else
		finish(setup);
}

void db_web_setup_hear(struct db_web_request *request)
{
	struct db_web_setup *setup = request->server->setups;
	json_int_t question = json_integer_value(json_object_get(request->parameters, "question"));
	bool ends = json_is_true(json_object_get(request->parameters, "end"));

	while (setup && (!setup->stream || strcmp(setup->page->tab, request->tab) != 0 ||
	                 strcmp(setup->page->session, request->session) != 0))
		setup = setup->next;
	if (!setup || (!ends && (!setup->asks || question != setup->question))) {
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "BadAnswer",
		                      "that is not asked now");
		return;
	}
	db_web_log_action(request, "setup", request->parameters);
	db_web_request_answer(request, MHD_HTTP_OK, json_object());
	setup->asks = false;
	if (!ends) {
		db_setup_move_take(&setup->move, NULL,
		                   json_is_true(json_object_get(request->parameters, "yes")),
		                   db_client_now());
		go_on(setup);
	} else if (setup->setting) {
		setup->stopping = true;
	} else {
		end_scan(setup);
		setup->until = DB_TIME_NEVER;
		fail(setup, "io.drivebridge.Client.Interrupted", "it was ended");
	}
}

void db_web_setup_tick(struct db_web_server *server, db_time now)
{
	struct db_web_setup *next;

	for (struct db_web_setup *setup = server->setups; setup; setup = next) {
		next = setup->next;
		if (setup->ended || now < setup->until)
			continue;
		setup->until = DB_TIME_NEVER;
		if (setup->setting) {
			/* A late answer changes nothing any more. */
			db_web_stream_tell(
				setup->stream, "problem",
				json_pack("{s:s, s:s}", "error", "NoAnswer", "text",
			                  "the service does not answer in time; a scan shows where "
			                  "the drive is"));
			finish(setup);
		} else {
			db_setup_move_take(&setup->move, NULL, false, now);
			go_on(setup);
		}
	}
}

void db_web_setup_free(struct db_web_server *server)
{
	while (server->setups) {
		struct db_web_setup *setup = server->setups;

		server->setups = setup->next;
		db_link_drop(setup->scan);
		dispose(setup);
	}
}
