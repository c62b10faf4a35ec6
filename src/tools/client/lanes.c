/* SPDX-License-Identifier: Apache-2.0 */
#include "client/lanes.h"
#include "client/clock.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Drives that are remembered for one lane; the service has at most 247. */
#define DRIVES_MAX 256

/* Shortest time between two reads of a drive. */
#define INTERVAL_MIN (20 * DB_NS_PER_MS)

/* A command may arm the watchdog a little later than its answer: its drive is read for this time in
 * any case. */
#define BEGINS_WITHIN (3 * DB_NS_PER_S)

/* Errors of a drive that is not there begin with it. */
#define NO_SUCH DB_CLIENT_SERVICE "NoSuch"

struct db_lane_drive {
	struct db_lane *lane;
	struct db_lane_drive *next;
	char name[64];
	db_time commanded; /* last */
	db_time due;       /* for the next read */
	bool reading;      /* its answer is awaited */
	json_t *note;
};

struct db_lanes {
	sd_event *loop;
	struct db_lanes_form form;
	void *context;
	struct db_stops *stops;
	struct db_lane places[];
};

struct db_lanes *db_lanes_new(sd_event *loop, const struct db_lanes_form *form, void *context)
{
	struct db_lanes *lanes = calloc(1, sizeof(*lanes) + form->most * sizeof(lanes->places[0]));

	if (!lanes)
		return NULL;
	lanes->loop = loop;
	lanes->form = *form;
	lanes->context = context;
	lanes->stops = db_stops_new(loop, form->socket, form->stops);
	if (lanes->stops)
		return lanes;
	free(lanes);
	return NULL;
}

bool db_lanes_drop(struct db_lanes *lanes)
{
	bool any = false;

	for (struct db_lane *lane; (lane = db_lanes_next(lanes, NULL)); any = true)
		db_lane_drop(lane);
	return db_stops_drop(lanes->stops) || any;
}

void db_lanes_free(struct db_lanes *lanes)
{
	if (!lanes)
		return;
	(void)db_lanes_drop(lanes);
	free(lanes->stops);
	free(lanes);
}

struct db_stops *db_lanes_stops(struct db_lanes *lanes)
{
	return lanes->stops;
}

static void lose(void *data)
{
	struct db_lane *lane = data;
	struct db_lanes *lanes = lane->lanes;

	if (lanes->form.lost)
		lanes->form.lost(lanes->context, lane);
	else
		db_lane_drop(lane);
}

struct db_lane *db_lanes_open(struct db_lanes *lanes, struct db_client_error *error)
{
	struct db_lane *lane = lanes->places;

	while (lane < lanes->places + lanes->form.most && lane->link)
		lane++;
	if (lane == lanes->places + lanes->form.most) {
		db_client_error_set(error, DB_LANES_FULL,
		                    "all connections for commands are in use");
		return NULL;
	}
	*lane = (struct db_lane){ .lanes = lanes };
	/* First, while there is room in the service. */
	db_stops_prepare(lanes->stops);
	lane->link = db_link_open(lanes->loop, lanes->form.socket, lose, lane, error);
	return lane->link ? lane : NULL;
}

struct db_lane *db_lanes_next(struct db_lanes *lanes, const struct db_lane *lane)
{
	for (size_t i = lane ? (size_t)(lane - lanes->places) + 1 : 0; i < lanes->form.most; i++) {
		if (lanes->places[i].link)
			return &lanes->places[i];
	}
	return NULL;
}

void db_lane_drop(struct db_lane *lane)
{
	db_link_drop(lane->link);
	while (lane->drives) {
		struct db_lane_drive *drive = lane->drives;

		lane->drives = drive->next;
		json_decref(drive->note);
		free(drive);
	}
	free(lane->call);
	*lane = (struct db_lane){ .lanes = lane->lanes };
}

void db_lane_close(struct db_lane *lane)
{
	struct db_link *link = lane ? lane->link : NULL;

	/* Its place is free only after the answers. */
	db_link_close(link);
	if (link) {
		lane->link = NULL;
		db_lane_drop(lane);
	}
}

