/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A separate thread writes, because the reader of the log may block it: a full pipe, a stopped
 * terminal, a journal that is being restarted. Neither a bus's cycle nor the watchdog of the
 * network thread may be blocked by that.
 *
 * The lock is held to copy a line in or out, never while one is written. It inherits priority: a
 * bus's thread that waits for it lends its priority to the owner.
 */
#include "log/log_private.h"

#include "drivebridge/clock.h"
#include "drivebridge/worker.h"

#include "log/event.h"
#include "log/repeat.h"

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct db_log {
	db_log_write_fn *write;
	void *context;
	int fd; /* for the usual outputs */
	pthread_t thread;
	sem_t wake;

	pthread_mutex_t lock; /* protects the following */
	struct db_repeats repeats;
	struct db_recent recent;
	struct db_log_record queue[DB_LOG_QUEUE];
	size_t first;
	size_t count;
	uint32_t lost;
	bool ending;
};

/* --- the thread that writes ------------------------------------------------------------------- */

__attribute__((format(printf, 3, 4))) static void make_record(struct db_log_record *record,
                                                              enum db_event event,
                                                              const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	db_log_record_init(record, NULL, event, NULL, format, arguments);
	va_end(arguments);
}

/* The lock is held. False when there is nothing to write now. */
static bool next_record(struct db_log *log, db_time now, struct db_log_record *record)
{
	uint32_t unkept;

	if (log->count > 0) {
		*record = log->queue[log->first];
		log->count--;
		/* An empty queue begins again at its start, so that not all of it is paged in. */
		log->first = log->count == 0 ? 0 : (log->first + 1) % DB_LOG_QUEUE;
		return true;
	}
	if (log->lost > 0) {
		make_record(record, DB_EVENT_LOG_LOST,
		            "%u messages are missing here: they came faster than they were read",
		            (unsigned)log->lost);
		log->lost = 0;
		return true;
	}
	if (!db_repeats_due(&log->repeats, now, log->ending, record, &unkept))
		return false;
	if (unkept > 0)
		db_recent_add(&log->recent, record, db_clock_wall_us());
	return true;
}

static void *write_records(void *context)
{
	struct db_log *log = context;
	struct db_log_record record;
	bool ending = false;
	db_time next = 0;
	bool any;

	while (!ending) {
		struct timespec time = { .tv_sec = (time_t)(next / DB_NS_PER_S),
			                 .tv_nsec = (long)(next % DB_NS_PER_S) };

		if (next == DB_TIME_NEVER)
			sem_wait(&log->wake);
		else
			sem_clockwait(&log->wake, CLOCK_MONOTONIC, &time);
		do {
			pthread_mutex_lock(&log->lock);
			any = next_record(log, db_clock_now(), &record);
			next = db_repeats_next(&log->repeats);
			ending = log->ending;
			pthread_mutex_unlock(&log->lock);
			if (any)
				log->write(log->context, &record);
		} while (any);
	}
	return NULL;
}

/* --- making ----------------------------------------------------------------------------------- */

int db_log_new_to(db_log_write_fn *write, void *context, struct db_log **log)
{
	struct db_log *made = calloc(1, sizeof(*made));
	int error;

	if (!made)
		return -ENOMEM;
	made->write = write;
	made->fd = STDERR_FILENO;
	made->context = context ? context : &made->fd;
	error = db_worker_init_lock(&made->lock);
	if (error != 0) {
		free(made);
		return error;
	}
	sem_init(&made->wake, 0, 0);
	error = pthread_create(&made->thread, NULL, write_records, made);
	if (error != 0) {
		sem_destroy(&made->wake);
		pthread_mutex_destroy(&made->lock);
		free(made);
		return -error;
	}
	pthread_setname_np(made->thread, "log");
	*log = made;
	return 0;
}

int db_log_new(struct db_log **log)
{
	bool journal = db_log_is_journal(STDERR_FILENO, getenv("JOURNAL_STREAM"));

	return db_log_new_to(journal ? db_log_write_journal : db_log_write_text, NULL, log);
}

/* False: the thread still uses the log. */
static bool end_thread(struct db_log *log)
{
	pthread_mutex_lock(&log->lock);
	log->ending = true;
	pthread_mutex_unlock(&log->lock);
	sem_post(&log->wake);
	return db_worker_join(log->thread);
}

void db_log_free(struct db_log *log)
{
	if (!log || !end_thread(log))
		return;
	sem_destroy(&log->wake);
	pthread_mutex_destroy(&log->lock);
	free(log);
}

void db_log_leave(struct db_log *log)
{
	(void)end_thread(log);
}

/* --- the other threads ------------------------------------------------------------------------ */

void db_log(const struct db_log_source *source, db_time now, enum db_event event,
            const struct db_log_about *about, const char *format, ...)
{
	struct db_log *log = source->log;
	enum db_repeat_verdict verdict;
	struct db_log_record record;
	va_list arguments;
	bool news = false;

	if (!log || db_event_level(event) > source->level)
		return;
	va_start(arguments, format);
	db_log_record_init(&record, source->bus, event, about, format, arguments);
	va_end(arguments);
	pthread_mutex_lock(&log->lock);
	verdict = db_repeats_pass(&log->repeats, &record, now);
	if (verdict != DB_REPEAT_COUNTED)
		db_recent_add(&log->recent, &record, db_clock_wall_us());
	if (verdict == DB_REPEAT_LOGGED) {
		news = log->count < DB_LOG_QUEUE;
		if (news)
			log->queue[(log->first + log->count++) % DB_LOG_QUEUE] = record;
		else
			log->lost++;
	}
	pthread_mutex_unlock(&log->lock);
	if (news)
		sem_post(&log->wake);
}

void db_log_fields(const struct db_log *log, char *const fields[], size_t count)
{
	if (log && log->write == db_log_write_journal)
		db_log_send_journal(fields, count);
}

bool db_log_latest(struct db_log *log, uint64_t events, const char *bus, const char *drive,
                   uint64_t since_us, struct db_log_line *line)
{
	bool found;

	if (!log)
		return false;
	pthread_mutex_lock(&log->lock);
	found = db_recent_latest(&log->recent, events, bus, drive ? drive : "", since_us, line);
	pthread_mutex_unlock(&log->lock);
	return found;
}

uint64_t db_log_newest(struct db_log *log)
{
	uint64_t newest;

	if (!log)
		return 0;
	pthread_mutex_lock(&log->lock);
	newest = log->recent.last;
	pthread_mutex_unlock(&log->lock);
	return newest;
}

bool db_log_recent(struct db_log *log, uint64_t from, struct db_log_line *line)
{
	bool found;

	if (!log)
		return false;
	pthread_mutex_lock(&log->lock);
	found = db_recent_find(&log->recent, from, line);
	pthread_mutex_unlock(&log->lock);
	return found;
}
