/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The schedule in made-up time against made-up drives that speak the real protocol: what is on the
 * wire, in which order, and what becomes of a command whose request or answer is lost.
 */
#include "codec/vsmd_serial_frames.h"
#include "fakes/bus.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 3
#define MS DB_NS_PER_MS

enum fault { FAULT_NONE, FAULT_LOSE_REQUEST, FAULT_LOSE_ANSWER, FAULT_LATE_ANSWER, FAULT_REFUSE };

struct drive {
	struct vsmd_status status;
	bool dead;
	db_time deaf; /* after each of its answers */
	db_time deaf_until;
	db_time latency;  /* 0: as all the others */
	enum fault fault; /* of the next request that `fault_verb` matches */
	enum vsmd_verb fault_verb;
	unsigned executed[VSMD_VERB_COUNT];
};

struct world {
	struct fake_bus *bus;
	struct drive sim[DRIVES];
	uint8_t late[VSMD_SERIAL_FRAME_MAX];
	size_t late_length;
	char log[4096];      /* every line sent since it was cleared */
	db_time quiet_since; /* end of the last answer */
	db_time least_gap;   /* between an answer and the next request */
	unsigned told_timing[DB_EVENT_COUNT];
	db_time timing; /* told last */
	struct {
		enum db_event event;
		unsigned address;
		struct db_feedback feedback;
	} told[32];
	size_t told_count;
};

static void execute(struct drive *drive, const struct vsmd_command *command)
{
	struct vsmd_status *status = &drive->status;

	drive->executed[command->verb]++;
	status->status &= ~(uint32_t)VSMD_ST_CMD_WRG;
	switch (command->verb) {
	case VSMD_DEV:
		status->status |= VSMD_ST_HS;
		break;
	case VSMD_ENA:
		status->status |= VSMD_ST_PWR;
		break;
	case VSMD_OFF:
		status->status &= ~(uint32_t)VSMD_ST_PWR;
		status->status |= VSMD_ST_STP;
		break;
	case VSMD_POS:
	case VSMD_MOV:
		if (!(status->status & VSMD_ST_PWR))
			status->status |= VSMD_ST_CMD_WRG;
		else if (command->verb == VSMD_POS)
			status->position = command->position; /* arrives at once */
		else
			status->status &= ~(uint32_t)VSMD_ST_STP;
		break;
	case VSMD_STP:
		status->status |= VSMD_ST_STP;
		break;
	case VSMD_ORG:
		status->position = command->position;
		break;
	default:
		break;
	}
}

static size_t reply(const struct drive *drive, uint8_t id, const struct vsmd_command *command,
                    uint8_t *frame)
{
	static const char identity[] = "VSMD113_025T-1.0.008.170428";
	static const char params[] = "bdr=115200 cid=1 spd=6400 acc=24000.00 dmd=1";
	int length;

	if (command->verb == VSMD_DEV)
		length = vsmd_serial_encode_text(id, VSMD_REPLY_IDENTITY, identity,
		                                 strlen(identity), frame, VSMD_SERIAL_FRAME_MAX);
	else if (command->verb == VSMD_CFG_READ || command->verb == VSMD_SAV)
		length = vsmd_serial_encode_text(id, VSMD_REPLY_PARAMS, params, strlen(params),
		                                 frame, VSMD_SERIAL_FRAME_MAX);
	else
		length = vsmd_serial_encode_status(id, &drive->status, frame,
		                                   VSMD_SERIAL_FRAME_MAX);
	assert_true(length > 0);
	return (size_t)length;
}

