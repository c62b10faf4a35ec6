/* SPDX-License-Identifier: Apache-2.0 */
#include "client/plant.h"
#include "client/clock.h"
#include "client/events.h"
#include "client/log.h"
#include "words/value.h"

#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* A call without an answer for this time counts as failed. */
#define ANSWER_MAX (10 * DB_NS_PER_S)
#define ANSWER_LATE (1 * DB_NS_PER_S)

/* The service is on this machine: an attempt to connect costs next to nothing. */
#define CONNECT_INTERVAL (1 * DB_NS_PER_S)

enum { CALLS, VALUES, EVENTS, TROUBLES, ALARMS, LINKS };

struct db_plant {
	sd_event *loop;
	struct db_plant_wishes wishes;
	const struct db_plant_ops *ops;
	void *context;
	struct db_link *links[LINKS];  /* NULL: the stream is not wished for */
	db_time connect_at;            /* no attempt before */
	json_t *description;           /* the answer of the first Describe of the connection */
	struct db_plant_drive *drives; /* while they are being read ... */
	size_t count;                  /* ... all of them ... */
	size_t known;                  /* ... and those whose commands have arrived */
	json_t *stops;                 /* names of the commands that stop a drive */
	bool there;                    /* found, and not lost since */
	bool found;                    /* the same, of this connection */
	bool changed;                  /* to be read anew: there are other drives */
	bool failed;                   /* to be closed; `why` is set */
	char why[512];
	char logged[512]; /* the last logged error; "" while the service is there */
	bool takes_notes; /* the service has an audit trail, and this tool may command */
	json_t *notes;    /* for it, while there is no service */
	unsigned notes_left_out;
	struct db_client_events events;
	struct db_client_troubles troubles;
	bool alarms_came;  /* over this connection */
	db_time look_at;   /* DB_TIME_NEVER while the answer is awaited */
	db_time answer_by; /* to a call; DB_TIME_NEVER */
};

struct db_plant *db_plant_new(sd_event *loop, const struct db_plant_wishes *wishes,
                              const struct db_plant_ops *ops, void *context)
{
	struct db_plant *plant = calloc(1, sizeof(*plant));

	if (!plant)
		return NULL;
	plant->loop = loop;
	plant->wishes = *wishes;
	plant->ops = ops;
	plant->context = context;
	plant->look_at = DB_TIME_NEVER;
	plant->answer_by = DB_TIME_NEVER;
	plant->stops = json_object();
	plant->notes = json_array();
	return plant;
}

static void forget_drives(struct db_plant *plant)
{
	for (size_t i = 0; i < plant->count; i++) {
		json_decref(plant->drives[i].description);
		json_decref(plant->drives[i].registers);
		json_decref(plant->drives[i].commands);
	}
	free(plant->drives);
	plant->drives = NULL;
	plant->count = 0;
	plant->known = 0;
}

static void disconnect(struct db_plant *plant)
{
	struct db_link *calls = plant->links[CALLS];

	plant->links[CALLS] = NULL;
	for (size_t i = 0; i < LINKS; i++) {
		db_link_drop(plant->links[i]);
		plant->links[i] = NULL;
	}
	/* The owner's calls over it are answered. */
	db_link_close(calls);
	forget_drives(plant);
	json_decref(plant->description);
	plant->description = NULL;
	db_client_troubles_clear(&plant->troubles);
	plant->found = false;
	plant->changed = false;
	plant->alarms_came = false;
	plant->failed = false;
	plant->look_at = DB_TIME_NEVER;
	plant->answer_by = DB_TIME_NEVER;
}

void db_plant_free(struct db_plant *plant)
{
	if (!plant)
		return;
	disconnect(plant);
	json_decref(plant->stops);
	json_decref(plant->notes);
	free(plant);
}

/* The connections are closed by the next db_plant_tend(): answers arrive while other functions
 * still use them. */
void db_plant_fail(struct db_plant *plant, const char *why)
{
	if (!plant->failed)
		snprintf(plant->why, sizeof(plant->why), "%s", why);
	plant->failed = true;
}

static void lose_link(void *data)
{
	db_plant_fail(data, "the service has closed the connection");
}

static void call(struct db_plant *plant, size_t link, const char *method, json_t *parameters,
                 db_client_answer_fn *answer)
{
	if (link == CALLS)
		plant->answer_by = db_client_now() + ANSWER_MAX;
	if (db_link_send(plant->links[link], method, parameters, link != CALLS, answer, plant) != 0)
		lose_link(plant);
}

