/* SPDX-License-Identifier: Apache-2.0 */
#include "health/health_private.h"

#include <stdlib.h>
#include <string.h>

/*
 * The file, all numbers with the lowest byte first: text "DBALARMS", u16 version, 2 bytes 0,
 * u32 checksum of what follows, u32 count, u64 last_id, u64 last_change; of each alarm: u64 id,
 * change, since, came, gone, acknowledged; u32 times, u8 kind, u8 cause, 2 bytes 0; texts name,
 * detail, by, with zeros behind them.
 */
#define VERSION 1
#define CHECKSUM_AT 12
#define HEAD 36
#define NUMBERS 56
#define RECORD (NUMBERS + DB_HEALTH_NAME_MAX + DB_ALARM_DETAIL_MAX + DB_ALARM_BY_MAX)

/* What comes back within this time is the same alarm, even if it was acknowledged meanwhile. */
#define AGAIN_US (UINT64_C(60) * 1000000)

#define ROOM_FIRST 16

static const uint8_t magic[8] = { 'D', 'B', 'A', 'L', 'A', 'R', 'M', 'S' };

const char *db_alarm_kind_name(enum db_alarm_kind kind)
{
	static const char *const names[] = { "drive", "bus", "configuration" };

	return names[kind];
}

void db_alarms_clear(struct db_alarms *alarms)
{
	free(alarms->list);
	free(alarms->seen);
	*alarms = (struct db_alarms){ .list = NULL };
}

/* Copies a text whole or, if it is too long, up to a letter's end. */
static void copy_text(char *to, const char *text, size_t size)
{
	size_t length = strnlen(text, size - 1);

	if (text[length] != '\0') {
		while (length > 0 && ((unsigned char)text[length] & 0xC0) == 0x80)
			length--;
	}
	memset(to, 0, size);
	memcpy(to, text, length);
}

/* The change is written, soon or with the next interval. */
static void note(struct db_alarms *alarms, struct db_alarm *alarm, bool urgent)
{
	alarm->change = ++alarms->last_change;
	alarms->changed = true;
	alarms->urgent = alarms->urgent || urgent;
}

/* --- coming and going ------------------------------------------------------------------------- */

/* The oldest one that is gone and acknowledged; else the oldest that is gone; else the oldest. */
static size_t find_least(const struct db_alarms *alarms)
{
	size_t gone = SIZE_MAX;

	for (size_t i = 0; i < alarms->count; i++) {
		if (alarms->list[i].gone == 0)
			continue;
		if (alarms->list[i].acknowledged != 0)
			return i;
		if (gone == SIZE_MAX)
			gone = i;
	}
	return gone != SIZE_MAX ? gone : 0;
}

static bool make_room(struct db_alarms *alarms)
{
	size_t room = alarms->room > 0 ? 2 * alarms->room : ROOM_FIRST;
	struct db_alarm *list;
	bool *seen;

	if (alarms->count == DB_ALARMS_MAX) {
		size_t least = find_least(alarms);

		alarms->count--;
		memmove(alarms->list + least, alarms->list + least + 1,
		        (alarms->count - least) * sizeof(*alarms->list));
		memmove(alarms->seen + least, alarms->seen + least + 1,
		        (alarms->count - least) * sizeof(*alarms->seen));
	}
	if (alarms->count < alarms->room)
		return true;
	if (room > DB_ALARMS_MAX)
		room = DB_ALARMS_MAX;
	list = realloc(alarms->list, room * sizeof(*list));
	if (list)
		alarms->list = list;
	seen = realloc(alarms->seen, room * sizeof(*seen));
	if (seen)
		alarms->seen = seen;
	if (!list || !seen)
		return false;
	alarms->room = room;
	return true;
}

void db_alarms_see(struct db_alarms *alarms, const struct db_alarm_seen *seen)
{
	struct db_alarm *alarm = NULL;
	char detail[DB_ALARM_DETAIL_MAX];

	/* The newest alarm about this. */
	for (size_t i = alarms->count; !alarm && i-- > 0;) {
		struct db_alarm *one = &alarms->list[i];

		if (one->cause == seen->cause && one->kind == seen->kind &&
		    strcmp(one->name, seen->name) == 0)
			alarm = one;
	}
	copy_text(detail, seen->detail, sizeof(detail));
	if (alarm && alarm->gone == 0) {
		if (strcmp(alarm->detail, detail) != 0) {
			memcpy(alarm->detail, detail, sizeof(detail));
			note(alarms, alarm, false);
		}
	} else if (alarm &&
	           (alarm->acknowledged == 0 ||
	            (seen->since_us >= alarm->gone && seen->since_us - alarm->gone < AGAIN_US))) {
		/* What comes now is what was there before: nobody has looked at that one, or it has
		 * only just gone. */
		memcpy(alarm->detail, detail, sizeof(detail));
		alarm->came = seen->since_us;
		alarm->gone = 0;
		alarm->acknowledged = 0;
		alarm->by[0] = '\0';
		alarm->times += alarm->times < UINT32_MAX;
		note(alarms, alarm, false);
	} else {
		if (!make_room(alarms))
			return;
		alarm = &alarms->list[alarms->count++];
		*alarm = (struct db_alarm){
			.id = ++alarms->last_id,
			.since = seen->since_us,
			.came = seen->since_us,
			.times = 1,
			.kind = (uint8_t)seen->kind,
			.cause = seen->cause,
		};
		copy_text(alarm->name, seen->name, sizeof(alarm->name));
		memcpy(alarm->detail, detail, sizeof(detail));
		note(alarms, alarm, true);
	}
	alarms->seen[alarm - alarms->list] = true;
}

