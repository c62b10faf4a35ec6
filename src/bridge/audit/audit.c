/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A thread of its own writes and reads the files, because a disk may take seconds, and neither a
 * bus's cycle, nor the network thread, nor the lines of the log may wait for that.
 *
 * The lock is held to copy a record in or out, never while one is written. It inherits priority, as
 * the log's.
 */
#include "audit/audit_private.h"

#include "drivebridge/clock.h"
#include "drivebridge/result.h"
#include "drivebridge/worker.h"

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* A loss of power costs the records of this time at most. */
#define SYNC_EVERY DB_NS_PER_S
/* A folder that could not be used at the start is tried again: a disk may be mounted late, or
 * repaired. */
#define OPEN_EVERY (10 * DB_NS_PER_S)
/* Read at the start, for histories. */
#define PAST_BYTES (1024 * 1024)
#define WRITTEN_AT_ONCE 256
#define MIB (1024u * 1024u)

/* One page at a time. */
enum reading { READING_NOTHING, READING_ASKED, READING_DONE };

struct db_audit {
	struct db_log_source log;
	pthread_t thread;
	sem_t wake;

	/* The thread's own. */
	char *folder;           /* null: only the journal */
	struct db_trail *trail; /* null: not open */
	db_time open_at;        /* DB_TIME_NEVER: it is open, or there is no folder */
	db_time sync_at;        /* DB_TIME_NEVER: nothing to be done */
	uint64_t kept_above;    /* the files have records from the next number on */
	uint64_t unkept;        /* records that the files do not have */
	bool failing;           /* which was logged */
	bool unsynced;          /* the disk did not take the latest ones for good */
	struct db_pages pages;

	pthread_mutex_t lock; /* of the following */
	struct db_audit_queue queue;
	struct db_floods floods;
	uint32_t lost; /* that found no room */
	bool ending;
	bool changed; /* the size */
	struct db_audit_state state;
	enum reading reading;
	uint32_t reader;
	struct db_audit_query query;
	struct db_audit_page page;
};

/* --- posting ---------------------------------------------------------------------------------- */

/* The lock is held. The record's number; 0: there was no room. */
static uint64_t put(struct db_audit *audit, const struct db_audit_entry *entry)
{
	struct db_audit_entry lost = { .kind = DB_AUDIT_LOST, .time_us = entry->time_us };
	struct db_audit_entry numbered = *entry;

	/* Those that were lost come first, in their order. */
	if (audit->lost > 0) {
		lost.count = audit->lost;
		lost.text = "they came faster than they could be written";
		lost.number = audit->state.newest + audit->lost + 1;
		if (!db_audit_queue_put(&audit->queue, &lost)) {
			audit->lost++;
			audit->state.lost++;
			return 0;
		}
		audit->lost = 0;
		audit->state.newest = lost.number;
	}
	numbered.number = audit->state.newest + 1;
	if (db_audit_queue_put(&audit->queue, &numbered)) {
		audit->state.newest = numbered.number;
		return numbered.number;
	}
	audit->lost++;
	audit->state.lost++;
	return 0;
}

/* Refusals, stops that another one serves, and writes that change nothing may come with every cycle
 * of a PLC. */
static bool may_be_repeated(const struct db_audit_entry *entry)
{
	if (entry->kind == DB_AUDIT_DENIED || (entry->kind == DB_AUDIT_COMMAND && entry->of != 0) ||
	    (entry->result != DB_RESULT_NONE && entry->result != DB_RESULT_PENDING &&
	     !db_result_is_success(entry->result)))
		return entry->kind != DB_AUDIT_END;
	if (entry->kind != DB_AUDIT_WRITE || entry->value_count == 0)
		return false;
	for (size_t i = 0; i < entry->value_count; i++) {
		const struct db_audit_value *value = &entry->values[i];

		if (!value->known || value->old.u != value->new.u)
			return false;
	}
	return true;
}

uint32_t db_audit_post(struct db_audit *audit, const struct db_audit_entry *entry, db_time now)
{
	struct db_flood *place = NULL;
	uint64_t number = 0;

	if (!audit)
		return 0;
	pthread_mutex_lock(&audit->lock);
	if (audit->state.on &&
	    (!may_be_repeated(entry) || db_floods_pass(&audit->floods, entry, now, &place)))
		number = put(audit, entry);
	if (place)
		place->last = number;
	pthread_mutex_unlock(&audit->lock);
	if (number != 0)
		sem_post(&audit->wake);
	return (uint32_t)number;
}

