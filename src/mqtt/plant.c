/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/plant.h"

#include "client/client.h"
#include "client/events.h"
#include "client/log.h"

#include <stdlib.h>
#include <string.h>

/* Calls that are not answered within this time will never be. */
#define ANSWER_MAX (10 * DB_NS_PER_S)

/* The service is on this machine: to look for it costs next to nothing. */
#define CONNECT_INTERVAL (1 * DB_NS_PER_S)

enum { CALLS, VALUES, EVENTS };

struct db_mqtt_plant {
	const struct db_mqtt_config *config;
	const struct db_mqtt_plant_ops *ops;
	void *context;
	/* One for calls, one for each stream. All or none. */
	struct db_client *clients[DB_MQTT_PLANT_FDS];
	db_time connect_at; /* not to be tried before */
	db_time now;        /* of this turn */
	json_t *description;
	json_t *registers; /* by drive, as they come */
	size_t described;  /* drives whose registers have been asked for */
	bool there;        /* found, and not lost since */
	bool changed;      /* to be asked anew: there are other drives */
	bool failed;       /* to be closed; `why` is told */
	char why[512];
	char told[512]; /* what was logged last; "" while it is there */
	struct db_client_events events;
	db_time ask_at;    /* for figures; DB_TIME_NEVER while the answer is awaited */
	db_time answer_by; /* of a call; DB_TIME_NEVER */
};

struct db_mqtt_plant *db_mqtt_plant_new(const struct db_mqtt_config *config,
                                        const struct db_mqtt_plant_ops *ops, void *context)
{
	struct db_mqtt_plant *plant = calloc(1, sizeof(*plant));

	if (!plant)
		return NULL;
	plant->config = config;
	plant->ops = ops;
	plant->context = context;
	plant->answer_by = DB_TIME_NEVER;
	plant->ask_at = DB_TIME_NEVER;
	return plant;
}

static void disconnect(struct db_mqtt_plant *plant)
{
	for (size_t i = 0; i < DB_MQTT_PLANT_FDS; i++) {
		db_client_close(plant->clients[i]);
		plant->clients[i] = NULL;
	}
	json_decref(plant->description);
	plant->description = NULL;
	json_decref(plant->registers);
	plant->registers = NULL;
	plant->described = 0;
	plant->changed = false;
	plant->failed = false;
	plant->ask_at = DB_TIME_NEVER;
	plant->answer_by = DB_TIME_NEVER;
}

void db_mqtt_plant_free(struct db_mqtt_plant *plant)
{
	if (!plant)
		return;
	disconnect(plant);
	free(plant);
}

/* The connections are closed when the turn ends: answers arrive in the middle of things. */
static void fail(struct db_mqtt_plant *plant, const char *why)
{
	if (!plant->failed)
		(void)snprintf(plant->why, sizeof(plant->why), "%s", why);
	plant->failed = true;
}

static void call(struct db_mqtt_plant *plant, size_t client, const char *method, json_t *parameters,
                 db_client_answer_fn *answer)
{
	if (db_client_send(plant->clients[client], method, parameters, client != CALLS, answer,
	                   plant) != 0)
		fail(plant, "the service has closed the connection");
	if (client == CALLS)
		plant->answer_by = plant->now + ANSWER_MAX;
}

/* --- streams ---------------------------------------------------------------------------------- */

static void take_samples(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_mqtt_plant *plant = data;
	json_int_t skipped = json_integer_value(json_object_get(parameters, "skipped"));
	int64_t us = json_integer_value(json_object_get(parameters, "time_us"));
	size_t i;
	const json_t *sample;

	if (error || !more) {
		fail(plant, error ? error->text : "the service has ended the stream of values");
		return;
	}
	if (skipped > 0)
		plant->ops->skipped(plant->context, skipped);
	json_array_foreach(json_object_get(parameters, "samples"), i, sample)
		plant->ops->sample(plant->context, sample, us);
}

static void take_events(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct db_mqtt_plant *plant = data;
	const json_t *events = json_object_get(parameters, "events");

	if (error || !more) {
		fail(plant, error ? error->text : "the service has ended the stream of events");
		return;
	}
	for (size_t i = db_client_events_skip(&plant->events, events); i < json_array_size(events);
	     i++)
		plant->ops->event(plant->context, json_array_get(events, i));
}

/* --- calls ------------------------------------------------------------------------------------ */

