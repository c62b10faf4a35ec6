/* SPDX-License-Identifier: Apache-2.0 */
#include "web/overview.h"
#include "client/troubles.h"
#include "web/service.h"
#include "web/stream.h"

#include <stdlib.h>
#include <string.h>

#define INTERVAL_MS 100
#define AGE_EVERY (1 * DB_NS_PER_S)
#define FIGURES_EVERY (1 * DB_NS_PER_S)
#define LOOK_EVERY (2 * DB_NS_PER_S)

/* Registers that drives of at least one family have. */
static const char *const names[] = {
	"axis_state",     "error",          "status",           "quality",        "age_ms",
	"position",       "velocity",       "position_units",   "velocity_units", "active_command",
	"drive_status",   "fault_bits",     "current",          "supply_voltage", "temperature",
	"watchdog_trips", "control_holder", "must_stand_cause", "must_stand_ms",
};
#define NAMES (sizeof(names) / sizeof(names[0]))

/* The kinds of news; a stream stores the number of the one it sent last of each kind. */
enum { SERVICE, DESCRIPTION, FIGURES, TROUBLES, SAMPLES, TOKEN, KINDS };
_Static_assert(KINDS == DB_WEB_STREAM_KINDS, "a stream remembers of each which one it had");

struct db_web_overview {
	struct db_web_server *server;
	struct db_link *link;  /* for the values; NULL: nobody looks, or the service is away */
	struct db_link *watch; /* for the troubles; NULL as above */
	struct db_client_troubles troubles;
	bool known[NAMES]; /* some drive has this register */
	bool up;           /* as last sent */
	bool failed;       /* to be closed */
	bool asking;       /* the figures were asked for */
	db_time figures_at;
	db_time look_at;
	unsigned numbers[KINDS];          /* of the latest text of each kind; 0: none yet */
	struct db_web_text *texts[KINDS]; /* the latest texts; for the samples the latest change */
	struct db_web_text *all;          /* the samples of all drives; NULL: to be written */
	json_t *samples;                  /* by drive */
	json_t *told;                     /* by drive: when it was last sent, as db_time */
	json_int_t time_us;
};

struct db_web_overview *db_web_overview_new(struct db_web_server *server)
{
	struct db_web_overview *overview = calloc(1, sizeof(*overview));

	if (!overview)
		return NULL;
	overview->server = server;
	overview->samples = json_object();
	overview->told = json_object();
	db_web_overview_changed(overview);
	return overview;
}

static void disconnect(struct db_web_overview *overview)
{
	struct db_link *link = overview->link;
	struct db_link *watch = overview->watch;

	overview->link = NULL;
	overview->watch = NULL;
	overview->failed = false;
	db_link_close(link);
	db_link_close(watch);
	db_client_troubles_clear(&overview->troubles);
	db_web_text_drop(overview->texts[TROUBLES]);
	overview->texts[TROUBLES] = NULL;
	(void)json_object_clear(overview->samples);
	(void)json_object_clear(overview->told);
	db_web_text_drop(overview->all);
	overview->all = NULL;
	db_web_text_drop(overview->texts[SAMPLES]);
	overview->texts[SAMPLES] = NULL;
}

void db_web_overview_free(struct db_web_overview *overview)
{
	if (!overview)
		return;
	disconnect(overview);
	for (size_t i = 0; i < sizeof(overview->texts) / sizeof(overview->texts[0]); i++)
		db_web_text_drop(overview->texts[i]);
	json_decref(overview->samples);
	json_decref(overview->told);
	free(overview);
}

/* Takes the object over. */
static void tell(struct db_web_overview *overview, size_t what, const char *event, json_t *data)
{
	db_web_text_drop(overview->texts[what]);
	overview->texts[what] = db_web_text_of(event, data);
	if (overview->texts[what])
		overview->numbers[what]++;
	json_decref(data);
	db_web_stream_poke(overview->server);
}

