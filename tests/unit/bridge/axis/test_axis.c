/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/axis.h"
#include "drivebridge/command.h"
#include "drivebridge/driver.h"
#include "drivebridge/scale.h"

#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* More than a word of a set has bits. */
#define PARAMS 300

#define HEAD offsetof(struct db_nameplate, param_count)

/* Every byte is the same, so that a mixture of two publications shows. */
static void fill(struct db_nameplate_copy *copy, int byte)
{
	memset(copy, byte, sizeof *copy);
	DB_NAMEPLATE_INIT(&copy->plate, &copy->room, PARAMS);
}

static unsigned count_other_bytes(const void *object, size_t size, int byte)
{
	const unsigned char *bytes = object;
	unsigned others = 0;

	for (size_t i = 0; i < size; i++)
		others += bytes[i] != byte;
	return others;
}

static unsigned count_others(const struct db_nameplate_copy *copy, int byte)
{
	const struct db_nameplate *plate = &copy->plate;
	size_t set = DB_PARAM_WORDS(PARAMS) * sizeof plate->valid[0];

	return count_other_bytes(plate, HEAD, byte) + count_other_bytes(plate->valid, set, byte) +
	       count_other_bytes(plate->missing, set, byte) +
	       count_other_bytes(plate->values, PARAMS * sizeof plate->values[0], byte) +
	       count_other_bytes(plate->told, PARAMS * sizeof plate->told[0], byte);
}

static void starts_offline_and_empty(void **state)
{
	struct db_axis *axis = db_axis_new(PARAMS);
	struct db_snapshot snapshot;
	struct db_nameplate_copy copy;

	(void)state;
	memset(&snapshot, 0xFF, sizeof snapshot);
	memset(&copy, 0xFF, sizeof copy);
	db_axis_read(axis, &snapshot);
	db_axis_read_nameplate(axis, &copy);
	assert_int_equal(snapshot.feedback.state, DB_AXIS_OFFLINE);
	assert_int_equal(snapshot.feedback.taken, 0);
	assert_int_equal(copy.plate.param_count, PARAMS);
	for (size_t i = 0; i < PARAMS; i++)
		assert_false(db_params_have(copy.plate.valid, i));
	assert_int_equal(copy.plate.identity[0], 0);
	db_axis_free(axis);
}

static void what_is_published_is_read(void **state)
{
	struct db_axis *axis = db_axis_new(PARAMS);
	struct db_snapshot in;
	struct db_snapshot out;
	struct db_nameplate_copy plate_in;
	struct db_nameplate_copy plate_out;

	(void)state;
	memset(&in, 0x5A, sizeof in);
	fill(&plate_in, 0x3C);
	db_axis_publish(axis, &in);
	db_axis_publish_nameplate(axis, &plate_in.plate);
	db_axis_read(axis, &out);
	db_axis_read_nameplate(axis, &plate_out);
	assert_memory_equal(&in, &out, sizeof in);
	assert_int_equal(count_others(&plate_out, 0x3C), 0);
	db_axis_free(axis);
}

#define PUBLICATIONS 20000

struct race {
	struct db_axis *axis;
	atomic_bool done;
};

static void *publish_many(void *context)
{
	struct race *race = context;
	struct db_snapshot snapshot;
	struct db_nameplate_copy copy;

	for (unsigned i = 1; i <= PUBLICATIONS; i++) {
		memset(&snapshot, (int)(i & 0xFF), sizeof snapshot);
		fill(&copy, (int)(i & 0xFF));
		db_axis_publish(race->axis, &snapshot);
		db_axis_publish_nameplate(race->axis, &copy.plate);
	}
	atomic_store(&race->done, true);
	return NULL;
}

static void never_tears(void **state)
{
	struct race race = { .axis = db_axis_new(PARAMS) };
	struct db_snapshot snapshot;
	struct db_nameplate_copy copy;
	unsigned torn = 0;
	pthread_t writer;

	(void)state;
	assert_int_equal(pthread_create(&writer, NULL, publish_many, &race), 0);
	while (!atomic_load(&race.done)) {
		db_axis_read(race.axis, &snapshot);
		db_axis_read_nameplate(race.axis, &copy);
		torn += count_other_bytes(&snapshot, sizeof snapshot, *(unsigned char *)&snapshot);
		torn += count_others(&copy, *(unsigned char *)&copy);
	}
	pthread_join(writer, NULL);
	assert_int_equal(torn, 0);
	db_axis_read(race.axis, &snapshot);
	assert_int_equal(*(unsigned char *)&snapshot, PUBLICATIONS & 0xFF);
	db_axis_free(race.axis);
}

/* More than one word of the set of those that are valid. */
#define MANY 130

