/* SPDX-License-Identifier: Apache-2.0 */
#include "web/commission.h"
#include "client/log.h"
#include "commission/round.h"
#include "web/call.h"
#include "web/round.h"
#include "web/service.h"
#include "web/stream.h"
#include "web/tabs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>

#define DRIVE_MAX 64

struct db_web_commission {
	struct db_web_commission *next;
	struct db_web_server *server;
	struct db_web_round *round;
	sd_event_source *told;
	struct db_web_stream *stream; /* NULL: the page is closed */
	struct db_web_caller caller;
	char tab[DB_WEB_TAB_MAX + 1];
	char session[DB_WEB_SECRET_TEXT];
	char drive[DRIVE_MAX];
	db_time heard;
};

static void leave(struct db_web_commission *commission, const char *why)
{
	db_client_log(DB_CLIENT_NOTICE, "%s: commissioning of %s is ended: %s",
	              commission->caller.text, commission->drive, why);
	db_web_round_end(commission->round);
}

static void lose_page(void *data)
{
	struct db_web_commission *commission = data;

	commission->stream = NULL;
	leave(commission, "its page is gone");
}

static void dispose(struct db_web_commission *commission)
{
	struct db_web_commission **at = &commission->server->commissions;

	db_client_log(DB_CLIENT_NOTICE, "%s: commissioning of %s ended%s", commission->caller.text,
	              commission->drive,
	              db_web_round_is_late(commission->round) ?
	                      ": its page was not heard in time while it moved" :
	                      "");
	while (*at && *at != commission)
		at = &(*at)->next;
	if (*at)
		*at = commission->next;
	sd_event_source_disable_unref(commission->told);
	db_web_round_free(commission->round);
	if (commission->stream)
		db_web_stream_finish(commission->stream);
	free(commission);
}

static int on_told(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_web_commission *commission = data;
	const char *event;
	char *json;
	bool over;

	(void)source;
	(void)fd;
	(void)events;
	while (db_web_round_take(commission->round, &event, &json, &over)) {
		if (commission->stream)
			db_web_stream_feed(commission->stream, event, json);
		free(json);
	}
	if (over)
		dispose(commission);
	return 0;
}

/* --- requests of pages ------------------------------------------------------------------------ */

/* False: the request is answered with the mistake. */
static bool read_order(struct db_web_request *request, struct db_web_round_order *order)
{
	const json_t *step = json_object_get(request->parameters, "step");
	const json_t *velocity = json_object_get(request->parameters, "velocity");
	const json_t *seconds = json_object_get(request->parameters, "seconds");

	*order = (struct db_web_round_order){
		.socket = request->server->config->socket,
		.user = request->user,
		.drive = json_string_value(json_object_get(request->parameters, "drive")),
		.only = json_is_string(step) ? db_commission_find(json_string_value(step)) : -1,
		.velocity = json_number_value(velocity),
		.seconds = json_number_value(seconds),
	};
	if (order->drive && strlen(order->drive) < DRIVE_MAX && request->tab[0] != '\0' &&
	    (!step || order->only >= 0) &&
	    (!velocity || (json_is_number(velocity) && order->velocity > 0)) &&
	    (!seconds || (order->seconds >= DB_COMMISSION_SHORTEST_S &&
	                  order->seconds <= DB_COMMISSION_LONGEST_S)))
		return true;
	db_web_request_refuse(
		request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		"a commissioning is {\"drive\": ..., \"step\": one of the list, or all "
		"without it, \"velocity\": above 0, \"seconds\": %g to %g}, from a page "
		"with X-Tab",
		DB_COMMISSION_SHORTEST_S, DB_COMMISSION_LONGEST_S);
	return false;
}

/* False: the request is answered with the user that commissions now. */
static bool has_room(struct db_web_request *request, const char *drive)
{
	unsigned count = 0;

	for (const struct db_web_commission *one = request->server->commissions; one;
	     one = one->next) {
		count++;
		if (strcmp(one->drive, drive) != 0)
			continue;
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "%s is at %s already", one->caller.text, drive);
		return false;
	}
	if (count < DB_WEB_COMMISSIONS_MAX)
		return true;
	db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
	                      "%u drives are commissioned already; end one", count);
	return false;
}

