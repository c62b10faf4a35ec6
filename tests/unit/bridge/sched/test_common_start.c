/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One frame that begins the same motion on all drives of a bus: when it goes out, when it does not, and
 * what a stop in between does. Drives that are told something before they can begin, in made-up time.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 3
#define MS DB_NS_PER_MS
#define ANSWER_TIME (2 * MS)

/* --- the family: a motion is prepared, begun, and then looked at where it was begun for all ---------- */

static enum db_step begin_prepared(struct db_conversation *talk)
{
	enum fake_kind kind = fake_kind_of(talk->job);
	enum db_step step = fake_say(talk, kind == FAKE_COMMAND ? FAKE_PREPARE : kind);

	talk->exchange->repeatable = false;
	return step;
}

static enum db_step answer_prepared(struct db_conversation *talk, const uint8_t *bytes,
                                    size_t length)
{
	struct fake_frame frame = fake_frame_at(bytes, length);
	struct fake_frame said = fake_frame_at(talk->exchange->request,
	                                       talk->exchange->request_length);

	if (talk->job->kind != DB_JOB_COMMAND)
		return fake_family.answer(talk, bytes, length);
	if (frame.kind != said.kind)
		return DB_STEP_IGNORE;
	talk->result = frame.refused ? DB_RESULT_REFUSED : DB_RESULT_OK;
	if (frame.kind != FAKE_PREPARE || frame.refused)
		return DB_STEP_DONE;
	fake_say(talk, FAKE_BEGIN);
	talk->exchange->repeatable = false;
	talk->exchange->begins = true;
	return DB_STEP_SEND;
}

static bool begin_all(const struct db_device *device, const struct db_exchange *prepared,
                      struct db_exchange *all)
{
	struct fake_frame frame = fake_frame_at(prepared->request, prepared->request_length);

	(void)device;
	frame.address = FAKE_ALL;
	memcpy(all->request, &frame, sizeof frame);
	all->request_length = sizeof frame;
	return true;
}

static enum db_step begun_by_all(struct db_conversation *talk)
{
	enum db_step step = fake_say(talk, FAKE_LOOK);

	talk->exchange->repeatable = false;
	return step;
}

static enum db_step begun_by_all_again(struct db_conversation *talk)
{
	enum db_step step = begun_by_all(talk);

	talk->exchange->repeatable = true;
	return step;
}

static db_time command_time(const struct db_bus_config *bus)
{
	(void)bus;
	return ANSWER_TIME;
}

/* --- the world ------------------------------------------------------------------------------------- */

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	db_time slow[DRIVES];        /* to be prepared, beyond ANSWER_TIME */
	db_time lag[DRIVES];         /* to answer anything, beyond that */
	bool refuses[DRIVES];        /* to be prepared */
	bool silent[DRIVES];         /* when it is polled */
	unsigned lost_looks[DRIVES]; /* so many looks at it get no answer */
	char said[256];              /* "1p 2p *b 1l ..." */
	enum db_result results[DRIVES];
	db_time sent[DRIVES];
};

static db_time obey(void *context, struct fake_frame *frame)
{
	struct world *world = context;
	unsigned i = frame->address - 1u;
	bool prepared = frame->kind == FAKE_PREPARE;

	if (frame->kind < FAKE_COMMAND && world->silent[i])
		return 0;
	if (frame->kind == FAKE_LOOK && world->lost_looks[i] > 0) {
		world->lost_looks[i]--;
		return 0;
	}
	frame->refused = prepared && world->refuses[i];
	return ANSWER_TIME + world->lag[i] + (prepared ? world->slow[i] : 0);
}

static void collect_results(void *context)
{
	struct world *world = context;
	struct db_request completion;

	while (fake_collect(world->bus->queue, &completion)) {
		world->results[completion.drive] = completion.result;
		world->sent[completion.drive] = completion.sent;
	}
}

