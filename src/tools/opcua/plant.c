/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/plant.h"

#include "client/clock.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>

/* How often figures are read, and whether the drives are still the same. */
#define LOOK_INTERVAL (1 * DB_NS_PER_S)

/* How long a read waits for the service, and how long none is tried after a failed one. */
#define FETCH_MAX_MS 20
#define FETCH_PAUSE (1 * DB_NS_PER_S)

/* Most names of a stream, the service's limit; one is always included. */
#define STREAM_MAX 128

/* The stream is requested anew this long after a change of what is watched: often much changes at
 * once. */
#define SETTLE (50 * DB_NS_PER_MS)

/* Streamed values count as current for this number of intervals. */
#define STREAM_LATE 4

struct db_opcua_plant {
	const struct db_opcua_config *config;
	const struct db_opcua_plant_ops *ops;
	void *context;
	struct db_plant *plant;
	struct db_client *fetcher; /* NULL: to be opened, not before `fetch_at` */
	db_time fetch_at;          /* no fetch before */
	/* For what takes the service longer, and must not hold up a fetch; NULL: to be opened. */
	struct db_client *historian;

	struct db_opcua_kind *kinds;
	struct db_opcua_drive **drives;
	size_t drive_count;
	json_t *known;       /* the description of the present drives, NULL before the first */
	const json_t *buses; /* while drives are made: the buses that they are on */

	bool late;         /* the service has not answered for a while */
	db_time stream_at; /* when the stream is to be requested anew; DB_TIME_NEVER */
};

struct db_opcua_drive *db_opcua_plant_find(const struct db_opcua_plant *plant, const char *name)
{
	for (size_t i = 0; i < plant->drive_count; i++) {
		if (strcmp(plant->drives[i]->name, name) == 0)
			return plant->drives[i];
	}
	return NULL;
}

/* --- streams ---------------------------------------------------------------------------------- */

static void on_sample(void *context, const json_t *sample, int64_t sent_us)
{
	struct db_opcua_plant *plant = context;
	struct db_opcua_drive *drive = db_opcua_plant_find(plant, db_words_text(sample, "drive"));
	int64_t us = db_client_wall_us();

	if (!drive)
		return;
	/* The clock was set back. */
	if (drive->outdated_us > us)
		drive->outdated_us = us;
	/* A sample sent before a command has older values. Later samples only have the changes
	 * since then: the next stream starts with all values. */
	if (sent_us < drive->outdated_us) {
		drive->missed = true;
		db_opcua_plant_rewatch(plant);
		return;
	}
	db_opcua_drive_take(drive, json_object_get(sample, "values"),
	                    json_integer_value(json_object_get(sample, "time_us")));
	drive->begun = true;
	if (!drive->missed)
		drive->streamed = db_client_now();
}

static void on_event(void *context, json_t *event)
{
	struct db_opcua_plant *plant = context;

	plant->ops->event(plant->context, event);
}

static void on_alarms(void *context, const json_t *answer, bool first)
{
	struct db_opcua_plant *plant = context;

	plant->ops->alarms(plant->context, answer, first);
}

static void on_figures(void *context, json_t *buses)
{
	struct db_opcua_plant *plant = context;

	plant->ops->figures(plant->context, buses);
}

static void on_troubles(void *context, const struct db_client_troubles *troubles,
                        const json_t *news)
{
	struct db_opcua_plant *plant = context;
	struct db_opcua_drive *gateway = db_opcua_plant_find(plant, "");
	int64_t us = db_client_wall_us();
	size_t i;
	const json_t *record;

	json_array_foreach(json_object_get(news, "drives"), i, record)
	{
		struct db_opcua_drive *drive = db_opcua_plant_find(plant,
		                                                   db_words_text(record, "drive"));

		if (drive)
			db_opcua_drive_diagnose(drive, record, us);
	}
	if (gateway)
		db_opcua_gateway_diagnose(gateway, troubles->configuration, troubles->well, us);
	plant->ops->troubles(plant->context, troubles->buses);
}

