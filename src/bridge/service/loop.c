/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/audit.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <systemd/sd-daemon.h>
#include <time.h>

/* A deadline that is met later than this was delayed: by other clients, or because the whole
 * process was stopped. */
#define LATE (2 * DB_NS_PER_MS)

static int on_signal(sd_event_source *source, const struct signalfd_siginfo *info, void *context)
{
	struct service *service = context;

	(void)source;
	(void)info;
	return sd_event_exit(service->loop, EXIT_SUCCESS);
}

static int on_hangup(sd_event_source *source, const struct signalfd_siginfo *info, void *context)
{
	struct service *service = context;
	char text[64];

	(void)source;
	/* Who may send it is root, or runs as the service's user. */
	snprintf(text, sizeof(text), "a signal of process %u, user %u", (unsigned)info->ssi_pid,
	         (unsigned)info->ssi_uid);
	(void)audit_post(service, NULL,
	                 &(struct db_audit_entry){
				 .kind = DB_AUDIT_RELOAD,
				 .what = "asked for",
				 .text = text,
			 });
	(void)reload_ask(service);
	return 0;
}

bool loop_buses_are_alive(struct service *service, db_time now)
{
	bool alive = true;

	for (size_t b = 0; b < service->plant->bus_count; b++) {
		struct plant_bus *bus = service->plant->buses[b];
		uint32_t beats = db_bus_heartbeat(bus->bus);
		struct db_log_source log;

		if (beats != bus->beats || bus->beaten == 0 || db_bus_has_ended(bus->bus)) {
			bus->beats = beats;
			bus->beaten = now;
		}
		if (now - bus->beaten <= service->watchdog / 2)
			continue;
		log = service_log_of(service, bus->config);
		db_log(&log, now, DB_EVENT_THREAD_HANGS, NULL,
		       "the thread of the bus hangs; systemd will restart the service");
		alive = false;
	}
	return alive;
}

static int on_pulse(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;

	(void)us;
	if (loop_buses_are_alive(service, service_now(service)))
		sd_notify(0, "WATCHDOG=1");
	sd_event_source_set_time_relative(source, (uint64_t)(service->watchdog / DB_NS_PER_US / 4));
	return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

static int on_deadline(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;

	(void)source;
	(void)us;
	/* If this thread was late, serve waiting clients before judging their silence. */
	if (service_now(service) - service->armed > LATE) {
		db_server_catch_up(service->server);
		db_control_socket_catch_up(service->control);
	}
	service->armed = DB_TIME_NEVER;
	db_registers_expire(service->registers, service_now(service));
	return 0;
}

/* Writes begin and end inside every turn of the loop; the timer is set once, before it sleeps. */
static int on_prepare(sd_event_source *source, void *context)
{
	struct service *service = context;
	db_time first;

	(void)source;
	reload_step(service);
	/* The timer waits for the first deadline of a client. */
	first = db_registers_next_deadline(service->registers);
	if (first == service->armed)
		return 0;
	service->armed = first;
	if (first == DB_TIME_NEVER) {
		sd_event_source_set_enabled(service->deadline, SD_EVENT_OFF);
		return 0;
	}
	sd_event_source_set_time(service->deadline, (uint64_t)(first / DB_NS_PER_US));
	sd_event_source_set_enabled(service->deadline, SD_EVENT_ONESHOT);
	return 0;
}

int loop_new(struct service *service)
{
	int error = sd_event_default(&service->loop);

	if (error < 0)
		return error;
	/* Without their own handlers they would end the loop with the context as its result. */
	error = sd_event_add_signal(service->loop, &service->term, SIGTERM, on_signal, service);
	if (error >= 0)
		error = sd_event_add_signal(service->loop, NULL, SIGINT, on_signal, service);
	if (error >= 0)
		error = sd_event_add_signal(service->loop, NULL, SIGHUP, on_hangup, service);
	if (error >= 0)
		error = sd_event_add_time(service->loop, &service->deadline, CLOCK_MONOTONIC,
		                          UINT64_MAX, 500, on_deadline, service);
	if (error >= 0)
		error = sd_event_source_set_enabled(service->deadline, SD_EVENT_OFF);
	/* Prepare callbacks run whenever the loop is about to sleep, whatever their source. */
	if (error >= 0)
		error = sd_event_source_set_prepare(service->term, on_prepare);
	service->armed = DB_TIME_NEVER;
	for (size_t b = 0; error >= 0 && b < service->plant->bus_count; b++)
		error = service_watch_bus(service, service->plant->buses[b]);
	return error;
}

int loop_feed_watchdog(struct service *service)
{
	uint64_t us = 0;

	if (sd_watchdog_enabled(0, &us) <= 0)
		return 0;
	service->watchdog = (db_time)us * DB_NS_PER_US;
	return sd_event_add_time_relative(service->loop, &service->pulse, CLOCK_MONOTONIC, us / 4,
	                                  0, on_pulse, service);
}

void loop_free(struct service *service)
{
	sd_event_source_unref(service->pulse);
	sd_event_source_unref(service->deadline);
	sd_event_source_unref(service->term);
	sd_event_unref(service->loop);
}
