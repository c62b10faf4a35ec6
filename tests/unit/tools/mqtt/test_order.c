/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/order.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <sparkplug.pb-c.h>
#include <cmocka.h>

#define MS UINT64_C(1767225600123)
#define METRICS_MAX 4

/* A DCMD that a test writes. */
struct dcmd {
	Spb__Metric metrics[METRICS_MAX];
	Spb__Metric *list[METRICS_MAX];
	Spb__Payload payload;
};

struct fixture {
	struct db_mqtt_aliases aliases;
	struct db_mqtt_points *points;
	json_t *stops;
	struct dcmd dcmd;
	struct db_mqtt_command command;
	bool alive;
};

static int open_fixture(void **state)
{
	static const struct db_mqtt_point all[] = {
		{ .name = "position", .what = "position", .type = DB_MQTT_INT32 },
		{ .name = "spd", .what = "spd", .type = DB_MQTT_FLOAT, .writable = true },
		{ .kind = DB_MQTT_RUN,
		  .name = "command/stop",
		  .what = "stop",
		  .type = DB_MQTT_BOOLEAN },
		{ .kind = DB_MQTT_RUN,
		  .name = "command/enable",
		  .what = "enable",
		  .type = DB_MQTT_BOOLEAN },
		{ .kind = DB_MQTT_RUN,
		  .name = "command/move_absolute",
		  .what = "move_absolute",
		  .first = "target_position",
		  .type = DB_MQTT_INT32 },
		{ .kind = DB_MQTT_ARGUMENT,
		  .name = "argument/target_velocity",
		  .what = "target_velocity",
		  .type = DB_MQTT_FLOAT },
		{ .kind = DB_MQTT_MARK, .name = "sender/id", .what = "id", .type = DB_MQTT_STRING },
		{ .kind = DB_MQTT_MARK,
		  .name = "sender/alive",
		  .what = "alive",
		  .type = DB_MQTT_BOOLEAN },
	};
	struct fixture *fixture = calloc(1, sizeof(*fixture));

	assert_non_null(fixture);
	fixture->aliases.known = json_object();
	fixture->points = db_mqtt_points_new(&fixture->aliases, "lift", "");
	for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++)
		assert_true(db_mqtt_points_add(fixture->points, &all[i]));
	fixture->stops = json_pack("{s:b}", "stop", 1);
	*state = fixture;
	return 0;
}

static int close_fixture(void **state)
{
	struct fixture *fixture = *state;

	db_mqtt_command_clear(&fixture->command);
	json_decref(fixture->stops);
	db_mqtt_points_free(fixture->points);
	json_decref(fixture->aliases.known);
	free(fixture);
	return 0;
}

/* A metric more, with its time but for 0. */
static Spb__Metric *add(struct fixture *fixture, const char *name, uint64_t ms)
{
	struct dcmd *dcmd = &fixture->dcmd;
	Spb__Metric *metric;

	if (dcmd->payload.n_metrics == 0) {
		spb__payload__init(&dcmd->payload);
		dcmd->payload.metrics = dcmd->list;
	}
	metric = &dcmd->metrics[dcmd->payload.n_metrics];
	dcmd->list[dcmd->payload.n_metrics++] = metric;
	spb__metric__init(metric);
	metric->has_alias = 1;
	metric->alias = (uint64_t)db_mqtt_points_find(fixture->points, name, 0)->alias;
	metric->has_timestamp = ms > 0;
	metric->timestamp = ms;
	return metric;
}

static void add_true(struct fixture *fixture, const char *name, uint64_t ms)
{
	Spb__Metric *metric = add(fixture, name, ms);

	metric->value_case = SPB__METRIC__VALUE_BOOLEAN_VALUE;
	metric->boolean_value = 1;
}

static void add_number(struct fixture *fixture, const char *name, double number)
{
	Spb__Metric *metric = add(fixture, name, MS);

	metric->value_case = SPB__METRIC__VALUE_DOUBLE_VALUE;
	metric->double_value = number;
}

/* Reads it, and begins a new one. */
static const char *read_it(struct fixture *fixture)
{
	uint8_t bytes[512];
	size_t length = spb__payload__pack(&fixture->dcmd.payload, bytes);

	db_mqtt_command_clear(&fixture->command);
	fixture->dcmd.payload.n_metrics = 0;
	return db_mqtt_order_read(fixture->points, fixture->stops, bytes, length, &fixture->command,
	                          &fixture->alive);
}