/* The names watched of any drive. Those that do not fit are fetched when they are read. */
static json_t *watched_names(const struct db_opcua_plant *plant)
{
	json_t *names = json_pack("[s]", "quality");
	size_t always = json_array_size(names);

	for (size_t i = 0; i < plant->drive_count; i++) {
		const struct db_opcua_drive *drive = plant->drives[i];

		for (size_t j = 0; j < drive->kind->count; j++) {
			const char *name = drive->items[j].reg->name;

			if (drive->items[j].watchers > 0 &&
			    drive->items[j].reg->group != DB_OPCUA_DIAGNOSIS &&
			    !db_words_has_text(names, name) && json_array_size(names) < STREAM_MAX)
				(void)json_array_append_new(names, json_string(name));
		}
	}
	for (struct db_opcua_kind *kind = plant->kinds; kind; kind = kind->next) {
		for (size_t i = 0; i < kind->count; i++)
			kind->list[i].streamed = db_words_has_text(names, kind->list[i].name);
	}
	if (json_array_size(names) == always) {
		json_decref(names);
		return NULL;
	}
	return names;
}

static void subscribe(struct db_opcua_plant *plant)
{
	json_t *names = watched_names(plant);

	plant->stream_at = DB_TIME_NEVER;
	for (size_t i = 0; i < plant->drive_count; i++) {
		plant->drives[i]->streamed = 0;
		plant->drives[i]->begun = false;
		plant->drives[i]->missed = false;
	}
	db_plant_subscribe(plant->plant, NULL, names, plant->config->interval_ms, true);
	json_decref(names);
}

void db_opcua_plant_rewatch(struct db_opcua_plant *plant)
{
	if (db_plant_is_there(plant->plant) && plant->stream_at == DB_TIME_NEVER)
		plant->stream_at = db_client_now() + SETTLE;
}

/* --- drives ----------------------------------------------------------------------------------- */

static struct db_opcua_drive *make_drive(struct db_opcua_plant *plant,
                                         const struct db_plant_drive *found)
{
	const char *bus = db_words_text(found->description, "bus");
	const char *family = db_words_text(db_words_look_up(plant->buses, bus), "protocol");
	bool gateway = db_words_text(found->description, "name")[0] == '\0';
	struct db_opcua_kind *kind = db_opcua_kind_take(&plant->kinds,
	                                                gateway ? db_opcua_type_of_gateway() :
	                                                          db_opcua_type_of_family(family),
	                                                found->registers, found->commands);
	struct db_opcua_drive *drive = NULL;

	if (kind)
		drive = db_opcua_drive_new(db_words_text(found->description, "name"), bus, kind);
	if (!drive)
		db_opcua_kind_release(&plant->kinds, kind);
	return drive;
}

static bool add_drive(struct db_opcua_plant *plant, const struct db_plant_drive *found)
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

/* Its monitored items and event subscriptions continue. */
static bool replace_drive(struct db_opcua_plant *plant, size_t place,
                          const struct db_plant_drive *found)
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

/* Removes drives that are gone, and adds new ones. False: out of memory, or they do not have the
 * expected form. */
static bool show_found(struct db_opcua_plant *plant, const struct db_plant_drive *found,
                       size_t count)
{
	const json_t *known = json_object_get(plant->known, "drives");

	for (size_t i = plant->drive_count; i-- > 0;) {
		struct db_opcua_drive *drive = plant->drives[i];
		const json_t *before = db_words_look_up(known, drive->name);
		size_t at = 0;

		while (at < count &&
		       strcmp(db_words_text(found[at].description, "name"), drive->name) != 0)
			at++;
		if (at == count) {
			plant->ops->removed(plant->context, drive);
			plant->drives[i] = plant->drives[--plant->drive_count];
			db_opcua_drive_free(&plant->kinds, drive);
		} else if ((!json_equal(found[at].registers, drive->kind->registers) ||
		            !json_equal(found[at].commands, drive->kind->commands) ||
		            (before && !json_equal(before, found[at].description))) &&
		           !replace_drive(plant, i, &found[at])) {
			return false;
		}
	}
	for (size_t i = 0; i < count; i++) {
		if (!db_opcua_plant_find(plant, db_words_text(found[i].description, "name")) &&
		    !add_drive(plant, &found[i]))
			return false;
	}
	return true;
}

static void know(void *context, json_t *description)
{
	struct db_opcua_plant *plant = context;
	json_t *buses = json_object_get(description, "buses");

	if (!plant->known || !json_equal(json_object_get(plant->known, "buses"), buses))
		plant->ops->buses(plant->context, buses);
	json_decref(plant->known);
	plant->known = json_incref(description);
}

bool db_opcua_plant_is_known(const struct db_opcua_plant *plant)
{
	return plant->known;
}

