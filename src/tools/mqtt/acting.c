/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/acting.h"

#include "client/lanes.h"
#include "client/log.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A lane without work for this time may be closed when another drive needs one. */
#define IDLE_MIN (60 * DB_NS_PER_S)

/* Twelve drives can be commanded at the same time, and all of them can be stopped; the service has
 * 64 sessions for all its tools. */
#define LANES_MAX 12

/* Stops whose answers are waited for at the same time. */
#define STOPS_MAX 4

/* For one drive: a flood of commands for it leaves lanes for the others. */
#define LANES_EACH (LANES_MAX / 2)

#define WRITE_NAME "write"

/* A command or a stop without its last answer. */
struct call {
	struct db_mqtt_acting *acting;
	struct db_lane *lane; /* NULL: it is a stop */
	char drive[32];
	char id[DB_MQTT_ID_MAX + 1];
	char command[48];
	char user[DB_MQTT_USER_MAX + 1];
};

struct db_mqtt_acting {
	const char *from; /* for the audit trail; "": the service has none */
	db_mqtt_result_fn *result;
	void *context;
	struct db_lanes *lanes;
	bool drops; /* within db_mqtt_acting_drop(): nothing is reported */
};

struct db_mqtt_acting *db_mqtt_acting_new(sd_event *loop, const char *socket,
                                          db_mqtt_result_fn *result, void *context)
{
	/* Without an interval: a drive is fed each time that its commands' sender shows life. */
	const struct db_lanes_form form = {
		.socket = socket,
		.most = LANES_MAX,
		.stops = STOPS_MAX,
	};
	struct db_mqtt_acting *acting = calloc(1, sizeof(*acting));

	if (!acting)
		return NULL;
	acting->from = "";
	acting->result = result;
	acting->context = context;
	acting->lanes = db_lanes_new(loop, &form, acting);
	if (acting->lanes)
		return acting;
	free(acting);
	return NULL;
}

void db_mqtt_acting_free(struct db_mqtt_acting *acting)
{
	if (!acting)
		return;
	(void)db_mqtt_acting_drop(acting);
	db_lanes_free(acting->lanes);
	free(acting);
}

static void on_introduced(void *data, json_t *parameters, const struct db_client_error *error,
                          bool more)
{
	const struct call *call = data;

	(void)parameters;
	(void)more;
	/* After an error the lane has no user at the service. */
	if (error)
		db_client_log(DB_CLIENT_WARNING, "command %s to drive %s: its user is not told: %s",
		              call->command, call->drive, error->text);
}

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct call *call = data;
	const json_t *words = error ? error->parameters : parameters;
	struct db_mqtt_outcome outcome = {
		.drive = call->drive,
		.sender = call->user,
		.id = call->id,
		.command = call->command,
		.result = json_string_value(json_object_get(words, "result")),
		.repeated = json_is_true(json_object_get(words, "repeated")),
		.why = error ? error->text : "",
	};
	char name[64] = "";
	size_t used = 0;

	if (!more && call->lane)
		call->lane->call = NULL;
	/* For an error the service gives the reason. */
	if (error && !outcome.result) {
		/* In the form of results: BadValue is bad_value. */
		for (const char *at = db_client_error_short(error); *at && used + 2 < sizeof(name);
		     at++) {
			if (isupper((unsigned char)*at) && used > 0)
				name[used++] = '_';
			name[used++] = (char)tolower((unsigned char)*at);
		}
		outcome.refused = strcmp(error->name, DB_CLIENT_LOST) != 0 &&
		                  strcmp(error->name, DB_STOPS_PENDING) != 0;
	}
	if (!outcome.result)
		outcome.result = name;
	if (!call->acting->drops)
		call->acting->result(call->acting->context, &outcome);
	if (!more)
		free(call);
}

/* Commands of this drive that are under way. `same`: whether this one is among them. */
static size_t count_calls(const struct db_mqtt_acting *acting, const char *drive,
                          const struct db_mqtt_command *command, bool *same)
{
	size_t count = 0;

	*same = false;
	for (struct db_lane *lane = NULL; (lane = db_lanes_next(acting->lanes, lane));) {
		const struct call *call = lane->call;

		if (!call || strcmp(call->drive, drive) != 0)
			continue;
		count++;
		*same = *same || (strcmp(call->id, command->id) == 0 &&
		                  strcmp(call->user, command->user) == 0);
	}
	return count;
}

/*
 * A lane without a call over which this user commands the drive, or a new one; NULL with an error.
 * Another user's would make him the one who keeps going what was commanded over it, even by what is
 * refused, and would give him that user's control: it is taken only when there is no other.
 */
static struct db_lane *take_lane(struct db_mqtt_acting *acting, const char *drive, const char *user,
                                 db_time now, struct db_client_error *error)
{
	struct db_lane *oldest = NULL;
	struct db_lane *others = NULL;
	size_t count = 0;

	for (struct db_lane *lane = NULL; (lane = db_lanes_next(acting->lanes, lane)); count++) {
		if (lane->call)
			continue;
		if (db_lane_note(lane, drive) && strcmp(db_link_user(lane->link), user) == 0)
			return lane;
		if (db_lane_note(lane, drive))
			others = lane;
		if (now - lane->used >= IDLE_MIN && (!oldest || lane->used < oldest->used))
			oldest = lane;
	}
	if (count == LANES_MAX && !oldest && others)
		return others;
	if (count == LANES_MAX && oldest)
		db_lane_drop(oldest);
	return db_lanes_open(acting->lanes, error);
}

