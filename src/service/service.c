/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service.h"

#include "drivebridge/command_table.h"
#include "drivebridge/log.h"
#include "service/alone.h"
#include "service/state.h"
#include "service/status.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <systemd/sd-daemon.h>
#include <time.h>
#include <unistd.h>

db_time service_now(const struct service *service)
{
	uint64_t us = 0;

	sd_event_now(service->loop, CLOCK_MONOTONIC, &us);
	return (db_time)us * DB_NS_PER_US;
}

/* Where there is no loop yet, or no more. */
static db_time monotonic_now(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (db_time)now.tv_sec * DB_NS_PER_S + now.tv_nsec;
}

/* A deadline that is met later than this was kept waiting: by other clients, or by a stop of the whole
 * process. */
#define LATE (2 * DB_NS_PER_MS)

/* --- what the registers ask for ------------------------------------------------------------------- */

static db_time now_of(void *context)
{
	return service_now(context);
}

static uint64_t wall_us(void *context)
{
	struct timespec now;

	(void)context;
	clock_gettime(CLOCK_REALTIME, &now);
	return (uint64_t)now.tv_sec * 1000000 + (uint64_t)now.tv_nsec / 1000;
}

static bool submit(void *context, struct db_bus *bus, const struct db_request *request)
{
	(void)context;
	return db_bus_submit(bus, request);
}

static void answer(void *context, struct db_write_token token, uint8_t exception)
{
	const struct service *service = context;

	db_server_answer(service->server, token, exception);
}

static void bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	(void)context;
	db_bus_read_stats(bus, stats);
}

static void server_stats(void *context, struct db_server_stats *stats)
{
	const struct service *service = context;

	db_server_stats(service->server, stats);
}

static size_t server_clients(void *context, struct db_server_client *clients, size_t max)
{
	const struct service *service = context;

	return db_server_clients(service->server, clients, max);
}

static void refused(void *context, const struct db_client *client, enum db_refusal kind)
{
	const struct service *service = context;

	db_server_refused(service->server, client, kind);
}

/* The network side speaking of a bus. */
static struct db_log_source log_of(const struct service *service, const struct db_bus_config *bus)
{
	return (struct db_log_source){
		.log = service->log.log,
		.bus = bus->name,
		.level = bus->log,
	};
}

static void tripped(void *context, const struct db_bus_config *bus,
                    const struct db_drive_config *drive, const struct db_client *last)
{
	const struct service *service = context;
	struct db_log_source log = log_of(service, bus);
	char text[DB_CLIENT_ADDRESS_MAX];
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };

	if (last->id != 0) {
		db_client_address(last->address, text);
		about.client = text;
	}
	db_log(&log, service_now(service), DB_EVENT_WATCHDOG_TRIPPED, &about,
	       "silent too long, so the watchdog stops the drive, and nothing moves it before "
	       "clear_fault; check the PLC, its program and the network");
}

/* What the client wrote, in words. */
static void describe_write(const struct db_refused_write *write, char *text, size_t size)
{
	if (write->command != DB_CMD_NONE)
		snprintf(text, size, "command %s", db_command_name(write->command));
	else if (write->address != 0)
		snprintf(text, size, "a write to register %u", write->address);
	else if (write->param)
		snprintf(text, size, "a write of parameter %s", write->param);
	else
		snprintf(text, size, "a write");
}

static void write_refused(void *context, const struct db_bus_config *bus,
                          const struct db_drive_config *drive, const struct db_client *client,
                          const struct db_refused_write *write)
{
	const struct service *service = context;
	struct db_log_source log = log_of(service, bus);
	bool open = write->result == DB_RESULT_TIMEOUT || write->result == DB_RESULT_INDETERMINATE;
	char address[DB_CLIENT_ADDRESS_MAX];
	struct db_log_about about = { .drive = drive->name, .unit = drive->unit };
	char what[96];

	if (client) {
		db_client_address(client->address, address);
		about.client = address;
	}
	describe_write(write, what, sizeof what);
	db_log(&log, service_now(service), DB_EVENT_COMMAND_REFUSED, &about,
	       "%s %s: %s (result %u)", what, open ? "is not confirmed" : "is refused",
	       db_result_name(write->result), (unsigned)write->result);
}