static void one_parameter_is_read_as_all_are(void **state)
{
	struct db_axis *axis = db_axis_new(MANY);
	struct db_nameplate_copy copy = { .plate.generation = 1 };
	struct db_nameplate *plate = &copy.plate;
	union db_value value;

	(void)state;
	DB_NAMEPLATE_INIT(plate, &copy.room, MANY);
	assert_false(db_axis_read_param(axis, MANY - 1, &value));
	for (size_t i = 0; i < MANY; i++) {
		plate->values[i].u = 0x01020304u * (uint32_t)(i + 1);
		if (i % 3 != 0)
			db_params_add(plate->valid, i);
	}
	for (int doubtful = 0; doubtful < 2; doubtful++) {
		plate->doubtful = doubtful;
		db_axis_publish_nameplate(axis, plate);
		for (size_t i = 0; i < MANY; i++) {
			assert_int_equal(db_axis_read_param(axis, i, &value),
			                 !doubtful && i % 3 != 0);
			assert_int_equal(value.u, plate->values[i].u);
		}
	}
	db_axis_free(axis);
}

/* Only the value 1 is both valid and without a doubt. */
static void *publish_doubts(void *context)
{
	struct race *race = context;
	struct db_nameplate_copy copy = { .plate.generation = 1 };
	struct db_nameplate *plate = &copy.plate;

	DB_NAMEPLATE_INIT(plate, &copy.room, MANY);
	for (unsigned i = 1; i <= PUBLICATIONS; i++) {
		plate->values[MANY - 1].u = i % 3;
		plate->doubtful = i % 3 == 2;
		plate->valid[(MANY - 1) / 64] = i % 3 == 0 ? 0 : UINT64_MAX;
		db_axis_publish_nameplate(race->axis, plate);
	}
	atomic_store(&race->done, true);
	return NULL;
}

static void one_parameter_never_tears(void **state)
{
	struct race race = { .axis = db_axis_new(MANY) };
	union db_value value;
	unsigned torn = 0;
	pthread_t writer;

	(void)state;
	assert_int_equal(pthread_create(&writer, NULL, publish_doubts, &race), 0);
	while (!atomic_load(&race.done))
		torn += db_axis_read_param(race.axis, MANY - 1, &value) && value.u != 1;
	pthread_join(writer, NULL);
	assert_int_equal(torn, 0);
	db_axis_free(race.axis);
}

static void names(void **state)
{
	char text[DB_ERROR_TEXT_MAX];

	(void)state;
	assert_string_equal(db_error_text(NULL, DB_ERROR_VOLTAGE, text), "voltage");
	assert_string_equal(db_error_text(NULL, 5, text), "5 (hex 0005)");
	assert_string_equal(db_axis_state_name(DB_AXIS_OFFLINE), "Offline");
	assert_string_equal(db_axis_state_name(DB_AXIS_ERROR_STOP), "ErrorStop");
	assert_string_equal(db_axis_state_name(DB_AXIS_STATE_COUNT), "unknown");
	assert_string_equal(db_error_name(NULL, DB_ERROR_NONE), "none");
	assert_string_equal(db_error_name(NULL, DB_ERROR_VOLTAGE), "voltage");
	assert_string_equal(db_error_name(NULL, DB_ERROR_RUNS_ON), "runs_on");
	assert_string_equal(db_error_name(NULL, 5), "unknown");
	assert_string_equal(db_error_name(NULL, UINT16_MAX), "unknown");
	assert_string_equal(db_status_bit_name(0), "online");
	assert_int_equal(DB_STATUS_MUST_STAND, 1u << (DB_STATUS_BIT_COUNT - 1));
	assert_string_equal(db_status_bit_name(DB_STATUS_BIT_COUNT - 1), "must_stand");
	assert_string_equal(db_status_bit_name(DB_STATUS_BIT_COUNT), "unknown");
}

static void kinds_of_commands(void **state)
{
	static const enum db_command motions[] = { DB_CMD_MOVE_VELOCITY,    DB_CMD_MOVE_ABSOLUTE,
		                                   DB_CMD_MOVE_RELATIVE,    DB_CMD_HOME,
		                                   DB_CMD_MOVE_PRESET,      DB_CMD_SHAKE_START,
		                                   DB_CMD_SHAKE_START_TIME, DB_CMD_MOVE_CURRENT,
		                                   DB_CMD_SYNC_START,       DB_CMD_JOG_POSITIVE,
		                                   DB_CMD_JOG_NEGATIVE,     DB_CMD_START_PROGRAM,
		                                   DB_CMD_CONTINUE_PROGRAM };
	unsigned motion_count = 0;
	unsigned stop_count = 0;

	(void)state;
	assert_true(db_command_is_stop(DB_CMD_STOP));
	assert_true(db_command_is_stop(DB_CMD_QUICK_STOP));
	assert_true(db_command_is_stop(DB_CMD_DISABLE));
	for (size_t i = 0; i < sizeof motions / sizeof motions[0]; i++)
		assert_true(db_command_is_motion(motions[i]));
	for (unsigned code = 0; code < DB_CMD_LIMIT; code++) {
		motion_count += db_command_is_motion((enum db_command)code);
		stop_count += db_command_is_stop((enum db_command)code);
	}
	assert_int_equal(motion_count, sizeof motions / sizeof motions[0]);
	assert_int_equal(stop_count, 3);
}