static struct call *make_call(struct db_mqtt_acting *acting, struct db_lane *lane,
                              const struct db_mqtt_outcome *command)
{
	struct call *call = calloc(1, sizeof(*call));

	if (!call)
		return NULL;
	call->acting = acting;
	call->lane = lane;
	snprintf(call->drive, sizeof(call->drive), "%s", command->drive);
	snprintf(call->id, sizeof(call->id), "%s", command->id);
	snprintf(call->command, sizeof(call->command), "%s", command->command);
	snprintf(call->user, sizeof(call->user), "%s", command->sender);
	return call;
}

/* Past all lanes. */
static void send_stop(struct db_mqtt_acting *acting, const struct db_mqtt_command *command,
                      struct db_mqtt_outcome *outcome)
{
	struct call *call = make_call(acting, NULL, outcome);

	if (call &&
	    db_stops_send(db_lanes_stops(acting->lanes), outcome->drive,
	                  &(struct db_stops_user){ command->user, acting->from }, "Run",
	                  json_pack("{s:s, s:s, s:O*, s:b}", "drive", outcome->drive, "command",
	                            command->name, "arguments", command->arguments, "until_end", 1),
	                  true, on_answer, call))
		return;
	free(call);
	outcome->result = "lost";
	outcome->why = "drivebridged cannot be reached";
	acting->result(acting->context, outcome);
}

/* False: nothing was sent, and the lane is closed. */
static bool send_command(struct db_mqtt_acting *acting, struct db_lane *lane,
                         const struct db_mqtt_command *command,
                         const struct db_mqtt_outcome *outcome, unsigned within_ms, db_time now)
{
	struct call *call = make_call(acting, lane, outcome);
	json_t *parameters;

	lane->call = call;
	lane->used = now;
	if (call && db_lane_command(lane, outcome->drive, now)) {
		db_link_introduce(lane->link, command->user, acting->from, on_introduced, call);
		parameters = command->name ?
		                     json_pack("{s:s, s:s, s:O?, s:b}", "drive", outcome->drive,
		                               "command", command->name, "arguments",
		                               command->arguments, "until_end", 1) :
		                     json_pack("{s:s, s:O}", "drive", outcome->drive, "values",
		                               command->arguments);
		(void)json_object_set_new(parameters, "id", json_string(command->id));
		(void)json_object_set_new(parameters, "within_ms", json_integer(within_ms));
		/* If the service was not running, it has not seen when the call arrived. */
		(void)json_object_set_new(parameters, "sent_us", json_integer(now / DB_NS_PER_US));
		if (command->token)
			(void)json_object_set_new(parameters, "token", json_string(command->token));
		if (db_link_send(lane->link, command->name ? "Run" : "Write", parameters,
		                 command->name != NULL, on_answer, call) == 0)
			return true;
	}
	db_lane_drop(lane);
	return false;
}

void db_mqtt_acting_run(struct db_mqtt_acting *acting, const char *drive,
                        const struct db_mqtt_command *command, unsigned within_ms, db_time now)
{
	struct db_mqtt_outcome outcome = {
		.drive = drive,
		.sender = command->user,
		.id = command->id,
		.command = command->name ? command->name : WRITE_NAME,
		.why = "",
	};
	struct db_client_error error = { .parameters = NULL };
	struct db_lane *lane = NULL;
	bool same;
	bool sent = false;

	if (command->stops) {
		send_stop(acting, command, &outcome);
		return;
	}
	if (count_calls(acting, drive, command, &same) < LANES_EACH && !same)
		lane = take_lane(acting, drive, command->user, now, &error);
	/* Both get one result. */
	if (same) {
		outcome.result = "pending";
		outcome.repeated = true;
	} else if (!lane && (error.name[0] == '\0' || strcmp(error.name, DB_LANES_FULL) == 0)) {
		outcome.result = "busy";
		outcome.why = "too much is commanded at the same time";
		outcome.refused = true;
	} else {
		if (lane)
			sent = send_command(acting, lane, command, &outcome, within_ms, now);
		outcome.result = "lost";
		outcome.why = error.text[0] ? error.text : "the service has closed the connection";
	}
	if (!sent)
		acting->result(acting->context, &outcome);
	db_client_error_clear(&error);
}

void db_mqtt_acting_set_audit(struct db_mqtt_acting *acting, bool has_audit)
{
	acting->from = has_audit ? "MQTT" : "";
}

void db_mqtt_acting_feed(struct db_mqtt_acting *acting, const char *drive, const char *user,
                         db_time now)
{
	for (struct db_lane *lane = NULL; (lane = db_lanes_next(acting->lanes, lane));) {
		if (lane->call || !db_lane_note(lane, drive) ||
		    (user && strcmp(db_link_user(lane->link), user) != 0))
			continue;
		lane->used = now;
		db_lane_feed(lane, now);
	}
}

bool db_mqtt_acting_drop(struct db_mqtt_acting *acting)
{
	bool any;

	acting->drops = true;
	any = db_lanes_drop(acting->lanes);
	acting->drops = false;
	return any;
}
