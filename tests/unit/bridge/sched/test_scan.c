/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A scan of a bus in service, in made-up time: what it finds, and that neither a cycle nor a stop waits for it.
 */
#include "driver/list.h"
#include "fakes/bus.h"
#include "sched/scan.h"
#include "sched/sched_private.h"
#include "sched/visit.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define DRIVES 3

static bool inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                    struct db_exchange *exchange)
{
	(void)bus;
	if (inquiry->kind == DB_INQUIRY_IDENTITY)
		return false;
	fake_write_inquiry(inquiry, exchange);
	return true;
}

static enum db_recognised recognise(const struct db_bus_config *bus,
                                    const struct db_inquiry *inquiry, const uint8_t *bytes,
                                    size_t length, struct db_inquired *said)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	(void)bus;
	if (frame.kind != FAKE_INQUIRY || frame.address != inquiry->address)
		return DB_RECOGNISED_NOTHING;
	said->tells_standing = true;
	said->stands = !(fabsf(frame.speed) > 0.0f);
	return said->parts++ > 0 ? DB_RECOGNISED_AGAIN : DB_RECOGNISED_ANSWER;
}

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	struct scan *scan;
};

static void open_world_on(struct world *world, enum db_medium medium, unsigned cycle_ms)
{
	world->driver = fake_family;
	world->driver.medium = medium;
	world->driver.inquire = inquire;
	world->driver.recognise = recognise;
	world->bus = fake_bus_new(&world->driver, DRIVES);
	world->bus->config.cycle_ms = cycle_ms;
	world->bus->config.drive_latency_ms = 8;
	fake_bus_open(world->bus, DRIVES, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 300 * MS);
	fake_forget_sent(world->bus);
}

static void open_world(struct world *world, unsigned cycle_ms)
{
	open_world_on(world, DB_MEDIUM_SERIAL, cycle_ms);
}

static void begin_plan(struct world *world, struct db_scan_plan plan)
{
	world->scan = scan_new(&world->bus->config, &plan, 1);
	assert_non_null(world->scan);
	scan_begin(world->bus->engine, world->scan, world->bus->now);
}

static void begin(struct world *world, unsigned last)
{
	begin_plan(world, (struct db_scan_plan){ .first = 1, .last = last });
}

static void close_world(struct world *world)
{
	scan_free(world->scan);
	fake_bus_free(world->bus);
}

static struct db_scan_progress progress_of(const struct world *world)
{
	struct db_scan_progress progress;

	db_seqlock_read(&world->scan->sequence, world->scan->words, &progress, sizeof(progress));
	return progress;
}

/* Before it has asked anybody: what a reader is told then is told from the plan. */
static void one_that_has_not_begun_tells_how_long_it_may_take(void **state)
{
	const struct db_bus_config bus = { .driver = &fake_family, .drive_latency_ms = 8 };
	struct db_scan_plan plan = { .first = 3, .last = 12, .speed_count = 4 };
	struct world world = { .scan = scan_new(&bus, &plan, 1) };

	(void)state;
	assert_non_null(world.scan);
	assert_int_equal(progress_of(&world).total, 10);
	assert_int_equal(progress_of(&world).wait_us, 8000);
	scan_free(world.scan);
	plan.aside = true;
	world.scan = scan_new(&bus, &plan, 2);
	assert_non_null(world.scan);
	assert_int_equal(progress_of(&world).total, 40);
	scan_free(world.scan);
}

static void finds_who_is_there_and_makes_no_cycle_late(void **state)
{
	struct world world;
	struct db_bus_stats before;

	(void)state;
	open_world(&world, 20);
	before = fake_stats(world.bus);
	begin(&world, 8);
	world.bus->dead[6] = true;
	fake_pass(world.bus, 3000 * MS);
	assert_true(atomic_load(&world.scan->ended));
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	assert_int_equal(progress_of(&world).asked, 8);
	/* The made-up wire answers for every address. */
	assert_int_equal(progress_of(&world).finds, 7);
	assert_int_equal(world.scan->finds[5].address, 7);
	assert_int_equal(world.scan->finds[0].address, 1);
	assert_int_equal(world.scan->finds[0].verdict, DB_SCAN_ONE);
	assert_int_equal(world.scan->finds[0].answered, 5);
	assert_int_equal(fake_stats(world.bus).overruns, before.overruns);
	assert_int_equal(fake_stats(world.bus).jitter_max_us, before.jitter_max_us);
	close_world(&world);
}

