/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bus thread: an engine, a port and a clock. Sleeps in ppoll() until bytes come, the network
 * thread posts a letter, or the engine wants to be called.
 */
#include "drivebridge/bus.h"
#include "drivebridge/log.h"

#include "axis/seqlock.h"
#include "sched/engine.h"

#include "transport/serial.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#define REOPEN_INTERVAL (500 * DB_NS_PER_MS)

/* Longest time the end of the service waits for drives to confirm their on_exit. */
#define EXIT_TIME (1500 * DB_NS_PER_MS)

struct db_bus {
	const struct db_bus_config *config;
	struct db_engine *engine;
	struct db_mailbox *mailbox;
	int wake_fd;       /* network to bus: letters, or the end */
	int completion_fd; /* bus to network */
	pthread_t thread;
	bool running;
	atomic_bool ending;

	/* Bus thread only. */
	struct db_serial *port;
	db_time reopen_at;
	int open_error; /* the last one reported, so that it is reported once */
	uint8_t unsent[DB_REQUEST_MAX];
	size_t unsent_length;
	bool port_failed;

	atomic_uint stats_sequence;
	_Atomic uint32_t stats_words[DB_SEQLOCK_WORDS(struct db_bus_stats)];
};

static db_time clock_ns(clockid_t clock)
{
	struct timespec now;

	clock_gettime(clock, &now);
	return (db_time)now.tv_sec * DB_NS_PER_S + now.tv_nsec;
}

static db_time now_ns(void)
{
	return clock_ns(CLOCK_MONOTONIC);
}

static int64_t wall_offset_us(void)
{
	return (clock_ns(CLOCK_REALTIME) - now_ns()) / DB_NS_PER_US;
}

/* --- engine's callbacks ------------------------------------------------------------------------- */

static void send_bytes(void *context, const uint8_t *bytes, size_t length)
{
	struct db_bus *bus = context;
	ssize_t sent = db_serial_write(bus->port, bytes, length);

	if (sent < 0) {
		bus->port_failed = true;
		bus->open_error = (int)-sent;
		return;
	}
	/* The kernel's buffer is full: the rest follows as soon as it drains. */
	bus->unsent_length = length - (size_t)sent;
	memcpy(bus->unsent, bytes + sent, bus->unsent_length);
}

static void log_presence(void *context, const struct db_drive_config *drive, bool online)
{
	const struct db_bus *bus = context;

	if (online)
		db_log(DB_LOG_NOTICE, "bus %s: drive %s (address %u) answers", bus->config->name,
		       drive->name, drive->address);
	else
		db_log(DB_LOG_WARNING,
		       "bus %s: drive %s (address %u) does not answer any more; check its power, "
		       "wiring and address",
		       bus->config->name, drive->name, drive->address);
}

static const struct db_engine_ops engine_ops = {
	.send = send_bytes,
	.presence = log_presence,
};

/* --- the port ------------------------------------------------------------------------------------- */

static void open_port(struct db_bus *bus, db_time now)
{
	int error = db_serial_open(bus->config, &bus->port);

	if (error != 0) {
		bus->port = NULL;
		bus->reopen_at = now + REOPEN_INTERVAL;
		db_engine_port(bus->engine, false, -error, now);
		if (-error != bus->open_error)
			db_log(DB_LOG_ERROR, "bus %s: cannot open %s: %s; trying again",
			       bus->config->name, bus->config->device, strerror(-error));
		bus->open_error = -error;
		return;
	}
	db_log(DB_LOG_NOTICE, "bus %s: %s is open", bus->config->name, bus->config->device);
	bus->open_error = 0;
	bus->port_failed = false;
	bus->unsent_length = 0;
	db_engine_set_wall_offset(bus->engine, wall_offset_us());
	db_engine_port(bus->engine, true, 0, now);
}

static void lose_port(struct db_bus *bus, int error, db_time now)
{
	db_log(DB_LOG_ERROR, "bus %s: lost %s: %s; waiting for it to come back", bus->config->name,
	       bus->config->device, strerror(error));
	db_serial_close(bus->port);
	bus->port = NULL;
	bus->port_failed = false;
	bus->unsent_length = 0;
	bus->open_error = error;
	bus->reopen_at = now + REOPEN_INTERVAL;
	db_engine_port(bus->engine, false, error, now);
}

