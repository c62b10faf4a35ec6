/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/acting.h"

#include "client/client.h"
#include "client/log.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A session that had nothing to do for so long may be closed for another drive's sake. */
#define IDLE_MIN (60 * DB_NS_PER_S)

/* One connection more is for stops. */
#define SESSIONS_MAX (DB_MQTT_ACTING_FDS - 1)

/* For one drive: who commands it in a flood leaves some for the others. */
#define SESSIONS_EACH (SESSIONS_MAX / 2)

#define WRITE_NAME "write"

struct session {
	struct db_mqtt_acting *acting;
	struct db_client *client; /* NULL: there is none */
	char drive[32];
	char id[DB_MQTT_ID_MAX + 1];
	char command[48];
	char user[DB_MQTT_USER_MAX + 1]; /* for whom it said last that it acts */
	bool busy;                       /* with a command ... */
	bool stops;                      /* ... that is a stop */
	bool feeding;                    /* a sign of life is on its way */
	db_time used;
};

struct db_mqtt_acting {
	const char *socket;
	db_mqtt_result_fn *result;
	void *context;
	struct session sessions[SESSIONS_MAX];
	/* There since there is a session: for stops that find them all taken. */
	struct db_client *stopper;
	char stopper_user[DB_MQTT_USER_MAX + 1]; /* as that of a session */
};

struct db_mqtt_acting *db_mqtt_acting_new(const char *socket, db_mqtt_result_fn *result,
                                          void *context)
{
	struct db_mqtt_acting *acting = calloc(1, sizeof(*acting));

	if (!acting)
		return NULL;
	acting->socket = socket;
	acting->result = result;
	acting->context = context;
	for (size_t i = 0; i < SESSIONS_MAX; i++)
		acting->sessions[i].acting = acting;
	return acting;
}

static void close_session(struct session *session)
{
	db_client_close(session->client);
	session->client = NULL;
	session->user[0] = '\0';
	session->busy = false;
	session->feeding = false;
}

void db_mqtt_acting_free(struct db_mqtt_acting *acting)
{
	if (acting)
		(void)db_mqtt_acting_drop(acting);
	free(acting);
}

/* The last word of an error's name as results are written: io.drivebridge.Control.BadValue is bad_value. */
static void name_error(const char *error, char *name, size_t size)
{
	const char *last = strrchr(error, '.');
	size_t used = 0;

	for (const char *at = last ? last + 1 : error; *at && used + 2 < size; at++) {
		if (isupper((unsigned char)*at) && used > 0)
			name[used++] = '_';
		name[used++] = (char)tolower((unsigned char)*at);
	}
	name[used] = '\0';
}

static void take_introduction(void *data, json_t *parameters, const struct db_client_error *error,
                              bool more)
{
	const struct session *session = data;

	(void)parameters;
	(void)more;
	/* Which is then nobody's for the service. */
	if (error)
		db_client_log(DB_CLIENT_WARNING, "command %s to drive %s: its user is not told: %s",
		              session->command, session->drive, error->text);
}

/* Before what is done for him. */
static void introduce(struct session *session, const char *user)
{
	if (!session->client || strcmp(session->user, user) == 0)
		return;
	(void)snprintf(session->user, sizeof(session->user), "%s", user);
	(void)db_client_send(session->client, "Introduce", json_pack("{s:s}", "user", user), false,
	                     take_introduction, session);
}

/* A stop that found no session goes out without one, and without its end. False: there is no connection for that. */
static bool tell_stop(struct db_mqtt_acting *acting, const char *drive, const char *id,
                      const char *command, const char *user)
{
	if (acting->stopper && strcmp(acting->stopper_user, user) != 0) {
		(void)snprintf(acting->stopper_user, sizeof(acting->stopper_user), "%s", user);
		(void)db_client_tell(acting->stopper, "Introduce",
		                     json_pack("{s:s}", "user", user));
	}
	if (!acting->stopper ||
	    db_client_tell(acting->stopper, "Run",
	                   json_pack("{s:s, s:s}", "drive", drive, "command", command)) != 0)
		return false;
	acting->result(acting->context,
	               &(struct db_mqtt_outcome){
			       .drive = drive,
			       .sender = user,
			       .id = id,
			       .command = command,
			       .result = "pending",
			       .why = "too much is commanded at the same time to wait for its end",
		       });
	return true;
}

static void take_result(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct session *session = data;
	struct db_mqtt_acting *acting = session->acting;
	const json_t *words = error ? error->parameters : parameters;
	struct db_mqtt_outcome outcome = {
		.drive = session->drive,
		.sender = session->user,
		.id = session->id,
		.command = session->command,
		.result = json_string_value(json_object_get(words, "result")),
		.why = error ? error->text : "",
		.repeated = json_is_true(json_object_get(words, "repeated")),
	};
	char name[64] = "";

	session->busy = more;
	/* The service has no room for one more session. */
	if (error && session->stops && strcmp(error->name, DB_CLIENT_SERVICE "Busy") == 0 &&
	    tell_stop(acting, session->drive, session->id, session->command, session->user))
		return;
	/* Of what has ended badly the service says how. */
	if (error && !outcome.result) {
		name_error(error->name, name, sizeof(name));
		outcome.result = name;
		outcome.refused = strcmp(error->name, DB_CLIENT_LOST) != 0;
	}
	if (!outcome.result)
		outcome.result = name;
	acting->result(acting->context, &outcome);
}

