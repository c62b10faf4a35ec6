/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/plant.h"

#include "client/client.h"
#include "client/clock.h"
#include "client/events.h"
#include "client/log.h"

#include <malloc.h>
#include <stdlib.h>
#include <string.h>

/* Calls that are not answered within this time will never be. */
#define ANSWER_MAX (10 * DB_NS_PER_S)

/* The service is on this machine: to look for it costs next to nothing. */
#define CONNECT_INTERVAL (1 * DB_NS_PER_S)

/* What was told before is not taken for what is now when the service has not answered for so long. */
#define ANSWER_LATE (1 * DB_NS_PER_S)

/* How often figures are asked for, and whether the drives are still the same. */
#define LOOK_INTERVAL (1 * DB_NS_PER_S)

/* How long a read waits for the service, and for how long none is tried after one that was in vain. */
#define FETCH_MAX_MS 20
#define FETCH_PAUSE (1 * DB_NS_PER_S)

/* Names of a stream at most, as the service has it; one is always there. */
#define STREAM_MAX 128

/* The service is asked for another stream so long after what is watched changed: often much changes at once. */
#define SETTLE (50 * DB_NS_PER_MS)

/* What is streamed is as good as fresh for so many intervals. */
#define STREAM_LATE 4

enum { CALLS, VALUES, EVENTS };

/* A drive that was found, before it is known whether it is new. */
struct found {
	const json_t *description; /* of the plant's */
	json_t *registers;
	json_t *commands;
};

struct db_opcua_plant {
	const struct db_opcua_config *config;
	const struct db_opcua_plant_ops *ops;
	void *context;
	struct db_client *clients[DB_OPCUA_PLANT_FDS]; /* VALUES: NULL when nothing is watched */
	struct db_client *fetcher;
	db_time connect_at; /* not to be tried before */
	db_time now;        /* of this turn */
	int64_t us;

	json_t *description;
	struct found *found; /* while they are looked at; the gateway is the last one */
	size_t found_count;
	size_t found_total;

	struct db_opcua_kind *kinds;
	struct db_opcua_drive **drives;
	size_t drive_count;
	json_t *known; /* the description of those, NULL before the first */

	bool there;
	bool late;         /* an answer is awaited for longer than ANSWER_LATE */
	bool changed;      /* to be asked anew: there are other drives */
	bool failed;       /* to be closed; `why` is told */
	bool renew;        /* the fetcher is to be opened anew */
	db_time stream_at; /* when the stream is to be asked for anew; DB_TIME_NEVER */
	db_time look_at;   /* DB_TIME_NEVER while an answer is awaited */
	db_time answer_by;
	db_time fetch_at; /* no fetch before */
	struct db_client_events events;
	char why[512];
	char told[512]; /* what was logged last; "" while it is there */
};

struct db_opcua_plant *db_opcua_plant_new(const struct db_opcua_config *config,
                                          const struct db_opcua_plant_ops *ops, void *context)
{
	struct db_opcua_plant *plant = calloc(1, sizeof(*plant));

	if (!plant)
		return NULL;
	plant->config = config;
	plant->ops = ops;
	plant->context = context;
	plant->answer_by = DB_TIME_NEVER;
	plant->look_at = DB_TIME_NEVER;
	plant->stream_at = DB_TIME_NEVER;
	return plant;
}

static void forget_found(struct db_opcua_plant *plant)
{
	for (size_t i = 0; i < plant->found_total && plant->found; i++) {
		json_decref(plant->found[i].registers);
		json_decref(plant->found[i].commands);
	}
	free(plant->found);
	plant->found = NULL;
	plant->found_count = 0;
	plant->found_total = 0;
	json_decref(plant->description);
	plant->description = NULL;
}

static void disconnect(struct db_opcua_plant *plant)
{
	for (size_t i = 0; i < DB_OPCUA_PLANT_FDS; i++) {
		db_client_close(plant->clients[i]);
		plant->clients[i] = NULL;
	}
	db_client_close(plant->fetcher);
	plant->fetcher = NULL;
	forget_found(plant);
	for (size_t i = 0; i < plant->drive_count; i++)
		db_opcua_plant_outdate(plant->drives[i]);
	plant->there = false;
	plant->changed = false;
	plant->failed = false;
	plant->renew = false;
	plant->look_at = DB_TIME_NEVER;
	plant->answer_by = DB_TIME_NEVER;
	plant->stream_at = DB_TIME_NEVER;
	plant->fetch_at = 0;
}

