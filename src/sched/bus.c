/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bus thread: an engine, a port and a clock. Sleeps in ppoll() until bytes come, the network
 * thread posts a request, or the engine wants to be called.
 */
#include "drivebridge/bus.h"

#include "codec/can.h"
#include "drivebridge/seqlock.h"
#include "drivebridge/trace.h"
#include "sched/bus_log.h"
#include "sched/change.h"
#include "sched/engine.h"
#include "sched/priority.h"
#include "sched/scan.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#define REOPEN_INTERVAL (500 * DB_NS_PER_MS)

/* The thread turns at least so often, to show that it lives. */
#define BEAT_TIME (500 * DB_NS_PER_MS)

/* So often a port is read before the cycle and stops have their turn again. */
#define READS_AT_ONCE 16

/* A port that takes nothing for so long is as good as gone. */
#define STUCK_TIME (1 * DB_NS_PER_S)

/* So often the cycle is judged; it is too slow when more than one in so many overran. */
#define JUDGE_INTERVAL (10 * DB_NS_PER_S)
#define OVERRUN_SHARE 10

/* Whose the line is. */
enum line_use {
	LINE_IN_SERVICE,
	LINE_CLEARING, /* its drives do what their on_exit says, then it is set aside */
	LINE_ASIDE,    /* the scan's */
};

struct db_bus {
	const struct db_bus_config *config;
	struct db_log_source log;
	struct db_engine *engine;
	struct db_queue *queue;
	int wake_fd;       /* network to bus: requests, or the end */
	int completion_fd; /* bus to network */
	pthread_t thread;
	bool running;
	atomic_bool ending;
	atomic_bool ended;
	struct db_change *_Atomic change;  /* network to bus */
	struct db_change *_Atomic changed; /* and back */
	size_t drives;                     /* network's: so many when all changes are carried out */
	struct scan *scan;                 /* network's: the latest */
	uint32_t scan_number;              /* likewise */
	struct scan *_Atomic scan_asked;   /* network to bus */
	_Atomic uint32_t beats;

	/* Bus thread only. */
	const struct db_transport *transport;
	struct db_port *port;
	db_time wall_at; /* when the wall clock is looked at again */
	bool line_up;    /* the port is open and carries frames */
	enum line_use use;
	bool passes_all;      /* the port's filters are open for a scan */
	unsigned aside_speed; /* of the port, bit/s */
	db_time clear_by;
	db_time reopen_at;
	int open_error; /* the last one reported, so that it is reported once */
	int port_error; /* the open port failed with it */
	bool troubled;  /* since the network's thread was last told */
	uint8_t unsent[2 * DB_REQUEST_MAX];
	size_t unsent_length;
	db_time unsent_since;       /* when the port last took something */
	struct db_bus_stats judged; /* as they were at the last judgement of the cycle */
	db_time judged_wait;        /* for a processor, until then */
	db_time judge_at;           /* the next one; 0 before the first */
	struct priority priority;

