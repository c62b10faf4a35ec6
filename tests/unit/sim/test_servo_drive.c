/* SPDX-License-Identifier: Apache-2.0 */
/* The simulated servo: what its motor does, in made-up time. */
#include "sim/servo_drive.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define WORDS_ACK 7

struct bench {
	struct sim_servo *drive;
	db_time now;
	struct servo_can_message replies[SIM_SERVO_REPLIES];
	size_t count;
};

static struct bench make_with(const struct sim_servo_config *config)
{
	struct bench bench = { .now = 1000 * MS };

	bench.drive = sim_servo_new(config, bench.now);
	assert_non_null(bench.drive);
	return bench;
}

static struct bench make(void)
{
	struct sim_servo_config config;

	sim_servo_config_init(&config);
	return make_with(&config);
}

static void wait(struct bench *b, db_time time)
{
	b->now += time;
	sim_servo_advance(b->drive, b->now);
}

/* Tells it something; the code of the acknowledgement, 0 when there is none. */
static uint8_t tell(struct bench *b, struct servo_can_message message)
{
	const struct servo_can_layout layout = { .words = { .set = true, .ack = WORDS_ACK } };

	b->count = sim_servo_execute(b->drive, &message, &layout, b->now, b->replies);
	return b->count == 1 && b->replies[0].kind == SERVO_CAN_ACK ? b->replies[0].u.ack.code : 0;
}

static uint8_t tell_enable(struct bench *b, bool on)
{
	struct servo_can_message message = { .kind = SERVO_CAN_ENABLE, .node = 1 };

	message.u.enable = on;
	return tell(b, message);
}

static uint8_t tell_mode(struct bench *b, enum servo_can_mode mode, uint16_t max_speed)
{
	struct servo_can_message message = { .kind = SERVO_CAN_MODE, .node = 1 };

	message.u.mode.mode = mode;
	message.u.mode.has_max_speed = max_speed > 0;
	message.u.mode.max_speed = max_speed;
	return tell(b, message);
}

static uint8_t tell_speed(struct bench *b, int16_t rpm)
{
	struct servo_can_message message = { .kind = SERVO_CAN_SPEED, .node = 1 };

	message.u.speed = rpm;
	return tell(b, message);
}

static uint8_t tell_current(struct bench *b, int16_t tenths)
{
	struct servo_can_message message = { .kind = SERVO_CAN_CURRENT, .node = 1 };

	message.u.current = tenths;
	return tell(b, message);
}

static uint8_t tell_position(struct bench *b, enum servo_can_kind kind, int32_t position)
{
	struct servo_can_message message = { .kind = kind, .node = 1 };

	message.u.position = position;
	return tell(b, message);
}

static uint8_t tell_words(struct bench *b, uint16_t word0)
{
	struct servo_can_message message = { .kind = SERVO_CAN_WORDS, .node = 1 };

	message.u.words.word0 = word0;
	return tell(b, message);
}

/* The status bits, by reading. */
static uint16_t bits(struct bench *b)
{
	struct servo_can_message message = { .kind = SERVO_CAN_READ, .node = 1 };

	message.u.selector = (uint8_t)servo_can_selector(SERVO_CAN_GIVES_STATUS);
	tell(b, message);
	assert_int_equal(b->count, 1);
	assert_int_equal(b->replies[0].kind, SERVO_CAN_ANSWER_STATUS);
	return b->replies[0].u.status.bits;
}

static struct bench make_running(enum servo_can_mode mode)
{
	struct bench b = make();

	assert_int_equal(tell_mode(&b, mode, 0), SERVO_CAN_ACK_MODE);
	assert_int_equal(tell_enable(&b, true), SERVO_CAN_ACK_ENABLE);
	wait(&b, 20 * MS);
	return b;
}

static void power_follows_later(void **state)
{
	struct bench b = make();

	(void)state;
	assert_int_equal(tell_enable(&b, true), SERVO_CAN_ACK_ENABLE);
	assert_int_equal(bits(&b) & SERVO_CAN_ST_STARTED, 0);
	wait(&b, 6 * MS);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_STARTED, 0);
	assert_int_equal(tell_enable(&b, false), SERVO_CAN_ACK_ENABLE);
	wait(&b, 6 * MS);
	assert_int_equal(bits(&b) & SERVO_CAN_ST_STARTED, 0);
	free(b.drive);
}

