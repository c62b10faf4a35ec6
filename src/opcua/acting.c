/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/acting.h"

#include "client/client.h"
#include "client/clock.h"
#include "client/log.h"
#include "client/stops.h"
#include "users/roles.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Callers of one turn make operators wait for so long at most, together: twice as long as a command usually takes. */
#define SHARE_MAX (30 * DB_NS_PER_MS)

/* Connections of one session, and those that only stops may take. */
#define LINKS_PER_SESSION 4
#define LINKS_RESERVED 2

/* How often a drive's watchdog is fed at least, and at most. */
#define FEED_LONGEST (1 * DB_NS_PER_S)
#define FEED_SHORTEST (20 * DB_NS_PER_MS)

/* A drive that a connection has commanded. */
struct fed_drive {
	char name[64];
	db_time told;  /* when it was commanded last */
	db_time due;   /* when it is fed next */
	bool feeding;  /* a sign of life is on its way */
	json_t *block; /* what this session wrote into the command block; NULL: nothing yet */
	struct link *link;
	struct fed_drive *next;
};

struct link {
	struct db_opcua_acting *acting;
	struct db_client *client; /* NULL: there is none */
	unsigned session;
	/* For whom it said last that it acts; "": for nobody else. */
	char user[DB_USERS_NAME_MAX + 1];
	bool shared; /* what is claimed or staged goes over it, and so does the start of all that is staged */
	bool passing; /* for one stop; closed when that is answered */
	db_time opened;
	struct call *
		call; /* that is not answered: nothing waits behind it, to be done when nobody expects it; NULL */
	struct fed_drive *drives;
};

/* A call that somebody waits for, or has waited for. */
struct call {
	struct db_opcua_acting *acting;
	struct link *link;
	char drive[64];
	char what[96]; /* for the log */
	bool done;
	bool left; /* nobody waits any more: it is freed when it ends */
	struct db_opcua_outcome outcome;
};

struct db_opcua_acting {
	const struct db_opcua_config *config;
	const struct db_opcua_network *network;
	db_opcua_ended_fn *ended;
	db_opcua_feed_fn *feed;
	void *context;
	db_time now;     /* of this turn */
	db_time awaited; /* since when others have waited in this turn; 0: none does */
	struct link links[DB_OPCUA_ACTING_FDS];
};

struct db_opcua_acting *db_opcua_acting_new(const struct db_opcua_config *config,
                                            const struct db_opcua_network *network,
                                            db_opcua_ended_fn *ended, db_opcua_feed_fn *feed,
                                            void *context)
{
	struct db_opcua_acting *acting = calloc(1, sizeof(*acting));

	if (!acting)
		return NULL;
	acting->config = config;
	acting->network = network;
	acting->ended = ended;
	acting->feed = feed;
	acting->context = context;
	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++)
		acting->links[i].acting = acting;
	return acting;
}

/* --- connections ------------------------------------------------------------------------------ */

/* What is under way goes on without anybody who hears of its end. */
static void close_link(struct link *link)
{
	db_client_close(link->client);
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
	for (size_t i = 0; acting && i < DB_OPCUA_ACTING_FDS; i++)
		close_link(&acting->links[i]);
	free(acting);
}

void db_opcua_acting_drop(struct db_opcua_acting *acting, unsigned session)
{
	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		if (acting->links[i].client && acting->links[i].session == session)
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

static struct link *open_link(struct db_opcua_acting *acting, unsigned session, bool passing,
                              struct db_opcua_outcome *outcome)
{
	struct db_client_error error = { .parameters = NULL };
	struct link *empty = NULL;
	size_t free_count = 0;

	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		if (acting->links[i].client)
			continue;
		empty = &acting->links[i];
		free_count++;
	}
	if (!empty || (!passing && free_count <= LINKS_RESERVED)) {
		fail(outcome, "busy", "too many sessions command at the same time");
		return NULL;
	}
	if (db_client_open(acting->config->socket, &empty->client, &error) != 0) {
		fail(outcome, "Unreachable", error.text);
		db_client_error_clear(&error);
		return NULL;
	}
	empty->session = session;
	empty->passing = passing;
	empty->opened = db_client_now();
	return empty;
}

