/* SPDX-License-Identifier: Apache-2.0 */
/* Commands to many drives in one write. */
#include "fakes/registers.h"
#include "regmap/clients.h"
#include "regmap/group.h"
#include "regmap/regmap_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

#define ILLEGAL_FUNCTION 0x01
#define ILLEGAL_VALUE 0x03
#define FAILURE 0x04
#define LATER 0x05
#define BUSY 0x06
#define NO_PATH 0x0A

#define ONLINE (DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID)

#define GATEWAY 255

static const struct db_client other = { .id = 2, .address = { 9 }, .port = 5, .may_write = true };

static void make(struct fake_registers *fake, const struct db_modbus_config *modbus)
{
	fake_registers_init(fake, 2, 3);
	fake->config.modbus = *modbus;
	for (size_t i = 0; i < 3; i++) {
		struct db_snapshot snapshot = { .feedback = { .taken = fake->now,
			                                      .state = DB_AXIS_STANDSTILL,
			                                      .status = ONLINE } };

		db_axis_publish(fake->axes[i], &snapshot);
	}
	fake_registers_open(fake);
}

#define FAKE()                      \
	struct fake_registers fake; \
	(void)state;                \
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40 })

static void stage(struct fake_registers *fake, uint8_t unit)
{
	assert_int_equal(fake_put(fake, unit, 102, 2, 0, 100 * unit), 0);
	assert_int_equal(fake_put(fake, unit, 124, 1, DB_CMD_MOVE_ABSOLUTE), 0);
}

static int start(struct fake_registers *fake)
{
	return fake_put(fake, GATEWAY, 61, 1, 1);
}

static void what_is_staged_starts_together(void **state)
{
	FAKE();
	assert_int_equal(start(&fake), ILLEGAL_VALUE);
	stage(&fake, 1);
	stage(&fake, 3);
	assert_int_equal(fake_get1(&fake, GATEWAY, 62), 2);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(start(&fake), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[0].drive, 0);
	assert_int_equal(fake.requests[0].command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake.args[0].target_position, 100);
	assert_int_equal(fake.requests[1].drive, 2);
	assert_int_equal(fake.args[1].target_position, 300);
	assert_int_equal(fake_get1(&fake, GATEWAY, 62), 0);
	assert_int_equal(fake_get1(&fake, GATEWAY, 63), 2);
	assert_int_equal(fake_get1(&fake, GATEWAY, 65), 1);
	/* Its writer is answered when all have ended, with the worst of it. */
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 0);
	assert_int_equal(fake_get1(&fake, GATEWAY, 64), FAILURE);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, FAILURE);
	assert_int_equal(fake.answered_to.client, FAKE_TOKEN.client);
	assert_int_equal(fake_get1(&fake, GATEWAY, 65), 0);
	assert_int_equal(fake_get1(&fake, GATEWAY, 64), FAILURE);
	/* Nothing is staged any more. */
	assert_int_equal(start(&fake), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, GATEWAY, 61, 1, 2), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, GATEWAY, 61, 1, 0), 0);
	assert_int_equal(fake.submitted, 2);
	fake_registers_close(&fake);
}