static db_time on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	struct vsmd_setting settings[VSMD_PARAM_COUNT];
	uint8_t answer[VSMD_SERIAL_FRAME_MAX];
	struct vsmd_command command;
	struct drive *drive;
	enum fault fault = FAULT_NONE;
	db_time now = world->bus->now;
	db_time latency;

	if (world->quiet_since != 0 && now - world->quiet_since < world->least_gap)
		world->least_gap = now - world->quiet_since;
	assert_true(strlen(world->log) + length < sizeof world->log);
	strncat(world->log, (const char *)bytes, length);
	/* A bare line end, in case that the line before had lost its own. */
	if (bytes[0] == '\n') {
		bytes++;
		length--;
	}
	assert_int_equal(vsmd_serial_decode_command((const char *)bytes, length - 1, true, &command,
	                                            settings, VSMD_PARAM_COUNT),
	                 VSMD_OK);
	if (command.id == VSMD_SERIAL_BROADCAST) {
		for (size_t i = 0; i < DRIVES; i++)
			execute(&world->sim[i], &command);
		return now;
	}
	drive = &world->sim[command.id - 1];
	if (drive->fault != FAULT_NONE && drive->fault_verb == command.verb) {
		fault = drive->fault;
		drive->fault = FAULT_NONE;
	}
	if (drive->dead || fault == FAULT_LOSE_REQUEST || now < drive->deaf_until)
		return now;
	if (fault == FAULT_REFUSE)
		drive->status.status |= VSMD_ST_CMD_WRG;
	else
		execute(drive, &command);
	if (fault == FAULT_LOSE_ANSWER)
		return now;
	if (fault == FAULT_LATE_ANSWER) {
		world->late_length = reply(drive, (uint8_t)command.id, &command, world->late);
		return now;
	}
	latency = drive->latency > 0 ? drive->latency : 2 * MS;
	fake_answer_after(world->bus, latency, answer,
	                  reply(drive, (uint8_t)command.id, &command, answer));
	world->quiet_since = now + latency;
	drive->deaf_until = now + latency + drive->deaf;
	return now;
}

static void on_tell(void *context, const struct db_drive_config *drive, enum db_event event,
                    const struct db_feedback *feedback)
{
	struct world *world = context;

	assert_true(world->told_count < sizeof world->told / sizeof world->told[0]);
	world->told[world->told_count].event = event;
	world->told[world->told_count].address = drive->address;
	world->told[world->told_count++].feedback = *feedback;
}

static void on_tell_timing(void *context, const struct db_drive_config *drive, enum db_event event,
                           db_time time)
{
	struct world *world = context;

	(void)drive;
	world->told_timing[event]++;
	world->timing = time;
}

static const struct db_engine_ops ops = {
	.send = on_send,
	.tell = on_tell,
	.tell_timing = on_tell_timing,
};

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->bus = fake_bus_new(db_driver_find("vsmd-serial"), DRIVES);
	world->bus->context = world;
	world->bus->config.transport = &db_transport_serial;
	world->bus->config.baud = 115200;
	world->bus->config.stop_bits = 1;
	for (size_t i = 0; i < DRIVES; i++)
		world->sim[i].status.status = VSMD_ST_STP;
	fake_bus_open(world->bus, DRIVES, &ops);
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	fake_bus_free(world->bus);
	free(world);
	return 0;
}

static void start_bus(struct world *world)
{
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	world->log[0] = '\0';
}

static uint32_t status_of(const struct world *world, size_t drive)
{
	return fake_feedback(world->bus, drive).status;
}

static void post_motion(struct world *world, uint16_t drive, enum db_command command,
                        int32_t position)
{
	fake_request(world->bus, drive,
	             (struct db_request){
			     .command = command,
			     .args = { .target_position = position, .target_velocity = 100.0f },
		     });
}

static size_t count_sent(const struct world *world, const char *text)
{
	size_t found = 0;

	for (const char *at = world->log; (at = strstr(at, text)) != NULL; at++)
		found++;
	return found;
}

static void drives_come_online_and_tell_their_parameters(void **state)
{
	struct world *world = *state;
	struct db_nameplate plate;

	assert_int_equal(status_of(world, 0), 0);
	start_bus(world);
	for (size_t i = 0; i < DRIVES; i++) {
		assert_true(status_of(world, i) & DB_STATUS_ONLINE);
		assert_true(status_of(world, i) & DB_STATUS_PARAMS_VALID);
	}
	db_axis_read_nameplate(world->bus->list[2].axis, &plate);
	assert_string_equal(plate.identity, "VSMD113_025T-1.0.008.170428");
	assert_true(plate.values[VSMD_SPD].f == 6400.0f);
	assert_true(plate.values[VSMD_ACC].f == 24000.0f);
	assert_true(plate.valid & (UINT64_C(1) << VSMD_BDR));
	assert_false(plate.valid & (UINT64_C(1) << VSMD_MCS));
}

static void every_drive_is_polled_once_a_cycle(void **state)
{
	struct world *world = *state;
	struct db_bus_stats stats;

	start_bus(world);
	fake_pass(world->bus, 200 * MS);
	assert_in_range(count_sent(world, "1 sts\n"), 9, 11);
	assert_in_range(count_sent(world, "2 sts\n"), 9, 11);
	assert_in_range(count_sent(world, "3 sts\n"), 9, 11);
	assert_int_equal(count_sent(world, "dev"), 0);
	stats = fake_stats(world->bus);
	assert_int_equal(stats.overruns, 0);
	assert_int_equal(stats.online, 3);
	assert_in_range(stats.cycle_us, 6000, 6500);
}

