/* SPDX-License-Identifier: Apache-2.0 */
#include "web/tabs.h"
#include "web/call.h"
#include "web/commission.h"
#include "web/jog.h"
#include "web/order.h"
#include "web/sequence.h"
#include "web/service.h"
#include "web/stops.h"
#include "web/stream.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Pages that act, and those that have left while what they moved is being stopped. */
#define LANES_MAX (4 * DB_WEB_TABS_MAX)

/* Drives that move are read at each tick. */
#define INTERVAL (DB_WEB_CONNECTIONS_TICK / 2)

/* An acting call is answered when the drive has confirmed it; one that waits for the end of a
 * motion, at that end. */
#define ACT_WITHIN (15 * DB_NS_PER_S)
#define MOTION_WITHIN (600 * DB_NS_PER_S)

struct db_web_tab {
	struct db_web_tab *next;
	struct db_web_server *server;
	char id[DB_WEB_TAB_MAX + 1];
	char session[DB_WEB_SECRET_TEXT];
	struct db_lane *lane;
	struct db_web_jog *jog;
	struct db_web_sequence *sequence;
	struct db_web_order order;
	bool lost;
	bool leaves; /* no more calls are taken from it */
	db_time heard;
};

const char *db_web_tabs_judge(const char *tab, const char *call)
{
	size_t length = tab ? strlen(tab) : 0;

	if (tab && (length < 16 || length > DB_WEB_TAB_MAX ||
	            strspn(tab, "0123456789abcdefABCDEF") != length))
		return "X-Tab is 16 to 32 hexadecimal digits";
	length = call ? strlen(call) : 0;
	/* The integers that JavaScript represents exactly. */
	if (call &&
	    (length < 1 || length > 15 || strspn(call, "0123456789") != length || call[0] == '0'))
		return "X-Call is a number from 1";
	return NULL;
}

static void free_tab(struct db_web_tab *tab)
{
	for (struct db_web_tab **at = &tab->server->tabs; *at; at = &(*at)->next) {
		if (*at == tab) {
			*at = tab->next;
			break;
		}
	}
	if (tab->jog)
		db_web_jog_lose(tab->jog);
	if (tab->sequence)
		db_web_sequence_lose(tab->sequence);
	db_lane_close(tab->lane);
	db_web_sequence_free(tab->sequence);
	db_web_jog_free(tab->jog);
	free(tab);
}

static struct db_web_tab *find_tab(const struct db_web_request *request)
{
	struct db_web_tab *tab = request->server->tabs;

	while (tab && (tab->lost || tab->leaves || strcmp(tab->id, request->tab) != 0 ||
	               strcmp(tab->session, request->session) != 0))
		tab = tab->next;
	return tab;
}

/* NULL with the reason in `error`. */
static struct db_web_tab *open_tab(const struct db_web_request *request,
                                   struct db_client_error *error)
{
	struct db_web_tab *tab = find_tab(request);
	unsigned count = 0;

	if (tab)
		return tab;
	for (tab = request->server->tabs; tab; tab = tab->next)
		count += !tab->leaves && !tab->lost;
	if (count >= DB_WEB_TABS_MAX) {
		db_client_error_set(error, DB_CLIENT_SERVICE "Busy",
		                    "%u pages command drives already; close one", count);
		return NULL;
	}
	tab = calloc(1, sizeof(*tab));
	if (!tab) {
		db_client_error_set(error, DB_CLIENT_NO_MEMORY, "no memory");
		return NULL;
	}
	tab->server = request->server;
	tab->next = request->server->tabs;
	request->server->tabs = tab;
	snprintf(tab->id, sizeof(tab->id), "%s", request->tab);
	snprintf(tab->session, sizeof(tab->session), "%s", request->session);
	tab->heard = db_client_now();
	tab->lane = db_lanes_open(request->server->lanes, error);
	if (tab->lane) {
		struct db_web_caller caller = db_web_request_caller(request);

		db_link_introduce(tab->lane->link, caller.user, caller.from, NULL, NULL);
		tab->jog = db_web_jog_new(tab->server, tab->lane->link);
		tab->sequence = db_web_sequence_new(tab->server, tab->lane->link);
	}
	if (tab->jog && tab->sequence)
		return tab;
	if (error->name[0] == '\0')
		db_client_error_set(error, DB_CLIENT_NO_MEMORY, "no memory");
	free_tab(tab);
	return NULL;
}

/* --- lanes ------------------------------------------------------------------------------------ */

static struct db_web_tab *find_tab_of(const struct db_web_server *server,
                                      const struct db_lane *lane)
{
	struct db_web_tab *tab = server->tabs;

	while (tab && tab->lane != lane)
		tab = tab->next;
	return tab;
}