	atomic_uint stats_sequence;
	db_seqlock_word stats_words[DB_SEQLOCK_WORDS(struct db_bus_stats)];
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

/* --- engine's callbacks ------------------------------------------------------------------------- */

/* The first error counts; the port is closed when the turn is over. */
static void fail_port(struct db_bus *bus, int error)
{
	if (bus->port_error == 0)
		bus->port_error = error;
}

static db_time send_bytes(void *context, const uint8_t *bytes, size_t length)
{
	struct db_bus *bus = context;
	db_time now = now_ns();
	ssize_t sent = 0;

	if (bus->unsent_length + length > sizeof bus->unsent) {
		fail_port(bus, ENOBUFS); /* cannot be: what is held sends nothing */
		return now;
	}
	if (bus->unsent_length == 0)
		sent = bus->transport->write(bus->port, bytes, length, now);
	if (sent < 0) {
		fail_port(bus, (int)-sent);
		return now;
	}
	if ((size_t)sent == length)
		return now;
	/* The kernel's buffer is full: the rest follows as soon as it drains. */
	memcpy(bus->unsent + bus->unsent_length, bytes + sent, length - (size_t)sent);
	bus->unsent_length += length - (size_t)sent;
	bus->unsent_since = now;
	db_engine_hold(bus->engine, true, now);
	return now;
}

/* Among the frames, and the network's thread is told where it is something to be looked into later. `drive`: null
 * when it is the bus's. */
static void trace_event(struct db_bus *bus, enum db_event event,
                        const struct db_drive_config *drive, db_time now)
{
	db_trace_write_event(db_engine_trace(bus->engine), now, event, drive ? drive->name : NULL);
	bus->troubled = bus->troubled || db_trace_is_trouble(event);
}

static void tell_drive(void *context, const struct db_drive_config *drive, enum db_event event,
                       const struct db_feedback *feedback)
{
	struct db_bus *bus = context;

	trace_event(bus, event, drive, now_ns());
	bus_log_event(&bus->log, bus->config->driver, drive, event, feedback, now_ns());
}

static void tell_missing(void *context, const struct db_drive_config *drive, uint64_t params)
{
	const struct db_bus *bus = context;

	bus_log_missing_params(&bus->log, drive, bus->config->driver, params, now_ns());
}

static void tell_heard(void *context, const struct db_drive_config *drive,
                       const struct db_heard *heard)
{
	const struct db_bus *bus = context;

	bus_log_heard(&bus->log, drive, bus->config->driver->medium, heard, now_ns());
}

static void tell_timing(void *context, const struct db_drive_config *drive, enum db_event event,
                        db_time time)
{
	struct db_bus *bus = context;

	trace_event(bus, event, drive, now_ns());
	bus_log_timing(&bus->log, bus->config, drive, event, time, now_ns());
}

static void tell_raw(void *context, const struct db_drive_config *drive, bool sent,
                     const uint8_t *bytes, size_t length)
{
	const struct db_bus *bus = context;

	bus_log_raw(&bus->log, drive, bus->config->driver->medium, sent, bytes, length, now_ns());
}

static const struct db_engine_ops engine_ops = {
	.send = send_bytes,
	.tell = tell_drive,
	.tell_missing = tell_missing,
	.tell_heard = tell_heard,
	.tell_timing = tell_timing,
	.tell_raw = tell_raw,
};

/* --- the port ------------------------------------------------------------------------------------- */

static const char *place_of(const struct db_bus_config *config)
{
	return config->transport->uses_interface ? config->interface : config->device;
}

static const struct db_port_health *health_of(const struct db_bus *bus)
{
	static const struct db_port_health fine = { .up = true };

	return bus->port && bus->transport->health ? bus->transport->health(bus->port) : &fine;
}

static void bring_up(struct db_bus *bus, db_time now)
{
	unsigned bitrate = health_of(bus)->bitrate;
	enum db_port_latency latency = health_of(bus)->latency;

	bus->line_up = true;
	if (bus->use == LINE_ASIDE) {
		scan_port(bus->engine, true, 0, now);
		return;
	}
	trace_event(bus, DB_EVENT_BUS_UP, NULL, now);
	db_log(&bus->log, now, DB_EVENT_BUS_UP, NULL, "%s is up", place_of(bus->config));
	if (bitrate != 0 && bitrate != bus->config->bitrate)
		db_log(&bus->log, now, DB_EVENT_BUS_BITRATE, NULL,
		       "%s runs at %u bit/s, but the configuration says bitrate = %u; set both to "
		       "that of the drives",
		       place_of(bus->config), bitrate, bus->config->bitrate);
	if (latency == DB_PORT_LATENCY_LOW)
		db_log(&bus->log, now, DB_EVENT_SERIAL_LATENCY, NULL,
		       "%s passes received bytes on at once", place_of(bus->config));
	else if (latency == DB_PORT_LATENCY_REFUSED)
		db_log(&bus->log, now, DB_EVENT_SERIAL_LATENCY, NULL,
		       "the driver of %s has no low latency setting; should answers be late by 16 ms "
		       "or so, see latency_timer in the udev example",
		       place_of(bus->config));
	bus->open_error = 0;
	db_engine_port(bus->engine, true, 0, now);
}

static void take_down(struct db_bus *bus, int error, db_time now)
{
	bus->line_up = false;
	bus->unsent_length = 0;
	if (bus->use == LINE_ASIDE)
		scan_port(bus->engine, false, error, now);
	else
		db_engine_port(bus->engine, false, error, now);
}

static void open_port(struct db_bus *bus, db_time now)
{
	struct db_can_filter filters[DB_FILTERS_MAX];
	const struct db_driver *driver = bus->config->driver;
	size_t count = driver->filters ? driver->filters(bus->config, filters) : 0;
	const struct db_bus_config *aside = scan_port_config(bus->engine);
	int error = bus->use == LINE_ASIDE ?
	                    bus->transport->open(aside, NULL, 0, now, &bus->port) :
	                    bus->transport->open(bus->config, filters, count, now, &bus->port);

	bus->passes_all = false;
	if (error == 0)
		return;
	bus->port = NULL;
	bus->reopen_at = now + REOPEN_INTERVAL;
	if (bus->use == LINE_ASIDE) {
		scan_port(bus->engine, false, -error, now);
		return;
	}
	db_engine_port(bus->engine, false, -error, now);
	if (-error != bus->open_error)
		db_log(&bus->log, now, DB_EVENT_BUS_LOST, NULL,
		       "cannot open %s: %s%s; trying again", place_of(bus->config),
		       strerror(-error), bus_log_port_advice(bus->config, -error));
	bus->open_error = -error;
}

static void lose_port(struct db_bus *bus, db_time now)
{
	int error = bus->port_error;

	trace_event(bus, DB_EVENT_BUS_LOST, NULL, now);
	if (error != bus->open_error && bus->use != LINE_ASIDE)
		db_log(&bus->log, now, DB_EVENT_BUS_LOST, NULL,
		       "lost %s: %s%s; waiting for it to come back", place_of(bus->config),
		       strerror(error), bus_log_port_advice(bus->config, error));
	bus->transport->close(bus->port);
	bus->port = NULL;
	bus->port_error = 0;
	bus->open_error = error;
	bus->reopen_at = now + REOPEN_INTERVAL;
	take_down(bus, error, now);
}

/* Adapters that are not ready yet, and controllers that went bus off and come back. */
static void follow_health(struct db_bus *bus, db_time now)
{
	const struct db_port_health *health = health_of(bus);

	if (!bus->port || health->up == bus->line_up)
		return;
	if (health->up) {
		bring_up(bus, now);
		return;
	}
	if (bus->use == LINE_ASIDE)
		return; /* at another speed than the drives' it is to be expected */
	trace_event(bus, DB_EVENT_BUS_OFF, NULL, now);
	db_log(&bus->log, now, DB_EVENT_BUS_OFF, NULL, "%s: %s", place_of(bus->config),
	       health->error == ENETRESET ?
	               "bus off, too many errors on the wire; check wiring, termination and bit rate" :
	               strerror(health->error));
	take_down(bus, health->error, now);
}

/* False when nothing was there. What is left when it has said enough is told again by poll(). */
static bool read_port(struct db_bus *bus)
{
	uint8_t bytes[512];
	ssize_t count = 0;

	for (unsigned reads = 0; reads < READS_AT_ONCE; reads++) {
		count = bus->transport->read(bus->port, bytes, sizeof bytes, now_ns());
		if (count > 0)
			db_engine_receive(bus->engine, bytes, (size_t)count, now_ns());
		if (count < 0)
			fail_port(bus, (int)-count);
		if (count < (ssize_t)sizeof bytes)
			return reads > 0 || count > 0;
	}
	return true;
}

static void write_rest(struct db_bus *bus, db_time now)
{
	ssize_t sent = bus->transport->write(bus->port, bus->unsent, bus->unsent_length, now);

	if (sent < 0) {
		fail_port(bus, (int)-sent);
		return;
	}
	bus->unsent_length -= (size_t)sent;
	memmove(bus->unsent, bus->unsent + sent, bus->unsent_length);
	if (bus->unsent_length == 0)
		db_engine_hold(bus->engine, false, now);
	else if (sent > 0)
		bus->unsent_since = now;
	else if (now - bus->unsent_since > STUCK_TIME)
		fail_port(bus, ENOBUFS);
}

/* --- a line that is set aside ----------------------------------------------------------------------- */

static void close_port(struct db_bus *bus, db_time now)
{
	bus->transport->close(bus->port);
	bus->port = NULL;
	bus->port_error = 0;
	bus->unsent_length = 0;
	bus->line_up = false;
	bus->reopen_at = now;
}

static unsigned speed_of(const struct db_bus_config *config)
{
	return config->driver->medium == DB_MEDIUM_CAN ? config->bitrate : config->baud;
}

/* The line goes from its drives to a scan that wants it alone, from one speed to the next, and back. */
static void follow_scan(struct db_bus *bus, db_time now)
{
	const struct db_bus_config *aside = scan_port_config(bus->engine);
	bool everything = scan_is_under_way(bus->engine);

	/* A scan tells of what else is there. */
	if (bus->port && bus->transport->pass && everything != bus->passes_all) {
		bus->transport->pass(bus->port, everything);
		bus->passes_all = everything;
	}
	if (bus->use == LINE_IN_SERVICE && aside) {
		db_log(&bus->log, now, DB_EVENT_BUS_ASIDE, NULL,
		       "%s is set aside for a scan: its drives are left as on-exit says, and are "
		       "offline until it has ended",
		       place_of(bus->config));
		db_engine_shut_down(bus->engine, now);
		bus->clear_by = now + DB_EXIT_TIME;
		bus->use = LINE_CLEARING;
	}
	if (bus->use == LINE_CLEARING &&
	    (db_engine_is_cleared(bus->engine) || now >= bus->clear_by)) {
		db_engine_set_aside(bus->engine, now);
		close_port(bus, now);
		bus->use = LINE_ASIDE;
		bus->aside_speed = aside ? speed_of(aside) : 0;
	}
	if (bus->use != LINE_ASIDE)
		return;
	if (!aside) {
		close_port(bus, now);
		bus->use = LINE_IN_SERVICE;
		db_log(&bus->log, now, DB_EVENT_BUS_ASIDE, NULL, "%s returns to service",
		       place_of(bus->config));
	} else if (speed_of(aside) != bus->aside_speed) {
		close_port(bus, now);
		bus->aside_speed = speed_of(aside);
	}
}

/* --- the thread ----------------------------------------------------------------------------------- */

/* How long this thread has been ready to run and was not let, since it began; 0 where the kernel does
 * not say. */
static db_time waited_for_processor(void)
{
	unsigned long long waited = 0;
	char text[96] = "";
	int fd = open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC);