static void a_cycle_that_does_not_fit_overruns_and_stays_fair(void **state)
{
	struct world *world = *state;
	struct db_bus_stats stats;

	db_engine_free(world->bus->engine);
	db_queue_free(world->bus->queue);
	world->bus->config.cycle_ms = 4;
	fake_bus_open(world->bus, DRIVES, &ops);
	start_bus(world);
	for (size_t i = 0; i < DRIVES; i++)
		assert_true(status_of(world, i) & DB_STATUS_PARAMS_VALID);
	fake_pass(world->bus, 120 * MS);
	assert_in_range(count_sent(world, "1 sts\n"), 19, 21);
	assert_in_range(count_sent(world, "2 sts\n"), 19, 21);
	assert_in_range(count_sent(world, "3 sts\n"), 19, 21);
	stats = fake_stats(world->bus);
	assert_true(stats.overruns > 20);
}

static void a_dead_drive_costs_little(void **state)
{
	struct world *world = *state;

	world->sim[1].dead = true;
	start_bus(world);
	fake_pass(world->bus, 5000 * MS); /* the backoff has grown */
	world->log[0] = '\0';
	assert_false(status_of(world, 1) & DB_STATUS_ONLINE);
	assert_true(status_of(world, 0) & DB_STATUS_ONLINE);
	fake_pass(world->bus, 2000 * MS);
	assert_in_range(count_sent(world, "1 sts\n"), 99, 101);
	assert_in_range(count_sent(world, "2 dev\n"), 1, 3);
	world->sim[1].dead = false;
	fake_pass(world->bus, 2500 * MS);
	assert_true(status_of(world, 1) & DB_STATUS_ONLINE);
	assert_true(status_of(world, 1) & DB_STATUS_PARAMS_VALID);
}

static void a_command_is_sent_once_and_confirmed(void **state)
{
	struct world *world = *state;
	struct db_snapshot snapshot;

	start_bus(world);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	post_motion(world, 0, DB_CMD_MOVE_ABSOLUTE, 25000);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(count_sent(world, "1 ena\n"), 1);
	assert_int_equal(count_sent(world, "1 pos 25000 spd=100\n"), 1);
	assert_true(strstr(world->log, "ena") < strstr(world->log, "pos"));
	fake_pass(world->bus, 40 * MS);
	snapshot = fake_snapshot(world->bus, 0);
	assert_int_equal(snapshot.feedback.position, 25000);
	assert_int_equal(snapshot.feedback.state, DB_AXIS_STANDSTILL);
	assert_true(snapshot.feedback.status & DB_STATUS_AT_TARGET);
}

static void a_refused_command_says_so(void **state)
{
	struct world *world = *state;

	start_bus(world);
	post_motion(world, 0, DB_CMD_MOVE_ABSOLUTE, 1); /* not enabled */
	fake_pass(world->bus, 20 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_REFUSED);
	assert_int_equal(world->sim[0].executed[VSMD_POS], 1);
	assert_true(status_of(world, 0) & DB_STATUS_REFUSED);
}

static void enable_first(struct world *world)
{
	start_bus(world);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 30 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	world->log[0] = '\0';
}

static void fail_next(struct world *world, size_t drive, enum vsmd_verb verb, enum fault fault)
{
	world->sim[drive].fault = fault;
	world->sim[drive].fault_verb = verb;
}

static void a_relative_move_whose_answer_is_lost_moves_once(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_POS, FAULT_LOSE_ANSWER);
	post_motion(world, 0, DB_CMD_MOVE_RELATIVE, 500);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(world->sim[0].executed[VSMD_POS], 1);
	assert_int_equal(world->sim[0].executed[VSMD_RMV], 0);
	assert_int_equal(world->sim[0].status.position, 500);
}

static void a_relative_move_whose_request_is_lost_is_sent_again(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].status.position = 70;
	fail_next(world, 0, VSMD_POS, FAULT_LOSE_REQUEST);
	post_motion(world, 0, DB_CMD_MOVE_RELATIVE, 500);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(world->sim[0].executed[VSMD_POS], 1);
	assert_int_equal(world->sim[0].status.position, 570);
}

