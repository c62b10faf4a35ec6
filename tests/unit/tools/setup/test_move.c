/* SPDX-License-Identifier: Apache-2.0 */
/* A drive gets another address or speed: with a bus whose drives answer, or not, where a test says. */
#include "setup/move.h"
#include "setup/sections.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

struct bus {
	json_t *description;
	json_t *places;        /* finds by "ADDRESS@SPEED" */
	const char *yes;       /* the answers to the questions: y or n; then y */
	const char *set_fails; /* `what` for which SetUp fails */
	const char *why;       /* of that error */
	const char *error;     /* its name */
	bool goes_at_once;     /* it adopts the value when it is set */
	bool goes_at_power_up; /* ... and when a pause is over */
	bool stays, vanishes; /* in addition it answers where it was; it does not answer any more */
	bool terminal;        /* not a page */
	db_time now;
	char log[1024];
	char said[4096];
	char failed[2048];
};

static json_t *find_of(int address, int speed, const char *verdict, const char *drive)
{
	json_t *find = json_pack("{s:i, s:i, s:s, s:s, s:[s*]}", "address", address, "speed", speed,
	                         "verdict", verdict, "identity", "VSMD113", "drives", drive);

	return find;
}

static void put(struct bus *bus, int address, int speed, const char *verdict, const char *drive)
{
	char place[32];

	(void)snprintf(place, sizeof(place), "%d@%d", address, speed);
	(void)json_object_set_new(bus->places, place, find_of(address, speed, verdict, drive));
}

static int set_up(void **state)
{
	struct bus *bus = calloc(1, sizeof(*bus));

	bus->description = json_pack("{s:s, s:s, s:b, s:i, s:s, s:s}", "name", "line", "protocol",
	                             "vsmd-serial", "can", 0, "speed", 115200, "address_effect",
	                             "power_up", "speed_effect", "power_up");
	bus->places = json_object();
	bus->yes = "";
	bus->error = DB_CLIENT_SERVICE "ScanFailed";
	put(bus, 2, 115200, "one", NULL);
	*state = bus;
	return 0;
}

static int tear_down(void **state)
{
	struct bus *bus = *state;

	json_decref(bus->description);
	json_decref(bus->places);
	free(bus);
	return 0;
}

__attribute__((format(printf, 3, 4))) static void note(char *text, size_t size, const char *format,
                                                       ...)
{
	size_t used = strlen(text);
	va_list arguments;

	va_start(arguments, format);
	(void)vsnprintf(text + used, size - used, format, arguments);
	va_end(arguments);
}

static void go(struct bus *bus, const struct db_setup_move *move)
{
	if (move->is_address)
		put(bus, (int)move->to, 115200, "one", NULL);
	else
		put(bus, (int)move->from, (int)move->to, "one", NULL);
	if (!bus->stays)
		(void)json_object_del(bus->places, "2@115200");
}

static void do_set(struct bus *bus, struct db_setup_move *move,
                   const struct db_setup_action *action)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *parameters = json_pack("{s:s}", "why", bus->why ? bus->why : "");

	note(bus->log, sizeof(bus->log), "set %d %s", (int)action->address, action->what);
	note(bus->log, sizeof(bus->log), action->has_value ? " %d;" : ";", (int)move->to);
	if (bus->goes_at_once)
		go(bus, move);
	if (bus->vanishes)
		(void)json_object_clear(bus->places);
	if (bus->set_fails && strcmp(bus->set_fails, action->what) == 0) {
		db_client_error_read(&error, bus->error, parameters);
		(void)snprintf(error.text, sizeof(error.text), "it does not");
		(void)db_setup_move_fail(move, &error);
	} else {
		db_setup_move_take(move, NULL, false, 0);
	}
	db_client_error_clear(&error);
	json_decref(parameters);
}

