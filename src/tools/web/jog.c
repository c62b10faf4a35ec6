/* SPDX-License-Identifier: Apache-2.0 */
#include "web/jog.h"
#include "client/lanes.h"
#include "client/log.h"
#include "web/service.h"
#include "web/stops.h"
#include "web/tokens.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DRIVE_MAX 64

/* A stop without confirmation is repeated at this interval, and for this time. */
#define STOP_AGAIN (200 * DB_NS_PER_MS)
#define STOP_WITHIN (3 * DB_NS_PER_S)

/* A drive that was started, and reports standstill this often, has been stopped. */
#define STANDING_SEEN 3

struct db_web_jog {
	struct db_web_server *server;
	struct db_link *act;    /* NULL: lost */
	sd_event_source *timer; /* fires when the grip is overdue */
	struct db_web_caller caller;
	struct db_web_grip grip;
	uint64_t waits; /* the newest grip that was told to wait: older ones move nothing */
	char waiting[DRIVE_MAX];      /* its drive */
	char token[DB_WEB_TOKEN_MAX]; /* of its latest accepted beat */
	char drive[DRIVE_MAX];        /* of the latest grip */
	double velocity_sent;         /* the last one sent to the drive; 0: stop */
	unsigned moves;               /* moves without an answer */
	unsigned stops;               /* stops without an answer */
	bool moved;         /* a move was taken, or may have been, and no stop confirmed since */
	db_time stop_again; /* DB_TIME_NEVER: the stop is not to be repeated */
	db_time stop_by;
	bool seen_moving;       /* since the latest move */
	unsigned seen_standing; /* standstill reported this often after that */
	char result[48];        /* of the latest move */
	char text[512];         /* the error's text */
};

static void settle(struct db_web_jog *jog);

/* --- stopping --------------------------------------------------------------------------------- */

static void on_stop_answer(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_web_jog *jog = data;

	(void)parameters;
	(void)more;
	jog->stops--;
	if (!error) {
		jog->moved = false;
		jog->stop_again = DB_TIME_NEVER;
	} else if (jog->stop_again != DB_TIME_NEVER) {
		snprintf(jog->text, sizeof(jog->text), "%s", error->text);
	}
	settle(jog);
}

static void send_stop(struct db_web_jog *jog)
{
	jog->stops++;
	if (!db_web_stops_send(jog->server, &jog->caller, "Run",
	                       json_pack("{s:s, s:s}", "drive", jog->drive, "command", "stop"),
	                       on_stop_answer, jog))
		jog->stops--;
}

/* On a connection of its own, past waiting calls; and on the acting connection after them, if a
 * move may be among them. */
static void stop_drive(struct db_web_jog *jog)
{
	db_time now = db_client_now();

	db_client_log(DB_CLIENT_NOTICE, "%s: jog of %s ended: %s", jog->caller.text, jog->drive,
	              db_web_grip_ends[jog->grip.end]);
	jog->server->counts.late_jogs += jog->grip.end == DB_WEB_GRIP_OVERDUE;
	jog->velocity_sent = 0;
	jog->stop_again = now + STOP_AGAIN;
	jog->stop_by = now + STOP_WITHIN;
	send_stop(jog);
	if (jog->act && db_link_waiting(jog->act) > 0)
		(void)db_link_tell(jog->act, "Run",
		                   json_pack("{s:s, s:s}", "drive", jog->drive, "command", "stop"));
}

/* --- moving ----------------------------------------------------------------------------------- */

