/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/positions.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FORM 1

/* --- whether a drive may go there ------------------------------------------------------------- */

const struct db_position_flaw_row db_position_flaws[DB_POSITION_FLAWS] = {
	[DB_POSITION_GOOD] = { "", "" },
	[DB_POSITION_OFFLINE] = { "offline", "the drive does not answer, or is not read yet" },
	[DB_POSITION_OTHER_DRIVE] = { "other_drive",
	                              "it was taught on another drive: teach it again" },
	[DB_POSITION_OTHER_SCALE] = { "other_scale",
	                              "it was taught with other counts per unit: teach it again" },
	[DB_POSITION_ORIGIN_LOST] = { "origin_lost",
	                              "the drive does not know where it stands: home it, or teach "
	                              "it again" },
	[DB_POSITION_OTHER_ORIGIN] = { "other_origin",
	                               "the drive may count from another origin than when it was "
	                               "taught: home it, or teach it again" },
};

enum db_position_flaw db_position_judge(const struct db_position *position,
                                        const struct db_position_drive *drive)
{
	bool same = strcmp(position->origin, drive->origin) == 0;

	if (!drive->online || !drive->identified || !(drive->counts_per_unit > 0.0))
		return DB_POSITION_OFFLINE;
	if (strcmp(position->identity, drive->identity) != 0)
		return DB_POSITION_OTHER_DRIVE;
	if (fabs(position->counts_per_unit - drive->counts_per_unit) >
	    1e-6 * fabs(position->counts_per_unit))
		return DB_POSITION_OTHER_SCALE;
	if (drive->lost)
		return DB_POSITION_ORIGIN_LOST;
	/* Homing finds the same place again. A drive that has homed by itself since has another
	 * origin although nobody commanded it. */
	if (position->homed ? drive->homed : same && !drive->homed)
		return DB_POSITION_GOOD;
	return DB_POSITION_OTHER_ORIGIN;
}

/* --- the list --------------------------------------------------------------------------------- */

void db_positions_clear(struct db_positions *positions)
{
	free(positions->list);
	*positions = (struct db_positions){ .count = 0 };
}

struct db_position *db_positions_find(const struct db_positions *positions, const char *drive,
                                      const char *name)
{
	for (size_t i = 0; i < positions->count; i++) {
		struct db_position *position = &positions->list[i];

		if (strcmp(position->drive, drive) == 0 && strcmp(position->name, name) == 0)
			return position;
	}
	return NULL;
}

int db_positions_put(struct db_positions *positions, const struct db_position *position)
{
	struct db_position *former = db_positions_find(positions, position->drive, position->name);
	struct db_position *more;
	size_t beside = 0;

	if (former) {
		*former = *position;
		return 0;
	}
	for (size_t i = 0; i < positions->count; i++)
		beside += strcmp(positions->list[i].drive, position->drive) == 0;
	if (positions->count >= DB_POSITIONS_MAX || beside >= DB_POSITIONS_OF_DRIVE)
		return -ENOSPC;
	more = realloc(positions->list, (positions->count + 1) * sizeof(*more));
	if (!more)
		return -ENOMEM;
	positions->list = more;
	more[positions->count++] = *position;
	return 0;
}

bool db_positions_remove(struct db_positions *positions, const char *drive, const char *name)
{
	struct db_position *position = db_positions_find(positions, drive, name);
	size_t after;

	if (!position)
		return false;
	after = positions->count - (size_t)(position - positions->list) - 1;
	memmove(position, position + 1, after * sizeof(*position));
	positions->count--;
	return true;
}

/* --- its text --------------------------------------------------------------------------------- */

char *db_positions_write(const struct db_positions *positions)
{
	json_t *list = json_array();
	json_t *whole = json_pack("{s:i, s:o}", "form", FORM, "positions", list);
	char *text = NULL;
	bool good = whole != NULL;

	for (size_t i = 0; good && i < positions->count; i++) {
		const struct db_position *position = &positions->list[i];
		json_t *one = json_pack(
			"{s:s, s:s, s:I, s:f, s:s, s:s, s:b, s:I, s:s}", "drive", position->drive,
			"name", position->name, "counts", (json_int_t)position->counts,
			"counts_per_unit", position->counts_per_unit, "identity",
			position->identity, "origin", position->origin, "homed", position->homed,
			"taught_us", (json_int_t)position->taught_us, "by", position->by);

		/* Without memory the former file is better than a part of the list. */
		good = one && json_array_append_new(list, one) == 0;
	}
	if (good)
		text = json_dumps(whole, JSON_INDENT(1));
	json_decref(whole);
	if (text) {
		size_t length = strlen(text);
		char *longer = realloc(text, length + 2);

		if (!longer)
			free(text);
		text = longer;
		if (text)
			memcpy(text + length, "\n", 2);
	}
	return text;
}

static bool take_text(const json_t *json, const char *name, char *text, size_t size)
{
	const char *value = json_string_value(json_object_get(json, name));

	if (!value || strlen(value) >= size)
		return false;
	memcpy(text, value, strlen(value) + 1);
	return true;
}

static bool take_position(const json_t *json, struct db_position *position)
{
	const json_t *counts = json_object_get(json, "counts");
	const json_t *scale = json_object_get(json, "counts_per_unit");
	const json_t *homed = json_object_get(json, "homed");
	const json_t *taught = json_object_get(json, "taught_us");

	*position = (struct db_position){
		.counts = (int32_t)json_integer_value(counts),
		.counts_per_unit = json_number_value(scale),
		.homed = json_is_true(homed),
		.taught_us = (uint64_t)json_integer_value(taught),
	};
	return json_is_integer(counts) && json_integer_value(counts) == position->counts &&
	       json_is_number(scale) && position->counts_per_unit > 0.0 && json_is_boolean(homed) &&
	       json_is_integer(taught) && json_integer_value(taught) >= 0 &&
	       take_text(json, "drive", position->drive, sizeof(position->drive)) &&
	       take_text(json, "name", position->name, sizeof(position->name)) &&
	       take_text(json, "identity", position->identity, sizeof(position->identity)) &&
	       take_text(json, "origin", position->origin, sizeof(position->origin)) &&
	       take_text(json, "by", position->by, sizeof(position->by)) &&
	       position->drive[0] != '\0' && position->name[0] != '\0';
}

int db_positions_read(struct db_positions *positions, const char *text)
{
	json_t *whole = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
	const json_t *list = json_object_get(whole, "positions");
	bool known = json_integer_value(json_object_get(whole, "form")) == FORM;
	int error = known && json_is_array(list) ? 0 : -EINVAL;
	struct db_position position;
	size_t i;
	const json_t *one;

	json_array_foreach(list, i, one)
	{
		if (error == 0)
			error = take_position(one, &position) ?
			                db_positions_put(positions, &position) :
			                -EINVAL;
	}
	json_decref(whole);
	if (error == 0)
		return 0;
	db_positions_clear(positions);
	return error == -ENOMEM ? error : -EINVAL;
}
