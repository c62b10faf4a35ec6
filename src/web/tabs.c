/* SPDX-License-Identifier: Apache-2.0 */
#include "web/tabs.h"
#include "web/call.h"
#include "web/service.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Drives that one page feeds at the same time. */
#define DRIVES_MAX 32
#define DRIVE_NAME_MAX 64

/* A drive that was commanded counts as moving for so long, whatever it shows. */
#define BEGINS_WITHIN (3 * DB_NS_PER_S)

/* A call that acts is answered when the drive has confirmed it; one that waits for the end of a motion, with that. */
#define ACT_WITHIN (15 * DB_NS_PER_S)
#define MOTION_WITHIN (600 * DB_NS_PER_S)

struct drive {
	struct db_web_tab *tab;
	char name[DRIVE_NAME_MAX]; /* "": the place is free */
	db_time commanded;
	bool moves;
	bool asking;
};

struct db_web_tab {
	struct db_web_tab *next;
	struct db_web_server *server;
	char id[DB_WEB_TAB_MAX + 1];
	char session[DB_WEB_SECRET_TEXT];
	struct db_web_link *act;
	struct db_web_link *stop;
	bool lost;
	db_time heard;
	struct drive drives[DRIVES_MAX];
};

bool db_web_tab_is_good(const char *id)
{
	size_t length = strlen(id);

	return length >= 16 && length <= DB_WEB_TAB_MAX &&
	       strspn(id, "0123456789abcdefABCDEF") == length;
}

static void free_tab(struct db_web_tab *tab)
{
	struct db_web_link *links[] = { tab->act, tab->stop };

	for (struct db_web_tab **at = &tab->server->tabs; *at; at = &(*at)->next) {
		if (*at == tab) {
			*at = tab->next;
			break;
		}
	}
	tab->act = NULL;
	tab->stop = NULL;
	db_web_link_close(links[0]);
	db_web_link_close(links[1]);
	free(tab);
}

static void lose(void *data)
{
	struct db_web_tab *tab = data;

	tab->lost = true;
}

static struct db_web_tab *find_tab(const struct db_web_request *request)
{
	struct db_web_tab *tab = request->server->tabs;

	while (tab && (tab->lost || strcmp(tab->id, request->tab) != 0 ||
	               strcmp(tab->session, request->session) != 0))
		tab = tab->next;
	return tab;
}

/* NULL when the request has been answered with why not. */
static struct db_web_tab *open_tab(struct db_web_request *request)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_web_tab *tab = find_tab(request);
	unsigned count = 0;

	if (tab)
		return tab;
	for (tab = request->server->tabs; tab; tab = tab->next)
		count++;
	if (count >= DB_WEB_TABS_MAX) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "%u pages command drives already; close one", count);
		return NULL;
	}
	tab = calloc(1, sizeof(*tab));
	if (!tab) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return NULL;
	}
	tab->server = request->server;
	tab->next = request->server->tabs;
	request->server->tabs = tab;
	(void)snprintf(tab->id, sizeof(tab->id), "%s", request->tab);
	(void)snprintf(tab->session, sizeof(tab->session), "%s", request->session);
	tab->heard = db_web_clock();
	tab->act = db_web_service_open(request->server->service, lose, tab, &error);
	if (tab->act)
		tab->stop = db_web_service_open(request->server->service, lose, tab, &error);
	if (!tab->stop) {
		db_web_request_fail(request, &error);
		free_tab(tab);
		tab = NULL;
	}
	db_client_error_clear(&error);
	return tab;
}

/* --- watchdogs -------------------------------------------------------------------------------- */

static void note_drive(struct db_web_tab *tab, const char *name)
{
	struct drive *place = &tab->drives[0];

	for (size_t i = 0; i < DRIVES_MAX; i++) {
		struct drive *drive = &tab->drives[i];

		if (strcmp(drive->name, name) == 0) {
			place = drive;
			break;
		}
		/* Of very many the one that was commanded first. */
		if (drive->commanded < place->commanded)
			place = drive;
	}
	place->tab = tab;
	(void)snprintf(place->name, sizeof(place->name), "%s", name);
	place->commanded = db_web_clock();
	place->moves = true;
}