void db_opcua_plant_free(struct db_opcua_plant *plant)
{
	if (!plant)
		return;
	disconnect(plant);
	for (size_t i = 0; i < plant->drive_count; i++)
		db_opcua_drive_free(&plant->kinds, plant->drives[i]);
	free(plant->drives);
	json_decref(plant->known);
	free(plant);
}

/* The connections are closed when the turn ends: answers arrive in the middle of things. */
static void fail(struct db_opcua_plant *plant, const char *why)
{
	if (!plant->failed)
		(void)snprintf(plant->why, sizeof(plant->why), "%s", why);
	plant->failed = true;
}

static void call(struct db_opcua_plant *plant, size_t client, const char *method,
                 json_t *parameters, db_client_answer_fn *answer)
{
	if (db_client_send(plant->clients[client], method, parameters, client != CALLS, answer,
	                   plant) != 0)
		fail(plant, "the service has closed the connection");
	if (client == CALLS)
		plant->answer_by = plant->now + ANSWER_MAX;
}

static const char *text_of(const json_t *object, const char *key)
{
	const char *text = json_string_value(json_object_get(object, key));

	return text ? text : "";
}

struct db_opcua_drive *db_opcua_plant_find(const struct db_opcua_plant *plant, const char *name)
{
	for (size_t i = 0; i < plant->drive_count; i++) {
		if (strcmp(plant->drives[i]->name, name) == 0)
			return plant->drives[i];
	}
	return NULL;
}

/* --- streams ---------------------------------------------------------------------------------- */

static void take_samples(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_opcua_plant *plant = data;
	json_int_t sent_us = json_integer_value(json_object_get(parameters, "time_us"));
	size_t i;
	const json_t *sample;

	if (error || !more) {
		fail(plant, error ? error->text : "the service has ended the stream of values");
		return;
	}
	json_array_foreach(json_object_get(parameters, "samples"), i, sample)
	{
		struct db_opcua_drive *drive = db_opcua_plant_find(plant, text_of(sample, "drive"));

		if (!drive)
			continue;
		/* The clock was set back. */
		if (drive->outdated_us > plant->us)
			drive->outdated_us = plant->us;
		/* One that was on its way when somebody commanded the drive tells of before that. What those that follow
		 * tell has changed since: the next stream begins with all again. */
		if (sent_us < drive->outdated_us) {
			drive->missed = true;
			db_opcua_plant_rewatch(plant);
			continue;
		}
		db_opcua_drive_take(drive, json_object_get(sample, "values"),
		                    json_integer_value(json_object_get(sample, "time_us")));
		drive->begun = true;
		if (!drive->missed)
			drive->streamed = plant->now;
	}
}

static void take_events(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct db_opcua_plant *plant = data;
	const json_t *events = json_object_get(parameters, "events");

	if (error || !more) {
		fail(plant, error ? error->text : "the service has ended the stream of events");
		return;
	}
	for (size_t i = db_client_events_skip(&plant->events, events); i < json_array_size(events);
	     i++)
		plant->ops->event(plant->context, json_array_get(events, i));
}

static bool has_text(const json_t *texts, const char *text)
{
	size_t i;
	const json_t *one;

	json_array_foreach(texts, i, one)
	{
		if (strcmp(json_string_value(one), text) == 0)
			return true;
	}
	return false;
}

/* What is watched of any drive. What there is no room for is fetched when it is read. */
static json_t *watched_names(const struct db_opcua_plant *plant)
{
	json_t *names = json_pack("[s]", "quality");
	size_t always = json_array_size(names);

	for (size_t i = 0; i < plant->drive_count; i++) {
		const struct db_opcua_drive *drive = plant->drives[i];

		for (size_t j = 0; j < drive->kind->count; j++) {
			const char *name = drive->items[j].reg->name;

			if (drive->items[j].watchers > 0 && !has_text(names, name) &&
			    json_array_size(names) < STREAM_MAX)
				(void)json_array_append_new(names, json_string(name));
		}
	}
	for (struct db_opcua_kind *kind = plant->kinds; kind; kind = kind->next) {
		for (size_t i = 0; i < kind->count; i++)
			kind->list[i].streamed = has_text(names, kind->list[i].name);
	}
	if (json_array_size(names) == always) {
		json_decref(names);
		return NULL;
	}
	return names;
}