/* Behind a question that nobody answers a stop waits for that, and no longer. */
static void a_stop_waits_for_one_question_at_most(void **state)
{
	struct world world;
	db_time asked;

	(void)state;
	open_world(&world, 20);
	memset(world.bus->dead, true, sizeof world.bus->dead);
	for (size_t i = 0; i <= DRIVES; i++)
		world.bus->dead[i] = false;
	begin(&world, 12);
	while (fake_count(world.bus, 6, FAKE_INQUIRY) == 0)
		fake_pass(world.bus, MS / 4);
	asked = world.bus->now;
	fake_forget_sent(world.bus);
	fake_post(world.bus, 0, DB_CMD_STOP);
	while (fake_count(world.bus, 1, FAKE_STOP) == 0 && world.bus->now - asked < 100 * MS)
		fake_pass(world.bus, MS / 4);
	assert_true(world.bus->now - asked <= 10 * MS);
	assert_int_equal(fake_count(world.bus, 7, FAKE_INQUIRY), 0);
	close_world(&world);
}

static void says_when_a_cycle_leaves_no_time(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 4);
	begin(&world, 8);
	fake_pass(world.bus, 5000 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_NO_ROOM);
	assert_true(progress_of(&world).needed_us > progress_of(&world).gap_us);
	/* What reading leaves of a cycle. */
	assert_true(fake_stats(world.bus).cycle_us > 0);
	assert_int_equal(progress_of(&world).gap_us + fake_stats(world.bus).cycle_us, 4000);
	assert_int_equal(fake_count(world.bus, 5, FAKE_INQUIRY), 0);
	close_world(&world);
}

/* The shortest cycle in which there is time is the one that leaves what was said to be needed. */
static void says_how_much_time_it_needs(void **state)
{
	uint32_t needed = 0;
	uint32_t shortest = 0;

	(void)state;
	for (unsigned cycle_ms = 3; shortest == 0; cycle_ms++) {
		struct world world;
		struct db_scan_progress progress;

		assert_true(cycle_ms < 20);
		open_world(&world, cycle_ms);
		world.bus->config.turnaround_us = 1000;
		begin(&world, 4);
		fake_pass(world.bus, 5000 * MS);
		progress = progress_of(&world);
		if (progress.end == DB_SCAN_DONE) {
			shortest = 1000 * cycle_ms - fake_stats(world.bus).cycle_us;
			assert_in_range(needed, shortest - 999, shortest);
		}
		needed = progress.needed_us;
		close_world(&world);
	}
}

/* Its frames are in the trace; they answer none of the questions to drives that are told there. */
static void its_answers_are_told_in_the_trace(void **state)
{
	struct db_trace_record record;
	struct db_trace_place place;
	unsigned answers = 0;
	struct world world;
	uint32_t lost;

	(void)state;
	open_world(&world, 20);
	place = db_trace_end(db_engine_trace(world.bus->engine));
	begin(&world, 1);
	fake_pass(world.bus, 2000 * MS);
	while (db_trace_read(db_engine_trace(world.bus->engine), &place, &record, &lost)) {
		if (record.kind != DB_TRACE_ANSWER ||
		    fake_frame_at(record.bytes, record.length).kind != FAKE_INQUIRY)
			continue;
		assert_int_equal(record.question, 0);
		answers++;
	}
	/* As often as a drive is asked that answers. */
	assert_int_equal(answers, 5);
	close_world(&world);
}