static void speed_follows_its_ramps(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_SPEED);

	(void)state;
	assert_int_equal(tell_speed(&b, 1000), SERVO_CAN_ACK_SPEED);
	/* The acknowledgement tells what is measured: it has not begun yet. */
	assert_int_equal(b.replies[0].u.ack.value, 0);
	wait(&b, 50 * MS); /* 10000 rpm/s */
	assert_true(fabs(b.drive->rpm - 500) < 40);
	wait(&b, 100 * MS);
	assert_true(fabs(b.drive->rpm - 1000) < 2);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_SPEED_REACHED, 0);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_FORWARD, 0);
	assert_int_equal(bits(&b) & SERVO_CAN_ST_ZERO_SPEED, 0);
	/* 1000 rpm are 16.7 turns a second. */
	assert_true(b.drive->position > 10000);
	tell_speed(&b, -200);
	wait(&b, 500 * MS);
	assert_true(fabs(b.drive->rpm + 200) < 2);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_REVERSE, 0);
	tell_speed(&b, 0);
	wait(&b, 200 * MS);
	assert_true(b.drive->rpm == 0);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_ZERO_SPEED, 0);
	free(b.drive);
}

static void the_highest_speed_is_kept(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_SPEED);

	(void)state;
	tell_mode(&b, SERVO_CAN_MODE_SPEED, 300);
	tell_speed(&b, 1000);
	wait(&b, 500 * MS);
	assert_true(fabs(b.drive->rpm - 300) < 2);
	free(b.drive);
}

/* More inertia than the current limit can accelerate with the ramp: it takes longer. */
static void the_current_is_limited(void **state)
{
	struct sim_servo_config config;
	struct bench b;

	(void)state;
	sim_servo_config_init(&config);
	config.inertia *= 50;
	b = make_with(&config);
	tell_mode(&b, SERVO_CAN_MODE_SPEED, 0);
	tell_enable(&b, true);
	tell_speed(&b, 1000);
	wait(&b, 150 * MS);
	assert_true(b.drive->rpm < 500);
	assert_true(fabs(b.drive->amperes - 10.0) < 1e-9);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_TORQUE_LIMITED, 0);
	wait(&b, 2000 * MS);
	assert_true(fabs(b.drive->rpm - 1000) < 2);
	free(b.drive);
}

static void current_accelerates(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_CURRENT);

	(void)state;
	/* Not enough against friction: 0.1 A are 0.01 N m of 0.02. */
	assert_int_equal(tell_current(&b, 1), SERVO_CAN_ACK_CURRENT);
	wait(&b, 100 * MS);
	assert_true(b.drive->rpm == 0);
	tell_current(&b, -10);
	wait(&b, 20 * MS);
	assert_true(b.drive->rpm < -100);
	assert_true(fabs(b.drive->amperes + 1.0) < 1e-9);
	/* The speed limit holds also here. */
	wait(&b, 3000 * MS);
	assert_true(fabs(b.drive->rpm) < 3100);
	tell_current(&b, 0);
	wait(&b, 10000 * MS);
	assert_true(b.drive->rpm == 0);
	free(b.drive);
}

static void a_position_move_arrives(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_POSITION);

	(void)state;
	assert_int_equal(tell_position(&b, SERVO_CAN_POSITION, -25000), SERVO_CAN_ACK_POSITION);
	wait(&b, 100 * MS);
	assert_true(b.drive->position == 0);
	assert_int_equal(tell_words(&b, SERVO_CAN_CTRG), WORDS_ACK);
	wait(&b, 50 * MS);
	assert_int_equal(bits(&b) & SERVO_CAN_ST_POSITION_REACHED, 0);
	wait(&b, 2000 * MS);
	assert_true(b.drive->position == -25000);
	assert_true(b.drive->rpm == 0);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_POSITION_REACHED, 0);
	/* CTRG that stays up begins nothing. */
	tell_position(&b, SERVO_CAN_POSITION, 5);
	tell_words(&b, SERVO_CAN_CTRG);
	wait(&b, 500 * MS);
	assert_true(b.drive->position == -25000);
	assert_int_equal(b.drive->moves, 1);
	tell_words(&b, 0);
	tell_words(&b, SERVO_CAN_CTRG);
	wait(&b, 2000 * MS);
	assert_true(b.drive->position == 5);
	assert_int_equal(b.drive->moves, 2);
	free(b.drive);
}

