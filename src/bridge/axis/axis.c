/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/axis.h"

#include "drivebridge/driver.h"
#include "drivebridge/scale.h"
#include "drivebridge/seqlock.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HEAD_BYTES offsetof(struct db_nameplate, param_count)

/*
 * Two publications, because the nameplate is large and seldom changes: cyclic readers need not copy
 * it. That of the nameplate has the pieces of struct db_nameplate one after the other.
 */
struct db_axis {
	atomic_uint snapshot_sequence;
	atomic_uint nameplate_sequence;
	size_t param_count;
	db_seqlock_word snapshot[DB_SEQLOCK_WORDS(struct db_snapshot)];
	db_seqlock_word nameplate[];
};

/* Where the pieces are, in words. */
struct places {
	size_t valid;
	size_t missing;
	size_t values;
	size_t told;
	size_t end;
};

static struct places places_of(size_t param_count)
{
	size_t set = DB_PARAM_WORDS(param_count) * sizeof(uint64_t);
	struct places places = { .valid = DB_SEQLOCK_WORDS_OF(HEAD_BYTES) };

	places.missing = places.valid + DB_SEQLOCK_WORDS_OF(set);
	places.values = places.missing + DB_SEQLOCK_WORDS_OF(set);
	places.told = places.values + DB_SEQLOCK_WORDS_OF(param_count * sizeof(union db_value));
	places.end = places.told + DB_SEQLOCK_WORDS_OF(param_count * sizeof(uint32_t));
	return places;
}

struct db_axis *db_axis_new(size_t param_count)
{
	struct db_axis *axis = calloc(1, sizeof(*axis) + places_of(param_count).end *
	                                                         sizeof(axis->nameplate[0]));

	if (axis)
		axis->param_count = param_count;
	return axis;
}

void db_axis_free(struct db_axis *axis)
{
	free(axis);
}

void db_axis_publish(struct db_axis *axis, const struct db_snapshot *snapshot)
{
	db_seqlock_write(&axis->snapshot_sequence, axis->snapshot, snapshot, sizeof(*snapshot));
}

void db_axis_publish_nameplate(struct db_axis *axis, const struct db_nameplate *nameplate)
{
	size_t count = axis->param_count;
	size_t set = DB_PARAM_WORDS(count) * sizeof(uint64_t);
	struct places at = places_of(count);

	db_seqlock_begin(&axis->nameplate_sequence);
	db_seqlock_store(axis->nameplate, nameplate, HEAD_BYTES);
	db_seqlock_store(axis->nameplate + at.valid, nameplate->valid, set);
	db_seqlock_store(axis->nameplate + at.missing, nameplate->missing, set);
	db_seqlock_store(axis->nameplate + at.values, nameplate->values,
	                 count * sizeof(nameplate->values[0]));
	db_seqlock_store(axis->nameplate + at.told, nameplate->told,
	                 count * sizeof(nameplate->told[0]));
	db_seqlock_end(&axis->nameplate_sequence);
}

void db_axis_read(const struct db_axis *axis, struct db_snapshot *snapshot)
{
	db_seqlock_read(&axis->snapshot_sequence, axis->snapshot, snapshot, sizeof(*snapshot));
}

void db_axis_read_nameplate(const struct db_axis *axis, struct db_nameplate_copy *copy)
{
	size_t count = axis->param_count;
	size_t set = DB_PARAM_WORDS(count) * sizeof(uint64_t);
	struct places at = places_of(count);
	struct db_nameplate *plate = &copy->plate;
	unsigned spins = 0;
	unsigned before;

	DB_NAMEPLATE_INIT(plate, &copy->room, count);
	do {
		before = db_seqlock_wait(&axis->nameplate_sequence, &spins);
		db_seqlock_copy(axis->nameplate, plate, HEAD_BYTES);
		db_seqlock_copy(axis->nameplate + at.valid, plate->valid, set);
		db_seqlock_copy(axis->nameplate + at.missing, plate->missing, set);
		db_seqlock_copy(axis->nameplate + at.values, plate->values,
		                count * sizeof(plate->values[0]));
		db_seqlock_copy(axis->nameplate + at.told, plate->told,
		                count * sizeof(plate->told[0]));
	} while (!db_seqlock_is(&axis->nameplate_sequence, before));
}