static const struct db_registers_ops registers_ops = {
	.now = now_of,
	.wall_us = wall_us,
	.submit = submit,
	.answer = answer,
	.bus_stats = bus_stats,
	.server_stats = server_stats,
	.server_clients = server_clients,
	.refused = refused,
	.write_refused = write_refused,
	.tripped = tripped,
};

/* --- the loop's events ---------------------------------------------------------------------------- */

/* Sets the timer to the first client that will not wait any longer. */
static void arm_deadline(struct service *service)
{
	db_time first = db_registers_next_deadline(service->registers);

	if (first == service->armed)
		return;
	service->armed = first;
	if (first == DB_TIME_NEVER) {
		sd_event_source_set_enabled(service->deadline, SD_EVENT_OFF);
		return;
	}
	sd_event_source_set_time(service->deadline, (uint64_t)(first / DB_NS_PER_US));
	sd_event_source_set_enabled(service->deadline, SD_EVENT_ONESHOT);
}

static int on_signal(sd_event_source *source, const struct signalfd_siginfo *info, void *context)
{
	struct service *service = context;

	(void)source;
	(void)info;
	return sd_event_exit(service->loop, EXIT_SUCCESS);
}

static int on_hangup(sd_event_source *source, const struct signalfd_siginfo *info, void *context)
{
	(void)source;
	(void)info;
	reload_ask(context);
	return 0;
}

/* Whether every bus's thread has turned within half of systemd's patience. */
static bool all_alive(struct service *service, db_time now)
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
		log = log_of(service, bus->config);
		db_log(&log, now, DB_EVENT_THREAD_HANGS, NULL,
		       "its thread hangs; systemd will start the service again");
		alive = false;
	}
	return alive;
}

static int on_pulse(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;

	(void)us;
	if (all_alive(service, service_now(service)))
		sd_notify(0, "WATCHDOG=1");
	sd_event_source_set_time_relative(source, (uint64_t)(service->watchdog / DB_NS_PER_US / 4));
	return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

static int on_deadline(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;

	(void)source;
	(void)us;
	/* Who is late itself first hears those whom it may find silent. */
	if (service_now(service) - service->armed > LATE)
		db_server_catch_up(service->server);
	service->armed = DB_TIME_NEVER;
	db_registers_expire(service->registers, service_now(service));
	return 0;
}

void service_collect(struct plant_bus *bus)
{
	struct service *service = bus->service;
	struct db_completion completion;

	while (db_bus_completion(bus->bus, &completion))
		db_registers_complete(service->registers, &completion, service_now(service));
}

static int on_completion(sd_event_source *source, int fd, uint32_t events, void *context)
{
	(void)source;
	(void)fd;
	(void)events;
	service_collect(context);
	return 0;
}

/* Writes come and go inside every turn of the loop; the timer follows once, before it sleeps. */
static int on_prepare(sd_event_source *source, void *context)
{
	(void)source;
	reload_step(context);
	arm_deadline(context);
	return 0;
}

/* --- putting together ----------------------------------------------------------------------------- */

int service_watch(struct service *service, struct plant_bus *bus)
{
	return sd_event_add_io(service->loop, &bus->completions, db_bus_completion_fd(bus->bus),
	                       EPOLLIN, on_completion, bus);
}

static int make_registers(struct service *service)
{
	struct plant_roster roster;
	int error = plant_roster_init(&roster, service->plant);

	if (error != 0)
		return error;
	error = db_registers_new(&roster.roster, &registers_ops, service, &service->registers);
	plant_roster_release(&roster);
	return error;
}

static int make_loop(struct service *service)
{
	int error = sd_event_default(&service->loop);

	if (error < 0)
		return error;
	/* Without a handler of their own they would end the loop with the context as its result. */
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
		error = service_watch(service, service->plant->buses[b]);
	return error;
}

/* A hung bus thread is as bad as a hung network: both must turn for systemd to be content. */
static int make_watchdog(struct service *service)
{
	uint64_t us = 0;

	if (sd_watchdog_enabled(0, &us) <= 0)
		return 0;
	service->watchdog = (db_time)us * DB_NS_PER_US;
	return sd_event_add_time_relative(service->loop, &service->pulse, CLOCK_MONOTONIC, us / 4,
	                                  0, on_pulse, service);
}

void service_log_listening(const struct service *service, const struct db_modbus_config *modbus)
{
	int host = (int)(strrchr(modbus->listen, ':') - modbus->listen);

	if (db_server_is_early(service->server))
		db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
		       "this machine does not have the address %.*s yet; clients are served as soon as "
		       "it does. If it never should: correct listen, or see ip address",
		       host, modbus->listen);
	db_log(&service->log, service_now(service), DB_EVENT_LISTENING, NULL,
	       "listening on %.*s:%u", host, modbus->listen,
	       (unsigned)db_server_port(service->server));
}

