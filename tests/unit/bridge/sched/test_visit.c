/* SPDX-License-Identifier: Apache-2.0 */
/* One address of a scan: how often it is asked what, and what its answers show. */
#include "sched/visit.h"

#include "driver/list.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#define ADDRESS 7
#define NEW_ADDRESS 9

static const struct visit_outcome silence = { .answered = false };
static const struct visit_outcome answer = { .answered = true, .time_us = 1000 };
static const struct visit_outcome two = { .answered = true, .doubled = true, .time_us = 1000 };
static const struct visit_outcome noise = { .garbled = true };
static const struct visit_outcome torn = { .garbled = true, .doubled = true };

static struct visit look(void)
{
	struct visit visit;

	visit_begin(&visit, &db_driver_vsmd_serial, 9600, ADDRESS, DB_INQUIRY_THERE, 0);
	return visit;
}

static struct visit set_address(const struct db_driver *driver)
{
	struct visit visit;

	visit_begin(&visit, driver, 9600, ADDRESS, DB_INQUIRY_SET_ADDRESS, NEW_ADDRESS);
	return visit;
}

/* The question that is next, of this kind and with this value, has this outcome. */
static void ask(struct visit *visit, enum db_inquiry_kind kind, unsigned value,
                const struct visit_outcome *outcome)
{
	struct db_inquiry inquiry;

	assert_true(visit_next(visit, &inquiry));
	assert_int_equal(inquiry.kind, kind);
	assert_int_equal(inquiry.address, ADDRESS);
	assert_int_equal(inquiry.value, value);
	visit_add_outcome(visit, &inquiry, outcome);
}

/* All questions whether a drive is there, each answered in this way. The number of them. */
static unsigned ask_presence(struct visit *visit, const struct visit_outcome *outcome)
{
	struct db_inquiry inquiry;
	unsigned count = 0;

	while (visit_next(visit, &inquiry) && inquiry.kind == DB_INQUIRY_THERE) {
		visit_add_outcome(visit, &inquiry, outcome);
		count++;
	}
	return count;
}

static bool is_over(const struct visit *visit)
{
	struct db_inquiry inquiry;

	return !visit_next(visit, &inquiry);
}

static struct visit_outcome of(const char *identity)
{
	struct visit_outcome outcome = answer;

	snprintf(outcome.said.identity, sizeof(outcome.said.identity), "%s", identity);
	return outcome;
}

/* --- looking ---------------------------------------------------------------------------------- */

static void a_silent_address_is_asked_twice(void **state)
{
	struct visit visit = look();

	(void)state;
	ask(&visit, DB_INQUIRY_THERE, 0, &silence);
	ask(&visit, DB_INQUIRY_THERE, 1, &silence);
	assert_true(is_over(&visit));
	assert_false(visit_end(&visit));
	assert_int_equal(visit.find.asked, 2);
	assert_int_equal(visit.find.answered, 0);
}

static void where_something_is_heard_it_is_asked_five_times(void **state)
{
	struct visit visit = look();

	(void)state;
	ask(&visit, DB_INQUIRY_THERE, 0, &noise);
	assert_int_equal(ask_presence(&visit, &silence), 4);
	assert_true(is_over(&visit));
	assert_true(visit_end(&visit));
	assert_int_equal(visit.find.verdict, DB_SCAN_GARBLED);
	assert_int_equal(visit.find.garbled, 1);
	/* Also from the second question on. */
	visit = look();
	ask(&visit, DB_INQUIRY_THERE, 0, &silence);
	ask(&visit, DB_INQUIRY_THERE, 1, &answer);
	assert_int_equal(ask_presence(&visit, &silence), 3);
	assert_int_equal(visit.find.asked, 5);
	assert_int_equal(visit.find.answered, 1);
}

/* Questions differ as long as none was answered: a drive may only know one form. */
static void the_form_that_was_answered_is_kept(void **state)
{
	const struct visit_outcome named = of("VSMD");
	struct visit visit = look();

	(void)state;
	ask(&visit, DB_INQUIRY_THERE, 0, &silence);
	ask(&visit, DB_INQUIRY_THERE, 1, &answer);
	ask(&visit, DB_INQUIRY_THERE, 1, &silence);
	ask(&visit, DB_INQUIRY_THERE, 1, &answer);
	ask(&visit, DB_INQUIRY_THERE, 1, &answer);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &silence);
	ask(&visit, DB_INQUIRY_IDENTITY, 1, &named);
	ask(&visit, DB_INQUIRY_IDENTITY, 1, &silence);
	assert_true(is_over(&visit));
	assert_string_equal(visit.find.identity, "VSMD");
	assert_string_equal(visit.find.other, "");
}