static void look(struct bus *bus, struct db_setup_move *move, const struct db_setup_action *action)
{
	char place[64];
	json_t *finds;

	(void)snprintf(place, sizeof(place), "%d@%d", (int)action->address,
	               action->speed ? (int)action->speed : 115200);
	note(bus->log, sizeof(bus->log), "look %s;", place);
	finds = json_pack("[O*]", json_object_get(bus->places, place));
	db_setup_move_take(move, finds, false, bus->now);
	json_decref(finds);
}

/* To its end. True: done. */
static bool run(struct bus *bus, struct db_setup_move move)
{
	move.bus = bus->description;
	move.from = 2;
	move.on_page = !bus->terminal;
	assert_null(db_setup_move_check(&move));
	for (unsigned turn = 0; turn < 1000; turn++) {
		struct db_setup_action action = db_setup_move_next(&move, bus->now);

		switch (action.kind) {
		case DB_SETUP_LOOK:
			look(bus, &move, &action);
			break;
		case DB_SETUP_SET:
			do_set(bus, &move, &action);
			break;
		case DB_SETUP_ASK:
			note(bus->log, sizeof(bus->log), "ask;");
			db_setup_move_take(&move, NULL, *bus->yes != 'n', bus->now);
			bus->yes += *bus->yes ? 1 : 0;
			if (bus->goes_at_power_up && !action.question)
				go(bus, &move);
			break;
		case DB_SETUP_PAUSE:
			bus->now += DB_SETUP_PAUSE_MS * DB_NS_PER_MS;
			if (bus->goes_at_power_up)
				go(bus, &move);
			db_setup_move_take(&move, NULL, false, bus->now);
			break;
		case DB_SETUP_SAY:
			note(bus->said, sizeof(bus->said), "%s|%s;", action.text,
			     action.configuration);
			break;
		case DB_SETUP_FAIL:
			note(bus->failed, sizeof(bus->failed), "%s;", action.text);
			break;
		case DB_SETUP_END:
		default:
			db_client_error_clear(&move.error);
			assert_int_equal(move.done, bus->failed[0] == '\0' && bus->yes[0] == '\0');
			return move.done;
		}
	}
	fail_msg("it does not end: %s", bus->log);
	return false;
}

static const struct db_setup_move to_9 = { .is_address = true, .to = 9 };
static const struct db_setup_move to_57600 = { .to = 57600 };

static void test_an_address_is_looked_at_set_saved_and_looked_for(void **state)
{
	struct bus *bus = *state;

	bus->goes_at_power_up = true;
	assert_true(run(bus, to_9));
	assert_string_equal(bus->log, "look 2@115200;look 9@115200;ask;set 2 address 9;look "
	                              "2@115200;ask;set 2 save;look 9@115200;look 9@115200;look "
	                              "2@115200;");
	assert_non_null(strstr(bus->said, "done: it answers at address 9. A scan of line"));
	assert_string_equal(bus->failed, "");
}

static void test_a_configured_drive_has_its_section(void **state)
{
	struct bus *bus = *state;

	bus->goes_at_power_up = true;
	put(bus, 2, 115200, "one", "feeder");
	assert_true(run(bus, to_9));
	assert_non_null(strstr(bus->said, "|drive feeder {\n    address = 9\n    ...\n;"));
}

static void expect_nothing_set(void **state, const char *failed)
{
	struct bus *bus = *state;

	assert_false(run(bus, to_9));
	assert_null(strstr(bus->log, "set"));
	assert_non_null(strstr(bus->failed, failed));
	assert_null(strstr(bus->failed, "may be found"));
}

static void test_nothing_is_set_when_none_answers(void **state)
{
	struct bus *bus = *state;

	(void)json_object_clear(bus->places);
	expect_nothing_set(state, "no drive answers at address 2 of line; a scan finds");
}

static void test_nothing_is_set_when_two_answer(void **state)
{
	put(*state, 2, 115200, "two", NULL);
	expect_nothing_set(state, "more than one drive answers at address 2");
}