/* A stop that waits the longest gives its place to the next: the service goes on with it by itself. There always is one when
 * all places are taken, as some are reserved for stops. */
static void make_room(struct db_opcua_acting *acting)
{
	struct link *oldest = NULL;

	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		struct link *link = &acting->links[i];

		if (!link->client)
			return;
		if (link->passing && (!oldest || link->opened < oldest->opened))
			oldest = link;
	}
	if (oldest)
		close_link(oldest);
}

/* For a stop. One that was told before and is not answered, because the drive is silent, gives its place to the next. */
static struct link *open_passing(struct db_opcua_acting *acting, unsigned session,
                                 const char *drive, struct db_opcua_outcome *outcome)
{
	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		struct link *link = &acting->links[i];

		if (link->client && link->session == session && link->passing && link->call &&
		    strcmp(link->call->drive, drive) == 0)
			close_link(link);
	}
	make_room(acting);
	return open_link(acting, session, true, outcome);
}

/* The connection over which this session commands the drive; NULL: there is none yet. */
static struct link *find_own(struct db_opcua_acting *acting, unsigned session, const char *drive)
{
	struct link *found = NULL;

	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		struct link *link = &acting->links[i];

		if (link->client && link->session == session && !link->passing &&
		    find_fed(link, drive) && (!found || link->shared))
			found = link;
	}
	return found;
}

/* Which of a session's connections something goes over. */
enum way {
	/* Always the same for a drive, so that its commands keep their order. A new drive gets one to itself as far as there
	 * are some: what is told over it is answered before the next. */
	OWN,
	/* One for all drives: for the service a connection is a client, and only who has control of the drives starts them
	 * together. */
	SHARED,
	/* One for each stop. */
	PASSING,
};

static struct link *find_link(struct db_opcua_acting *acting, unsigned session, const char *drive,
                              enum way way, struct db_opcua_outcome *outcome)
{
	struct link *link = way == SHARED ? NULL : find_own(acting, session, drive);
	struct link *least = NULL;
	size_t own = 0;

	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS && !link; i++) {
		struct link *other = &acting->links[i];

		if (!other->client || other->session != session || other->passing)
			continue;
		if (way == SHARED && other->shared)
			link = other;
		own++;
		if (!least || (least->call && !other->call) ||
		    (!other->call == !least->call && count_fed(other) < count_fed(least)))
			least = other;
	}
	if (!link && own < LINKS_PER_SESSION)
		link = open_link(acting, session, false, outcome);
	if (!link)
		link = least;
	if (link && way == SHARED)
		link->shared = true;
	return link;
}

/* --- answers ---------------------------------------------------------------------------------- */

static const char *words_of(const struct db_opcua_outcome *outcome)
{
	return outcome->reason[0] ? outcome->reason : outcome->result;
}

/* The call was told, and no answer to it has come or will: whether it was done, nobody knows. */
static bool leaves_open(const struct db_client_error *error)
{
	return strcmp(error->name, DB_CLIENT_LOST) == 0 ||
	       strcmp(error->name, DB_CLIENT_BAD_ANSWER) == 0 ||
	       strcmp(error->name, DB_CLIENT_NO_MEMORY) == 0;
}

/* Before its name, in the log. */
static const char *kind_of(const char *drive)
{
	return drive[0] != '\0' ? "drive " : "gateway";
}

/* The last word of an error's name. */
static const char *short_name(const char *error)
{
	const char *last = strrchr(error, '.');

	return last ? last + 1 : error;
}