bool db_opcua_plant_has_audit(const struct db_opcua_plant *plant)
{
	/* Services of before have no audit trail. */
	return json_object_get(plant->known, "audit_trouble");
}

void db_opcua_plant_note(const struct db_opcua_plant *plant, const struct db_plant_note *note)
{
	db_plant_note(plant->plant, note);
}

static void open_fetcher(struct db_opcua_plant *plant)
{
	struct db_client_error error = { .parameters = NULL };

	db_client_close(plant->fetcher);
	plant->fetcher = NULL;
	if (db_client_open(plant->config->socket, &plant->fetcher, &error) != 0)
		db_plant_fail(plant->plant, error.text);
	db_client_error_clear(&error);
}

static void on_found(void *context, json_t *description, const struct db_plant_drive *drives,
                     size_t count)
{
	struct db_opcua_plant *plant = context;
	bool shown;

	for (size_t i = 0; i < plant->drive_count; i++)
		db_opcua_plant_outdate(plant->drives[i]);
	plant->buses = json_object_get(description, "buses");
	shown = show_found(plant, drives, count);
	plant->buses = NULL;
	plant->ops->settled(plant->context);
	if (!shown) {
		db_plant_fail(plant->plant, "out of memory, or the service tells no registers");
		return;
	}
	know(plant, description);
	for (size_t i = 0; i < plant->drive_count; i++)
		plant->drives[i]->lost = false;
	plant->fetch_at = 0;
	open_fetcher(plant);
	subscribe(plant);
}

/* Drives of a kind share its objects. */
static json_t *keep(void *context, const char *drive, json_t *received, bool commands)
{
	const struct db_opcua_plant *plant = context;

	if (!commands) {
		db_opcua_registers_shorten(received,
		                           db_opcua_config_shows(plant->config, DB_OPCUA_HISTORY));
		db_opcua_registers_add_diagnosis(received, drive[0] == '\0');
	}
	for (const struct db_opcua_kind *kind = plant->kinds; kind; kind = kind->next) {
		json_t *other = commands ? kind->commands : kind->registers;

		if (json_equal(other, received))
			return json_incref(other);
	}
	return json_incref(received);
}

/* --- reading ---------------------------------------------------------------------------------- */

void db_opcua_plant_outdate(struct db_opcua_drive *drive)
{
	drive->outdated_us = db_client_wall_us();
	for (size_t i = 0; i < DB_OPCUA_GROUPS; i++)
		drive->taken[i] = 0;
	drive->streamed = 0;
}

/* The answer to a call that is waited for; NULL: there is none. Takes `parameters` over. */
static json_t *ask_now(struct db_opcua_plant *plant, const char *method, json_t *parameters)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *answer = NULL;

	if (!plant->fetcher || !db_plant_is_there(plant->plant) ||
	    db_client_now() < plant->fetch_at) {
		json_decref(parameters);
		return NULL;
	}
	if (db_client_call(plant->fetcher, method, parameters, FETCH_MAX_MS, &answer, &error) !=
	    0) {
		plant->fetch_at = db_client_now() + FETCH_PAUSE;
		/* A connection with an outstanding answer is not used for another call. */
		db_client_close(plant->fetcher);
		plant->fetcher = NULL;
	}
	db_client_error_clear(&error);
	return answer;
}

void db_opcua_plant_fetch(struct db_opcua_plant *plant, struct db_opcua_item *item)
{
	struct db_opcua_drive *drive = item->drive;
	enum db_opcua_group group = item->reg->group;
	db_time interval = plant->config->interval_ms * DB_NS_PER_MS;
	db_time now = db_client_now();
	bool streamed = drive->streamed > 0 && now - drive->streamed < STREAM_LATE * interval;
	json_t *answer;
	json_t *values;

	/* The diagnosis is always complete. */
	if (group == DB_OPCUA_DIAGNOSIS || (streamed && item->reg->streamed) ||
	    (drive->taken[group] > 0 && now - drive->taken[group] < interval))
		return;
	answer = ask_now(plant, "Read",
	                 json_pack("{s:s, s:o}", "drive", drive->name, "names",
	                           db_opcua_group_names(drive->kind, group, !streamed)));
	if (!answer)
		return;
	values = json_object_get(answer, "values");
	db_opcua_drive_take(drive, values,
	                    json_integer_value(json_object_get(values, "timestamp_us")));
	drive->taken[group] = now;
	/* The stream only sends what differs from its own last message: it does not know these
	 * values. */
	if (!streamed && drive->begun) {
		drive->missed = true;
		db_opcua_plant_rewatch(plant);
	}
	json_decref(answer);
}