	if (fd < 0)
		return 0;
	if (read(fd, text, sizeof text - 1) <= 0 || sscanf(text, "%*s %llu", &waited) != 1)
		waited = 0;
	close(fd);
	return (db_time)waited;
}

static void log_slow(const struct db_bus *bus, const struct db_bus_stats *stats, uint32_t overruns,
                     db_time waited, db_time now)
{
	unsigned seconds = (unsigned)(JUDGE_INTERVAL / DB_NS_PER_S);
	/* A quarter of a cycle of waiting for each one that overran. */
	bool computer = waited / DB_NS_PER_MS * 4 > (db_time)overruns * bus->config->cycle_ms;

	if (computer)
		db_log(&bus->log, now, DB_EVENT_BUS_SLOW, NULL,
		       "%u times in %u s the drives could not all be read within cycle-ms = %u: this "
		       "computer is busy, the bus waited %u ms for a processor; %s",
		       (unsigned)overruns, seconds, bus->config->cycle_ms,
		       (unsigned)(waited / DB_NS_PER_MS),
		       bus->priority.held ?
		               "look for what else has a real-time priority" :
		               "let it have a real-time priority, or look for what else runs");
	else
		db_log(&bus->log, now, DB_EVENT_BUS_SLOW, NULL,
		       "%u times in %u s the drives could not all be read within cycle-ms = %u "
		       "(the last round took %u ms); raise cycle-ms or baud, or look for drives "
		       "that answer slowly or not at all",
		       (unsigned)overruns, seconds, bus->config->cycle_ms,
		       (unsigned)(stats->cycle_us / 1000));
}