/* The made-up bus fails where its engine wants to be called again and again while nothing has changed. */
static void waits_in_peace_for_what_it_asked_a_drive_that_is_away(void **state)
{
	struct world world;

	(void)state;
	open_world_on(&world, DB_MEDIUM_CAN, 20);
	world.bus->dead[2] = true;
	fake_pass(world.bus, 1000 * MS);
	assert_false(fake_is_online(world.bus, 1));
	begin(&world, 3);
	while (fake_count(world.bus, 2, FAKE_INQUIRY) == 0)
		fake_pass(world.bus, MS / 4);
	/* Looking for it comes due, too. */
	world.bus->engine->nodes[1]->probe_at = world.bus->now;
	fake_pass(world.bus, 500 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	close_world(&world);
}

static void waits_in_peace_for_a_port_that_takes_nothing(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 20);
	memset(world.bus->dead, true, sizeof world.bus->dead);
	for (size_t i = 0; i <= DRIVES; i++)
		world.bus->dead[i] = false;
	begin(&world, 8);
	while (fake_count(world.bus, 6, FAKE_INQUIRY) == 0)
		fake_pass(world.bus, MS / 4);
	db_engine_hold(world.bus->engine, true, world.bus->now);
	fake_pass(world.bus, 200 * MS);
	db_engine_hold(world.bus->engine, false, world.bus->now);
	fake_pass(world.bus, 2000 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	close_world(&world);
}

static void is_ended_by_its_client_and_with_the_port(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 20);
	begin(&world, 12);
	fake_pass(world.bus, 30 * MS);
	atomic_store(&world.scan->cancelled, true);
	fake_pass(world.bus, 30 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_CANCELLED);
	scan_free(world.scan);
	begin(&world, 12);
	fake_port(world.bus, 5);
	assert_int_equal(progress_of(&world).end, DB_SCAN_PORT);
	assert_int_equal(progress_of(&world).error, 5);
	scan_free(world.scan);
	/* Nor does one begin, or ask anything, while there is none. */
	fake_forget_sent(world.bus);
	begin(&world, 12);
	fake_pass(world.bus, 30 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_PORT);
	assert_int_equal(progress_of(&world).error, 5);
	assert_int_equal(world.bus->sent_count, 0);
	close_world(&world);
}

/* A drive whose answer to a command does not show yet that it moves. */
static db_time answer_as_it_was(void *context, struct fake_frame *frame)
{
	const struct fake_bus *bus = context;

	frame->speed = 0.0f;
	return bus->answer_time;
}

static void sets_no_bus_aside_whose_drive_was_just_told_to_move(void **state)
{
	const struct db_scan_plan plan = {
		.first = 1, .last = 1, .aside = true, .speed_count = 1, .speeds = { 9600 }
	};
	struct world world;

	(void)state;
	open_world(&world, 20);
	world.bus->context = world.bus;
	world.bus->obey = answer_as_it_was;
	fake_post(world.bus, 1, DB_CMD_MOVE_VELOCITY);
	while (fake_result(world.bus) == DB_RESULT_NONE)
		fake_pass(world.bus, MS / 10);
	begin_plan(&world, plan);
	assert_int_equal(progress_of(&world).end, DB_SCAN_MOVES);
	assert_int_equal(progress_of(&world).drive, 1);
	close_world(&world);
}

/* A scan looks for a drive that was lost while it turned, whose watchdog has tripped since. */
static void keeps_a_stop_for_a_drive_that_is_not_there(void **state)
{
	const struct db_scan_plan plan = {
		.first = 1, .last = 1, .aside = true, .speed_count = 1, .speeds = { 9600 }
	};
	struct world world;

	(void)state;
	open_world(&world, 20);
	fake_post(world.bus, 1, DB_CMD_MOVE_VELOCITY);
	fake_pass(world.bus, 100 * MS);
	assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
	world.bus->dead[2] = true;
	fake_pass(world.bus, 500 * MS);
	assert_false(fake_is_online(world.bus, 1));
	fake_post(world.bus, 1, DB_CMD_STOP);
	fake_pass(world.bus, 100 * MS);
	begin_plan(&world, plan);
	db_engine_shut_down(world.bus->engine, world.bus->now);
	fake_pass(world.bus, 100 * MS);
	assert_true(db_engine_is_quiet(world.bus->engine, true));
	db_engine_set_aside(world.bus->engine, world.bus->now);
	atomic_store(&world.scan->cancelled, true);
	fake_pass(world.bus, 10 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_CANCELLED);
	assert_int_equal(fake_result(world.bus), DB_RESULT_NONE);
	/* It comes back, and turns. */
	world.bus->dead[2] = false;
	fake_forget_sent(world.bus);
	fake_port(world.bus, 0);
	fake_pass(world.bus, 200 * MS);
	assert_true(fake_count(world.bus, 2, FAKE_STOP) > 0);
	assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
	close_world(&world);
}