/* All or none: a part that is refused would leave the others to move without it. */
static void one_that_may_not_start_keeps_all_from_it(void **state)
{
	const struct db_role_config role = { .write.names = "feeder\0", .control = true };
	struct db_client client = other;
	struct fake_registers fake;
	const uint16_t one = 1;

	(void)state;
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40,
	                                        .control = DB_CONTROL_DRIVE,
	                                        .control_timeout_ms = 5000 });
	fake.drives[1].name = (char *)"press";
	stage(&fake, 1);
	stage(&fake, 2);
	/* Another client has control of them. */
	assert_int_equal(db_registers_backend.write(fake.registers, &client, GATEWAY,
	                                            DB_TABLE_HOLDING, 61, 1, &one, FAKE_TOKEN),
	                 BUSY);
	assert_int_equal(fake.refused[client.id], 1);
	assert_int_equal(fake_put(&fake, 1, 56, 1, 0), 0);
	assert_int_equal(fake_put(&fake, 2, 56, 1, 0), 0);
	/* The role of its certificate is not for the second one. */
	client.role = &role;
	assert_int_equal(db_registers_backend.write(fake.registers, &client, GATEWAY,
	                                            DB_TABLE_HOLDING, 61, 1, &one, FAKE_TOKEN),
	                 ILLEGAL_FUNCTION);
	assert_int_equal(fake.refused_by_role, 1);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake_get1(&fake, GATEWAY, 62), 2);
	client.role = NULL;
	assert_int_equal(fake_put(&fake, 1, 56, 1, 0), 0);
	(void)db_registers_backend.client(fake.registers, &other, false);
	assert_int_equal(db_registers_backend.write(fake.registers, &client, GATEWAY,
	                                            DB_TABLE_HOLDING, 61, 1, &one, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	fake_registers_close(&fake);
}

/* One frame for all drives of a bus, where all of them are to start. */
static void a_bus_whose_drives_all_start_begins_with_one_frame(void **state)
{
	FAKE();
	fake.buses[1].starts_by_broadcast = true;
	for (uint8_t unit = 1; unit <= 2; unit++)
		stage(&fake, unit);
	assert_int_equal(start(&fake), DB_WRITE_LATER);
	/* The first bus cannot, and the second one has a drive that stays. */
	assert_int_equal(fake.requests[0].group, 0);
	assert_int_equal(fake.requests[1].group, 0);
	fake_complete(&fake, 0, DB_RESULT_OK);
	fake_complete(&fake, 1, DB_RESULT_OK);
	for (uint8_t unit = 1; unit <= 3; unit++)
		stage(&fake, unit);
	assert_int_equal(start(&fake), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 5);
	assert_int_equal(fake.requests[2].group, 0);
	assert_int_not_equal(fake.requests[3].group, 0);
	assert_int_equal(fake.requests[3].group, fake.requests[4].group);
	fake_registers_close(&fake);
}

/* --- several endpoints ------------------------------------------------------------------------ */

/* Drive 0 is unit 1 of the first endpoint, drives 1 and 2 are units 1 and 2 of hall2; the last two are
 * on one bus. */
static void make_two(struct fake_registers *fake)
{
	static struct db_endpoint_config hall = { .name = (char *)"hall2" };

	hall.number = db_endpoint_number(hall.name);
	make(fake, &(struct db_modbus_config){
			   .confirm_ms = 40, .endpoints = &hall, .endpoint_count = 1 });
	for (size_t i = 1; i < 3; i++) {
		fake->drives[i].endpoint = hall.number;
		fake->drives[i].unit = (unsigned)i;
	}
	fake_registers_open(fake);
}

static struct db_client client_of_hall(void)
{
	return (struct db_client){ .id = 2,
		                   .address = { 9 },
		                   .port = 5,
		                   .may_write = true,
		                   .endpoint = db_endpoint_number("hall2") };
}

static int put_at_hall(struct fake_registers *fake, uint8_t unit, uint16_t address, uint16_t value)
{
	const struct db_client client = client_of_hall();

	return db_registers_backend.write(fake->registers, &client, unit, DB_TABLE_HOLDING, address,
	                                  1, &value,
	                                  (struct db_write_token){ 2, FAKE_TOKEN.sequence });
}

static uint16_t get_at_hall(struct fake_registers *fake, uint16_t address)
{
	const struct db_client client = client_of_hall();
	uint16_t value = 0;

	assert_int_equal(db_registers_backend.read(fake->registers, &client, GATEWAY,
	                                           DB_TABLE_HOLDING, address, 1, &value),
	                 0);
	return value;
}

static void groups_of_two_endpoints_at_once(void **state)
{
	struct fake_registers fake;

	(void)state;
	make_two(&fake);
	stage(&fake, 1);
	assert_int_equal(put_at_hall(&fake, 1, 124, DB_CMD_HOME), 0);
	/* What is staged starts for its own endpoint. */
	assert_int_equal(start(&fake), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.requests[0].drive, 0);
	assert_int_equal(put_at_hall(&fake, GATEWAY, 61, 1), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].drive, 1);
	/* Neither writer is answered by the other's command. */
	assert_int_equal(fake.answered, 0);
	fake_complete(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_to.client, 2);
	assert_int_equal(fake.answered_with, FAILURE);
	assert_int_equal(fake_get1(&fake, GATEWAY, 65), 1);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 2);
	assert_int_equal(fake.answered_to.client, FAKE_TOKEN.client);
	assert_int_equal(fake.answered_with, 0);
	assert_int_equal(fake_get1(&fake, GATEWAY, 64), 0);
	assert_int_equal(get_at_hall(&fake, 64), FAILURE);
	fake_registers_close(&fake);
}

