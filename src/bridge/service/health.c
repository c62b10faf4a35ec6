/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/clock.h"
#include "drivebridge/health.h"
#include "drivebridge/trouble.h"
#include "regmap/named.h"
#include "service/configuration.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define FOLDER_NAME "health"
#define LOOK_EVERY_US 250000
/* After a start drives are asked for the first time, one after the other. */
#define STARTING (5 * DB_NS_PER_S)

/* --- values ----------------------------------------------------------------------------------- */

void health_set_drives(struct service *service)
{
	const struct plant *plant = service->plant;
	struct db_health_drive drives[DB_HEALTH_DRIVES_MAX];
	size_t count = 0;

	/* Units are 1 to 247, so there are no more drives. */
	for (; count < plant->drive_count && count < DB_HEALTH_DRIVES_MAX; count++) {
		const struct plant_drive *drive = plant->drives[count];

		drives[count] = (struct db_health_drive){ .name = drive->config->name,
			                                  .unit = (uint16_t)drive->config->unit,
			                                  .number = drive->number };
	}
	if (db_health_set_drives(service->health, drives, count) != 0)
		db_log(&service->log, service_now(service), DB_EVENT_HEALTH_UNKEPT, NULL,
		       "no memory to take health values of the drives");
}

/* --- alarms ----------------------------------------------------------------------------------- */

static void see_buses(struct service *service, db_time now, uint64_t wall)
{
	const struct db_bus_config *bus;

	for (size_t i = 0; (bus = db_named_bus(service->registers, i)) != NULL; i++) {
		enum db_trouble_cause cause;
		struct db_bus_stats stats;

		db_named_bus_stats(service->registers, i, &stats);
		cause = db_trouble_of_bus(stats.up && stats.port.up, stats.aside);
		/* A hint is no alarm: nobody has to look. */
		if (db_trouble_need(cause) <= DB_NEED_HINT)
			continue;
		db_health_see(service->health,
		              &(struct db_alarm_seen){
				      .kind = DB_ALARM_BUS,
				      .cause = (uint8_t)cause,
				      .name = bus->name,
				      .detail = cause == DB_TROUBLE_PORT && stats.last_error != 0 ?
		                                        strerror((int)stats.last_error) :
		                                        "",
				      .since_us = db_clock_wall_us_of(stats.down_since, now, wall),
			      });
	}
}

static void see_drives(struct service *service, db_time now, uint64_t wall)
{
	for (size_t i = 0; i < service->plant->drive_count; i++) {
		const struct plant_drive *drive = service->plant->drives[i];
		char text[DB_ERROR_TEXT_MAX];
		struct db_trouble trouble;
		enum db_trouble_cause cause;
		uint16_t error;

		if (!db_named_trouble(service->registers, drive->number, &trouble, &error))
			continue;
		cause = (enum db_trouble_cause)trouble.cause;
		/* The alarm of the bus is about all of its drives. */
		if (db_trouble_need(cause) <= DB_NEED_HINT || cause == DB_TROUBLE_PORT ||
		    cause == DB_TROUBLE_ASIDE)
			continue;
		db_health_see(service->health,
		              &(struct db_alarm_seen){
				      .kind = DB_ALARM_DRIVE,
				      .cause = (uint8_t)cause,
				      .name = drive->config->name,
				      .detail = cause == DB_TROUBLE_FAULT ?
		                                        db_error_text(drive->bus->config->driver,
		                                                      error, text) :
		                                        "",
				      .since_us = db_clock_wall_us_of(trouble.since, now, wall),
			      });
	}
}

static void see_configuration(struct service *service)
{
	struct db_configuration_report report = configuration_report(service);
	char line[DB_ALARM_DETAIL_MAX];

	if (report.state != DB_CONFIGURATION_REFUSED && report.state != DB_CONFIGURATION_LAST_GOOD)
		return;
	snprintf(line, sizeof(line), "%.*s", (int)strcspn(report.messages, "\n"), report.messages);
	db_health_see(service->health, &(struct db_alarm_seen){ .kind = DB_ALARM_CONFIGURATION,
	                                                        .cause = (uint8_t)report.state,
	                                                        .name = "",
	                                                        .detail = line,
	                                                        .since_us = report.since_us });
}

/* --- beginning and end ------------------------------------------------------------------------ */

static int on_timer(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;
	db_time now = service_now(service);
	uint64_t wall = db_clock_wall_us();

	(void)us;
	for (size_t i = 0; i < service->plant->drive_count; i++) {
		const struct plant_drive *drive = service->plant->drives[i];
		unsigned measures = drive->bus->config->driver->measures;
		struct db_snapshot snapshot;

		db_axis_read(drive->axis, &snapshot);
		db_health_sample(service->health, i, &snapshot,
		                 (measures & DB_MEASURE_TEMPERATURE) != 0, now);
	}
	if (now >= service->alarms_from) {
		see_buses(service, now, wall);
		see_drives(service, now, wall);
		see_configuration(service);
		db_health_seen(service->health, wall);
	}
	db_health_tick(service->health, now, wall);
	sd_event_source_set_time_relative(source, LOOK_EVERY_US);
	return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

int health_begin(struct service *service)
{
	const struct db_control_config *config = &service->plant->edition->config->control;
	struct db_health_setup setup = { .log = service->log, .on = !config->health_off };
	char *folder = NULL;
	int error;

	(void)service_state_path(FOLDER_NAME, &folder);
	setup.folder = folder;
	error = db_health_new(&setup, service_now(service), &service->health);
	free(folder);
	if (error != 0)
		return error;
	service->alarms_from = service_now(service) + STARTING;
	health_set_drives(service);
	return sd_event_add_time_relative(service->loop, &service->health_timer, CLOCK_MONOTONIC,
	                                  LOOK_EVERY_US, LOOK_EVERY_US / 4, on_timer, service);
}

void health_end(struct service *service)
{
	sd_event_source_disable_unref(service->health_timer);
	service->health_timer = NULL;
	if (service->health &&
	    !db_health_free(service->health, service_now(service), db_clock_wall_us()))
		service->log_in_use = true;
	service->health = NULL;
}