json_t *db_opcua_plant_ask_health(struct db_opcua_plant *plant, const char *drive, int64_t since_us,
                                  int wait_ms)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *answer = NULL;

	if (!db_plant_is_there(plant->plant))
		return NULL;
	if (!plant->historian &&
	    db_client_open(plant->config->socket, &plant->historian, &error) != 0)
		plant->historian = NULL;
	if (plant->historian && db_client_call(plant->historian, "Health",
	                                       json_pack("{s:s, s:I}", "drive", drive, "since_us",
	                                                 (json_int_t)since_us),
	                                       wait_ms, &answer, &error) != 0) {
		/* As above. */
		db_client_close(plant->historian);
		plant->historian = NULL;
	}
	db_client_error_clear(&error);
	return answer;
}

bool db_opcua_plant_ask_clock(struct db_opcua_plant *plant, char token[DB_OPCUA_TOKEN_MAX])
{
	json_t *answer = ask_now(plant, "Clock", NULL);
	const char *text = db_words_text(answer, "token");
	bool good = text[0] && strlen(text) < DB_OPCUA_TOKEN_MAX;

	snprintf(token, DB_OPCUA_TOKEN_MAX, "%s", good ? text : "");
	json_decref(answer);
	return good;
}

/* --- its life --------------------------------------------------------------------------------- */

static void on_lost(void *context)
{
	struct db_opcua_plant *plant = context;

	db_client_close(plant->fetcher);
	plant->fetcher = NULL;
	db_client_close(plant->historian);
	plant->historian = NULL;
	plant->stream_at = DB_TIME_NEVER;
	for (size_t i = 0; i < plant->drive_count; i++) {
		db_opcua_plant_outdate(plant->drives[i]);
		plant->drives[i]->lost = true;
	}
}

struct db_opcua_plant *db_opcua_plant_new(sd_event *loop, const struct db_opcua_config *config,
                                          const struct db_opcua_plant_ops *ops, void *context)
{
	static const struct db_plant_ops plant_ops = {
		.keep = keep,
		.found = on_found,
		.described = know,
		.lost = on_lost,
		.sample = on_sample,
		.event = on_event,
		.figures = on_figures,
		.troubles = on_troubles,
		.alarms = on_alarms,
	};
	const struct db_plant_wishes wishes = {
		.socket = config->socket,
		.registers = true,
		.gateway = true,
		.events = true,
		.troubles = true,
		.alarms = true,
		.interval = LOOK_INTERVAL,
	};
	struct db_opcua_plant *plant = calloc(1, sizeof(*plant));

	if (!plant)
		return NULL;
	plant->config = config;
	plant->ops = ops;
	plant->context = context;
	plant->stream_at = DB_TIME_NEVER;
	plant->plant = db_plant_new(loop, &wishes, &plant_ops, plant);
	if (plant->plant)
		return plant;
	free(plant);
	return NULL;
}

void db_opcua_plant_free(struct db_opcua_plant *plant)
{
	if (!plant)
		return;
	db_plant_free(plant->plant);
	db_client_close(plant->fetcher);
	db_client_close(plant->historian);
	for (size_t i = 0; i < plant->drive_count; i++)
		db_opcua_drive_free(&plant->kinds, plant->drives[i]);
	free(plant->drives);
	json_decref(plant->known);
	free(plant);
}

db_time db_opcua_plant_tend(struct db_opcua_plant *plant, db_time now)
{
	db_time due;
	bool late;

	if (db_plant_is_there(plant->plant)) {
		if (!plant->fetcher && now >= plant->fetch_at)
			open_fetcher(plant);
		if (now >= plant->stream_at)
			subscribe(plant);
	}
	due = db_plant_tend(plant->plant, now);
	late = db_plant_is_late(plant->plant, now);
	for (size_t i = 0; late != plant->late && i < plant->drive_count; i++)
		plant->drives[i]->late = late;
	plant->late = late;
	return plant->stream_at < due ? plant->stream_at : due;
}

bool db_opcua_plant_is_stop(const struct db_opcua_plant *plant, const char *command)
{
	return db_plant_is_stop(plant->plant, command);
}
