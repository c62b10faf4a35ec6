/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/history.h"

#include "regmap/commands.h"

#include <string.h>

static size_t place_of(uint32_t sequence)
{
	return (sequence - 1) % DB_HISTORY_MAX;
}

/* The newest entry is the same refusal of the same request of the same client. */
static bool is_again(const struct db_history *history, const struct db_history_entry *entry)
{
	const struct db_history_entry *last = db_history_get(history, 0);

	return last && history->parts[place_of(history->count)].ticket == 0 &&
	       last->result == entry->result && last->command == entry->command &&
	       last->command_id == entry->command_id && last->number == entry->number &&
	       last->position == entry->position && last->position_2 == entry->position_2 &&
	       !(last->real < entry->real) && !(last->real > entry->real) &&
	       last->value == entry->value &&
	       memcmp(last->address, entry->address, sizeof last->address) == 0;
}

static void count_repeat(struct db_history_entry *entry)
{
	if (entry->repeats < UINT16_MAX)
		entry->repeats++;
}

void db_history_add(struct db_history *history, const struct db_history_entry *entry,
                    uint32_t ticket, db_time now)
{
	size_t place;

	if (ticket == 0 && db_result_exception((enum db_result)entry->result) != 0 &&
	    is_again(history, entry)) {
		count_repeat(&history->entries[place_of(history->count)]);
		return;
	}
	/* Never 0, which is no entry, even after 2^32 of them. */
	if (++history->count == 0)
		history->count = DB_HISTORY_MAX;
	place = place_of(history->count);
	history->entries[place] = *entry;
	history->entries[place].sequence = history->count;
	history->parts[place] = (struct db_history_part){ .ticket = ticket, .arrived = now };
}

/* Null when the entry was overwritten meanwhile. */
static struct db_history_entry *find(struct db_history *history, uint32_t ticket, size_t *place)
{
	for (*place = 0; ticket != 0 && *place < DB_HISTORY_MAX; (*place)++) {
		if (history->parts[*place].ticket == ticket)
			return &history->entries[*place];
	}
	return NULL;
}

void db_history_repeat(struct db_history *history, uint32_t ticket)
{
	size_t place;
	struct db_history_entry *entry = find(history, ticket, &place);

	if (entry)
		count_repeat(entry);
}

void db_history_retarget(struct db_history *history, uint32_t ticket, uint32_t to)
{
	size_t place;

	if (find(history, ticket, &place))
		history->parts[place].ticket = to;
}

void db_history_end(struct db_history *history, uint32_t ticket, enum db_result result, db_time end)
{
	size_t place;
	struct db_history_entry *entry = find(history, ticket, &place);
	db_time took;

	if (!entry)
		return;
	took = (end - history->parts[place].arrived) / DB_NS_PER_US;
	entry->result = (uint16_t)result;
	entry->duration_us = took < 0 ? 0 : took > UINT32_MAX ? UINT32_MAX : (uint32_t)took;
}

const struct db_history_entry *db_history_get(const struct db_history *history, size_t age)
{
	if (age >= DB_HISTORY_MAX || age >= history->count)
		return NULL;
	return &history->entries[place_of(history->count - (uint32_t)age)];
}

void db_history_args(struct db_history_entry *entry, unsigned code, const struct db_args *args)
{
	const struct db_command_row *row = db_command_find(code);

	for (size_t i = 0; row && i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		const char *from = (const char *)args + db_arg_offset(row->args[i]);
		uint16_t narrow;

		memcpy(&narrow, from, sizeof narrow);
		switch (row->args[i]) {
		case DB_ARG_TARGET_POSITION:
		case DB_ARG_SHAKE_START_POSITION:
			memcpy(&entry->position, from, sizeof entry->position);
			break;
		case DB_ARG_SHAKE_END_POSITION:
			memcpy(&entry->position_2, from, sizeof entry->position_2);
			break;
		case DB_ARG_TARGET_VELOCITY:
		case DB_ARG_TARGET_CURRENT:
		case DB_ARG_SHAKE_FREQUENCY:
			memcpy(&entry->real, from, sizeof entry->real);
			break;
		case DB_ARG_SHAKE_CYCLES:
		case DB_ARG_SHAKE_TIME:
			memcpy(&entry->value, from, sizeof entry->value);
			break;
		case DB_ARG_OUTPUT_NUMBER:
		case DB_ARG_OUTPUT_MASK:
		case DB_ARG_PROGRAM_NUMBER:
			entry->number = narrow;
			break;
		default:
			entry->value = narrow;
			break;
		}
	}
}
