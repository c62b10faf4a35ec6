/* SPDX-License-Identifier: Apache-2.0 */
/* Parameters are written one after the other, and each is read back: with a drive that obeys, refuses or is gone. */
#include "params/set.h"
#include "params/writer.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

struct fixture {
	json_t *registers;
	json_t *held;    /* what the drive has */
	json_t *refused; /* by name: the error of a write, or the value that the drive takes instead */
	json_t *needs; /* by name: the parameter that has to be 1 before this one is taken */
	json_t *calls;
	char said[2048];
	size_t end_after;   /* calls; 0: never */
	size_t other_after; /* so many calls another writes spd = 77; 0: never */
	size_t deaf_after;  /* so many calls nothing answers; 0: never */
	bool standing;
	struct db_params_writer writer;
};

static void add_register(json_t *registers, const char *name, const char *trait)
{
	(void)json_array_append_new(registers,
	                            json_pack("{s:s, s:s, s:s, s:b, s:[s*]}", "name", name, "type",
	                                      "u16", "unit", "V", "parameter", 1, "traits", trait));
}

static void take_report(void *data, const char *name, const char *state, const char *text,
                        const json_t *value)
{
	struct fixture *fixture = data;
	size_t used = strlen(fixture->said);

	if (strcmp(state, "writing") != 0)
		(void)snprintf(fixture->said + used, sizeof(fixture->said) - used, "%s %s %s%s;",
		               name, state, text, value ? "" : " -");
}

static int set_up(void **state)
{
	struct fixture *fixture = calloc(1, sizeof(*fixture));

	fixture->registers = json_array();
	add_register(fixture->registers, "spd", NULL);
	add_register(fixture->registers, "zmd", "last");
	add_register(fixture->registers, "s1", "first");
	add_register(fixture->registers, "low", "together");
	add_register(fixture->registers, "high", "together");
	add_register(fixture->registers, "code", "secret");
	fixture->held = json_object();
	fixture->refused = json_object();
	fixture->needs = json_object();
	fixture->calls = json_array();
	*state = fixture;
	return 0;
}

static int tear_down(void **state)
{
	struct fixture *fixture = *state;

	json_decref(fixture->registers);
	json_decref(fixture->held);
	json_decref(fixture->refused);
	json_decref(fixture->needs);
	json_decref(fixture->calls);
	db_params_writer_clear(&fixture->writer);
	free(fixture);
	return 0;
}

/* What the drive answers; NULL with the error. */
static json_t *answer_write(struct fixture *fixture, json_t *values, struct db_client_error *error)
{
	const char *name;
	json_t *value;
	json_t *rule;
	const char *need;

	json_object_foreach(values, name, value)
	{
		rule = json_object_get(fixture->refused, name);
		need = json_string_value(json_object_get(fixture->needs, name));
		if (json_is_array(rule)) {
			json_t *parameters = json_pack("{s:O}", "result", json_array_get(rule, 1));

			db_client_error_read(error, json_string_value(json_array_get(rule, 0)),
			                     parameters);
			json_decref(parameters);
			return NULL;
		}
		if (need && json_integer_value(json_object_get(fixture->held, need)) != 1) {
			db_client_error_set(error, DB_CLIENT_SERVICE "Refused", "refused");
			return NULL;
		}
		(void)json_object_set(fixture->held, name, rule ? rule : value);
	}
	return json_pack("{s:s}", "result", "ok");
}

static json_t *answer_read(const struct fixture *fixture, const json_t *names)
{
	json_t *values = json_object();
	size_t i;
	const json_t *name;

	json_array_foreach(names, i, name)
	{
		(void)json_object_set(values, json_string_value(name),
		                      json_object_get(fixture->held, json_string_value(name)));
	}
	return json_pack("{s:o}", "values", values);
}