static void on_move_answer(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_web_jog *jog = data;
	const char *result = json_string_value(
		json_object_get(error ? error->parameters : parameters, "result"));

	(void)more;
	jog->moves--;
	/* db_web_jog_lose() handles the lost connection. */
	if (error && strcmp(error->name, DB_CLIENT_LOST) == 0)
		return;
	snprintf(jog->result, sizeof(jog->result), "%s", result ? result : "");
	jog->moved = jog->moved || !error || db_client_error_may_move(error);
	if (error) {
		json_t *told = db_web_error_describe(error, NULL);
		const char *text = json_string_value(json_object_get(told, "text"));

		snprintf(jog->text, sizeof(jog->text), "%s", text ? text : "");
		json_decref(told);
		db_client_log(DB_CLIENT_NOTICE, "%s: jog of %s refused: %s", jog->caller.text,
		              jog->drive, jog->text);
		db_web_grip_finish(&jog->grip, DB_WEB_GRIP_REFUSED);
		/* It may continue as commanded before. */
		if (jog->velocity_sent != 0 && jog->moved)
			stop_drive(jog);
		jog->velocity_sent = 0;
	}
	settle(jog);
}

static void move_drive(struct db_web_jog *jog)
{
	if (jog->velocity_sent == 0) {
		jog->server->counts.jogs++;
		db_client_log(DB_CLIENT_NOTICE, "%s: jog of %s begins at %.10g", jog->caller.text,
		              jog->drive, jog->grip.velocity);
	}
	jog->velocity_sent = jog->grip.velocity;
	jog->seen_moving = false;
	jog->seen_standing = 0;
	jog->stop_again = DB_TIME_NEVER;
	jog->text[0] = '\0';
	jog->result[0] = '\0';
	jog->moves++;
	if (db_link_send(jog->act, "Run",
	                 json_pack("{s:s, s:s, s:{s:f}, s:i, s:s}", "drive", jog->drive, "command",
	                           "move_velocity", "arguments", "target_velocity",
	                           jog->velocity_sent, "hold_ms",
	                           (int)(DB_WEB_GRIP_LATE / DB_NS_PER_MS), "token", jog->token),
	                 false, on_move_answer, jog) != 0)
		jog->moves--;
}

/* Sends the drive what the state of the grip requires. */
static void settle(struct db_web_jog *jog)
{
	uint64_t due = (uint64_t)(jog->grip.until / DB_NS_PER_US);

	if (jog->velocity_sent != 0 && !db_web_grip_is_held(&jog->grip))
		stop_drive(jog);
	else if (jog->act && db_web_grip_is_held(&jog->grip) &&
	         jog->velocity_sent != jog->grip.velocity && jog->moves == 0 && jog->stops == 0)
		move_drive(jog);
	(void)sd_event_source_set_time(jog->timer, due);
	(void)sd_event_source_set_enabled(
		jog->timer, db_web_grip_is_held(&jog->grip) ? SD_EVENT_ONESHOT : SD_EVENT_OFF);
}

static int on_overdue(sd_event_source *source, uint64_t us, void *data)
{
	struct db_web_jog *jog = data;

	(void)source;
	(void)us;
	db_web_grip_look(&jog->grip, db_client_now());
	settle(jog);
	return 0;
}

/* --- the page's beats ------------------------------------------------------------------------- */

/* A beat, as the page sends it. */
struct beat {
	const char *drive;
	uint64_t grip;
	uint64_t number;
	double velocity;
	const char *token; /* NULL: none */
	db_time age;       /* of the token */
};

static bool read_beat(const struct db_web_request *request, db_time now, struct beat *beat)
{
	const json_t *velocity = json_object_get(request->parameters, "velocity");
	json_int_t grip = json_integer_value(json_object_get(request->parameters, "grip"));
	json_int_t number = json_integer_value(json_object_get(request->parameters, "beat"));

	*beat = (struct beat){
		.drive = json_string_value(json_object_get(request->parameters, "drive")),
		.grip = (uint64_t)grip,
		.number = (uint64_t)number,
		.velocity = json_number_value(velocity),
		.token = json_string_value(json_object_get(request->parameters, "token")),
	};
	beat->age = db_web_tokens_age(&request->server->service->tokens, beat->token, now);
	return beat->drive && strlen(beat->drive) < DRIVE_MAX && grip >= 1 && number >= 1 &&
	       json_is_number(velocity);
}

