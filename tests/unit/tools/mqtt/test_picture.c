/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/picture.h"

#include "mqtt/topics.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define NOON INT64_C(1772366400000000)

static json_t *parse(const char *text)
{
	json_t *json = json_loads(text, JSON_DECODE_ANY, NULL);

	assert_non_null(json);
	return json;
}

static int open_picture(void **state)
{
	json_t *drive = parse(
		"{\"name\":\"lift\",\"bus\":\"press\",\"unit_name\":\"mm\",\"unit\":1}");
	json_t *registers = parse(
		"[{\"name\":\"axis_state\",\"type\":\"u16\",\"codes\":{\"1\":\"Disabled\",\"2\":"
		"\"Standstill\"}},{\"name\":\"status\",\"type\":\"bits16\",\"codes\":{\"0\":\"online\","
		"\"3\":\"moving\"}},{\"name\":\"position\",\"type\":\"i32\",\"unit\":\"counts\"}]");

	*state = db_mqtt_picture_new(drive, registers);
	json_decref(drive);
	json_decref(registers);
	return *state ? 0 : -1;
}

static int close_picture(void **state)
{
	db_mqtt_picture_free(*state);
	return 0;
}

/* NULL: nothing changed. */
static void expect_changes(struct db_mqtt_picture *picture, const char *values,
                           const char *expected)
{
	json_t *json = parse(values);
	char *text = db_mqtt_picture_take(picture, json, NOON);

	json_decref(json);
	if (expected)
		assert_string_equal(text, expected);
	else
		assert_null(text);
	free(text);
}

static void test_what_changed_in_words(void **state)
{
	expect_changes(
		*state,
		"{\"axis_state\":2,\"status\":9,\"position\":5,\"quality\":192,"
		"\"timestamp_us\":1772366399000001}",
		"{\"time\":\"2026-03-01T11:59:59.000001Z\",\"quality\":\"good\",\"values\":{"
		"\"axis_state\":\"Standstill\",\"status\":[\"online\",\"moving\"],\"position\":5}}");
	expect_changes(*state,
	               "{\"axis_state\":2,\"status\":9,\"position\":5,\"quality\":192,"
	               "\"timestamp_us\":1772366399900001}",
	               NULL);
	/* Codes without a name are numbers, of a bit its number. */
	expect_changes(*state,
	               "{\"axis_state\":7,\"status\":3,\"position\":5,\"quality\":192,"
	               "\"timestamp_us\":1772366399900001}",
	               "{\"time\":\"2026-03-01T11:59:59.900001Z\",\"quality\":\"good\",\"values\":{"
	               "\"axis_state\":7,\"status\":[\"online\",1]}}");
	/* A drive that is not there: when that was sent. */
	expect_changes(*state,
	               "{\"axis_state\":7,\"status\":3,\"position\":null,\"quality\":0,"
	               "\"timestamp_us\":0}",
	               "{\"time\":\"2026-03-01T12:00:00.000000Z\",\"quality\":\"bad\",\"values\":{"
	               "\"position\":null}}");
	expect_changes(
		*state,
		"{\"axis_state\":7,\"status\":3,\"position\":null,\"quality\":64,"
		"\"timestamp_us\":1772366400000000}",
		"{\"time\":\"2026-03-01T12:00:00.000000Z\",\"quality\":\"uncertain\",\"values\":{}}");
}

static void test_nothing_old_is_shown_as_new(void **state)
{
	const struct db_mqtt_picture *picture = *state;
	char *text;

	expect_changes(*state, "{\"axis_state\":1,\"status\":0,\"position\":5,\"quality\":192}",
	               "{\"time\":\"2026-03-01T12:00:00.000000Z\",\"quality\":\"good\",\"values\":{"
	               "\"axis_state\":\"Disabled\",\"status\":[],\"position\":5}}");
	text = db_mqtt_picture_take(*state, NULL, NOON);
	assert_string_equal(text,
	                    "{\"time\":\"2026-03-01T12:00:00.000000Z\",\"quality\":\"bad\","
	                    "\"values\":{\"axis_state\":null,\"status\":null,\"position\":null}}");
	free(text);
	text = db_mqtt_picture_write(picture, picture->values);
	assert_non_null(strstr(text, "\"position\":null"));
	free(text);
}