static void a_lost_set_position_is_read_back(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_ORG, FAULT_LOSE_ANSWER);
	post_motion(world, 0, DB_CMD_SET_POSITION, 1234);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(world->sim[0].executed[VSMD_ORG], 1);
}

static void a_lost_save_is_indeterminate_and_not_repeated(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_SAV, FAULT_LOSE_ANSWER);
	fake_post(world->bus, 0, DB_CMD_SAVE_PARAMETERS);
	fake_pass(world->bus, 1500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_INDETERMINATE);
	assert_int_equal(world->sim[0].executed[VSMD_SAV], 1);
}

/* The answer to an earlier status poll comes while a command waits for its own. */
static void a_late_answer_is_not_taken_for_the_next_ones(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_STS, FAULT_LATE_ANSWER);
	while (world->late_length == 0)
		fake_pass(world->bus, MS);
	fail_next(world, 0, VSMD_MOV, FAULT_LOSE_REQUEST);
	post_motion(world, 0, DB_CMD_MOVE_VELOCITY, 0);
	for (int i = 0; i < 40; i++) {
		fake_pass(world->bus, MS);
		if (world->late_length > 0 && count_sent(world, "1 dev\n") > 0) {
			fake_receive(world->bus, world->late, world->late_length);
			world->late_length = 0;
		}
		/* Never confirmed before the drive has really done it. */
		if (world->sim[0].executed[VSMD_MOV] == 0)
			assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	}
	assert_int_equal(world->late_length, 0);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(world->sim[0].executed[VSMD_MOV], 1);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
}

static void a_stop_overtakes_and_cancels(void **state)
{
	struct world *world = *state;
	struct db_completion completion;
	unsigned cancelled = 0;

	enable_first(world);
	for (int i = 0; i < 4; i++)
		post_motion(world, 0, DB_CMD_MOVE_ABSOLUTE, 1000 + i);
	fake_post(world->bus, 1, DB_CMD_ENABLE);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 30 * MS);
	assert_true(strncmp(world->log, "1 stp\n", 6) == 0 ||
	            strncmp(strchr(world->log, '\n') + 1, "1 stp\n", 6) == 0);
	assert_int_equal(count_sent(world, "1 pos"), 0);
	while (db_queue_collect(world->bus->queue, &completion)) {
		if (completion.result == DB_RESULT_CANCELLED)
			cancelled++;
		else
			assert_int_equal(completion.result, DB_RESULT_OK);
	}
	assert_int_equal(cancelled, 4);
	assert_int_equal(world->sim[1].executed[VSMD_ENA], 1);
}

static void a_stop_is_repeated_until_confirmed(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].dead = true;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 2000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	assert_true(count_sent(world, "1 stp\n") > 5);
	/* And the others are not starved by it. */
	assert_in_range(count_sent(world, "2 sts\n"), 80, 101);
	world->sim[0].dead = false;
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_true(world->sim[0].executed[VSMD_STP] >= 1);
}

static void commands_to_a_drive_that_is_gone_end(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].dead = true;
	post_motion(world, 0, DB_CMD_MOVE_VELOCITY, 0);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 300 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_INDETERMINATE);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OFFLINE);
	assert_false(status_of(world, 0) & DB_STATUS_ONLINE);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 1 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OFFLINE);
}

static void a_lost_port_ends_everything_and_comes_back(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->bus->answer_count = 0;
	fake_port(world->bus, 5);
	world->bus->answer_count = 0;
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_BUS_DOWN);
	assert_false(status_of(world, 0) & DB_STATUS_BUS_UP);
	assert_false(status_of(world, 0) & DB_STATUS_ONLINE);
	start_bus(world);
	assert_true(status_of(world, 0) & DB_STATUS_ONLINE);
}

static void a_drive_that_lost_power_is_read_again(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].status = (struct vsmd_status){ .status = VSMD_ST_STP };
	fake_pass(world->bus, 300 * MS);
	assert_true(count_sent(world, "1 cfg\n") >= 1);
	assert_true(status_of(world, 0) & DB_STATUS_ORIGIN_LOST);
}