/* What a bridge must not let happen, so the simulator lets it. */
static void an_old_speed_is_dangerous(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_SPEED);

	(void)state;
	tell_speed(&b, 500);
	wait(&b, 200 * MS);
	tell_enable(&b, false);
	wait(&b, 5000 * MS);
	assert_true(b.drive->rpm == 0);
	tell_enable(&b, true);
	wait(&b, 200 * MS);
	assert_true(b.drive->rpm > 490);
	free(b.drive);
}

static void feedback_of_a_held_motor_makes_it_jump(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_POSITION);

	(void)state;
	assert_int_equal(tell_position(&b, SERVO_CAN_SET_FEEDBACK, 5000),
	                 SERVO_CAN_ACK_SET_FEEDBACK);
	wait(&b, 1000 * MS);
	assert_true(b.drive->position == 0);
	tell_enable(&b, false);
	tell_position(&b, SERVO_CAN_SET_FEEDBACK, 5000);
	tell_enable(&b, true);
	wait(&b, 1000 * MS);
	assert_true(b.drive->position == 5000);
	free(b.drive);
}

static void a_weight_falls_without_power(void **state)
{
	struct sim_servo_config config;
	struct bench b;

	(void)state;
	sim_servo_config_init(&config);
	config.load = 0.2;
	b = make_with(&config);
	tell_enable(&b, true);
	wait(&b, 200 * MS);
	assert_true(fabs(b.drive->position) < 20);
	tell_enable(&b, false);
	wait(&b, 100 * MS);
	assert_true(b.drive->position < -20);
	free(b.drive);
}

static void sync_starts_what_is_staged(void **state)
{
	struct sim_servo_config config;
	struct bench b;

	(void)state;
	sim_servo_config_init(&config);
	config.synchronous = true;
	config.mode = SERVO_CAN_MODE_SPEED;
	b = make_with(&config);
	tell_enable(&b, true);
	assert_int_equal(tell_speed(&b, 100), SERVO_CAN_ACK_SPEED);
	wait(&b, 200 * MS);
	assert_true(b.drive->rpm == 0);
	assert_int_equal(tell(&b, (struct servo_can_message){ .kind = SERVO_CAN_SYNC }), 0);
	assert_int_equal(b.drive->setpoint_at, b.now);
	wait(&b, 200 * MS);
	assert_true(fabs(b.drive->rpm - 100) < 2);
	free(b.drive);
}

static void reports_have_their_intervals(void **state)
{
	struct servo_can_message report;
	unsigned counts[SERVO_CAN_KIND_COUNT] = { 0 };
	struct bench b = make();
	db_time end = b.now + 2000 * MS;

	(void)state;
	sim_servo_set_reports(b.drive, SIM_SERVO_REPORT_MOTION, 25 * MS, b.now);
	while (sim_servo_next(b.drive) <= end) {
		b.now = sim_servo_next(b.drive);
		assert_true(sim_servo_report(b.drive, b.now, &report));
		counts[report.kind]++;
	}
	assert_int_equal(counts[SERVO_CAN_REPORT_POSITION], 20);
	assert_int_equal(counts[SERVO_CAN_REPORT_MOTION], 80);
	assert_int_equal(counts[SERVO_CAN_REPORT_HEALTH], 2);
	for (int i = 0; i < SIM_SERVO_REPORTS; i++)
		sim_servo_set_reports(b.drive, (enum sim_servo_report)i, 0, b.now);
	assert_int_equal(sim_servo_next(b.drive), DB_TIME_NEVER);
	assert_false(sim_servo_report(b.drive, b.now + 5000 * MS, &report));
	free(b.drive);
}

