/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/acting.h"

#include "client/clock.h"
#include "client/link.h"
#include "client/log.h"
#include "client/stops.h"
#include "users/roles.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Longest time that operators wait for all callers of one turn together: twice the usual time of a
 * command. */
#define SHARE_MAX (30 * DB_NS_PER_MS)

/* Most connections at the same time, in addition to those of stops; the service has 64 for all its
 * tools. */
#define LINKS_MAX 14

/* Connections of one session, and stops without an answer. */
#define LINKS_PER_SESSION 4
#define STOPS_MAX 4

/* Longest and shortest interval for feeding a drive's watchdog. */
#define FEED_LONGEST (1 * DB_NS_PER_S)
#define FEED_SHORTEST (20 * DB_NS_PER_MS)

/* A drive that a connection has commanded. */
struct fed_drive {
	char name[64];
	db_time commanded; /* last */
	db_time due;       /* when it is to be fed next */
	bool feeding;      /* a feeding call is not answered yet */
	json_t *block;     /* what this session wrote into the command block; NULL: nothing yet */
	struct link *link;
	struct fed_drive *next;
};

struct link {
	struct db_opcua_acting *acting;
	struct db_link *connection; /* NULL: the place is free */
	bool lost;                  /* to be closed in the next turn */
	unsigned session;
	bool shared; /* for control and staged commands, and for starting all staged ones */
	/* The unanswered one; no other call waits for its end, because it could then be carried out
	 * when nobody expects it; NULL: none. */
	struct call *call;
	struct fed_drive *drives;
};

/* A call with a waiting caller, or one that has stopped waiting. */
struct call {
	struct db_opcua_acting *acting;
	struct link *link; /* NULL: it is a stop */
	char drive[64];
	char what[96]; /* for the log */
	bool done;
	bool left; /* the caller has stopped waiting: it is freed when it ends */
	struct db_opcua_outcome outcome;
};

struct db_opcua_acting {
	sd_event *loop;
	const struct db_opcua_config *config;
	const struct db_opcua_network *network;
	db_opcua_ended_fn *ended;
	db_opcua_feed_fn *feed;
	void *context;
	db_time now;     /* of this turn */
	db_time awaited; /* since when other clients wait in this turn; 0: none does */
	struct link links[LINKS_MAX];
	struct db_stops *stops;
};

struct db_opcua_acting *db_opcua_acting_new(sd_event *loop, const struct db_opcua_config *config,
                                            const struct db_opcua_network *network,
                                            db_opcua_ended_fn *ended, db_opcua_feed_fn *feed,
                                            void *context)
{
	struct db_opcua_acting *acting = calloc(1, sizeof(*acting));

	if (!acting)
		return NULL;
	acting->loop = loop;
	acting->config = config;
	acting->network = network;
	acting->ended = ended;
	acting->feed = feed;
	acting->context = context;
	for (size_t i = 0; i < LINKS_MAX; i++)
		acting->links[i].acting = acting;
	acting->stops = db_stops_new(loop, config->socket, STOPS_MAX);
	if (acting->stops)
		return acting;
	free(acting);
	return NULL;
}

/* --- connections ------------------------------------------------------------------------------ */

/* A call under way continues in the service; its result is dropped. */
static void close_link(struct link *link)
{
	db_link_drop(link->connection);
	free(link->call);
	while (link->drives) {
		struct fed_drive *drive = link->drives;

		link->drives = drive->next;
		json_decref(drive->block);
		free(drive);
	}
	*link = (struct link){ .acting = link->acting };
}

void db_opcua_acting_free(struct db_opcua_acting *acting)
{
	for (size_t i = 0; acting && i < LINKS_MAX; i++)
		close_link(&acting->links[i]);
	if (acting)
		db_stops_free(acting->stops);
	free(acting);
}