void db_web_overview_changed(struct db_web_overview *overview)
{
	json_t *description = overview->server->service ? overview->server->service->description :
	                                                  NULL;

	disconnect(overview);
	/* Other drives may have other registers. */
	for (size_t i = 0; i < NAMES; i++)
		overview->known[i] = true;
	if (overview->numbers[SERVICE] == 0 || overview->up != (description != NULL))
		tell(overview, SERVICE, "service",
		     json_pack("{s:b, s:o}", "up", description != NULL, "stops",
		               overview->server->service ?
		                       db_web_service_stops(overview->server->service) :
		                       json_array()));
	overview->up = description;
	if (description) {
		tell(overview, DESCRIPTION, NULL, json_pack("{s:O}", "describe", description));
	} else {
		/* Data of the former connection are out of date. */
		for (size_t i = DESCRIPTION; i < KINDS; i++) {
			db_web_text_drop(overview->texts[i]);
			overview->texts[i] = NULL;
		}
	}
}

/* --- values ----------------------------------------------------------------------------------- */

/* True if anything but the age differs. */
static bool has_changed(const json_t *before, const json_t *after)
{
	json_t *values = json_object_get(after, "values");
	json_t *old = json_object_get(before, "values");
	const char *name;
	json_t *value;

	if (!old || json_object_size(old) != json_object_size(values))
		return true;
	json_object_foreach(values, name, value)
	{
		if (strcmp(name, "age_ms") != 0 && !json_equal(value, json_object_get(old, name)))
			return true;
	}
	return false;
}

static void on_samples(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct db_web_overview *overview = data;
	json_int_t now = (json_int_t)db_client_now();
	json_t *changed;
	json_t *sample;
	size_t i;

	if (!overview->link)
		return;
	if (error || !more) {
		const char *unknown = json_string_value(
			json_object_get(error ? error->parameters : NULL, "name"));

		/* No drive has this register: ask again without it. */
		for (i = 0; unknown && i < NAMES; i++)
			overview->known[i] = overview->known[i] && strcmp(names[i], unknown) != 0;
		overview->failed = true;
		return;
	}
	changed = json_array();
	overview->time_us = json_integer_value(json_object_get(parameters, "time_us"));
	json_array_foreach(json_object_get(parameters, "samples"), i, sample)
	{
		const char *drive = json_string_value(json_object_get(sample, "drive"));

		if (!drive)
			continue;
		if (has_changed(json_object_get(overview->samples, drive), sample) ||
		    now - json_integer_value(json_object_get(overview->told, drive)) >= AGE_EVERY) {
			(void)json_array_append(changed, sample);
			(void)json_object_set_new(overview->told, drive, json_integer(now));
		}
		(void)json_object_set(overview->samples, drive, sample);
	}
	db_web_text_drop(overview->all);
	overview->all = NULL;
	if (json_array_size(changed) > 0)
		tell(overview, SAMPLES, NULL,
		     json_pack("{s:I, s:o}", "time_us", overview->time_us, "samples", changed));
	else
		json_decref(changed);
}

/* The newest samples of all drives, for streams that have missed some. */
static struct db_web_text *write_all(struct db_web_overview *overview)
{
	json_t *samples = json_array();
	const char *drive;
	json_t *sample;
	json_t *whole;

	if (!overview->all) {
		json_object_foreach(overview->samples, drive, sample)(void)
			json_array_append(samples, sample);
		whole = json_pack("{s:I, s:O}", "time_us", overview->time_us, "samples", samples);
		overview->all = db_web_text_of(NULL, whole);
		json_decref(whole);
	}
	json_decref(samples);
	return db_web_text_use(overview->all);
}

static void lose(void *data)
{
	struct db_web_overview *overview = data;

	overview->failed = true;
}

/* The records with a trouble or a hint. */
static json_t *choose_records(json_t *records)
{
	json_t *chosen = json_object();
	const char *name;
	json_t *record;

	json_object_foreach(records, name, record)
	{
		if (db_client_trouble_need(record) != DB_CLIENT_FINE)
			(void)json_object_set(chosen, name, record);
	}
	return chosen;
}

