/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/rows.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>

static void write_row(struct db_ctl_rows *rows, const json_t *sample)
{
	json_int_t since = db_words_number(sample, "time_us") - rows->zero_us;

	if (rows->ended)
		return;
	if ((rows->duration_us > 0 && since > rows->duration_us) ||
	    (rows->samples_max > 0 && rows->written >= rows->samples_max)) {
		rows->ended = true;
		return;
	}
	rows->write(rows->context, sample, since);
	rows->written++;
	rows->ended = rows->samples_max > 0 && rows->written >= rows->samples_max;
}

static void forget_oldest(struct db_ctl_rows *rows)
{
	json_decref(rows->held[rows->held_first]);
	rows->held_first = (rows->held_first + 1) % DB_CTL_ROWS_HELD;
	rows->held_count--;
}

static bool hold(struct db_ctl_rows *rows, json_t *sample)
{
	json_int_t from = db_words_number(sample, "time_us") - rows->before_us;

	if (!rows->held)
		rows->held = calloc(DB_CTL_ROWS_HELD, sizeof(*rows->held));
	if (!rows->held)
		return false;
	while (rows->held_count > 0 &&
	       (rows->held_count == DB_CTL_ROWS_HELD ||
	        db_words_number(rows->held[rows->held_first], "time_us") < from))
		forget_oldest(rows);
	rows->held[(rows->held_first + rows->held_count++) % DB_CTL_ROWS_HELD] = json_incref(
		sample);
	return true;
}

bool db_ctl_rows_take(struct db_ctl_rows *rows, json_t *sample)
{
	const char *drive = json_string_value(json_object_get(sample, "drive"));
	bool comes = !rows->trigger_drive;

	/* A drive that never answered has no values. */
	if (rows->ended || db_words_number(sample, "time_us") == 0)
		return true;
	if (rows->begun) {
		write_row(rows, sample);
		return true;
	}
	if (rows->trigger_drive && drive && strcmp(drive, rows->trigger_drive) == 0)
		comes = db_capture_trigger_take(rows->trigger, json_object_get(sample, "values"));
	if (!hold(rows, sample))
		return false;
	if (!comes)
		return true;
	rows->begun = true;
	rows->zero_us = db_words_number(sample, "time_us");
	while (rows->held_count > 0) {
		write_row(rows, rows->held[rows->held_first]);
		forget_oldest(rows);
	}
	return true;
}

void db_ctl_rows_clear(struct db_ctl_rows *rows)
{
	while (rows->held_count > 0)
		forget_oldest(rows);
	free(rows->held);
	rows->held = NULL;
}