/* All drives of hall2 are staged, but the frame would reach a drive of the first endpoint as well. */
static void one_frame_is_not_for_the_drives_of_another_endpoint(void **state)
{
	struct fake_registers fake;

	(void)state;
	make_two(&fake);
	fake.buses[1].starts_by_broadcast = true;
	assert_int_equal(put_at_hall(&fake, 1, 124, DB_CMD_HOME), 0);
	assert_int_equal(put_at_hall(&fake, 2, 124, DB_CMD_HOME), 0);
	assert_int_equal(put_at_hall(&fake, GATEWAY, 61, 1), DB_WRITE_LATER);
	assert_int_not_equal(fake.requests[0].group, 0);
	assert_int_equal(fake.requests[0].group, fake.requests[1].group);
	fake_complete(&fake, 0, DB_RESULT_OK);
	fake_complete(&fake, 1, DB_RESULT_OK);
	/* Now the second of them is the first endpoint's, where it is staged, too. */
	fake.drives[2].endpoint = DB_ENDPOINT_FIRST;
	fake_registers_open(&fake);
	stage(&fake, 2);
	fake.submitted = 0;
	assert_int_equal(put_at_hall(&fake, 1, 124, DB_CMD_HOME), 0);
	assert_int_equal(put_at_hall(&fake, GATEWAY, 61, 1), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.requests[0].group, 0);
	fake_registers_close(&fake);
}

static void a_stop_of_all_is_for_all_endpoints(void **state)
{
	struct fake_registers fake;

	(void)state;
	make_two(&fake);
	assert_int_equal(put_at_hall(&fake, GATEWAY, 60, 1), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(get_at_hall(&fake, 63), 3);
	assert_int_equal(fake_get1(&fake, GATEWAY, 63), 0);
	/* Each has a list of units of its own. */
	assert_int_equal(fake_put(&fake, GATEWAY, 70, 1, 1), 0);
	assert_int_equal(put_at_hall(&fake, GATEWAY, 70, 2), 0);
	assert_int_equal(put_at_hall(&fake, GATEWAY, 86, 1), DB_WRITE_LATER);
	assert_int_equal(get_at_hall(&fake, 63), 1);
	assert_int_equal(fake_get1(&fake, GATEWAY, 70), 1);
	assert_int_equal(get_at_hall(&fake, 70), 2);
	fake_registers_close(&fake);
}

/* One part is refused at once, and the others are awaited all the same. */
static void a_part_that_cannot_start_is_the_worst(void **state)
{
	FAKE();
	stage(&fake, 1);
	stage(&fake, 2);
	db_axis_publish(fake.axes[1], &(struct db_snapshot){ .feedback.status = DB_STATUS_BUS_UP });
	assert_int_equal(start(&fake), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake_get1(&fake, GATEWAY, 64), 0x0B);
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, 0x0B);
	/* Where none is on its way, at once. */
	stage(&fake, 2);
	assert_int_equal(start(&fake), 0x0B);
	assert_int_equal(fake.answered, 1);
	fake_registers_close(&fake);
}

/* Written to group_stop. */
static void every_kind_of_stop_reaches_every_drive(void **state)
{
	static const enum db_command stops[] = { DB_CMD_STOP, DB_CMD_QUICK_STOP, DB_CMD_DISABLE };

	FAKE();
	for (unsigned kind = 1; kind <= 3; kind++) {
		fake.submitted = 0;
		fake.answered = 0;
		assert_int_equal(fake_put(&fake, GATEWAY, 60, 1, (int)kind), DB_WRITE_LATER);
		assert_int_equal(fake.submitted, 3);
		for (unsigned i = 0; i < 3; i++) {
			assert_int_equal(fake.requests[i].command, stops[kind - 1]);
			assert_int_equal(fake.requests[i].drive, i);
			assert_int_equal(fake.answered, 0);
			fake_complete(&fake, i, DB_RESULT_OK);
		}
		assert_int_equal(fake.answered, 1);
		assert_int_equal(fake.answered_with, 0);
	}
	assert_int_equal(fake_put(&fake, GATEWAY, 60, 1, 4), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, GATEWAY, 60, 1, 0), 0);
	assert_int_equal(fake.submitted, 3);
	/* The order of two of them would be a guess. */
	assert_int_equal(fake_put(&fake, GATEWAY, 60, 2, 1, 1), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 3);
	fake_registers_close(&fake);
}