/* True if an answer to a call can be used. */
static bool is_answered(struct db_plant *plant, const struct db_client_error *error)
{
	if (!plant->links[CALLS])
		return false;
	plant->answer_by = DB_TIME_NEVER;
	if (error)
		db_plant_fail(plant, error->text);
	return !error;
}

/* --- streams ---------------------------------------------------------------------------------- */

/* False: the stream has ended, and the connection with it. */
static bool goes_on(struct db_plant *plant, const char *what, const struct db_client_error *error,
                    bool more)
{
	char why[64];

	snprintf(why, sizeof(why), "the service has ended the stream of %s", what);
	if (error || !more)
		db_plant_fail(plant, error ? error->text : why);
	return !error && more;
}

static void on_samples(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct db_plant *plant = data;
	json_int_t skipped = json_integer_value(json_object_get(parameters, "skipped"));
	int64_t us = json_integer_value(json_object_get(parameters, "time_us"));
	size_t i;
	const json_t *sample;

	if (!goes_on(plant, "values", error, more))
		return;
	if (skipped > 0 && plant->ops->skipped)
		plant->ops->skipped(plant->context, skipped);
	json_array_foreach(json_object_get(parameters, "samples"), i, sample)
		plant->ops->sample(plant->context, sample, us);
}

static void on_events(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct db_plant *plant = data;
	const json_t *events = json_object_get(parameters, "events");

	if (!goes_on(plant, "events", error, more))
		return;
	for (size_t i = db_client_events_skip(&plant->events, events); i < json_array_size(events);
	     i++)
		plant->ops->event(plant->context, json_array_get(events, i));
}

static void on_troubles(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct db_plant *plant = data;

	if (db_client_troubles_are_missing(error) || !goes_on(plant, "troubles", error, more))
		return;
	db_client_troubles_take(&plant->troubles, parameters);
	plant->ops->troubles(plant->context, &plant->troubles, parameters);
}

static void on_alarms(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct db_plant *plant = data;
	bool first = !plant->alarms_came;

	if (db_client_troubles_are_missing(error) || !goes_on(plant, "alarms", error, more))
		return;
	plant->alarms_came = true;
	plant->ops->alarms(plant->context, parameters, first);
}

static void open_link(struct db_plant *plant, size_t link)
{
	struct db_client_error error = { .parameters = NULL };

	if (!plant->failed)
		plant->links[link] = db_link_open(plant->loop, plant->wishes.socket, lose_link,
		                                  plant, &error);
	if (!plant->failed && !plant->links[link])
		db_plant_fail(plant, error.text);
	db_client_error_clear(&error);
}

void db_plant_subscribe(struct db_plant *plant, json_t *drives, json_t *names, unsigned interval_ms,
                        bool changes)
{
	db_link_drop(plant->links[VALUES]);
	plant->links[VALUES] = NULL;
	if (names)
		open_link(plant, VALUES);
	if (plant->links[VALUES])
		call(plant, VALUES, "Subscribe",
		     json_pack("{s:o, s:O, s:i, s:b}", "drives",
		               drives ? json_incref(drives) : json_array(), "names", names,
		               "interval_ms", (int)interval_ms, "changes", changes),
		     on_samples);
}

/* --- drives ----------------------------------------------------------------------------------- */

static void tell_kept_notes(struct db_plant *plant)
{
	size_t i;
	json_t *note;

	json_array_foreach(plant->notes, i, note)
	{
		if (plant->takes_notes)
			(void)db_link_tell(plant->links[CALLS], "Note", json_incref(note));
	}
	if (plant->notes_left_out > 0)
		db_client_log(DB_CLIENT_WARNING,
		              "%u notes for the audit trail were left out: there was no service",
		              plant->notes_left_out);
	(void)json_array_clear(plant->notes);
	plant->notes_left_out = 0;
}