static unsigned count_inquiries(const struct world *world, enum db_inquiry_kind kind)
{
	unsigned count = 0;

	for (size_t i = 0; i < world->bus->sent_count; i++)
		count += world->bus->sent[i].frame.kind == FAKE_INQUIRY &&
		         world->bus->sent[i].frame.target == (int32_t)kind;
	return count;
}

/* A stop would go to the address that it had. */
static void sets_up_no_drive_that_is_told_to_move_meanwhile(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 20);
	begin_plan(&world, (struct db_scan_plan){
				   .first = 2, .last = 2, .set_up = DB_INQUIRY_SET_ADDRESS });
	/* The last of its axes is asked. */
	while (count_inquiries(&world, DB_INQUIRY_STANDING) < fake_family.axes)
		fake_pass(world.bus, MS / 4);
	fake_post(world.bus, 1, DB_CMD_MOVE_VELOCITY);
	fake_pass(world.bus, 300 * MS);
	assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
	assert_int_equal(count_inquiries(&world, DB_INQUIRY_SET_ADDRESS), 0);
	assert_int_equal(progress_of(&world).end, DB_SCAN_STANDS_NOT);
	scan_free(world.scan);
	/* Of others it is no matter. */
	begin_plan(&world, (struct db_scan_plan){
				   .first = 3, .last = 3, .set_up = DB_INQUIRY_SET_ADDRESS });
	fake_pass(world.bus, 300 * MS);
	assert_int_equal(count_inquiries(&world, DB_INQUIRY_SET_ADDRESS), 1);
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	close_world(&world);
}

/* A save takes the line for a second. */
static void saves_nothing_while_a_drive_of_the_line_moves(void **state)
{
	const struct db_scan_plan plan = { .first = 2, .last = 2, .set_up = DB_INQUIRY_SAVE };
	struct world world;

	(void)state;
	open_world(&world, 20);
	fake_post(world.bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(world.bus, 100 * MS);
	begin_plan(&world, plan);
	fake_pass(world.bus, 300 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_MOVES);
	assert_int_equal(progress_of(&world).drive, 0);
	assert_int_equal(count_inquiries(&world, DB_INQUIRY_SAVE), 0);
	scan_free(world.scan);
	fake_post(world.bus, 0, DB_CMD_STOP);
	fake_pass(world.bus, 100 * MS);
	begin_plan(&world, plan);
	fake_pass(world.bus, 300 * MS);
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	assert_int_equal(count_inquiries(&world, DB_INQUIRY_SAVE), 1);
	close_world(&world);
}

/* What it is told shows with the next status, and the save must not go out before that. */
static void saves_nothing_before_it_is_read_that_all_drives_stand(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 20);
	world.bus->context = world.bus;
	world.bus->obey = answer_as_it_was;
	begin_plan(&world,
	           (struct db_scan_plan){ .first = 2, .last = 2, .set_up = DB_INQUIRY_SAVE });
	while (count_inquiries(&world, DB_INQUIRY_STANDING) < fake_family.axes)
		fake_pass(world.bus, MS / 4);
	fake_post(world.bus, 2, DB_CMD_MOVE_VELOCITY);
	while (fake_result(world.bus) == DB_RESULT_NONE)
		fake_pass(world.bus, MS / 10);
	fake_pass(world.bus, 4 * MS);
	assert_int_equal(count_inquiries(&world, DB_INQUIRY_SAVE), 0);
	assert_false(atomic_load(&world.scan->ended));
	/* One that stands there holds nothing up. */
	world.bus->obey = NULL;
	fake_post(world.bus, 2, DB_CMD_STOP);
	fake_pass(world.bus, 300 * MS);
	assert_int_equal(count_inquiries(&world, DB_INQUIRY_SAVE), 1);
	assert_int_equal(progress_of(&world).end, DB_SCAN_DONE);
	close_world(&world);
}