/* Nobody watches the older one any more, whose drives go on with it. */
static void a_newer_group_command_answers_the_older_ones_writer(void **state)
{
	FAKE();
	stage(&fake, 1);
	assert_int_equal(start(&fake), DB_WRITE_LATER);
	assert_int_equal(fake_put(&fake, GATEWAY, 60, 1, 1), DB_WRITE_LATER);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, LATER);
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake_get1(&fake, GATEWAY, 64), 0);
	for (unsigned i = 1; i < 4; i++)
		fake_complete(&fake, i, DB_RESULT_OK);
	assert_int_equal(fake.answered, 2);
	assert_int_equal(fake.answered_with, 0);
	/* And an answer after all of it changes nothing. */
	assert_true(db_group_take_answer(fake.registers,
	                                 (struct db_write_token){ .client = DB_CLIENT_GROUP },
	                                 DB_RESULT_FAILED));
	assert_false(db_group_take_answer(fake.registers, FAKE_TOKEN, DB_RESULT_FAILED));
	assert_int_equal(fake_get1(&fake, GATEWAY, 64), 0);
	assert_int_equal(fake.answered, 2);
	fake_registers_close(&fake);
}

static void a_session_is_answered_as_a_session(void **state)
{
	const struct db_write_token session = { .client = DB_CLIENT_FIRST_SESSION };
	const uint16_t stop = 1;

	FAKE();
	assert_int_equal(db_registers_backend.write(fake.registers, &other, GATEWAY,
	                                            DB_TABLE_HOLDING, 60, 1, &stop, session),
	                 DB_WRITE_LATER);
	for (unsigned i = 0; i < 3; i++)
		fake_complete(&fake, i, i == 1 ? DB_RESULT_BUS_DOWN : DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_to.client, DB_CLIENT_FIRST_SESSION);
	assert_int_equal(fake.session_answered_with, DB_RESULT_BUS_DOWN);
	fake_registers_close(&fake);
}

/* group_units1 to 16, and group_stop_units behind them. */
static void listed_units_are_stopped(void **state)
{
	uint16_t list[17] = { 0 };

	FAKE();
	fake.drives[2].unit = 247;
	fake_registers_open(&fake);
	/* Units 1 and 247. */
	list[0] = 1u << 0;
	list[15] = 1u << (247 - 1) % 16;
	assert_int_equal(fake_put_values(&fake, GATEWAY, DB_TABLE_HOLDING, 70, 16, list), 0);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake_get1(&fake, GATEWAY, 70), 1);
	assert_int_equal(fake_get1(&fake, GATEWAY, 85), list[15]);
	assert_int_equal(fake_put(&fake, GATEWAY, 86, 1, 2), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[0].drive, 0);
	assert_int_equal(fake.requests[0].command, DB_CMD_QUICK_STOP);
	assert_int_equal(fake.requests[1].drive, 2);
	fake_complete(&fake, 0, DB_RESULT_OK);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 86, 1, 4), ILLEGAL_VALUE);
	/* Some words of it, and the last ones with the stop. */
	assert_int_equal(fake_put(&fake, GATEWAY, 70, 2, 0, 0), 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 85, 2, 0, 1), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 2);
	/* Together with what is no list. */
	assert_int_equal(fake_put(&fake, GATEWAY, 68, 3, 0, 0, 0), 0x02);
	fake_registers_close(&fake);
}

/* A stop is not refused for it, but whoever wrote it must know. */
static void a_listed_unit_without_a_drive_is_said(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, GATEWAY, 70, 1, 1 << 1 | 1 << 8), 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 86, 1, 1), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake_last_request(&fake)->drive, 1);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, NO_PATH);
	/* Where no drive has one of them, at once. */
	assert_int_equal(fake_put(&fake, GATEWAY, 70, 1, 1 << 8), 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 86, 1, 1), NO_PATH);
	assert_int_equal(fake.submitted, 1);
	/* What is worse stays. */
	assert_int_equal(fake_put(&fake, GATEWAY, 70, 1, 1 << 1 | 1 << 8), 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 86, 1, 1), DB_WRITE_LATER);
	fake_complete(&fake, 1, DB_RESULT_TIMEOUT);
	assert_int_equal(fake.answered_with, 0x0B);
	fake_registers_close(&fake);
}