bool db_axis_read_param(const struct db_axis *axis, size_t param, union db_value *value)
{
	enum { WORD = sizeof(db_seqlock_word) };
	struct places at = places_of(axis->param_count);
	size_t doubt = offsetof(struct db_nameplate, doubtful);
	size_t place = param * sizeof(*value);
	unsigned char head[WORD];
	unsigned char values[WORD];
	uint64_t valid;
	bool doubtful;
	unsigned spins = 0;
	unsigned before;

	do {
		before = db_seqlock_wait(&axis->nameplate_sequence, &spins);
		db_seqlock_copy(axis->nameplate + doubt / WORD, head, WORD);
		db_seqlock_copy(axis->nameplate + at.valid + param / 64 * (sizeof(valid) / WORD),
		                &valid, sizeof(valid));
		db_seqlock_copy(axis->nameplate + at.values + place / WORD, values, WORD);
	} while (!db_seqlock_is(&axis->nameplate_sequence, before));
	memcpy(&doubtful, head + doubt % WORD, sizeof(doubtful));
	memcpy(value, values + place % WORD, sizeof(*value));
	return !doubtful && (valid >> param % 64 & 1);
}

/* Names of the codes that the axis shows. */

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

static const char *const state_names[DB_AXIS_STATE_COUNT] = {
	[DB_AXIS_OFFLINE] = "Offline",
	[DB_AXIS_DISABLED] = "Disabled",
	[DB_AXIS_STANDSTILL] = "Standstill",
	[DB_AXIS_DISCRETE_MOTION] = "DiscreteMotion",
	[DB_AXIS_CONTINUOUS_MOTION] = "ContinuousMotion",
	[DB_AXIS_HOMING] = "Homing",
	[DB_AXIS_STOPPING] = "Stopping",
	[DB_AXIS_ERROR_STOP] = "ErrorStop",
};

static const char *const error_names[] = {
	[DB_ERROR_NONE] = "none",
	[DB_ERROR_NO_ANSWER] = "no_answer",
	[DB_ERROR_BUS_DOWN] = "bus_down",
	[DB_ERROR_CLIENT_LOSS] = "client_loss",
	[DB_ERROR_RUNS_ON] = "runs_on",
	[DB_ERROR_HARDWARE] = "hardware",
	[DB_ERROR_FLASH] = "flash",
	[DB_ERROR_ENCODER] = "encoder",
	[DB_ERROR_OVER_TEMPERATURE] = "over_temperature",
	[DB_ERROR_OVER_CURRENT] = "over_current",
	[DB_ERROR_VOLTAGE] = "voltage",
	[DB_ERROR_INTERRUPTED] = "interrupted",
	[DB_ERROR_UNEXPLAINED_FAULT] = "unexplained_fault",
};

/*
 * By bit number. They are also the names of discrete inputs, which share one name space with the
 * registers: DB_STATUS_ERROR is error_stop because `error` is a register.
 */
static const char *const status_names[DB_STATUS_BIT_COUNT] = {
	"online",  "enabled",     "homed",          "moving",     "at_target",
	"homing",  "stopping",    "error_stop",     "warning",    "busy",
	"latched", "origin_lost", "params_valid",   "bus_up",     "refused",
	"done",    "aborted",     "params_unsaved", "must_stand",
};

const char *db_axis_state_name(enum db_axis_state state)
{
	return (size_t)state < DB_AXIS_STATE_COUNT ? state_names[state] : "unknown";
}

const char *db_error_name(const struct db_driver *driver, uint16_t error)
{
	const struct db_drive_fault *fault = driver ? db_driver_fault(driver, error) : NULL;

	if (fault)
		return fault->name;
	return error < COUNT_OF(error_names) && error_names[error] ? error_names[error] : "unknown";
}

const char *db_error_text(const struct db_driver *driver, uint16_t error,
                          char text[DB_ERROR_TEXT_MAX])
{
	const char *name = db_error_name(driver, error);

	if (strcmp(name, "unknown") != 0)
		return name;
	snprintf(text, DB_ERROR_TEXT_MAX, "%u (hex %04X)", (unsigned)error, (unsigned)error);
	return text;
}

const char *db_status_bit_name(unsigned bit)
{
	return bit < DB_STATUS_BIT_COUNT ? status_names[bit] : "unknown";
}

double db_scale_counts(const struct db_drive_config *drive, const struct db_feedback *feedback)
{
	if (!drive->counts_given && feedback->counts_per_unit > 0.0f)
		return (double)feedback->counts_per_unit;
	return drive->counts_per_unit;
}

bool db_scale_is_open(const struct db_driver *driver, const struct db_drive_config *drive,
                      const struct db_feedback *feedback)
{
	return driver->scale_unit && !drive->counts_given && !(feedback->counts_per_unit > 0.0f);
}

const char *db_scale_unit(const struct db_driver *driver, const struct db_drive_config *drive)
{
	return driver->scale_unit && !drive->counts_given && !drive->unit_given ?
	               driver->scale_unit :
	               drive->unit_name;
}