/* Cycles that overrun now and then are no news (the figures count them); many of them are. */
static void watch_cycle(struct db_bus *bus, const struct db_bus_stats *stats, db_time now)
{
	uint32_t cycles = stats->cycles - bus->judged.cycles;
	uint32_t overruns = stats->overruns - bus->judged.overruns;
	db_time waited;

	/* The first figures are made before the thread runs. */
	if (now < bus->judge_at || now == 0)
		return;
	waited = waited_for_processor();
	if (bus->judge_at != 0 && overruns > cycles / OVERRUN_SHARE)
		log_slow(bus, stats, overruns, waited - bus->judged_wait, now);
	bus->judged = *stats;
	bus->judged_wait = waited;
	bus->judge_at = now + JUDGE_INTERVAL;
}

static void publish_stats(struct db_bus *bus, db_time now)
{
	struct db_bus_stats stats;

	db_engine_stats(bus->engine, &stats);
	stats.port = *health_of(bus);
	db_seqlock_write(&bus->stats_sequence, bus->stats_words, &stats, sizeof stats);
	watch_cycle(bus, &stats, now);
}

static void wait_for_work(struct db_bus *bus, db_time until)
{
	struct pollfd fds[2] = {
		{ .fd = bus->wake_fd, .events = POLLIN },
		{ .fd = bus->port ? bus->transport->fd(bus->port) : -1, .events = POLLIN },
	};
	db_time now = now_ns();
	db_time wait = until > now ? until - now : 0;
	struct timespec timeout = { .tv_sec = (time_t)(wait / DB_NS_PER_S),
		                    .tv_nsec = (long)(wait % DB_NS_PER_S) };

	if (bus->unsent_length > 0 && bus->transport->write_retry == 0)
		fds[1].events |= POLLOUT;
	if (ppoll(fds, 2, &timeout, NULL) <= 0)
		return;
	if (fds[0].revents) {
		uint64_t count;

		(void)!read(bus->wake_fd, &count, sizeof count);
	}
	if (fds[1].revents & POLLOUT)
		write_rest(bus, now_ns());
	/* A hung-up port that has nothing more to say would wake us for ever. (A socket with an error
	 * pending tells it by read(), and is fine afterwards.) */
	if ((fds[1].revents & (POLLIN | POLLHUP | POLLERR | POLLNVAL)) && !read_port(bus) &&
	    (fds[1].revents & (POLLHUP | POLLNVAL)))
		fail_port(bus, ENODEV);
}