static void what_ends_a_motion(void **state)
{
	static const enum db_command stays[] = { DB_CMD_NONE,         DB_CMD_ENABLE,
		                                 DB_CMD_SET_POSITION, DB_CMD_CLEAR_FAULT,
		                                 DB_CMD_SET_OUTPUT,   DB_CMD_READ_PARAMETERS,
		                                 DB_CMD_END_PROGRAM };

	(void)state;
	for (unsigned code = 0; code < DB_CMD_LIMIT; code++) {
		enum db_command command = (enum db_command)code;

		if (db_command_is_motion(command) || db_command_is_stop(command))
			assert_true(db_command_ends_motion(command));
	}
	assert_true(db_command_ends_motion(DB_CMD_HOME_STOP));
	assert_true(db_command_ends_motion(DB_CMD_SHAKE_STOP));
	for (size_t i = 0; i < sizeof stays / sizeof stays[0]; i++)
		assert_false(db_command_ends_motion(stays[i]));
}

/* It is told again as it was, to 10 ms, also when the count has begun again from 0. */
static void when_parameters_were_told(void **state)
{
	const db_time round = (db_time)UINT32_MAX * DB_TOLD_UNIT + DB_TOLD_UNIT;
	const db_time day = 24 * 3600 * DB_NS_PER_S;
	static const db_time ago[] = { 0, 10, 250, 3600000, INT64_C(496) * 24 * 3600000 };

	(void)state;
	for (db_time now = 2 * round - 3 * day; now < 2 * round + 3 * day; now += day / 7) {
		for (size_t i = 0; i < sizeof ago / sizeof ago[0]; i++) {
			db_time moment = now - ago[i] * DB_NS_PER_MS;
			db_time told = db_told_time(db_told_at(moment), now);

			assert_in_range(told - moment + 2 * DB_TOLD_UNIT, 0, 4 * DB_TOLD_UNIT);
			assert_true(told <= now);
		}
		/* Another thread was a little later. */
		assert_int_equal(db_told_time(db_told_at(now + DB_NS_PER_S / 2), now), now);
		assert_true(db_told_after(db_told_at(now + DB_NS_PER_S), db_told_at(now)));
		assert_false(db_told_after(db_told_at(now), db_told_at(now)));
		assert_false(db_told_after(db_told_at(now), db_told_at(now + DB_NS_PER_S)));
	}
	assert_int_equal(db_told_time(0, 5 * day), 0);
	assert_int_not_equal(db_told_at(2 * round), 0);
}

/* The drive's own, where it reports it and nothing else is configured. */
static void the_unit_of_a_position(void **state)
{
	const struct db_driver plain = { .name = "plain" };
	const struct db_driver scaled = { .name = "scaled", .scale_unit = "mm" };
	struct db_drive_config drive = { .unit_name = (char *)"deg", .counts_per_unit = 3.0 };
	struct db_feedback feedback = { .counts_per_unit = 0.0f };

	(void)state;
	assert_string_equal(db_scale_unit(&plain, &drive), "deg");
	assert_string_equal(db_scale_unit(&scaled, &drive), "mm");
	assert_true(db_scale_is_open(&scaled, &drive, &feedback));
	assert_false(db_scale_is_open(&plain, &drive, &feedback));
	assert_true(db_scale_counts(&drive, &feedback) > 2.9 &&
	            db_scale_counts(&drive, &feedback) < 3.1);
	feedback.counts_per_unit = 640.0f;
	assert_false(db_scale_is_open(&scaled, &drive, &feedback));
	assert_true(db_scale_counts(&drive, &feedback) > 639.0);
	drive.unit_given = true;
	assert_string_equal(db_scale_unit(&scaled, &drive), "deg");
	drive.unit_given = false;
	drive.counts_given = true;
	assert_string_equal(db_scale_unit(&scaled, &drive), "deg");
	assert_true(db_scale_counts(&drive, &feedback) < 3.1);
	feedback.counts_per_unit = 0.0f;
	assert_false(db_scale_is_open(&scaled, &drive, &feedback));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(starts_offline_and_empty),
		cmocka_unit_test(what_is_published_is_read),
		cmocka_unit_test(never_tears),
		cmocka_unit_test(one_parameter_is_read_as_all_are),
		cmocka_unit_test(one_parameter_never_tears),
		cmocka_unit_test(names),
		cmocka_unit_test(the_unit_of_a_position),
		cmocka_unit_test(kinds_of_commands),
		cmocka_unit_test(what_ends_a_motion),
		cmocka_unit_test(when_parameters_were_told),
	};

	return cmocka_run_group_tests_name("axis", tests, NULL, NULL);
}