static const char *advice_for_listening(int error)
{
	switch (error) {
	case EADDRINUSE:
		return "; another program uses this port";
	case EACCES:
		return "; ports below 1024 are for the service: see CAP_NET_BIND_SERVICE in its unit";
	default:
		return "";
	}
}

/*
 * systemd gives up on a service that fails too often, and what another program holds is free again some
 * time: so as a service this waits, before it touches a bus. Who starts the program by hand is told
 * instead. 0 to try again, -ECANCELED when asked to end, else what kept it.
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
	bool told = false;
	int error;

	do {
		error = db_server_new(service->loop, modbus, &db_registers_backend,
		                      service->registers, &service->log, &service->server);
		if (error == 0)
			break;
		if (!told)
			db_log(&service->log, service_now(service), DB_EVENT_FAILED, NULL,
			       "cannot listen on %s: %s%s", modbus->listen, strerror(-error),
			       advice_for_listening(-error));
		told = true;
		if (error == -EADDRINUSE)
			error = wait_after(error);
	} while (error == 0);
	if (error != 0)
		return error;
	service_keep_descriptors(service);
	service_log_listening(service, modbus);
	return 0;
}

static int set_up(struct service *service, struct db_config *config)
{
	int error = plant_new(service, config, NULL, &service->last_number, &service->plant);

	/* The loop first: the registers ask it for the time. */
	if (error == 0)
		error = make_loop(service);
	if (error >= 0)
		error = make_registers(service);
	if (error >= 0)
		error = make_watchdog(service);
	if (error < 0)
		return error;
	error = listen_for_clients(service);
	if (error == 0)
		error = status_begin(service);
	for (size_t b = 0; error == 0 && b < service->plant->bus_count; b++)
		error = db_bus_start(service->plant->buses[b]->bus);
	return error;
}

/*
 * Every bus carries out its drives' on_exit side by side; clients are gone by then. What a reload was
 * about to bring goes last: buses have its drives already.
 */
static void tear_down(struct service *service)
{
	status_end(service);
	db_server_free(service->server);
	if (service->plant)
		plant_end(service->plant);
	reload_abandon(service);
	db_registers_free(service->registers);
	plant_free(service->plant, NULL);
	sd_event_source_unref(service->pulse);
	sd_event_source_unref(service->deadline);
	sd_event_source_unref(service->term);
	sd_event_unref(service->loop);
	if (service->lock >= 0)
		close(service->lock);
}

/* --- what it needs of the machine ------------------------------------------------------------------- */

/* A bus has two descriptors, its port and the lock of that; a reload may replace each of them before the old one ends. */
#define DESCRIPTORS_PER_BUS 8
/* The log, the loop, the server, and the files that a reload reads. */
#define DESCRIPTORS_BESIDE 24

