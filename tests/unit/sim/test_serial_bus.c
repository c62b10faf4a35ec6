/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/serial_bus.h"

#include "codec/vsmd_serial_frames.h"
#include "sim/vsmd_drive.h"
#include "sim/vsmd_mechanics.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define BAUD 9600
#define LATENCY (2 * DB_NS_PER_MS)
#define SECOND DB_NS_PER_S
#define NEVER DB_TIME_NEVER

/* Two drives on a bus, and what a host received. */
struct bench {
	struct sim_serial_bus *bus;
	struct sim_node nodes[2];
	db_time now;
	db_time last_byte;
	uint8_t bytes[4096];
	size_t length;
	unsigned chunks;
};

static int setup(void **state)
{
	static struct bench bench;
	struct sim_serial_config config = {
		.baud = BAUD, .rs485 = true, .paced = true, .latency = LATENCY
	};

	bench = (struct bench){ .now = 50 * SECOND };
	bench.bus = sim_serial_bus_new(&sim_vsmd_serial_protocol, &config, NULL, NULL);
	assert_non_null(bench.bus);
	for (unsigned i = 0; i < 2; i++) {
		struct sim_vsmd_config drive;

		sim_vsmd_config_init(&drive, i + 1, BAUD);
		bench.nodes[i].name = "drive";
		bench.nodes[i].drive = sim_vsmd_new(&drive, bench.now);
		assert_non_null(bench.nodes[i].drive);
		assert_true(sim_serial_bus_attach(bench.bus, &bench.nodes[i]));
	}
	*state = &bench;
	return 0;
}

static int teardown(void **state)
{
	struct bench *bench = *state;

	free(bench->bus);
	free(bench->nodes[0].drive);
	free(bench->nodes[1].drive);
	return 0;
}

static db_time wire(size_t bytes)
{
	return (db_time)bytes * 10 * SECOND / BAUD;
}

/* Sends and lets time pass until all is quiet, waking only when the bus asks for it. */
static void talk(struct bench *bench, const char *request)
{
	bench->length = 0;
	bench->chunks = 0;
	sim_serial_bus_receive(bench->bus, (const uint8_t *)request, strlen(request), bench->now);
	while (sim_serial_bus_next(bench->bus) != NEVER) {
		size_t count;

		bench->now = sim_serial_bus_next(bench->bus);
		count = sim_serial_bus_run(bench->bus, bench->now, bench->bytes + bench->length,
		                           sizeof(bench->bytes) - bench->length);
		if (count > 0) {
			bench->last_byte = bench->now;
			bench->chunks++;
		}
		bench->length += count;
	}
}

static enum vsmd_error decode(const struct bench *bench, struct vsmd_reply *reply)
{
	return vsmd_serial_decode_reply(bench->bytes, bench->length, reply);
}

static void status_reply_takes_its_time(void **state)
{
	struct bench *b = *state;
	db_time start = b->now;
	struct vsmd_reply reply;

	talk(b, "1 sts\n");
	assert_int_equal(b->length, VSMD_SERIAL_STATUS_FRAME);
	assert_int_equal(decode(b, &reply), VSMD_OK);
	assert_int_equal(reply.id, 1);
	assert_in_range(b->last_byte - start, wire(6) + LATENCY + wire(21),
	                wire(6) + LATENCY + wire(21) + 10);
	assert_in_range(b->chunks, 2, 8);
}

static void a_slow_host_is_not_charged_twice(void **state)
{
	struct bench *b = *state;
	db_time start = b->now;

	sim_serial_bus_receive(b->bus, (const uint8_t *)"1 st", 4, b->now);
	b->now += SECOND;
	talk(b, "s\n");
	assert_in_range(b->last_byte - start, SECOND + LATENCY + wire(21),
	                SECOND + LATENCY + wire(21) + 10);
}

static void broadcast_and_strangers_get_no_reply(void **state)
{
	struct bench *b = *state;

	talk(b, "0 ena\n");
	assert_int_equal(b->length, 0);
	assert_int_equal(b->nodes[0].drive->counts[VSMD_ENA], 1);
	assert_int_equal(b->nodes[1].drive->counts[VSMD_ENA], 1);
	talk(b, "3 sts\n");
	talk(b, "sts\n");
	talk(b, "\n");
	assert_int_equal(b->length, 0);
	assert_int_equal(b->bus->stats.foreign, 3);
}

static void nonsense_is_answered_with_cmd_wrg(void **state)
{
	struct bench *b = *state;
	struct vsmd_reply reply;

	talk(b, "2 dance\n");
	assert_int_equal(decode(b, &reply), VSMD_OK);
	assert_int_equal(reply.id, 2);
	assert_true(reply.status.status & VSMD_ST_CMD_WRG);
	talk(b, "2 sts\n");
	assert_int_equal(decode(b, &reply), VSMD_OK);
	assert_false(reply.status.status & VSMD_ST_CMD_WRG);
}