static void take_result(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct call *call = data;
	const char *result = json_string_value(json_object_get(parameters, "result"));
	struct db_opcua_outcome *outcome = &call->outcome;

	(void)more;
	call->link->call = NULL;
	call->done = true;
	outcome->pending = result && strcmp(result, "pending") == 0;
	if (error && leaves_open(error)) {
		result = "indeterminate";
		(void)snprintf(outcome->reason, sizeof(outcome->reason),
		               "%.180s; whether the drive has done it is not known", error->text);
	} else if (error) {
		result = json_string_value(json_object_get(error->parameters, "result"));
		if (!result)
			result = short_name(error->name);
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
	/* Answers say when the next feeding is due. A connection that is lost is closed in the next turn. */
	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		if (acting->links[i].client)
			(void)db_client_handle(acting->links[i].client);
	}
	acting->feed(acting->context, now);
}

/* Until it has ended, which it does with its connection, too, or others have waited long enough. */
static void wait_for(struct call *call)
{
	struct db_opcua_acting *acting = call->acting;
	db_time deadline = db_client_now() + acting->config->confirm_ms * DB_NS_PER_MS;
	struct pollfd fds[1 + DB_OPCUA_NETWORK_PLACES];

	(void)db_client_handle(call->link->client);
	while (!call->done) {
		db_time now = db_client_now();
		db_time until = acting->awaited > 0 && acting->awaited + SHARE_MAX < deadline ?
		                        acting->awaited + SHARE_MAX :
		                        deadline;
		struct timespec patience;
		size_t others = 0;

		if (now >= until)
			break;
		db_opcua_acting_go_on(acting);
		until = until - now < FEED_SHORTEST ? until - now : FEED_SHORTEST;
		patience = (struct timespec){ .tv_nsec = until };
		fds[0] = (struct pollfd){ .fd = db_client_fd(call->link->client),
			                  .events = db_client_poll_events(call->link->client) };
		if (acting->awaited == 0)
			others = db_opcua_network_watch(acting->network, DB_ROLE_OPERATOR, fds + 1,
			                                DB_OPCUA_NETWORK_PLACES);
		(void)ppoll(fds, 1 + others, &patience, NULL);
		for (size_t i = 1; i <= others && acting->awaited == 0; i++) {
			if (fds[i].revents & POLLIN)
				acting->awaited = db_client_now();
		}
		(void)db_client_handle(call->link->client);
	}
}

/* Takes `parameters` over. Sends, and waits for the end. */
static void make_call(struct link *link, const struct db_opcua_actor *actor, const char *drive,
                      const char *what, const char *method, json_t *parameters,
                      struct db_opcua_outcome *outcome)
{
	struct db_opcua_acting *acting = link->acting;
	struct call *call = calloc(1, sizeof(*call));

	if (!call) {
		json_decref(parameters);
		fail(outcome, "NoMemory", "out of memory");
		return;
	}
	call->acting = acting;
	call->link = link;
	/* gcc's analyzer: it is the link's now, which frees it. */
	link->call = call;
	(void)snprintf(call->drive, sizeof(call->drive), "%s", drive);
	(void)snprintf(call->what, sizeof(call->what), "%s by %s", what, actor->label);
	/* A session may be activated again as another user. */
	if (strcmp(link->user, actor->user) != 0) {
		(void)snprintf(link->user, sizeof(link->user), "%s", actor->user);
		(void)db_client_send(link->client, "Introduce",
		                     json_pack("{s:s}", "user", actor->user), false, NULL, NULL);
	}
	if (db_client_send(link->client, method, parameters, false, take_result, call) != 0) {
		fail(outcome, "Lost", "the service has closed the connection");
		close_link(link);
		return;
	}
	wait_for(call);
	if (call->done) {
		*outcome = call->outcome;
	} else {
		call->left = true;
		outcome->pending = true;
	}
	/* The service says so, too, of a stop that is told again already. */
	if (outcome->pending)
		fail(outcome, "pending",
		     "the drive has not confirmed it yet; it goes on, and Result tells how it ends");
	db_client_log(DB_CLIENT_NOTICE, "%s%s: %s: %s", kind_of(drive), drive, call->what,
	              words_of(outcome));
	if (call->done)
		free(call);
}

