/* SPDX-License-Identifier: Apache-2.0 */
#include "log/repeat.h"

#include "log/event.h"

#define PERIOD (DB_REPEAT_PERIOD_S * DB_NS_PER_S)

enum db_repeat_verdict db_repeats_pass(struct db_repeats *repeats,
                                       const struct db_log_record *record, db_time now)
{
	const struct db_event_kind *kind = db_event_kind(record->event);
	struct db_repeat *entry = NULL;
	struct db_repeat *oldest = &repeats->entries[0];

	if (kind->most == 0)
		return DB_REPEAT_LOGGED;
	/* The subject's entry, else a free one, else the oldest. */
	for (size_t i = 0; i < DB_REPEATS_MAX && !entry; i++) {
		struct db_repeat *one = &repeats->entries[i];

		if (one->since != 0 && one->subject == record->subject)
			entry = one;
		if (one->since < oldest->since)
			oldest = one;
	}
	if (!entry) {
		entry = oldest;
		*entry = (struct db_repeat){ .subject = record->subject };
	}
	if (entry->since == 0 || (now >= entry->since + PERIOD && entry->withheld == 0)) {
		entry->since = now;
		entry->logged = entry->kept = 0;
	}
	if (entry->logged < kind->most) {
		entry->logged++;
		entry->kept++;
		return DB_REPEAT_LOGGED;
	}
	entry->withheld++;
	repeats->newest[entry - repeats->entries] = *record;
	if (entry->kept < kind->kept) {
		entry->kept++;
		return DB_REPEAT_KEPT;
	}
	entry->unkept++;
	return DB_REPEAT_COUNTED;
}

db_time db_repeats_next(const struct db_repeats *repeats)
{
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i < DB_REPEATS_MAX; i++) {
		const struct db_repeat *entry = &repeats->entries[i];

		if (entry->since != 0 && entry->since + PERIOD < next)
			next = entry->since + PERIOD;
	}
	return next;
}

bool db_repeats_due(struct db_repeats *repeats, db_time now, bool all, struct db_log_record *record,
                    uint32_t *unkept)
{
	for (size_t i = 0; i < DB_REPEATS_MAX; i++) {
		struct db_repeat *entry = &repeats->entries[i];

		if (entry->since == 0 || (now < entry->since + PERIOD && !all))
			continue;
		if (entry->withheld == 0) {
			entry->since = 0; /* a quiet minute: the next one is logged again */
			continue;
		}
		*record = repeats->newest[i];
		db_log_record_add_count(record, entry->withheld,
		                        (uint32_t)((now - entry->since) / DB_NS_PER_S));
		*unkept = entry->unkept;
		entry->withheld = entry->unkept = 0;
		entry->kept = 0;
		entry->since = now;
		return true;
	}
	return false;
}
