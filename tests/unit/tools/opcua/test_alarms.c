/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/alarms.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* The ids of the conditions that were told as changed. */
static void note(void *context, struct db_opcua_alarm *alarm)
{
	char *told = context;

	strcat(told, alarm->cause);
	strcat(told, alarm->present ? "+" : "-");
	strcat(told, alarm->acknowledged ? "! " : " ");
}

struct told {
	int id;
	int change;
	const char *name;
	const char *cause;
	int came;
	int gone;
	int acknowledged;
};

static void take(struct db_opcua_alarms *alarms, const struct told *told, size_t count, bool over,
                 char *changed)
{
	json_t *list = json_array();
	json_t *answer;

	for (size_t i = 0; i < count; i++)
		json_array_append_new(
			list,
			json_pack("{s:i, s:i, s:s, s:s, s:s, s:s, s:s, s:b, s:i, s:i, s:i, s:s}",
		                  "id", told[i].id, "change", told[i].change, "kind",
		                  told[i].name[0] ? "drive" : "configuration", "name", told[i].name,
		                  "cause", told[i].cause, "need", "act", "detail", "", "present",
		                  told[i].gone == 0, "came_us", told[i].came, "gone_us",
		                  told[i].gone, "acknowledged_us", told[i].acknowledged,
		                  "acknowledged_by", told[i].acknowledged ? "olga" : ""));
	answer = json_pack("{s:o, s:b}", "alarms", list, "over", over);
	changed[0] = '\0';
	db_opcua_alarms_take(alarms, answer, 1000, note, changed);
	json_decref(answer);
}

static struct db_opcua_alarm *find(const struct db_opcua_alarms *alarms, const char *id,
                                   enum db_opcua_member *member)
{
	return db_opcua_alarms_find(alarms, id, strlen(id), member);
}

static void test_the_first_list_tells_what_concerns_somebody(void **state)
{
	static const struct told first[] = {
		{ 1, 1, "feeder", "no_answer", 10, 20, 21 },
		{ 2, 2, "feeder", "fault", 30, 40, 0 },
	};
	static const struct told second[] = { { 3, 3, "", "wrong", 50, 0, 0 } };
	struct db_opcua_alarms alarms = { .list = NULL };
	char told[200];

	(void)state;
	db_opcua_alarms_begin(&alarms);
	take(&alarms, first, 2, false, told);
	assert_string_equal(told, "fault- ");
	take(&alarms, second, 1, true, told);
	assert_string_equal(told, "wrong+ ");
	/* A new connection says the same, and then that all but one is gone. */
	db_opcua_alarms_begin(&alarms);
	take(&alarms, first, 2, false, told);
	assert_string_equal(told, "");
	take(&alarms, second, 1, true, told);
	assert_string_equal(told, "");
	db_opcua_alarms_begin(&alarms);
	take(&alarms, second, 1, true, told);
	assert_string_equal(told, "fault-! ");
	db_opcua_alarms_free(&alarms);
}

static void test_a_condition_has_the_latest_alarm(void **state)
{
	static const struct told steps[] = {
		{ 1, 1, "feeder", "fault", 10, 0, 0 },   { 1, 2, "feeder", "fault", 10, 0, 15 },
		{ 1, 3, "feeder", "fault", 10, 20, 15 }, { 2, 4, "feeder", "fault", 30, 0, 0 },
		{ 1, 5, "feeder", "fault", 10, 20, 16 },
	};
	static const char *const told_then[] = { "fault+ ", "fault+! ", "fault-! ", "fault+ ", "" };
	struct db_opcua_alarms alarms = { .complete = true };
	enum db_opcua_member member;
	char told[200];

	(void)state;
	for (size_t i = 0; i < sizeof(steps) / sizeof(steps[0]); i++) {
		take(&alarms, &steps[i], 1, true, told);
		assert_string_equal(told, told_then[i]);
	}
	assert_int_equal(find(&alarms, "/Alarms.drive.feeder.fault", &member)->number, 2);
	db_opcua_alarms_free(&alarms);
}

/* Somebody acknowledges what he has seen, and not what came afterwards. */
static void test_events_of_before_it_came_again_do_not_count(void **state)
{
	static const struct told came = { 1, 1, "feeder", "fault", 10, 0, 0 };
	static const struct told gone = { 1, 2, "feeder", "fault", 10, 20, 0 };
	static const struct told again = { 1, 3, "feeder", "fault", 30, 0, 0 };
	struct db_opcua_alarms alarms = { .complete = true, .salt = { 1, 2, 3 } };
	uint8_t first[DB_OPCUA_EVENT_ID_SIZE];
	uint8_t second[DB_OPCUA_EVENT_ID_SIZE];
	struct db_opcua_alarm *alarm;
	char told[200];

	(void)state;
	take(&alarms, &came, 1, true, told);
	alarm = alarms.list;
	db_opcua_alarm_event_id(&alarms, alarm, first);
	assert_true(db_opcua_alarm_has_event(&alarms, alarm, first, sizeof(first)));
	assert_false(db_opcua_alarm_has_event(&alarms, alarm, first, sizeof(first) - 1));
	take(&alarms, &gone, 1, true, told);
	/* The same alarm, which has only gone. */
	assert_true(db_opcua_alarm_has_event(&alarms, alarm, first, sizeof(first)));
	take(&alarms, &again, 1, true, told);
	db_opcua_alarm_event_id(&alarms, alarm, second);
	assert_memory_not_equal(first, second, sizeof(first));
	assert_false(db_opcua_alarm_has_event(&alarms, alarm, first, sizeof(first)));
	assert_true(db_opcua_alarm_has_event(&alarms, alarm, second, sizeof(second)));
	second[0]++;
	assert_false(db_opcua_alarm_has_event(&alarms, alarm, second, sizeof(second)));
	db_opcua_alarms_free(&alarms);
}

static void test_ids_of_names_with_dots(void **state)
{
	static const struct told two[] = {
		{ 1, 1, "a", "fault", 10, 0, 0 },
		{ 2, 2, "a.fault", "AckedState", 10, 0, 0 },
	};
	struct db_opcua_alarms alarms = { .complete = true };
	enum db_opcua_member member;
	char told[200];

	(void)state;
	take(&alarms, two, 2, true, told);
	assert_int_equal(find(&alarms, "/Alarms.drive.a.fault", &member)->number, 1);
	assert_int_equal(member, DB_OPCUA_MEMBERS);
	assert_int_equal(find(&alarms, "/Alarms.drive.a.fault.Time", &member)->number, 1);
	assert_int_equal(member, DB_OPCUA_MEMBER_TIME);
	assert_int_equal(find(&alarms, "/Alarms.drive.a.fault.AckedState.Time", &member)->number,
	                 2);
	assert_int_equal(member, DB_OPCUA_MEMBER_TIME);
	assert_null(find(&alarms, "/Alarms.drive.a.fault.", &member));
	assert_null(find(&alarms, "/Alarms.drive.a.fault.Nope", &member));
	assert_null(find(&alarms, "/Alarms.drive.a", &member));
	db_opcua_alarms_free(&alarms);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_the_first_list_tells_what_concerns_somebody),
		cmocka_unit_test(test_a_condition_has_the_latest_alarm),
		cmocka_unit_test(test_events_of_before_it_came_again_do_not_count),
		cmocka_unit_test(test_ids_of_names_with_dots),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