/* --- watchdogs -------------------------------------------------------------------------------- */

static struct db_lane_drive *find_drive(const struct db_lane *lane, const char *name)
{
	struct db_lane_drive *drive = lane->drives;

	while (drive && strcmp(drive->name, name) != 0)
		drive = drive->next;
	return drive;
}

json_t **db_lane_note(struct db_lane *lane, const char *drive)
{
	struct db_lane_drive *found = find_drive(lane, drive);

	return found ? &found->note : NULL;
}

bool db_lane_command(struct db_lane *lane, const char *drive, db_time now)
{
	struct db_lane_drive *one = drive ? find_drive(lane, drive) : NULL;

	if (drive && !one) {
		if (lane->count == DRIVES_MAX || strlen(drive) >= sizeof(one->name))
			return false;
		one = calloc(1, sizeof(*one));
		if (!one)
			return false;
		snprintf(one->name, sizeof(one->name), "%s", drive);
		one->lane = lane;
		one->next = lane->drives;
		lane->drives = one;
		lane->count++;
	}
	for (struct db_lane_drive *each = lane->drives; each; each = each->next) {
		if (!drive || each == one)
			each->commanded = each->due = now;
	}
	return true;
}

/* Time until silence would end something; 0 if it would end nothing. */
static db_time time_left(const json_t *values)
{
	json_int_t watchdog = json_integer_value(json_object_get(values, "watchdog_remaining_ms"));
	json_int_t control = json_integer_value(json_object_get(values, "control_remaining_ms"));
	/* Reads 1 on the connection that has control. */
	bool controls = json_integer_value(json_object_get(values, "control_request")) == 1;

	if (controls && control > 0 && (watchdog <= 0 || control < watchdog))
		return control * DB_NS_PER_MS;
	return watchdog * DB_NS_PER_MS;
}

static void on_read(void *data, json_t *parameters, const struct db_client_error *error, bool more)
{
	struct db_lane_drive *drive = data;
	struct db_lane *lane = drive->lane;
	const struct db_lanes_form *form = &lane->lanes->form;
	const json_t *values = json_object_get(parameters, "values");
	db_time left = time_left(values);
	db_time now = db_client_now();
	bool again = left > 0 || now - drive->commanded < BEGINS_WITHIN;

	(void)more;
	drive->reading = false;
	lane->reads--;
	if (error)
		again = again || strncmp(error->name, NO_SUCH, strlen(NO_SUCH)) != 0;
	else if (form->seen)
		again = form->seen(lane->lanes->context, lane, drive->name, values) || again;
	/* The watchdog stays armed at standstill, and control stays too. The next command starts
	 * both again. */
	if (form->interval == 0)
		drive->due = now;
	else if (!again)
		drive->due = DB_TIME_NEVER;
	else if (error)
		drive->due = now + form->interval;
	else
		drive->due = now + db_time_min(form->interval, db_time_max(left / 4, INTERVAL_MIN));
}

void db_lane_feed(struct db_lane *lane, db_time now)
{
	if (db_link_waiting(lane->link) > lane->reads)
		return;
	for (struct db_lane_drive *drive = lane->drives; drive; drive = drive->next) {
		if (drive->reading || now < drive->due)
			continue;
		/* A lost connection is noticed at its next handling. */
		drive->reading = db_link_send(lane->link, "Read",
		                              json_pack("{s:s, s:[s,s,s,s]}", "drive", drive->name,
		                                        "names", "axis_state",
		                                        "watchdog_remaining_ms", "control_request",
		                                        "control_remaining_ms"),
		                              false, on_read, drive) == 0;
		lane->reads += drive->reading;
	}
}

db_time db_lanes_due(const struct db_lanes *lanes)
{
	db_time due = DB_TIME_NEVER;

	for (size_t i = 0; i < lanes->form.most; i++) {
		for (const struct db_lane_drive *drive = lanes->places[i].drives; drive;
		     drive = drive->next) {
			if (!drive->reading && drive->due < due)
				due = drive->due;
		}
	}
	return due;
}
