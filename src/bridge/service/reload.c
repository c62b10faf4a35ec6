/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include "drivebridge/audit.h"
#include "drivebridge/clock.h"
#include "drivebridge/health.h"
#include "drivebridge/log.h"
#include "service/configuration.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>
#include <time.h>

struct reload {
	uint64_t signature; /* signature of the files from which it was read */
	char *copy;         /* copy of their texts; null: none */
	struct plant *next;
	struct db_server_change *server;
	struct db_registers_change *registers;
};

/* --- texts ------------------------------------------------------------------------------------ */

/* Logs about a bus, and a drive of it if not null, or with null about the service. */
static void log_effect(void *context, const struct db_bus_config *bus_config,
                       const struct plant_drive *drive, const char *text)
{
	const struct service *service = context;
	struct db_log_source log = service->log;
	struct db_log_about about = { .drive = drive ? drive->config->name : NULL };

	log.bus = bus_config ? bus_config->name : NULL;
	db_log(&log, service_now(service), DB_EVENT_RELOAD, &about, "reload: %s", text);
}

/* Tells what happens to all that is not kept unchanged; returns the number of drives that are not
 * affected. */
static size_t tell_effects(const struct plant *running, const struct plant *next,
                           reload_tell_fn *tell, void *context)
{
	size_t kept = 0;

	for (size_t i = 0; i < running->bus_count; i++) {
		const struct db_bus_config *bus_config = running->buses[i]->config;

		if (plant_has_bus(next, running->buses[i]))
			continue;
		tell(context, bus_config, NULL,
		     plant_bus_named(next, bus_config->name) ?
		             "it is changed and starts with the new settings" :
		             "it is removed");
	}
	for (size_t i = 0; i < next->bus_count; i++) {
		const struct db_bus_config *bus_config = next->buses[i]->config;

		if (!plant_bus_named(running, bus_config->name))
			tell(context, bus_config, NULL, "it is added");
	}
	for (size_t i = 0; i < running->drive_count; i++) {
		const struct plant_drive *drive = running->drives[i];
		const struct plant_drive *after = plant_drive_named(next, drive->config->name);

		if (after == drive)
			kept++;
		else if (!after)
			tell(context, drive->bus->config, drive,
			     "it is removed: its on-exit is carried out");
		else if (db_config_same_drive(drive->edition->config, drive->config,
		                              after->edition->config, after->config))
			tell(context, drive->bus->config, drive, "it starts again with its bus");
		else
			tell(context, drive->bus->config, drive,
			     "it is changed: its on-exit is carried out, then it starts with the "
			     "new settings");
	}
	for (size_t i = 0; i < next->drive_count; i++) {
		const struct plant_drive *drive = next->drives[i];

		if (!plant_drive_named(running, drive->config->name))
			tell(context, drive->bus->config, drive, "it is added");
	}
	return kept;
}

int reload_foresee(struct service *service, struct db_config *config, struct plant **next,
                   reload_tell_fn *tell, void *context)
{
	/* Numbers of drives are not used up. */
	uint16_t last_number = service->last_number;
	int error = plant_new(service, config, service->plant, &last_number, next);

	if (error != 0)
		return error;
	(void)tell_effects(service->plant, *next, tell, context);
	return 0;
}

/* The reason for a failed reload: for the log, and for the client that requested it. */
__attribute__((format(printf, 3, 4))) static void log_error(struct service *service,
                                                            enum db_event event, const char *format,
                                                            ...)
{
	char *before = service->reload_errors;
	char text[1024];
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	db_log(&service->log, service_now(service), event, NULL, "%s", text);
	if (asprintf(&service->reload_errors, "%s%s%s", before ? before : "", before ? "\n" : "",
	             text) < 0)
		service->reload_errors = NULL;
	free(before);
}

/* It has ended, with whatever result. */
static void end_reload(struct service *service)
{
	char *errors = service->reload_errors;

	service->reload_errors = NULL;
	sd_notify(0, "READY=1");
	(void)audit_post(service, NULL,
	                 &(struct db_audit_entry){
				 .kind = DB_AUDIT_RELOAD,
				 .what = "ended",
				 .text = errors,
				 .result = errors ? DB_RESULT_REFUSED : DB_RESULT_OK,
			 });
	db_control_socket_reloaded(service->control, errors);
	free(errors);
}

/* --- getting ready ---------------------------------------------------------------------------- */

/* The drives that are removed from a bus and added to it; nothing when there are none. */
static int prepare_bus(struct plant_bus *bus, const struct plant *running, const struct plant *next)
{
	size_t leaving_count;
	size_t coming_count;
	struct db_bus_drive *leaving = plant_drives_on(running, bus, next, &leaving_count);
	struct db_bus_drive *coming = plant_drives_on(next, bus, running, &coming_count);
	uint16_t *numbers = calloc(leaving_count + 1, sizeof(*numbers));
	int error = leaving && coming && numbers ? 0 : -ENOMEM;

	for (size_t i = 0; error == 0 && i < leaving_count; i++)
		numbers[i] = leaving[i].drive;
	if (error == 0 && leaving_count + coming_count > 0)
		error = db_bus_change_new(bus->bus, numbers, leaving_count, coming, coming_count,
		                          &bus->change);
	free(leaving);
	free(coming);
	free(numbers);
	return error;
}

