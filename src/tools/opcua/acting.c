/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/acting.h"

#include "client/clock.h"
#include "client/lanes.h"
#include "client/log.h"
#include "users/roles.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Longest time that operators wait for all callers of one turn together: twice the usual time of a
 * command. */
#define SHARE_MAX (30 * DB_NS_PER_MS)

/* Most connections at the same time, in addition to those of stops; the service has 64 for all its
 * tools. */
#define LANES_MAX 14

/* Connections of one session, and stops without an answer. */
#define LANES_PER_SESSION 4
#define STOPS_MAX 4

/* Longest interval for feeding a drive's watchdog, and shortest one for looking whether that is
 * due. */
#define FEED_LONGEST (1 * DB_NS_PER_S)
#define FEED_SHORTEST (20 * DB_NS_PER_MS)

/* A call with a waiting caller, or one that has stopped waiting. */
struct call {
	struct db_opcua_acting *acting;
	struct db_lane *lane; /* NULL: it is a stop */
	char drive[64];
	char what[96]; /* for the log */
	bool done;
	bool left; /* the caller has stopped waiting: it is freed when it ends */
	struct db_opcua_outcome outcome;
};

struct db_opcua_acting {
	const struct db_opcua_config *config;
	const struct db_opcua_network *network;
	db_opcua_ended_fn *ended;
	db_opcua_feed_fn *feed;
	void *context;
	db_time now;     /* of this turn */
	db_time awaited; /* since when other clients wait in this turn; 0: none does */
	struct db_lanes *lanes;
};

struct db_opcua_acting *db_opcua_acting_new(sd_event *loop, const struct db_opcua_config *config,
                                            const struct db_opcua_network *network,
                                            db_opcua_ended_fn *ended, db_opcua_feed_fn *feed,
                                            void *context)
{
	const struct db_lanes_form form = {
		.socket = config->socket,
		.most = LANES_MAX,
		.stops = STOPS_MAX,
		.interval = FEED_LONGEST,
	};
	struct db_opcua_acting *acting = calloc(1, sizeof(*acting));

	if (!acting)
		return NULL;
	acting->config = config;
	acting->network = network;
	acting->ended = ended;
	acting->feed = feed;
	acting->context = context;
	acting->lanes = db_lanes_new(loop, &form, acting);
	if (acting->lanes)
		return acting;
	free(acting);
	return NULL;
}

/* --- lanes ------------------------------------------------------------------------------------ */

void db_opcua_acting_free(struct db_opcua_acting *acting)
{
	if (acting)
		db_lanes_free(acting->lanes);
	free(acting);
}

/* The next lane of this session; NULL at the end. */
static struct db_lane *next_lane(const struct db_opcua_acting *acting, unsigned session,
                                 const struct db_lane *lane)
{
	struct db_lane *next = db_lanes_next(acting->lanes, lane);

	while (next && next->session != session)
		next = db_lanes_next(acting->lanes, next);
	return next;
}

void db_opcua_acting_drop(struct db_opcua_acting *acting, unsigned session)
{
	for (struct db_lane *lane; (lane = next_lane(acting, session, NULL));)
		db_lane_drop(lane);
}

static void fail(struct db_opcua_outcome *outcome, const char *result, const char *reason)
{
	snprintf(outcome->result, sizeof(outcome->result), "%s", result);
	snprintf(outcome->reason, sizeof(outcome->reason), "%.255s", reason);
}

/* The lane over which this session commands the drive; NULL: there is none yet. */
static struct db_lane *find_own(const struct db_opcua_acting *acting, unsigned session,
                                const char *drive)
{
	struct db_lane *found = NULL;

	for (struct db_lane *lane = NULL; (lane = next_lane(acting, session, lane));) {
		if (db_lane_note(lane, drive) && (!found || lane->shared))
			found = lane;
	}
	return found;
}

/* Which of a session's connections to use. */
enum way {
	/* Always the same one for a drive, so that its commands keep their order. A new drive gets
	 * one of its own while there are free ones: its calls then wait for no other drive's. */
	OWN,
	/* One for all drives: for the service a connection is a client, and only the client that
	 * controls the drives can start them together. */
	SHARED,
	/* None of them: past everything that waits (client/stops.h). */
	PASSING,
};