static struct world *open_world_of(size_t drives, enum db_medium medium, unsigned cycle_ms)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->driver.medium = medium;
	world->driver.begin = begin_prepared;
	world->driver.answer = answer_prepared;
	world->driver.begin_all = begin_all;
	world->driver.begun_by_all = begun_by_all;
	world->driver.command_time = command_time;
	world->bus = fake_bus_new(&world->driver, DRIVES);
	world->bus->context = world;
	world->bus->obey = obey;
	world->bus->turned = collect_results;
	world->bus->config.cycle_ms = cycle_ms;
	world->bus->config.drive_latency_ms = 100;
	world->bus->config.starts_by_broadcast = true;
	for (unsigned i = 0; i < DRIVES; i++)
		world->bus->drives[i].stop_reaction_ms = 500;
	fake_bus_open(world->bus, drives, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 300 * MS);
	fake_forget_sent(world->bus);
	return world;
}

static struct world *open_world_with(enum db_medium medium, unsigned cycle_ms)
{
	return open_world_of(DRIVES, medium, cycle_ms);
}

static struct world *open_world(void)
{
	return open_world_with(DB_MEDIUM_SERIAL, 20);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

static void post(struct world *world, uint16_t drive, enum db_command command, int32_t target)
{
	world->results[drive] = DB_RESULT_NONE;
	fake_request(world->bus, drive,
	             (struct db_request){
			     .command = command,
			     .args = &(struct db_args){ .target_position = target },
			     .group = command == DB_CMD_MOVE_ABSOLUTE ? 1 : 0,
		     });
}

static void post_all(struct world *world)
{
	for (uint16_t i = 0; i < DRIVES; i++)
		post(world, i, DB_CMD_MOVE_ABSOLUTE, 5);
}

/* What commands made of the bus's traffic, one letter for each kind. */
static const char *said(struct world *world)
{
	static const char letters[FAKE_KINDS] = {
		[FAKE_PREPARE] = 'p', [FAKE_BEGIN] = 'b', [FAKE_LOOK] = 'l', [FAKE_STOP] = 's'
	};
	size_t length = 0;

	world->said[0] = '\0';
	for (size_t i = 0; i < world->bus->sent_count; i++) {
		const struct fake_frame *frame = &world->bus->sent[i].frame;

		if (!letters[frame->kind])
			continue;
		assert_true(length + 4 <= sizeof world->said);
		length += (size_t)sprintf(world->said + length, "%s%c%c", length ? " " : "",
		                          frame->address == FAKE_ALL ? '*' : '0' + frame->address,
		                          letters[frame->kind]);
	}
	return world->said;
}

static unsigned count_said(struct world *world, const char *what)
{
	unsigned found = 0;

	for (const char *at = said(world); (at = strstr(at, what)) != NULL; at++)
		found++;
	return found;
}

static bool all_ended(const struct world *world, enum db_result result)
{
	for (unsigned i = 0; i < DRIVES; i++) {
		if (world->results[i] != result)
			return false;
	}
	return true;
}

/* What is for all must be right for each, whichever it is. */
static void one_that_goes_elsewhere_is_begun_by_itself(void **state)
{
	(void)state;
	for (uint16_t other = 0; other < DRIVES; other++) {
		struct world *world = open_world();

		for (uint16_t i = 0; i < DRIVES; i++)
			post(world, i, DB_CMD_MOVE_ABSOLUTE, i == other ? 6 : 5);
		fake_pass(world->bus, 300 * MS);
		assert_int_equal(count_said(world, "*b"), 0);
		for (unsigned i = 0; i < world->bus->sent_count; i++) {
			const struct fake_frame *frame = &world->bus->sent[i].frame;

			if (frame->kind == FAKE_BEGIN)
				assert_int_equal(frame->target,
				                 frame->address == other + 1 ? 6 : 5);
		}
		assert_true(all_ended(world, DB_RESULT_OK));
		close_world(world);
	}
}

/* Nobody acknowledges it: the line is kept for it until each is sure to hear. */
static void it_is_said_when_all_are_sure_to_hear(void **state)
{
	struct world *world = open_world_with(DB_MEDIUM_SERIAL, 100);
	db_time answered = 0;
	size_t at = 0;

	(void)state;
	for (size_t i = 0; i < DRIVES; i++)
		world->bus->engine->nodes[i]->gap.sure = 15 * MS;
	post_all(world);
	fake_pass(world->bus, 300 * MS);
	while (at < world->bus->sent_count && world->bus->sent[at].frame.address != FAKE_ALL) {
		answered = world->bus->sent[at].at + ANSWER_TIME;
		at++;
	}
	assert_true(at < world->bus->sent_count);
	assert_int_equal(world->bus->sent[at].frame.kind, FAKE_BEGIN);
	assert_true(world->bus->sent[at].at - answered == 15 * MS);
	assert_true(all_ended(world, DB_RESULT_OK));
	close_world(world);
}

/* --- what is asked after it ------------------------------------------------------------------------ */

/* Whether it has begun is asked as often as any question is, whatever was said again before. */
static void a_look_that_is_lost_is_repeated(void **state)
{
	struct world *world = open_world();

	(void)state;
	world->driver.begun_by_all = begun_by_all_again;
	world->lost_looks[1] = world->bus->config.retries;
	post_all(world);
	fake_pass(world->bus, 1000 * MS);
	assert_true(all_ended(world, DB_RESULT_OK));
	assert_int_equal(count_said(world, "2l"), world->bus->config.retries + 1);
	post_all(world);
	world->lost_looks[1] = world->bus->config.retries + 1;
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->results[0], DB_RESULT_OK);
	assert_int_equal(world->results[1], DB_RESULT_TIMEOUT);
	close_world(world);
}

