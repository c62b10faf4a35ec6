/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/payload.h"
#include "mqtt/points.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <sparkplug.pb-c.h>
#include <cmocka.h>

#define US INT64_C(1767225600123456)
#define MS UINT64_C(1767225600123)

static const struct {
	enum db_mqtt_type type;
	const char *json;
	const char *bytes; /* of the value, with the number of its field in front */
	size_t length;
} literal[] = {
	{ DB_MQTT_INT32, "-2", "\x50\xfe\xff\xff\xff\x0f", 6 },
	{ DB_MQTT_UINT16, "300", "\x50\xac\x02", 3 },
	{ DB_MQTT_UINT32, "4294967295", "\x50\xff\xff\xff\xff\x0f", 6 },
	{ DB_MQTT_INT64, "-1", "\x58\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01", 11 },
	{ DB_MQTT_UINT64, "5", "\x58\x05", 2 },
	{ DB_MQTT_FLOAT, "1.5", "\x65\x00\x00\xc0\x3f", 5 },
	{ DB_MQTT_FLOAT, "2", "\x65\x00\x00\x00\x40", 5 },
	{ DB_MQTT_DOUBLE, "1.5", "\x69\x00\x00\x00\x00\x00\x00\xf8\x3f", 9 },
	{ DB_MQTT_BOOLEAN, "true", "\x70\x01", 2 },
	{ DB_MQTT_BOOLEAN, "false", "\x70\x00", 2 },
	{ DB_MQTT_STRING, "\"ab\"", "\x7a\x02\x61\x62", 4 },
	/* Of another type, and none: is_null. */
	{ DB_MQTT_INT32, "1.5", "\x38\x01", 2 },
	{ DB_MQTT_STRING, "5", "\x38\x01", 2 },
	{ DB_MQTT_BOOLEAN, "1", "\x38\x01", 2 },
	{ DB_MQTT_FLOAT, "null", "\x38\x01", 2 },
};

/* By the numbers of the fields, as the specification has them. */
static void test_values_are_what_they_are_on_the_wire(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(literal) / sizeof(literal[0]); i++) {
		struct db_mqtt_payload *payload = db_mqtt_payload_new();
		json_t *value = json_loads(literal[i].json, JSON_DECODE_ANY, NULL);
		/* metrics 2: alias 2, timestamp 3 */
		uint8_t expected[64] = { 0x12, 0,    0x10, 0x07, 0x18, 0xfb,
			                 0xd0, 0xea, 0xb6, 0xb7, 0x33 };
		size_t length;
		uint8_t *bytes;

		expected[1] = (uint8_t)(9 + literal[i].length);
		memcpy(expected + 11, literal[i].bytes, literal[i].length);
		db_mqtt_payload_add(payload, &(struct db_mqtt_metric){ .alias = 7,
		                                                       .us = US,
		                                                       .type = literal[i].type,
		                                                       .value = value,
		                                                       .quality = DB_MQTT_UNSAID });
		bytes = db_mqtt_payload_close(payload, &length);
		assert_int_equal(length, 11 + literal[i].length);
		assert_memory_equal(bytes, expected, length);
		free(bytes);
		json_decref(value);
	}
}

static void test_head_and_metrics_are_one_payload(void **state)
{
	static const uint8_t metrics[] = { 0x12, 0x02, 0x10, 0x07 };
	size_t length, marked_length;
	uint8_t *bytes = db_mqtt_payload_finish(US, 255, metrics, sizeof(metrics), &length);
	uint8_t *marked = db_mqtt_payload_mark(metrics, sizeof(metrics), &marked_length);
	Spb__Payload *payload;

	(void)state;
	payload = spb__payload__unpack(NULL, length, bytes);
	assert_non_null(payload);
	assert_true(payload->timestamp == MS && payload->has_seq && payload->seq == 255);
	assert_int_equal(payload->n_metrics, 1);
	assert_true(payload->metrics[0]->alias == 7 && !payload->metrics[0]->has_is_historical);
	spb__payload__free_unpacked(payload, NULL);
	payload = spb__payload__unpack(NULL, marked_length, marked);
	assert_true(payload->n_metrics == 1 && payload->metrics[0]->is_historical);
	spb__payload__free_unpacked(payload, NULL);
	free(bytes);
	free(marked);
	/* NDEATH has no number, and DDEATH no metrics. */
	bytes = db_mqtt_payload_finish(US, DB_MQTT_NO_SEQ, NULL, 0, &length);
	payload = spb__payload__unpack(NULL, length, bytes);
	assert_true(payload->has_timestamp && !payload->has_seq && payload->n_metrics == 0);
	spb__payload__free_unpacked(payload, NULL);
	free(bytes);
	assert_null(db_mqtt_payload_mark((const uint8_t *)"\xff", 1, &length));
}

static Spb__Payload *write(struct db_mqtt_points *points, bool all)
{
	struct db_mqtt_payload *payload = db_mqtt_payload_new();
	Spb__Payload *read;
	size_t length;
	uint8_t *bytes;

	if (all)
		db_mqtt_points_write_all(points, payload, US);
	else
		db_mqtt_points_write_news(points, payload);
	bytes = db_mqtt_payload_close(payload, &length);
	read = spb__payload__unpack(NULL, length, bytes);
	free(bytes);
	assert_non_null(read);
	return read;
}