static struct db_lane *find_lane(struct db_opcua_acting *acting, unsigned session,
                                 const char *drive, enum way way, struct db_opcua_outcome *outcome)
{
	struct db_lane *lane = way == SHARED ? NULL : find_own(acting, session, drive);
	struct db_lane *least = NULL;
	struct db_client_error error = { .parameters = NULL };
	size_t own = 0;

	for (struct db_lane *other = NULL; !lane && (other = next_lane(acting, session, other));) {
		if (way == SHARED && other->shared)
			lane = other;
		own++;
		if (!least || (least->call && !other->call) ||
		    (!other->call == !least->call && other->count < least->count))
			least = other;
	}
	if (!lane && own < LANES_PER_SESSION) {
		lane = db_lanes_open(acting->lanes, &error);
		if (lane)
			lane->session = session;
		else if (strcmp(error.name, DB_LANES_FULL) == 0)
			fail(outcome, "busy", "too many sessions command at the same time");
		else
			fail(outcome, "Unreachable", error.text);
		db_client_error_clear(&error);
	}
	if (!lane)
		lane = least;
	if (lane && way == SHARED)
		lane->shared = true;
	return lane;
}

/* --- answers ---------------------------------------------------------------------------------- */

/* `ends`: what follows the name of the command: "", or " ended" of a call whose answer was not
 * waited for any more. */
static void log_outcome(enum db_client_level level, const struct call *call, const char *ends,
                        const struct db_opcua_outcome *outcome)
{
	db_client_log(level, "%s%s: %s%s: %s", call->drive[0] ? "drive " : "gateway", call->drive,
	              call->what, ends,
	              outcome->reason[0] ? outcome->reason :
	              outcome->result[0] ? outcome->result :
	                                   "done");
}

static void on_result(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct call *call = data;
	const char *result = json_string_value(json_object_get(parameters, "result"));
	struct db_opcua_outcome *outcome = &call->outcome;
	/* The call was sent, and no answer has arrived or will: it is unknown whether it was
	 * carried out. */
	bool open = error && (strcmp(error->name, DB_CLIENT_LOST) == 0 ||
	                      strcmp(error->name, DB_CLIENT_BAD_ANSWER) == 0 ||
	                      strcmp(error->name, DB_CLIENT_NO_MEMORY) == 0);

	(void)more;
	if (call->lane)
		call->lane->call = NULL;
	call->done = true;
	outcome->pending = result && strcmp(result, "pending") == 0;
	if (error && strcmp(error->name, DB_STOPS_PENDING) == 0) {
		result = "pending";
		outcome->pending = true;
		snprintf(outcome->reason, sizeof(outcome->reason), "%.255s", error->text);
	} else if (open) {
		result = "indeterminate";
		snprintf(outcome->reason, sizeof(outcome->reason),
		         "%.180s; whether the drive has done it is not known", error->text);
	} else if (error) {
		result = json_string_value(json_object_get(error->parameters, "result"));
		if (!result)
			result = db_client_error_short(error);
		snprintf(outcome->reason, sizeof(outcome->reason), "%.255s", error->text);
	}
	snprintf(outcome->result, sizeof(outcome->result), "%.31s", result ? result : "");
	if (!call->left)
		return;
	log_outcome(error ? DB_CLIENT_WARNING : DB_CLIENT_INFO, call, " ended", outcome);
	call->acting->ended(call->acting->context, call->drive, outcome);
	free(call);
}

void db_opcua_acting_go_on(struct db_opcua_acting *acting)
{
	db_time now = db_client_now();

	if (now - acting->now < FEED_SHORTEST)
		return;
	acting->now = now;
	/* Answers tell when the next feeding is due. */
	for (struct db_lane *lane = NULL; (lane = db_lanes_next(acting->lanes, lane));)
		db_link_handle(lane->link);
	acting->feed(acting->context, now);
}

/* Until the call has ended, also by the loss of its connection, or other clients have waited long
 * enough. */
