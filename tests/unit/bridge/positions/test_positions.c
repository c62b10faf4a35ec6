/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/positions.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const struct db_position taught = {
	.drive = "feeder",
	.name = "loading place",
	.counts = -2147483647 - 1,
	.counts_per_unit = 640.125,
	.identity = "VSMD 7",
	.origin = "8f3a2c71-1-0-0-0",
	.taught_us = 1790000000123456,
	.by = "control, user anna",
};

static const struct db_position_drive same = {
	.online = true,
	.stands = true,
	.counts_per_unit = 640.125,
	.identified = true,
	.identity = "VSMD 7",
	.origin = "8f3a2c71-1-0-0-0",
};

/* --- whether a drive may go there ------------------------------------------------------------- */

static void the_same_drive_with_the_same_origin_goes_there(void **state)
{
	struct db_position_drive drive = same;

	(void)state;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_GOOD);
	/* That it moves now is no reason. */
	drive.stands = false;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_GOOD);
}

static void what_is_not_known_is_not_good(void **state)
{
	struct db_position_drive drive = same;

	(void)state;
	drive.online = false;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OFFLINE);
	drive = same;
	drive.identified = false;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OFFLINE);
	drive = same;
	drive.counts_per_unit = 0.0;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OFFLINE);
}

static void another_drive_or_scale_does_not_go_there(void **state)
{
	struct db_position_drive drive = same;

	(void)state;
	snprintf(drive.identity, sizeof(drive.identity), "VSMD 8");
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OTHER_DRIVE);
	drive = same;
	drive.counts_per_unit = 640.2;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OTHER_SCALE);
	/* A number of 32 bits that was written as text. */
	drive.counts_per_unit = 640.12500001;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_GOOD);
}

static void a_moved_origin_is_not_driven_to(void **state)
{
	struct db_position homed = taught;
	struct db_position_drive drive = same;

	(void)state;
	drive.lost = true;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_ORIGIN_LOST);
	drive = same;
	snprintf(drive.origin, sizeof(drive.origin), "8f3a2c71-1-1-0-0");
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OTHER_ORIGIN);
	/* Homing does not bring an origin back that was none of homing. */
	drive.homed = true;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OTHER_ORIGIN);
	/* It does for one that was. */
	homed.homed = true;
	assert_int_equal(db_position_judge(&homed, &drive), DB_POSITION_GOOD);
	drive.homed = false;
	assert_int_equal(db_position_judge(&homed, &drive), DB_POSITION_OTHER_ORIGIN);
	/* It was homed by itself since. */
	drive = same;
	drive.homed = true;
	assert_int_equal(db_position_judge(&taught, &drive), DB_POSITION_OTHER_ORIGIN);
}

static void each_flaw_has_a_name_and_says_what_to_do(void **state)
{
	(void)state;
	assert_string_equal(db_position_flaws[DB_POSITION_GOOD].name, "");
	for (int flaw = DB_POSITION_OFFLINE; flaw < DB_POSITION_FLAWS; flaw++) {
		assert_true(strlen(db_position_flaws[flaw].name) > 4);
		assert_true(strlen(db_position_flaws[flaw].text) > 20);
	}
}

/* --- the list --------------------------------------------------------------------------------- */

static void one_of_the_same_name_takes_its_place(void **state)
{
	struct db_positions list = { .count = 0 };
	struct db_position other = taught;

	(void)state;
	assert_int_equal(db_positions_put(&list, &taught), 0);
	snprintf(other.drive, sizeof(other.drive), "turner");
	assert_int_equal(db_positions_put(&list, &other), 0);
	other = taught;
	other.counts = 7;
	assert_int_equal(db_positions_put(&list, &other), 0);
	assert_int_equal(list.count, 2);
	assert_int_equal(db_positions_find(&list, "feeder", "loading place")->counts, 7);
	assert_string_equal(list.list[0].drive, "feeder");
	assert_false(db_positions_remove(&list, "feeder", "nowhere"));
	assert_true(db_positions_remove(&list, "feeder", "loading place"));
	assert_string_equal(list.list[0].drive, "turner");
	db_positions_clear(&list);
}

static void there_is_a_most(void **state)
{
	struct db_positions list = { .count = 0 };
	struct db_position position = taught;

	(void)state;
	for (int i = 0; i < DB_POSITIONS_MAX; i++) {
		snprintf(position.drive, sizeof(position.drive), "drive%d",
		         i / DB_POSITIONS_OF_DRIVE);
		snprintf(position.name, sizeof(position.name), "place %d", i);
		if (i == DB_POSITIONS_OF_DRIVE) {
			struct db_position more = position;

			snprintf(more.drive, sizeof(more.drive), "drive0");
			assert_int_equal(db_positions_put(&list, &more), -ENOSPC);
		}
		assert_int_equal(db_positions_put(&list, &position), 0);
	}
	snprintf(position.drive, sizeof(position.drive), "one more");
	assert_int_equal(db_positions_put(&list, &position), -ENOSPC);
	/* Teaching one again is no other one. */
	assert_int_equal(db_positions_put(&list, &list.list[5]), 0);
	db_positions_clear(&list);
}

