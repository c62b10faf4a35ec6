/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridged: puts the rooms together, runs the network thread and ends in order.
 */
#include "drivebridge/axis.h"
#include "drivebridge/bus.h"
#include "drivebridge/config.h"
#include "drivebridge/log.h"
#include "drivebridge/registers.h"
#include "drivebridge/server.h"
#include "drivebridge/version.h"

#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sysexits.h>
#include <systemd/sd-daemon.h>
#include <systemd/sd-event.h>
#include <time.h>

struct service;

/* What the callback of one bus's completions needs, and whether its thread is alive. */
struct seat {
	struct service *service;
	struct db_bus *bus;
	uint32_t beats; /* seen last */
	db_time beaten; /* when they changed */
};

struct service {
	struct db_config *config;
	struct db_log_source log; /* the network side's */
	const char *path;         /* the configuration's */
	sd_event *loop;
	sd_event_source *term;
	sd_event_source *deadline; /* of the most impatient client */
	db_time armed;
	sd_event_source *pulse; /* feeds systemd's watchdog; null: there is none */
	db_time watchdog;       /* systemd's patience */
	struct db_axis **axes;  /* one per drive, in the configuration's order */
	struct db_bus **buses;
	struct seat *seats; /* one per bus */
	struct db_registers *registers;
	struct db_server *server;
};

struct options {
	const char *config;
	bool check;
};

static void usage(FILE *out)
{
	fputs("usage: drivebridged --config FILE [--check]\n"
	      "  --config FILE  run in the foreground with this configuration\n"
	      "  --check        read the file, say what would run or what is wrong, and end\n"
	      "  --version      print the version\n"
	      "  --help         print this\n",
	      out);
}

/* -1 to go on, else the status to exit with. */
static int read_options(int argc, char **argv, struct options *options)
{
	static const struct option known[] = {
		{ "config", required_argument, NULL, 'c' },
		{ "check", no_argument, NULL, 'k' },
		{ "version", no_argument, NULL, 'v' },
		{ "help", no_argument, NULL, 'h' },
		{ NULL, 0, NULL, 0 },
	};
	int option;

	while ((option = getopt_long(argc, argv, "c:h", known, NULL)) != -1) {
		switch (option) {
		case 'c':
			options->config = optarg;
			break;
		case 'k':
			options->check = true;
			break;
		case 'v':
			puts("drivebridged " DB_VERSION);
			return EXIT_SUCCESS;
		case 'h':
			usage(stdout);
			return EXIT_SUCCESS;
		default:
			usage(stderr);
			return 2;
		}
	}
	if (!options->config || optind != argc) {
		usage(stderr);
		return 2;
	}
	return -1;
}

static db_time loop_now(const struct service *service)
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

/* --- what the registers ask for ------------------------------------------------------------------- */

static db_time now_of(void *context)
{
	return loop_now(context);
}

static uint64_t wall_us(void *context)
{
	struct timespec now;

	(void)context;
	clock_gettime(CLOCK_REALTIME, &now);
	return (uint64_t)now.tv_sec * 1000000 + (uint64_t)now.tv_nsec / 1000;
}

static bool submit(void *context, size_t bus, const struct db_request *request)
{
	const struct service *service = context;

	return db_bus_submit(service->buses[bus], request);
}

static void answer(void *context, struct db_write_token token, uint8_t exception)
{
	const struct service *service = context;

	db_server_answer(service->server, token, exception);
}