static void texts(void **state)
{
	struct bench *b = *state;
	struct vsmd_reply reply;

	talk(b, "1 dev\n");
	assert_int_equal(decode(b, &reply), VSMD_OK);
	assert_int_equal(reply.code, VSMD_REPLY_IDENTITY);
	assert_int_equal(reply.text_length, strlen("VSMD113_025T-1.0.008.170428"));
	talk(b, "1 cfg\n");
	assert_int_equal(decode(b, &reply), VSMD_OK);
	assert_int_equal(reply.code, VSMD_REPLY_PARAMS);
	assert_in_range(b->chunks, 2, 8);
}

static void an_overlong_line_is_not_heard(void **state)
{
	struct bench *b = *state;
	char line[VSMD_SERIAL_LINE_MAX + 100];

	memset(line, 'x', sizeof(line));
	line[sizeof(line) - 2] = '\n';
	line[sizeof(line) - 1] = '\0';
	talk(b, line);
	assert_int_equal(b->length, 0);
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 21);
}

static void set_fault(struct bench *bench, const char *text)
{
	assert_null(sim_faults_set(&bench->nodes[0].faults, text));
}

static void lost_requests_and_replies(void **state)
{
	struct bench *b = *state;
	uint32_t before;

	talk(b, "1 ena\n");
	set_fault(b, "drop 2");
	before = b->nodes[0].drive->counts[VSMD_RMV];
	talk(b, "1 rmv 10\n");
	assert_int_equal(b->length, 0);
	assert_int_equal(b->nodes[0].drive->counts[VSMD_RMV], before + 1);
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 0);
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 21);
	set_fault(b, "lose-request 1");
	talk(b, "1 rmv 10\n");
	assert_int_equal(b->length, 0);
	assert_int_equal(b->nodes[0].drive->counts[VSMD_RMV], before + 1);
	set_fault(b, "silence on");
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 0);
	talk(b, "2 sts\n");
	assert_int_equal(b->length, 21);
	set_fault(b, "silence off");
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 21);
}

static void broken_replies(void **state)
{
	struct bench *b = *state;
	struct vsmd_reply reply;
	db_time start;

	set_fault(b, "corrupt 1");
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 21);
	assert_int_not_equal(decode(b, &reply), VSMD_OK);
	set_fault(b, "truncate 1");
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 10);
	set_fault(b, "garbage 1");
	talk(b, "1 sts\n");
	assert_in_range(b->length, 22, 29);
	assert_int_equal(vsmd_serial_decode_reply(b->bytes + b->length - 21, 21, &reply), VSMD_OK);
	set_fault(b, "wrong-id 1");
	talk(b, "1 sts\n");
	assert_int_equal(decode(b, &reply), VSMD_OK);
	assert_int_equal(reply.id, 2);
	set_fault(b, "delay 500 1");
	start = b->now;
	talk(b, "1 sts\n");
	assert_true(b->last_byte - start >= SECOND / 2 + LATENCY + wire(27));
	talk(b, "1 sts\n");
	assert_int_equal(decode(b, &reply), VSMD_OK);
	assert_int_equal(reply.id, 1);
}

static void replies_damaged_at_a_place(void **state)
{
	struct bench *b = *state;
	struct vsmd_reply reply;
	uint8_t whole[VSMD_SERIAL_STATUS_FRAME];

	talk(b, "1 sts\n");
	memcpy(whole, b->bytes, sizeof(whole));
	for (size_t place = 1; place <= sizeof(whole); place++) {
		char text[32];

		(void)snprintf(text, sizeof(text), "corrupt-at %zu 1", place);
		set_fault(b, text);
		talk(b, "1 sts\n");
		assert_int_equal(b->length, sizeof(whole));
		for (size_t i = 0; i < sizeof(whole); i++)
			assert_int_equal(b->bytes[i] != whole[i], i == place - 1);
	}
	set_fault(b, "split 1");
	talk(b, "1 sts\n");
	assert_in_range(b->length, 22, 29);
	assert_memory_equal(b->bytes, whole, 10);
	assert_memory_equal(b->bytes + b->length - 11, whole + 10, 11);
	set_fault(b, "double 1");
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 42);
	assert_int_equal(vsmd_serial_decode_reply(b->bytes, 21, &reply), VSMD_OK);
	assert_memory_equal(b->bytes, b->bytes + 21, 21);
}

static char testimony[256];

static void remember(void *context, db_time time, const char *request, bool obeyed)
{
	size_t length = strlen(testimony);

	(void)context;
	(void)time;
	(void)snprintf(testimony + length, sizeof(testimony) - length, "%s%s;", request,
	               obeyed ? "" : " (refused)");
}