static void read_port(struct db_bus *bus)
{
	uint8_t bytes[512];
	ssize_t count;

	while ((count = db_serial_read(bus->port, bytes, sizeof bytes)) > 0) {
		db_engine_receive(bus->engine, bytes, (size_t)count, now_ns());
		if ((size_t)count < sizeof bytes)
			return;
	}
	if (count < 0) {
		bus->port_failed = true;
		bus->open_error = (int)-count;
	}
}

static void write_rest(struct db_bus *bus)
{
	ssize_t sent = db_serial_write(bus->port, bus->unsent, bus->unsent_length);

	if (sent < 0) {
		bus->port_failed = true;
		bus->open_error = (int)-sent;
		return;
	}
	bus->unsent_length -= (size_t)sent;
	memmove(bus->unsent, bus->unsent + sent, bus->unsent_length);
}

/* --- the thread ----------------------------------------------------------------------------------- */

static void publish_stats(struct db_bus *bus)
{
	struct db_bus_stats stats;

	db_engine_stats(bus->engine, &stats);
	db_seqlock_write(&bus->stats_sequence, bus->stats_words, &stats, sizeof stats);
}

static void wait_for_work(struct db_bus *bus, db_time until)
{
	struct pollfd fds[2] = {
		{ .fd = bus->wake_fd, .events = POLLIN },
		{ .fd = bus->port ? db_serial_fd(bus->port) : -1, .events = POLLIN },
	};
	db_time wait = until - now_ns();
	struct timespec timeout;

	if (bus->unsent_length > 0)
		fds[1].events |= POLLOUT;
	if (wait < 0)
		wait = 0;
	timeout.tv_sec = (time_t)(wait / DB_NS_PER_S);
	timeout.tv_nsec = (long)(wait % DB_NS_PER_S);
	if (ppoll(fds, 2, &timeout, NULL) <= 0)
		return;
	if (fds[0].revents) {
		uint64_t count;

		(void)!read(bus->wake_fd, &count, sizeof count);
	}
	if (fds[1].revents & POLLOUT)
		write_rest(bus);
	if (fds[1].revents & (POLLIN | POLLHUP | POLLERR | POLLNVAL))
		read_port(bus);
	/* A hung-up port that has nothing more to say would wake us for ever. */
	if (!(fds[1].revents & POLLIN) && (fds[1].revents & (POLLHUP | POLLERR | POLLNVAL)) &&
	    !bus->port_failed) {
		bus->port_failed = true;
		bus->open_error = ENODEV;
	}
}

/* One turn. Returns when the next one is due at the latest. */
static db_time turn(struct db_bus *bus)
{
	db_time now = now_ns();
	db_time next;

	if (!bus->port && now >= bus->reopen_at)
		open_port(bus, now);
	next = db_engine_run(bus->engine, now);
	if (bus->port_failed)
		lose_port(bus, bus->open_error, now);
	if (!bus->port && bus->reopen_at < next)
		next = bus->reopen_at;
	publish_stats(bus);
	return next;
}

static void tell_network(struct db_bus *bus)
{
	uint64_t one = 1;

	(void)!write(bus->completion_fd, &one, sizeof one);
}

static void set_priority(const struct db_bus *bus)
{
	struct sched_param param = { .sched_priority = (int)bus->config->priority };
	int error;

	if (bus->config->priority == 0)
		return;
	error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param);
	if (error != 0)
		db_log(DB_LOG_WARNING,
		       "bus %s: cannot run at real-time priority %u: %s; check LimitRTPRIO",
		       bus->config->name, bus->config->priority, strerror(error));
}

