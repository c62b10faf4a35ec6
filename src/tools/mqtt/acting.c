/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/acting.h"

#include "client/link.h"
#include "client/log.h"
#include "client/stops.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A session without work for this time may be closed when another drive needs one. */
#define IDLE_MIN (60 * DB_NS_PER_S)

/* Twelve drives can be commanded at the same time, and all of them can be stopped; the service has
 * 64 sessions for all its tools. */
#define SESSIONS_MAX 12

/* Stops whose answers are waited for at the same time. */
#define STOPS_MAX 4

/* For one drive: a flood of commands for it leaves sessions for the others. */
#define SESSIONS_EACH (SESSIONS_MAX / 2)

#define WRITE_NAME "write"

struct session {
	struct db_mqtt_acting *acting;
	struct db_link *link; /* NULL: there is none */
	char drive[32];
	char id[DB_MQTT_ID_MAX + 1];
	char command[48];
	char user[DB_MQTT_USER_MAX + 1]; /* of the last command */
	bool busy;                       /* a command is under way */
	bool feeding;                    /* a feeding call is not answered yet */
	db_time used;
};

/* A stop without its last answer. */
struct stop {
	struct db_mqtt_acting *acting;
	char drive[32];
	char id[DB_MQTT_ID_MAX + 1];
	char command[48];
	char user[DB_MQTT_USER_MAX + 1];
};

struct db_mqtt_acting {
	sd_event *loop;
	const char *socket;
	const char *from; /* for the audit trail; "": the service has none */
	db_mqtt_result_fn *result;
	void *context;
	struct session sessions[SESSIONS_MAX];
	struct db_stops *stops;
	bool drops; /* within db_mqtt_acting_drop(): nothing is reported */
};

struct db_mqtt_acting *db_mqtt_acting_new(sd_event *loop, const char *socket,
                                          db_mqtt_result_fn *result, void *context)
{
	struct db_mqtt_acting *acting = calloc(1, sizeof(*acting));

	if (!acting)
		return NULL;
	acting->loop = loop;
	acting->socket = socket;
	acting->from = "";
	acting->result = result;
	acting->context = context;
	for (size_t i = 0; i < SESSIONS_MAX; i++)
		acting->sessions[i].acting = acting;
	acting->stops = db_stops_new(loop, socket, STOPS_MAX);
	if (acting->stops)
		return acting;
	free(acting);
	return NULL;
}

static void close_session(struct session *session)
{
	db_link_drop(session->link);
	session->link = NULL;
	session->busy = false;
	session->feeding = false;
}

void db_mqtt_acting_free(struct db_mqtt_acting *acting)
{
	if (!acting)
		return;
	(void)db_mqtt_acting_drop(acting);
	db_stops_free(acting->stops);
	free(acting);
}

/* An error's name in the form of results: BadValue is bad_value. */
static void name_error(const struct db_client_error *error, char *name, size_t size)
{
	size_t used = 0;

	for (const char *at = db_client_error_short(error); *at && used + 2 < size; at++) {
		if (isupper((unsigned char)*at) && used > 0)
			name[used++] = '_';
		name[used++] = (char)tolower((unsigned char)*at);
	}
	name[used] = '\0';
}

static void on_introduced(void *data, json_t *parameters, const struct db_client_error *error,
                          bool more)
{
	const struct session *session = data;

	(void)parameters;
	(void)more;
	/* After an error the session has no user at the service. */
	if (error)
		db_client_log(DB_CLIENT_WARNING, "command %s to drive %s: its user is not told: %s",
		              session->command, session->drive, error->text);
}