static void bus_stats(void *context, size_t bus, struct db_bus_stats *stats)
{
	const struct service *service = context;

	db_bus_read_stats(service->buses[bus], stats);
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
static struct db_log_source log_of(const struct service *service, size_t bus)
{
	return (struct db_log_source){
		.log = service->log.log,
		.bus = service->config->buses[bus].name,
		.level = service->config->buses[bus].log,
	};
}

static void tripped(void *context, size_t drive, const struct db_client *last)
{
	const struct service *service = context;
	const struct db_drive_config *config = &service->config->drives[drive];
	struct db_log_source log = log_of(service, config->bus);
	char text[DB_CLIENT_ADDRESS_MAX];
	struct db_log_about about = { .drive = config->name, .unit = config->unit };

	if (last->id != 0) {
		db_client_address(last->address, text);
		about.client = text;
	}
	db_log(&log, loop_now(service), DB_EVENT_WATCHDOG_TRIPPED, &about,
	       "silent too long, so the watchdog stops the drive, and nothing moves it before "
	       "clear_fault; check the PLC, its program and the network");
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

/* The new file is checked, so that a wrong one is known at once; it holds from the next start on. */
static int on_hangup(sd_event_source *source, const struct signalfd_siginfo *info, void *context)
{
	const struct service *service = context;
	struct db_config *config = NULL;

	(void)source;
	(void)info;
	if (db_config_load(service->path, stderr, &config) != 0) {
		db_log(&service->log, loop_now(service), DB_EVENT_CONFIG_WRONG, NULL,
		       "%s is wrong and not taken, nothing changes; drivebridged --check tells "
		       "what is wrong",
		       service->path);
		return 0;
	}
	db_config_free(config);
	db_log(&service->log, loop_now(service), DB_EVENT_CONFIG_RIGHT, NULL,
	       "%s is right; it takes effect with the next start of the service", service->path);
	return 0;
}

/* Whether every bus's thread has turned within half of systemd's patience. */
static bool all_alive(struct service *service, db_time now)
{
	bool alive = true;

	for (size_t b = 0; b < service->config->bus_count; b++) {
		struct seat *seat = &service->seats[b];
		uint32_t beats = db_bus_heartbeat(seat->bus);
		struct db_log_source log;

		if (beats != seat->beats || seat->beaten == 0) {
			seat->beats = beats;
			seat->beaten = now;
		}
		if (now - seat->beaten <= service->watchdog / 2)
			continue;
		log = log_of(service, b);
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
	if (all_alive(service, loop_now(service)))
		sd_notify(0, "WATCHDOG=1");
	sd_event_source_set_time_relative(source, (uint64_t)(service->watchdog / DB_NS_PER_US / 4));
	return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

static int on_deadline(sd_event_source *source, uint64_t us, void *context)
{
	struct service *service = context;

	(void)source;
	(void)us;
	service->armed = DB_TIME_NEVER;
	db_registers_expire(service->registers, loop_now(service));
	return 0;
}

static int on_completion(sd_event_source *source, int fd, uint32_t events, void *context)
{
	const struct seat *seat = context;
	struct service *service = seat->service;
	struct db_completion completion;

	(void)source;
	(void)fd;
	(void)events;
	while (db_bus_completion(seat->bus, &completion))
		db_registers_complete(service->registers, &completion, loop_now(service));
	return 0;
}

/* Writes come and go inside every turn of the loop; the timer follows once, before it sleeps. */
static int on_prepare(sd_event_source *source, void *context)
{
	(void)source;
	arm_deadline(context);
	return 0;
}

/* --- putting together ----------------------------------------------------------------------------- */

static int make_buses(struct service *service)
{
	const struct db_config *config = service->config;

	for (size_t b = 0; b < config->bus_count; b++) {
		struct db_axis **axes = calloc(config->drive_count + 1, sizeof *axes);
		size_t count = 0;
		int error;

		if (!axes)
			return -ENOMEM;
		for (size_t d = 0; d < config->drive_count; d++) {
			if (config->drives[d].bus == b)
				axes[count++] = service->axes[d];
		}
		error = db_bus_new(config, b, axes, service->log.log, &service->buses[b]);
		free(axes);
		if (error != 0)
			return error;
	}
	return 0;
}

static int make_axes(struct service *service)
{
	size_t drives = service->config->drive_count;

	/* One more of each than needed, so that none is ever an allocation of nothing. */
	service->axes = calloc(drives + 1, sizeof *service->axes);
	service->seats = calloc(service->config->bus_count + 1, sizeof *service->seats);
	service->buses = calloc(service->config->bus_count + 1, sizeof *service->buses);
	if (!service->axes || !service->seats || !service->buses)
		return -ENOMEM;
	for (size_t d = 0; d < drives; d++) {
		service->axes[d] = db_axis_new();
		if (!service->axes[d])
			return -ENOMEM;
	}
	return 0;
}

static int watch_completions(struct service *service)
{
	for (size_t b = 0; b < service->config->bus_count; b++) {
		int error;

		service->seats[b].service = service;
		service->seats[b].bus = service->buses[b];
		error = sd_event_add_io(service->loop, NULL,
		                        db_bus_completion_fd(service->buses[b]), EPOLLIN,
		                        on_completion, &service->seats[b]);
		if (error < 0)
			return error;
	}
	return 0;
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
	return error < 0 ? error : watch_completions(service);
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

static int listen_for_clients(struct service *service)
{
	const struct db_modbus_config *modbus = &service->config->modbus;
	int error = db_server_new(service->loop, modbus, &db_registers_backend, service->registers,
	                          &service->log, &service->server);

	if (error != 0) {
		db_log(&service->log, loop_now(service), DB_EVENT_FAILED, NULL,
		       "cannot listen on %s: %s; does another program use this port?",
		       modbus->listen, strerror(-error));
		return error;
	}
	db_log(&service->log, loop_now(service), DB_EVENT_LISTENING, NULL, "listening on %.*s:%u",
	       (int)(strrchr(modbus->listen, ':') - modbus->listen), modbus->listen,
	       (unsigned)db_server_port(service->server));
	return 0;
}

static int set_up(struct service *service)
{
	int error = make_axes(service);

	if (error == 0)
		error = make_buses(service);
	if (error == 0)
		error = db_registers_new(service->config, service->axes, &registers_ops, service,
		                         &service->registers);
	if (error == 0)
		error = make_loop(service);
	if (error >= 0)
		error = make_watchdog(service);
	if (error < 0)
		return error;
	error = listen_for_clients(service);
	for (size_t b = 0; error == 0 && b < service->config->bus_count; b++)
		error = db_bus_start(service->buses[b]);
	return error;
}

/* Every bus carries out its drives' on_exit side by side; clients are gone by then. */
static void tear_down(struct service *service)
{
	size_t drives = service->config->drive_count;
	size_t buses = service->config->bus_count;

	db_server_free(service->server);
	for (size_t b = 0; service->buses && b < buses; b++) {
		if (service->buses[b])
			db_bus_ask_end(service->buses[b]);
	}
	for (size_t b = 0; service->buses && b < buses; b++)
		db_bus_free(service->buses[b]);
	db_registers_free(service->registers);
	for (size_t d = 0; service->axes && d < drives; d++)
		db_axis_free(service->axes[d]);
	free(service->buses);
	free(service->seats);
	free(service->axes);
	sd_event_source_unref(service->pulse);
	sd_event_source_unref(service->deadline);
	sd_event_source_unref(service->term);
	sd_event_unref(service->loop);
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

static int serve(struct service *service)
{
	int error;

	lock_memory(&service->log);
	if (service->config->drive_count == 0)
		db_log(&service->log, monotonic_now(), DB_EVENT_NO_DRIVES, NULL,
		       "no drive is configured yet: describe the buses and drives in %s, see "
		       "drivebridge.conf(5), check it with drivebridged --check and restart",
		       service->path);
	error = set_up(service);
	if (error >= 0) {
		sd_notify(0, "READY=1");
		error = sd_event_loop(service->loop);
		sd_notify(0, "STOPPING=1");
	}
	if (error < 0)
		db_log(&service->log, monotonic_now(), DB_EVENT_FAILED, NULL, "cannot go on: %s",
		       strerror(-error));
	tear_down(service);
	return error < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

static int run(struct db_config *config, const char *path)
{
	struct service service = {
		.config = config,
		.path = path,
		.log.level = config->modbus.log,
	};
	int error = db_log_new(&service.log.log);
	int status;

	if (error != 0) {
		fprintf(stderr, "cannot make the log: %s\n", strerror(-error));
		return EXIT_FAILURE;
	}
	status = serve(&service);
	db_log_free(service.log.log);
	return status;
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

int main(int argc, char **argv)
{
	struct options options = { 0 };
	struct db_config *config = NULL;
	int status = read_options(argc, argv, &options);

	if (status >= 0)
		return status;
	/* For systemd a status of its own: starting again would not help. */
	if (db_config_load(options.config, stderr, &config) != 0)
		return options.check ? EXIT_FAILURE : EX_CONFIG;
	if (options.check) {
		db_config_describe(config, stdout);
		status = EXIT_SUCCESS;
	} else {
		block_signals();
		status = run(config, options.config);
	}
	db_config_free(config);
	return status;
}
