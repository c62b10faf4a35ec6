/* SPDX-License-Identifier: Apache-2.0 */
/* Records of values: what triggers them, which samples they have, and how a line of them is written. */
#include "ctl/ctl_private.h"
#include "ctl/rows.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

/* --- triggers ----------------------------------------------------------------------------------------- */

static struct db_capture_trigger trigger;

static json_t *make_register(const char *type)
{
	return json_pack("{s:s, s:s, s:s, s:b, s:{s:s, s:s}}", "name", "n", "type", type, "unit",
	                 "", "writable", 0, "codes", "2",
	                 strncmp(type, "bits", 4) == 0 ? "homed" : "Standstill", "7",
	                 strncmp(type, "bits", 4) == 0 ? "error" : "ErrorStop");
}

static void set(const char *type, const char *text)
{
	json_t *reg = make_register(type);
	const char *value = NULL;
	char problem[256] = "";

	assert_null(db_capture_trigger_split(text, &trigger, &value));
	if (!db_capture_trigger_set(&trigger, reg, value, problem, sizeof problem))
		fail_msg("%s: %s", text, problem);
	json_decref(reg);
}

static bool take(json_t *value)
{
	json_t *values = json_pack("{s:o}", trigger.name, value);
	bool comes = db_capture_trigger_take(&trigger, values);

	json_decref(values);
	return comes;
}

static void a_state_triggers_when_it_is_entered(void **state)
{
	(void)state;
	set("u16", "feeder.axis_state=ErrorStop");
	assert_string_equal(trigger.drive, "feeder");
	assert_string_equal(trigger.name, "axis_state");
	/* Not what is so from the first. */
	assert_false(take(json_integer(7)));
	assert_false(take(json_integer(2)));
	assert_false(take(json_null()));
	assert_true(take(json_integer(7)));
	assert_false(take(json_integer(7)));
	assert_false(take(json_integer(3)));
	assert_true(take(json_integer(7)));
}

static void a_state_triggers_when_it_is_left(void **state)
{
	(void)state;
	set("u16", "feeder.axis_state!=Standstill");
	assert_false(take(json_integer(2)));
	assert_true(take(json_integer(3)));
	assert_false(take(json_integer(4)));
}

static void a_value_triggers_when_it_crosses_another(void **state)
{
	(void)state;
	set("i32", "feeder.position>10000");
	assert_false(take(json_integer(9000)));
	assert_false(take(json_integer(10000)));
	assert_true(take(json_integer(10001)));
	assert_false(take(json_integer(20000)));
	assert_false(take(json_integer(-5)));
	assert_true(take(json_integer(30000)));
	set("f32", "feeder.velocity<-2.5");
	assert_false(take(json_real(0.0)));
	assert_true(take(json_real(-2.6)));
	assert_false(take(json_real(-3.0)));
}

static void a_bit_triggers_at_its_edge(void **state)
{
	(void)state;
	set("bits32", "feeder.status=error");
	assert_false(take(json_integer(0x04)));
	assert_true(take(json_integer(0x84)));
	assert_false(take(json_integer(0x80)));
	set("bits32", "feeder.status=error,homed");
	assert_false(take(json_integer(0x80)));
	assert_true(take(json_integer(0x84)));
	set("bits32", "feeder.status!=homed");
	assert_false(take(json_integer(0x04)));
	assert_true(take(json_integer(0x01)));
	set("bool", "feeder.moving=1");
	assert_false(take(json_false()));
	assert_true(take(json_true()));
}

static void what_is_no_condition_is_told(void **state)
{
	static const char *const wrong[] = { "",           "feeder", "feeder.position",
		                             "position>5", ".n>5",   "d.>5",
		                             "d.n>",       "d.n!5",  "d=n.5" };
	json_t *bits = make_register("bits32");
	json_t *text = make_register("text");
	const char *value = NULL;
	char problem[256];

	(void)state;
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
		if (!db_capture_trigger_split(wrong[i], &trigger, &value))
			fail_msg("\"%s\" is taken", wrong[i]);
	}
	assert_null(db_capture_trigger_split("d.n>5", &trigger, &value));
	assert_false(db_capture_trigger_set(&trigger, bits, value, problem, sizeof problem));
	assert_non_null(strstr(problem, "bits are set (=) or not"));
	assert_null(db_capture_trigger_split("d.n=nonsense", &trigger, &value));
	assert_false(db_capture_trigger_set(&trigger, bits, value, problem, sizeof problem));
	assert_false(db_capture_trigger_set(&trigger, text, value, problem, sizeof problem));
	json_decref(bits);
	json_decref(text);
}

/* --- rows --------------------------------------------------------------------------------------------- */

static char written[512];
static struct db_ctl_rows rows;

