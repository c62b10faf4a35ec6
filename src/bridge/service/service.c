/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service.h"

#include "drivebridge/clock.h"
#include "drivebridge/log.h"
#include "service/configuration.h"
#include "service/edit.h"
#include "service/service_private.h"
#include "service/status.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sysexits.h>
#include <systemd/sd-daemon.h>
#include <time.h>
#include <unistd.h>

/* --- putting together ------------------------------------------------------------------------- */

/*
 * systemd gives up on a service that fails too often, and what another program occupies will be
 * free again: so as a service this waits before it touches a bus. If the program was started by
 * hand, the error is reported instead. 0 to try again, -ECANCELED when asked to end, else the
 * error.
 */
static int wait_after(int error)
{
	const struct timespec second = { .tv_sec = 1 };
	sigset_t ends;

	if (!getenv("NOTIFY_SOCKET"))
		return error;
	sigemptyset(&ends);
	sigaddset(&ends, SIGTERM);
	sigaddset(&ends, SIGINT);
	return sigtimedwait(&ends, NULL, &second) < 0 ? 0 : -ECANCELED;
}

static int listen_for_clients(struct service *service)
{
	const struct db_modbus_config *modbus = &service->plant->edition->config->modbus;
	bool logged = false;
	const char *where;
	int error;

	do {
		error = db_server_new(service->loop, modbus, &db_registers_backend,
		                      service->registers, &service->log, &service->server, &where);
		if (error == 0)
			break;
		if (!logged)
			db_log(&service->log, service_now(service), DB_EVENT_FAILED, NULL,
			       "cannot listen on %s: %s%s", where ? where : modbus->listen,
			       strerror(-error),
			       error == -EADDRINUSE ? "; another program uses this port" :
			       error == -EACCES     ? "; ports below 1024 are for the service: see "
			                              "CAP_NET_BIND_SERVICE in its unit" :
			                              "");
		logged = true;
		if (error == -EADDRINUSE)
			error = wait_after(error);
	} while (error == 0);
	if (error == 0)
		service_limit_clients(service);
	return error;
}

static bool read_secure_status(void *context, struct db_secure_status *status)
{
	const struct service *service = context;

	return db_server_secure_status(service->server, status);
}

static bool read_line(void *context, size_t index, struct db_server_line *line)
{
	const struct service *service = context;

	return db_server_read_line(service->server, index, line);
}

static const struct db_trace *find_trace(void *context, const char *name, uint32_t *number)
{
	const struct service *service = context;
	const struct plant_bus *bus = plant_bus_named(service->plant, name);

	if (!bus || !bus->bus)
		return NULL;
	*number = bus->number;
	return db_bus_trace(bus->bus);
}

static int listen_for_tools(struct service *service)
{
	static const struct db_control_socket_ops ops = {
		.reload = reload_ask,
		.configuration = configuration_report,
		.edit = edit_begin,
		.server_stats = service_read_server_stats,
		.secure_status = read_secure_status,
		.line = read_line,
		.scan = scans_begin,
		.scan_read = scans_read,
		.scan_find = scans_find,
		.scan_foreign = scans_foreign,
		.scan_cancel = scans_cancel,
		.trace = find_trace,
		.audit_post = audit_post,
		.positions = positions_list,
		.positions_changed = positions_changed,
		.positions_trouble = positions_trouble,
	};
	const struct db_control_socket_setup setup = {
		.loop = service->loop,
		.config = &service->plant->edition->config->control,
		.configuration = service->path,
		.registers = service->registers,
		.traces = service->traces,
		.audit = &service->audit,
		.health = &service->health,
		.log = service->log,
		.ops = &ops,
		.context = service,
	};

	return db_control_socket_new(&setup, &service->control);
}

static int set_up(struct service *service, struct configuration_start *start)
{
	int error = plant_new(service, start->config, NULL, &service->last_number, &service->plant);
	struct plant_roster roster;

	start->config = NULL;
	/* The loop first: the registers need its time. */
	if (error == 0)
		error = loop_new(service);
	if (error >= 0)
		error = traces_begin(service);
	if (error >= 0)
		error = plant_roster_init(&roster, service->plant);
	if (error >= 0) {
		error = db_registers_new(&roster.roster, &service_registers_ops, service,
		                         &service->registers);
		plant_roster_release(&roster);
	}
	if (error >= 0)
		error = loop_feed_watchdog(service);
	if (error < 0)
		return error;
	error = listen_for_clients(service);
	if (error == 0)
		error = listen_for_tools(service);
	/* Before the first commands. */
	if (error == 0)
		error = audit_begin(service);
	if (error == 0)
		error = must_stand_begin(service);
	if (error == 0)
		error = status_begin(service);
	if (error == 0)
		error = health_begin(service);
	if (error == 0)
		error = positions_begin(service);
	if (error == 0)
		error = configuration_begin(service, start);
	/* A program that waits for this line finds everything ready. */
	if (error == 0)
		service_log_listening(service, NULL, &service->plant->edition->config->modbus);
	for (size_t b = 0; error == 0 && b < service->plant->bus_count; b++)
		error = db_bus_start(service->plant->buses[b]->bus);
	return error;
}

