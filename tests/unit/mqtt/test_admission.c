/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/admission.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

/* 2026-03-01T12:00:00Z */
#define NOON INT64_C(1772366400000000)

struct desk {
	struct db_mqtt_config config;
	struct db_mqtt_admission *admission;
	struct db_mqtt_arrival arrival;
	char why[DB_MQTT_REASON_MAX];
};

static int open_desk(void **state)
{
	static struct desk desk;

	desk = (struct desk){
		.config = { .age_ms = 2000,
		            .allow = { .word = DB_MQTT_ALLOW_ALL },
		            .parameters = DB_MQTT_ON },
		.arrival = { .drive = "lift",
		             .now = 100 * DB_NS_PER_S,
		             .us = NOON,
		             .sent_behind = 99 * DB_NS_PER_S },
	};
	desk.admission = db_mqtt_admission_new(&desk.config);
	*state = &desk;
	return desk.admission ? 0 : -1;
}

static int close_desk(void **state)
{
	struct desk *desk = *state;

	db_mqtt_admission_free(desk->admission);
	return 0;
}

/* "" for what is carried out. */
static const char *judge(struct desk *desk, const char *text)
{
	struct db_mqtt_command command;
	const char *wrong = db_mqtt_command_parse(text, strlen(text), &command);
	const char *refusal = wrong ? "bad_message" :
	                              db_mqtt_admission_judge(desk->admission, &command,
	                                                      &desk->arrival, desk->why);

	db_mqtt_command_clear(&command);
	return refusal ? refusal : "";
}

#define AT_NOON "\"time\":\"2026-03-01T12:00:00Z\""
#define MOVE(id) "{\"id\":\"" id "\"," AT_NOON ",\"command\":\"move_absolute\"}"

static void test_a_good_one_once(void **state)
{
	assert_string_equal(judge(*state, MOVE("1")), "");
	assert_string_equal(judge(*state, MOVE("1")), "duplicate");
	assert_string_equal(judge(*state, MOVE("2")), "");
	((struct desk *)*state)->arrival.drive = "feeder";
	assert_string_equal(judge(*state, MOVE("1")), "");
	assert_string_equal(judge(*state, "{\"id\":3," AT_NOON ",\"write\":{\"spd\":5}}"), "");
	assert_string_equal(judge(*state, "{\"id\":\"3\"," AT_NOON ",\"command\":\"enable\"}"),
	                    "duplicate");
}

static void test_retained_never(void **state)
{
	((struct desk *)*state)->arrival.retained = true;
	assert_string_equal(judge(*state, MOVE("1")), "retained");
	assert_string_equal(judge(*state, "{\"command\":\"stop\"}"), "retained");
	/* And is not taken for the first one of two. */
	((struct desk *)*state)->arrival.retained = false;
	assert_string_equal(judge(*state, MOVE("1")), "");
}

static void test_what_is_allowed(void **state)
{
	struct desk *desk = *state;
	char names[] = "home\0enable\0";

	desk->config.parameters = DB_MQTT_OFF;
	assert_string_equal(judge(desk, "{\"id\":1," AT_NOON ",\"write\":{\"spd\":5}}"),
	                    "not_allowed");
	desk->config.allow.word = DB_MQTT_ALLOW_STOP;
	assert_string_equal(judge(desk, MOVE("1")), "not_allowed");
	assert_string_equal(judge(desk, "{\"command\":\"quick_stop\"}"), "");
	assert_string_equal(judge(desk, "{\"command\":\"disable\"}"), "");
	desk->config.allow = (struct db_setting_list){ DB_SETTING_NAMED, names };
	assert_string_equal(judge(desk, MOVE("1")), "not_allowed");
	assert_string_equal(judge(desk, "{\"command\":\"stop\"}"), "not_allowed");
	assert_string_equal(judge(desk, "{\"id\":1," AT_NOON ",\"command\":\"enable\"}"), "");
	desk->config.command_drives = (struct db_setting_list){ DB_SETTING_NAMED, names };
	assert_string_equal(judge(desk, "{\"id\":2," AT_NOON ",\"command\":\"enable\"}"),
	                    "not_allowed");
	desk->config.allow.word = DB_MQTT_ALLOW_NONE;
	desk->config.command_drives.word = DB_MQTT_ALL;
	assert_string_equal(judge(desk, "{\"id\":2," AT_NOON ",\"command\":\"enable\"}"),
	                    "not_allowed");
}