/* The text of all parameters takes as long on the wire as many commands: a stop would wait behind it. */
static void no_drive_tells_its_parameters_while_another_moves(void **state)
{
	struct world *world = *state;

	world->bus->config.baud = 9600;
	world->sim[2].dead = true;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 2000 * MS);
	world->sim[0].status.status &= ~(uint32_t)VSMD_ST_STP;
	fake_pass(world->bus, 200 * MS);
	assert_true(status_of(world, 0) & DB_STATUS_MOVING);
	world->sim[2].dead = false;
	world->log[0] = '\0';
	fake_pass(world->bus, 4000 * MS);
	assert_true(status_of(world, 2) & DB_STATUS_ONLINE);
	assert_int_equal(count_sent(world, " cfg\n"), 0);
	/* All stand. */
	world->sim[0].status.status |= VSMD_ST_STP;
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(count_sent(world, "3 cfg\n"), 1);
	assert_true(status_of(world, 2) & DB_STATUS_PARAMS_VALID);
}

static void a_drive_that_moves_for_ever_does_not_hide_the_parameters_of_others(void **state)
{
	struct world *world = *state;

	world->bus->config.baud = 9600;
	world->sim[0].status.status &= ~(uint32_t)VSMD_ST_STP;
	fake_port(world->bus, 0);
	for (unsigned seconds = 0; seconds < 35; seconds++) {
		world->log[0] = '\0';
		fake_pass(world->bus, 1000 * MS);
		assert_true(count_sent(world, " cfg\n") <= 1);
	}
	for (size_t i = 0; i < DRIVES; i++)
		assert_true(status_of(world, i) & DB_STATUS_PARAMS_VALID);
	/* The time that one waited is not counted for another, much later. */
	world->sim[2].dead = true;
	for (unsigned seconds = 0; seconds < 15; seconds++) {
		world->log[0] = '\0';
		fake_pass(world->bus, 1000 * MS);
	}
	world->sim[2].dead = false;
	for (unsigned seconds = 0; seconds < 4; seconds++) {
		world->log[0] = '\0';
		fake_pass(world->bus, 1000 * MS);
		assert_int_equal(count_sent(world, " cfg\n"), 0);
	}
	assert_true(status_of(world, 2) & DB_STATUS_ONLINE);
	/* Who is asked to is not made to wait. */
	world->log[0] = '\0';
	fake_post(world->bus, 1, DB_CMD_READ_PARAMETERS);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(count_sent(world, "2 cfg\n"), 1);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
}

static void the_end_stops_every_drive(void **state)
{
	struct world *world = *state;

	enable_first(world);
	db_engine_shut_down(world->bus->engine, world->bus->now);
	fake_pass(world->bus, 50 * MS);
	assert_true(db_engine_is_quiet(world->bus->engine));
	/* All at once by broadcast, then each one for its confirmation. */
	assert_memory_equal(world->log, "0 stp\n1 stp\n", 12);
	assert_int_equal(count_sent(world, " stp\n"), 4);
}

/* --- drives that are slower than others --------------------------------------------------------------- */

static void drives_get_time_to_turn_around(void **state)
{
	struct world *world = *state;

	world->least_gap = 1000 * MS;
	start_bus(world);
	assert_int_equal(world->least_gap, 0);
	world->bus->config.turnaround_us = 1000;
	for (size_t i = 0; i < DRIVES; i++)
		world->sim[i].deaf = MS;
	fake_pass(world->bus, 100 * MS); /* what was lost meanwhile is over */
	world->least_gap = 1000 * MS;
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_post(world->bus, 1, DB_CMD_STOP);
	fake_pass(world->bus, 400 * MS);
	assert_int_equal(world->least_gap, MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	for (size_t i = 0; i < DRIVES; i++)
		assert_true(status_of(world, i) & DB_STATUS_ONLINE);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_DEAF], 0);
}

static void a_drive_that_is_deaf_for_longer_is_told_of(void **state)
{
	struct world *world = *state;

	/* One on the line, so that every request follows its own answer. */
	world->sim[1].dead = world->sim[2].dead = true;
	world->bus->config.turnaround_us = 1000;
	start_bus(world);
	world->sim[0].deaf = 4 * MS;
	/* Its parameters are asked for right behind the answer who it is. */
	for (unsigned i = 0; i < 3; i++) {
		fake_post(world->bus, 0, DB_CMD_READ_PARAMETERS);
		fake_pass(world->bus, 1000 * MS);
	}
	assert_true(world->told_timing[DB_EVENT_DRIVE_DEAF] > 0);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_LATE], 0);
	assert_int_equal(world->timing, MS);
}