static void test_nothing_is_set_when_the_place_is_taken(void **state)
{
	put(*state, 9, 115200, "garbled", NULL);
	expect_nothing_set(state, "is taken: somebody answers there; choose another one. Nothing");
}

static void test_nothing_is_set_when_nobody_wants_it(void **state)
{
	struct bus *bus = *state;

	bus->yes = "n";
	expect_nothing_set(state, "nothing was changed");
}

static void expect_doubt(void **state, struct db_setup_move move, const char *failed)
{
	struct bus *bus = *state;

	assert_false(run(bus, move));
	assert_string_equal(bus->failed, failed);
}

#define WHERE ": the drive may be found at address 2 or 9 of line; a scan of line shows where;"

static void test_one_that_vanishes_is_told_of(void **state)
{
	struct bus *bus = *state;

	bus->vanishes = true;
	expect_doubt(state, to_9, "it was told and does not answer to be saved" WHERE);
}

static void test_one_that_is_not_to_be_saved_is_told_of(void **state)
{
	struct bus *bus = *state;

	bus->yes = "yn";
	expect_doubt(state, to_9, "it was not saved" WHERE);
}

static void test_one_that_cannot_be_saved_is_told_of(void **state)
{
	struct bus *bus = *state;

	bus->set_fails = "save";
	expect_doubt(state, to_9, "it does not;it was not saved" WHERE);
}

static void test_one_that_is_not_there_afterwards_is_told_of(void **state)
{
	expect_doubt(state, to_9, "it does not answer where it should" WHERE);
}

static void test_one_at_both_addresses_is_told_of(void **state)
{
	struct bus *bus = *state;

	bus->goes_at_power_up = bus->stays = true;
	expect_doubt(state, to_9, "somebody still answers at its former address" WHERE);
}

static void test_a_lost_connection_leaves_doubt(void **state)
{
	struct bus *bus = *state;

	bus->set_fails = "address";
	bus->error = DB_CLIENT_LOST;
	expect_doubt(state, to_9, "it does not;it was told, and may have taken it" WHERE);
}

static void test_a_refusal_leaves_none(void **state)
{
	struct bus *bus = *state;

	bus->set_fails = "address";
	bus->why = "moves";
	expect_doubt(state, to_9, "it does not;");
}

static void test_one_that_goes_at_once_may_not_have_answered(void **state)
{
	struct bus *bus = *state;

	(void)json_object_set_new(bus->description, "address_effect", json_string("at_once"));
	bus->set_fails = "address";
	bus->why = "silent";
	bus->goes_at_once = true;
	assert_true(run(bus, to_9));
	assert_string_equal(bus->log, "look 2@115200;look 9@115200;ask;set 2 address 9;look "
	                              "2@115200;look 9@115200;look 9@115200;look 2@115200;");
}

static void test_a_speed_is_looked_for_once_when_somebody_says_so(void **state)
{
	struct bus *bus = *state;

	bus->goes_at_power_up = true;
	assert_true(run(bus, to_57600));
	assert_string_equal(bus->log, "look 2@115200;ask;set 2 speed 57600;look 2@115200;ask;set 2 "
	                              "save;ask;look 2@57600;");
	assert_non_null(strstr(bus->said, "|bus line {\n    baud = 57600\n    ...\n;"));
}

static void test_a_speed_that_it_does_not_have_is_told_of(void **state)
{
	expect_doubt(
		state, to_57600,
		"it does not answer where it should: the drive at address 2 may be found at its "
		"former speed or at 57600 bit/s; a scan of line at all speeds shows where;");
}

static void test_what_a_family_cannot_is_said_by_the_service(void **state)
{
	struct bus *bus = *state;

	(void)json_object_set_new(bus->description, "speed_effect", json_string("never"));
	bus->set_fails = "speed";
	expect_doubt(state, to_57600, "it does not;");
	assert_string_equal(bus->log, "set 2 speed 57600;");
}