static void on_troubles(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct db_web_overview *overview = data;
	struct db_client_troubles *troubles = &overview->troubles;

	if (!overview->watch || db_client_troubles_are_missing(error))
		return;
	if (error || !more) {
		overview->failed = true;
		return;
	}
	db_client_troubles_take(troubles, parameters);
	tell(overview, TROUBLES, NULL,
	     json_pack("{s:{s:o, s:o, s:O?, s:b}}", "troubles", "drives",
	               choose_records(troubles->drives), "buses", choose_records(troubles->buses),
	               "configuration", troubles->configuration, "well", troubles->well));
}

void db_web_overview_take_token(struct db_web_server *server, const char *token)
{
	tell(server->overview, TOKEN, "token", json_pack("{s:s}", "token", token));
}

/* --- output ----------------------------------------------------------------------------------- */

static struct db_web_text *choose_next(void *data, unsigned seen[DB_WEB_STREAM_KINDS])
{
	struct db_web_overview *overview = data;

	for (size_t i = SERVICE; i < KINDS; i++) {
		bool follows = seen[i] + 1 == overview->numbers[i] && seen[i] > 0;

		if (!overview->texts[i] || seen[i] == overview->numbers[i])
			continue;
		seen[i] = overview->numbers[i];
		/* A new description makes all values news again. */
		if (i == DESCRIPTION)
			seen[SAMPLES] = 0;
		return i == SAMPLES && !follows ? write_all(overview) :
		                                  db_web_text_use(overview->texts[i]);
	}
	return NULL;
}

void db_web_overview_begin(struct db_web_request *request)
{
	struct db_web_overview *overview = request->server->overview;

	(void)db_web_stream_begin_own(request, choose_next, NULL, overview);
	db_web_overview_tick(overview, db_client_now());
}

static void on_figures(void *data, json_t *parameters, const struct db_client_error *error,
                       bool more)
{
	struct db_web_overview *overview = data;

	(void)more;
	overview->asking = false;
	if (!error)
		tell(overview, FIGURES, NULL,
		     json_pack("{s:O}", "figures", json_object_get(parameters, "buses")));
}

void db_web_overview_tick(struct db_web_overview *overview, db_time now)
{
	struct db_link *reader = db_web_service_reader(overview->server->service);
	bool wanted = reader && db_web_stream_count_shared(overview->server) > 0;
	const json_t *description;
	struct db_client_error error = { .parameters = NULL };
	json_t *chosen;

	if (overview->failed || (!wanted && (overview->link || overview->watch)))
		disconnect(overview);
	if (!wanted)
		return;
	if (!overview->watch) {
		overview->watch = db_web_service_open(overview->server->service, lose, overview,
		                                      &error);
		if (overview->watch &&
		    db_link_send(overview->watch, "Troubles", json_pack("{s:[]}", "drives"), true,
		                 on_troubles, overview) != 0)
			overview->failed = true;
		db_client_error_clear(&error);
	}
	description = overview->server->service->description;
	if (!overview->link && json_array_size(json_object_get(description, "drives")) > 0) {
		chosen = json_array();
		for (size_t i = 0; i < NAMES; i++) {
			if (overview->known[i])
				(void)json_array_append_new(chosen, json_string(names[i]));
		}
		overview->link = db_web_service_open(overview->server->service, lose, overview,
		                                     &error);
		if (overview->link && db_link_send(overview->link, "Subscribe",
		                                   json_pack("{s:[], s:O, s:i}", "drives", "names",
		                                             chosen, "interval_ms", INTERVAL_MS),
		                                   true, on_samples, overview) != 0)
			overview->failed = true;
		json_decref(chosen);
		db_client_error_clear(&error);
	}
	if (now >= overview->figures_at && !overview->asking) {
		overview->asking = db_link_send(reader, "Figures", NULL, false, on_figures,
		                                overview) == 0;
		overview->figures_at = now + FIGURES_EVERY;
	}
	if (now >= overview->look_at) {
		db_plant_refresh(overview->server->service->plant);
		overview->look_at = now + LOOK_EVERY;
	}
}