/* --- tests ----------------------------------------------------------------------------------------- */

static void one_frame_when_all_are_ready(void **state)
{
	struct world *world = open_world();

	(void)state;
	post_all(world);
	fake_pass(world->bus, 60 * MS);
	assert_string_equal(said(world), "1p 2p 3p *b 1l 2l 3l");
	assert_true(all_ended(world, DB_RESULT_OK));
	assert_true(world->sent[0] != 0);
	close_world(world);
}

/* Drives that act on it may not listen meanwhile; on CAN, what follows waits for the wire by itself. */
static void the_frame_for_all_has_time_to_be_acted_on(void **state)
{
	static const enum db_medium media[] = { DB_MEDIUM_SERIAL, DB_MEDIUM_CAN };

	(void)state;
	for (size_t m = 0; m < 2; m++) {
		struct world *world = open_world_with(media[m], 20);
		db_time gap = DB_TIME_NEVER;

		post_all(world);
		fake_pass(world->bus, 60 * MS);
		for (size_t i = 0; i + 1 < world->bus->sent_count; i++) {
			const struct fake_sent *sent = &world->bus->sent[i];

			if (sent->frame.address == FAKE_ALL)
				gap = sent[1].at - sent->at;
		}
		if (media[m] == DB_MEDIUM_SERIAL)
			assert_true(gap >= 2 * MS + FAKE_WIRE_TIME && gap < 3 * MS);
		else
			assert_true(gap < MS);
		close_world(world);
	}
}

/* The bus may be quicker than the one who hands the requests over. */
static void requests_that_come_later_are_waited_for(void **state)
{
	struct world *world = open_world();

	(void)state;
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	fake_pass(world->bus, 8 * MS);
	assert_int_equal(count_said(world, "b"), 0);
	post(world, 1, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 2, DB_CMD_MOVE_ABSOLUTE, 5);
	fake_pass(world->bus, 60 * MS);
	assert_int_equal(count_said(world, "*b"), 1);
	assert_true(all_ended(world, DB_RESULT_OK));
	close_world(world);
}