void db_alarms_end(struct db_alarms *alarms, uint64_t wall_us)
{
	for (size_t i = 0; i < alarms->count; i++) {
		struct db_alarm *alarm = &alarms->list[i];

		if (!alarms->seen[i] && alarm->gone == 0) {
			alarm->gone = wall_us;
			note(alarms, alarm, false);
		}
		alarms->seen[i] = false;
	}
}

const struct db_alarm *db_alarms_acknowledge(struct db_alarms *alarms, uint64_t id,
                                             const char *drive, const char *by, uint64_t wall_us,
                                             bool *fresh)
{
	for (size_t i = 0; i < alarms->count; i++) {
		struct db_alarm *alarm = &alarms->list[i];

		if (alarm->id != id)
			continue;
		/* A tool whose users have some of the drives says of which one the alarm is to
		 * be. */
		if (drive[0] != '\0' &&
		    (alarm->kind != DB_ALARM_DRIVE || strcmp(alarm->name, drive) != 0))
			return NULL;
		*fresh = alarm->acknowledged == 0;
		if (*fresh) {
			alarm->acknowledged = wall_us;
			copy_text(alarm->by, by, sizeof(alarm->by));
			note(alarms, alarm, true);
		}
		return alarm;
	}
	return NULL;
}

/* --- the file --------------------------------------------------------------------------------- */

uint8_t *db_alarms_write(const struct db_alarms *alarms, size_t *size)
{
	uint8_t *bytes = calloc(1, HEAD + alarms->count * RECORD);

	if (!bytes)
		return NULL;
	*size = HEAD + alarms->count * RECORD;
	for (size_t i = 0; i < sizeof(magic); i++)
		bytes[i] = magic[i];
	db_bytes_put(bytes + 8, VERSION, 2);
	db_bytes_put(bytes + 16, alarms->count, 4);
	db_bytes_put(bytes + 20, alarms->last_id, 8);
	db_bytes_put(bytes + 28, alarms->last_change, 8);
	for (size_t i = 0; i < alarms->count; i++) {
		const struct db_alarm *alarm = &alarms->list[i];
		const uint64_t numbers[] = { alarm->id,   alarm->change, alarm->since,
			                     alarm->came, alarm->gone,   alarm->acknowledged };
		uint8_t *at = bytes + HEAD + i * RECORD;
		char *text = (char *)at + NUMBERS;

		for (size_t k = 0; k < sizeof(numbers) / sizeof(numbers[0]); k++)
			db_bytes_put(at + 8 * k, numbers[k], 8);
		db_bytes_put(at + 48, alarm->times, 4);
		at[52] = alarm->kind;
		at[53] = alarm->cause;
		copy_text(text, alarm->name, sizeof(alarm->name));
		text += sizeof(alarm->name);
		copy_text(text, alarm->detail, sizeof(alarm->detail));
		text += sizeof(alarm->detail);
		copy_text(text, alarm->by, sizeof(alarm->by));
	}
	db_bytes_put(bytes + CHECKSUM_AT, db_bytes_crc(bytes + 16, *size - 16), 4);
	return bytes;
}

static void read_text(char *to, const uint8_t **at, size_t size)
{
	memcpy(to, *at, size);
	to[size - 1] = '\0';
	*at += size;
}

bool db_alarms_read(struct db_alarms *alarms, const uint8_t *bytes, size_t size)
{
	uint64_t count;
	uint64_t last = 0;

	if (size < HEAD || memcmp(bytes, magic, sizeof(magic)) != 0 ||
	    db_bytes_get(bytes + 8, 2) != VERSION ||
	    db_bytes_get(bytes + CHECKSUM_AT, 4) != db_bytes_crc(bytes + 16, size - 16))
		return false;
	count = db_bytes_get(bytes + 16, 4);
	if (count > DB_ALARMS_MAX || size != HEAD + count * RECORD)
		return false;
	alarms->last_id = db_bytes_get(bytes + 20, 8);
	alarms->last_change = db_bytes_get(bytes + 28, 8);
	for (size_t i = 0; i < count; i++) {
		const uint8_t *at = bytes + HEAD + i * RECORD;
		struct db_alarm alarm = { .times = (uint32_t)db_bytes_get(at + 48, 4),
			                  .kind = at[52],
			                  .cause = at[53] };
		uint64_t *const numbers[] = { &alarm.id,   &alarm.change, &alarm.since,
			                      &alarm.came, &alarm.gone,   &alarm.acknowledged };

		for (size_t k = 0; k < sizeof(numbers) / sizeof(numbers[0]); k++)
			*numbers[k] = db_bytes_get(at + 8 * k, 8);
		at += NUMBERS;
		read_text(alarm.name, &at, sizeof(alarm.name));
		read_text(alarm.detail, &at, sizeof(alarm.detail));
		read_text(alarm.by, &at, sizeof(alarm.by));
		if (alarm.kind >= DB_ALARM_KIND_COUNT || alarm.id <= last ||
		    alarm.id > alarms->last_id || alarm.change > alarms->last_change ||
		    !make_room(alarms)) {
			db_alarms_clear(alarms);
			return false;
		}
		last = alarm.id;
		alarms->seen[alarms->count] = false;
		alarms->list[alarms->count++] = alarm;
	}
	return true;
}