/* --- its text --------------------------------------------------------------------------------- */

static void assert_same(const struct db_position *one, const struct db_position *other)
{
	assert_string_equal(one->drive, other->drive);
	assert_string_equal(one->name, other->name);
	assert_int_equal(one->counts, other->counts);
	assert_float_equal(one->counts_per_unit, other->counts_per_unit, 0.0);
	assert_string_equal(one->identity, other->identity);
	assert_string_equal(one->origin, other->origin);
	assert_int_equal(one->homed, other->homed);
	assert_int_equal(one->taught_us, other->taught_us);
	assert_string_equal(one->by, other->by);
}

static void what_is_written_is_read(void **state)
{
	struct db_positions list = { .count = 0 };
	struct db_positions again = { .count = 0 };
	struct db_position other = taught;
	char *text;

	(void)state;
	snprintf(other.name, sizeof(other.name),
	         "Stra\xc3\x9f"
	         "e \"2\"");
	other.homed = true;
	other.counts = INT32_MAX;
	assert_int_equal(db_positions_put(&list, &taught), 0);
	assert_int_equal(db_positions_put(&list, &other), 0);
	text = db_positions_write(&list);
	assert_int_equal(text[strlen(text) - 1], '\n');
	assert_int_equal(db_positions_read(&again, text), 0);
	assert_int_equal(again.count, 2);
	assert_same(&again.list[0], &taught);
	assert_same(&again.list[1], &other);
	free(text);
	db_positions_clear(&again);
	db_positions_clear(&list);
}

static void a_damaged_text_is_refused_as_a_whole(void **state)
{
	struct db_positions list = { .count = 0 };
	char *text;
	char *cut;

	(void)state;
	assert_int_equal(db_positions_put(&list, &taught), 0);
	text = db_positions_write(&list);
	db_positions_clear(&list);
	/* The last two bytes are the brace and the line feed. */
	for (size_t length = 0; length < strlen(text) - 1; length++) {
		cut = strndup(text, length);
		assert_int_equal(db_positions_read(&list, cut), -EINVAL);
		assert_int_equal(list.count, 0);
		free(cut);
		db_positions_clear(&list);
	}
	free(text);
}

static void what_is_out_of_range_is_refused(void **state)
{
#define OTHERS                                                                           \
	"\"drive\":\"a\",\"identity\":\"\",\"origin\":\"\",\"by\":\"\",\"taught_us\":1," \
	"\"homed\":true,"
#define LIST(inside) "{\"form\":1,\"positions\":[{" OTHERS inside "}]}"
	static const char *const wrong[] = {
		LIST("\"name\":\"\",\"counts\":1,\"counts_per_unit\":1.0"),
		LIST("\"name\":\"n\",\"counts\":2147483648,\"counts_per_unit\":1.0"),
		LIST("\"name\":\"n\",\"counts\":1.5,\"counts_per_unit\":1.0"),
		LIST("\"name\":\"n\",\"counts\":1,\"counts_per_unit\":0"),
		LIST("\"name\":\"n\",\"counts\":1"),
		LIST("\"name\":\"a name that is longer than the thirty-two bytes\",\"counts\":1,"
		     "\"counts_per_unit\":1.0"),
		"{\"form\":2,\"positions\":[]}",
		"{\"form\":1,\"positions\":{}}",
		"[]",
		"",
	};
	struct db_positions list = { .count = 0 };

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++)
		assert_int_equal(db_positions_read(&list, wrong[i]), -EINVAL);
	assert_int_equal(
		db_positions_read(&list,
	                          LIST("\"name\":\"n\",\"counts\":1,\"counts_per_unit\":1.0")),
		0);
	assert_int_equal(list.count, 1);
	db_positions_clear(&list);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_same_drive_with_the_same_origin_goes_there),
		cmocka_unit_test(what_is_not_known_is_not_good),
		cmocka_unit_test(another_drive_or_scale_does_not_go_there),
		cmocka_unit_test(a_moved_origin_is_not_driven_to),
		cmocka_unit_test(each_flaw_has_a_name_and_says_what_to_do),
		cmocka_unit_test(one_of_the_same_name_takes_its_place),
		cmocka_unit_test(there_is_a_most),
		cmocka_unit_test(what_is_written_is_read),
		cmocka_unit_test(a_damaged_text_is_refused_as_a_whole),
		cmocka_unit_test(what_is_out_of_range_is_refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