static void take_state(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct drive *drive = data;
	const json_t *state = json_object_get(json_object_get(parameters, "values"), "axis_state");

	(void)more;
	drive->asking = false;
	drive->moves = !error && db_web_service_is_moving(drive->tab->server->service, state);
}

/* What asks, lives. */
static void feed(struct db_web_tab *tab, db_time now)
{
	for (size_t i = 0; i < DRIVES_MAX; i++) {
		struct drive *drive = &tab->drives[i];

		if (drive->name[0] == '\0' || drive->asking ||
		    (!drive->moves && now - drive->commanded >= BEGINS_WITHIN))
			continue;
		drive->asking = db_web_link_send(tab->act, "Read",
		                                 json_pack("{s:s, s:[s]}", "drive", drive->name,
		                                           "names", "axis_state"),
		                                 false, take_state, drive) == 0;
	}
}

/* --- acting ----------------------------------------------------------------------------------- */

static bool is_stop(const struct db_web_request *request)
{
	static const char *const stops[] = { "stop", "quick_stop", "disable" };
	const char *command = json_string_value(json_object_get(request->parameters, "command"));

	if (strcmp(request->route.name, "Run") != 0 || !command)
		return false;
	for (size_t i = 0; i < sizeof(stops) / sizeof(stops[0]); i++) {
		if (strcmp(stops[i], command) == 0)
			return true;
	}
	return false;
}

/* Past everything that waits; and once more behind that, where a motion may be waiting. */
static void stop(struct db_web_request *request)
{
	struct db_web_tab *tab = find_tab(request);

	if (tab && db_web_link_waiting(tab->act) > 0)
		(void)db_web_link_send(tab->act, "Run", json_incref(request->parameters), false,
		                       NULL, NULL);
	db_web_call(request, tab ? tab->stop : db_web_service_stopper(request->server->service),
	            ACT_WITHIN);
}

void db_web_tabs_act(struct db_web_request *request)
{
	const char *drive = json_string_value(json_object_get(request->parameters, "drive"));
	bool to_end = json_is_true(json_object_get(request->parameters, "until_end"));
	struct db_web_tab *tab;

	db_web_log_action(request, request->route.name, request->parameters);
	if (is_stop(request)) {
		stop(request);
		return;
	}
	if (request->tab[0] == '\0') {
		db_web_request_refuse(
			request, MHD_HTTP_BAD_REQUEST, "BadRequest",
			"what acts tells its page: X-Tab, 16 to 32 hexadecimal digits");
		return;
	}
	tab = open_tab(request);
	if (!tab)
		return;
	tab->heard = db_web_clock();
	if (drive && strlen(drive) < DRIVE_NAME_MAX)
		note_drive(tab, drive);
	db_web_call(request, tab->act, to_end ? MOTION_WITHIN : ACT_WITHIN);
}

void db_web_tabs_hear(struct db_web_request *request)
{
	struct db_web_tab *tab = find_tab(request);

	if (tab)
		tab->heard = db_web_clock();
	db_web_request_answer(request, MHD_HTTP_OK, json_pack("{s:b}", "acting", tab != NULL));
}

void db_web_tabs_tick(struct db_web_server *server, db_time now)
{
	struct db_web_tab *next;

	for (struct db_web_tab *tab = server->tabs; tab; tab = next) {
		next = tab->next;
		if (tab->lost || now - tab->heard >= DB_WEB_TAB_SILENT ||
		    !db_web_sessions_find(server->sessions, tab->session, now))
			free_tab(tab);
		else
			feed(tab, now);
	}
}

void db_web_tabs_close(struct db_web_server *server, const char *session)
{
	struct db_web_tab *next;

	for (struct db_web_tab *tab = server->tabs; tab; tab = next) {
		next = tab->next;
		if (!session || strcmp(tab->session, session) == 0)
			free_tab(tab);
	}
}