static void a_family_without_identities_is_not_asked_again(void **state)
{
	struct visit visit = look();

	(void)state;
	assert_int_equal(ask_presence(&visit, &answer), 5);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, NULL);
	assert_true(is_over(&visit));
	assert_true(visit_end(&visit));
	assert_int_equal(visit.find.verdict, DB_SCAN_ONE);
	assert_int_equal(visit.find.asked, 5);
}

static void answers_are_timed(void **state)
{
	struct visit_outcome outcome = answer;
	struct visit visit = look();

	(void)state;
	outcome.time_us = 2000;
	ask(&visit, DB_INQUIRY_THERE, 0, &outcome);
	assert_int_equal(visit.find.time_min_us, 2000);
	assert_int_equal(visit.find.time_max_us, 2000);
	outcome.time_us = 1000;
	ask(&visit, DB_INQUIRY_THERE, 0, &outcome);
	outcome.time_us = 4500;
	ask(&visit, DB_INQUIRY_THERE, 0, &outcome);
	/* No answer has no time. */
	ask(&visit, DB_INQUIRY_THERE, 0, &silence);
	ask(&visit, DB_INQUIRY_THERE, 0, &noise);
	assert_int_equal(visit.find.time_min_us, 1000);
	assert_int_equal(visit.find.time_mean_us, 2500);
	assert_int_equal(visit.find.time_max_us, 4500);
}

/* --- one drive or two ------------------------------------------------------------------------- */

static enum db_scan_verdict verdict(struct visit *visit)
{
	assert_true(visit_end(visit));
	return visit->find.verdict;
}

static void damage_that_occurs_once_is_the_lines(void **state)
{
	struct visit visit = look();

	(void)state;
	/* A single answer is enough: there is a drive. */
	ask(&visit, DB_INQUIRY_THERE, 0, &answer);
	assert_int_equal(verdict(&visit), DB_SCAN_ONE);
	visit = look();
	ask(&visit, DB_INQUIRY_THERE, 0, &noise);
	(void)ask_presence(&visit, &answer);
	assert_int_equal(verdict(&visit), DB_SCAN_ONE);
	visit = look();
	ask(&visit, DB_INQUIRY_THERE, 0, &two);
	(void)ask_presence(&visit, &answer);
	assert_int_equal(verdict(&visit), DB_SCAN_ONE);
	assert_int_equal(visit.find.doubled, 1);
}

static void damage_that_occurs_often_is_a_second_drive(void **state)
{
	struct visit visit = look();

	(void)state;
	ask(&visit, DB_INQUIRY_THERE, 0, &two);
	ask(&visit, DB_INQUIRY_THERE, 0, &two);
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
	visit = look();
	ask(&visit, DB_INQUIRY_THERE, 0, &two);
	ask(&visit, DB_INQUIRY_THERE, 0, &noise);
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
	visit = look();
	ask(&visit, DB_INQUIRY_THERE, 0, &answer);
	ask(&visit, DB_INQUIRY_THERE, 0, &noise);
	ask(&visit, DB_INQUIRY_THERE, 0, &noise);
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
	/* Each time parts of two answers arrive, although none of them could be read. */
	visit = look();
	ask(&visit, DB_INQUIRY_THERE, 0, &torn);
	assert_int_equal(verdict(&visit), DB_SCAN_GARBLED);
	ask(&visit, DB_INQUIRY_THERE, 1, &torn);
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
	/* Nothing that could be read: it is not known what is there. */
	visit = look();
	ask(&visit, DB_INQUIRY_THERE, 0, &noise);
	ask(&visit, DB_INQUIRY_THERE, 1, &noise);
	assert_int_equal(verdict(&visit), DB_SCAN_GARBLED);
}

static void two_identities_are_two_drives(void **state)
{
	const struct visit_outcome first = of("VSMD-1");
	const struct visit_outcome second = of("VSMD-2");
	struct visit visit = look();

	(void)state;
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &first);
	assert_int_equal(verdict(&visit), DB_SCAN_ONE);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &second);
	assert_string_equal(visit.find.identity, "VSMD-1");
	assert_string_equal(visit.find.other, "VSMD-2");
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
}