/* The transport's own part of a turn. Returns when it wants the next one. */
static db_time run_port(struct db_bus *bus, db_time now)
{
	db_time next = DB_TIME_NEVER;
	int error = 0;

	if (!bus->port && now >= bus->reopen_at)
		open_port(bus, now);
	if (!bus->port)
		return bus->reopen_at;
	if (bus->transport->run)
		next = bus->transport->run(bus->port, now, &error);
	if (error < 0)
		fail_port(bus, -error);
	if (bus->unsent_length > 0)
		write_rest(bus, now);
	if (bus->unsent_length > 0) {
		db_time retry = bus->transport->write_retry > 0 ? bus->transport->write_retry :
		                                                  STUCK_TIME;

		next = now + retry < next ? now + retry : next;
	}
	follow_health(bus, now);
	return next;
}

/* One turn. Returns when the next one is due at the latest. */
static db_time take_turn(struct db_bus *bus)
{
	db_time now = now_ns();
	db_time port_next;
	db_time next;

	/* A gateway boots in 1970 and learns the time later: the offset is taken again and again. */
	if (now >= bus->wall_at) {
		bus->wall_at = now + BEAT_TIME;
		db_engine_set_wall_offset(bus->engine,
		                          (clock_ns(CLOCK_REALTIME) - now_ns()) / DB_NS_PER_US);
	}
	follow_scan(bus, now);
	port_next = run_port(bus, now);
	next = db_engine_run(bus->engine, now);
	if (bus->port && bus->port_error != 0) {
		lose_port(bus, now);
		port_next = bus->reopen_at;
	}
	publish_stats(bus, now);
	return port_next < next ? port_next : next;
}