/* Takes `values` over. */
static void run(struct fixture *fixture, json_t *values)
{
	struct db_params_writer *writer = &fixture->writer;
	json_t *names = json_array();
	json_t *parameters;
	const char *method;
	const char *name;
	json_t *plan;
	json_t *value;

	json_object_foreach(values, name, value)
	{
		(void)json_array_append_new(names, json_string(name));
	}
	plan = db_params_order(fixture->registers, names);
	json_decref(names);
	*writer = (struct db_params_writer){ .drive = "feeder",
		                             .registers = fixture->registers,
		                             .values = values,
		                             .plan = plan,
		                             .standing = fixture->standing,
		                             .report = take_report,
		                             .data = fixture };
	db_params_writer_begin(writer);
	for (;;) {
		struct db_client_error error = { .parameters = NULL };
		json_t *answer;

		if (fixture->end_after > 0 &&
		    json_array_size(fixture->calls) >= fixture->end_after && !writer->reads_back)
			db_params_writer_end(writer, "it was ended");
		method = db_params_writer_next(writer, &parameters);
		if (!method)
			break;
		assert_string_equal(json_string_value(json_object_get(parameters, "drive")),
		                    "feeder");
		(void)json_object_del(parameters, "drive");
		if (fixture->other_after > 0 &&
		    json_array_size(fixture->calls) == fixture->other_after)
			(void)json_object_set_new(fixture->held, "spd", json_integer(77));
		answer = strcmp(method, "Write") == 0 ?
		                 answer_write(fixture, json_object_get(parameters, "values"),
		                              &error) :
		                 answer_read(fixture, json_object_get(parameters, "names"));
		(void)json_array_append_new(fixture->calls, parameters);
		if (fixture->deaf_after > 0 &&
		    json_array_size(fixture->calls) > fixture->deaf_after) {
			json_decref(answer);
			answer = NULL;
			db_client_error_set(&error, DB_CLIENT_LOST, "it is gone");
		}
		db_params_writer_take(writer, answer, &error);
		db_client_error_clear(&error);
		json_decref(answer);
	}
	json_decref(plan);
	json_decref(values);
}

static void expect(const json_t *found, const char *expected)
{
	char *text = json_dumps(found, JSON_COMPACT);

	assert_string_equal(text, expected);
	free(text);
}

static void test_each_is_written_and_read_back(void **state)
{
	struct fixture *fixture = *state;

	run(fixture, json_pack("{s:i, s:i, s:i}", "high", 4, "low", 3, "spd", 5));
	expect(fixture->writer.written, "[\"spd\",\"low\",\"high\"]");
	expect(fixture->writer.failed, "{}");
	expect(fixture->calls, "[{\"values\":{\"spd\":5}},{\"names\":[\"spd\"]},"
	                       "{\"values\":{\"low\":3,\"high\":4}},{\"names\":[\"low\",\"high\"]},"
	                       "{\"names\":[\"spd\",\"low\",\"high\"]}]");
	assert_string_equal(fixture->said, "spd done ok;low done ok;high done ok;");
	assert_string_equal(fixture->writer.over, "");
}

static void test_what_the_drive_shows_otherwise_has_failed(void **state)
{
	struct fixture *fixture = *state;

	(void)json_object_set_new(fixture->refused, "spd", json_integer(100));
	(void)json_object_set_new(fixture->refused, "zmd", json_null());
	run(fixture, json_pack("{s:i, s:i, s:i}", "spd", 5, "zmd", 1, "s1", 1));
	expect(fixture->writer.written, "[\"s1\"]");
	expect(fixture->writer.failed,
	       "{\"spd\":\"the drive shows 100 V\",\"zmd\":\"the drive does not tell it\"}");
}

static void test_what_is_refused_because_of_another_is_tried_again(void **state)
{
	struct fixture *fixture = *state;

	(void)json_object_set_new(fixture->needs, "high", json_string("zmd"));
	run(fixture, json_pack("{s:i, s:i, s:i}", "low", 5, "high", 6, "zmd", 1));
	expect(fixture->writer.written, "[\"zmd\",\"low\",\"high\"]");
	expect(fixture->writer.failed, "{}");
	assert_string_equal(fixture->writer.over, "");
}

static void test_of_a_group_both_are_counted_once(void **state)
{
	struct fixture *fixture = *state;

	(void)json_object_set_new(fixture->refused, "low", json_integer(9));
	run(fixture, json_pack("{s:i, s:i}", "low", 5, "high", 6));
	expect(fixture->writer.written, "[\"high\"]");
	expect(fixture->writer.failed, "{\"low\":\"the drive shows 9 V\"}");
	assert_int_equal(json_array_size(fixture->calls), 5);
}