static void without_one_of_them_each_begins_by_itself(void **state)
{
	struct world *world = open_world();

	(void)state;
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 2, DB_CMD_MOVE_ABSOLUTE, 5);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(count_said(world, "b"), 0);
	fake_pass(world->bus, 60 * MS);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(count_said(world, "1b"), 1);
	assert_int_equal(count_said(world, "2b"), 0);
	assert_int_equal(count_said(world, "3b"), 1);
	close_world(world);
}

/* It would be moved by a frame for all. */
static void one_that_refuses_is_not_reached(void **state)
{
	struct world *world = open_world();

	(void)state;
	world->refuses[1] = true;
	world->slow[1] = 40 * MS;
	post_all(world);
	fake_pass(world->bus, 120 * MS);
	assert_int_equal(world->results[1], DB_RESULT_REFUSED);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(count_said(world, "2b"), 0);
	assert_int_equal(count_said(world, "1b") + count_said(world, "3b"), 2);
	close_world(world);
}

static void different_motions_begin_one_by_one(void **state)
{
	struct world *world = open_world();

	(void)state;
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 1, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 2, DB_CMD_MOVE_ABSOLUTE, 6);
	fake_pass(world->bus, 60 * MS);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(count_said(world, "b"), 3);
	assert_true(all_ended(world, DB_RESULT_OK));
	close_world(world);
}

/* While the others wait for the last one. */
static void a_stop_in_between_wins(void **state)
{
	struct world *world = open_world();

	(void)state;
	world->slow[2] = 40 * MS;
	post_all(world);
	fake_pass(world->bus, 20 * MS);
	assert_string_equal(said(world), "1p 2p 3p");
	post(world, 0, DB_CMD_STOP, 0);
	fake_pass(world->bus, 150 * MS);
	/* Its own move never begins, with a frame for all neither. */
	assert_int_equal(count_said(world, "1s"), 1);
	assert_int_equal(count_said(world, "1b"), 0);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(count_said(world, "2b") + count_said(world, "3b"), 2);
	close_world(world);
}

/* The stop of a drive goes out before the frame that was ready, and all of them keep it from moving. */
static void stops_for_all_leave_nothing_to_begin(void **state)
{
	struct world *world = open_world();

	(void)state;
	world->slow[2] = 40 * MS;
	post_all(world);
	fake_pass(world->bus, 20 * MS);
	for (uint16_t i = 0; i < DRIVES; i++)
		post(world, i, DB_CMD_STOP, 0);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(count_said(world, "b"), 0);
	assert_int_equal(count_said(world, "s"), 3);
	close_world(world);
}

static void a_drive_that_is_away_keeps_the_others_apart(void **state)
{
	struct world *world = open_world();

	(void)state;
	world->slow[1] = 10000 * MS;
	post_all(world);
	fake_pass(world->bus, 1500 * MS);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(world->results[0], DB_RESULT_OK);
	assert_int_equal(world->results[1], DB_RESULT_TIMEOUT);
	assert_int_equal(world->results[2], DB_RESULT_OK);
	close_world(world);
}

/* Longer than the requests of one start take to arrive. */
static void a_drive_that_is_prepared_slowly_is_waited_for(void **state)
{
	struct world *world = open_world_with(DB_MEDIUM_CAN, 20);

	(void)state;
	world->slow[1] = 60 * MS;
	post_all(world);
	fake_pass(world->bus, 200 * MS);
	assert_true(all_ended(world, DB_RESULT_OK));
	assert_int_equal(count_said(world, "*b"), 1);
	assert_int_equal(count_said(world, "b"), 1);
	close_world(world);
}