static void faults_take_the_power(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_SPEED);
	struct servo_can_message report;

	(void)state;
	sim_servo_set_faults(b.drive, SERVO_CAN_FAULT_OVERCURRENT, b.now);
	b.drive->voltage = 1;
	b.drive->temperature = 2;
	wait(&b, 1000 * MS);
	assert_false(b.drive->enabled);
	do
		assert_true(sim_servo_report(b.drive, b.now, &report));
	while (report.kind != SERVO_CAN_REPORT_HEALTH);
	assert_int_equal(report.u.health.faults, SERVO_CAN_FAULT_OVERCURRENT);
	assert_int_equal(report.u.health.voltage, 1);
	assert_int_equal(report.u.health.temperature, 2);
	/* Enabling is acknowledged, and nothing follows. */
	assert_int_equal(tell_enable(&b, true), SERVO_CAN_ACK_ENABLE);
	wait(&b, 100 * MS);
	assert_int_equal(bits(&b) & SERVO_CAN_ST_STARTED, 0);
	sim_servo_set_faults(b.drive, 0, b.now);
	tell_enable(&b, true);
	wait(&b, 100 * MS);
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_STARTED, 0);
	free(b.drive);
}

static struct bench make_tempered(const struct sim_servo_temper *temper, enum servo_can_mode mode)
{
	struct sim_servo_config config;
	struct bench b;

	sim_servo_config_init(&config);
	config.temper = *temper;
	b = make_with(&config);
	tell_mode(&b, mode, 0);
	tell_enable(&b, true);
	wait(&b, 20 * MS);
	return b;
}

/* What a bridge must not let happen, so the simulator lets it. */
static void some_go_on_when_a_fault_is_gone(void **state)
{
	static const struct sim_servo_temper tempers[] = {
		{ .fault_power = SIM_SERVO_FAULT_KEEPS },
		{ .fault_power = SIM_SERVO_FAULT_RESUMES },
	};

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct bench b = make_tempered(&tempers[i], SERVO_CAN_MODE_SPEED);
		bool shown = tempers[i].fault_power == SIM_SERVO_FAULT_KEEPS;

		tell_speed(&b, 300);
		wait(&b, 200 * MS);
		sim_servo_set_faults(b.drive, SERVO_CAN_FAULT_OVERCURRENT, b.now);
		wait(&b, 5000 * MS);
		assert_true(b.drive->rpm == 0);
		assert_int_not_equal(bits(&b) & SERVO_CAN_ST_ERROR, 0);
		assert_int_equal((bits(&b) & SERVO_CAN_ST_STARTED) != 0, shown);
		sim_servo_set_faults(b.drive, 0, b.now);
		wait(&b, 200 * MS);
		assert_int_equal(bits(&b) & SERVO_CAN_ST_ERROR, 0);
		assert_int_not_equal(bits(&b) & SERVO_CAN_ST_STARTED, 0);
		assert_true(b.drive->rpm > 290);
		free(b.drive);
	}
}

/* A demand of 9000 from a move, one of 500 written without power, and CTRG behind that. */
static void where_a_demand_comes_from(void **state)
{
	static const struct {
		struct sim_servo_temper temper;
		int written; /* the motor's place after enabling behind the write ... */
		int triggered;
		int reset;
	} cases[] = {
		{ { .demand = SIM_SERVO_DEMAND_POSITION }, 9000, 9000, 9000 },
		{ { .demand = SIM_SERVO_DEMAND_WRITTEN }, 500, 500, 0 },
		{ { .demand = SIM_SERVO_DEMAND_TRIGGERED }, 9000, 500, 0 },
		{ { .demand = SIM_SERVO_DEMAND_MOVED }, 9000, 9000, 0 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct bench b = make_tempered(&cases[i].temper, SERVO_CAN_MODE_POSITION);

		tell_position(&b, SERVO_CAN_POSITION, 9000);
		tell_words(&b, SERVO_CAN_CTRG);
		wait(&b, 2000 * MS);
		assert_true(b.drive->position == 9000);
		for (int triggered = 0; triggered < 2; triggered++) {
			tell_enable(&b, false);
			tell_words(&b, 0);
			tell_position(&b, SERVO_CAN_POSITION, 500);
			tell_words(&b, triggered ? SERVO_CAN_CTRG : 0);
			wait(&b, 100 * MS);
			tell_enable(&b, true);
			wait(&b, 2000 * MS);
			assert_true(b.drive->position ==
			            (triggered ? cases[i].triggered : cases[i].written));
		}
		assert_int_equal(b.drive->moves, 1);
		/* A reset that nobody notices: it has power, and a demand of its own. */
		tell_enable(&b, false);
		tell_position(&b, SERVO_CAN_SET_FEEDBACK, 9000);
		sim_servo_power(b.drive, false, b.now);
		sim_servo_power(b.drive, true, b.now);
		tell_enable(&b, true);
		wait(&b, 2000 * MS);
		assert_true(b.drive->position == cases[i].reset);
		free(b.drive);
	}
}

static void some_speeds_have_no_sign(void **state)
{
	static const struct sim_servo_temper temper = { .unsigned_speed = true };
	struct bench b = make_tempered(&temper, SERVO_CAN_MODE_SPEED);
	struct servo_can_message message = { .kind = SERVO_CAN_READ, .node = 1 };

	(void)state;
	tell_speed(&b, -300);
	wait(&b, 200 * MS);
	tell(&b, message);
	assert_int_equal(b.count, 3);
	assert_int_equal(b.replies[1].u.motion.speed, 300);
	assert_int_not_equal(b.replies[2].u.status.bits & SERVO_CAN_ST_REVERSE, 0);
	free(b.drive);
}

static void a_restart_forgets(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_SPEED);

	(void)state;
	tell_speed(&b, 500);
	wait(&b, 100 * MS);
	sim_servo_power(b.drive, false, b.now);
	assert_int_equal(tell_enable(&b, true), 0);
	assert_int_equal(b.count, 0);
	assert_int_equal(sim_servo_next(b.drive), DB_TIME_NEVER);
	wait(&b, 5000 * MS);
	sim_servo_power(b.drive, true, b.now);
	assert_int_equal(b.drive->mode, SERVO_CAN_MODE_POSITION);
	assert_false(b.drive->enabled);
	assert_true(b.drive->position > 1000);
	free(b.drive);
}

