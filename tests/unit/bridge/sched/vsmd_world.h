/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A serial bus of three made-up drives that speak the real protocol, in made-up time: requests and answers are lost,
 * late or refused as the test says. Header only.
 */
#ifndef DRIVEBRIDGE_TESTS_VSMD_WORLD_H
#define DRIVEBRIDGE_TESTS_VSMD_WORLD_H

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
	bool has_twin; /* another drive tells its status behind it at the same address, from elsewhere */
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
	db_time timing;
	db_time learnt; /* told last */
	struct {
		enum db_event event;
		unsigned address;
		struct db_feedback feedback;
	} told[32];
	size_t told_count;
};

static inline void execute(struct drive *drive, const struct vsmd_command *command)
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

static inline size_t reply(const struct drive *drive, uint8_t id,
                           const struct vsmd_command *command, uint8_t *frame)
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

static inline db_time on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	struct vsmd_setting settings[VSMD_PARAM_COUNT];
	uint8_t answer[VSMD_SERIAL_FRAME_MAX];
	struct vsmd_command command;
	struct drive *drive;
	enum fault fault = FAULT_NONE;
	db_time now = world->bus->now;
	size_t answered;
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
	answered = reply(drive, (uint8_t)command.id, &command, answer);
	if (drive->has_twin && command.verb == VSMD_STS) {
		struct drive twin = *drive;

		twin.status.position += 1000;
		answered += reply(&twin, (uint8_t)command.id, &command, answer + answered);
	}
	fake_answer_after(world->bus, latency, answer, answered);
	world->quiet_since = now + latency;
	drive->deaf_until = now + latency + drive->deaf;
	return now;
}

static inline void on_tell(void *context, const struct db_drive_config *drive, enum db_event event,
                           const struct db_feedback *feedback, const struct db_outage *outage)
{
	struct world *world = context;

	(void)outage;
	assert_true(world->told_count < sizeof world->told / sizeof world->told[0]);
	world->told[world->told_count].event = event;
	world->told[world->told_count].address = drive->address;
	world->told[world->told_count++].feedback = *feedback;
}

static inline void on_tell_timing(void *context, const struct db_drive_config *drive,
                                  const struct db_engine_timing *timing)
{
	struct world *world = context;

	(void)drive;
	world->told_timing[timing->event]++;
	world->timing = timing->time;
	world->learnt = timing->learnt;
}

static const struct db_engine_ops ops = {
	.send = on_send,
	.on_event = on_tell,
	.on_timing = on_tell_timing,
};

static inline int open_with_turnaround(void **state, unsigned turnaround_us)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->bus = fake_bus_new(db_driver_find("vsmd-serial"), DRIVES);
	world->bus->context = world;
	world->bus->config.transport = &db_transport_serial;
	world->bus->config.baud = 115200;
	world->bus->config.stop_bits = 1;
	world->bus->config.turnaround_us = turnaround_us;
	for (size_t i = 0; i < DRIVES; i++)
		world->sim[i].status.status = VSMD_ST_STP;
	fake_bus_open(world->bus, DRIVES, &ops);
	*state = world;
	return 0;
}

static inline int open_world(void **state)
{
	return open_with_turnaround(state, 0);
}

static inline int open_turning_world(void **state)
{
	return open_with_turnaround(state, 1000);
}

static inline int close_world(void **state)
{
	struct world *world = *state;

	fake_bus_free(world->bus);
	free(world);
	return 0;
}

static inline void start_bus(struct world *world)
{
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	world->log[0] = '\0';
}

static inline uint32_t status_of(const struct world *world, size_t drive)
{
	return fake_feedback(world->bus, drive).status;
}

static inline void post_motion(struct world *world, uint16_t drive, enum db_command command,
                               int32_t position)
{
	fake_request(world->bus, drive,
	             (struct db_request){
			     .command = command,
			     .args = &(struct db_args){ .target_position = position,
	                                                .target_velocity = 100.0f },
		     });
}

static inline size_t count_sent(const struct world *world, const char *text)
{
	size_t found = 0;

	for (const char *at = world->log; (at = strstr(at, text)) != NULL; at++)
		found++;
	return found;
}

static inline void enable_first(struct world *world)
{
	start_bus(world);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 30 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	world->log[0] = '\0';
}

static inline void fail_next(struct world *world, size_t drive, enum vsmd_verb verb,
                             enum fault fault)
{
	world->sim[drive].fault = fault;
	world->sim[drive].fault_verb = verb;
}

static inline void pass_seconds(struct world *world, unsigned seconds)
{
	for (unsigned i = 0; i < 4 * seconds; i++) {
		fake_pass(world->bus, 250 * MS);
		world->log[0] = '\0';
	}
}

/* A test of a bus of its own. */
#define TEST_OF_LINE(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)

#endif