void db_opcua_acting_drop(struct db_opcua_acting *acting, unsigned session)
{
	for (size_t i = 0; i < LINKS_MAX; i++) {
		if (acting->links[i].connection && acting->links[i].session == session)
			close_link(&acting->links[i]);
	}
}

static struct fed_drive *find_fed(const struct link *link, const char *drive)
{
	for (struct fed_drive *fed = link->drives; fed; fed = fed->next) {
		if (strcmp(fed->name, drive) == 0)
			return fed;
	}
	return NULL;
}

static size_t count_fed(const struct link *link)
{
	size_t count = 0;

	for (const struct fed_drive *fed = link->drives; fed; fed = fed->next)
		count++;
	return count;
}

static void fail(struct db_opcua_outcome *outcome, const char *result, const char *reason)
{
	(void)snprintf(outcome->result, sizeof(outcome->result), "%s", result);
	(void)snprintf(outcome->reason, sizeof(outcome->reason), "%.255s", reason);
}

static void lose_link(void *data)
{
	struct link *link = data;

	link->lost = true;
}

static struct link *open_link(struct db_opcua_acting *acting, unsigned session,
                              struct db_opcua_outcome *outcome)
{
	struct db_client_error error = { .parameters = NULL };
	struct link *empty = NULL;

	for (size_t i = 0; i < LINKS_MAX && !empty; i++)
		empty = acting->links[i].connection ? NULL : &acting->links[i];
	if (!empty) {
		fail(outcome, "busy", "too many sessions command at the same time");
		return NULL;
	}
	empty->connection = db_link_open(acting->loop, acting->config->socket, lose_link, empty,
	                                 &error);
	if (!empty->connection) {
		fail(outcome, "Unreachable", error.text);
		db_client_error_clear(&error);
		return NULL;
	}
	empty->session = session;
	db_stops_prepare(acting->stops);
	return empty;
}

/* The connection over which this session commands the drive; NULL: there is none yet. */
static struct link *find_own(struct db_opcua_acting *acting, unsigned session, const char *drive)
{
	struct link *found = NULL;