static void tell_network(struct db_bus *bus)
{
	uint64_t one = 1;

	(void)!write(bus->completion_fd, &one, sizeof one);
}

/* After a turn; true when the network is to be told of something. */
static bool give_back(struct db_bus *bus)
{
	bool finished = db_queue_take_finished(bus->queue);
	struct db_change *changed = change_fetch(bus->engine);
	bool troubled = bus->troubled;

	/* Last, so that who sees it finds every completion. */
	if (changed)
		atomic_store(&bus->changed, changed);
	bus->troubled = false;
	return finished || changed || troubled;
}

static db_time used_ns(void)
{
	return clock_ns(CLOCK_THREAD_CPUTIME_ID);
}

static void set_priority(struct db_bus *bus)
{
	unsigned wanted = bus->config->priority;
	int error = priority_begin(&bus->priority, wanted, now_ns(), used_ns());

	if (error != 0)
		db_log(&bus->log, now_ns(), DB_EVENT_PRIORITY_REFUSED, NULL,
		       "cannot run at real-time priority %u: %s; the bus runs without, and its cycles "
		       "may be late when the computer is busy. LimitRTPRIO of the service allows it, "
		       "and priority = 0 does not ask for it",
		       wanted, strerror(error));
}

static void judge_priority(struct db_bus *bus)
{
	db_time now = now_ns();
	enum priority_news news;

	if (!priority_is_due(&bus->priority, now))
		return;
	news = priority_judge(&bus->priority, now, used_ns());
	if (news == PRIORITY_LENT)
		db_log(&bus->log, now, DB_EVENT_PRIORITY_REFUSED, NULL,
		       "%s keeps a processor busy with what it sends; the bus goes on without its "
		       "real-time priority until that is over",
		       place_of(bus->config));
	else if (news == PRIORITY_TAKEN_BACK)
		db_log(&bus->log, now, DB_EVENT_PRIORITY_REFUSED, NULL,
		       "real-time priority %u again", bus->config->priority);
}

static void set_cpus(const struct db_bus *bus)
{
	cpu_set_t set;
	int error;

	if (bus->config->cpus == 0)
		return;
	CPU_ZERO(&set);
	for (size_t cpu = 0; cpu < 64; cpu++) {
		if (bus->config->cpus >> cpu & 1)
			CPU_SET(cpu, &set);
	}
	error = pthread_setaffinity_np(pthread_self(), sizeof set, &set);
	if (error != 0)
		db_log(&bus->log, now_ns(), DB_EVENT_CPUS_REFUSED, NULL,
		       "cannot keep to its processors: %s; check cpus, and CPUAffinity and "
		       "AllowedCPUs of the service",
		       strerror(error));
}

/* A scan that was asked for. When the bus ends it does not begin. */
static void take_scan(struct db_bus *bus, bool ending, db_time now)
{
	struct scan *scan = atomic_exchange(&bus->scan_asked, NULL);

	/* One that follows the last one before the line is back in service opens the port for itself. */
	if (scan && bus->use == LINE_ASIDE)
		close_port(bus, now);
	if (scan)
		scan_begin(bus->engine, scan, now);
	if (ending)
		scan_end(bus->engine, DB_SCAN_CANCELLED);
}