static void test_the_oldest_time_counts(void **state)
{
	struct fixture *fixture = *state;

	add_true(fixture, "command/enable", MS);
	assert_null(read_it(fixture));
	assert_string_equal(fixture->command.name, "enable");
	assert_true(fixture->command.timed && fixture->command.us == (int64_t)MS * 1000);
	assert_null(fixture->command.arguments);
	add_number(fixture, "command/move_absolute", -5);
	add_number(fixture, "argument/target_velocity", 2.5);
	fixture->dcmd.metrics[1].timestamp = MS - 7;
	assert_null(read_it(fixture));
	assert_true(fixture->command.us == (int64_t)(MS - 7) * 1000);
	assert_int_equal(
		json_integer_value(json_object_get(fixture->command.arguments, "target_position")),
		-5);
	assert_true(json_is_real(json_object_get(fixture->command.arguments, "target_velocity")));
	/* A metric without a time has that of the payload. */
	add_true(fixture, "command/enable", 0);
	fixture->dcmd.payload.has_timestamp = 1;
	fixture->dcmd.payload.timestamp = MS + 1;
	assert_null(read_it(fixture));
	assert_true(fixture->command.us == (int64_t)(MS + 1) * 1000);
	add_true(fixture, "command/enable", 0);
	assert_string_equal(read_it(fixture), "neither its metrics nor the payload have a time");
	add_true(fixture, "command/enable", UINT64_MAX);
	assert_string_equal(read_it(fixture), "neither its metrics nor the payload have a time");
}

static void test_the_same_bytes_have_one_id(void **state)
{
	struct fixture *fixture = *state;
	char id[DB_MQTT_ID_MAX + 1];

	add_number(fixture, "command/move_absolute", 5);
	assert_null(read_it(fixture));
	strcpy(id, fixture->command.id);
	assert_memory_equal(id, "1767225600123 move_absolute ", 28);
	add_number(fixture, "command/move_absolute", 5);
	assert_null(read_it(fixture));
	assert_string_equal(fixture->command.id, id);
	add_number(fixture, "command/move_absolute", 6);
	assert_null(read_it(fixture));
	assert_string_not_equal(fixture->command.id, id);
}

static void test_numbers_that_are_none_for_it(void **state)
{
	static const double wrong[] = { 0.5, NAN, INFINITY, 1e300, 9007199254740994.0 };
	struct fixture *fixture = *state;

	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		add_number(fixture, "command/move_absolute", wrong[i]);
		assert_string_equal(
			read_it(fixture),
			"a metric has no value, or one of another type than in the DBIRTH");
	}
	add_number(fixture, "spd", 0.5);
	assert_null(read_it(fixture));
	assert_null(fixture->command.name);
	assert_true(json_is_real(json_object_get(fixture->command.arguments, "spd")));
}

static void test_a_stop_wins(void **state)
{
	struct fixture *fixture = *state;

	add_true(fixture, "command/enable", MS);
	(void)add(fixture, "position", 0);
	(void)add(fixture, "command/stop", 0);
	assert_null(read_it(fixture));
	assert_true(fixture->command.stops && !fixture->command.arguments);
	assert_string_equal(fixture->command.name, "stop");
	/* A sign of life is one only by itself. */
	add_true(fixture, "sender/alive", MS);
	(void)read_it(fixture);
	assert_true(fixture->alive);
	add_true(fixture, "sender/alive", MS);
	add_true(fixture, "command/enable", MS);
	assert_null(read_it(fixture));
	assert_false(fixture->alive);
}

/* A template in a template, as deep as a message can be: it is not looked into. */
static void test_templates_do_not_nest(void **state)
{
	struct fixture *fixture = *state;
	static uint8_t bytes[DB_MQTT_COMMAND_MAX];
	size_t at = sizeof(bytes);

	while (at > 16) {
		size_t length = sizeof(bytes) - at;
		uint8_t size[3];
		size_t sizes = 0;

		do {
			size[sizes++] = (uint8_t)((length & 0x7F) | (length > 0x7F ? 0x80 : 0));
			length >>= 7;
		} while (length > 0);
		at -= sizes;
		memcpy(bytes + at, size, sizes);
		/* By turns a template of a metric (18), and the metrics of a payload or template (2). */
		bytes[--at] = 0x12;
		if (at > 16) {
			length = sizeof(bytes) - at;
			sizes = 0;
			do {
				size[sizes++] = (uint8_t)((length & 0x7F) |
				                          (length > 0x7F ? 0x80 : 0));
				length >>= 7;
			} while (length > 0);
			at -= sizes;
			memcpy(bytes + at, size, sizes);
			bytes[--at] = 0x01;
			bytes[--at] = 0x92;
		}
	}
	assert_non_null(db_mqtt_order_read(fixture->points, fixture->stops, bytes + at,
	                                   sizeof(bytes) - at, &fixture->command, &fixture->alive));
	assert_false(db_mqtt_order_asks(bytes + at, sizeof(bytes) - at, "x"));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_fixture, close_fixture)
	const struct CMUnitTest tests[] = {
		TEST(test_the_oldest_time_counts),       TEST(test_the_same_bytes_have_one_id),
		TEST(test_numbers_that_are_none_for_it), TEST(test_a_stop_wins),
		TEST(test_templates_do_not_nest),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