/* Lost requests are not told, unanswered ones are, and questions are of no interest. */
static void the_witness_hears_what_the_drive_obeys(void **state)
{
	struct bench *b = *state;

	testimony[0] = '\0';
	b->nodes[0].witness.report = remember;
	talk(b, "1 mov spd=10\n");
	talk(b, "1 dev\n");
	talk(b, "1 ena\n");
	set_fault(b, "lose-request 1");
	talk(b, "1 pos 5\n");
	set_fault(b, "drop 1");
	talk(b, "1 pos 6\n");
	talk(b, "2 pos 7\n");
	talk(b, "1 sts\n");
	talk(b, "1 nonsense\n");
	assert_string_equal(testimony,
	                    "1 mov spd=10 (refused);1 ena;1 pos 6;1 nonsense (refused);");
}

static void a_late_reply_does_not_hold_up_others(void **state)
{
	struct bench *b = *state;
	struct vsmd_reply reply;

	set_fault(b, "delay 500 1");
	talk(b, "1 sts\n2 sts\n");
	assert_int_equal(b->length, 42);
	assert_int_equal(vsmd_serial_decode_reply(b->bytes, 21, &reply), VSMD_OK);
	assert_int_equal(reply.id, 2);
	assert_int_equal(vsmd_serial_decode_reply(b->bytes + 21, 21, &reply), VSMD_OK);
	assert_int_equal(reply.id, 1);
}

static void echo_comes_before_the_reply(void **state)
{
	struct bench *b = *state;
	struct vsmd_reply reply;

	assert_null(sim_faults_set(sim_serial_bus_faults(b->bus), "echo on"));
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 27);
	assert_memory_equal(b->bytes, "1 sts\n", 6);
	assert_int_equal(vsmd_serial_decode_reply(b->bytes + 6, 21, &reply), VSMD_OK);
}

static void new_id_and_rate_come_with_power(void **state)
{
	struct bench *b = *state;

	talk(b, "1 cfg cid=9\n");
	talk(b, "1 sav\n");
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 21);
	sim_vsmd_power(b->nodes[0].drive, false, b->now);
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 0);
	sim_vsmd_power(b->nodes[0].drive, true, b->now);
	talk(b, "1 sts\n");
	assert_int_equal(b->length, 0);
	talk(b, "9 sts\n");
	assert_int_equal(b->length, 21);
	b->bus->config.baud = 19200;
	talk(b, "9 sts\n");
	assert_int_equal(b->length, 0);
}

static void fault_texts(void **state)
{
	struct sim_faults faults = { .delay_ms = 0 };

	(void)state;
	assert_non_null(sim_faults_set(&faults, ""));
	assert_non_null(sim_faults_set(&faults, "explode"));
	assert_non_null(sim_faults_set(&faults, "drop x"));
	assert_non_null(sim_faults_set(&faults, "drop 0"));
	assert_non_null(sim_faults_set(&faults, "delay"));
	assert_non_null(sim_faults_set(&faults, "corrupt-at"));
	assert_non_null(sim_faults_set(&faults, "silence"));
	assert_non_null(sim_faults_set(&faults, "drop 1 2 3 4"));
	assert_false(sim_faults_take(&faults, SIM_FAULT_DROP));
	assert_null(sim_faults_set(&faults, "drop 1"));
	assert_true(sim_faults_take(&faults, SIM_FAULT_DROP));
	assert_false(sim_faults_take(&faults, SIM_FAULT_DROP));
	assert_null(sim_faults_set(&faults, "corrupt"));
	assert_true(sim_faults_take(&faults, SIM_FAULT_CORRUPT));
	assert_true(sim_faults_take(&faults, SIM_FAULT_CORRUPT));
	assert_null(sim_faults_set(&faults, "none"));
	assert_false(sim_faults_take(&faults, SIM_FAULT_CORRUPT));
}

#define BUS_TEST(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
		BUS_TEST(status_reply_takes_its_time),
		BUS_TEST(a_slow_host_is_not_charged_twice),
		BUS_TEST(broadcast_and_strangers_get_no_reply),
		BUS_TEST(nonsense_is_answered_with_cmd_wrg),
		BUS_TEST(texts),
		BUS_TEST(an_overlong_line_is_not_heard),
		BUS_TEST(lost_requests_and_replies),
		BUS_TEST(broken_replies),
		BUS_TEST(replies_damaged_at_a_place),
		BUS_TEST(the_witness_hears_what_the_drive_obeys),
		BUS_TEST(a_late_reply_does_not_hold_up_others),
		BUS_TEST(echo_comes_before_the_reply),
		BUS_TEST(new_id_and_rate_come_with_power),
		cmocka_unit_test(fault_texts),
	};

	return cmocka_run_group_tests_name("sim/vsmd_serial_bus", tests, NULL, NULL);
}