static void lose(void *context, struct db_lane *lane)
{
	struct db_web_tab *tab = find_tab_of(context, lane);

	if (tab)
		tab->lost = true;
}

static bool see(void *context, struct db_lane *lane, const char *drive, const json_t *values)
{
	const struct db_web_server *server = context;
	const struct db_web_tab *tab = find_tab_of(server, lane);
	bool moves = db_web_service_is_moving(server->service,
	                                      json_object_get(values, "axis_state"));

	if (tab)
		db_web_jog_see(tab->jog, drive, moves);
	return moves;
}

struct db_lanes *db_web_tabs_make_lanes(struct db_web_server *server)
{
	const struct db_lanes_form form = {
		.socket = server->config->socket,
		.most = LANES_MAX,
		.stops = DB_WEB_STOPS_MAX,
		.interval = INTERVAL,
		.lost = lose,
		.seen = see,
	};

	return db_lanes_new(server->loop, &form, server);
}

/* --- acting ----------------------------------------------------------------------------------- */

/* True for a stop, and of which drive; NULL: of several. */
static bool is_stop(const struct db_web_request *request, const char **drive)
{
	const char *command = json_string_value(json_object_get(request->parameters, "command"));
	const json_t *values = json_object_get(request->parameters, "values");

	*drive = json_string_value(json_object_get(request->parameters, "drive"));
	if (strcmp(request->route.name, "Write") == 0 && *drive && (*drive)[0] == '\0') {
		*drive = NULL;
		return json_object_get(values, "group_stop") ||
		       json_object_get(values, "group_stop_units");
	}
	return strcmp(request->route.name, "Run") == 0 && *drive && command &&
	       db_plant_is_stop(request->server->service->plant, command);
}

/* Past all waiting calls; and repeated after them if a motion may be waiting. */
static void stop(struct db_web_request *request, const char *drive)
{
	struct db_web_tab *tab = find_tab(request);
	bool waits = tab && db_link_waiting(tab->lane->link) > 0;
	bool is_new = db_web_stops_call(request, ACT_WITHIN);

	if (waits && is_new)
		(void)db_link_tell(tab->lane->link, request->route.name,
		                   json_incref(request->parameters));
	if (tab) {
		db_web_jog_yield(tab->jog, drive);
		db_web_sequence_yield(tab->sequence, drive);
	}
	db_web_commission_yield(request->server, drive);
	/* Calls that the page sent before the stop and that arrive after it are not carried out,
	 * even if one of them is the page's first. */
	if (!tab && request->tab[0] != '\0' && request->call != 0) {
		struct db_client_error error = { .parameters = NULL };

		tab = open_tab(request, &error);
		db_client_error_clear(&error);
	}
	if (tab)
		db_web_order_stop(&tab->order, request->call);
}

/* The page's tab, marked as alive; NULL when the request has been answered with the reason. */
static struct db_web_tab *require_tab(struct db_web_request *request)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_web_tab *tab = NULL;

	if (request->tab[0] == '\0' || request->call == 0) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "what acts tells its page and the number of the call there: "
		                      "X-Tab, 16 to 32 hexadecimal digits, and X-Call, from 1");
		return NULL;
	}
	tab = open_tab(request, &error);
	if (tab)
		tab->heard = db_client_now();
	else
		db_web_request_fail(request, &error);
	db_client_error_clear(&error);
	return tab;
}

struct db_link *db_web_tabs_begin(struct db_web_request *request, const char *drive)
{
	struct db_web_tab *tab = require_tab(request);

	if (!tab)
		return NULL;
	switch (db_web_order_take(&tab->order, request->call)) {
	case DB_WEB_TURN_REPEATED:
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "Repeated",
		                      "this call came before and is not carried out again; the "
		                      "history of the drive tells how it ended");
		return NULL;
	case DB_WEB_TURN_OVERTAKEN:
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "Overtaken",
		                      "a stop overtook this call, and it was not carried out");
		return NULL;
	case DB_WEB_TURN_NOW:
	default:
		break;
	}
	if (drive)
		(void)db_lane_command(tab->lane, drive, db_client_now());
	return tab->lane->link;
}

void db_web_tabs_act(struct db_web_request *request)
{
	bool to_end = json_is_true(json_object_get(request->parameters, "until_end"));
	struct db_link *link;
	const char *drive;

	/* The page asks for checks while somebody types. */
	if (request->route.kind != DB_WEB_CONFIGURATION ||
	    strcmp(request->route.name, "SetConfiguration") == 0)
		db_web_log_action(request, request->route.name, request->parameters);
	if (is_stop(request, &drive)) {
		stop(request, drive);
		return;
	}
	link = db_web_tabs_begin(request, drive && drive[0] != '\0' ? drive : NULL);
	if (link)
		db_web_call(request, link, to_end ? MOTION_WITHIN : ACT_WITHIN);
}