/* A stream is changed by another one. */
static void subscribe(struct db_opcua_plant *plant)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *names = watched_names(plant);

	plant->stream_at = DB_TIME_NEVER;
	db_client_close(plant->clients[VALUES]);
	plant->clients[VALUES] = NULL;
	for (size_t i = 0; i < plant->drive_count; i++) {
		plant->drives[i]->streamed = 0;
		plant->drives[i]->begun = false;
		plant->drives[i]->missed = false;
	}
	if (!names)
		return;
	if (db_client_open(plant->config->socket, &plant->clients[VALUES], &error) != 0)
		fail(plant, error.text);
	else
		call(plant, VALUES, "Subscribe",
		     json_pack("{s:[], s:O, s:i, s:b}", "drives", "names", names, "interval_ms",
		               (int)plant->config->interval_ms, "changes", true),
		     take_samples);
	json_decref(names);
	db_client_error_clear(&error);
}

void db_opcua_plant_rewatch(struct db_opcua_plant *plant)
{
	if (plant->there && plant->stream_at == DB_TIME_NEVER)
		plant->stream_at = plant->now + SETTLE;
}

/* --- drives ----------------------------------------------------------------------------------- */

static struct db_opcua_drive *make_drive(struct db_opcua_plant *plant, const struct found *found)
{
	struct db_opcua_kind *kind = db_opcua_kind_take(&plant->kinds, found->registers,
	                                                found->commands);
	struct db_opcua_drive *drive = NULL;

	if (kind)
		drive = db_opcua_drive_new(text_of(found->description, "name"),
		                           text_of(found->description, "bus"), kind);
	if (!drive)
		db_opcua_kind_release(&plant->kinds, kind);
	return drive;
}

static bool add_drive(struct db_opcua_plant *plant, const struct found *found)
{
	struct db_opcua_drive **grown = realloc(plant->drives,
	                                        (plant->drive_count + 1) * sizeof(*plant->drives));
	struct db_opcua_drive *drive;

	if (!grown)
		return false;
	plant->drives = grown;
	drive = make_drive(plant, found);
	if (!drive)
		return false;
	plant->drives[plant->drive_count++] = drive;
	plant->ops->added(plant->context, drive, found->description);
	return true;
}

/* Who watches it, and waits for its events, goes on doing so. */
static bool replace_drive(struct db_opcua_plant *plant, size_t place, const struct found *found)
{
	struct db_opcua_drive *before = plant->drives[place];
	struct db_opcua_drive *drive = make_drive(plant, found);

	if (!drive)
		return false;
	db_opcua_drive_take_watchers(drive, before);
	plant->drives[place] = drive;
	plant->ops->replaced(plant->context, before, drive, found->description);
	db_opcua_drive_free(&plant->kinds, before);
	return true;
}

static void remove_drive(struct db_opcua_plant *plant, size_t place)
{
	struct db_opcua_drive *drive = plant->drives[place];

	plant->ops->removed(plant->context, drive);
	plant->drives[place] = plant->drives[--plant->drive_count];
	db_opcua_drive_free(&plant->kinds, drive);
}

static const json_t *find_description(const json_t *description, const char *name)
{
	size_t i;
	const json_t *drive;

	json_array_foreach(json_object_get(description, "drives"), i, drive)
	{
		if (strcmp(text_of(drive, "name"), name) == 0)
			return drive;
	}
	return NULL;
}

static const struct found *find_found(const struct db_opcua_plant *plant, const char *name)
{
	for (size_t i = 0; i < plant->found_total; i++) {
		if (strcmp(text_of(plant->found[i].description, "name"), name) == 0)
			return &plant->found[i];
	}
	return NULL;
}