/* What has an effect only after it was saved is no use without the save. */
static void count_settings(enum db_inquiry_kind kind, enum db_takes_effect effect,
                           struct db_scan_progress *progress, unsigned *sent)
{
	struct world world;

	open_world(&world, 20);
	world.driver.address_effect = kind == DB_INQUIRY_SET_ADDRESS ? effect :
	                                                               DB_TAKES_EFFECT_AT_ONCE;
	world.driver.speed_effect = kind == DB_INQUIRY_SET_SPEED ? effect : DB_TAKES_EFFECT_AT_ONCE;
	fake_post(world.bus, 2, DB_CMD_MOVE_VELOCITY);
	fake_pass(world.bus, 100 * MS);
	begin_plan(&world, (struct db_scan_plan){ .first = 2, .last = 2, .set_up = kind });
	fake_pass(world.bus, 300 * MS);
	*progress = progress_of(&world);
	/* That it stands itself is asked all the same. */
	assert_true(count_inquiries(&world, DB_INQUIRY_STANDING) > 0);
	*sent = count_inquiries(&world, kind);
	close_world(&world);
}

static void sets_nothing_that_must_be_saved_while_a_drive_of_the_line_moves(void **state)
{
	static const enum db_inquiry_kind kinds[] = { DB_INQUIRY_SET_ADDRESS,
		                                      DB_INQUIRY_SET_SPEED };
	struct db_scan_progress progress;
	unsigned sent;

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		count_settings(kinds[i], DB_TAKES_EFFECT_POWER_UP, &progress, &sent);
		assert_int_equal(progress.end, DB_SCAN_MOVES);
		assert_int_equal(progress.drive, 2);
		assert_int_equal(sent, 0);
		count_settings(kinds[i], DB_TAKES_EFFECT_AT_ONCE, &progress, &sent);
		assert_int_equal(progress.end, DB_SCAN_DONE);
		assert_int_equal(sent, 1);
	}
}

/* --- whom it gives way to ---------------------------------------------------------------------------- */

static void do_nothing(struct db_engine *engine, db_time now)
{
	(void)engine;
	(void)now;
}

static void be_quiet(struct db_engine *engine, db_time now)
{
	engine->quiet_until = now + 1;
}

static void be_reserved(struct db_engine *engine, db_time now)
{
	engine->reserved.until = now + 1;
}

static void await_late_answers(struct db_engine *engine, db_time now)
{
	engine->scan->not_before = now + 1;
}

static void be_full(struct db_engine *engine, db_time now)
{
	engine->port_full_since = now;
}

static void ask_another(struct db_engine *engine, db_time now)
{
	(void)now;
	engine->flights = 1;
}

static void ask_this_one(struct db_engine *engine, db_time now)
{
	(void)now;
	engine->nodes[0]->flight.station = engine->stations[0];
}

static void lose_this_one(struct db_engine *engine, db_time now)
{
	engine->nodes[0]->in_step = false;
	engine->nodes[0]->late_probes = 1;
	engine->nodes[0]->late_probes_until = now + 2;
	engine->nodes[0]->risky_until = now + 2;
}

static void command_this_one(struct db_engine *engine, db_time now)
{
	(void)now;
	engine->stations[0]->lanes[LANE_COMMAND].active = true;
}

static void stop_this_one(struct db_engine *engine, db_time now)
{
	(void)now;
	engine->stations[0]->standing.kind = DB_CMD_STOP;
}

