/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bus thread: an engine, a line and a clock. Sleeps in ppoll() until bytes arrive, the network
 * thread posts a request, or the engine wants to be called.
 */
#include "drivebridge/bus.h"

#include "drivebridge/clock.h"
#include "drivebridge/seqlock.h"
#include "sched/bus_line.h"
#include "sched/bus_log.h"
#include "sched/bus_watch.h"
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

/* The thread runs at least this often, to show that it lives. */
#define BEAT_TIME (500 * DB_NS_PER_MS)

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
	size_t drives;        /* network's: the number of drives when all changes are carried out */
	struct scan *scan;    /* network's: the latest */
	uint32_t scan_number; /* network's: the number of that scan */
	struct scan *_Atomic scan_asked; /* network to bus */
	_Atomic uint32_t beats;

	/* Bus thread only. */
	struct bus_line line;
	db_time wall_at; /* when the wall clock is read again */
	struct bus_watch watch;
	int schedstat; /* the thread's file in /proc that shows how long it waited; -1 */
	struct priority priority;

	atomic_uint stats_sequence;
	db_seqlock_word stats_words[DB_SEQLOCK_WORDS(struct db_bus_stats)];
};

/* --- engine's callbacks ----------------------------------------------------------------------- */

static db_time send_bytes(void *context, const uint8_t *bytes, size_t length)
{
	return bus_line_send(&((struct db_bus *)context)->line, bytes, length);
}

static void log_event(void *context, const struct db_drive_config *drive, enum db_event event,
                      const struct db_feedback *feedback, const struct db_outage *outage)
{
	struct db_bus *bus = context;

	bus_line_trace(&bus->line, event, drive, db_clock_now());
	bus_log_event(&bus->log, bus->config->driver, drive, event, feedback, outage,
	              db_clock_now());
}

static void log_missing_params(void *context, const struct db_drive_config *drive,
                               const uint64_t *params)
{
	const struct db_bus *bus = context;

	bus_log_missing_params(&bus->log, drive, bus->config->driver, params, db_clock_now());
}

static void log_unusable(void *context, const struct db_drive_config *drive,
                         const struct db_unusable *unusable)
{
	struct db_bus *bus = context;

	bus_line_trace(&bus->line, DB_EVENT_DRIVE_HEARD, drive, db_clock_now());
	bus_log_unusable(&bus->log, drive, bus->config->driver->medium, unusable, db_clock_now());
}

/* How long this thread was ready to run but not running, since it began; 0 where the kernel does
 * not report it. */
static db_time read_wait(const struct db_bus *bus)
{
	unsigned long long waited = 0;
	char text[96] = "";

	if (bus->schedstat < 0 || pread(bus->schedstat, text, sizeof(text) - 1, 0) <= 0 ||
	    sscanf(text, "%*s %llu", &waited) != 1)
		waited = 0;
	return (db_time)waited;
}

static void log_timing(void *context, const struct db_drive_config *drive,
                       const struct db_engine_timing *told)
{
	struct db_bus *bus = context;
	struct bus_timing timing = { .told = *told };
	struct db_bus_stats stats;

	db_engine_stats(bus->engine, &stats);
	timing.missed = bus_watch_missed(&bus->watch, &stats, read_wait(bus));
	timing.seconds = (unsigned)(2 * BUS_WATCH_INTERVAL / DB_NS_PER_S);
	bus_line_trace(&bus->line, told->event, drive, db_clock_now());
	bus_log_timing(&bus->log, bus->config, drive, &timing, db_clock_now());
}

static void log_raw_frame(void *context, const struct db_drive_config *drive, bool sent,
                          const uint8_t *bytes, size_t length)
{
	const struct db_bus *bus = context;

	bus_log_raw_frame(&bus->log, drive, bus->config->driver->medium, sent, bytes, length,
	                  db_clock_now());
}

static const struct db_engine_ops engine_ops = {
	.send = send_bytes,
	.on_event = log_event,
	.on_missing_params = log_missing_params,
	.on_unusable = log_unusable,
	.on_timing = log_timing,
	.on_raw_frame = log_raw_frame,
};