/* Whether a drive is as it was. */
static bool is_same(const struct db_opcua_plant *plant, const struct db_opcua_drive *drive,
                    const struct found *found)
{
	const json_t *before = find_description(plant->known, drive->name);

	return json_equal(found->registers, drive->kind->registers) &&
	       json_equal(found->commands, drive->kind->commands) &&
	       (drive->name[0] == '\0' || (before && json_equal(before, found->description)));
}

/* Who went goes, and who is new comes. */
static bool show_found(struct db_opcua_plant *plant)
{
	for (size_t i = plant->drive_count; i-- > 0;) {
		const struct found *found = find_found(plant, plant->drives[i]->name);

		if (!found)
			remove_drive(plant, i);
		else if (!is_same(plant, plant->drives[i], found) &&
		         !replace_drive(plant, i, found))
			return false;
	}
	for (size_t i = 0; i < plant->found_total; i++) {
		if (!db_opcua_plant_find(plant, text_of(plant->found[i].description, "name")) &&
		    !add_drive(plant, &plant->found[i]))
			return false;
	}
	return true;
}

/* Everything is known, and the streams begin. */
static void begin(struct db_opcua_plant *plant)
{
	bool same_buses = plant->known && json_equal(json_object_get(plant->known, "buses"),
	                                             json_object_get(plant->description, "buses"));

	if (!show_found(plant)) {
		fail(plant, "out of memory, or the service tells no registers");
		return;
	}
	json_decref(plant->known);
	plant->known = json_incref(plant->description);
	if (!same_buses)
		plant->ops->buses(plant->context, json_object_get(plant->known, "buses"));
	forget_found(plant);
	/* Registers are told at length. */
	(void)malloc_trim(0);
	for (size_t i = 0; i < plant->drive_count; i++)
		plant->drives[i]->lost = false;
	if (plant->told[0] != '\0')
		db_client_log(DB_CLIENT_NOTICE, "drivebridged is there again");
	plant->there = true;
	plant->told[0] = '\0';
	subscribe(plant);
	call(plant, EVENTS, "Events", NULL, take_events);
	plant->look_at = plant->now;
}

static void ask_next(struct db_opcua_plant *plant);

/* The same again, where a drive before this one has it, or a drive that was known before. */
static json_t *share(const struct db_opcua_plant *plant, json_t *told, bool commands)
{
	for (size_t i = 0; i < plant->drive_count; i++) {
		json_t *other = commands ? plant->drives[i]->kind->commands :
		                           plant->drives[i]->kind->registers;

		if (json_equal(other, told))
			return json_incref(other);
	}
	for (size_t i = 0; i < plant->found_count; i++) {
		json_t *other = commands ? plant->found[i].commands : plant->found[i].registers;

		if (json_equal(other, told))
			return json_incref(other);
	}
	return json_incref(told);
}

static void take_commands(void *data, json_t *parameters, const struct db_client_error *error,
                          bool more)
{
	struct db_opcua_plant *plant = data;

	(void)more;
	plant->answer_by = DB_TIME_NEVER;
	if (error) {
		fail(plant, error->text);
		return;
	}
	plant->found[plant->found_count++].commands = json_incref(
		json_object_get(parameters, "commands"));
	ask_next(plant);
}

static void take_registers(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_opcua_plant *plant = data;
	struct found *found = &plant->found[plant->found_count];
	const char *name = text_of(found->description, "name");

	(void)more;
	plant->answer_by = DB_TIME_NEVER;
	if (error) {
		fail(plant, error->text);
		return;
	}
	db_opcua_registers_shorten(json_object_get(parameters, "registers"),
	                           db_opcua_config_shows(plant->config, DB_OPCUA_HISTORY));
	found->registers = share(plant, json_object_get(parameters, "registers"), false);
	if (name[0] != '\0') {
		call(plant, CALLS, "Commands", json_pack("{s:s}", "drive", name), take_commands);
		return;
	}
	found->commands = json_array();
	plant->found_count++;
	ask_next(plant);
}

/* One drive after the other: an answer is long. */
static void ask_next(struct db_opcua_plant *plant)
{
	if (plant->found_count < plant->found_total)
		call(plant, CALLS, "Registers",
		     json_pack("{s:s}", "drive",
		               text_of(plant->found[plant->found_count].description, "name")),
		     take_registers);
	else
		begin(plant);
}