static void note(void *context, const json_t *sample, json_int_t time_us)
{
	size_t used = strlen(written);

	(void)context;
	snprintf(written + used, sizeof written - used, "%s%lld=%lld", used ? " " : "",
	         (long long)time_us,
	         (long long)json_integer_value(
			 json_object_get(json_object_get(sample, "values"), "position")));
}

static int begin_rows(void **state)
{
	(void)state;
	written[0] = '\0';
	rows = (struct db_ctl_rows){ .write = note };
	return 0;
}

static int end_rows(void **state)
{
	(void)state;
	db_ctl_rows_clear(&rows);
	return 0;
}

static void sample(const char *drive, json_int_t time_us, json_int_t position)
{
	json_t *one = json_pack("{s:s, s:I, s:{s:I}}", "drive", drive, "time_us", time_us, "values",
	                        "position", position);

	assert_true(db_ctl_rows_take(&rows, one));
	json_decref(one);
}

static void without_a_trigger_all_samples_are_written(void **state)
{
	(void)state;
	rows.samples_max = 3;
	sample("feeder", 0, 99); /* never answered */
	sample("feeder", 1000, 1);
	sample("lift", 1500, 2);
	assert_false(rows.ended);
	sample("feeder", 2000, 3);
	assert_true(rows.ended);
	sample("feeder", 3000, 4);
	assert_string_equal(written, "0=1 500=2 1000=3");
	assert_int_equal(rows.written, 3);
}

static void a_record_ends_after_its_time(void **state)
{
	(void)state;
	rows.duration_us = 1000;
	sample("feeder", 5000, 1);
	sample("feeder", 6000, 2);
	assert_false(rows.ended);
	sample("feeder", 6001, 3);
	assert_true(rows.ended);
	assert_string_equal(written, "0=1 1000=2");
}

static void a_trigger_brings_what_was_before_it(void **state)
{
	(void)state;
	set("i32", "feeder.position>10");
	rows.trigger = &trigger;
	rows.trigger_drive = "feeder";
	rows.before_us = 2000;
	rows.duration_us = 1000;
	for (json_int_t i = 1; i <= 5; i++)
		sample("feeder", i * 1000, i);
	/* Another drive's position is nothing to it. */
	sample("lift", 5500, 50);
	assert_string_equal(written, "");
	sample("feeder", 6000, 11);
	assert_string_equal(written, "-2000=4 -1000=5 -500=50 0=11");
	sample("feeder", 7000, 12);
	sample("feeder", 8000, 13);
	assert_true(rows.ended);
	assert_string_equal(written, "-2000=4 -1000=5 -500=50 0=11 1000=12");
}

static void what_is_held_is_bounded(void **state)
{
	(void)state;
	set("i32", "feeder.position>10");
	rows.trigger = &trigger;
	rows.trigger_drive = "feeder";
	rows.before_us = INT64_MAX / 2;
	for (json_int_t i = 1; i <= DB_CTL_ROWS_HELD + 10; i++)
		sample("feeder", i, 1);
	assert_int_equal(rows.held_count, DB_CTL_ROWS_HELD);
}

/* --- lines -------------------------------------------------------------------------------------------- */

static void lines_are_as_rfc_4180_has_them(void **state)
{
	char *text = NULL;
	size_t size = 0;
	FILE *file = open_memstream(&text, &size);
	json_t *values = json_pack("[i, f, b, b, n, s]", -5, 0.25, 1, 0, "a \"b\", c");

	(void)state;
	assert_non_null(file);
	db_ctl_csv_add_text(file, true, "time_s");
	db_ctl_csv_add_text(file, false, "plain");
	db_ctl_csv_add_text(file, false, "with, comma");
	db_ctl_csv_add_text(file, false, NULL);
	db_ctl_csv_end_line(file);
	for (size_t i = 0; i < json_array_size(values); i++)
		db_ctl_csv_add_value(file, i == 0, json_array_get(values, i));
	db_ctl_csv_end_line(file);
	fclose(file);
	assert_string_equal(text,
	                    "time_s,plain,\"with, comma\",\r\n-5,0.25,1,0,,\"a \"\"b\"\", c\"\r\n");
	json_decref(values);
	free(text);
}

#define ROWS(name) cmocka_unit_test_setup_teardown(name, begin_rows, end_rows)

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_state_triggers_when_it_is_entered),
		cmocka_unit_test(a_state_triggers_when_it_is_left),
		cmocka_unit_test(a_value_triggers_when_it_crosses_another),
		cmocka_unit_test(a_bit_triggers_at_its_edge),
		cmocka_unit_test(what_is_no_condition_is_told),
		ROWS(without_a_trigger_all_samples_are_written),
		ROWS(a_record_ends_after_its_time),
		ROWS(a_trigger_brings_what_was_before_it),
		ROWS(what_is_held_is_bounded),
		cmocka_unit_test(lines_are_as_rfc_4180_has_them),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
