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
	struct db_grant grant; /* of the sender */
	struct db_mqtt_arrival arrival;
	char why[DB_MQTT_REASON_MAX];
};

static int open_desk(void **state)
{
	static struct desk desk;

	desk = (struct desk){
		.config = { .age_ms = 2000,
		            .allow = { .word = DB_MQTT_ALLOW_ALL },
		            .parameters = DB_MQTT_ON,
		            .role = DB_MQTT_ROLE_ENGINEER },
		.grant = { DB_ROLE_ENGINEER, true, "*" },
		.arrival = { .drive = "lift",
		             .grant = &desk.grant,
		             .now = 100 * DB_NS_PER_S,
		             .us = NOON,
		             .sent_behind = 99 * DB_NS_PER_S },
	};
	*state = &desk;
	return 0;
}

static const char *parse(const char *text, struct db_mqtt_command *command)
{
	json_t *stops = json_pack("{s:b, s:b, s:b}", "stop", 1, "quick_stop", 1, "disable", 1);
	const char *wrong = db_mqtt_command_parse(text, strlen(text), stops, command);

	json_decref(stops);
	return wrong;
}

/* "" for what is carried out. */
static const char *judge(struct desk *desk, const char *text)
{
	struct db_mqtt_command command;
	const char *wrong = parse(text, &command);
	const char *refusal = wrong ? "bad_message" :
	                              db_mqtt_admission_judge(&desk->config, &command,
	                                                      &desk->arrival, desk->why);

	db_mqtt_command_clear(&command);
	return refusal ? refusal : "";
}

#define AT_NOON "\"time\":\"2026-03-01T12:00:00Z\""
#define MOVE(id) "{\"id\":\"" id "\"," AT_NOON ",\"command\":\"move_absolute\"}"

static void test_a_good_one(void **state)
{
	assert_string_equal(judge(*state, MOVE("1")), "");
	assert_string_equal(judge(*state, "{\"id\":3," AT_NOON ",\"write\":{\"spd\":5}}"), "");
	assert_string_equal(judge(*state, "{" AT_NOON ",\"command\":\"home\"}"), "bad_message");
}