	for (size_t i = 0; i < LINKS_MAX; i++) {
		struct link *link = &acting->links[i];

		if (link->connection && link->session == session && find_fed(link, drive) &&
		    (!found || link->shared))
			found = link;
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

static struct link *find_link(struct db_opcua_acting *acting, unsigned session, const char *drive,
                              enum way way, struct db_opcua_outcome *outcome)
{
	struct link *link = way == SHARED ? NULL : find_own(acting, session, drive);
	struct link *least = NULL;
	size_t own = 0;

	for (size_t i = 0; i < LINKS_MAX && !link; i++) {
		struct link *other = &acting->links[i];

		if (!other->connection || other->session != session)
			continue;
		if (way == SHARED && other->shared)
			link = other;
		own++;
		if (!least || (least->call && !other->call) ||
		    (!other->call == !least->call && count_fed(other) < count_fed(least)))
			least = other;
	}
	if (!link && own < LINKS_PER_SESSION)
		link = open_link(acting, session, outcome);
	if (!link)
		link = least;
	if (link && way == SHARED)
		link->shared = true;
	return link;
}

/* --- answers ---------------------------------------------------------------------------------- */

static const char *words_of(const struct db_opcua_outcome *outcome)
{
	return outcome->reason[0] ? outcome->reason : outcome->result[0] ? outcome->result : "done";
}

/* The call was sent, and no answer has arrived or will: it is unknown whether it was carried
 * out. */
static bool leaves_open(const struct db_client_error *error)
{
	return strcmp(error->name, DB_CLIENT_LOST) == 0 ||
	       strcmp(error->name, DB_CLIENT_BAD_ANSWER) == 0 ||
	       strcmp(error->name, DB_CLIENT_NO_MEMORY) == 0;
}

/* Precedes its name in the log. */
static const char *kind_of(const char *drive)
{
	return drive[0] != '\0' ? "drive " : "gateway";
}

static void on_result(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct call *call = data;
	const char *result = json_string_value(json_object_get(parameters, "result"));
	struct db_opcua_outcome *outcome = &call->outcome;

	(void)more;
	if (call->link)
		call->link->call = NULL;
	call->done = true;
	outcome->pending = result && strcmp(result, "pending") == 0;
	if (error && strcmp(error->name, DB_STOPS_PENDING) == 0) {
		result = "pending";
		outcome->pending = true;
		(void)snprintf(outcome->reason, sizeof(outcome->reason), "%.255s", error->text);
	} else if (error && leaves_open(error)) {
		result = "indeterminate";
		(void)snprintf(outcome->reason, sizeof(outcome->reason),
		               "%.180s; whether the drive has done it is not known", error->text);
	} else if (error) {
		result = json_string_value(json_object_get(error->parameters, "result"));
		if (!result)
			result = db_client_error_short(error);
		(void)snprintf(outcome->reason, sizeof(outcome->reason), "%.255s", error->text);
	}
	(void)snprintf(outcome->result, sizeof(outcome->result), "%.31s", result ? result : "");
	if (!call->left)
		return;
	db_client_log(error ? DB_CLIENT_WARNING : DB_CLIENT_INFO, "%s%s: %s ended: %s",
	              kind_of(call->drive), call->drive, call->what, words_of(outcome));
	call->acting->ended(call->acting->context, call->drive, outcome);
	free(call);
}

void db_opcua_acting_go_on(struct db_opcua_acting *acting)
{
	db_time now = db_client_now();

	if (now - acting->now < FEED_SHORTEST)
		return;
	acting->now = now;
	/* Answers tell when the next feeding is due. A lost connection is closed in the next
	 * turn. */
	for (size_t i = 0; i < LINKS_MAX; i++) {
		if (acting->links[i].connection && !acting->links[i].lost)
			db_link_handle(acting->links[i].connection);
	}
	acting->feed(acting->context, now);
}

/* Until the call has ended, also by the loss of its connection, or other clients have waited long
 * enough. */
static void wait_for(struct call *call)
{
	struct db_opcua_acting *acting = call->acting;
	/* A stop's is closed by its answer. */
	struct db_link *connection = call->link ? call->link->connection :
	                                          db_stops_link(acting->stops, call);
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
		fds[0].fd = db_link_fd(connection, &fds[0].events);
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

/* From now on commands for the drive use `to`, with this session's part of the command block, and
 * with control. The former connection still feeds what was commanded over it. */
static void move_drive(struct link *from, struct link *to, const char *name)
{
	struct fed_drive *before = find_fed(from, name);
	struct fed_drive *fed = find_fed(to, name);

	json_decref(fed->block);
	fed->block = before->block;
	before->block = NULL;
	/* The next write takes control. Without control in the configuration the service answers
	 * with an error, which is ignored. */
	(void)db_link_send(
		from->connection, "Write",
		json_pack("{s:s, s:{s:i}}", "drive", name, "values", "control_request", 0), false,
		NULL, NULL);
}

/* False: out of memory. */
static bool remember_drive(struct link *link, const char *name, db_time now)
{
	struct link *before = find_own(link->acting, link->session, name);
	struct fed_drive *fed = find_fed(link, name);

	if (!fed) {
		fed = calloc(1, sizeof(*fed));
		if (!fed)
			return false;
		(void)snprintf(fed->name, sizeof(fed->name), "%s", name);
		fed->link = link;
		fed->next = link->drives;
		link->drives = fed;
	}
	if (before && before != link)
		move_drive(before, link, name);
	fed->commanded = now;
	fed->due = now;
	return true;
}

/* The connection to use, without an unanswered call. */
static struct link *take_link(struct db_opcua_acting *acting, unsigned session, const char *drive,
                              enum way way, struct db_opcua_outcome *outcome)
{
	const struct link *before = find_own(acting, session, drive);
	struct link *link = find_link(acting, session, drive, drive[0] == '\0' ? SHARED : way,
	                              outcome);

	if (!link)
		return NULL;
	if (link->call || (before && before->call)) {
		fail(outcome, "busy",
		     "what was told before has not ended; nothing waits behind it");
		return NULL;
	}
	if (drive[0] == '\0') {
		/* A command of the gateway may start each of its drives. */
		for (struct fed_drive *fed = link->drives; fed; fed = fed->next)
			fed->commanded = fed->due = db_client_now();
	} else if (!remember_drive(link, drive, db_client_now())) {
		fail(outcome, "NoMemory", "out of memory");
		return NULL;
	}
	return link;
}

/* Takes `parameters` over. False: it was not sent. */
static bool send_call(struct call *call, const struct db_opcua_actor *actor, const char *method,
                      json_t *parameters)
{
	char key[96];

	if (call->link) {
		/* A session may be activated again as another user. */
		db_link_introduce(call->link->connection, actor->user, actor->from, NULL, NULL);
		return db_link_send(call->link->connection, method, parameters, false, on_result,
		                    call) == 0;
	}
	(void)snprintf(key, sizeof(key), "%u %s", actor->session, call->drive);
	return db_stops_send(call->acting->stops, key,
	                     &(struct db_stops_user){ actor->user, actor->from }, method,
	                     parameters, false, on_result, call);
}

/* Takes `parameters` over. Sends, and waits for the end. */
static void act(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                const char *drive, const char *what, enum way way, const char *method,
                json_t *parameters, struct db_opcua_outcome *outcome)
{
	struct link *link = NULL;
	struct call *call;

	*outcome = (struct db_opcua_outcome){ .pending = false };
	if (way != PASSING) {
		link = take_link(acting, actor->session, drive, way, outcome);
		if (!link) {
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
	call->link = link;
	(void)snprintf(call->drive, sizeof(call->drive), "%s", drive);
	(void)snprintf(call->what, sizeof(call->what), "%s by %s", what, actor->label);
	/* gcc's analyzer: it is the link's now, which frees it. */
	if (link)
		link->call = call;
	if (!send_call(call, actor, method, parameters)) {
		fail(outcome, "Lost", "the service has closed the connection");
		if (link)
			close_link(link);
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
		     outcome->reason[0] ?
		             call->outcome.reason :
		             "the drive has not confirmed it yet; it goes on, and Result tells how it "
		             "ends");
	db_client_log(DB_CLIENT_NOTICE, "%s%s: %s: %s", kind_of(drive), drive, call->what,
	              words_of(outcome));
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

/* NULL leaves it out. */
static const char *token_of(const struct db_opcua_actor *actor)
{
	return actor->token[0] ? actor->token : NULL;
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
	              arguments, "token", token_of(actor)),
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
	struct link *own = find_own(acting, actor->session, drive);
	const struct fed_drive *fed = own ? find_fed(own, drive) : NULL;
	bool uses_block = command || strcmp(reg, "staged_command") == 0;
	/* With this session's arguments, whatever other clients have written there meanwhile. */
	json_t *values = uses_block && fed && fed->block ? json_copy(fed->block) : json_object();
	struct fed_drive *keeper;
	char what[80];

	if (!has_right_place(actor, way_of_write(reg, stops) == PASSING, outcome)) {
		json_decref(values);
		return;
	}
	(void)json_object_set(values, reg, value);
	(void)snprintf(what, sizeof(what), "write of %s", reg);
	act(acting, actor, drive, what, way_of_write(reg, stops), "Write",
	    json_pack("{s:s, s:o, s:s*}", "drive", drive, "values", values, "token",
	              token_of(actor)),
	    outcome);
	if (!block || uses_block || outcome->pending || outcome->reason[0] != '\0')
		return;
	own = find_own(acting, actor->session, drive);
	keeper = own ? find_fed(own, drive) : NULL;
	if (keeper && !keeper->block)
		keeper->block = json_object();
	if (keeper)
		(void)json_object_set(keeper->block, reg, value);
}

void db_opcua_acting_acknowledge(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                                 int64_t alarm, const char *comment,
                                 struct db_opcua_outcome *outcome)
{
	char what[64];

	if (!has_right_place(actor, false, outcome))
		return;
	(void)snprintf(what, sizeof(what), "acknowledgement of alarm %lld", (long long)alarm);
	act(acting, actor, "", what, SHARED, "AcknowledgeAlarm",
	    json_pack("{s:I, s:s*}", "id", (json_int_t)alarm, "comment",
	              comment[0] ? comment : NULL),
	    outcome);
	/* Its answer is the alarm, without a result. */
	if (!outcome->pending && outcome->result[0] == '\0')
		(void)snprintf(outcome->result, sizeof(outcome->result), "ok");
}

/* --- watchdogs -------------------------------------------------------------------------------- */

/* Time until silence would end something; 0 if it would end nothing. */
static db_time time_left(const json_t *values)
{
	json_int_t watchdog = json_integer_value(json_object_get(values, "watchdog_remaining_ms"));
	json_int_t control = json_integer_value(json_object_get(values, "control_remaining_ms"));

	/* Reads 1 on the connection that has control. */
	if (json_integer_value(json_object_get(values, "control_request")) != 1)
		control = 0;
	if (watchdog > 0 && control > 0)
		return (watchdog < control ? watchdog : control) * DB_NS_PER_MS;
	return (watchdog > 0 ? watchdog : control) * DB_NS_PER_MS;
}

static void on_feed_answer(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct fed_drive *fed = data;
	db_time left = time_left(json_object_get(parameters, "values"));
	db_time wait = left / 4;
	db_time now = db_client_now();

	(void)more;
	if (wait > FEED_LONGEST || error)
		wait = FEED_LONGEST;
	if (wait < FEED_SHORTEST)
		wait = FEED_SHORTEST;
	fed->feeding = false;
	/* The watchdog stays armed at standstill, and control stays too. The next command starts
	 * both again, which may show a little later than its answer. */
	if (left > 0 || error || now - fed->commanded < FEED_LONGEST)
		fed->due = now + wait;
	else
		fed->due = DB_TIME_NEVER;
}

void db_opcua_acting_feed(struct db_opcua_acting *acting, unsigned session, db_time now)
{
	for (size_t i = 0; i < LINKS_MAX; i++) {
		struct link *link = &acting->links[i];

		/* While a call is unanswered, a feeding call after it would not be processed. */
		if (!link->connection || link->session != session || link->call)
			continue;
		for (struct fed_drive *fed = link->drives; fed; fed = fed->next) {
			if (fed->feeding || now < fed->due)
				continue;
			/* A read shows that the client is alive. A lost connection is noticed at
			 * its next handling. */
			fed->feeding = db_link_send(
					       link->connection, "Read",
					       json_pack("{s:s, s:[s,s,s]}", "drive", fed->name,
			                                 "names", "watchdog_remaining_ms",
			                                 "control_request", "control_remaining_ms"),
					       false, on_feed_answer, fed) == 0;
		}
	}
}

db_time db_opcua_acting_due(const struct db_opcua_acting *acting)
{
	db_time due = DB_TIME_NEVER;

	for (size_t i = 0; i < LINKS_MAX; i++) {
		for (const struct fed_drive *fed = acting->links[i].drives; fed; fed = fed->next) {
			if (!fed->feeding && fed->due < due)
				due = fed->due;
		}
	}
	return due;
}

void db_opcua_acting_begin(struct db_opcua_acting *acting, db_time now)
{
	acting->now = now;
	acting->awaited = 0;
	for (size_t i = 0; i < LINKS_MAX; i++) {
		struct link *link = &acting->links[i];

		if (link->lost)
			close_link(link);
	}
}
