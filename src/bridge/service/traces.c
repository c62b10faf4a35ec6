/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/clock.h"

#include <errno.h>
#include <stdio.h>
#include <time.h>

static void arm(struct service *service)
{
	db_time next = db_trace_keeper_next(service->traces);

	if (next == DB_TIME_NEVER) {
		sd_event_source_set_enabled(service->keeping, SD_EVENT_OFF);
		return;
	}
	sd_event_source_set_time(service->keeping, (uint64_t)(next / DB_NS_PER_US) + 1);
	sd_event_source_set_enabled(service->keeping, SD_EVENT_ONESHOT);
}

static int on_due(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;

	(void)source;
	(void)us;
	db_trace_keeper_run(service->traces, db_clock_now(),
	                    db_clock_read(CLOCK_REALTIME) - db_clock_now());
	arm(service);
	return 0;
}

int traces_begin(struct service *service)
{
	int error;

	service->traces = db_trace_keeper_new();
	if (!service->traces)
		return -ENOMEM;
	error = sd_event_add_time(service->loop, &service->keeping, CLOCK_MONOTONIC, UINT64_MAX, 0,
	                          on_due, service);
	return error < 0 ? error : sd_event_source_set_enabled(service->keeping, SD_EVENT_OFF);
}

void traces_end(struct service *service)
{
	sd_event_source_disable_unref(service->keeping);
	service->keeping = NULL;
	db_trace_keeper_free(service->traces);
	service->traces = NULL;
}

void traces_look(struct plant_bus *bus)
{
	struct service *service = bus->service;

	db_trace_keeper_look(service->traces, bus->config->name, db_bus_trace(bus->bus),
	                     db_clock_now());
	arm(service);
}

void traces_note_tripped(struct service *service, const struct db_bus_config *bus_config,
                         const struct db_drive_config *drive)
{
	db_time now = db_clock_now();
	struct db_trace_cause cause = { .event = DB_EVENT_WATCHDOG_TRIPPED, .time = now };

	snprintf(cause.drive, sizeof(cause.drive), "%s", drive->name);
	for (size_t b = 0; b < service->plant->bus_count; b++) {
		const struct plant_bus *bus = service->plant->buses[b];

		if (bus->config == bus_config && bus->bus)
			db_trace_keeper_note(service->traces, bus->config->name,
			                     db_bus_trace(bus->bus), &cause, now);
	}
	arm(service);
}

void traces_leave(struct plant_bus *bus)
{
	if (bus->service->traces && bus->bus)
		db_trace_keeper_leave(bus->service->traces, db_bus_trace(bus->bus),
		                      db_clock_read(CLOCK_REALTIME) - db_clock_now());
}