/* --- the thread ------------------------------------------------------------------------------- */

static void watch_cycle(struct db_bus *bus, const struct db_bus_stats *stats, db_time now)
{
	struct bus_slowness slow;

	if (!bus_watch_is_due(&bus->watch, stats, now) ||
	    !bus_watch_judge(&bus->watch, stats, read_wait(bus), now, &slow))
		return;
	slow.has_priority = bus->priority.held;
	bus_log_slow(&bus->log, bus->config, &slow, now);
}

static void publish_stats(struct db_bus *bus, db_time now)
{
	struct db_bus_stats stats;

	db_engine_stats(bus->engine, &stats);
	stats.port = *bus_line_health(&bus->line);
	memcpy(stats.holder, bus->line.holder, sizeof(stats.holder));
	db_seqlock_write(&bus->stats_sequence, bus->stats_words, &stats, sizeof(stats));
	watch_cycle(bus, &stats, now);
}

static void wait_for_work(struct db_bus *bus, db_time until)
{
	struct pollfd fds[2] = { { .fd = bus->wake_fd, .events = POLLIN } };
	db_time look_at = bus_line_poll(&bus->line, &fds[1]);
	db_time now = db_clock_now();
	struct timespec timeout;
	db_time wait;
	int ready;

	until = look_at < until ? look_at : until;
	if (until > now + BEAT_TIME)
		until = now + BEAT_TIME;
	wait = until > now ? until - now : 0;
	timeout = (struct timespec){ .tv_sec = (time_t)(wait / DB_NS_PER_S),
		                     .tv_nsec = (long)(wait % DB_NS_PER_S) };
	ready = ppoll(fds, 2, &timeout, NULL);
	if (ready < 0)
		return;
	if (fds[0].revents) {
		uint64_t count;

		(void)!read(bus->wake_fd, &count, sizeof(count));
	}
	bus_line_polled(&bus->line, fds[1].revents, ready == 0);
}

/* One turn. Returns when the next one is due at the latest. */
static db_time run_turn(struct db_bus *bus)
{
	db_time now = db_clock_now();
	db_time line_next;
	db_time next;

	/* A gateway boots in 1970 and learns the time later: the offset is determined again and
	 * again. */
	if (now >= bus->wall_at) {
		bus->wall_at = now + BEAT_TIME;
		bus->engine->wall_offset_us = db_clock_wall_offset(db_clock_read) / DB_NS_PER_US;
	}
	line_next = bus_line_run(&bus->line, now);
	next = db_engine_run(bus->engine, now);
	if (bus_line_check(&bus->line, now))
		line_next = bus->line.reopen_at;
	publish_stats(bus, now);
	return line_next < next ? line_next : next;
}

static void wake(int event_fd)
{
	uint64_t one = 1;

	(void)!write(event_fd, &one, sizeof(one));
}

/* The thread's name, its processors and its priority, as the system allows them. */
static void set_up_thread(struct db_bus *bus)
{
	const struct db_bus_config *config = bus->config;
	char name[16]; /* what top -H and ps show; the kernel keeps 15 characters */
	cpu_set_t set;
	int error = 0;

	snprintf(name, sizeof(name), "%s", config->name);
	pthread_setname_np(pthread_self(), name);
	/* Opened now: opening a file later could delay the cycle. */
	bus->schedstat = open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC);
	CPU_ZERO(&set);
	for (size_t cpu = 0; cpu < 64; cpu++) {
		if (config->cpus >> cpu & 1)
			CPU_SET(cpu, &set);
	}
	if (config->cpus != 0)
		error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
	if (error != 0)
		db_log(&bus->log, db_clock_now(), DB_EVENT_CPUS_REFUSED, NULL,
		       "cannot run on the processors of cpus: %s; check cpus, and CPUAffinity and "
		       "AllowedCPUs of the service",
		       strerror(error));
	error = priority_begin(&bus->priority, config->priority, db_clock_now(),
	                       db_clock_read(CLOCK_THREAD_CPUTIME_ID));
	if (error != 0)
		db_log(&bus->log, db_clock_now(), DB_EVENT_PRIORITY_REFUSED, NULL,
		       "cannot run at real-time priority %u: %s; the bus runs without it, and its "
		       "cycles may be late when the computer is busy; allow it with LimitRTPRIO of "
		       "the service, or set priority = 0",
		       config->priority, strerror(error));
	/* The default slack of 50 us is a good part of an exchange at high baud rates. */
	prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
}