void db_audit_end(struct db_audit *audit, uint32_t number, const char *drive, enum db_result result,
                  uint32_t took_us, uint64_t time_us)
{
	struct db_audit_entry entry = {
		.kind = DB_AUDIT_END,
		.time_us = time_us,
		.drive = drive,
		.result = result,
		.took_us = took_us,
	};

	if (!audit || number == 0)
		return;
	pthread_mutex_lock(&audit->lock);
	/* The newest number at or below the present one that has this lower half. */
	entry.of = audit->state.newest - (uint32_t)((uint32_t)audit->state.newest - number);
	if (audit->state.on)
		(void)put(audit, &entry);
	pthread_mutex_unlock(&audit->lock);
	sem_post(&audit->wake);
}

void db_audit_change(struct db_audit *audit, bool on, unsigned mib)
{
	pthread_mutex_lock(&audit->lock);
	audit->state.on = on;
	audit->state.mib = mib;
	audit->changed = true;
	pthread_mutex_unlock(&audit->lock);
	sem_post(&audit->wake);
}

void db_audit_state(struct db_audit *audit, struct db_audit_state *state)
{
	*state = (struct db_audit_state){ .on = false };
	if (!audit)
		return;
	pthread_mutex_lock(&audit->lock);
	*state = audit->state;
	pthread_mutex_unlock(&audit->lock);
}

/* --- the thread that writes ------------------------------------------------------------------- */

static void note_trouble(struct db_audit *audit, int error)
{
	pthread_mutex_lock(&audit->lock);
	snprintf(audit->state.trouble, sizeof(audit->state.trouble), "%s",
	         error == 0 ? "" : strerror(-error));
	if (audit->trail)
		audit->state.bytes = db_trail_bytes(audit->trail);
	pthread_mutex_unlock(&audit->lock);
	if (error == 0 && audit->failing)
		db_log(&audit->log, db_clock_now(), DB_EVENT_AUDIT_KEPT, NULL,
		       "the audit trail is written again; %llu records are only in the journal",
		       (unsigned long long)audit->unkept);
	if (error != 0 && !audit->failing)
		db_log(&audit->log, db_clock_now(), DB_EVENT_AUDIT_UNKEPT, NULL,
		       "the audit trail cannot be written: %s; commands are carried out, and their "
		       "records are only in the journal",
		       strerror(-error));
	audit->failing = error != 0;
}

static void write_record(struct db_audit *audit, const struct db_audit_entry *entry)
{
	json_t *object = db_record_write(entry);
	char *fields[DB_RECORD_FIELDS_MAX];
	size_t count;

	if (!object)
		return;
	if (audit->trail && entry->number > audit->kept_above) {
		struct db_audit_entry lost = {
			.kind = DB_AUDIT_LOST,
			.time_us = entry->time_us,
			.number = entry->number - 1,
			.count = audit->unkept,
			.text = "the disk did not take them",
		};
		json_t *before = audit->unkept > 0 ? db_record_write(&lost) : NULL;
		int error = 0;

		/* What the files do not take is counted before the next record that they take, with
		 * the number of the last of them. */
		if (audit->unkept > 0)
			error = before ? db_trail_append(audit->trail, before, lost.number,
			                                 lost.time_us) :
			                 -ENOMEM;
		json_decref(before);
		if (error == 0) {
			error = db_trail_append(audit->trail, object, entry->number,
			                        entry->time_us);
			if (audit->unkept > 0 || error != 0)
				note_trouble(audit, error);
			audit->unkept = 0;
		} else {
			note_trouble(audit, error);
		}
		if (error != 0) {
			audit->unkept++;
			pthread_mutex_lock(&audit->lock);
			audit->state.lost++;
			pthread_mutex_unlock(&audit->lock);
		}
		if (audit->sync_at == DB_TIME_NEVER)
			audit->sync_at = db_clock_now() + SYNC_EVERY;
	}
	/* The end of what succeeded says nothing that the journal needs. */
	if (entry->kind != DB_AUDIT_END || db_record_is_refused(object)) {
		count = db_record_fields(entry, object, fields);
		db_log_fields(audit->log.log, fields, count);
		for (size_t i = 0; i < count; i++)
			free(fields[i]);
	}
	json_decref(object);
}

/* --- reading ---------------------------------------------------------------------------------- */

bool db_audit_ask(struct db_audit *audit, uint32_t owner, const struct db_audit_query *query)
{
	bool free_place;

	pthread_mutex_lock(&audit->lock);
	free_place = audit->reading == READING_NOTHING;
	if (free_place) {
		audit->reading = READING_ASKED;
		audit->reader = owner;
		audit->query = *query;
	}
	pthread_mutex_unlock(&audit->lock);
	if (free_place)
		sem_post(&audit->wake);
	return free_place;
}

bool db_audit_take(struct db_audit *audit, uint32_t owner, struct db_audit_page *page)
{
	bool done;

	pthread_mutex_lock(&audit->lock);
	done = audit->reading == READING_DONE && audit->reader == owner;
	if (done) {
		*page = audit->page;
		audit->reading = READING_NOTHING;
	}
	pthread_mutex_unlock(&audit->lock);
	return done;
}