/* Reports an answer, or an error, with the command that is in `outcome`. */
static void report(const struct db_mqtt_acting *acting, struct db_mqtt_outcome *outcome,
                   const json_t *parameters, const struct db_client_error *error)
{
	const json_t *words = error ? error->parameters : parameters;
	char name[64] = "";

	outcome->result = json_string_value(json_object_get(words, "result"));
	outcome->repeated = json_is_true(json_object_get(words, "repeated"));
	outcome->why = error ? error->text : "";
	/* For an error the service gives the reason. */
	if (error && !outcome->result) {
		name_error(error, name, sizeof(name));
		outcome->refused = strcmp(error->name, DB_CLIENT_LOST) != 0 &&
		                   strcmp(error->name, DB_STOPS_PENDING) != 0;
	}
	if (!outcome->result)
		outcome->result = name;
	acting->result(acting->context, outcome);
}

static void on_result(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct session *session = data;

	session->busy = more;
	report(session->acting,
	       &(struct db_mqtt_outcome){
		       .drive = session->drive,
		       .sender = session->user,
		       .id = session->id,
		       .command = session->command,
	       },
	       parameters, error);
}

static void on_stop_answer(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct stop *stop = data;

	if (!stop->acting->drops)
		report(stop->acting,
		       &(struct db_mqtt_outcome){
			       .drive = stop->drive,
			       .sender = stop->user,
			       .id = stop->id,
			       .command = stop->command,
		       },
		       parameters, error);
	if (!more)
		free(stop);
}

static void on_feed_answer(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct session *session = data;

	(void)parameters;
	(void)error;
	(void)more;
	session->feeding = false;
}

/* True if the same command is under way. */
static bool is_under_way(const struct db_mqtt_acting *acting, const char *drive,
                         const struct db_mqtt_command *command)
{
	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		const struct session *session = &acting->sessions[i];

		if (session->busy && strcmp(session->drive, drive) == 0 &&
		    strcmp(session->id, command->id) == 0 &&
		    strcmp(session->user, command->user) == 0)
			return true;
	}
	return false;
}

static size_t count_busy(const struct db_mqtt_acting *acting, const char *drive)
{
	size_t count = 0;

	for (size_t i = 0; i < SESSIONS_MAX; i++)
		count += acting->sessions[i].busy && strcmp(acting->sessions[i].drive, drive) == 0;
	return count;
}

/* A free one for the drive; NULL when all are taken. */
static struct session *find_session(struct db_mqtt_acting *acting, const char *drive, db_time now)
{
	struct session *empty = NULL;
	struct session *oldest = NULL;

	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		struct session *session = &acting->sessions[i];

		if (session->link && !session->busy && strcmp(session->drive, drive) == 0)
			return session;
		if (!session->link)
			empty = session;
		else if (!session->busy && now - session->used >= IDLE_MIN &&
		         (!oldest || session->used < oldest->used))
			oldest = session;
	}
	if (empty || !oldest)
		return empty;
	close_session(oldest);
	return oldest;
}

static void lose_session(void *data)
{
	close_session(data);
}

/* Without a connection the reason is in `error`, else it is "". */
static void open_session(struct session *session, const char *drive, struct db_client_error *error)
{
	struct db_mqtt_acting *acting = session->acting;

	db_stops_prepare(acting->stops);
	if (!session->link)
		session->link = db_link_open(acting->loop, acting->socket, lose_session, session,
		                             error);
	(void)snprintf(session->drive, sizeof(session->drive), "%s", drive);
}

/* Past all sessions. */
static void send_stop(struct db_mqtt_acting *acting, const char *drive,
                      const struct db_mqtt_command *command, struct db_mqtt_outcome *outcome)
{
	struct stop *stop = calloc(1, sizeof(*stop));

	if (stop) {
		stop->acting = acting;
		(void)snprintf(stop->drive, sizeof(stop->drive), "%s", drive);
		(void)snprintf(stop->id, sizeof(stop->id), "%s", command->id);
		(void)snprintf(stop->command, sizeof(stop->command), "%s", command->name);
		(void)snprintf(stop->user, sizeof(stop->user), "%s", command->user);
	}
	if (stop &&
	    db_stops_send(acting->stops, drive,
	                  &(struct db_stops_user){ command->user, acting->from }, "Run",
	                  json_pack("{s:s, s:s, s:O*, s:b}", "drive", drive, "command",
	                            command->name, "arguments", command->arguments, "until_end", 1),
	                  true, on_stop_answer, stop))
		return;
	free(stop);
	outcome->result = "lost";
	outcome->why = "drivebridged cannot be reached";
	acting->result(acting->context, outcome);
}