static struct db_mqtt_points *make(struct db_mqtt_aliases *aliases, const char *template)
{
	struct db_mqtt_points *points = db_mqtt_points_new(aliases, "lift", template);

	assert_true(db_mqtt_points_add(
		points, &(struct db_mqtt_point){ .name = "position", .type = DB_MQTT_INT32 }));
	assert_true(db_mqtt_points_add(
		points, &(struct db_mqtt_point){ .name = "velocity", .type = DB_MQTT_FLOAT }));
	assert_true(db_mqtt_points_add(points, &(struct db_mqtt_point){ .kind = DB_MQTT_RESULT,
	                                                                .name = "result/id",
	                                                                .type = DB_MQTT_STRING }));
	return points;
}

static void test_news_are_what_has_changed(void **state)
{
	struct db_mqtt_aliases aliases = { .known = json_object() };
	struct db_mqtt_points *points, *again;
	Spb__Payload *payload;

	(void)state;
	points = make(&aliases, "");
	db_mqtt_points_set(points, "position", json_integer(5), US);
	db_mqtt_points_rate(points, DB_MQTT_GOOD);
	payload = write(points, true);
	assert_int_equal(payload->n_metrics, 3);
	assert_string_equal(payload->metrics[1]->name, "velocity");
	assert_true(payload->metrics[1]->is_null && payload->metrics[1]->datatype == DB_MQTT_FLOAT);
	spb__payload__free_unpacked(payload, NULL);
	assert_false(db_mqtt_points_have_news(points));
	db_mqtt_points_set(points, "position", json_integer(5), US + 1);
	db_mqtt_points_set(points, "unknown", json_integer(5), US + 1);
	assert_false(db_mqtt_points_have_news(points));
	db_mqtt_points_set(points, "velocity", json_real(1.0), US + 5000);
	payload = write(points, false);
	assert_int_equal(payload->n_metrics, 1);
	assert_null(payload->metrics[0]->name);
	assert_true(payload->metrics[0]->timestamp == MS + 5 && !payload->metrics[0]->properties);
	spb__payload__free_unpacked(payload, NULL);
	/* Of worse quality all values are news, and say so. */
	db_mqtt_points_rate(points, DB_MQTT_STALE);
	payload = write(points, false);
	assert_int_equal(payload->n_metrics, 2);
	assert_int_equal(payload->metrics[0]->properties->values[0]->int_value, DB_MQTT_STALE);
	spb__payload__free_unpacked(payload, NULL);
	/* The same result twice is news twice. */
	for (int i = 0; i < 2; i++) {
		db_mqtt_points_set(points, "result/id", json_string("a"), US);
		assert_true(db_mqtt_points_have_news(points));
		spb__payload__free_unpacked(write(points, false), NULL);
	}
	/* The drive comes again: its names keep their aliases. */
	again = make(&aliases, "");
	assert_true(db_mqtt_points_are_same(points, again));
	assert_true(again->list[2].alias == points->list[2].alias);
	assert_true(db_mqtt_points_add(again, &(struct db_mqtt_point){ .name = "more" }));
	assert_false(db_mqtt_points_are_same(points, again));
	db_mqtt_points_free(again);
	db_mqtt_points_free(points);
	json_decref(aliases.known);
}

static void test_a_template_has_the_values(void **state)
{
	struct db_mqtt_aliases aliases = { .known = json_object() };
	struct db_mqtt_points *points;
	struct db_mqtt_payload *written;
	Spb__Payload *payload;
	size_t length;
	uint8_t *bytes;

	(void)state;
	points = make(&aliases, "family");
	db_mqtt_points_rate(points, DB_MQTT_GOOD);
	payload = write(points, true);
	assert_int_equal(payload->n_metrics, 2);
	assert_int_equal(payload->metrics[0]->template_value->n_metrics, 2);
	assert_string_equal(payload->metrics[0]->template_value->template_ref, "family");
	assert_string_equal(payload->metrics[1]->name, "result/id");
	spb__payload__free_unpacked(payload, NULL);
	db_mqtt_points_set(points, "velocity", json_real(1.0), US);
	db_mqtt_points_set(points, "result/id", json_string("a"), US);
	payload = write(points, false);
	assert_int_equal(payload->n_metrics, 2);
	assert_int_equal(payload->metrics[0]->template_value->n_metrics, 1);
	assert_string_equal(payload->metrics[0]->template_value->metrics[0]->name, "velocity");
	assert_null(payload->metrics[1]->name);
	spb__payload__free_unpacked(payload, NULL);
	written = db_mqtt_payload_new();
	db_mqtt_points_write_definition("family", (struct db_mqtt_points *[]){ points, points }, 2,
	                                written, US);
	bytes = db_mqtt_payload_close(written, &length);
	payload = spb__payload__unpack(NULL, length, bytes);
	assert_int_equal(payload->metrics[0]->template_value->n_metrics, 2);
	assert_true(payload->metrics[0]->template_value->is_definition);
	assert_null(payload->metrics[0]->template_value->template_ref);
	spb__payload__free_unpacked(payload, NULL);
	free(bytes);
	db_mqtt_points_free(points);
	json_decref(aliases.known);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_values_are_what_they_are_on_the_wire),
		cmocka_unit_test(test_head_and_metrics_are_one_payload),
		cmocka_unit_test(test_news_are_what_has_changed),
		cmocka_unit_test(test_a_template_has_the_values),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