void db_audit_forget(struct db_audit *audit, uint32_t owner)
{
	if (!audit)
		return;
	pthread_mutex_lock(&audit->lock);
	if (audit->reader == owner) {
		if (audit->reading == READING_DONE)
			free(audit->page.records);
		/* A page that is being read is dropped when it is ready. */
		audit->reader = 0;
		if (audit->reading == READING_DONE)
			audit->reading = READING_NOTHING;
	}
	pthread_mutex_unlock(&audit->lock);
}

static void serve_reader(struct db_audit *audit)
{
	struct db_audit_query query;
	struct db_audit_page page;
	uint32_t reader;
	bool asked;

	pthread_mutex_lock(&audit->lock);
	asked = audit->reading == READING_ASKED;
	query = audit->query;
	reader = audit->reader;
	pthread_mutex_unlock(&audit->lock);
	if (!asked)
		return;
	db_pages_read(&audit->pages, audit->trail, reader, &query, &page);
	pthread_mutex_lock(&audit->lock);
	audit->reading = audit->reader != 0 ? READING_DONE : READING_NOTHING;
	if (audit->reader != 0)
		audit->page = page;
	else
		free(page.records);
	pthread_mutex_unlock(&audit->lock);
}

/* --- opening ---------------------------------------------------------------------------------- */

static void tell_damage(struct db_audit *audit, const struct db_trail_found *found, db_time now)
{
	struct db_audit_entry entry = { .kind = DB_AUDIT_TRAIL, .time_us = db_clock_wall_us() };
	char text[96];

	if (found->cut > 0) {
		snprintf(text, sizeof(text), "a torn record of %llu bytes at the end was cut off",
		         (unsigned long long)found->cut);
		entry.text = text;
		db_log(&audit->log, now, DB_EVENT_AUDIT_UNKEPT, NULL, "the audit trail: %s", text);
		(void)db_audit_post(audit, &entry, now);
	}
	if (found->fresh_key || found->wrong_end) {
		entry.text =
			found->fresh_key ?
				"the key was missing: what is before cannot be verified any "
				"more" :
				"the last record does not fit: it or the key was changed while "
				"the service did not run";
		db_log(&audit->log, now, DB_EVENT_AUDIT_UNKEPT, NULL, "the audit trail: %s",
		       entry.text);
		(void)db_audit_post(audit, &entry, now);
	}
}

/* Returns whether the trail is open now. Records get numbers without it, too; what has one by now
 * is only in the journal, and the files' next number is above both. */
static bool open_trail(struct db_audit *audit, struct db_trail_found *found, db_time now)
{
	struct db_trail *trail;
	bool first = audit->open_at == 0;
	uint64_t bytes;
	int error;

	pthread_mutex_lock(&audit->lock);
	bytes = (uint64_t)audit->state.mib * MIB;
	pthread_mutex_unlock(&audit->lock);
	error = db_trail_open(audit->folder, bytes, &trail, found);
	if (error != 0) {
		audit->open_at = now + OPEN_EVERY;
		if (first)
			db_log(&audit->log, now, DB_EVENT_AUDIT_UNKEPT, NULL,
			       "there is no audit trail in %s: %s; records are only in the "
			       "journal",
			       audit->folder, strerror(-error));
	} else {
		audit->open_at = DB_TIME_NEVER;
		audit->sync_at = now;
		audit->trail = trail;
	}
	pthread_mutex_lock(&audit->lock);
	snprintf(audit->state.trouble, sizeof(audit->state.trouble), "%s",
	         error == 0 ? "" : strerror(-error));
	if (error == 0) {
		audit->state.kept = true;
		audit->unkept = audit->state.newest;
		if (audit->state.newest < db_trail_newest(trail))
			audit->state.newest = db_trail_newest(trail);
		/* The record of what is missing takes one number. */
		if (audit->unkept > 0)
			audit->state.newest++;
		audit->state.lost += (uint32_t)audit->unkept;
		audit->kept_above = audit->state.newest;
	}
	pthread_mutex_unlock(&audit->lock);
	if (error == 0 && !first)
		db_log(&audit->log, now, DB_EVENT_AUDIT_KEPT, NULL,
		       "the audit trail in %s is written from now on; %llu records are only in "
		       "the journal",
		       audit->folder, (unsigned long long)audit->unkept);
	return error == 0;
}

/* --- the thread ------------------------------------------------------------------------------- */