static void a_drive_that_answers_late_is_told_of(void **state)
{
	struct world *world = *state;
	unsigned missing = 0;

	world->sim[0].latency = 14 * MS; /* 10 are waited for */
	start_bus(world);
	fake_pass(world->bus, 3000 * MS);
	assert_true(world->told_timing[DB_EVENT_DRIVE_LATE] > 0);
	assert_in_range(world->timing, 10 * MS, 14 * MS);
	for (size_t i = 0; i < world->told_count; i++)
		missing += world->told[i].event == DB_EVENT_DRIVE_LOST;
	assert_int_equal(missing, 0);
}

static void who_is_just_away_is_neither_late_nor_deaf(void **state)
{
	struct world *world = *state;

	start_bus(world);
	for (unsigned i = 0; i < 20; i++) {
		world->sim[0].dead = i % 2 == 0;
		fake_pass(world->bus, 200 * MS);
		world->told_count = 0;
	}
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_DEAF], 0);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_LATE], 0);
}

/* --- stops that must not be lost ----------------------------------------------------------------------- */

/* Nobody else would say the bridge's own stops again. */
static void a_stop_at_the_end_that_is_refused_is_said_again(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].status.status = VSMD_ST_HS | VSMD_ST_PWR; /* runs */
	fake_pass(world->bus, 50 * MS);
	/* Otherwise a broadcast would have stopped it already. */
	world->bus->drives[1].on_exit = DB_ON_LOSS_NONE;
	fail_next(world, 0, VSMD_STP, FAULT_REFUSE);
	db_engine_shut_down(world->bus->engine, world->bus->now);
	for (unsigned i = 0; i < 200 && !db_engine_is_quiet(world->bus->engine); i++)
		fake_pass(world->bus, 1 * MS);
	assert_true(db_engine_is_quiet(world->bus->engine));
	assert_int_equal(count_sent(world, "1 stp\n"), 2);
	assert_true(world->sim[0].status.status & VSMD_ST_STP);
}

static void a_drive_that_is_offline_at_the_end_is_stopped_when_it_answers(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->sim[1].status.status = VSMD_ST_HS | VSMD_ST_PWR; /* runs */
	world->sim[1].dead = true;
	fake_pass(world->bus, 200 * MS);
	assert_false(status_of(world, 1) & DB_STATUS_ONLINE);
	/* The line is whole again, and nobody has noticed. */
	world->sim[1].dead = false;
	db_engine_shut_down(world->bus->engine, world->bus->now);
	for (unsigned i = 0; i < 1500 && !db_engine_is_quiet(world->bus->engine); i++)
		fake_pass(world->bus, 1 * MS);
	assert_true(world->sim[1].status.status & VSMD_ST_STP);
}

static void a_homing_run_that_began_unheard_is_ended_by_a_stop(void **state)
{
	struct world *world = *state;
	char *stop;

	start_bus(world);
	world->sim[0].status.status |= VSMD_ST_HS | VSMD_ST_PWR;
	fake_pass(world->bus, 50 * MS);
	world->sim[0].fault = FAULT_LOSE_ANSWER;
	world->sim[0].fault_verb = VSMD_ZERO_START;
	post_motion(world, 0, DB_CMD_HOME, 0);
	while (!strstr(world->log, "zero start"))
		fake_pass(world->bus, MS / 8);
	fake_pass(world->bus, 2 * MS);
	world->sim[0].status.status &= ~(uint32_t)VSMD_ST_STP;
	world->log[0] = '\0';
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 200 * MS);
	stop = strstr(world->log, "1 stp");
	assert_non_null(stop);
	assert_non_null(strstr(stop, "1 zero stop"));
}

static void a_shake_whose_answer_is_lost_is_not_begun_again(void **state)
{
	struct world *world = *state;
	const struct db_request request = {
		.command = DB_CMD_SHAKE_START,
		.args = { .shake_end_position = 100, .shake_frequency = 20.0f, .shake_cycles = 1 },
	};

	start_bus(world);
	world->sim[0].status.status |= VSMD_ST_HS | VSMD_ST_PWR;
	fake_pass(world->bus, 50 * MS);
	world->sim[0].fault = FAULT_LOSE_ANSWER;
	world->sim[0].fault_verb = VSMD_SHAKE_CYCLES;
	fake_request(world->bus, 0, request);
	fake_pass(world->bus, 200 * MS);
	/* It is over by now, back where it began. */
	assert_int_equal(fake_result(world->bus), DB_RESULT_INDETERMINATE);
	assert_int_equal(world->sim[0].executed[VSMD_SHAKE_CYCLES], 1);
}