static void test_a_terminal_gets_commands(void **state)
{
	struct bus *bus = *state;

	bus->terminal = bus->goes_at_power_up = true;
	assert_true(run(bus, to_57600));
	assert_string_equal(bus->said, "now switch its power off and on, and press Enter|;done: it "
	                               "answers at 57600 bit/s. When all drives of the bus do:|bus "
	                               "line {\n    baud = 57600\n    ...\n;");
}

/* --- sections --------------------------------------------------------------------------------- */

static void expect_sections(const json_t *bus, json_t *finds, json_t *drives, const char *expected)
{
	char *text = db_setup_write_sections(bus, finds, drives);

	assert_string_equal(text, expected);
	free(text);
	json_decref(finds);
	json_decref(drives);
}

static void test_new_drives_have_sections(void **state)
{
	struct bus *bus = *state;
	json_t *nameless = find_of(3, 115200, "one", NULL);

	(void)json_object_set_new(nameless, "identity", json_string(""));
	expect_sections(
		bus->description,
		json_pack("[o,o,o,o,o,o]", find_of(1, 115200, "one", "feeder"),
	                  find_of(2, 115200, "one", NULL), nameless,
	                  find_of(4, 115200, "two", NULL), find_of(5, 9600, "one", NULL),
	                  find_of(6, 9600, "one", NULL)),
		json_pack("[{s:s, s:i}, {s:s, s:i}]", "name", "feeder", "unit", 1, "name", "line-3",
	                  "unit", 3),
		"drive line-2 {    # VSMD113\n    bus = line\n    address = 2\n    unit = 2\n}\n"
		"drive line-3-b {\n    bus = line\n    address = 3\n    unit = 4\n}\n"
		"# at 9600 bit/s, while bus line is set to 115200: all drives of a bus and its "
		"baud must be the same\n"
		"drive line-5 {    # VSMD113\n    bus = line\n    address = 5\n    unit = 5\n}\n"
		"drive line-6 {    # VSMD113\n    bus = line\n    address = 6\n    unit = 6\n}\n");
	(void)json_object_set_new(bus->description, "axes", json_integer(4));
	expect_sections(
		bus->description, json_pack("[o]", find_of(0, 115200, "one", NULL)), json_array(),
		"drive line-0 {    # VSMD113\n    bus = line\n    axis = x    # and a drive each "
		"for y, z and a, as far as it has them\n    unit = 247\n}\n");
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
	const struct CMUnitTest tests[] = {
		TEST(test_an_address_is_looked_at_set_saved_and_looked_for),
		TEST(test_a_configured_drive_has_its_section),
		TEST(test_nothing_is_set_when_none_answers),
		TEST(test_nothing_is_set_when_two_answer),
		TEST(test_nothing_is_set_when_the_place_is_taken),
		TEST(test_nothing_is_set_when_nobody_wants_it),
		TEST(test_one_that_vanishes_is_told_of),
		TEST(test_one_that_is_not_to_be_saved_is_told_of),
		TEST(test_one_that_cannot_be_saved_is_told_of),
		TEST(test_one_that_is_not_there_afterwards_is_told_of),
		TEST(test_one_at_both_addresses_is_told_of),
		TEST(test_a_lost_connection_leaves_doubt),
		TEST(test_a_refusal_leaves_none),
		TEST(test_one_that_goes_at_once_may_not_have_answered),
		TEST(test_a_speed_is_looked_for_once_when_somebody_says_so),
		TEST(test_a_speed_that_it_does_not_have_is_told_of),
		TEST(test_what_a_family_cannot_is_said_by_the_service),
		TEST(test_a_terminal_gets_commands),
		TEST(test_new_drives_have_sections),
	};

	return cmocka_run_group_tests_name("setup: moves and sections", tests, NULL, NULL);
}