/* All drives are known: the streams begin. */
static void begin(struct db_plant *plant)
{
	plant->there = true;
	plant->found = true;
	/* Services of before have no audit trail. */
	plant->takes_notes = json_object_get(plant->description, "audit_trouble") &&
	                     json_is_true(json_object_get(plant->description, "may_act"));
	tell_kept_notes(plant);
	plant->ops->found(plant->context, plant->description, plant->drives, plant->count);
	if (plant->failed)
		return;
	if (plant->logged[0] != '\0')
		db_client_log(DB_CLIENT_NOTICE, "drivebridged is there again");
	plant->logged[0] = '\0';
	forget_drives(plant);
	/* The descriptions of registers are long. */
	(void)malloc_trim(0);
	if (plant->wishes.events)
		call(plant, EVENTS, "Events", NULL, on_events);
	if (plant->wishes.troubles)
		call(plant, TROUBLES, "Troubles", json_pack("{s:[]}", "drives"), on_troubles);
	if (plant->wishes.alarms)
		call(plant, ALARMS, "Alarms", NULL, on_alarms);
	if (plant->wishes.interval > 0)
		plant->look_at = 0;
}

/* What is kept of an answer about the drive that is being read: drives of a kind share one. */
static json_t *keep(const struct db_plant *plant, json_t *received, bool commands)
{
	const char *name = db_words_text(plant->drives[plant->known].description, "name");
	json_t *kept = plant->ops->keep ?
	                       plant->ops->keep(plant->context, name, received, commands) :
	                       json_incref(received);

	for (size_t i = 0; i < plant->known; i++) {
		json_t *other = commands ? plant->drives[i].commands : plant->drives[i].registers;

		if (other != kept && json_equal(other, kept)) {
			json_decref(kept);
			return json_incref(other);
		}
	}
	return kept;
}

static void ask_next(struct db_plant *plant);

static void on_commands(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct db_plant *plant = data;
	json_t *commands = json_object_get(parameters, "commands");
	size_t i;
	const json_t *command;

	(void)more;
	if (!is_answered(plant, error))
		return;
	json_array_foreach(commands, i, command)
	{
		if (json_is_true(json_object_get(command, "stops")))
			(void)json_object_set_new(plant->stops, db_words_text(command, "name"),
			                          json_true());
	}
	plant->drives[plant->known].commands = keep(plant, commands, true);
	plant->known++;
	ask_next(plant);
}

static void ask_commands(struct db_plant *plant)
{
	const char *name = db_words_text(plant->drives[plant->known].description, "name");

	if (name[0] != '\0') {
		call(plant, CALLS, "Commands", json_pack("{s:s}", "drive", name), on_commands);
		return;
	}
	plant->drives[plant->known++].commands = json_array();
	ask_next(plant);
}

static void on_registers(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_plant *plant = data;

	(void)more;
	if (!is_answered(plant, error))
		return;
	plant->drives[plant->known].registers = keep(
		plant, json_object_get(parameters, "registers"), false);
	ask_commands(plant);
}

/* One drive after the other: an answer is long. */
static void ask_next(struct db_plant *plant)
{
	if (plant->known == plant->count)
		begin(plant);
	else if (plant->wishes.registers)
		call(plant, CALLS, "Registers",
		     json_pack("{s:s}", "drive",
		               db_words_text(plant->drives[plant->known].description, "name")),
		     on_registers);
	else
		ask_commands(plant);
}

static void on_description(void *data, json_t *parameters, const struct db_client_error *error,
                           bool more)
{
	struct db_plant *plant = data;
	json_t *drives = json_object_get(parameters, "drives");
	size_t i;
	json_t *drive;

	(void)more;
	if (!is_answered(plant, error))
		return;
	if (plant->ops->choose)
		plant->ops->choose(plant->context, parameters);
	if (plant->found && plant->wishes.registers &&
	    !json_equal(json_object_get(plant->description, "drives"), drives)) {
		plant->changed = true;
	} else if (!plant->found ||
	           !json_equal(json_object_get(plant->description, "drives"), drives)) {
		json_decref(plant->description);
		plant->description = json_incref(parameters);
		forget_drives(plant);
		plant->drives = calloc(json_array_size(drives) + 1, sizeof(*plant->drives));
		if (!plant->drives) {
			db_plant_fail(plant, "out of memory");
			return;
		}
		json_array_foreach(drives, i, drive) plant->drives[plant->count++].description =
			json_incref(drive);
		if (plant->wishes.gateway)
			plant->drives[plant->count++].description = json_object();
		ask_next(plant);
	} else if (plant->ops->described) {
		plant->ops->described(plant->context, parameters);
	}
}