static void silent_drives_do_not_keep_a_stop_from_one_that_answers(void **state)
{
	struct world *world = *state;

	world->sim[0].dead = world->sim[1].dead = true;
	start_bus(world);
	fake_pass(world->bus, 1000 * MS);
	for (unsigned i = 0; i < 4; i++) {
		fake_post(world->bus, 0, DB_CMD_STOP);
		fake_post(world->bus, 1, DB_CMD_QUICK_STOP);
	}
	fake_pass(world->bus, 1000 * MS);
	world->log[0] = '\0';
	world->sim[2].status.status = VSMD_ST_HS | VSMD_ST_PWR; /* runs */
	fake_post(world->bus, 2, DB_CMD_STOP);
	/* At most the one transaction that is on the wire. */
	fake_pass(world->bus, 25 * MS);
	assert_true(world->sim[2].status.status & VSMD_ST_STP);
	/* Both silent ones share one part of the bus. */
	world->log[0] = '\0';
	fake_pass(world->bus, 1000 * MS);
	assert_true(count_sent(world, "3 sts\n") > 40);
	assert_true(count_sent(world, "1 stp") > 3 && count_sent(world, "2 stp") > 3);
}

/* --- what is told for the log ----------------------------------------------------------------------- */

static void assert_told(struct world *world, enum db_event event, unsigned address)
{
	assert_int_equal(world->told_count, 1);
	assert_string_equal(db_event_name(world->told[0].event), db_event_name(event));
	assert_int_equal(world->told[0].address, address);
	world->told_count = 0;
}

static void a_drive_that_does_not_confirm_its_end_is_told(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[1].dead = true;
	world->told_count = 0;
	db_engine_shut_down(world->bus->engine, world->bus->now);
	for (unsigned i = 0; i < 1500; i++)
		fake_pass(world->bus, 1 * MS);
	world->told_count = 0;
	db_engine_tell_unconfirmed(world->bus->engine);
	assert_told(world, DB_EVENT_DRIVE_UNCONFIRMED, 2);
}

static void pass_seconds(struct world *world, unsigned seconds)
{
	for (unsigned i = 0; i < 4 * seconds; i++) {
		fake_pass(world->bus, 250 * MS);
		world->log[0] = '\0';
	}
}

static void what_is_found_is_told_once(void **state)
{
	struct world *world = *state;

	world->sim[1].status.status = VSMD_ST_PWR; /* somebody else has set it going */
	world->sim[1].status.velocity = 1200;
	world->sim[1].status.position = 77;
	start_bus(world);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(world->told_count, DRIVES);
	for (size_t i = 0; i < DRIVES; i++) {
		assert_int_equal(world->told[i].event, DB_EVENT_DRIVE_ONLINE);
		if (world->told[i].address != 2)
			continue;
		assert_true(world->told[i].feedback.status & DB_STATUS_MOVING);
		assert_true(world->told[i].feedback.status & DB_STATUS_ENABLED);
		assert_int_equal(world->told[i].feedback.position, 77);
		assert_int_equal(world->told[i].feedback.state, DB_AXIS_CONTINUOUS_MOTION);
	}
}

static void drives_that_go_and_come_are_told(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->told_count = 0;
	world->sim[0].dead = true;
	pass_seconds(world, 20);
	assert_told(world, DB_EVENT_DRIVE_LOST, 1);
	world->sim[0].dead = false;
	pass_seconds(world, 3);
	assert_told(world, DB_EVENT_DRIVE_ONLINE, 1);
}

static void a_clock_that_is_set_makes_no_sample_younger(void **state)
{
	struct world *world = *state;
	struct db_feedback before;
	struct db_feedback after;

	db_engine_set_wall_offset(world->bus->engine, 1000000);
	start_bus(world);
	before = fake_feedback(world->bus, 0);
	assert_int_equal(before.taken_wall_us, before.taken / 1000 + 1000000);
	world->sim[0].dead = true;
	db_engine_set_wall_offset(world->bus->engine, 5000000);
	pass_seconds(world, 3);
	after = fake_feedback(world->bus, 0);
	assert_int_equal(after.taken, before.taken);
	assert_int_equal(after.taken_wall_us, before.taken_wall_us);
	world->sim[0].dead = false;
	pass_seconds(world, 3);
	after = fake_feedback(world->bus, 0);
	assert_int_equal(after.taken_wall_us, after.taken / 1000 + 5000000);
}

