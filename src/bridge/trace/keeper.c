/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/trace_keeper.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A bus whose trace is watched. */
struct watched {
	char bus[DB_TRACE_NAME_MAX + 1];
	const struct db_trace *trace;
	uint32_t troubles;           /* number seen so far */
	struct db_trace_place place; /* after what was kept */
	db_time due;                 /* when it is to be kept; DB_TIME_NEVER */
	bool noted;                  /* because of `cause`, which is not in the trace */
	struct db_trace_cause cause;
};

struct db_trace_keeper {
	struct watched *watched;
	size_t watched_count;
	uint32_t last;
	struct db_trace_kept kept[DB_TRACES_KEPT];
	size_t kept_count;
};

struct db_trace_keeper *db_trace_keeper_new(void)
{
	return calloc(1, sizeof(struct db_trace_keeper));
}

void db_trace_keeper_free(struct db_trace_keeper *keeper)
{
	if (!keeper)
		return;
	for (size_t i = 0; i < keeper->kept_count; i++)
		db_trace_free(keeper->kept[i].trace);
	free(keeper->watched);
	free(keeper);
}

/* --- trouble ---------------------------------------------------------------------------------- */

/* Null when out of memory: then none of its traces is kept. */
static struct watched *watch(struct db_trace_keeper *keeper, const char *bus,
                             const struct db_trace *trace)
{
	struct watched *grown;

	for (size_t i = 0; i < keeper->watched_count; i++) {
		if (keeper->watched[i].trace == trace)
			return &keeper->watched[i];
	}
	grown = realloc(keeper->watched, (keeper->watched_count + 1) * sizeof(*grown));
	if (!grown)
		return NULL;
	keeper->watched = grown;
	grown += keeper->watched_count++;
	*grown = (struct watched){ .trace = trace, .due = DB_TIME_NEVER };
	snprintf(grown->bus, sizeof(grown->bus), "%s", bus);
	return grown;
}

void db_trace_keeper_look(struct db_trace_keeper *keeper, const char *bus,
                          const struct db_trace *trace, db_time now)
{
	struct watched *watched = watch(keeper, bus, trace);
	uint32_t troubles = db_trace_troubles(trace);

	if (!watched || troubles == watched->troubles)
		return;
	watched->troubles = troubles;
	if (watched->due == DB_TIME_NEVER)
		watched->due = now + DB_TRACE_AFTER;
}

void db_trace_keeper_note(struct db_trace_keeper *keeper, const char *bus,
                          const struct db_trace *trace, const struct db_trace_cause *cause,
                          db_time now)
{
	struct watched *watched = watch(keeper, bus, trace);

	if (!watched)
		return;
	/* The first event is the cause that is recorded. */
	if (!watched->noted)
		watched->cause = *cause;
	watched->noted = true;
	if (watched->due == DB_TIME_NEVER)
		watched->due = now + DB_TRACE_AFTER;
}

/* --- keeping ---------------------------------------------------------------------------------- */

/* The trace to be replaced: where a bus has enough, the oldest of those with the same cause, so
 * that repeated events do not displace single ones. kept_count: there is room. */
static size_t find_dispensable(const struct db_trace_keeper *keeper, const char *bus,
                               const struct db_trace_cause *cause)
{
	size_t first = keeper->kept_count;
	size_t alike = keeper->kept_count;
	size_t count = 0;

	for (size_t i = keeper->kept_count; i-- > 0;) {
		if (strcmp(keeper->kept[i].bus, bus) != 0)
			continue;
		count++;
		first = i;
		if (keeper->kept[i].cause.event == cause->event &&
		    strcmp(keeper->kept[i].cause.drive, cause->drive) == 0)
			alike = i;
	}
	if (count >= DB_TRACES_KEPT_EACH)
		return alike < keeper->kept_count ? alike : first;
	return keeper->kept_count == DB_TRACES_KEPT ? 0 : keeper->kept_count;
}

/* The first trouble that was not kept yet, unless the noted one was earlier. */
static void find_cause(struct watched *watched)
{
	struct db_trace_record record;
	struct db_trace_cause found;
	uint32_t missed;

	while (db_trace_read(watched->trace, &watched->place, &record, &missed)) {
		if (record.kind != DB_TRACE_EVENT)
			continue;
		found.event = db_trace_event_of(&record, found.drive);
		found.time = record.time;
		if (db_trace_is_trouble(found.event) &&
		    (watched->cause.time == 0 || found.time < watched->cause.time))
			watched->cause = found;
	}
}

static void keep(struct db_trace_keeper *keeper, struct watched *watched, int64_t wall_offset)
{
	struct db_trace_record extra = { .kind = DB_TRACE_EVENT,
		                         .time = watched->cause.time,
		                         .length = 1 + strlen(watched->cause.drive) };
	struct db_trace_kept kept = { .wall_offset = wall_offset };
	bool noted = watched->noted;
	size_t place;

	extra.bytes[0] = (uint8_t)watched->cause.event;
	memcpy(extra.bytes + 1, watched->cause.drive, extra.length - 1);
	find_cause(watched);
	kept.cause = watched->cause;
	kept.trace = db_trace_copy(watched->trace, noted ? &extra : NULL);
	watched->due = DB_TIME_NEVER;
	watched->noted = false;
	watched->cause = (struct db_trace_cause){ .time = 0 };
	/* Out of memory, or the cause was overwritten already: there is nothing to show. */
	if (!kept.trace || kept.cause.time == 0) {
		db_trace_free(kept.trace);
		return;
	}
	place = find_dispensable(keeper, watched->bus, &kept.cause);
	if (place < keeper->kept_count) {
		db_trace_free(keeper->kept[place].trace);
		keeper->kept_count--;
		memmove(&keeper->kept[place], &keeper->kept[place + 1],
		        (keeper->kept_count - place) * sizeof(keeper->kept[0]));
	}
	kept.number = ++keeper->last;
	memcpy(kept.bus, watched->bus, sizeof(kept.bus));
	keeper->kept[keeper->kept_count++] = kept;
}

void db_trace_keeper_leave(struct db_trace_keeper *keeper, const struct db_trace *trace,
                           int64_t wall_offset)
{
	for (size_t i = keeper->watched_count; i-- > 0;) {
		struct watched *watched = &keeper->watched[i];

		if (watched->trace != trace)
			continue;
		if (watched->due != DB_TIME_NEVER)
			keep(keeper, watched, wall_offset);
		*watched = keeper->watched[--keeper->watched_count];
	}
}

db_time db_trace_keeper_next(const struct db_trace_keeper *keeper)
{
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i < keeper->watched_count; i++)
		next = keeper->watched[i].due < next ? keeper->watched[i].due : next;
	return next;
}

void db_trace_keeper_run(struct db_trace_keeper *keeper, db_time now, int64_t wall_offset)
{
	for (size_t i = 0; i < keeper->watched_count; i++) {
		if (now >= keeper->watched[i].due)
			keep(keeper, &keeper->watched[i], wall_offset);
	}
}

const struct db_trace_kept *db_trace_keeper_at(const struct db_trace_keeper *keeper, size_t place)
{
	return place < keeper->kept_count ? &keeper->kept[place] : NULL;
}