static void take_description(void *data, json_t *parameters, const struct db_client_error *error,
                             bool more)
{
	struct db_opcua_plant *plant = data;
	const json_t *drives = json_object_get(parameters, "drives");

	(void)more;
	plant->answer_by = DB_TIME_NEVER;
	if (error) {
		fail(plant, error->text);
		return;
	}
	if (plant->there) {
		plant->changed = !json_equal(json_object_get(plant->known, "drives"), drives);
		if (plant->changed)
			return;
		if (!json_equal(json_object_get(plant->known, "buses"),
		                json_object_get(parameters, "buses")))
			plant->ops->buses(plant->context, json_object_get(parameters, "buses"));
		json_decref(plant->known);
		plant->known = json_incref(parameters);
		return;
	}
	plant->description = json_incref(parameters);
	plant->found = calloc(json_array_size(drives) + 1, sizeof(*plant->found));
	if (!plant->found) {
		fail(plant, "out of memory");
		return;
	}
	for (size_t i = 0; i < json_array_size(drives); i++)
		plant->found[i].description = json_array_get(drives, i);
	plant->found_total = json_array_size(drives) + 1;
	ask_next(plant);
}

static void take_figures(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_opcua_plant *plant = data;

	(void)more;
	plant->answer_by = DB_TIME_NEVER;
	if (error) {
		fail(plant, error->text);
		return;
	}
	plant->ops->figures(plant->context, json_object_get(parameters, "buses"));
	plant->look_at = plant->now + LOOK_INTERVAL;
	call(plant, CALLS, "Describe", NULL, take_description);
}

/* --- reading ---------------------------------------------------------------------------------- */

void db_opcua_plant_outdate(struct db_opcua_drive *drive)
{
	drive->outdated_us = db_client_wall_us();
	for (size_t i = 0; i < DB_OPCUA_GROUPS; i++)
		drive->taken[i] = 0;
	drive->streamed = 0;
}

void db_opcua_plant_fetch(struct db_opcua_plant *plant, struct db_opcua_item *item)
{
	struct db_opcua_drive *drive = item->drive;
	enum db_opcua_group group = item->reg->group;
	struct db_client_error error = { .parameters = NULL };
	db_time interval = plant->config->interval_ms * DB_NS_PER_MS;
	db_time now = db_client_now();
	bool streamed = drive->streamed > 0 && now - drive->streamed < STREAM_LATE * interval;
	json_t *answer = NULL;

	if (!plant->there || (streamed && item->reg->streamed) ||
	    (drive->taken[group] > 0 && now - drive->taken[group] < interval) ||
	    now < plant->fetch_at)
		return;
	if (db_client_call(plant->fetcher, "Read",
	                   json_pack("{s:s, s:o}", "drive", drive->name, "names",
	                             db_opcua_group_names(drive->kind, group, !streamed)),
	                   FETCH_MAX_MS, &answer, &error) == 0) {
		json_t *values = json_object_get(answer, "values");

		db_opcua_drive_take(drive, values,
		                    json_integer_value(json_object_get(values, "timestamp_us")));
		drive->taken[group] = now;
		/* The stream tells only what is not as it told it last: it does not know of these values. */
		if (!streamed && drive->begun) {
			drive->missed = true;
			db_opcua_plant_rewatch(plant);
		}
	} else {
		plant->fetch_at = now + FETCH_PAUSE;
		/* A connection on which an answer is still to come is not used for another question. */
		plant->renew = true;
	}
	json_decref(answer);
	db_client_error_clear(&error);
}

bool db_opcua_plant_ask_clock(struct db_opcua_plant *plant, char token[DB_OPCUA_TOKEN_MAX])
{
	struct db_client_error error = { .parameters = NULL };
	db_time now = db_client_now();
	json_t *answer = NULL;
	const char *text;
	bool good = false;

	token[0] = '\0';
	if (!plant->there || now < plant->fetch_at)
		return false;
	if (db_client_call(plant->fetcher, "Clock", NULL, FETCH_MAX_MS, &answer, &error) == 0) {
		text = json_string_value(json_object_get(answer, "token"));
		good = text && text[0] && strlen(text) < DB_OPCUA_TOKEN_MAX;
		(void)snprintf(token, DB_OPCUA_TOKEN_MAX, "%s", good ? text : "");
	} else {
		plant->fetch_at = now + FETCH_PAUSE;
		plant->renew = true;
	}
	json_decref(answer);
	db_client_error_clear(&error);
	return good;
}