static void take_sign(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct session *session = data;

	(void)parameters;
	(void)error;
	(void)more;
	session->feeding = false;
}

/* Whether the same command is under way. */
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

/* One that is free for the drive; NULL when all are taken. */
static struct session *find_session(struct db_mqtt_acting *acting, const char *drive, db_time now)
{
	struct session *empty = NULL;
	struct session *oldest = NULL;

	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		struct session *session = &acting->sessions[i];

		if (session->client && !session->busy && strcmp(session->drive, drive) == 0)
			return session;
		if (!session->client)
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

/* Why there is no connection is in `error`, "" when it is there. */
static void open_session(struct session *session, const char *drive, struct db_client_error *error)
{
	struct db_mqtt_acting *acting = session->acting;

	if (!acting->stopper)
		(void)db_client_open(acting->socket, &acting->stopper, error);
	if (session->client || db_client_open(acting->socket, &session->client, error) != 0)
		return;
	(void)snprintf(session->drive, sizeof(session->drive), "%s", drive);
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

	if (!call || db_mqtt_command_is_stop(command))
		return call;
	(void)json_object_set_new(call, "id", json_string(command->id));
	(void)json_object_set_new(call, "within_ms", json_integer(within_ms));
	/* A service that stood still has not seen it come. */
	(void)json_object_set_new(call, "sent_us", json_integer(now / DB_NS_PER_US));
	if (command->token)
		(void)json_object_set_new(call, "token", json_string(command->token));
	return call;
}

void db_mqtt_acting_run(struct db_mqtt_acting *acting, const char *drive,
                        const struct db_mqtt_command *command, unsigned within_ms, db_time now)
{
	bool stops = db_mqtt_command_is_stop(command);
	struct db_mqtt_outcome outcome = {
		.drive = drive,
		.sender = command->user,
		.id = command->id,
		.command = command->name ? command->name : WRITE_NAME,
		.why = "",
	};
	struct db_client_error error = { .parameters = NULL };
	struct session *session;
	json_t *parameters;

	/* Its end is told once for both. */
	if (!stops && is_under_way(acting, drive, command)) {
		outcome.result = "pending";
		outcome.repeated = true;
		acting->result(acting->context, &outcome);
		return;
	}
	session = stops || count_busy(acting, drive) < SESSIONS_EACH ?
	                  find_session(acting, drive, now) :
	                  NULL;
	if (!session && stops &&
	    tell_stop(acting, drive, command->id, outcome.command, command->user))
		return;
	if (!session) {
		outcome.result = "busy";
		outcome.why = "too much is commanded at the same time";
		outcome.refused = true;
		acting->result(acting->context, &outcome);
		return;
	}
	open_session(session, drive, &error);
	parameters = describe_call(drive, command, within_ms, now);
	(void)snprintf(session->id, sizeof(session->id), "%s", command->id);
	(void)snprintf(session->command, sizeof(session->command), "%s", outcome.command);
	session->stops = stops;
	session->used = now;
	session->busy = true;
	introduce(session, command->user);
	if (!session->client ||
	    db_client_send(session->client, command->name ? "Run" : "Write", parameters,
	                   command->name != NULL, take_result, session) != 0) {
		if (!session->client)
			json_decref(parameters);
		close_session(session);
		outcome.result = "lost";
		outcome.why = error.text[0] ? error.text : "the service has closed the connection";
		acting->result(acting->context, &outcome);
	}
	db_client_error_clear(&error);
}

void db_mqtt_acting_feed(struct db_mqtt_acting *acting, const char *drive, db_time now)
{
	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		struct session *session = &acting->sessions[i];

		if (!session->client || session->busy || session->feeding ||
		    strcmp(session->drive, drive) != 0)
			continue;
		session->used = now;
		/* What reads, lives. A connection that is lost shows when it is looked at next. */
		session->feeding = db_client_send(session->client, "Read",
		                                  json_pack("{s:s, s:[s]}", "drive", drive, "names",
		                                            "watchdog_remaining_ms"),
		                                  false, take_sign, session) == 0;
	}
}

bool db_mqtt_acting_drop(struct db_mqtt_acting *acting)
{
	bool any = false;

	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		any = any || acting->sessions[i].client;
		close_session(&acting->sessions[i]);
	}
	db_client_close(acting->stopper);
	acting->stopper = NULL;
	acting->stopper_user[0] = '\0';
	return any;
}

void db_mqtt_acting_watch(const struct db_mqtt_acting *acting,
                          struct pollfd fds[DB_MQTT_ACTING_FDS])
{
	for (size_t i = 0; i < DB_MQTT_ACTING_FDS; i++) {
		const struct db_client *client = i < SESSIONS_MAX ? acting->sessions[i].client :
		                                                    acting->stopper;

		fds[i] = (struct pollfd){ .fd = -1 };
		if (client)
			fds[i] = (struct pollfd){ .fd = db_client_fd(client),
				                  .events = db_client_poll_events(client) };
	}
}

void db_mqtt_acting_handle(struct db_mqtt_acting *acting)
{
	for (size_t i = 0; i < SESSIONS_MAX; i++) {
		struct session *session = &acting->sessions[i];

		if (session->client && db_client_handle(session->client) != 0)
			close_session(session);
	}
	if (acting->stopper && db_client_handle(acting->stopper) != 0) {
		db_client_close(acting->stopper);
		acting->stopper = NULL;
		acting->stopper_user[0] = '\0';
	}
}