static bool next_record(struct db_audit *audit, struct db_audit_taken *taken, db_time *next,
                        bool *ending)
{
	struct db_audit_entry repeated;
	bool any;

	pthread_mutex_lock(&audit->lock);
	any = db_audit_queue_take(&audit->queue, taken);
	if (!any && audit->state.on &&
	    db_floods_due(&audit->floods, db_clock_now(), audit->ending, &repeated)) {
		repeated.time_us = db_clock_wall_us();
		(void)put(audit, &repeated);
		any = db_audit_queue_take(&audit->queue, taken);
	}
	*next = audit->state.on ? db_floods_next(&audit->floods) : DB_TIME_NEVER;
	*ending = audit->ending;
	if (audit->trail)
		audit->state.bytes = db_trail_bytes(audit->trail);
	pthread_mutex_unlock(&audit->lock);
	return any;
}

static void *run(void *context)
{
	struct db_audit *audit = context;
	struct db_audit_taken taken;
	struct db_trail_found found;
	bool ending = false;
	db_time next = 0;
	uint64_t bytes;
	bool changed;

	while (!ending) {
		struct timespec time;

		if (audit->sync_at < next)
			next = audit->sync_at;
		if (audit->open_at < next)
			next = audit->open_at;
		time.tv_sec = (time_t)(next / DB_NS_PER_S);
		time.tv_nsec = (long)(next % DB_NS_PER_S);
		if (next == DB_TIME_NEVER)
			sem_wait(&audit->wake);
		else
			sem_clockwait(&audit->wake, CLOCK_MONOTONIC, &time);
		/* A size that is less than before costs files, and the disk may take its time. */
		pthread_mutex_lock(&audit->lock);
		changed = audit->changed;
		bytes = (uint64_t)audit->state.mib * MIB;
		audit->changed = false;
		pthread_mutex_unlock(&audit->lock);
		if (changed && audit->trail)
			db_trail_set_bytes(audit->trail, bytes);
		if (db_clock_now() >= audit->open_at && open_trail(audit, &found, db_clock_now()))
			tell_damage(audit, &found, db_clock_now());
		/* A reader waits for some records at most. */
		for (unsigned i = 0; i < WRITTEN_AT_ONCE; i++) {
			if (!next_record(audit, &taken, &next, &ending))
				break;
			write_record(audit, &taken.entry);
			next = i + 1 == WRITTEN_AT_ONCE ? 0 : next;
			ending = false;
		}
		serve_reader(audit);
		if (audit->trail && (db_clock_now() >= audit->sync_at || ending)) {
			int error = db_trail_sync(audit->trail);

			if (error != 0 || audit->unsynced)
				note_trouble(audit, error);
			audit->unsynced = error != 0;
			audit->sync_at = DB_TIME_NEVER;
		}
	}
	return NULL;
}

/* --- beginning and end ------------------------------------------------------------------------ */

static void pass_on(void *context, const struct db_lines *lines, json_t *object, const char *text,
                    size_t length, const char *why)
{
	const struct db_audit_setup *setup = context;
	struct db_audit_entry entry;
	struct db_audit_value value;

	(void)lines;
	(void)text;
	(void)length;
	/* What somebody has changed is no history. */
	if (!why && object && db_record_read(object, &entry, &value))
		setup->past(setup->context, &entry);
}

static void release(struct db_audit *audit)
{
	db_trail_free(audit->trail);
	free(audit->folder);
	sem_destroy(&audit->wake);
	pthread_mutex_destroy(&audit->lock);
	free(audit);
}

int db_audit_new(const struct db_audit_setup *setup, db_time now, struct db_audit **audit)
{
	struct db_audit *made = calloc(1, sizeof(*made));
	struct db_trail_found found;
	int error;

	if (!made)
		return -ENOMEM;
	error = db_worker_init_lock(&made->lock);
	if (error != 0) {
		free(made);
		return error;
	}
	sem_init(&made->wake, 0, 0);
	made->log = setup->log;
	made->sync_at = DB_TIME_NEVER;
	made->open_at = DB_TIME_NEVER;
	made->state.on = setup->on;
	made->state.mib = setup->mib;
	if (setup->folder) {
		made->open_at = 0;
		made->folder = strdup(setup->folder);
		error = made->folder ? 0 : -ENOMEM;
	}
	if (made->folder && open_trail(made, &found, now)) {
		if (setup->past && setup->on)
			db_trail_read_tail(made->trail, PAST_BYTES, pass_on,
			                   (void *)(uintptr_t)setup);
		tell_damage(made, &found, now);
	}
	if (error == 0)
		error = -pthread_create(&made->thread, NULL, run, made);
	if (error != 0) {
		release(made);
		return error;
	}
	pthread_setname_np(made->thread, "audit");
	*audit = made;
	return 0;
}

bool db_audit_free(struct db_audit *audit)
{
	if (!audit)
		return true;
	pthread_mutex_lock(&audit->lock);
	audit->ending = true;
	pthread_mutex_unlock(&audit->lock);
	sem_post(&audit->wake);
	if (!db_worker_join(audit->thread))
		return false;
	if (audit->reading == READING_DONE)
		free(audit->page.records);
	release(audit);
	return true;
}
