/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The network thread counts and hands over what is to be written; the thread of this room writes
 * and reads. The lock is held to hand over a pointer, never during a call of the disk. It inherits
 * priority, as the log's.
 */
#include "health/health_private.h"

#include "drivebridge/clock.h"
#include "drivebridge/worker.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define ALARMS_NAME "alarms"
/* A new alarm, or one that was acknowledged, is written at once if the last time is as long ago. */
#define ALARMS_EVERY (10 * DB_NS_PER_S)
/* More than the file of the most alarms. */
#define ALARMS_BYTES_MAX (256 * 1024)
/* An interval that is shorter than that says nothing. */
#define SHORTEST DB_NS_PER_S

/* One page at a time. */
enum reading { READING_NOTHING, READING_ASKED, READING_DONE };

/* What is handed over, and what is answered. */
struct exchange {
	bool on;
	bool ending;
	struct db_store_interval *interval; /* with its entries; null: none */
	uint8_t *alarms;                    /* the bytes of their file; null: none */
	size_t alarms_size;
	enum reading reading;
	uint32_t reader;
	struct db_health_query query;
	uint32_t clock_s; /* at that query */
	uint64_t wall_us;
};

struct db_health {
	struct db_log_source log;
	char *folder; /* null: none */

	/* The network thread's own. */
	bool on;
	bool loaded; /* alarms of earlier runs */
	bool first;  /* interval since the values are taken */
	struct db_meter *meters;
	size_t meter_count;
	db_time now;   /* of the last tick */
	db_time began; /* the interval */
	struct db_alarms alarms;
	db_time alarms_written;

	/* The thread's own. */
	struct db_store *store;
	int values_error;
	int alarms_error;

	pthread_t thread;
	sem_t wake;
	pthread_mutex_t lock; /* of the following */
	struct exchange exchange;
	bool writing; /* an interval was taken and is not written yet */
	bool alarms_failed;
	char trouble[128];
	struct db_health_page page;
};

/* --- the thread ------------------------------------------------------------------------------- */

/* Writes what was handed over, and tells when writing begins to fail or succeeds again. */
static void write_given(struct db_health *health, const struct exchange *given)
{
	int before = health->values_error != 0 ? health->values_error : health->alarms_error;
	int error;

	if (given->interval && health->store)
		health->values_error = db_store_add(health->store, given->interval);
	if (given->alarms && health->folder)
		health->alarms_error = db_store_replace(health->folder, ALARMS_NAME, given->alarms,
		                                        given->alarms_size);
	error = health->values_error != 0 ? health->values_error : health->alarms_error;
	pthread_mutex_lock(&health->lock);
	health->alarms_failed = health->alarms_error != 0;
	snprintf(health->trouble, sizeof(health->trouble), "%s",
	         error == 0 ? "" : strerror(-error));
	pthread_mutex_unlock(&health->lock);
	if (error == 0 && before != 0)
		db_log(&health->log, db_clock_now(), DB_EVENT_HEALTH_KEPT, NULL,
		       "health values and alarms are written again");
	if (error != 0 && before == 0)
		db_log(&health->log, db_clock_now(), DB_EVENT_HEALTH_UNKEPT, NULL,
		       "health values or alarms cannot be written into %s: %s; they are kept in "
		       "memory",
		       health->folder ? health->folder : "memory", strerror(-error));
}

static void *run(void *context)
{
	struct db_health *health = context;
	struct exchange given = { .ending = false };
	bool damaged = false;

	while (!given.ending) {
		sem_wait(&health->wake);
		pthread_mutex_lock(&health->lock);
		given = health->exchange;
		health->exchange.interval = NULL;
		health->exchange.alarms = NULL;
		health->writing = given.interval != NULL;
		pthread_mutex_unlock(&health->lock);
		if (given.on && !health->store) {
			health->values_error = db_store_open(health->folder, &health->store,
			                                     &damaged);
			if (health->values_error == 0 && damaged)
				db_log(&health->log, db_clock_now(), DB_EVENT_HEALTH_UNKEPT, NULL,
				       "the file of health values in %s is not understood: it is "
				       "kept as values" DB_HEALTH_DAMAGED
				       ", and another one begins",
				       health->folder);
		}
		write_given(health, &given);
		if (!given.on) {
			db_store_free(health->store);
			health->store = NULL;
		}
		if (given.interval)
			free((void *)(uintptr_t)given.interval->entries);
		free(given.interval);
		free(given.alarms);
		pthread_mutex_lock(&health->lock);
		health->writing = false;
		pthread_mutex_unlock(&health->lock);
		if (given.reading == READING_ASKED) {
			struct db_health_page page = { .known = false };

			if (health->store)
				db_store_read(health->store, &given.query, given.clock_s,
				              given.wall_us, &page);
			pthread_mutex_lock(&health->lock);
			/* Its owner may be gone. */
			health->exchange.reading = health->exchange.reader != 0 ? READING_DONE :
			                                                          READING_NOTHING;
			if (health->exchange.reader != 0)
				health->page = page;
			else
				free(page.values);
			pthread_mutex_unlock(&health->lock);
		}
	}
	return NULL;
}