static void test_a_drive_that_is_gone_gets_nothing_more(void **state)
{
	static const char *const gone[][2] = {
		{ DB_CLIENT_SERVICE "Refused", "offline" },
		{ DB_CLIENT_SERVICE "Refused", "not_in_control" },
		{ DB_CLIENT_SERVICE "NotAllowed", "" },
		{ DB_CLIENT_SERVICE "TooOld", "" },
		{ DB_CLIENT_SERVICE "Moving", "" },
		{ DB_CLIENT_LOST, "" },
	};

	for (size_t i = 0; i < sizeof(gone) / sizeof(gone[0]); i++) {
		struct fixture *fixture;

		(void)tear_down(state);
		(void)set_up(state);
		fixture = *state;
		(void)json_object_set_new(fixture->refused, "spd",
		                          json_pack("[s,s]", gone[i][0], gone[i][1]));
		run(fixture, json_pack("{s:i, s:i, s:i}", "s1", 1, "spd", 5, "zmd", 1));
		expect(fixture->writer.written, "[\"s1\"]");
		assert_int_equal(json_object_size(fixture->writer.failed), 1);
		assert_non_null(json_object_get(fixture->writer.failed, "spd"));
		/* What was written is read once more, where that can be asked. */
		assert_int_equal(json_array_size(fixture->calls), fixture->writer.lost ? 3 : 4);
		assert_int_not_equal(fixture->writer.over[0], '\0');
		assert_int_equal(fixture->writer.lost, strcmp(gone[i][0], DB_CLIENT_LOST) == 0);
	}
}

static void test_it_ends_between_two_writes(void **state)
{
	struct fixture *fixture = *state;

	/* What is written is still read back. */
	fixture->end_after = 1;
	run(fixture, json_pack("{s:i, s:i}", "s1", 1, "spd", 5));
	expect(fixture->writer.written, "[\"s1\"]");
	expect(fixture->writer.failed, "{\"spd\":\"it was ended\"}");
	assert_string_equal(fixture->writer.over, "it was ended");
}

static void test_an_end_after_the_last_one_is_none(void **state)
{
	struct fixture *fixture = *state;

	fixture->end_after = 2;
	run(fixture, json_pack("{s:i}", "s1", 1));
	expect(fixture->writer.written, "[\"s1\"]");
	assert_string_equal(fixture->writer.over, "");
}

static void test_a_secret_is_not_read_back(void **state)
{
	struct fixture *fixture = *state;

	run(fixture, json_pack("{s:i}", "code", 9));
	expect(fixture->writer.written, "[\"code\"]");
	assert_int_equal(json_array_size(fixture->calls), 1);
	assert_string_equal(fixture->said, "code done ok; it cannot be read back -;");
}

static void test_what_another_wrote_since_is_not_written(void **state)
{
	struct fixture *fixture = *state;

	fixture->other_after = 3;
	run(fixture, json_pack("{s:i, s:i}", "s1", 1, "spd", 5));
	expect(fixture->writer.written, "[\"s1\",\"spd\"]");

	(void)tear_down(state);
	(void)set_up(state);
	fixture = *state;
	fixture->other_after = 4;
	run(fixture, json_pack("{s:i, s:i}", "s1", 1, "spd", 5));
	expect(fixture->writer.written, "[\"s1\"]");
	expect(fixture->writer.failed,
	       "{\"spd\":\"something has changed it since: the drive shows 77 V\"}");
	/* Nobody is written against: it is not tried again. */
	assert_int_equal(json_array_size(fixture->calls), 5);
	assert_string_equal(fixture->writer.over, "");
}

