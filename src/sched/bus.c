/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bus thread: an engine, a line and a clock. Sleeps in ppoll() until bytes come, the network
 * thread posts a request, or the engine wants to be called.
 */
#include "drivebridge/bus.h"

#include "drivebridge/seqlock.h"
#include "sched/bus_line.h"
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

/* The thread turns at least so often, to show that it lives. */
#define BEAT_TIME (500 * DB_NS_PER_MS)

/* So often the cycle is judged; it is too slow when more than one in so many overran. */
#define JUDGE_INTERVAL (10 * DB_NS_PER_S)
#define OVERRUN_SHARE 10

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
	struct bus_line line;
	db_time wall_at;            /* when the wall clock is looked at again */
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

/* --- engine's callbacks ------------------------------------------------------------------------- */

static db_time send_bytes(void *context, const uint8_t *bytes, size_t length)
{
	return bus_line_send(&((struct db_bus *)context)->line, bytes, length);
}

static void tell_drive(void *context, const struct db_drive_config *drive, enum db_event event,
                       const struct db_feedback *feedback)
{
	struct db_bus *bus = context;

	bus_line_trace(&bus->line, event, drive, bus_line_now());
	bus_log_event(&bus->log, drive, event, feedback, bus_line_now());
}

static void tell_missing(void *context, const struct db_drive_config *drive, uint64_t params)
{
	const struct db_bus *bus = context;

	bus_log_missing_params(&bus->log, drive, bus->config->driver, params, bus_line_now());
}

static void tell_heard(void *context, const struct db_drive_config *drive,
                       const struct db_heard *heard)
{
	const struct db_bus *bus = context;

	bus_log_heard(&bus->log, drive, bus->config->driver->medium, heard, bus_line_now());
}

static void tell_timing(void *context, const struct db_drive_config *drive, enum db_event event,
                        db_time time)
{
	struct db_bus *bus = context;

	bus_line_trace(&bus->line, event, drive, bus_line_now());
	bus_log_timing(&bus->log, bus->config, drive, event, time, bus_line_now());
}

static void tell_raw(void *context, const struct db_drive_config *drive, bool sent,
                     const uint8_t *bytes, size_t length)
{
	const struct db_bus *bus = context;

	bus_log_raw(&bus->log, drive, bus->config->driver->medium, sent, bytes, length,
	            bus_line_now());
}

static const struct db_engine_ops engine_ops = {
	.send = send_bytes,
	.tell = tell_drive,
	.tell_missing = tell_missing,
	.tell_heard = tell_heard,
	.tell_timing = tell_timing,
	.tell_raw = tell_raw,
};

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
	stats.port = *bus_line_health(&bus->line);
	db_seqlock_write(&bus->stats_sequence, bus->stats_words, &stats, sizeof stats);
	watch_cycle(bus, &stats, now);
}

static void wait_for_work(struct db_bus *bus, db_time until)
{
	struct pollfd fds[2] = { { .fd = bus->wake_fd, .events = POLLIN } };
	db_time now = bus_line_now();
	db_time wait = until > now ? until - now : 0;
	struct timespec timeout = { .tv_sec = (time_t)(wait / DB_NS_PER_S),
		                    .tv_nsec = (long)(wait % DB_NS_PER_S) };

	bus_line_poll(&bus->line, &fds[1]);
	if (ppoll(fds, 2, &timeout, NULL) <= 0)
		return;
	if (fds[0].revents) {
		uint64_t count;

		(void)!read(bus->wake_fd, &count, sizeof count);
	}
	bus_line_take(&bus->line, fds[1].revents);
}