/* From now on it goes over `to`, with what this session wrote into its command block, and with the control of it. The
 * former connection still feeds what was commanded over it. */
static void move_drive(struct link *from, struct link *to, const char *name)
{
	struct fed_drive *before = find_fed(from, name);
	struct fed_drive *fed = find_fed(to, name);

	json_decref(fed->block);
	fed->block = before->block;
	before->block = NULL;
	/* The next write takes it. Where nobody can have control the service says so, and nobody listens. */
	(void)db_client_send(
		from->client, "Write",
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
	fed->told = now;
	fed->due = now;
	return true;
}

/* The gateway was told something that may set each of its drives going. */
static void feed_anew(struct link *link, db_time now)
{
	for (struct fed_drive *fed = link->drives; fed; fed = fed->next) {
		fed->told = now;
		fed->due = now;
	}
}

/* The connection for it, on which nothing is under way. */
static struct link *take_link(struct db_opcua_acting *acting, unsigned session, const char *drive,
                              enum way way, struct db_opcua_outcome *outcome)
{
	/* The service goes on with a stop for as long as the drive is silent: what else is told over the connection
	 * would wait for that. */
	struct link *link = way == PASSING ? open_passing(acting, session, drive, outcome) : NULL;
	const struct link *before = find_own(acting, session, drive);

	if (link)
		return link;
	link = find_link(acting, session, drive, drive[0] == '\0' ? SHARED : way, outcome);
	if (!link)
		return NULL;
	if (link->call || (before && before->call)) {
		fail(outcome, "busy",
		     "what was told before has not ended; nothing waits behind it");
		return NULL;
	}
	if (drive[0] == '\0') {
		feed_anew(link, db_client_now());
	} else if (!remember_drive(link, drive, db_client_now())) {
		fail(outcome, "NoMemory", "out of memory");
		return NULL;
	}
	return link;
}

static void act(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                const char *drive, const char *what, enum way way, const char *method,
                json_t *parameters, struct db_opcua_outcome *outcome)
{
	struct link *link;

	*outcome = (struct db_opcua_outcome){ .pending = false };
	link = take_link(acting, actor->session, drive, way, outcome);
	if (!link) {
		json_decref(parameters);
		return;
	}
	outcome->result[0] = '\0';
	outcome->reason[0] = '\0';
	make_call(link, actor, drive, what, method, parameters, outcome);
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
                         const char *drive, const char *command, json_t *arguments,
                         struct db_opcua_outcome *outcome)
{
	bool stops = db_client_is_stop(command);

	if (!has_right_place(actor, stops, outcome)) {
		json_decref(arguments);
		return;
	}
	act(acting, actor, drive, command, stops ? PASSING : OWN, "Run",
	    json_pack("{s:s, s:s, s:o, s:s*}", "drive", drive, "command", command, "arguments",
	              arguments, "token", token_of(actor)),
	    outcome);
}

static enum way way_of_write(const char *reg, const char *command)
{
	if (strcmp(reg, "group_stop") == 0 || strcmp(reg, "group_stop_units") == 0 ||
	    (command && db_client_is_stop(command)))
		return PASSING;
	return strcmp(reg, "staged_command") == 0 || strcmp(reg, "control_request") == 0 ? SHARED :
	                                                                                   OWN;
}

void db_opcua_acting_write(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                           const char *drive, const char *reg, json_t *value, bool block,
                           const char *command, struct db_opcua_outcome *outcome)
{
	struct link *own = find_own(acting, actor->session, drive);
	const struct fed_drive *fed = own ? find_fed(own, drive) : NULL;
	bool uses_block = command || strcmp(reg, "staged_command") == 0;
	/* With its own arguments, whatever others have written there meanwhile. */
	json_t *values = uses_block && fed && fed->block ? json_copy(fed->block) : json_object();
	struct fed_drive *keeper;
	char what[80];

	if (!has_right_place(actor, way_of_write(reg, command) == PASSING, outcome)) {
		json_decref(values);
		return;
	}
	(void)json_object_set(values, reg, value);
	(void)snprintf(what, sizeof(what), "write of %s", reg);
	act(acting, actor, drive, what, way_of_write(reg, command), "Write",
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

/* --- watchdogs -------------------------------------------------------------------------------- */

/* What is left until silence would end something: 0 when it would end nothing. */
static db_time time_left(const json_t *values)
{
	json_int_t watchdog = json_integer_value(json_object_get(values, "watchdog_remaining_ms"));
	json_int_t control = json_integer_value(json_object_get(values, "control_remaining_ms"));

	/* Reads 1 where this connection has it. */
	if (json_integer_value(json_object_get(values, "control_request")) != 1)
		control = 0;
	if (watchdog > 0 && control > 0)
		return (watchdog < control ? watchdog : control) * DB_NS_PER_MS;
	return (watchdog > 0 ? watchdog : control) * DB_NS_PER_MS;
}

static void take_sign(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct fed_drive *fed = data;
	db_time left = time_left(json_object_get(parameters, "values"));
	db_time wait = left / 4;

	(void)more;
	if (wait > FEED_LONGEST || error)
		wait = FEED_LONGEST;
	if (wait < FEED_SHORTEST)
		wait = FEED_SHORTEST;
	fed->feeding = false;
	/* The watchdog stays armed at a stand, and so does control. The next command begins both again, which may show a
	 * little later than its answer. */
	if (left > 0 || error || fed->link->acting->now - fed->told < FEED_LONGEST)
		fed->due = fed->link->acting->now + wait;
	else
		fed->due = DB_TIME_NEVER;
}

void db_opcua_acting_feed(struct db_opcua_acting *acting, unsigned session, db_time now)
{
	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		struct link *link = &acting->links[i];

		/* Behind a call that is not answered nothing would be heard. */
		if (!link->client || link->session != session || link->call)
			continue;
		for (struct fed_drive *fed = link->drives; fed; fed = fed->next) {
			if (fed->feeding || now < fed->due)
				continue;
			/* What reads, lives. A connection that is lost shows when it is looked at next. */
			fed->feeding = db_client_send(
					       link->client, "Read",
					       json_pack("{s:s, s:[s,s,s]}", "drive", fed->name,
			                                 "names", "watchdog_remaining_ms",
			                                 "control_request", "control_remaining_ms"),
					       false, take_sign, fed) == 0;
		}
	}
}

void db_opcua_acting_watch(const struct db_opcua_acting *acting,
                           struct pollfd fds[DB_OPCUA_ACTING_FDS])
{
	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		const struct db_client *client = acting->links[i].client;

		fds[i] = (struct pollfd){ .fd = -1 };
		if (client)
			fds[i] = (struct pollfd){ .fd = db_client_fd(client),
				                  .events = db_client_poll_events(client) };
	}
}

db_time db_opcua_acting_due(const struct db_opcua_acting *acting)
{
	db_time due = DB_TIME_NEVER;

	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		for (const struct fed_drive *fed = acting->links[i].drives; fed; fed = fed->next) {
			if (!fed->feeding && fed->due < due)
				due = fed->due;
		}
	}
	return due;
}

void db_opcua_acting_handle(struct db_opcua_acting *acting, db_time now)
{
	acting->now = now;
	acting->awaited = 0;
	for (size_t i = 0; i < DB_OPCUA_ACTING_FDS; i++) {
		struct link *link = &acting->links[i];

		if (link->client &&
		    (db_client_handle(link->client) != 0 || (link->passing && !link->call)))
			close_link(link);
	}
}