static void test_its_age(void **state)
{
	struct desk *desk = *state;

	desk->arrival.us = NOON + 2000000;
	assert_string_equal(judge(desk, MOVE("1")), "");
	desk->arrival.us = NOON + 2001000;
	assert_string_equal(judge(desk, MOVE("2")), "late");
	desk->arrival.us = NOON - 2001000;
	assert_string_equal(judge(desk, MOVE("2")), "late");
	desk->arrival.us = NOON;
	/* The line stood still, whatever the clocks say. */
	desk->arrival.sent_behind = desk->arrival.now - 2001 * DB_NS_PER_MS;
	assert_string_equal(judge(desk, MOVE("2")), "late");
	assert_string_equal(judge(desk, "{\"command\":\"disable\"}"), "");
	assert_string_equal(judge(desk, "{\"command\":\"stop\"}"), "");
	desk->arrival.sent_behind = desk->arrival.now;
	assert_string_equal(judge(desk, "{\"id\":2,\"command\":\"home\"}"), "bad_message");
	desk->config.time = DB_MQTT_TIME_OPTIONAL;
	assert_string_equal(judge(desk, "{\"id\":2,\"command\":\"home\"}"), "");
	assert_string_equal(judge(desk, "{\"command\":\"home\"}"), "bad_message");
}

/* An id is not forgotten before what has it would be too old. */
static void test_too_many(void **state)
{
	struct desk *desk = *state;
	char text[128];

	for (int i = 0; i < 1024; i++) {
		(void)snprintf(text, sizeof(text), "{\"id\":%d," AT_NOON ",\"command\":\"home\"}",
		               i);
		assert_string_equal(judge(desk, text), "");
	}
	assert_string_equal(judge(desk, MOVE("x")), "busy");
	assert_string_equal(judge(desk, "{\"command\":\"stop\"}"), "");
	desk->arrival.now += 5 * DB_NS_PER_S;
	desk->arrival.sent_behind = desk->arrival.now;
	assert_string_equal(judge(desk, MOVE("x")), "");
	assert_string_equal(judge(desk, MOVE("x")), "duplicate");
}

static void test_what_is_no_command(void **state)
{
	static const char *const wrong[] = {
		"",
		"5",
		"[]",
		"{}",
		"{\"id\":1}",
		"{\"id\":1.5,\"command\":\"stop\"}",
		"{\"id\":\"\",\"command\":\"stop\"}",
		"{\"id\":null,\"command\":\"stop\"}",
		"{\"id\":\"a\\u0000b\",\"command\":\"stop\"}",
		"{\"command\":\"stop\",\"write\":{}}",
		"{\"command\":\"stop\",\"arguments\":[]}",
		"{\"write\":{\"spd\":1},\"arguments\":{}}",
		"{\"write\":[]}",
		"{\"command\":7}",
		"{\"command\":\"stop\",\"user\":7}",
		"{\"command\":\"stop\",\"user\":\"\"}",
		"{\"command\":\"stop\",\"user\":\"an\\nna\"}",
		"{\"command\":\"stop\",\"user\":\"abcdefghijabcdefghijabcdefghijabc\"}",
		"{\"command\":\"stop\",\"commnad\":1}",
		"{\"command\":\"stop\",\"command\":\"enable\"}",
		"{\"time\":5,\"command\":\"stop\"}",
		"{\"time\":\"noon\",\"command\":\"stop\"}",
		"{\"command\":\"stop\"} ,",
	};
	char id[DB_MQTT_ID_MAX + 32];

	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++)
		assert_string_equal(judge(*state, wrong[i]), "bad_message");
	(void)snprintf(id, sizeof(id), "{\"id\":\"%065d\",\"command\":\"stop\"}", 1);
	assert_string_equal(judge(*state, id), "bad_message");
	(void)snprintf(id, sizeof(id), "{\"id\":\"%064d\",\"command\":\"stop\"}", 1);
	assert_string_equal(judge(*state, id), "");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_a_good_one_once, open_desk, close_desk),
		cmocka_unit_test_setup_teardown(test_retained_never, open_desk, close_desk),
		cmocka_unit_test_setup_teardown(test_what_is_allowed, open_desk, close_desk),
		cmocka_unit_test_setup_teardown(test_its_age, open_desk, close_desk),
		cmocka_unit_test_setup_teardown(test_too_many, open_desk, close_desk),
		cmocka_unit_test_setup_teardown(test_what_is_no_command, open_desk, close_desk),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