static void judge_priority(struct db_bus *bus)
{
	db_time now = db_clock_now();
	enum priority_change change;

	if (!priority_is_due(&bus->priority, now))
		return;
	change = priority_judge(&bus->priority, now, db_clock_read(CLOCK_THREAD_CPUTIME_ID));
	if (change == PRIORITY_GIVEN_UP)
		db_log(&bus->log, now, DB_EVENT_PRIORITY_REFUSED, NULL,
		       "reading what %s receives keeps a processor busy; the bus runs without its "
		       "real-time priority until that ends",
		       bus_line_place(&bus->line));
	else if (change == PRIORITY_LOST)
		db_log(&bus->log, now, DB_EVENT_PRIORITY_REFUSED, NULL,
		       "ran for a second without a pause and lost its real-time priority; it has "
		       "it again when that ends");
	else if (change == PRIORITY_RESTORED)
		db_log(&bus->log, now, DB_EVENT_PRIORITY_REFUSED, NULL,
		       "runs at real-time priority %u again", bus->config->priority);
}

/* Begins a requested scan. While the bus ends it is cancelled at once. */
static void begin_scan(struct db_bus *bus, bool ending)
{
	struct scan *scan = atomic_exchange(&bus->scan_asked, NULL);

	if (scan) {
		db_time now = db_clock_now();

		bus_line_begin_scan(&bus->line, now);
		scan_begin(bus->engine, scan, now);
	}
	if (ending)
		scan_end(bus->engine, DB_SCAN_CANCELLED);
}

static void *run_thread(void *context)
{
	struct db_bus *bus = context;
	db_time exit_by = DB_TIME_NEVER;

	set_up_thread(bus);
	while (exit_by == DB_TIME_NEVER || db_clock_now() < exit_by) {
		struct db_change *change = atomic_exchange(&bus->change, NULL);
		bool notify;
		db_time next;

		/* Every request posted before this change is visible by now. */
		if (change)
			change_begin(bus->engine, change, db_clock_now());
		begin_scan(bus, exit_by != DB_TIME_NEVER);
		next = run_turn(bus);
		atomic_fetch_add_explicit(&bus->beats, 1, memory_order_relaxed);
		judge_priority(bus);
		/* What the network thread is to know of this turn. */
		notify = db_queue_has_finished(bus->queue) || bus->line.has_trouble;
		bus->line.has_trouble = false;
		change = change_fetch(bus->engine);
		/* Last, so that a reader that sees it finds every completion. */
		if (change)
			atomic_store(&bus->changed, change);
		if (notify || change)
			wake(bus->completion_fd);
		if (exit_by == DB_TIME_NEVER && atomic_load(&bus->ending)) {
			exit_by = db_clock_now() + DB_EXIT_TIME;
			/* A line that is being cleared or was taken out of service has its drives
			 * released already. */
			if (bus->line.use == LINE_IN_SERVICE)
				db_engine_shut_down(bus->engine, db_clock_now());
			continue;
		}
		if (exit_by != DB_TIME_NEVER && db_engine_is_quiet(bus->engine, false))
			break;
		wait_for_work(bus, next < exit_by ? next : exit_by);
	}
	db_engine_report_unconfirmed(bus->engine);
	begin_scan(bus, true);
	bus_line_close(&bus->line);
	if (bus->schedstat >= 0)
		close(bus->schedstat);
	atomic_store(&bus->ended, true);
	wake(bus->completion_fd);
	return NULL;
}