static void begin(struct db_web_request *request)
{
	struct db_web_server *server = request->server;
	struct db_web_commission *commission;
	struct db_web_round_order order;

	if (!read_order(request, &order) || !has_room(request, order.drive))
		return;
	commission = calloc(1, sizeof(*commission));
	if (commission)
		commission->round = db_web_round_new(&order);
	if (!commission || !commission->round) {
		free(commission);
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	commission->server = server;
	commission->caller = db_web_request_caller(request);
	commission->heard = db_client_now();
	snprintf(commission->tab, sizeof(commission->tab), "%s", request->tab);
	snprintf(commission->session, sizeof(commission->session), "%s", request->session);
	snprintf(commission->drive, sizeof(commission->drive), "%s", order.drive);
	commission->next = server->commissions;
	server->commissions = commission;
	/* NULL: the request was answered with the reason. */
	commission->stream = db_web_stream_begin_own(request, NULL, lose_page, commission);
	if (!commission->stream ||
	    sd_event_add_io(server->loop, &commission->told, db_web_round_fd(commission->round),
	                    EPOLLIN, on_told, commission) < 0)
		dispose(commission);
}

static void hear(struct db_web_request *request)
{
	struct db_web_server *server = request->server;
	struct db_web_commission *commission = server->commissions;
	const json_t *parameters = request->parameters;
	const char *answer = json_string_value(json_object_get(parameters, "answer"));
	const char *token = json_string_value(json_object_get(parameters, "token"));
	json_int_t motion = json_integer_value(json_object_get(parameters, "motion"));
	json_int_t question = json_integer_value(json_object_get(parameters, "question"));
	db_time now = db_client_now();

	while (commission && (strcmp(commission->tab, request->tab) != 0 ||
	                      strcmp(commission->session, request->session) != 0))
		commission = commission->next;
	if (!commission) {
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "NotHeld",
		                      "this page commissions no drive, or not any more");
		return;
	}
	commission->heard = now;
	/* A confirmation that is too old holds nothing. */
	if (motion > 0 && token &&
	    db_web_tokens_age(&server->service->tokens, token, now) <= DB_WEB_TOKEN_FRESH)
		db_web_round_hold(commission->round, (uint64_t)motion, token, now);
	if (json_is_true(json_object_get(parameters, "end")))
		leave(commission, "by its page");
	if (answer) {
		db_web_sessions_touch(server->sessions, request->session, now);
		db_web_log_action(request, "answer", request->parameters);
	}
	if (answer && !db_web_round_answer(commission->round, (uint64_t)question, answer))
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "BadAnswer",
		                      "that is not asked now, or \"%s\" is no answer to it",
		                      answer);
	else
		db_web_request_answer(request, MHD_HTTP_OK, json_object());
}

void db_web_commission_take(struct db_web_request *request)
{
	json_t *steps;

	switch (request->route.kind) {
	case DB_WEB_COMMISSION:
		db_web_log_action(request, request->route.name, request->parameters);
		begin(request);
		break;
	case DB_WEB_COMMISSION_SAY:
		hear(request);
		break;
	default:
		steps = json_array();
		for (const struct db_commission_step *step = db_commission_list; step->name; step++)
			(void)json_array_append_new(
				steps, json_pack("{s:s, s:b, s:b, s:s}", "step", step->name,
			                         "moves", step->moves, "chosen", step->chosen,
			                         "description", step->description));
		db_web_request_answer(request, MHD_HTTP_OK, json_pack("{s:o}", "steps", steps));
	}
}

/* --- ends ------------------------------------------------------------------------------------- */

void db_web_commission_yield(struct db_web_server *server, const char *drive)
{
	for (struct db_web_commission *one = server->commissions; one; one = one->next) {
		if (!drive || strcmp(one->drive, drive) == 0)
			leave(one, "a stop");
	}
}

void db_web_commission_tick(struct db_web_server *server, db_time now)
{
	for (struct db_web_commission *one = server->commissions; one; one = one->next) {
		if (!one->stream || now - one->heard < DB_WEB_TAB_SILENT)
			continue;
		one->heard = now;
		leave(one, "its page is silent");
	}
}

void db_web_commission_free(struct db_web_server *server)
{
	while (server->commissions) {
		struct db_web_commission *commission = server->commissions;

		server->commissions = commission->next;
		dispose(commission);
	}
}