static const char *name_of(const json_t *object)
{
	const char *name = json_string_value(json_object_get(object, "name"));

	return name ? name : "";
}

static bool is_usual(const char *name)
{
	static const char *const usual[] = { "axis_state",     "error",           "status",
		                             "position",       "velocity",        "position_units",
		                             "velocity_units", "must_stand_cause" };

	for (size_t i = 0; i < sizeof(usual) / sizeof(usual[0]); i++) {
		if (strcmp(usual[i], name) == 0)
			return true;
	}
	return false;
}

/* What every message has beside its values, or what nobody wants to hear the change of. */
static bool is_frame(const char *name)
{
	return strcmp(name, "quality") == 0 || strcmp(name, "timestamp_us") == 0 ||
	       strcmp(name, "age_ms") == 0;
}

/* Those of a drive's registers that are published: a new array. */
static json_t *choose_registers(const struct db_mqtt_config *config, const json_t *registers)
{
	const struct db_setting_list *values = &config->values;
	json_t *chosen = json_array();
	bool process = true;
	size_t i;
	json_t *reg;

	json_array_foreach(registers, i, reg)
	{
		const char *name = name_of(reg);

		/* Process data stand first, up to the first register that can be written. */
		process = process && !json_is_true(json_object_get(reg, "writable"));
		if (values->word == DB_SETTING_NAMED   ? db_setting_list_has(values, name) :
		    values->word == DB_MQTT_VALUES_ALL ? process && !is_frame(name) :
		                                         is_usual(name))
			(void)json_array_append(chosen, reg);
	}
	return chosen;
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

/* The names of what is published of any drive, and what every message has beside. */
static json_t *collect_names(const struct db_mqtt_plant *plant)
{
	const struct db_setting_list *values = &plant->config->values;
	json_t *names = json_pack("[s,s]", "quality", "timestamp_us");
	const char *drive;
	const json_t *registers;

	json_object_foreach(plant->registers, drive, registers)
	{
		size_t i;
		const json_t *reg;

		json_array_foreach(registers, i, reg)
		{
			if (!has_text(names, name_of(reg)))
				(void)json_array_append_new(names, json_string(name_of(reg)));
		}
	}
	for (const char *at = values->names; at && *at; at += strlen(at) + 1) {
		if (!has_text(names, at))
			db_client_log(DB_CLIENT_WARNING, "values: no drive has a register '%s'",
			              at);
	}
	return names;
}

/* Everything is known: the streams begin. */
static void run(struct db_mqtt_plant *plant)
{
	json_t *names = collect_names(plant);
	json_t *drives = json_array();
	size_t i;
	const json_t *drive;

	json_array_foreach(json_object_get(plant->description, "drives"), i, drive)(void)
		json_array_append_new(drives, json_string(name_of(drive)));
	plant->there = true;
	plant->told[0] = '\0';
	plant->ops->found(plant->context, plant->description, plant->registers);
	/* No drives would mean all of them. */
	if (json_array_size(drives) > 0)
		call(plant, VALUES, "Subscribe",
		     json_pack("{s:O, s:O, s:i}", "drives", drives, "names", names, "interval_ms",
		               (int)plant->config->interval_ms),
		     take_samples);
	if (plant->config->events)
		call(plant, EVENTS, "Events", NULL, take_events);
	plant->ask_at = plant->now;
	json_decref(drives);
	json_decref(names);
}

static void take_registers(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more);

/* One drive after the other: an answer is long. */
static void ask_registers(struct db_mqtt_plant *plant)
{
	const json_t *drive = json_array_get(json_object_get(plant->description, "drives"),
	                                     plant->described);

	if (drive)
		call(plant, CALLS, "Registers", json_pack("{s:s}", "drive", name_of(drive)),
		     take_registers);
	else
		run(plant);
}

static void take_registers(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_mqtt_plant *plant = data;
	const json_t *drive = json_array_get(json_object_get(plant->description, "drives"),
	                                     plant->described);

	(void)more;
	plant->answer_by = DB_TIME_NEVER;
	if (error) {
		fail(plant, error->text);
		return;
	}
	(void)json_object_set_new(
		plant->registers, name_of(drive),
		choose_registers(plant->config, json_object_get(parameters, "registers")));
	plant->described++;
	ask_registers(plant);
}

/* Leaves the drives that are to be published. */
static void choose_drives(const struct db_mqtt_plant *plant, json_t *drives)
{
	const struct db_setting_list *list = &plant->config->drives;

	for (size_t i = json_array_size(drives); list->word == DB_SETTING_NAMED && i-- > 0;) {
		if (!db_setting_list_has(list, name_of(json_array_get(drives, i))))
			(void)json_array_remove(drives, i);
	}
}

static void take_description(void *data, json_t *parameters, const struct db_client_error *error,
                             bool more)
{
	struct db_mqtt_plant *plant = data;
	json_t *drives = json_object_get(parameters, "drives");

	(void)more;
	plant->answer_by = DB_TIME_NEVER;
	if (error) {
		fail(plant, error->text);
		return;
	}
	choose_drives(plant, drives);
	if (!plant->description) {
		plant->description = json_incref(parameters);
		plant->registers = json_object();
		ask_registers(plant);
	} else if (!json_equal(json_object_get(plant->description, "drives"), drives)) {
		plant->changed = true;
	}
}

static void take_figures(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_mqtt_plant *plant = data;

	(void)more;
	plant->answer_by = DB_TIME_NEVER;
	if (error) {
		fail(plant, error->text);
		return;
	}
	plant->ops->figures(plant->context, json_object_get(parameters, "buses"));
	plant->ask_at = plant->now + plant->config->figures_interval_s * DB_NS_PER_S;
	/* Whether it still has the same drives. */
	call(plant, CALLS, "Describe", NULL, take_description);
}

/* --- connecting ------------------------------------------------------------------------------- */

static void connect_all(struct db_mqtt_plant *plant, int64_t us)
{
	struct db_client_error error = { .parameters = NULL };

	if (plant->events.from_us == 0)
		plant->events.from_us = us;
	db_client_events_connect(&plant->events);
	for (size_t i = 0; i < DB_MQTT_PLANT_FDS && !plant->failed; i++) {
		if (db_client_open(plant->config->socket, &plant->clients[i], &error) != 0)
			fail(plant, error.text);
	}
	db_client_error_clear(&error);
	if (!plant->failed)
		call(plant, CALLS, "Describe", NULL, take_description);
}

/* Closes what has failed, and says why unless it was said. */
static void give_up(struct db_mqtt_plant *plant)
{
	bool was_there = plant->there;

	if (was_there || strcmp(plant->why, plant->told) != 0)
		db_client_log(DB_CLIENT_WARNING, "no connection to drivebridged: %s", plant->why);
	memcpy(plant->told, plant->why, sizeof(plant->told));
	disconnect(plant);
	plant->there = false;
	plant->connect_at = plant->now + CONNECT_INTERVAL;
	if (was_there)
		plant->ops->lost(plant->context);
}

void db_mqtt_plant_watch(const struct db_mqtt_plant *plant, struct pollfd fds[DB_MQTT_PLANT_FDS])
{
	for (size_t i = 0; i < DB_MQTT_PLANT_FDS; i++) {
		fds[i] = (struct pollfd){ .fd = -1 };
		if (plant->clients[i])
			fds[i] = (struct pollfd){
				.fd = db_client_fd(plant->clients[i]),
				.events = db_client_poll_events(plant->clients[i]),
			};
	}
}

db_time db_mqtt_plant_due(const struct db_mqtt_plant *plant)
{
	if (!plant->clients[CALLS])
		return plant->connect_at;
	return plant->ask_at < plant->answer_by ? plant->ask_at : plant->answer_by;
}

void db_mqtt_plant_handle(struct db_mqtt_plant *plant, db_time now, int64_t us)
{
	plant->now = now;
	if (!plant->clients[CALLS] && now >= plant->connect_at)
		connect_all(plant, us);
	for (size_t i = 0; i < DB_MQTT_PLANT_FDS; i++) {
		if (plant->clients[i] && db_client_handle(plant->clients[i]) != 0)
			fail(plant, "the service has closed the connection");
	}
	if (now >= plant->answer_by)
		fail(plant, "the service does not answer");
	if (!plant->failed && now >= plant->ask_at) {
		plant->ask_at = DB_TIME_NEVER;
		call(plant, CALLS, "Figures", NULL, take_figures);
	}
	if (plant->changed && !plant->failed) {
		disconnect(plant);
		connect_all(plant, us);
	}
	if (plant->failed)
		give_up(plant);
}