static void test_what_the_drive_had_is_looked_at_in_the_end(void **state)
{
	struct fixture *fixture = *state;
	json_t *values = json_pack("{s:i, s:i}", "s1", 1, "spd", 5);
	json_t *plan = json_pack("[[s]]", "s1");
	struct db_client_error none = { .parameters = NULL };
	json_t *parameters;
	json_t *answer;

	fixture->writer = (struct db_params_writer){ .drive = "feeder",
		                                     .registers = fixture->registers,
		                                     .values = values,
		                                     .plan = plan,
		                                     .kept = json_pack("[s]", "spd"),
		                                     .report = take_report,
		                                     .data = fixture };
	db_params_writer_begin(&fixture->writer);
	(void)json_object_set_new(fixture->held, "spd", json_integer(6));
	while (db_params_writer_next(&fixture->writer, &parameters)) {
		json_t *written = json_object_get(parameters, "values");

		answer = written ? answer_write(fixture, written, &none) :
		                   answer_read(fixture, json_object_get(parameters, "names"));
		db_params_writer_take(&fixture->writer, answer, &none);
		json_decref(answer);
		json_decref(parameters);
	}
	expect(fixture->writer.written, "[\"s1\"]");
	expect(fixture->writer.failed,
	       "{\"spd\":\"something has changed it since: the drive shows 6 V\"}");
	json_decref(fixture->writer.kept);
	json_decref(values);
	json_decref(plan);
}

static void test_without_the_last_look_it_is_over(void **state)
{
	struct fixture *fixture = *state;

	fixture->deaf_after = 2;
	run(fixture, json_pack("{s:i}", "s1", 1));
	expect(fixture->writer.written, "[\"s1\"]");
	expect(fixture->writer.failed, "{}");
	assert_string_equal(fixture->writer.over, "it is gone");
	assert_true(fixture->writer.lost);
}

static void test_what_is_for_a_drive_that_stands_says_so(void **state)
{
	struct fixture *fixture = *state;

	fixture->standing = true;
	run(fixture, json_pack("{s:i}", "code", 9));
	expect(fixture->calls, "[{\"values\":{\"code\":9},\"standing\":true}]");
}

static void test_what_was_not_tried_is_known(void **state)
{
	struct fixture *fixture = *state;
	json_t *plan = json_pack("[[s],[s],[s,s]]", "s1", "spd", "low", "high");
	json_t *untried;

	fixture->end_after = 1;
	run(fixture, json_pack("{s:i, s:i, s:i, s:i}", "s1", 1, "spd", 5, "low", 1, "high", 2));
	fixture->writer.plan = plan; /* as it was */
	untried = db_params_writer_untried(&fixture->writer);
	expect(untried, "[\"low\",\"high\"]");
	json_decref(untried);
	json_decref(plan);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_each_is_written_and_read_back, set_up,
		                                tear_down),
		cmocka_unit_test_setup_teardown(test_what_another_wrote_since_is_not_written,
		                                set_up, tear_down),
		cmocka_unit_test_setup_teardown(test_what_the_drive_had_is_looked_at_in_the_end,
		                                set_up, tear_down),
		cmocka_unit_test_setup_teardown(test_without_the_last_look_it_is_over, set_up,
		                                tear_down),
		cmocka_unit_test_setup_teardown(test_what_is_for_a_drive_that_stands_says_so,
		                                set_up, tear_down),
		cmocka_unit_test_setup_teardown(test_what_was_not_tried_is_known, set_up,
		                                tear_down),
		cmocka_unit_test_setup_teardown(test_what_the_drive_shows_otherwise_has_failed,
		                                set_up, tear_down),
		cmocka_unit_test_setup_teardown(
			test_what_is_refused_because_of_another_is_tried_again, set_up, tear_down),
		cmocka_unit_test_setup_teardown(test_of_a_group_both_are_counted_once, set_up,
		                                tear_down),
		cmocka_unit_test_setup_teardown(test_a_drive_that_is_gone_gets_nothing_more, set_up,
		                                tear_down),
		cmocka_unit_test_setup_teardown(test_it_ends_between_two_writes, set_up, tear_down),
		cmocka_unit_test_setup_teardown(test_an_end_after_the_last_one_is_none, set_up,
		                                tear_down),
		cmocka_unit_test_setup_teardown(test_a_secret_is_not_read_back, set_up, tear_down),
	};

	return cmocka_run_group_tests_name("params: writing", tests, NULL, NULL);
}