/*
 * A grip on another drive than before begins only after that drive stands: the page holds one drive
 * at a time, and its stop is repeated until it is confirmed. False: it does not stand yet, and the
 * request is answered. The page may go on with its beats; the grip is not taken, so the next beat
 * asks again.
 */
static bool change_drive(struct db_web_jog *jog, struct db_web_request *request,
                         const struct beat *beat, db_time now)
{
	db_web_jog_end(jog, DB_WEB_GRIP_RELEASED);
	if (!db_web_jog_is_over(jog, now)) {
		bool goes_on = beat->velocity != 0;

		jog->waits = beat->grip;
		snprintf(jog->waiting, sizeof(jog->waiting), "%s", beat->drive);
		/* Let go: a beat of it that comes later moves nothing. */
		if (!goes_on)
			db_web_grip_take(&jog->grip, beat->grip, beat->number, 0, beat->age, now);
		db_web_request_answer(
			request, MHD_HTTP_OK,
			json_pack("{s:b, s:s, s:o, s:s}", "held", 0, "why",
		                  goes_on ? "waiting" : "released", "text",
		                  json_sprintf("%s is still being stopped", jog->drive), "result",
		                  ""));
		return false;
	}
	/* The service continues a stop that the other drive has not confirmed. */
	db_stops_forget(db_lanes_stops(jog->server->lanes), jog);
	jog->stops = 0;
	snprintf(jog->drive, sizeof(jog->drive), "%s", beat->drive);
	return true;
}

static void handle_beat(struct db_web_jog *jog, const struct beat *beat, db_time now)
{
	bool is_first = beat->grip > jog->grip.number;

	db_web_grip_take(&jog->grip, beat->grip, beat->number, beat->velocity, beat->age, now);
	if (is_first && jog->grip.end == DB_WEB_GRIP_OLD) {
		db_web_tokens_write_late(jog->text, beat->age);
		db_client_log(DB_CLIENT_NOTICE, "%s: a jog of %s %s", jog->caller.text, jog->drive,
		              jog->text);
	}
	/* The beat was accepted. */
	if (db_web_grip_is_held(&jog->grip) && jog->grip.number == beat->grip &&
	    jog->grip.beat == beat->number && beat->token) {
		snprintf(jog->token, sizeof(jog->token), "%s", beat->token);
		/* The service's own dead man's rule: it stops the drive without these beats, also
		 * if this program hangs. */
		if (jog->act && jog->velocity_sent != 0)
			(void)db_link_tell(
				jog->act, "Beat",
				json_pack("{s:s, s:s}", "drive", jog->drive, "token", jog->token));
	}
}

bool db_web_jog_take(struct db_web_jog *jog, struct db_web_request *request)
{
	db_time now = db_client_now();
	struct beat beat;
	bool mine;

	if (!read_beat(request, now, &beat)) {
		db_web_request_refuse(
			request, MHD_HTTP_BAD_REQUEST, "BadRequest",
			"a beat is {\"drive\": ..., \"grip\": from 1, \"beat\": from 1, "
			"\"velocity\": ..., \"token\": the newest one of the overview}");
		return false;
	}
	if (beat.grip > jog->grip.number && strcmp(beat.drive, jog->drive) != 0 &&
	    beat.grip >= jog->waits && !change_drive(jog, request, &beat, now))
		return true;
	jog->caller = db_web_request_caller(request);
	/* A grip cannot change to another drive. */
	if (strcmp(beat.drive, jog->drive) == 0 && beat.grip >= jog->waits)
		handle_beat(jog, &beat, now);
	settle(jog);
	/* Of a former grip there is nothing more to tell: it is over. */
	mine = beat.grip == jog->grip.number;
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:b, s:s, s:s, s:s}", "held",
	                                mine && db_web_grip_is_held(&jog->grip), "why",
	                                mine ? db_web_grip_ends[jog->grip.end] : "released", "text",
	                                mine ? jog->text : "", "result", mine ? jog->result : ""));
	return true;
}