static void wait_for(struct call *call)
{
	struct db_opcua_acting *acting = call->acting;
	/* A stop's is closed by its answer. */
	struct db_link *connection = call->lane ?
	                                     call->lane->link :
	                                     db_stops_link(db_lanes_stops(acting->lanes), call);
	db_time deadline = db_client_now() + acting->config->confirm_ms * DB_NS_PER_MS;
	struct pollfd fds[1 + DB_OPCUA_NETWORK_PLACES];

	while (!call->done) {
		db_time now = db_client_now();
		db_time until = acting->awaited > 0 && acting->awaited + SHARE_MAX < deadline ?
		                        acting->awaited + SHARE_MAX :
		                        deadline;
		struct timespec patience;
		size_t others = 0;

		db_link_handle(connection);
		if (now >= until)
			break;
		db_opcua_acting_go_on(acting);
		if (call->done)
			break;
		until = until - now < FEED_SHORTEST ? until - now : FEED_SHORTEST;
		patience = (struct timespec){ .tv_nsec = until };
		fds[0] = db_link_poll_fd(connection);
		if (acting->awaited == 0)
			others = db_opcua_network_watch(acting->network, fds + 1,
			                                DB_OPCUA_NETWORK_PLACES);
		(void)ppoll(fds, 1 + others, &patience, NULL);
		for (size_t i = 1; i <= others && acting->awaited == 0; i++) {
			if (fds[i].revents & POLLIN)
				acting->awaited = db_client_now();
		}
	}
}

/* The lane to use, without an unanswered call: no other call waits for its end, because it could
 * then be carried out when nobody expects it. */
static struct db_lane *take_lane(struct db_opcua_acting *acting, unsigned session,
                                 const char *drive, enum way way, struct db_opcua_outcome *outcome)
{
	struct db_lane *before = find_own(acting, session, drive);
	struct db_lane *lane = find_lane(acting, session, drive, drive[0] == '\0' ? SHARED : way,
	                                 outcome);
	json_t **from;
	json_t **to;

	if (!lane)
		return NULL;
	if (lane->call || (before && before->call)) {
		fail(outcome, "busy",
		     "what was told before has not ended; nothing waits behind it");
		return NULL;
	}
	/* A command of the gateway may start each of its drives. */
	if (!db_lane_command(lane, drive[0] ? drive : NULL, db_client_now())) {
		fail(outcome, "NoMemory", "out of memory");
		return NULL;
	}
	if (!before || before == lane)
		return lane;
	/* From now on commands for the drive use this lane, with this session's part of the command
	 * block, and with control. The former lane still feeds what was commanded over it. */
	from = db_lane_note(before, drive);
	to = db_lane_note(lane, drive);
	json_decref(*to);
	*to = *from;
	*from = NULL;
	/* The next write takes control. Without control in the configuration the service answers
	 * with an error, which is ignored. */
	(void)db_link_send(
		before->link, "Write",
		json_pack("{s:s, s:{s:i}}", "drive", drive, "values", "control_request", 0), false,
		NULL, NULL);
	return lane;
}

/* Takes `parameters` over. False: it was not sent. */
static bool send_call(struct call *call, const struct db_opcua_actor *actor, const char *method,
                      json_t *parameters)
{
	char key[96];

	if (call->lane) {
		/* A session may be activated again as another user. */
		db_link_introduce(call->lane->link, actor->user, actor->from, NULL, NULL);
		return db_link_send(call->lane->link, method, parameters, false, on_result, call) ==
		       0;
	}
	snprintf(key, sizeof(key), "%u %s", actor->session, call->drive);
	return db_stops_send(db_lanes_stops(call->acting->lanes), key,
	                     &(struct db_stops_user){ actor->user, actor->from }, method,
	                     parameters, false, on_result, call);
}

/* Takes `parameters` over. Sends, and waits for the end. */
static void act(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                const char *drive, const char *what, enum way way, const char *method,
                json_t *parameters, struct db_opcua_outcome *outcome)
{
	struct db_lane *lane = NULL;
	struct call *call;

	*outcome = (struct db_opcua_outcome){ .pending = false };
	if (way != PASSING) {
		lane = take_lane(acting, actor->session, drive, way, outcome);
		if (!lane) {
			json_decref(parameters);
			return;
		}
	}
	call = calloc(1, sizeof(*call));
	if (!call) {
		json_decref(parameters);
		fail(outcome, "NoMemory", "out of memory");
		return;
	}
	call->acting = acting;
	call->lane = lane;
	snprintf(call->drive, sizeof(call->drive), "%s", drive);
	snprintf(call->what, sizeof(call->what), "%s by %s", what, actor->label);
	/* gcc's analyzer: it is the lane's now, which frees it. */
	if (lane)
		lane->call = call;
	if (!send_call(call, actor, method, parameters)) {
		fail(outcome, "Lost", "the service has closed the connection");
		if (lane)
			db_lane_drop(lane);
		else
			free(call);
		return;
	}
	wait_for(call);
	if (call->done) {
		*outcome = call->outcome;
	} else {
		call->left = true;
		outcome->pending = true;
	}
	/* The service also reports a stop that is being repeated as pending. */
	if (outcome->pending)
		fail(outcome, "pending",
		     outcome->reason[0] ? call->outcome.reason :
		                          "the drive has not confirmed it yet; it goes on, and "
		                          "Result tells how it ends");
	log_outcome(DB_CLIENT_NOTICE, call, "", outcome);
	if (call->done)
		free(call);
}