/* --- making and using ------------------------------------------------------------------------- */

int db_bus_new(const struct db_bus_config *config, const struct db_bus_drive *drives,
               size_t drive_count, struct db_log *log, struct db_bus **bus)
{
	struct db_bus *made = calloc(1, sizeof(*made));
	int error;

	if (!made)
		return -ENOMEM;
	made->config = config;
	made->log = (struct db_log_source){
		.log = log,
		.bus = config->name,
		.level = config->log,
	};
	made->drives = drive_count;
	made->schedstat = -1;
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
	made->line = (struct bus_line){
		.config = config,
		.transport = config->transport,
		.log = &made->log,
		.engine = made->engine,
	};
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

void db_bus_ask_end(struct db_bus *bus)
{
	atomic_store(&bus->ending, true);
	wake(bus->wake_fd);
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
	wake(bus->wake_fd);
}

struct db_change *db_bus_take_changed(struct db_bus *bus)
{
	return atomic_exchange(&bus->changed, NULL);
}

void db_bus_change_free(struct db_change *change)
{
	change_free(change);
}

int db_bus_scan(struct db_bus *bus, const struct db_scan_plan *plan, uint32_t *number)
{
	bool alone = bus->config->line == DB_LINE_RS232;
	unsigned min = alone ? 0 : bus->config->driver->address_min;
	unsigned max = alone ? 0 : bus->config->driver->address_max;
	struct scan *scan;

	/* Addresses and speeds that no drive of this bus can have. */
	if (plan->first < min || plan->first > plan->last || plan->last > max ||
	    plan->speed_count > DB_SCAN_SPEEDS_MAX || (plan->aside && plan->speed_count == 0))
		return -EINVAL;
	if (bus->scan && !atomic_load(&bus->scan->ended))
		return -EBUSY;
	scan = scan_new(bus->config, plan, ++bus->scan_number);
	if (!scan)
		return -ENOMEM;
	scan_free(bus->scan);
	bus->scan = scan;
	*number = bus->scan_number;
	atomic_store(&bus->scan_asked, scan);
	wake(bus->wake_fd);
	return 0;
}

bool db_bus_scan_read(const struct db_bus *bus, uint32_t number, struct db_scan_progress *progress)
{
	if (!bus->scan || bus->scan->number != number)
		return false;
	db_seqlock_read(&bus->scan->sequence, bus->scan->words, progress, sizeof(*progress));
	return true;
}

const struct db_scan_find *db_bus_scan_find(const struct db_bus *bus, size_t index)
{
	return &bus->scan->finds[index];
}

const struct db_scan_foreign *db_bus_scan_foreign(const struct db_bus *bus, size_t index)
{
	return &bus->scan->foreign[index];
}

void db_bus_scan_cancel(struct db_bus *bus, uint32_t number)
{
	if (!bus->scan || bus->scan->number != number)
		return;
	atomic_store(&bus->scan->cancelled, true);
	wake(bus->wake_fd);
}

struct db_request *db_bus_submit(struct db_bus *bus, const struct db_request *request)
{
	struct db_request *posted = db_queue_post(bus->queue, request);

	if (posted)
		wake(bus->wake_fd);
	return posted;
}

void db_bus_release(struct db_request *request)
{
	db_queue_release(request);
}

void db_bus_gather(struct db_bus *bus, bool gathers)
{
	if (db_queue_gather(bus->queue, gathers))
		wake(bus->wake_fd);
}

int db_bus_completion_fd(const struct db_bus *bus)
{
	return bus->completion_fd;
}

struct db_request *db_bus_completion(struct db_bus *bus)
{
	struct db_request *request = db_queue_collect(bus->queue);
	uint64_t count;

	if (request)
		return request;
	/* Clear the notification first, then look: a request finished in between notifies again or
	 * is found. */
	(void)!read(bus->completion_fd, &count, sizeof(count));
	return db_queue_collect(bus->queue);
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
	db_seqlock_read(&bus->stats_sequence, bus->stats_words, stats, sizeof(*stats));
}