static void a_blocked_shaft_stands(void **state)
{
	struct bench b = make_running(SERVO_CAN_MODE_SPEED);

	(void)state;
	sim_servo_advance(b.drive, b.now);
	b.drive->blocked = true;
	tell_speed(&b, 500);
	wait(&b, 500 * MS);
	assert_true(b.drive->position == 0);
	assert_true(b.drive->amperes > 1);
	sim_servo_advance(b.drive, b.now);
	b.drive->blocked = false;
	wait(&b, 200 * MS);
	assert_true(b.drive->rpm > 400);
	free(b.drive);
}

static void reads_tell_inputs(void **state)
{
	struct bench b = make();
	struct servo_can_message message = { .kind = SERVO_CAN_READ, .node = 1 };

	(void)state;
	b.drive->inputs = 0xA5;
	b.drive->analogue = 1234;
	b.drive->forced = SERVO_CAN_ST_WARNING;
	assert_int_not_equal(bits(&b) & SERVO_CAN_ST_WARNING, 0);
	assert_int_equal(b.replies[0].u.status.inputs, 0xA5);
	message.u.selector = 7;
	tell(&b, message);
	assert_int_equal(b.count, 1);
	assert_int_equal(b.replies[0].u.analogue, 1234);
	message.u.selector = 0;
	tell(&b, message);
	assert_int_equal(b.count, 3);
	assert_int_equal(b.drive->counts[SERVO_CAN_READ], 3);
	free(b.drive);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(power_follows_later),
		cmocka_unit_test(speed_follows_its_ramps),
		cmocka_unit_test(the_highest_speed_is_kept),
		cmocka_unit_test(the_current_is_limited),
		cmocka_unit_test(current_accelerates),
		cmocka_unit_test(a_position_move_arrives),
		cmocka_unit_test(an_old_speed_is_dangerous),
		cmocka_unit_test(feedback_of_a_held_motor_makes_it_jump),
		cmocka_unit_test(a_weight_falls_without_power),
		cmocka_unit_test(sync_starts_what_is_staged),
		cmocka_unit_test(reports_have_their_intervals),
		cmocka_unit_test(faults_take_the_power),
		cmocka_unit_test(some_go_on_when_a_fault_is_gone),
		cmocka_unit_test(where_a_demand_comes_from),
		cmocka_unit_test(some_speeds_have_no_sign),
		cmocka_unit_test(a_restart_forgets),
		cmocka_unit_test(a_blocked_shaft_stands),
		cmocka_unit_test(reads_tell_inputs),
	};

	return cmocka_run_group_tests_name("sim/servo_drive", tests, NULL, NULL);
}