void db_web_jog_yield(struct db_web_jog *jog, const char *drive)
{
	/* A grip that waits was not taken yet: it must not begin after the stop. */
	if (jog->waits > jog->grip.number && (!drive || strcmp(drive, jog->waiting) == 0)) {
		jog->grip.number = jog->waits;
		jog->grip.end = DB_WEB_GRIP_STOPPED;
		jog->text[0] = jog->result[0] = '\0';
	}
	if (drive && strcmp(drive, jog->drive) != 0)
		return;
	db_web_grip_finish(&jog->grip, DB_WEB_GRIP_STOPPED);
	/* A move that still waits would be carried out after the other button's stop. */
	settle(jog);
}

void db_web_jog_see(struct db_web_jog *jog, const char *drive, bool moves)
{
	if (strcmp(drive, jog->drive) != 0 || jog->velocity_sent == 0 || jog->moves > 0)
		return;
	jog->seen_moving = jog->seen_moving || moves;
	jog->seen_standing = moves ? 0 : jog->seen_standing + 1;
	/* It may have been stopped before it was seen to move. */
	if (jog->seen_standing >= (jog->seen_moving ? 1 : STANDING_SEEN)) {
		db_web_grip_finish(&jog->grip, DB_WEB_GRIP_STOPPED);
		settle(jog);
	}
}

void db_web_jog_end(struct db_web_jog *jog, enum db_web_grip_end end)
{
	db_web_grip_finish(&jog->grip, end);
	settle(jog);
}

void db_web_jog_lose(struct db_web_jog *jog)
{
	bool moved = jog->velocity_sent != 0 || !db_web_jog_is_over(jog, db_client_now());

	jog->act = NULL;
	db_web_grip_finish(&jog->grip, DB_WEB_GRIP_LOST);
	jog->velocity_sent = 0;
	if (moved) {
		db_client_log(DB_CLIENT_WARNING,
		              "%s: the connection was lost while %s was moved; %s",
		              jog->caller.text, jog->drive,
		              db_web_service_is_up(jog->server->service) ?
		                      "it is told to stop over another one" :
		                      "its watchdog is to stop it");
		(void)db_web_stops_send(
			jog->server, &jog->caller, "Run",
			json_pack("{s:s, s:s}", "drive", jog->drive, "command", "stop"), NULL,
			NULL);
	}
	jog->stop_again = DB_TIME_NEVER;
	settle(jog);
}

void db_web_jog_tick(struct db_web_jog *jog, db_time now)
{
	if (now < jog->stop_again)
		return;
	jog->stop_again = now < jog->stop_by ? now + STOP_AGAIN : DB_TIME_NEVER;
	/* The service itself continues a stop that it has not answered. */
	if (jog->stop_again != DB_TIME_NEVER && jog->stops == 0)
		send_stop(jog);
	else if (jog->stop_again == DB_TIME_NEVER)
		db_client_log(DB_CLIENT_ERROR, "%s: %s does not confirm that it stops: %s",
		              jog->caller.text, jog->drive, jog->text);
}

bool db_web_jog_is_over(const struct db_web_jog *jog, db_time now)
{
	return jog->velocity_sent == 0 && jog->moves == 0 &&
	       (jog->stop_again == DB_TIME_NEVER || now >= jog->stop_by);
}

/* --- life ------------------------------------------------------------------------------------- */

struct db_web_jog *db_web_jog_new(struct db_web_server *server, struct db_link *act)
{
	struct db_web_jog *jog = calloc(1, sizeof(*jog));

	if (!jog)
		return NULL;
	jog->server = server;
	jog->act = act;
	jog->grip.until = DB_TIME_NEVER;
	jog->stop_again = DB_TIME_NEVER;
	if (db_web_server_add_timer(server, &jog->timer, on_overdue, jog) < 0) {
		free(jog);
		return NULL;
	}
	return jog;
}

void db_web_jog_free(struct db_web_jog *jog)
{
	if (!jog)
		return;
	db_stops_forget(db_lanes_stops(jog->server->lanes), jog);
	sd_event_source_disable_unref(jog->timer);
	free(jog);
}