/* The parameters of Run or Write. */
static json_t *describe_call(const char *drive, const struct db_mqtt_command *command,
                             unsigned within_ms, db_time now)
{
	json_t *call = command->name ? json_pack("{s:s, s:s, s:O?, s:b}", "drive", drive, "command",
	                                         command->name, "arguments", command->arguments,
	                                         "until_end", 1) :
	                               json_pack("{s:s, s:O}", "drive", drive, "values",
	                                         command->arguments);

	(void)json_object_set_new(call, "id", json_string(command->id));
	(void)json_object_set_new(call, "within_ms", json_integer(within_ms));
	/* If the service was not running, it has not seen when the call arrived. */
	(void)json_object_set_new(call, "sent_us", json_integer(now / DB_NS_PER_US));
	if (command->token)
		(void)json_object_set_new(call, "token", json_string(command->token));
	return call;
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
	struct session *session = NULL;
	bool sent = false;

	if (command->stops) {
		send_stop(acting, drive, command, &outcome);
		return;
	}
	/* Both get one result. */
	if (is_under_way(acting, drive, command)) {
		outcome.result = "pending";
		outcome.repeated = true;
		acting->result(acting->context, &outcome);
		return;
	}
	if (count_busy(acting, drive) < SESSIONS_EACH)
		session = find_session(acting, drive, now);
	if (!session) {
		outcome.result = "busy";
		outcome.why = "too much is commanded at the same time";
		outcome.refused = true;
		acting->result(acting->context, &outcome);
		return;
	}
	open_session(session, drive, &error);
	(void)snprintf(session->id, sizeof(session->id), "%s", command->id);
	(void)snprintf(session->command, sizeof(session->command), "%s", outcome.command);
	(void)snprintf(session->user, sizeof(session->user), "%s", command->user);
	session->used = now;
	session->busy = true;
	if (session->link) {
		db_link_introduce(session->link, command->user, acting->from, on_introduced,
		                  session);
		sent = db_link_send(session->link, command->name ? "Run" : "Write",
		                    describe_call(drive, command, within_ms, now),
		                    command->name != NULL, on_result, session) == 0;
	}
	if (!sent) {
		close_session(session);
		outcome.result = "lost";
		outcome.why = error.text[0] ? error.text : "the service has closed the connection";
		acting->result(acting->context, &outcome);
	}
	db_client_error_clear(&error);
}

void db_mqtt_acting_set_audit(struct db_mqtt_acting *acting, bool has_audit)
{
	acting->from = has_audit ? "MQTT" : "";
}

void db_mqtt_acting_feed(struct db_mqtt_acting *acting, const char *drive, const char *user,
                         db_time now)
{
	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		struct session *session = &acting->sessions[i];

		if (!session->link || session->busy || session->feeding ||
		    strcmp(session->drive, drive) != 0 ||
		    (user && strcmp(session->user, user) != 0))
			continue;
		session->used = now;
		/* A read shows that the client is alive. A lost connection is noticed at its next
		 * handling. */
		session->feeding = db_link_send(session->link, "Read",
		                                json_pack("{s:s, s:[s]}", "drive", drive, "names",
		                                          "watchdog_remaining_ms"),
		                                false, on_feed_answer, session) == 0;
	}
}

bool db_mqtt_acting_drop(struct db_mqtt_acting *acting)
{
	bool any = false;

	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		any = any || acting->sessions[i].link;
		close_session(&acting->sessions[i]);
	}
	acting->drops = true;
	any = db_stops_drop(acting->stops) || any;
	acting->drops = false;
	return any;
}