static void on_figures(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct db_plant *plant = data;

	(void)more;
	if (!is_answered(plant, error))
		return;
	plant->ops->figures(plant->context, json_object_get(parameters, "buses"));
	plant->look_at = db_client_now() + plant->wishes.interval;
	/* Checks whether it still has the same drives. */
	call(plant, CALLS, "Describe", NULL, on_description);
}

void db_plant_refresh(struct db_plant *plant)
{
	if (plant->found && plant->answer_by == DB_TIME_NEVER)
		call(plant, CALLS, "Describe", NULL, on_description);
}

/* --- connecting ------------------------------------------------------------------------------- */

static void connect_all(struct db_plant *plant)
{
	if (plant->events.from_us == 0)
		plant->events.from_us = db_client_wall_us();
	plant->events.connected = false;
	open_link(plant, CALLS);
	if (plant->wishes.events)
		open_link(plant, EVENTS);
	if (plant->wishes.troubles)
		open_link(plant, TROUBLES);
	if (plant->wishes.alarms)
		open_link(plant, ALARMS);
	if (!plant->failed)
		call(plant, CALLS, "Describe", NULL, on_description);
}

db_time db_plant_tend(struct db_plant *plant, db_time now)
{
	db_time due;

	if (!plant->links[CALLS] && now >= plant->connect_at)
		connect_all(plant);
	if (now >= plant->answer_by)
		db_plant_fail(plant, "the service does not answer");
	if (!plant->failed && now >= plant->look_at) {
		plant->look_at = DB_TIME_NEVER;
		call(plant, CALLS, "Figures", NULL, on_figures);
	}
	if (plant->changed && !plant->failed) {
		disconnect(plant);
		connect_all(plant);
	}
	if (plant->failed) {
		/* The reason is logged once. */
		bool was_there = plant->there;

		if (strcmp(plant->why, plant->logged) != 0)
			db_client_log(DB_CLIENT_WARNING, "no connection to drivebridged: %s",
			              plant->why);
		memcpy(plant->logged, plant->why, sizeof(plant->logged));
		disconnect(plant);
		plant->there = false;
		plant->connect_at = now + CONNECT_INTERVAL;
		if (was_there)
			plant->ops->lost(plant->context);
	}
	due = plant->links[CALLS] ? plant->look_at : plant->connect_at;
	return plant->answer_by < due ? plant->answer_by : due;
}

bool db_plant_is_there(const struct db_plant *plant)
{
	return plant->there && !plant->failed;
}

bool db_plant_is_late(const struct db_plant *plant, db_time now)
{
	return plant->answer_by != DB_TIME_NEVER &&
	       now >= plant->answer_by - ANSWER_MAX + ANSWER_LATE;
}

json_t *db_plant_stops(const struct db_plant *plant)
{
	return plant->stops;
}

bool db_plant_is_stop(const struct db_plant *plant, const char *command)
{
	return json_object_get(plant->stops, command);
}

/* The parameters of the call that adds it. */
static json_t *note_words(const struct db_plant_note *note)
{
	return json_pack("{s:s, s:s, s:s*, s:s*, s:s*, s:s*, s:b}", "kind", note->kind, "what",
	                 note->what, "user", note->user, "from", note->from, "text", note->text,
	                 "drive", note->drive, "refused", note->refused);
}

void db_plant_note(struct db_plant *plant, const struct db_plant_note *note)
{
	struct db_plant_note kept = *note;
	char text[256];
	char when[sizeof("2026-11-29T12:00:00Z")];
	time_t now = (time_t)(db_client_wall_us() / 1000000);
	struct tm utc;

	if (db_plant_reader(plant)) {
		if (plant->takes_notes)
			(void)db_link_tell(plant->links[CALLS], "Note", note_words(note));
		return;
	}
	if (json_array_size(plant->notes) >= DB_PLANT_NOTES ||
	    strftime(when, sizeof(when), "%FT%TZ", gmtime_r(&now, &utc)) == 0) {
		plant->notes_left_out++;
		return;
	}
	snprintf(text, sizeof(text), "at %s, when there was no service%s%s", when,
	         note->text && note->text[0] ? ": " : "", note->text ? note->text : "");
	kept.text = text;
	(void)json_array_append_new(plant->notes, note_words(&kept));
}

struct db_link *db_plant_reader(const struct db_plant *plant)
{
	return plant->found && !plant->failed ? plant->links[CALLS] : NULL;
}