static void identities_of_one_letter_are_told_apart(void **state)
{
	const struct visit_outcome first = of("A");
	const struct visit_outcome second = of("B");
	struct visit visit = look();

	(void)state;
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &first);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &second);
	assert_string_equal(visit.find.identity, "A");
	assert_string_equal(visit.find.other, "B");
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
}

/* Damage of identities counts as that of other answers. */
static void damaged_identities_are_two_drives(void **state)
{
	struct visit visit = look();

	(void)state;
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &noise);
	assert_int_equal(verdict(&visit), DB_SCAN_ONE);
	ask(&visit, DB_INQUIRY_IDENTITY, 1, &noise);
	assert_int_equal(visit.find.garbled, 2);
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
	visit = look();
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &two);
	ask(&visit, DB_INQUIRY_IDENTITY, 0, &two);
	assert_int_equal(visit.find.doubled, 2);
	assert_int_equal(verdict(&visit), DB_SCAN_TWO);
}

/* --- setting up ------------------------------------------------------------------------------- */

static const struct visit_outcome stands = { .answered = true,
	                                     .said = { .tells_standing = true, .stands = true } };

static void a_drive_is_set_when_it_is_one_and_stands(void **state)
{
	struct visit visit = set_address(&db_driver_vsmd_serial);

	(void)state;
	assert_int_equal(ask_presence(&visit, &answer), 3);
	ask(&visit, DB_INQUIRY_STANDING, 0, &stands);
	ask(&visit, DB_INQUIRY_SET_ADDRESS, NEW_ADDRESS, &answer);
	assert_int_equal(visit.end, DB_SCAN_DONE);
	assert_true(is_over(&visit));
	assert_int_equal(verdict(&visit), DB_SCAN_ONE);
}

static void nothing_is_set_where_not_one_drive_answers(void **state)
{
	struct visit visit = set_address(&db_driver_vsmd_serial);

	(void)state;
	assert_int_equal(ask_presence(&visit, &silence), 2);
	assert_int_equal(visit.end, DB_SCAN_NOT_ONE);
	assert_true(is_over(&visit));
	visit = set_address(&db_driver_vsmd_serial);
	assert_int_equal(ask_presence(&visit, &two), 3);
	assert_int_equal(visit.end, DB_SCAN_NOT_ONE);
	assert_true(is_over(&visit));
	visit = set_address(&db_driver_vsmd_serial);
	assert_int_equal(ask_presence(&visit, &noise), 3);
	assert_int_equal(visit.end, DB_SCAN_NOT_ONE);
	assert_true(is_over(&visit));
}

static void nothing_is_set_while_it_moves_or_does_not_say(void **state)
{
	const struct visit_outcome moves = { .answered = true, .said = { .tells_standing = true } };
	struct visit visit = set_address(&db_driver_vsmd_serial);

	(void)state;
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_STANDING, 0, &moves);
	assert_int_equal(visit.end, DB_SCAN_STANDS_NOT);
	assert_true(is_over(&visit));
	/* Its answer tells nothing of it. */
	visit = set_address(&db_driver_vsmd_serial);
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_STANDING, 0, &answer);
	assert_int_equal(visit.end, DB_SCAN_STANDS_NOT);
	/* Three questions without an answer. */
	visit = set_address(&db_driver_vsmd_serial);
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_STANDING, 0, &silence);
	ask(&visit, DB_INQUIRY_STANDING, 0, &silence);
	assert_int_equal(visit.end, DB_SCAN_RUNS);
	ask(&visit, DB_INQUIRY_STANDING, 0, &silence);
	assert_int_equal(visit.end, DB_SCAN_STANDS_NOT);
}