/* --- connecting ------------------------------------------------------------------------------- */

static void open_client(struct db_opcua_plant *plant, struct db_client **client)
{
	struct db_client_error error = { .parameters = NULL };

	if (!plant->failed && db_client_open(plant->config->socket, client, &error) != 0)
		fail(plant, error.text);
	db_client_error_clear(&error);
}

static void connect_all(struct db_opcua_plant *plant)
{
	if (plant->events.from_us == 0)
		plant->events.from_us = plant->us;
	db_client_events_connect(&plant->events);
	open_client(plant, &plant->clients[CALLS]);
	open_client(plant, &plant->clients[EVENTS]);
	open_client(plant, &plant->fetcher);
	if (!plant->failed)
		call(plant, CALLS, "Describe", NULL, take_description);
}

/* Closes what has failed, and says why unless it was said. */
static void give_up(struct db_opcua_plant *plant)
{
	if (plant->there || strcmp(plant->why, plant->told) != 0)
		db_client_log(DB_CLIENT_WARNING, "no connection to drivebridged: %s", plant->why);
	memcpy(plant->told, plant->why, sizeof(plant->told));
	disconnect(plant);
	for (size_t i = 0; i < plant->drive_count; i++)
		plant->drives[i]->lost = true;
	plant->connect_at = plant->now + CONNECT_INTERVAL;
}

/* A service that hangs keeps its connections, and streams that say nothing. */
static void note_lateness(struct db_opcua_plant *plant)
{
	bool late = plant->answer_by != DB_TIME_NEVER &&
	            plant->now >= plant->answer_by - ANSWER_MAX + ANSWER_LATE;

	if (late == plant->late)
		return;
	plant->late = late;
	for (size_t i = 0; i < plant->drive_count; i++)
		plant->drives[i]->late = late;
}

void db_opcua_plant_watch(const struct db_opcua_plant *plant, struct pollfd fds[DB_OPCUA_PLANT_FDS])
{
	for (size_t i = 0; i < DB_OPCUA_PLANT_FDS; i++) {
		fds[i] = (struct pollfd){ .fd = -1 };
		if (plant->clients[i])
			fds[i] = (struct pollfd){
				.fd = db_client_fd(plant->clients[i]),
				.events = db_client_poll_events(plant->clients[i]),
			};
	}
}

db_time db_opcua_plant_due(const struct db_opcua_plant *plant)
{
	db_time due = plant->stream_at;

	if (!plant->clients[CALLS])
		return plant->connect_at;
	if (plant->look_at < due)
		due = plant->look_at;
	return plant->answer_by < due ? plant->answer_by : due;
}

void db_opcua_plant_handle(struct db_opcua_plant *plant, db_time now, int64_t us)
{
	plant->now = now;
	plant->us = us;
	if (!plant->clients[CALLS] && now >= plant->connect_at)
		connect_all(plant);
	for (size_t i = 0; i < DB_OPCUA_PLANT_FDS; i++) {
		if (plant->clients[i] && db_client_handle(plant->clients[i]) != 0)
			fail(plant, "the service has closed the connection");
	}
	if (now >= plant->answer_by)
		fail(plant, "the service does not answer");
	if (plant->renew && !plant->failed && now >= plant->fetch_at) {
		db_client_close(plant->fetcher);
		plant->fetcher = NULL;
		plant->renew = false;
		open_client(plant, &plant->fetcher);
	}
	if (!plant->failed && now >= plant->stream_at)
		subscribe(plant);
	if (!plant->failed && now >= plant->look_at) {
		plant->look_at = DB_TIME_NEVER;
		call(plant, CALLS, "Figures", NULL, take_figures);
	}
	if (plant->changed && !plant->failed) {
		disconnect(plant);
		connect_all(plant);
	}
	if (plant->failed)
		give_up(plant);
	note_lateness(plant);
}