/* Everything that can fail. free_reload() frees what was prepared in any case. */
static int prepare_reload(struct service *service, struct reload *reload)
{
	const struct db_modbus_config *modbus = &reload->next->edition->config->modbus;
	struct plant_roster roster;
	const char *where;
	int error = 0;

	for (size_t i = 0; error >= 0 && i < reload->next->bus_count; i++) {
		struct plant_bus *bus = reload->next->buses[i];

		if (plant_has_bus(service->plant, bus))
			error = prepare_bus(bus, service->plant, reload->next);
		else
			error = service_watch_bus(service, bus);
	}
	if (error >= 0)
		error = plant_roster_init(&roster, reload->next);
	if (error >= 0) {
		error = db_registers_prepare(service->registers, &roster.roster,
		                             &reload->registers);
		plant_roster_release(&roster);
	}
	if (error < 0) {
		log_error(service, DB_EVENT_RELOAD_FAILED, "reload: %s; nothing changes",
		          strerror(-error));
		return error;
	}
	error = db_server_prepare(service->server, modbus, &reload->server, &where);
	if (error < 0)
		log_error(service, DB_EVENT_RELOAD_FAILED,
		          "reload: cannot listen on %s: %s; nothing changes",
		          where ? where : modbus->listen, strerror(-error));
	return error;
}

static void free_reload(struct reload *reload, const struct plant *running)
{
	for (size_t i = 0; running && i < running->bus_count; i++) {
		db_bus_change_free(running->buses[i]->change);
		running->buses[i]->change = NULL;
	}
	db_registers_change_free(reload->registers);
	db_server_change_free(reload->server);
	plant_free(reload->next, running);
	free(reload->copy);
	free(reload);
}

/* --- what goes -------------------------------------------------------------------------------- */

static void retire_parts(struct service *service, struct reload *reload)
{
	struct plant *running = service->plant;
	const struct db_modbus_config *before = &running->edition->config->modbus;
	const struct db_config *next = reload->next->edition->config;

	db_registers_retire(service->registers, reload->registers);
	db_server_apply(service->server, reload->server);
	reload->server = NULL;
	service->log.level = next->modbus.log;
	db_audit_change(service->audit, !next->control.audit_off, next->control.audit_mib);
	db_health_change(service->health, !next->control.health_off);
	db_control_socket_change(service->control, &next->control, &service->log);
	service_log_listening(service, before, &next->modbus);
	for (size_t i = 0; i < running->bus_count; i++) {
		struct plant_bus *bus = running->buses[i];

		bus->leaving = !plant_has_bus(reload->next, bus);
		if (bus->leaving)
			db_bus_ask_end(bus->bus);
		if (!bus->change)
			continue;
		bus->changing = true;
		db_bus_change(bus->bus, bus->change);
		bus->change = NULL;
	}
}

static bool is_all_gone(const struct plant *running)
{
	for (size_t i = 0; i < running->bus_count; i++) {
		struct plant_bus *bus = running->buses[i];
		/* The bus's notification may have been received together with that of a completion:
		 * so this is checked whenever the loop is about to sleep. */
		struct db_change *changed = bus->changing ? db_bus_take_changed(bus->bus) : NULL;

		if (changed) {
			/* After that check: all completions of removed drives have arrived by then.
			 */
			service_collect(bus);
			bus->changing = false;
			db_bus_change_free(changed);
		}
		if (bus->changing || (bus->leaving && !db_bus_has_ended(bus->bus)))
			return false;
	}
	return true;
}

/* --- what comes ------------------------------------------------------------------------------- */

static int begin_next(struct service *service, struct reload *reload)
{
	struct plant *before = service->plant;
	int error = 0;

	for (size_t i = 0; i < before->bus_count; i++) {
		if (before->buses[i]->leaving)
			service_collect(before->buses[i]);
	}
	must_stand_look(service);
	db_registers_apply(service->registers, reload->registers);
	service->plant = reload->next;
	service_limit_clients(service);
	for (size_t i = 0; error == 0 && i < service->plant->bus_count; i++) {
		if (!plant_has_bus(before, service->plant->buses[i]))
			error = db_bus_start(service->plant->buses[i]->bus);
	}
	health_set_drives(service);
	plant_free(before, service->plant);
	must_stand_look(service);
	/* The files agree with what runs. */
	configuration_loaded(service, reload->signature, reload->copy);
	free(reload);
	service->reload = NULL;
	return error;
}