static void test_when_the_state_is_due(void **state)
{
	const db_time interval = 5 * DB_NS_PER_S, refresh = 60 * DB_NS_PER_S;

	assert_true(db_mqtt_picture_state_is_due(*state, interval, refresh, 100));
	assert_false(db_mqtt_picture_state_is_due(*state, interval, refresh, 100 + interval));
	free(db_mqtt_picture_take(*state, NULL, NOON));
	assert_false(db_mqtt_picture_state_is_due(*state, interval, refresh, 99 + interval));
	assert_true(db_mqtt_picture_state_is_due(*state, interval, refresh, 100 + interval));
	assert_false(
		db_mqtt_picture_state_is_due(*state, interval, refresh, 99 + interval + refresh));
	assert_true(
		db_mqtt_picture_state_is_due(*state, interval, refresh, 100 + interval + refresh));
}

static void test_about(void **state)
{
	char *text = db_mqtt_picture_write_about(*state);

	assert_string_equal(
		text,
		"{\"drive\":\"lift\",\"bus\":\"press\",\"unit_name\":\"mm\",\"values\":{\"axis_state\":{"
		"\"type\":\"u16\",\"codes\":{\"1\":\"Disabled\",\"2\":\"Standstill\"}},\"status\":{\"type\":"
		"\"bits16\",\"codes\":{\"0\":\"online\",\"3\":\"moving\"}},\"position\":{\"type\":\"i32\","
		"\"unit\":\"counts\"}}}");
	free(text);
}

static void test_topics(void **state)
{
	static const struct {
		const char *topic;
		const char *drive; /* NULL: it is none */
		const char *sender;
	} rows[] = {
		{ "a/b/gw/drive/lift/command", "lift", "" },
		{ "a/b/gw/drive/lift/command/anna", "lift", "anna" },
		{ "a/b/gw/drive/lift/command/", NULL, "" },
		{ "a/b/gw/drive/lift/command/anna/otto", NULL, "" },
		{ "a/b/gw/drive/lift/commands", NULL, "" },
		{ "a/b/gw/drive/lift/state", NULL, "" },
		{ "a/b/gw/drive//command", NULL, "" },
		{ "a/b/gw/drive/lift/x/command", NULL, "" },
		{ "a/b/other/drive/lift/command", NULL, "" },
		{ "a/b/gw/drive/a-name-that-is-longer-than-any-drive-has/command", NULL, "" },
	};
	char prefix[] = "a/b";
	char gateway[] = "gw";
	const struct db_mqtt_config config = { .prefix = prefix, .gateway = gateway };
	char drive[DB_MQTT_NAME_MAX];
	char sender[DB_MQTT_TOPIC_MAX];

	(void)state;
	assert_string_equal(db_mqtt_topic_of_part(&config, "drive", "lift", "command").text,
	                    "a/b/gw/drive/lift/command");
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		assert_int_equal(
			db_mqtt_topic_is_of_drive(rows[i].topic, &config, "command", drive, sender),
			rows[i].drive != NULL);
		if (!rows[i].drive)
			continue;
		assert_string_equal(drive, rows[i].drive);
		assert_string_equal(sender, rows[i].sender);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_what_changed_in_words, open_picture,
		                                close_picture),
		cmocka_unit_test_setup_teardown(test_nothing_old_is_shown_as_new, open_picture,
		                                close_picture),
		cmocka_unit_test_setup_teardown(test_when_the_state_is_due, open_picture,
		                                close_picture),
		cmocka_unit_test_setup_teardown(test_about, open_picture, close_picture),
		cmocka_unit_test(test_topics),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