/* The first question, to the first drive's address, is asked although this is so. */
static bool asks(enum db_medium medium, void (*let_it)(struct db_engine *engine, db_time now))
{
	struct world world;
	struct db_engine *engine;
	bool sent;

	open_world_on(&world, medium, 20);
	engine = world.bus->engine;
	while (engine->flights > 0)
		fake_pass(world.bus, MS / 10);
	/* No cycle is to be kept. */
	engine->stats.online = 0;
	begin(&world, 8);
	let_it(engine, world.bus->now);
	sent = scan_send_next(engine, world.bus->now);
	assert_int_equal(fake_count(world.bus, 1, FAKE_INQUIRY), sent);
	assert_int_equal(scan_send_next(engine, world.bus->now), false);
	engine->stations[0]->lanes[LANE_COMMAND].active = false;
	close_world(&world);
	return sent;
}

static void gives_way_to_whatever_the_line_is_for(void **state)
{
	static void (*const always[])(struct db_engine * engine, db_time now) = {
		be_quiet,     be_reserved,   await_late_answers, be_full,
		ask_this_one, lose_this_one, command_this_one,   stop_this_one,
	};

	(void)state;
	for (enum db_medium medium = DB_MEDIUM_SERIAL; medium <= DB_MEDIUM_CAN; medium++) {
		assert_true(asks(medium, do_nothing));
		for (size_t i = 0; i < sizeof(always) / sizeof(always[0]); i++)
			assert_false(asks(medium, always[i]));
	}
	/* Several may be asked at once on CAN only. */
	assert_false(asks(DB_MEDIUM_SERIAL, ask_another));
	assert_true(asks(DB_MEDIUM_CAN, ask_another));
}

/* --- verdicts ---------------------------------------------------------------------------------------- */

/* Answers every question of a visit so; the find. */
static struct db_scan_find visit_all(struct visit_outcome one, struct visit_outcome other)
{
	struct db_inquiry inquiry;
	struct visit visit;
	unsigned asked = 0;

	visit_begin(&visit, &fake_family, 9600, 4, DB_INQUIRY_THERE, 0);
	while (visit_next(&visit, &inquiry)) {
		if (inquiry.kind == DB_INQUIRY_THERE)
			visit_add_outcome(&visit, &inquiry, asked++ % 2 == 0 ? &one : &other);
		else
			visit_add_outcome(&visit, &inquiry, NULL);
		assert_true(asked < 20);
	}
	(void)visit_end(&visit);
	return visit.find;
}

static void tells_one_drive_from_two(void **state)
{
	const struct visit_outcome good = { .answered = true, .time_us = 3000 };
	const struct visit_outcome twice = { .answered = true, .doubled = true, .time_us = 3000 };
	const struct visit_outcome noise = { .garbled = true };
	const struct visit_outcome silence = { .answered = false };

	(void)state;
	assert_int_equal(visit_all(good, good).verdict, DB_SCAN_ONE);
	assert_int_equal(visit_all(good, silence).verdict, DB_SCAN_ONE);
	assert_int_equal(visit_all(twice, good).verdict, DB_SCAN_TWO);
	assert_int_equal(visit_all(noise, good).verdict, DB_SCAN_TWO);
	assert_int_equal(visit_all(noise, noise).verdict, DB_SCAN_GARBLED);
	assert_int_equal(visit_all(silence, silence).asked, 2);
	assert_int_equal(visit_all(good, good).time_mean_us, 3000);
}

static void tells_two_identities(void **state)
{
	static const char *const names[] = { "VSMD113", "VSMD123" };
	struct db_inquiry inquiry;
	struct visit visit;
	unsigned named = 0;

	(void)state;
	visit_begin(&visit, &fake_family, 9600, 4, DB_INQUIRY_THERE, 0);
	while (visit_next(&visit, &inquiry)) {
		struct visit_outcome outcome = { .answered = true, .time_us = 1 };

		if (inquiry.kind == DB_INQUIRY_IDENTITY)
			strcpy(outcome.said.identity, names[named++ % 2]);
		visit_add_outcome(&visit, &inquiry, &outcome);
	}
	assert_true(visit_end(&visit));
	assert_int_equal(visit.find.verdict, DB_SCAN_TWO);
	assert_string_equal(visit.find.identity, names[0]);
	assert_string_equal(visit.find.other, names[1]);
}