/* --- handing over ----------------------------------------------------------------------------- */

/* Ends the interval. While the disk holds up the thread, or without memory, it goes on. */
static void post_interval(struct db_health *health, db_time now, uint64_t wall_us)
{
	struct db_store_interval *interval;
	struct db_store_entry *entries;
	db_time span = (now - health->began + DB_NS_PER_S / 2) / DB_NS_PER_S;
	bool busy;

	pthread_mutex_lock(&health->lock);
	busy = health->writing || health->exchange.interval;
	pthread_mutex_unlock(&health->lock);
	if (busy || health->meter_count == 0)
		return;
	interval = malloc(sizeof(*interval));
	entries = calloc(health->meter_count + 1, sizeof(*entries));
	if (!interval || !entries) {
		free(interval);
		free(entries);
		return;
	}
	/* All meters as they are. */
	for (size_t i = 0; i < health->meter_count; i++) {
		const struct db_meter *meter = &health->meters[i];
		struct db_health_value value;

		memcpy(entries[i].name, meter->name, sizeof(meter->name));
		entries[i].unit = meter->unit;
		db_meter_read(meter, &value);
		db_health_value_write(&value, entries[i].value);
	}
	*interval = (struct db_store_interval){
		.clock_s = (uint32_t)(now / DB_NS_PER_S),
		.span_s = span > UINT16_MAX ? UINT16_MAX : (uint16_t)span,
		.wall_us = wall_us,
		.entries = entries,
		.count = health->meter_count,
	};
	pthread_mutex_lock(&health->lock);
	health->exchange.interval = interval;
	pthread_mutex_unlock(&health->lock);
	sem_post(&health->wake);
	for (size_t i = 0; i < health->meter_count; i++)
		db_meter_begin(&health->meters[i]);
	health->began = now;
	health->first = false;
}

static void post_alarms(struct db_health *health, db_time now)
{
	size_t size = 0;
	uint8_t *bytes;

	if (!health->folder)
		return;
	bytes = db_alarms_write(&health->alarms, &size);
	if (!bytes)
		return;
	pthread_mutex_lock(&health->lock);
	free(health->exchange.alarms);
	health->exchange.alarms = bytes;
	health->exchange.alarms_size = size;
	pthread_mutex_unlock(&health->lock);
	sem_post(&health->wake);
	health->alarms.changed = health->alarms.urgent = false;
	health->alarms_written = now;
}

void db_health_tick(struct db_health *health, db_time now, uint64_t wall_us)
{
	db_time span = (health->first ? DB_HEALTH_FIRST_S : DB_HEALTH_INTERVAL_S) * DB_NS_PER_S;
	bool failed;

	health->now = now;
	if (!health->on)
		return;
	if (now - health->began >= span)
		post_interval(health, now, wall_us);
	pthread_mutex_lock(&health->lock);
	failed = health->alarms_failed;
	pthread_mutex_unlock(&health->lock);
	if ((health->alarms.urgent && now - health->alarms_written >= ALARMS_EVERY) ||
	    ((health->alarms.changed || failed) &&
	     now - health->alarms_written >= DB_HEALTH_INTERVAL_S * DB_NS_PER_S))
		post_alarms(health, now);
}

/* --- values ----------------------------------------------------------------------------------- */