static void test_retained_never(void **state)
{
	((struct desk *)*state)->arrival.retained = true;
	assert_string_equal(judge(*state, MOVE("1")), "retained");
	assert_string_equal(judge(*state, "{\"command\":\"stop\"}"), "retained");
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

/* Of the sender and of all of MQTT: each of them bounds the other. */
static void test_roles(void **state)
{
	static const char *const messages[] = {
		"{\"command\":\"stop\"}",
		"{\"command\":\"disable\"}",
		MOVE("1"),
		"{\"id\":2," AT_NOON ",\"write\":{\"target_position\":5}}",
		"{\"id\":2," AT_NOON ",\"write\":{\"target_position\":5,\"spd\":5}}",
		"{\"id\":3," AT_NOON ",\"command\":\"set_position\"}",
		"{\"id\":4," AT_NOON ",\"command\":\"sync_start\"}",
	};
	static const struct {
		unsigned whole;
		struct db_grant grant;
		const char *may; /* each of the messages */
	} rows[] = {
		{ DB_MQTT_ROLE_ENGINEER, { DB_ROLE_ENGINEER, true, "*" }, "xxxxxxx" },
		{ DB_MQTT_ROLE_OPERATOR, { DB_ROLE_ENGINEER, true, "*" }, "xxxx--x" },
		{ DB_MQTT_ROLE_OBSERVER, { DB_ROLE_ENGINEER, true, "*" }, "x------" },
		{ DB_MQTT_ROLE_ENGINEER, { DB_ROLE_OPERATOR, true, "*" }, "xxxx--x" },
		{ DB_MQTT_ROLE_ENGINEER, { DB_ROLE_ENGINEER, true, "press,lift" }, "xxxxxx-" },
		{ DB_MQTT_ROLE_ENGINEER, { DB_ROLE_ENGINEER, true, "press" }, "x------" },
		{ DB_MQTT_ROLE_ENGINEER, { DB_ROLE_ADMINISTRATOR, true, "*" }, "x------" },
		{ DB_MQTT_ROLE_ENGINEER, { DB_ROLE_OBSERVER, true, "*" }, "x------" },
	};
	struct desk *desk = *state;

	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		desk->config.role = rows[i].whole;
		desk->grant = rows[i].grant;
		for (size_t k = 0; k < sizeof(messages) / sizeof(messages[0]); k++)
			assert_string_equal(judge(desk, messages[k]),
			                    rows[i].may[k] == 'x' ? "" : "not_allowed");
	}
	assert_string_equal(desk->why, "this needs the role operator");
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

/* It may have been carried out before this program, or this run of the service, was there. */
/* A clock that is ahead makes an old message new. */
static void test_what_an_earlier_run_was_sent(void **state)
{
	struct desk *desk = *state;

	desk->arrival.served = desk->arrival.now - 100 * DB_NS_PER_MS;
	desk->arrival.newest_before = NOON - 1;
	assert_string_equal(judge(desk, MOVE("1")), "");
	desk->arrival.newest_before = NOON;
	assert_string_equal(judge(desk, MOVE("1")), "late");
	assert_non_null(strstr(desk->why, "both clocks"));
	assert_string_equal(judge(desk, "{\"command\":\"stop\"}"), "");
	/* Of a message without a time its id is what is known. */
	desk->config.time = DB_MQTT_TIME_OPTIONAL;
	desk->arrival.served = desk->arrival.now - 5 * DB_NS_PER_S;
	assert_string_equal(judge(desk, "{\"id\":2,\"command\":\"home\"}"), "");
	desk->arrival.had = true;
	assert_string_equal(judge(desk, "{\"id\":2,\"command\":\"home\"}"), "late");
	assert_non_null(strstr(desk->why, "id"));
	assert_string_equal(judge(desk, "{\"command\":\"stop\"}"), "");
}

static void test_what_was_sent_before(void **state)
{
	struct desk *desk = *state;
	db_time *const moments[] = { &desk->arrival.subscribed, &desk->arrival.served };

	desk->arrival.us = NOON + 500000;
	for (size_t i = 0; i < 2; i++) {
		desk->config.time = DB_MQTT_TIME_REQUIRED;
		*moments[i] = desk->arrival.now - 500 * DB_NS_PER_MS;
		assert_string_equal(judge(desk, MOVE("1")), "");
		*moments[i] += 1 * DB_NS_PER_US;
		assert_string_equal(judge(desk, MOVE("1")), "late");
		assert_non_null(strstr(desk->why, i == 0 ? "broker" : "service"));
		assert_string_equal(judge(desk, "{\"command\":\"stop\"}"), "");
		assert_string_equal(judge(desk, "{\"command\":\"disable\"}"), "");
		/* Without a time nothing may have been sent before. */
		desk->config.time = DB_MQTT_TIME_OPTIONAL;
		assert_string_equal(judge(desk, "{\"id\":2,\"command\":\"home\"}"), "late");
		*moments[i] = desk->arrival.now - 1999 * DB_NS_PER_MS;
		assert_string_equal(judge(desk, "{\"id\":2,\"command\":\"home\"}"), "late");
		*moments[i] = desk->arrival.now - 2000 * DB_NS_PER_MS;
		assert_string_equal(judge(desk, "{\"id\":2,\"command\":\"home\"}"), "");
		*moments[i] = 0;
	}
}

/* Until then the same message could be taken again. */
static void test_what_is_left_of_its_time(void **state)
{
	static const struct {
		int64_t age_ms;
		unsigned left_ms;
	} cases[] = { { 0, 2000 }, { 1500, 500 }, { 2000, 1 }, { -2000, 4000 } };
	struct desk *desk = *state;
	struct db_mqtt_command command;

	assert_null(parse(MOVE("1"), &command));
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		desk->arrival.us = NOON + cases[i].age_ms * 1000;
		assert_int_equal(db_mqtt_admission_left_ms(&desk->config, &command, &desk->arrival),
		                 cases[i].left_ms);
	}
	command.timed = false;
	assert_int_equal(db_mqtt_admission_left_ms(&desk->config, &command, &desk->arrival), 2000);
	db_mqtt_command_clear(&command);
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
		cmocka_unit_test_setup(test_a_good_one, open_desk),
		cmocka_unit_test_setup(test_retained_never, open_desk),
		cmocka_unit_test_setup(test_what_is_allowed, open_desk),
		cmocka_unit_test_setup(test_roles, open_desk),
		cmocka_unit_test_setup(test_its_age, open_desk),
		cmocka_unit_test_setup(test_what_an_earlier_run_was_sent, open_desk),
		cmocka_unit_test_setup(test_what_was_sent_before, open_desk),
		cmocka_unit_test_setup(test_what_is_left_of_its_time, open_desk),
		cmocka_unit_test_setup(test_what_is_no_command, open_desk),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