/* What each question is asked as, of a drive that answers each only in its second form. */
static void asks_in_another_form_until_one_is_answered(void **state)
{
	struct db_inquiry inquiry;
	struct visit visit;
	unsigned asked[2] = { 0, 0 };
	unsigned answered[2] = { 0, 0 };

	(void)state;
	visit_begin(&visit, &fake_family, 9600, 4, DB_INQUIRY_THERE, 0);
	while (visit_next(&visit, &inquiry)) {
		struct visit_outcome outcome = { .answered = inquiry.value == 1, .time_us = 1 };
		unsigned kind = inquiry.kind == DB_INQUIRY_IDENTITY;

		assert_true(inquiry.value <= 1);
		asked[kind]++;
		answered[kind] += outcome.answered;
		visit_add_outcome(&visit, &inquiry, &outcome);
	}
	assert_int_equal(asked[0], 5);
	assert_int_equal(answered[0], 4);
	assert_int_equal(asked[1], 3);
	assert_int_equal(answered[1], 2);
	assert_true(visit_end(&visit));
	assert_int_equal(visit.find.verdict, DB_SCAN_ONE);
}

/* Nothing is told where not one drive answers, or where it moves. */
static void tells_a_drive_only_where_it_stands_alone(void **state)
{
	struct db_inquiry inquiry;
	struct visit visit;

	(void)state;
	for (unsigned kind = 0; kind < 3; kind++) {
		struct visit_outcome outcome = { .answered = true,
			                         .doubled = kind == 1,
			                         .time_us = 1,
			                         .said = { .tells_standing = true,
			                                   .stands = kind == 0 } };
		bool told = false;

		visit_begin(&visit, &db_driver_vsmd_serial, 9600, 4, DB_INQUIRY_SET_ADDRESS, 5);
		while (visit_next(&visit, &inquiry)) {
			told = told || inquiry.kind == DB_INQUIRY_SET_ADDRESS;
			visit_add_outcome(&visit, &inquiry, &outcome);
		}
		assert_int_equal(told, kind == 0);
		assert_int_equal(visit.end, kind == 0 ? DB_SCAN_DONE :
		                            kind == 1 ? DB_SCAN_NOT_ONE :
		                                        DB_SCAN_STANDS_NOT);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(one_that_has_not_begun_tells_how_long_it_may_take),
		cmocka_unit_test(finds_who_is_there_and_makes_no_cycle_late),
		cmocka_unit_test(a_stop_waits_for_one_question_at_most),
		cmocka_unit_test(says_when_a_cycle_leaves_no_time),
		cmocka_unit_test(says_how_much_time_it_needs),
		cmocka_unit_test(its_answers_are_told_in_the_trace),
		cmocka_unit_test(waits_in_peace_for_what_it_asked_a_drive_that_is_away),
		cmocka_unit_test(waits_in_peace_for_a_port_that_takes_nothing),
		cmocka_unit_test(is_ended_by_its_client_and_with_the_port),
		cmocka_unit_test(sets_no_bus_aside_whose_drive_was_just_told_to_move),
		cmocka_unit_test(keeps_a_stop_for_a_drive_that_is_not_there),
		cmocka_unit_test(sets_up_no_drive_that_is_told_to_move_meanwhile),
		cmocka_unit_test(saves_nothing_while_a_drive_of_the_line_moves),
		cmocka_unit_test(saves_nothing_before_it_is_read_that_all_drives_stand),
		cmocka_unit_test(sets_nothing_that_must_be_saved_while_a_drive_of_the_line_moves),
		cmocka_unit_test(gives_way_to_whatever_the_line_is_for),
		cmocka_unit_test(tells_one_drive_from_two),
		cmocka_unit_test(tells_two_identities),
		cmocka_unit_test(asks_in_another_form_until_one_is_answered),
		cmocka_unit_test(tells_a_drive_only_where_it_stands_alone),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