static void *run(void *context)
{
	struct db_bus *bus = context;
	db_time exit_by = DB_TIME_NEVER;

	set_priority(bus);
	/* The default slack of 50 us is a good part of an exchange at high baud rates. */
	prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
	while (now_ns() < exit_by) {
		db_time next = turn(bus);

		if (db_mailbox_take_finished(bus->mailbox))
			tell_network(bus);
		if (exit_by == DB_TIME_NEVER && atomic_load(&bus->ending)) {
			exit_by = now_ns() + EXIT_TIME;
			db_engine_shut_down(bus->engine, now_ns());
			continue;
		}
		if (exit_by != DB_TIME_NEVER && db_engine_is_quiet(bus->engine))
			break;
		wait_for_work(bus, next < exit_by ? next : exit_by);
	}
	db_serial_close(bus->port);
	bus->port = NULL;
	return NULL;
}

/* --- making and using ------------------------------------------------------------------------------- */

/* The bus's drives, in the configuration's order; null-terminated. */
static const struct db_drive_config **drives_of(const struct db_config *config, size_t bus_index,
                                                size_t *count)
{
	const struct db_drive_config **drives;

	drives = calloc(config->drive_count + 1, sizeof *drives);
	if (!drives)
		return NULL;
	*count = 0;
	for (size_t i = 0; i < config->drive_count; i++) {
		if (config->drives[i].bus == bus_index)
			drives[(*count)++] = &config->drives[i];
	}
	return drives;
}

int db_bus_new(const struct db_config *config, size_t bus_index, struct db_axis *const *axes,
               struct db_bus **bus)
{
	const struct db_drive_config **drives = NULL;
	struct db_bus *made = calloc(1, sizeof *made);
	size_t count = 0;
	int error = -ENOMEM;

	if (!made)
		return -ENOMEM;
	made->config = &config->buses[bus_index];
	made->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
	made->completion_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
	if (made->wake_fd < 0 || made->completion_fd < 0) {
		error = -errno;
		goto fail;
	}
	drives = drives_of(config, bus_index, &count);
	if (!drives)
		goto fail;
	error = db_mailbox_new(made->config->queue, 4 * count, &made->mailbox);
	if (error != 0)
		goto fail;
	error = db_engine_new(made->config, drives, axes, count, made->mailbox, &engine_ops, made,
	                      &made->engine);
	if (error != 0)
		goto fail;
	free(drives);
	publish_stats(made);
	*bus = made;
	return 0;
fail:
	free(drives);
	db_bus_free(made);
	return error;
}

int db_bus_start(struct db_bus *bus)
{
	int error = pthread_create(&bus->thread, NULL, run, bus);

	bus->running = error == 0;
	return -error;
}

static void wake(struct db_bus *bus)
{
	uint64_t one = 1;

	(void)!write(bus->wake_fd, &one, sizeof one);
}

void db_bus_ask_end(struct db_bus *bus)
{
	atomic_store(&bus->ending, true);
	wake(bus);
}

void db_bus_stop(struct db_bus *bus)
{
	if (!bus->running)
		return;
	db_bus_ask_end(bus);
	pthread_join(bus->thread, NULL);
	bus->running = false;
}

void db_bus_free(struct db_bus *bus)
{
	if (!bus)
		return;
	db_bus_stop(bus);
	db_engine_free(bus->engine);
	db_mailbox_free(bus->mailbox);
	if (bus->wake_fd >= 0)
		close(bus->wake_fd);
	if (bus->completion_fd >= 0)
		close(bus->completion_fd);
	free(bus);
}

bool db_bus_submit(struct db_bus *bus, const struct db_request *request)
{
	if (!db_mailbox_post(bus->mailbox, request))
		return false;
	wake(bus);
	return true;
}

int db_bus_completion_fd(const struct db_bus *bus)
{
	return bus->completion_fd;
}

bool db_bus_completion(struct db_bus *bus, struct db_completion *completion)
{
	uint64_t count;

	if (db_mailbox_collect(bus->mailbox, completion))
		return true;
	/* Only now, and then look once more: a letter finished in between rings again or is found. */
	(void)!read(bus->completion_fd, &count, sizeof count);
	return db_mailbox_collect(bus->mailbox, completion);
}

void db_bus_read_stats(const struct db_bus *bus, struct db_bus_stats *stats)
{
	db_seqlock_read(&bus->stats_sequence, bus->stats_words, stats, sizeof *stats);
}