void service_keep_descriptors(struct service *service)
{
	db_server_keep_descriptors(
		service->server,
		DESCRIPTORS_BESIDE + DESCRIPTORS_PER_BUS * (unsigned)service->plant->bus_count);
}

/* The soft limit is there for programs that use select(). */
static void raise_descriptors(void)
{
	struct rlimit limit;

	if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == limit.rlim_max)
		return;
	limit.rlim_cur = limit.rlim_max;
	/* Where it stays as it is, clients are refused earlier. */
	(void)setrlimit(RLIMIT_NOFILE, &limit);
}

/* Another process that runs the same configuration would be a second master on each of its buses. */
static int take_configuration(struct service *service)
{
	bool told = false;
	pid_t holder = 0;
	int error = 0;

	while (error == 0) {
		service->lock = alone_take(service->path, &holder);
		/* Where there are no such sockets, ports and the address to listen on keep others out. */
		if (service->lock != -EBUSY)
			return 0;
		if (!told)
			db_log(&service->log, monotonic_now(), DB_EVENT_FAILED, NULL,
			       "%s is run by another process already (%d): two masters on one bus would "
			       "answer each other's questions; systemctl stop drivebridge ends the "
			       "service, systemctl reload drivebridge has it read a changed file",
			       service->path, (int)holder);
		told = true;
		error = wait_after(-EBUSY);
	}
	return error;
}

/* A page that has to be fetched from a disk first makes a cycle late. */
static void lock_memory(const struct db_log_source *log)
{
	if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0 && errno != EPERM &&
	    errno != ENOMEM)
		db_log(log, monotonic_now(), DB_EVENT_MEMORY_UNLOCKED, NULL,
		       "cannot lock memory: %s; a cycle may be late when memory is short",
		       strerror(errno));
}

/* Before any thread starts: signals are the loop's. */
static void block_signals(void)
{
	sigset_t signals;

	sigemptyset(&signals);
	sigaddset(&signals, SIGTERM);
	sigaddset(&signals, SIGINT);
	sigaddset(&signals, SIGHUP);
	sigprocmask(SIG_BLOCK, &signals, NULL);
	signal(SIGPIPE, SIG_IGN);
}

/* Takes the configuration over. */
static int serve(struct service *service, struct db_config *config)
{
	int error = take_configuration(service);

	if (error != 0) {
		db_config_free(config);
		return error == -ECANCELED ? EXIT_SUCCESS : EXIT_FAILURE;
	}
	raise_descriptors();
	lock_memory(&service->log);
	if (config->drive_count == 0)
		db_log(&service->log, monotonic_now(), DB_EVENT_NO_DRIVES, NULL,
		       "no drive is configured yet: describe the buses and drives in %s, see "
		       "drivebridge.conf(5), check it with drivebridged --config %s --check and "
		       "reload",
		       service->path, service->path);
	error = set_up(service, config);
	if (error >= 0) {
		sd_notify(0, "READY=1");
		error = sd_event_loop(service->loop);
		sd_notify(0, "STOPPING=1");
	}
	if (error == -ECANCELED)
		error = 0;
	if (error < 0)
		db_log(&service->log, monotonic_now(), DB_EVENT_FAILED, NULL, "cannot go on: %s",
		       strerror(-error));
	tear_down(service);
	return error < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

int db_service_run(struct db_config *config, const char *path)
{
	struct service service = {
		.path = path,
		.lock = -1,
		.log.level = config->modbus.log,
	};
	int error;
	int status;

	block_signals();
	error = db_log_new(&service.log.log);
	if (error != 0) {
		fprintf(stderr, "cannot make the log: %s\n", strerror(-error));
		db_config_free(config);
		return EXIT_FAILURE;
	}
	status = serve(&service, config);
	db_log_free(service.log.log);
	return status;
}