static void *run_thread(void *context)
{
	struct db_bus *bus = context;
	db_time exit_by = DB_TIME_NEVER;
	char name[16]; /* what top -H and ps show; the kernel keeps 15 characters */

	snprintf(name, sizeof name, "%s", bus->config->name);
	pthread_setname_np(pthread_self(), name);
	set_cpus(bus);
	set_priority(bus);
	/* The default slack of 50 us is a good part of an exchange at high baud rates. */
	prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
	while (now_ns() < exit_by) {
		struct db_change *change = atomic_exchange(&bus->change, NULL);
		db_time next;

		/* Requests that were handed over before a change are all there by now. */
		if (change)
			change_begin(bus->engine, change, now_ns());
		take_scan(bus, exit_by != DB_TIME_NEVER, now_ns());
		next = take_turn(bus);
		atomic_fetch_add_explicit(&bus->beats, 1, memory_order_relaxed);
		judge_priority(bus);
		if (give_back(bus))
			tell_network(bus);
		if (exit_by == DB_TIME_NEVER && atomic_load(&bus->ending)) {
			exit_by = now_ns() + DB_EXIT_TIME;
			/* A line that is being cleared or set aside was left so already. */
			if (bus->use == LINE_IN_SERVICE)
				db_engine_shut_down(bus->engine, now_ns());
			continue;
		}
		if (exit_by != DB_TIME_NEVER && db_engine_is_quiet(bus->engine))
			break;
		if (next > now_ns() + BEAT_TIME)
			next = now_ns() + BEAT_TIME;
		wait_for_work(bus, next < exit_by ? next : exit_by);
	}
	db_engine_tell_unconfirmed(bus->engine);
	take_scan(bus, true, now_ns());
	bus->transport->close(bus->port);
	bus->port = NULL;
	atomic_store(&bus->ended, true);
	tell_network(bus);
	return NULL;
}

/* --- making and using ------------------------------------------------------------------------------- */

int db_bus_new(const struct db_bus_config *config, const struct db_bus_drive *drives,
               size_t drive_count, struct db_log *log, struct db_bus **bus)
{
	struct db_bus *made = calloc(1, sizeof *made);
	int error;

	if (!made)
		return -ENOMEM;
	made->config = config;
	made->log = (struct db_log_source){
		.log = log,
		.bus = config->name,
		.level = config->log,
	};
	made->transport = config->transport;
	made->drives = drive_count;
	made->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
	made->completion_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
	error = made->wake_fd < 0 || made->completion_fd < 0 ? -errno : 0;
	if (error == 0)
		error = db_queue_new(config->queue, drive_count, &made->queue);
	if (error == 0)
		error = db_engine_new(config, drives, drive_count, made->queue, &engine_ops, made,
		                      &made->engine);
	if (error != 0) {
		db_bus_free(made);
		return error;
	}
	publish_stats(made, 0);
	*bus = made;
	return 0;
}

int db_bus_start(struct db_bus *bus)
{
	int error = pthread_create(&bus->thread, NULL, run_thread, bus);

	bus->running = error == 0;
	return -error;
}

static void wake_bus(struct db_bus *bus)
{
	uint64_t one = 1;

	(void)!write(bus->wake_fd, &one, sizeof one);
}

void db_bus_ask_end(struct db_bus *bus)
{
	atomic_store(&bus->ending, true);
	wake_bus(bus);
}

void db_bus_stop(struct db_bus *bus)
{
	if (!bus->running)
		return;
	db_bus_ask_end(bus);
	pthread_join(bus->thread, NULL);
	bus->running = false;
}

bool db_bus_has_ended(const struct db_bus *bus)
{
	return atomic_load(&bus->ended);
}

void db_bus_free(struct db_bus *bus)
{
	if (!bus)
		return;
	db_bus_stop(bus);
	change_free(atomic_load(&bus->change));
	change_free(atomic_load(&bus->changed));
	scan_free(bus->scan);
	db_engine_free(bus->engine);
	db_queue_free(bus->queue);
	if (bus->wake_fd >= 0)
		close(bus->wake_fd);
	if (bus->completion_fd >= 0)
		close(bus->completion_fd);
	free(bus);
}

int db_bus_change_new(struct db_bus *bus, const uint16_t *leaving, size_t leaving_count,
                      const struct db_bus_drive *coming, size_t coming_count,
                      struct db_change **change)
{
	size_t drives = bus->drives - leaving_count + coming_count;