/* The requests of one start arrive within 20 ms; no cycle is waited for after that. */
static void the_only_one_begins_when_no_other_can_come(void **state)
{
	struct world *world = open_world_with(DB_MEDIUM_SERIAL, 500);
	db_time begun = 0;

	(void)state;
	for (uint16_t i = 0; i < 2; i++) {
		db_time asked = world->bus->now;

		fake_forget_sent(world->bus);
		post(world, i, DB_CMD_MOVE_ABSOLUTE, 5);
		fake_pass(world->bus, 60 * MS);
		assert_int_equal(count_said(world, "b"), 1);
		for (size_t n = 0; n < world->bus->sent_count; n++) {
			if (world->bus->sent[n].frame.kind == FAKE_BEGIN)
				begun = world->bus->sent[n].at - asked;
		}
		assert_in_range(begun, 20 * MS, 25 * MS);
	}
	close_world(world);
}

/* Its own command before is not answered yet, and the motion after it waits. */
static void a_drive_that_is_busy_with_another_command_is_waited_for(void **state)
{
	struct world *world = open_world_with(DB_MEDIUM_CAN, 20);

	(void)state;
	world->lag[2] = 60 * MS;
	post(world, 2, DB_CMD_CLEAR_FAULT, 0);
	fake_pass(world->bus, 1 * MS);
	post(world, 2, DB_CMD_ENABLE, 0);
	post_all(world);
	fake_pass(world->bus, 40 * MS);
	assert_int_equal(count_said(world, "b"), 0);
	world->lag[2] = 0;
	fake_pass(world->bus, 200 * MS);
	/* Two of these belong to the two commands before the motion. */
	assert_int_equal(count_said(world, "*b"), 1);
	assert_int_equal(count_said(world, "3b"), 2);
	assert_int_equal(count_said(world, "b"), 3);
	assert_true(all_ended(world, DB_RESULT_OK));
	close_world(world);
}

/* The third drive is busy, and the request that waits for it is none of the common motion. */
static void a_busy_drive_that_has_no_common_motion_is_not_waited_for(void **state)
{
	struct world *world = open_world_with(DB_MEDIUM_CAN, 20);

	(void)state;
	world->lag[2] = 80 * MS;
	post(world, 2, DB_CMD_CLEAR_FAULT, 0);
	fake_pass(world->bus, 1 * MS);
	post(world, 2, DB_CMD_ENABLE, 0);
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 1, DB_CMD_MOVE_ABSOLUTE, 5);
	fake_pass(world->bus, 40 * MS);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(count_said(world, "1b"), 1);
	assert_int_equal(count_said(world, "2b"), 1);
	close_world(world);
}

static void two_drives_are_enough(void **state)
{
	struct world *world = open_world_of(2, DB_MEDIUM_SERIAL, 20);

	(void)state;
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 1, DB_CMD_MOVE_ABSOLUTE, 5);
	fake_pass(world->bus, 60 * MS);
	assert_int_equal(count_said(world, "*b"), 1);
	assert_int_equal(count_said(world, "b"), 1);
	close_world(world);
}

static bool begin_none(const struct db_device *device, const struct db_exchange *prepared,
                       struct db_exchange *all)
{
	(void)begin_all(device, prepared, all);
	return false;
}

/* The family has no frame that starts all drives, or none for this motion. */
static void without_a_frame_for_all_each_drive_begins_by_itself(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 2; i++) {
		struct world *world = open_world();

		world->driver.begin_all = i == 0 ? NULL : begin_none;
		post_all(world);
		fake_pass(world->bus, 100 * MS);
		assert_int_equal(count_said(world, "*b"), 0);
		assert_int_equal(count_said(world, "b"), DRIVES);
		assert_true(all_ended(world, DB_RESULT_OK));
		close_world(world);
	}
}

static enum db_step begun_for_good(struct db_conversation *talk)
{
	talk->result = DB_RESULT_UNPROVEN;
	return DB_STEP_DONE;
}

/* The driver cannot see whether the drives began, so the commands end when the common frame is
 * sent. From then on each drive may move, even if its status does not show it yet. */