static bool has_right_place(const struct db_opcua_actor *actor, bool stops,
                            struct db_opcua_outcome *outcome)
{
	*outcome = (struct db_opcua_outcome){ .pending = false };
	if (stops || !actor->stops_only)
		return true;
	fail(outcome, "busy", "operators have all sessions; this one is only for stops");
	return false;
}

void db_opcua_acting_run(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                         const char *drive, const char *command, bool stops, json_t *arguments,
                         struct db_opcua_outcome *outcome)
{
	if (!has_right_place(actor, stops, outcome)) {
		json_decref(arguments);
		return;
	}
	act(acting, actor, drive, command, stops ? PASSING : OWN, "Run",
	    json_pack("{s:s, s:s, s:o, s:s*}", "drive", drive, "command", command, "arguments",
	              arguments, "token", actor->token[0] ? actor->token : NULL),
	    outcome);
}

static enum way way_of_write(const char *reg, bool stops)
{
	if (strcmp(reg, "group_stop") == 0 || strcmp(reg, "group_stop_units") == 0 || stops)
		return PASSING;
	return strcmp(reg, "staged_command") == 0 || strcmp(reg, "control_request") == 0 ? SHARED :
	                                                                                   OWN;
}

void db_opcua_acting_write(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                           const char *drive, const char *reg, json_t *value, bool block,
                           bool command, bool stops, struct db_opcua_outcome *outcome)
{
	struct db_lane *own = find_own(acting, actor->session, drive);
	json_t **kept = own ? db_lane_note(own, drive) : NULL;
	bool uses_block = command || strcmp(reg, "staged_command") == 0;
	/* With this session's arguments, whatever other clients have written there meanwhile. */
	json_t *values = uses_block && kept && *kept ? json_copy(*kept) : json_object();
	char what[80];

	if (!has_right_place(actor, way_of_write(reg, stops) == PASSING, outcome)) {
		json_decref(values);
		return;
	}
	(void)json_object_set(values, reg, value);
	snprintf(what, sizeof(what), "write of %s", reg);
	act(acting, actor, drive, what, way_of_write(reg, stops), "Write",
	    json_pack("{s:s, s:o, s:s*}", "drive", drive, "values", values, "token",
	              actor->token[0] ? actor->token : NULL),
	    outcome);
	if (!block || uses_block || outcome->pending || outcome->reason[0] != '\0')
		return;
	own = find_own(acting, actor->session, drive);
	kept = own ? db_lane_note(own, drive) : NULL;
	if (kept && !*kept)
		*kept = json_object();
	if (kept)
		(void)json_object_set(*kept, reg, value);
}

void db_opcua_acting_acknowledge(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                                 int64_t alarm, const char *comment,
                                 struct db_opcua_outcome *outcome)
{
	char what[64];

	if (!has_right_place(actor, false, outcome))
		return;
	snprintf(what, sizeof(what), "acknowledgement of alarm %lld", (long long)alarm);
	act(acting, actor, "", what, SHARED, "AcknowledgeAlarm",
	    json_pack("{s:I, s:s*}", "id", (json_int_t)alarm, "comment",
	              comment[0] ? comment : NULL),
	    outcome);
	/* Its answer is the alarm, without a result. */
	if (!outcome->pending && outcome->result[0] == '\0')
		snprintf(outcome->result, sizeof(outcome->result), "ok");
}

/* --- watchdogs -------------------------------------------------------------------------------- */

void db_opcua_acting_feed(struct db_opcua_acting *acting, unsigned session, db_time now)
{
	for (struct db_lane *lane = NULL; (lane = next_lane(acting, session, lane));)
		db_lane_feed(lane, now);
}

db_time db_opcua_acting_due(const struct db_opcua_acting *acting)
{
	return db_lanes_due(acting->lanes);
}

void db_opcua_acting_begin(struct db_opcua_acting *acting, db_time now)
{
	acting->now = now;
	acting->awaited = 0;
}