struct db_link *db_web_tabs_link(const struct db_web_request *request, const char *drive,
                                 const char **why)
{
	struct db_web_tab *tab = find_tab(request);

	if (!tab) {
		*why = "the page has left, or its connection is lost";
		return NULL;
	}
	if (db_web_order_is_overtaken(&tab->order, request->call))
		*why = "a stop overtook it";
	else if (drive)
		(void)db_lane_command(tab->lane, drive, db_client_now());
	return tab->lane->link;
}

void db_web_tabs_jog(struct db_web_request *request)
{
	const char *drive = json_string_value(json_object_get(request->parameters, "drive"));
	struct db_web_tab *tab = require_tab(request);

	if (!tab)
		return;
	/* Beats have an order of their own within their press. A release is never too late. */
	if (db_web_order_is_overtaken(&tab->order, request->call) &&
	    json_number_value(json_object_get(request->parameters, "velocity")) != 0.0)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:b, s:s, s:s, s:s}", "held", 0, "why", "stopped",
		                                "text", "", "result", ""));
	else if (json_number_value(json_object_get(request->parameters, "velocity")) != 0.0 &&
	         !db_web_sequence_is_over(tab->sequence, db_client_now()))
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:b, s:s, s:s, s:s}", "held", 0, "why", "refused",
		                                "text", "a sequence is held, or is being stopped",
		                                "result", ""));
	else if (db_web_jog_take(tab->jog, request))
		(void)db_lane_command(tab->lane, drive, db_client_now());
}

void db_web_tabs_sequence(struct db_web_request *request)
{
	struct db_web_tab *tab = require_tab(request);
	bool held = json_is_true(json_object_get(request->parameters, "held"));
	const char *drive;

	if (!tab)
		return;
	if (held && db_web_order_is_overtaken(&tab->order, request->call)) {
		db_web_request_answer(
			request, MHD_HTTP_OK,
			json_pack("{s:b, s:s, s:s}", "held", 0, "why", "stopped", "text", ""));
	} else if (held && !db_web_jog_is_over(tab->jog, db_client_now())) {
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:b, s:s, s:s}", "held", 0, "why", "refused",
		                                "text", "a drive is jogged, or is being stopped"));
	} else {
		drive = db_web_sequence_take(tab->sequence, request);
		if (drive)
			(void)db_lane_command(tab->lane, drive, db_client_now());
	}
}

void db_web_tabs_keep_alive(struct db_web_request *request)
{
	struct db_web_tab *tab = find_tab(request);

	if (tab)
		tab->heard = db_client_now();
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:b, s:I}", "acting", tab != NULL, "moment",
	                                (json_int_t)db_web_moment()));
}

/* --- leaving ---------------------------------------------------------------------------------- */

static void leave(struct db_web_tab *tab, enum db_web_grip_end end)
{
	tab->leaves = true;
	db_web_jog_end(tab->jog, end);
	db_web_sequence_end(tab->sequence, end);
}

void db_web_tabs_tick(struct db_web_server *server, db_time now)
{
	struct db_web_tab *next;

	for (struct db_web_tab *tab = server->tabs; tab; tab = next) {
		next = tab->next;
		if (!tab->leaves && !db_web_sessions_find(server->sessions, tab->session, now))
			leave(tab, DB_WEB_GRIP_LOGOUT);
		else if (!tab->leaves && now - tab->heard >= DB_WEB_TAB_SILENT)
			leave(tab, DB_WEB_GRIP_OVERDUE);
		db_web_jog_tick(tab->jog, now);
		db_web_sequence_tick(tab->sequence, now);
		if (tab->lost || (tab->leaves && db_web_jog_is_over(tab->jog, now) &&
		                  db_web_sequence_is_over(tab->sequence, now)))
			free_tab(tab);
		else if (!tab->leaves)
			db_lane_feed(tab->lane, now);
	}
}

void db_web_tabs_leave(struct db_web_server *server, const char *session, enum db_web_grip_end end)
{
	for (struct db_web_tab *tab = server->tabs; tab; tab = tab->next) {
		if (!session || strcmp(tab->session, session) == 0)
			leave(tab, end);
	}
}

void db_web_tabs_close(struct db_web_server *server)
{
	while (server->tabs) {
		struct db_web_tab *tab = server->tabs;

		server->tabs = tab->next;
		free_tab(tab);
	}
}