/*
 * All buses carry out their drives' on_exit in parallel; clients are disconnected by then. What a
 * reload has prepared is freed last: buses have its drives already.
 */
static void tear_down(struct service *service)
{
	status_end(service);
	if (service->registers)
		db_registers_end_holds(service->registers, service_now(service));
	db_control_socket_free(service->control);
	service->control = NULL;
	db_server_free(service->server);
	if (service->plant)
		plant_end(service->plant);
	reload_abandon(service);
	configuration_end(service);
	edit_end(service);
	positions_end(service);
	must_stand_end(service);
	audit_end(service);
	health_end(service);
	db_registers_free(service->registers);
	traces_end(service);
	plant_free(service->plant, NULL);
	loop_free(service);
	free(service->reload_errors);
	if (service->lock >= 0)
		close(service->lock);
}

/* --- what it needs of the machine ------------------------------------------------------------- */

/* Locks the configuration: another process that runs it would be a second master on each of its
 * buses. */
static int take_configuration(struct service *service)
{
	bool logged = false;
	pid_t holder = 0;
	int error = 0;

	while (error == 0) {
		service->lock = alone_take(service->path, &holder);
		/* Where there are no such sockets, ports and the listening address exclude other
		 * processes. */
		if (service->lock != -EBUSY)
			return 0;
		if (!logged)
			db_log(&service->log, db_clock_now(), DB_EVENT_FAILED, NULL,
			       "%s is in use by another process (%d): two masters on one bus would "
			       "disturb each other; systemctl stop drivebridge ends the "
			       "service, systemctl reload drivebridge has it read a changed file",
			       service->path, (int)holder);
		logged = true;
		error = wait_after(-EBUSY);
	}
	return error;
}

static int run_service(struct service *service, struct configuration_start *start)
{
	int error = take_configuration(service);
	struct rlimit limit;

	if (error != 0)
		return error == -ECANCELED ? EXIT_SUCCESS : EXIT_FAILURE;
	/* Raises the soft limit, which exists for programs that use select(). */
	if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur != limit.rlim_max) {
		limit.rlim_cur = limit.rlim_max;
		/* If it cannot be raised, clients are refused earlier. */
		(void)setrlimit(RLIMIT_NOFILE, &limit);
	}
	/* Locks memory: a page that has to be read from a disk first makes a cycle late. */
	if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0 && errno != EPERM &&
	    errno != ENOMEM)
		db_log(&service->log, db_clock_now(), DB_EVENT_MEMORY_UNLOCKED, NULL,
		       "cannot lock memory: %s; a cycle may be late when memory is short",
		       strerror(errno));
	if (start->config->drive_count == 0)
		db_log(&service->log, db_clock_now(), DB_EVENT_NO_DRIVES, NULL,
		       "no drive is configured yet: describe the buses and drives in %s, see "
		       "drivebridge.conf(5), check it with drivebridged --config %s --check and "
		       "reload",
		       service->path, service->path);
	error = set_up(service, start);
	if (error >= 0) {
		sd_notify(0, "READY=1");
		error = sd_event_loop(service->loop);
		sd_notify(0, "STOPPING=1");
	}
	if (error == -ECANCELED)
		error = 0;
	if (error < 0)
		db_log(&service->log, db_clock_now(), DB_EVENT_FAILED, NULL, "cannot go on: %s",
		       strerror(-error));
	tear_down(service);
	return error < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

int db_service_run(const char *path, bool last_good)
{
	struct configuration_start start;
	struct service service = { .path = path, .lock = -1 };
	int error;
	int status;
	sigset_t signals;

	/* A special status for systemd: starting again would not help. */
	if (!configuration_load(path, last_good, &start))
		return EX_CONFIG;
	service.log.level = start.config->modbus.log;
	/* Called before any thread starts: the loop handles signals. */
	sigemptyset(&signals);
	sigaddset(&signals, SIGTERM);
	sigaddset(&signals, SIGINT);
	sigaddset(&signals, SIGHUP);
	sigprocmask(SIG_BLOCK, &signals, NULL);
	signal(SIGPIPE, SIG_IGN);
	/* A file that may not grow any more is an error like a full disk. */
	signal(SIGXFSZ, SIG_IGN);
	error = db_log_new(&service.log.log);
	if (error != 0) {
		fprintf(stderr, "cannot make the log: %s\n", strerror(-error));
		configuration_start_clear(&start);
		return EXIT_FAILURE;
	}
	status = run_service(&service, &start);
	configuration_start_clear(&start);
	if (service.log_in_use)
		db_log_leave(service.log.log);
	else
		db_log_free(service.log.log);
	return status;
}