/* What was read from the files. */
struct reading {
	uint64_t signature;
	struct db_config *config;
	char *copy;
	char *messages;
};

/* False when it cannot succeed. */
static bool begin_reload(struct service *service, struct reading *reading)
{
	struct reload *reload = calloc(1, sizeof(*reload));
	int error = reload ? plant_new(service, reading->config, service->plant,
	                               &service->last_number, &reload->next) :
	                     -ENOMEM;
	size_t kept;

	if (!reload)
		db_config_free(reading->config);
	if (error != 0) {
		log_error(service, DB_EVENT_RELOAD_FAILED, "reload: %s; nothing changes",
		          strerror(-error));
		free(reload);
		return false;
	}
	reload->signature = reading->signature;
	reload->copy = reading->copy;
	reading->copy = NULL;
	if (plant_same(service->plant, reload->next)) {
		db_log(&service->log, service_now(service), DB_EVENT_RELOAD, NULL,
		       "reload: %s is what is loaded already; nothing changes", service->path);
		db_config_keep_ends(service->plant->edition->config, reload->next->edition->config);
		configuration_loaded(service, reload->signature, reload->copy);
		reload->copy = NULL;
		free_reload(reload, service->plant);
		return true;
	}
	if (prepare_reload(service, reload) < 0) {
		free_reload(reload, service->plant);
		return false;
	}
	kept = tell_effects(service->plant, reload->next, log_effect, service);
	if (!db_config_same_modbus(service->plant->edition->config, reload->next->edition->config))
		log_effect(service, NULL, NULL, "the section modbus is changed");
	if (!db_config_same_control(service->plant->edition->config, reload->next->edition->config))
		log_effect(service, NULL, NULL, "the section control is changed");
	db_log(&service->log, service_now(service), DB_EVENT_RELOAD, NULL,
	       "reload: %zu drive%s without interruption", kept,
	       kept == 1 ? " continues" : "s continue");
	service->reload = reload;
	retire_parts(service, reload);
	return true;
}

/* False when they are invalid. */
static bool read_files(struct service *service, struct reading *reading)
{
	size_t size = 0;
	FILE *errors = open_memstream(&reading->messages, &size);
	struct db_config_reading files;

	if (!errors)
		return false;
	(void)db_config_read(service->path, NULL, errors, &files);
	reading->signature = files.signature;
	reading->config = files.config;
	reading->copy = files.copy;
	free(files.profiles);
	if (reading->config) {
		/* A file that was cut off while being written would remove drives that move. */
		char *why;

		if (db_config_is_cut(service->plant->edition->config, reading->config, &why)) {
			fprintf(errors, "%s\n", why ? why : strerror(ENOMEM));
			free(why);
			db_config_free(reading->config);
			reading->config = NULL;
		}
	}
	fclose(errors);
	if (reading->messages) {
		/* Messages about the file go to the log, which never waits for its readers. */
		const char *line = reading->messages;

		while (*line) {
			int length = (int)strcspn(line, "\n");

			if (reading->config)
				db_log(&service->log, service_now(service), DB_EVENT_RELOAD, NULL,
				       "%.*s", length, line);
			else
				log_error(service, DB_EVENT_CONFIG_WRONG, "%.*s", length, line);
			line += length;
			line += *line == '\n';
		}
	}
	return reading->config;
}

bool reload_ask(void *context)
{
	struct service *service = context;
	struct reading reading = { 0 };

	if (service->reload) {
		service->reload_again = true;
		return false;
	}
	sd_notifyf(0, "RELOADING=1\nMONOTONIC_USEC=%" PRIu64,
	           (uint64_t)(db_clock_now() / DB_NS_PER_US));
	if (!read_files(service, &reading)) {
		log_error(service, DB_EVENT_CONFIG_WRONG,
		          "reload: %s has an error and is not loaded, drivebridged --config %s "
		          "--check "
		          "shows it; nothing changes",
		          service->path, service->path);
		configuration_refused(service, reading.signature,
		                      reading.messages ? reading.messages : "");
	} else if (!begin_reload(service, &reading)) {
		configuration_refused(service, reading.signature,
		                      service->reload_errors ? service->reload_errors : "");
	}
	free(reading.copy);
	free(reading.messages);
	if (!service->reload)
		end_reload(service);
	return true;
}

void reload_step(struct service *service)
{
	while (service->reload && is_all_gone(service->plant)) {
		int error = begin_next(service, service->reload);

		if (error != 0) {
			/* A partial plant is worse than none: the service ends in order, and
			 * systemd restarts it. */
			sd_event_exit(service->loop, error);
			return;
		}
		log_effect(service, NULL, NULL, "done");
		end_reload(service);
		if (!service->reload_again)
			return;
		service->reload_again = false;
		(void)reload_ask(service);
	}
}

void reload_abandon(struct service *service)
{
	if (!service->reload)
		return;
	free_reload(service->reload, service->plant);
	service->reload = NULL;
}
