/* SPDX-License-Identifier: Apache-2.0 */
/* Several VSMD drives on one CAN bus: whom a fault meets, and what a power-up forgets. */
#include "sim/can_bus.h"
#include "sim/node.h"
#include "sim/vsmd_can_node.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 3
#define BITRATE 500000
#define START (40 * DB_NS_PER_S)
#define LATENCY (200 * DB_NS_PER_US)
#define ANSWERED (20 * DB_NS_PER_MS) /* by then every answer has come */

struct bench {
	struct sim_can_bus *bus;
	struct sim_node nodes[DRIVES];
	struct sim_vsmd_can_node can[DRIVES];
	db_time now;
	uint32_t first_id; /* of what came last */
};

static int set_up(void **state, bool extended)
{
	static struct bench bench;
	const struct vsmd_can_style style = { .extended = extended, .output_base = 1 };

	bench = (struct bench){ .now = START };
	bench.bus = sim_can_bus_new(BITRATE, NULL, NULL);
	assert_non_null(bench.bus);
	for (unsigned i = 0; i < DRIVES; i++) {
		struct sim_vsmd_config config;
		struct sim_can_station station;

		sim_vsmd_config_init(&config, i + 1, BITRATE);
		config.can = true;
		bench.nodes[i].name = "drive";
		bench.nodes[i].drive = sim_vsmd_new(&config, START);
		assert_non_null(bench.nodes[i].drive);
		sim_vsmd_can_node_init(&bench.can[i], &bench.nodes[i], &style, LATENCY);
		station = sim_vsmd_can_node_station(&bench.can[i]);
		assert_true(sim_can_bus_attach(bench.bus, &station));
	}
	*state = &bench;
	return 0;
}

static int setup(void **state)
{
	return set_up(state, true);
}

static int setup_standard(void **state)
{
	return set_up(state, false);
}

static int teardown(void **state)
{
	struct bench *b = *state;

	for (unsigned i = 0; i < DRIVES; i++)
		free(b->nodes[i].drive);
	free(b->bus);
	return 0;
}

/* Frames that reach the host in the time to come. */
static unsigned run(struct bench *b, db_time time)
{
	struct db_can_frame frame;
	unsigned count = 0;

	b->now += time;
	while (sim_can_bus_run(b->bus, b->now, &frame)) {
		if (count++ == 0)
			b->first_id = frame.id;
	}
	return count;
}

/* Eight digits make an extended frame. Returns how many frames come back. */
static unsigned ask(struct bench *b, const char *text)
{
	struct db_can_frame frame = { .length = 0 };
	const char *data = strchr(text, '#') + 1;
	unsigned id;
	unsigned byte;

	assert_int_equal(sscanf(text, "%x", &id), 1);
	frame.id = id | (data - text > 4 ? DB_CAN_EXTENDED : 0);
	for (; sscanf(data, "%2x", &byte) == 1; data += 2)
		frame.data[frame.length++] = (uint8_t)byte;
	assert_true(sim_can_bus_put(b->bus, &frame, b->now));
	return run(b, ANSWERED);
}

static void fault(struct sim_faults *faults, const char *text)
{
	assert_null(sim_faults_set(faults, text));
}

static void a_request_to_another_drive_is_not_lost(void **state)
{
	struct bench *b = *state;

	fault(&b->nodes[1].faults, "lose-request 1");
	assert_int_equal(ask(b, "0008039E#0003"), 2);
	assert_int_equal(ask(b, "0010039E#0003"), 0);
	assert_int_equal(ask(b, "0010039E#0003"), 2);
}

static void the_bus_loses_what_was_sent(void **state)
{
	struct bench *b = *state;

	fault(&b->bus->faults, "lose-request 1");
	assert_int_equal(ask(b, "0018039E#0003"), 0);
	assert_int_equal(ask(b, "0018039E#0003"), 2);
}

static void a_wrong_id_is_that_of_a_neighbour(void **state)
{
	struct bench *b = *state;

	fault(&b->nodes[0].faults, "wrong-id 1");
	assert_int_equal(ask(b, "0008039E#0003"), 2);
	assert_int_equal(b->first_id, 0x00080600 | DB_CAN_EXTENDED);
}

/* The register stays as it was, here too: 0, of drive 3 instead of 1. */
static void a_wrong_standard_id_is_that_of_a_neighbour(void **state)
{
	struct bench *b = *state;

	fault(&b->nodes[0].faults, "wrong-id 1");
	assert_int_equal(ask(b, "0FE#0003"), 2);
	assert_int_equal(b->first_id, 0x180);
}

static void a_power_up_ends_reports(void **state)
{
	struct bench *b = *state;

	assert_int_equal(ask(b, "0008038F#03000A"), 1);
	sim_vsmd_power(b->nodes[0].drive, false, b->now);
	assert_int_equal(run(b, 5 * DB_NS_PER_S), 0);
	sim_vsmd_power(b->nodes[0].drive, true, b->now);
	assert_int_equal(run(b, DB_NS_PER_S), 0);
	assert_true(ask(b, "0008038F#03000A") > 0);
}

/* Answers that were not sent yet are gone as well, however short the interruption. */
static void a_power_cycle_forgets_answers(void **state)
{
	struct bench *b = *state;
	const struct db_can_frame request = { .id = 0x0008039E | DB_CAN_EXTENDED,
		                              .length = 2,
		                              .data = { 0, 3 } };

	assert_true(sim_can_bus_put(b->bus, &request, b->now));
	/* Heard (a frame of two bytes takes less than 200 us), and the answer is in the making. */
	assert_int_equal(run(b, 300 * DB_NS_PER_US), 0);
	assert_int_equal(b->nodes[0].received, 1);
	sim_vsmd_power(b->nodes[0].drive, false, b->now);
	sim_vsmd_power(b->nodes[0].drive, true, b->now);
	assert_int_equal(run(b, ANSWERED), 0);
}

/* Must end: without a shortest interval a silent drive would have ever more to say. */
static void reports_without_an_interval_are_bounded(void **state)
{
	struct bench *b = *state;

	assert_in_range(ask(b, "0008038F#030000"), 10, ANSWERED / DB_NS_PER_MS);
	fault(&b->nodes[0].faults, "silence on");
	(void)run(b, ANSWERED); /* what is on the wire still arrives */
	assert_int_equal(run(b, ANSWERED), 0);
}

#define CASE(function) cmocka_unit_test_setup_teardown(function, setup, teardown)
#define STANDARD(function) cmocka_unit_test_setup_teardown(function, setup_standard, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
		CASE(a_request_to_another_drive_is_not_lost),
		CASE(the_bus_loses_what_was_sent),
		CASE(a_wrong_id_is_that_of_a_neighbour),
		STANDARD(a_wrong_standard_id_is_that_of_a_neighbour),
		CASE(a_power_up_ends_reports),
		CASE(a_power_cycle_forgets_answers),
		CASE(reports_without_an_interval_are_bounded),
	};

	return cmocka_run_group_tests_name("sim/can_drives", tests, NULL, NULL);
}
