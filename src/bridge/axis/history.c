/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include "drivebridge/command_table.h"

#include <string.h>

/* Null when it was overwritten meanwhile, or is none. */
static struct db_history_kept *find_kept(struct db_history *history, uint32_t number)
{
	uint32_t age = history->count - number;

	/* From before the numbering started again. */
	if (number > history->count)
		age -= DB_HISTORY_MAX;
	if (number == 0 || age >= DB_HISTORY_MAX)
		return NULL;
	return &history->entries[number % DB_HISTORY_MAX];
}

/* True if the newest entry is the same refusal of the same request of the same client. */
static bool is_same_refusal(const struct db_history_kept *last,
                            const struct db_history_entry *entry)
{
	return !last->bus && last->result == entry->result && last->command == entry->command &&
	       last->command_id == entry->command_id && last->number == entry->number &&
	       last->position == entry->position && last->position_2 == entry->position_2 &&
	       !(last->real < entry->real) && !(last->real > entry->real) &&
	       last->value == entry->value &&
	       memcmp(last->address, entry->address, sizeof(last->address)) == 0;
}

uint32_t db_history_add(struct db_history *history, const struct db_history_entry *entry, bool bus)
{
	struct db_history_kept *last = find_kept(history, history->count);
	struct db_history_kept kept = {
		.timestamp_us = entry->timestamp_us,
		.position = entry->position,
		.position_2 = entry->position_2,
		.real = entry->real,
		.value = entry->value,
		.port = entry->port,
		.command_id = entry->command_id,
		.command = entry->command,
		.number = entry->number,
		.result = (uint8_t)entry->result,
		.bus = bus,
	};

	memcpy(kept.address, entry->address, sizeof(kept.address));
	if (last && !bus && !db_result_is_success((enum db_result)entry->result) &&
	    is_same_refusal(last, entry)) {
		if (last->repeats < UINT16_MAX)
			last->repeats++;
		return history->count;
	}
	/* Never 0, which is no entry, even after 2^32 of them. */
	if (++history->count == 0)
		history->count = DB_HISTORY_MAX;
	history->entries[history->count % DB_HISTORY_MAX] = kept;
	return history->count;
}

void db_history_repeat(struct db_history *history, uint32_t number)
{
	struct db_history_kept *kept = find_kept(history, number);

	if (kept && kept->repeats < UINT16_MAX)
		kept->repeats++;
}

void db_history_end(struct db_history *history, uint32_t number, enum db_result result,
                    db_time took)
{
	struct db_history_kept *kept = find_kept(history, number);

	if (!kept)
		return;
	kept->result = (uint8_t)result;
	kept->duration_us = db_time_us32(took);
}

void db_history_recall(struct db_history *history, const struct db_history_entry *entry)
{
	struct db_history_kept *kept = find_kept(history, db_history_add(history, entry, true));

	if (!kept)
		return;
	kept->repeats = entry->repeats;
	kept->duration_us = entry->duration_us;
}

bool db_history_get(const struct db_history *history, size_t age, struct db_history_entry *entry)
{
	const struct db_history_kept *kept;

	if (age >= DB_HISTORY_MAX || age >= history->count)
		return false;
	entry->sequence = history->count - (uint32_t)age;
	kept = &history->entries[entry->sequence % DB_HISTORY_MAX];
	entry->timestamp_us = kept->timestamp_us;
	memcpy(entry->address, kept->address, sizeof(entry->address));
	entry->port = kept->port;
	entry->command_id = kept->command_id;
	entry->command = kept->command;
	entry->result = kept->result;
	entry->duration_us = kept->duration_us;
	entry->repeats = kept->repeats;
	entry->number = kept->number;
	entry->position = kept->position;
	entry->position_2 = kept->position_2;
	entry->real = kept->real;
	entry->value = kept->value;
	return true;
}

void db_history_args(struct db_history_entry *entry, unsigned code, const struct db_args *args)
{
	const struct db_command_row *row = db_command_find(code);

	for (size_t i = 0; row && i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		const char *from = (const char *)args + db_arg_rows[row->args[i]].offset;
		uint16_t narrow;

		memcpy(&narrow, from, sizeof(narrow));
		switch (row->args[i]) {
		case DB_ARG_TARGET_POSITION:
		case DB_ARG_SHAKE_START_POSITION:
			memcpy(&entry->position, from, sizeof(entry->position));
			break;
		case DB_ARG_SHAKE_END_POSITION:
			memcpy(&entry->position_2, from, sizeof(entry->position_2));
			break;
		case DB_ARG_TARGET_VELOCITY:
		case DB_ARG_TARGET_CURRENT:
		case DB_ARG_SHAKE_FREQUENCY:
			memcpy(&entry->real, from, sizeof(entry->real));
			break;
		case DB_ARG_SHAKE_CYCLES:
		case DB_ARG_SHAKE_TIME:
			memcpy(&entry->value, from, sizeof(entry->value));
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