static void every_axis_of_a_controller_has_to_stand(void **state)
{
	const struct visit_outcome refused = { .answered = true, .said = { .refused = true } };
	struct visit visit = set_address(&db_driver_xyza);

	(void)state;
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_STANDING, 0, &stands);
	/* Each has three questions of its own. */
	ask(&visit, DB_INQUIRY_STANDING, 1, &silence);
	ask(&visit, DB_INQUIRY_STANDING, 1, &silence);
	ask(&visit, DB_INQUIRY_STANDING, 1, &stands);
	ask(&visit, DB_INQUIRY_STANDING, 2, &silence);
	ask(&visit, DB_INQUIRY_STANDING, 2, &silence);
	/* It has no such axis. */
	ask(&visit, DB_INQUIRY_STANDING, 2, &refused);
	ask(&visit, DB_INQUIRY_STANDING, 3, &refused);
	ask(&visit, DB_INQUIRY_SET_ADDRESS, NEW_ADDRESS, &answer);
	assert_int_equal(visit.end, DB_SCAN_DONE);
	/* A controller with one axis refuses the question for the others. */
	visit = set_address(&db_driver_xyza);
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_STANDING, 0, &stands);
	for (unsigned axis = 1; axis < 4; axis++)
		ask(&visit, DB_INQUIRY_STANDING, axis, &refused);
	ask(&visit, DB_INQUIRY_SET_ADDRESS, NEW_ADDRESS, &answer);
	assert_int_equal(visit.end, DB_SCAN_DONE);
	/* The first one it must have. */
	visit = set_address(&db_driver_xyza);
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_STANDING, 0, &refused);
	assert_int_equal(visit.end, DB_SCAN_STANDS_NOT);
}

/* Something was sent meanwhile that may have started a motion. */
static void standing_is_asked_again_when_it_may_have_changed(void **state)
{
	struct visit visit = set_address(&db_driver_vsmd_serial);

	(void)state;
	(void)ask_presence(&visit, &answer);
	ask(&visit, DB_INQUIRY_STANDING, 0, &stands);
	visit.standings = visit.standing_tries = 0;
	ask(&visit, DB_INQUIRY_STANDING, 0, &silence);
	ask(&visit, DB_INQUIRY_STANDING, 0, &silence);
	visit.standings = visit.standing_tries = 0;
	ask(&visit, DB_INQUIRY_STANDING, 0, &silence);
	ask(&visit, DB_INQUIRY_STANDING, 0, &silence);
	ask(&visit, DB_INQUIRY_STANDING, 0, &stands);
	ask(&visit, DB_INQUIRY_SET_ADDRESS, NEW_ADDRESS, &answer);
	assert_int_equal(visit.end, DB_SCAN_DONE);
}

/* It is sent once, whatever becomes of it. */
static void a_setting_ends_as_the_drive_answers_it(void **state)
{
	const struct visit_outcome refused = { .answered = true, .said = { .refused = true } };
	static const struct {
		bool known;
		const struct visit_outcome *outcome;
		enum db_scan_end end;
	} cases[] = { { true, &answer, DB_SCAN_DONE },
		      { true, &silence, DB_SCAN_SILENT },
		      { true, NULL, DB_SCAN_REFUSED },
		      { false, NULL, DB_SCAN_REFUSED } };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct visit visit = set_address(&db_driver_vsmd_serial);
		const struct visit_outcome *outcome = cases[i].outcome;

		(void)ask_presence(&visit, &answer);
		ask(&visit, DB_INQUIRY_STANDING, 0, &stands);
		if (cases[i].known && !outcome)
			outcome = &refused;
		ask(&visit, DB_INQUIRY_SET_ADDRESS, NEW_ADDRESS, outcome);
		assert_int_equal(visit.end, cases[i].end);
		assert_true(is_over(&visit));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_silent_address_is_asked_twice),
		cmocka_unit_test(where_something_is_heard_it_is_asked_five_times),
		cmocka_unit_test(the_form_that_was_answered_is_kept),
		cmocka_unit_test(a_family_without_identities_is_not_asked_again),
		cmocka_unit_test(answers_are_timed),
		cmocka_unit_test(damage_that_occurs_once_is_the_lines),
		cmocka_unit_test(damage_that_occurs_often_is_a_second_drive),
		cmocka_unit_test(two_identities_are_two_drives),
		cmocka_unit_test(identities_of_one_letter_are_told_apart),
		cmocka_unit_test(damaged_identities_are_two_drives),
		cmocka_unit_test(a_drive_is_set_when_it_is_one_and_stands),
		cmocka_unit_test(nothing_is_set_where_not_one_drive_answers),
		cmocka_unit_test(nothing_is_set_while_it_moves_or_does_not_say),
		cmocka_unit_test(every_axis_of_a_controller_has_to_stand),
		cmocka_unit_test(standing_is_asked_again_when_it_may_have_changed),
		cmocka_unit_test(a_setting_ends_as_the_drive_answers_it),
	};

	return cmocka_run_group_tests_name("sched: one address of a scan", tests, NULL, NULL);
}