	if (db_queue_grow(bus->queue, drives) != 0)
		return -ENOMEM;
	*change = change_new(bus->config, bus->drives, leaving, leaving_count, coming,
	                     coming_count);
	return *change ? 0 : -ENOMEM;
}

void db_bus_change(struct db_bus *bus, struct db_change *change)
{
	bus->drives = bus->drives - change->leaving_count + change->coming_count;
	atomic_store(&bus->change, change);
	wake_bus(bus);
}

struct db_change *db_bus_take_changed(struct db_bus *bus)
{
	return atomic_exchange(&bus->changed, NULL);
}

void db_bus_change_free(struct db_change *change)
{
	change_free(change);
}

/* Whether drives of this bus can have these addresses and speeds. */
static bool is_possible(const struct db_bus_config *config, const struct db_scan_plan *plan)
{
	const struct db_driver *driver = config->driver;
	unsigned min = config->line == DB_LINE_RS232 ? 0 : driver->address_min;
	unsigned max = config->line == DB_LINE_RS232 ? 0 : driver->address_max;

	return plan->first >= min && plan->first <= plan->last && plan->last <= max &&
	       plan->speed_count <= DB_SCAN_SPEEDS_MAX && (!plan->aside || plan->speed_count > 0);
}

int db_bus_scan(struct db_bus *bus, const struct db_scan_plan *plan, uint32_t *number)
{
	struct scan *scan;

	if (!is_possible(bus->config, plan))
		return -EINVAL;
	if (bus->scan && !scan_has_ended(bus->scan))
		return -EBUSY;
	scan = scan_new(bus->config, plan, ++bus->scan_number);
	if (!scan)
		return -ENOMEM;
	scan_free(bus->scan);
	bus->scan = scan;
	*number = bus->scan_number;
	atomic_store(&bus->scan_asked, scan);
	wake_bus(bus);
	return 0;
}

bool db_bus_scan_read(const struct db_bus *bus, uint32_t number, struct db_scan_progress *progress)
{
	if (!bus->scan || scan_number(bus->scan) != number)
		return false;
	scan_read(bus->scan, progress);
	return true;
}

const struct db_scan_find *db_bus_scan_find(const struct db_bus *bus, size_t index)
{
	return scan_find(bus->scan, index);
}

const struct db_scan_foreign *db_bus_scan_foreign(const struct db_bus *bus, size_t index)
{
	return scan_foreign(bus->scan, index);
}

void db_bus_scan_cancel(struct db_bus *bus, uint32_t number)
{
	if (!bus->scan || scan_number(bus->scan) != number)
		return;
	scan_cancel(bus->scan);
	wake_bus(bus);
}

bool db_bus_submit(struct db_bus *bus, const struct db_request *request)
{
	if (!db_queue_post(bus->queue, request))
		return false;
	wake_bus(bus);
	return true;
}

void db_bus_gather(struct db_bus *bus, bool gathers)
{
	if (db_queue_gather(bus->queue, gathers))
		wake_bus(bus);
}

int db_bus_completion_fd(const struct db_bus *bus)
{
	return bus->completion_fd;
}

bool db_bus_completion(struct db_bus *bus, struct db_completion *completion)
{
	uint64_t count;

	if (db_queue_collect(bus->queue, completion))
		return true;
	/* Only now, and then look once more: a request finished in between rings again or is found. */
	(void)!read(bus->completion_fd, &count, sizeof count);
	return db_queue_collect(bus->queue, completion);
}

uint32_t db_bus_heartbeat(const struct db_bus *bus)
{
	return atomic_load_explicit(&bus->beats, memory_order_relaxed);
}

const struct db_trace *db_bus_trace(const struct db_bus *bus)
{
	return db_engine_trace(bus->engine);
}

void db_bus_read_stats(const struct db_bus *bus, struct db_bus_stats *stats)
{
	db_seqlock_read(&bus->stats_sequence, bus->stats_words, stats, sizeof *stats);
}