int db_health_set_drives(struct db_health *health, const struct db_health_drive *drives,
                         size_t count)
{
	struct db_meter *meters = calloc(count + 1, sizeof(*meters));

	if (!meters)
		return -ENOMEM;
	for (size_t i = 0; i < count; i++) {
		meters[i] = (struct db_meter){ .unit = drives[i].unit, .number = drives[i].number };
		strncpy(meters[i].name, drives[i].name, sizeof(meters[i].name) - 1);
		db_meter_begin(&meters[i]);
		for (size_t k = 0; k < health->meter_count; k++) {
			const struct db_meter *before = &health->meters[k];

			if (before->unit != drives[i].unit ||
			    strcmp(before->name, drives[i].name) != 0)
				continue;
			meters[i] = *before;
			if (before->number == drives[i].number)
				continue;
			meters[i].number = drives[i].number;
			meters[i].sampled = 0;
		}
	}
	free(health->meters);
	health->meters = meters;
	health->meter_count = count;
	return 0;
}

void db_health_sample(struct db_health *health, size_t place, const struct db_snapshot *snapshot,
                      bool has_temperature, db_time now)
{
	if (health->on && place < health->meter_count)
		db_meter_sample(&health->meters[place], snapshot, has_temperature, now);
}

char *db_health_running(const struct db_health *health, const char *drive, db_time now,
                        uint64_t wall_us)
{
	db_time span = health->on ? (now - health->began) / DB_NS_PER_S : 0;
	size_t printed = 0;
	char *text = NULL;
	size_t length;
	FILE *out = open_memstream(&text, &length);

	if (!out)
		return NULL;
	for (size_t i = 0; health->on && i < health->meter_count; i++) {
		const struct db_meter *meter = &health->meters[i];
		struct db_health_value value;

		if (drive[0] != '\0' && strcmp(drive, meter->name) != 0)
			continue;
		db_meter_read(meter, &value);
		if (printed++ > 0)
			fputc(',', out);
		db_health_value_print(&value, meter->name, wall_us, (uint64_t)span, out);
	}
	if (fclose(out) != 0) {
		free(text);
		return NULL;
	}
	return text;
}

bool db_health_ask(struct db_health *health, uint32_t owner, const struct db_health_query *query,
                   db_time now, uint64_t wall_us)
{
	bool place;

	pthread_mutex_lock(&health->lock);
	place = health->exchange.reading == READING_NOTHING;
	if (place) {
		health->exchange.reading = READING_ASKED;
		health->exchange.reader = owner;
		health->exchange.query = *query;
		health->exchange.clock_s = (uint32_t)(now / DB_NS_PER_S);
		health->exchange.wall_us = wall_us;
	}
	pthread_mutex_unlock(&health->lock);
	if (place)
		sem_post(&health->wake);
	return place;
}

bool db_health_take(struct db_health *health, uint32_t owner, struct db_health_page *page)
{
	bool done;

	pthread_mutex_lock(&health->lock);
	done = health->exchange.reading == READING_DONE && health->exchange.reader == owner;
	if (done) {
		*page = health->page;
		health->exchange.reading = READING_NOTHING;
	}
	pthread_mutex_unlock(&health->lock);
	return done;
}

void db_health_forget(struct db_health *health, uint32_t owner)
{
	if (!health)
		return;
	pthread_mutex_lock(&health->lock);
	if (health->exchange.reader == owner) {
		/* A page that is being read is dropped when it is ready. */
		health->exchange.reader = 0;
		if (health->exchange.reading == READING_DONE) {
			free(health->page.values);
			health->exchange.reading = READING_NOTHING;
		}
	}
	pthread_mutex_unlock(&health->lock);
}

/* --- alarms ----------------------------------------------------------------------------------- */

void db_health_see(struct db_health *health, const struct db_alarm_seen *seen)
{
	if (health->on)
		db_alarms_see(&health->alarms, seen);
}

void db_health_seen(struct db_health *health, uint64_t wall_us)
{
	if (health->on)
		db_alarms_end(&health->alarms, wall_us);
}

struct db_alarm_list db_health_alarms(const struct db_health *health)
{
	const struct db_alarms *alarms = &health->alarms;

	return (struct db_alarm_list){ alarms->list, alarms->count, alarms->last_change };
}

const struct db_alarm *db_health_acknowledge(struct db_health *health, uint64_t id,
                                             const char *drive, const char *by, uint64_t wall_us,
                                             bool *fresh)
{
	return db_alarms_acknowledge(&health->alarms, id, drive, by, wall_us, fresh);
}