/* One turn. Returns when the next one is due at the latest. */
static db_time take_turn(struct db_bus *bus)
{
	db_time now = bus_line_now();
	db_time line_next;
	db_time next;

	/* A gateway boots in 1970 and learns the time later: the offset is taken again and again. */
	if (now >= bus->wall_at) {
		bus->wall_at = now + BEAT_TIME;
		db_engine_set_wall_offset(bus->engine, (clock_ns(CLOCK_REALTIME) - bus_line_now()) /
		                                               DB_NS_PER_US);
	}
	line_next = bus_line_run(&bus->line, now);
	next = db_engine_run(bus->engine, now);
	if (bus_line_check(&bus->line, now))
		line_next = bus->line.reopen_at;
	publish_stats(bus, now);
	return line_next < next ? line_next : next;
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
	bool troubled = bus->line.troubled;

	/* Last, so that who sees it finds every completion. */
	if (changed)
		atomic_store(&bus->changed, changed);
	bus->line.troubled = false;
	return finished || changed || troubled;
}

static db_time used_ns(void)
{
	return clock_ns(CLOCK_THREAD_CPUTIME_ID);
}

static void set_priority(struct db_bus *bus)
{
	unsigned wanted = bus->config->priority;
	int error = priority_begin(&bus->priority, wanted, bus_line_now(), used_ns());

	if (error != 0)
		db_log(&bus->log, bus_line_now(), DB_EVENT_PRIORITY_REFUSED, NULL,
		       "cannot run at real-time priority %u: %s; the bus runs without, and its cycles "
		       "may be late when the computer is busy. LimitRTPRIO of the service allows it, "
		       "and priority = 0 does not ask for it",
		       wanted, strerror(error));
}

static void judge_priority(struct db_bus *bus)
{
	db_time now = bus_line_now();
	enum priority_news news;

	if (!priority_is_due(&bus->priority, now))
		return;
	news = priority_judge(&bus->priority, now, used_ns());
	if (news == PRIORITY_LENT)
		db_log(&bus->log, now, DB_EVENT_PRIORITY_REFUSED, NULL,
		       "%s keeps a processor busy with what it sends; the bus goes on without its "
		       "real-time priority until that is over",
		       bus_line_place(&bus->line));
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
		db_log(&bus->log, bus_line_now(), DB_EVENT_CPUS_REFUSED, NULL,
		       "cannot keep to its processors: %s; check cpus, and CPUAffinity and "
		       "AllowedCPUs of the service",
		       strerror(error));
}

/* A scan that was asked for. When the bus ends it does not begin. */
static void take_scan(struct db_bus *bus, bool ending, db_time now)
{
	struct scan *scan = atomic_exchange(&bus->scan_asked, NULL);

	if (scan) {
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
	char name[16]; /* what top -H and ps show; the kernel keeps 15 characters */

	snprintf(name, sizeof name, "%s", bus->config->name);
	pthread_setname_np(pthread_self(), name);
	set_cpus(bus);
	set_priority(bus);
	/* The default slack of 50 us is a good part of an exchange at high baud rates. */
	prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);
	while (bus_line_now() < exit_by) {
		struct db_change *change = atomic_exchange(&bus->change, NULL);
		db_time next;

		/* Requests that were handed over before a change are all there by now. */
		if (change)
			change_begin(bus->engine, change, bus_line_now());
		take_scan(bus, exit_by != DB_TIME_NEVER, bus_line_now());
		next = take_turn(bus);
		atomic_fetch_add_explicit(&bus->beats, 1, memory_order_relaxed);
		judge_priority(bus);
		if (give_back(bus))
			tell_network(bus);
		if (exit_by == DB_TIME_NEVER && atomic_load(&bus->ending)) {
			exit_by = bus_line_now() + DB_EXIT_TIME;
			/* A line that is being cleared or set aside was left so already. */
			if (bus->line.use == LINE_IN_SERVICE)
				db_engine_shut_down(bus->engine, bus_line_now());
			continue;
		}
		if (exit_by != DB_TIME_NEVER && db_engine_is_quiet(bus->engine))
			break;
		if (next > bus_line_now() + BEAT_TIME)
			next = bus_line_now() + BEAT_TIME;
		wait_for_work(bus, next < exit_by ? next : exit_by);
	}
	db_engine_tell_unconfirmed(bus->engine);
	take_scan(bus, true, bus_line_now());
	bus_line_close(&bus->line);
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