static void a_common_start_that_cannot_be_seen_is_unproven(void **state)
{
	struct world *world = open_world();

	(void)state;
	world->driver.begun_by_all = begun_for_good;
	post_all(world);
	for (unsigned i = 0; i < 1000 && count_said(world, "*b") == 0; i++)
		fake_pass(world->bus, MS / 10);
	assert_int_equal(count_said(world, "*b"), 1);
	for (unsigned i = 0; i < DRIVES; i++)
		assert_true(world->bus->engine->stations[i]->motion_sent >=
		            world->bus->now - MS / 10);
	assert_true(all_ended(world, DB_RESULT_UNPROVEN));
	close_world(world);
}

/* Several exchanges are under way there, polls among them: the frame goes out when they are answered. */
static void where_exchanges_overlap_all_is_answered_first(void **state)
{
	/* So often that there is always one under way. */
	struct world *world = open_world_with(DB_MEDIUM_CAN, 2);

	(void)state;
	world->lag[1] = MS / 2;
	world->lag[2] = 3 * MS / 2;
	for (unsigned i = 0; i < 10; i++) {
		fake_forget_sent(world->bus);
		world->slow[i % DRIVES] = (db_time)i * MS;
		post_all(world);
		fake_pass(world->bus, (40 + i) * MS + MS / 2);
		assert_int_equal(count_said(world, "*b"), 1);
		assert_int_equal(count_said(world, "l"), 3);
		assert_true(all_ended(world, DB_RESULT_OK));
	}
	close_world(world);
}

/* Nobody knows whether it is still there. */
static void one_that_falls_silent_is_not_counted_on(void **state)
{
	struct world *world = open_world_with(DB_MEDIUM_CAN, 20);

	(void)state;
	world->slow[2] = 90 * MS;
	post_all(world);
	fake_pass(world->bus, 8 * MS);
	world->silent[1] = true;
	fake_pass(world->bus, 130 * MS);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(count_said(world, "1b") + count_said(world, "3b"), 2);
	close_world(world);
}

static void not_unless_the_bus_is_told_to(void **state)
{
	struct world *world = open_world();

	(void)state;
	world->bus->config.starts_by_broadcast = false;
	post_all(world);
	fake_pass(world->bus, 60 * MS);
	assert_int_equal(count_said(world, "*b"), 0);
	assert_int_equal(count_said(world, "b"), 3);
	close_world(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(one_frame_when_all_are_ready),
		cmocka_unit_test(one_that_goes_elsewhere_is_begun_by_itself),
		cmocka_unit_test(it_is_said_when_all_are_sure_to_hear),
		cmocka_unit_test(a_look_that_is_lost_is_repeated),
		cmocka_unit_test(the_frame_for_all_has_time_to_be_acted_on),
		cmocka_unit_test(requests_that_come_later_are_waited_for),
		cmocka_unit_test(without_one_of_them_each_begins_by_itself),
		cmocka_unit_test(one_that_refuses_is_not_reached),
		cmocka_unit_test(different_motions_begin_one_by_one),
		cmocka_unit_test(a_stop_in_between_wins),
		cmocka_unit_test(stops_for_all_leave_nothing_to_begin),
		cmocka_unit_test(a_drive_that_is_away_keeps_the_others_apart),
		cmocka_unit_test(a_drive_that_is_prepared_slowly_is_waited_for),
		cmocka_unit_test(the_only_one_begins_when_no_other_can_come),
		cmocka_unit_test(a_drive_that_is_busy_with_another_command_is_waited_for),
		cmocka_unit_test(a_busy_drive_that_has_no_common_motion_is_not_waited_for),
		cmocka_unit_test(two_drives_are_enough),
		cmocka_unit_test(without_a_frame_for_all_each_drive_begins_by_itself),
		cmocka_unit_test(a_common_start_that_cannot_be_seen_is_unproven),
		cmocka_unit_test(where_exchanges_overlap_all_is_answered_first),
		cmocka_unit_test(one_that_falls_silent_is_not_counted_on),
		cmocka_unit_test(not_unless_the_bus_is_told_to),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