static void a_drive_that_was_never_there_is_told_once(void **state)
{
	struct world *world = *state;

	world->sim[2].dead = true;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(world->told_count, 2);
	world->told_count = 0;
	pass_seconds(world, 60);
	assert_told(world, DB_EVENT_DRIVE_LOST, 3);
}

/* Of a lost port there is one line, the bus's; what is found behind it afterwards is told. */
static void a_lost_port_is_not_told_of_each_drive(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->told_count = 0;
	fake_port(world->bus, 5);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->told_count, 0);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->told_count, DRIVES);
}

static void faults_are_told_when_they_come_and_go(void **state)
{
	struct world *world = *state;

	start_bus(world);
	world->told_count = 0;
	world->sim[1].status.status |= VSMD_ST_OVER_CURRENT;
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->told[0].feedback.error, DB_ERROR_OVER_CURRENT);
	assert_told(world, DB_EVENT_DRIVE_FAULT, 2);
	world->sim[1].status.status &= ~(uint32_t)VSMD_ST_OVER_CURRENT;
	fake_pass(world->bus, 1000 * MS);
	assert_told(world, DB_EVENT_DRIVE_FAULT_GONE, 2);
}

static void a_drive_that_lost_power_is_told(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->told_count = 0;
	world->sim[0].status.status = VSMD_ST_STP; /* no power and no handshake any more */
	fake_pass(world->bus, 1000 * MS);
	assert_told(world, DB_EVENT_DRIVE_RESTARTED, 1);
	/* That a disabled drive loses its origin as well is what was asked for. */
	fake_post(world->bus, 1, DB_CMD_DISABLE);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(world->told_count, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(
			a_drive_that_is_offline_at_the_end_is_stopped_when_it_answers, open_world,
			close_world),
		cmocka_unit_test_setup_teardown(a_homing_run_that_began_unheard_is_ended_by_a_stop,
		                                open_world, close_world),
		cmocka_unit_test_setup_teardown(a_shake_whose_answer_is_lost_is_not_begun_again,
		                                open_world, close_world),
		cmocka_unit_test_setup_teardown(
			silent_drives_do_not_keep_a_stop_from_one_that_answers, open_world,
			close_world),
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)
		TEST(drives_come_online_and_tell_their_parameters),
		TEST(every_drive_is_polled_once_a_cycle),
		TEST(a_cycle_that_does_not_fit_overruns_and_stays_fair),
		TEST(a_dead_drive_costs_little),
		TEST(a_command_is_sent_once_and_confirmed),
		TEST(a_refused_command_says_so),
		TEST(a_relative_move_whose_answer_is_lost_moves_once),
		TEST(a_relative_move_whose_request_is_lost_is_sent_again),
		TEST(a_lost_set_position_is_read_back),
		TEST(a_lost_save_is_indeterminate_and_not_repeated),
		TEST(a_late_answer_is_not_taken_for_the_next_ones),
		TEST(drives_get_time_to_turn_around),
		TEST(a_drive_that_is_deaf_for_longer_is_told_of),
		TEST(a_drive_that_answers_late_is_told_of),
		TEST(who_is_just_away_is_neither_late_nor_deaf),
		TEST(a_stop_overtakes_and_cancels),
		TEST(a_stop_is_repeated_until_confirmed),
		TEST(commands_to_a_drive_that_is_gone_end),
		TEST(a_lost_port_ends_everything_and_comes_back),
		TEST(a_drive_that_lost_power_is_read_again),
		TEST(no_drive_tells_its_parameters_while_another_moves),
		TEST(a_drive_that_moves_for_ever_does_not_hide_the_parameters_of_others),
		TEST(the_end_stops_every_drive),
		TEST(a_stop_at_the_end_that_is_refused_is_said_again),
		TEST(a_drive_that_does_not_confirm_its_end_is_told),
		TEST(what_is_found_is_told_once),
		TEST(drives_that_go_and_come_are_told),
		TEST(a_clock_that_is_set_makes_no_sample_younger),
		TEST(a_drive_that_was_never_there_is_told_once),
		TEST(a_lost_port_is_not_told_of_each_drive),
		TEST(faults_are_told_when_they_come_and_go),
		TEST(a_drive_that_lost_power_is_told),
#undef TEST
	};

	return cmocka_run_group_tests_name("engine", tests, NULL, NULL);
}