/* A drive has a second unit with its vendor's layout: either of them names it, once. */
static void either_unit_of_a_drive_names_it(void **state)
{
	FAKE();
	fake.drives[1].vendor_unit = 9;
	fake_registers_open(&fake);
	assert_int_equal(fake_put(&fake, GATEWAY, 70, 1, 1 << 8), 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 86, 1, 1), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake_last_request(&fake)->drive, 1);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 70, 1, 1 << 8 | 1 << 1), 0);
	assert_int_equal(fake_put(&fake, GATEWAY, 86, 1, 1), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);
	fake_registers_close(&fake);
}

/* Ends request `number`, which was sent then; 0: not at all. */
static void end_sent(struct fake_registers *fake, unsigned number, db_time sent)
{
	struct db_request late = fake->requests[number];
	struct db_request *kept = fake_place_find(fake->places, FAKE_PLACES, late.ticket);

	kept->sent = sent;
	db_registers_complete(fake->registers, fake_place_end(kept, DB_RESULT_OK, fake->now),
	                      fake->now);
}

static void the_skew_is_from_the_first_to_the_last_command_sent(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, GATEWAY, 60, 1, 1), DB_WRITE_LATER);
	end_sent(&fake, 1, fake.now + 500 * DB_NS_PER_US);
	assert_int_equal(fake_get2(&fake, GATEWAY, 66), 0);
	end_sent(&fake, 0, fake.now + 200 * DB_NS_PER_US);
	assert_int_equal(fake_get2(&fake, GATEWAY, 66), 300);
	end_sent(&fake, 2, fake.now + 900 * DB_NS_PER_US);
	assert_int_equal(fake_get2(&fake, GATEWAY, 66), 700);
	/* What is sent later belongs to no group, and one that was not sent has no time. */
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_STOP), DB_WRITE_LATER);
	end_sent(&fake, 3, fake.now + 5000 * DB_NS_PER_US);
	assert_int_equal(fake_get2(&fake, GATEWAY, 66), 700);
	assert_int_equal(fake_put(&fake, GATEWAY, 60, 1, 1), DB_WRITE_LATER);
	assert_int_equal(fake_get2(&fake, GATEWAY, 66), 0);
	end_sent(&fake, 4, 0);
	end_sent(&fake, 5, fake.now);
	assert_int_equal(fake_get2(&fake, GATEWAY, 66), 0);
	/* Nor does what has no ticket. */
	fake.registers->roster->drives[1]->group_ticket = 0;
	db_group_note_sent(fake.registers->roster->drives[1], 0, fake.now + 800 * DB_NS_PER_US);
	assert_int_equal(fake_get2(&fake, GATEWAY, 66), 0);
	fake_registers_close(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_is_staged_starts_together),
		cmocka_unit_test(one_that_may_not_start_keeps_all_from_it),
		cmocka_unit_test(a_bus_whose_drives_all_start_begins_with_one_frame),
		cmocka_unit_test(a_part_that_cannot_start_is_the_worst),
		cmocka_unit_test(every_kind_of_stop_reaches_every_drive),
		cmocka_unit_test(a_newer_group_command_answers_the_older_ones_writer),
		cmocka_unit_test(a_session_is_answered_as_a_session),
		cmocka_unit_test(listed_units_are_stopped),
		cmocka_unit_test(a_listed_unit_without_a_drive_is_said),
		cmocka_unit_test(either_unit_of_a_drive_names_it),
		cmocka_unit_test(groups_of_two_endpoints_at_once),
		cmocka_unit_test(one_frame_is_not_for_the_drives_of_another_endpoint),
		cmocka_unit_test(a_stop_of_all_is_for_all_endpoints),
		cmocka_unit_test(the_skew_is_from_the_first_to_the_last_command_sent),
	};

	return cmocka_run_group_tests_name("regmap/group", tests, NULL, NULL);
}