static void load_alarms(struct db_health *health, db_time now)
{
	char path[PATH_MAX];
	char aside[PATH_MAX + sizeof(DB_HEALTH_DAMAGED)];
	uint8_t *bytes;
	size_t used = 0;
	ssize_t got = 1;
	int error;
	int fd;

	if (health->loaded || !health->folder ||
	    snprintf(path, sizeof(path), "%s/" ALARMS_NAME, health->folder) >= (int)sizeof(path))
		return;
	health->loaded = true;
	fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
	bytes = fd < 0 ? NULL : malloc(ALARMS_BYTES_MAX);
	error = fd < 0 ? -errno : bytes ? 0 : -ENOMEM;
	/* gcc's analyzer does not see that without a file `error` is not 0. */
	while (error == 0 && got > 0 && used < ALARMS_BYTES_MAX) {
		got = read(fd, bytes + used, ALARMS_BYTES_MAX - used);
		used += got > 0 ? (size_t)got : 0;
		if (got < 0 && errno != EINTR)
			error = -errno;
	}
	if (error == 0 && !db_alarms_read(&health->alarms, bytes, used))
		error = -EBADMSG;
	free(bytes);
	if (fd >= 0)
		close(fd);
	if (error == 0 || error == -ENOENT)
		return;
	db_log(&health->log, now, DB_EVENT_HEALTH_UNKEPT, NULL,
	       "the alarms in %s cannot be read: %s; the file is kept as "
	       "alarms" DB_HEALTH_DAMAGED ", and another one begins",
	       path, error == -EBADMSG ? "it is damaged" : strerror(-error));
	snprintf(aside, sizeof(aside), "%s" DB_HEALTH_DAMAGED, path);
	(void)rename(path, aside);
}

/* --- beginning and end ------------------------------------------------------------------------ */

static void release(struct db_health *health)
{
	if (health->exchange.reading == READING_DONE)
		free(health->page.values);
	db_store_free(health->store);
	db_alarms_clear(&health->alarms);
	free(health->meters);
	free(health->folder);
	sem_destroy(&health->wake);
	pthread_mutex_destroy(&health->lock);
	free(health);
}

int db_health_new(const struct db_health_setup *setup, db_time now, struct db_health **health)
{
	struct db_health *made = calloc(1, sizeof(*made));
	int error = made ? db_worker_init_lock(&made->lock) : -ENOMEM;

	if (error != 0) {
		free(made);
		return error;
	}
	sem_init(&made->wake, 0, setup->on ? 1 : 0);
	made->log = setup->log;
	made->on = made->exchange.on = setup->on;
	made->first = true;
	made->now = made->began = now;
	made->alarms_written = now - ALARMS_EVERY;
	made->folder = setup->folder ? strdup(setup->folder) : NULL;
	error = setup->folder && !made->folder ? ENOMEM : 0;
	if (error == 0 && setup->on)
		load_alarms(made, now);
	if (error == 0)
		error = pthread_create(&made->thread, NULL, run, made);
	if (error != 0) {
		release(made);
		return -error;
	}
	pthread_setname_np(made->thread, "health");
	*health = made;
	return 0;
}

bool db_health_free(struct db_health *health, db_time now, uint64_t wall_us)
{
	if (!health)
		return true;
	if (health->on && now - health->began >= SHORTEST)
		post_interval(health, now, wall_us);
	if (health->on && health->alarms.changed)
		post_alarms(health, now);
	pthread_mutex_lock(&health->lock);
	health->exchange.ending = true;
	pthread_mutex_unlock(&health->lock);
	sem_post(&health->wake);
	if (!db_worker_join(health->thread))
		return false;
	release(health);
	return true;
}

void db_health_change(struct db_health *health, bool on)
{
	if (on == health->on)
		return;
	if (on) {
		load_alarms(health, health->now);
		health->first = true;
		health->began = health->now;
		for (size_t i = 0; i < health->meter_count; i++) {
			db_meter_begin(&health->meters[i]);
			health->meters[i].sampled = 0;
		}
	} else if (health->alarms.changed) {
		post_alarms(health, health->now);
	}
	health->on = on;
	pthread_mutex_lock(&health->lock);
	health->exchange.on = on;
	pthread_mutex_unlock(&health->lock);
	sem_post(&health->wake);
}

void db_health_state(struct db_health *health, struct db_health_state *state)
{
	pthread_mutex_lock(&health->lock);
	*state = (struct db_health_state){
		.on = health->on, .kept = health->on && health->folder && health->trouble[0] == '\0'
	};
	memcpy(state->trouble, health->trouble, sizeof(state->trouble));
	pthread_mutex_unlock(&health->lock);
}
