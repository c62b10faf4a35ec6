/* SPDX-License-Identifier: Apache-2.0 */
/* XYZA controllers on a line, and the simulator with such a line in its configuration. */
#include "sim/serial_bus.h"

#include "codec/xyza_frames.h"
#include "sim/commands.h"
#include "sim/xyza_controller.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define BAUD 9600
#define LATENCY (2 * DB_NS_PER_MS)
#define SECOND DB_NS_PER_S
#define NEVER DB_TIME_NEVER
#define CONTROLLERS 2

/* Two controllers on a bus, numbers 1 and 2, and what a host received. */
struct bench {
	struct sim_serial_bus *bus;
	struct sim_node nodes[CONTROLLERS];
	db_time now;
	db_time last_byte;
	uint8_t bytes[1024];
	size_t length;
};

static struct sim_xyza *new_controller(unsigned number, struct xyza_style style, db_time now)
{
	struct sim_xyza_config config;

	sim_xyza_config_init(&config, number);
	config.style = style;
	return sim_xyza_new(&config, now);
}

static void replace_controller(struct bench *bench, size_t place, unsigned number,
                               struct xyza_style style)
{
	free(bench->nodes[place].xyza);
	bench->nodes[place].xyza = new_controller(number, style, bench->now);
	assert_non_null(bench->nodes[place].xyza);
}

static int setup(void **state)
{
	static struct bench bench;
	struct sim_serial_config config = {
		.baud = BAUD, .rs485 = true, .paced = true, .latency = LATENCY
	};

	bench = (struct bench){ .now = 50 * SECOND };
	bench.bus = sim_serial_bus_new(&sim_xyza_protocol, &config, NULL, NULL);
	assert_non_null(bench.bus);
	for (unsigned i = 0; i < CONTROLLERS; i++) {
		bench.nodes[i].name = "controller";
		replace_controller(&bench, i, i + 1, (struct xyza_style){ .failure_bb = false });
		assert_true(sim_serial_bus_attach(bench.bus, &bench.nodes[i]));
	}
	*state = &bench;
	return 0;
}

static int teardown(void **state)
{
	struct bench *bench = *state;

	free(bench->bus);
	for (size_t i = 0; i < CONTROLLERS; i++)
		free(bench->nodes[i].xyza);
	return 0;
}

static db_time wire(size_t bytes)
{
	return (db_time)bytes * 10 * SECOND / BAUD;
}

/* Lets time pass until all is quiet, waking only when the bus asks for it. */
static void listen_to(struct bench *b)
{
	while (sim_serial_bus_next(b->bus) != NEVER) {
		size_t count;

		b->now = sim_serial_bus_next(b->bus);
		count = sim_serial_bus_run(b->bus, b->now, b->bytes + b->length,
		                           sizeof(b->bytes) - b->length);
		if (count > 0)
			b->last_byte = b->now;
		b->length += count;
	}
}

static void send_bytes(struct bench *b, const uint8_t *bytes, size_t length)
{
	b->length = 0;
	sim_serial_bus_receive(b->bus, bytes, length, b->now);
	listen_to(b);
}

static void ask(struct bench *b, const struct xyza_request *request)
{
	uint8_t frame[XYZA_FRAME_MAX];
	int length = xyza_encode_request(request, frame, sizeof(frame));

	assert_true(length > 0);
	send_bytes(b, frame, (size_t)length);
}

/* The one reply that came, whole and right, and fitting. */
static struct xyza_reply reply_to(struct bench *b, const struct xyza_request *request)
{
	struct xyza_reply reply = { .kind = XYZA_REPLY_FAILED };

	ask(b, request);
	assert_int_equal(xyza_decode_reply(b->bytes, b->length, &reply), XYZA_OK);
	assert_true(xyza_fits(request, &reply));
	return reply;
}

static const struct xyza_request online = { .verb = XYZA_VERB_ONLINE, .object = 1 };
static const struct xyza_request magnitude = { .verb = XYZA_READ_MAGNITUDE, .object = 1 };

/* --- the line ------------------------------------------------------------------------------------- */

static void a_reply_takes_its_time(void **state)
{
	struct bench *b = *state;
	db_time start = b->now;
	db_time due = wire(XYZA_COMMAND_FRAME) + LATENCY + wire(XYZA_DATA_FRAME);

	assert_int_equal(reply_to(b, &magnitude).kind, XYZA_REPLY_DATA);
	assert_int_equal(b->length, xyza_reply_length(magnitude.verb));
	assert_in_range(b->last_byte - start, due, due + 10);
	start = b->now;
	due = 2 * wire(XYZA_COMMAND_FRAME) + LATENCY;
	assert_int_equal(reply_to(b, &online).kind, XYZA_REPLY_DONE);
	assert_in_range(b->last_byte - start, due, due + 10);
}

static void only_the_one_that_is_meant_answers(void **state)
{
	struct bench *b = *state;
	const struct xyza_request other = { .verb = XYZA_VERB_ONLINE, .object = 2 };
	const struct xyza_request nobody = { .verb = XYZA_VERB_ONLINE, .object = 3 };

	assert_int_equal(reply_to(b, &other).object, 2);
	assert_int_equal(b->nodes[0].received, 0);
	ask(b, &nobody);
	assert_int_equal(b->length, 0);
	assert_int_equal(b->bus->stats.foreign, 1);
	assert_string_equal(b->nodes[1].log[0].line, "5A A5 0A AC 01 02 AC AC 07");
}

static void a_wrong_sum_is_answered_as_failed(void **state)
{
	struct bench *b = *state;
	const uint8_t frame[] = { 0x5a, 0xa5, 0x0a, 0xf3, 0x01, 0x01, 0x03, 0xa1, 0x00 };
	struct xyza_reply reply;

	send_bytes(b, frame, sizeof(frame));
	assert_int_equal(xyza_decode_reply(b->bytes, b->length, &reply), XYZA_OK);
	assert_int_equal(reply.kind, XYZA_REPLY_FAILED);
	assert_int_equal(reply.order, XYZA_ORDER_MANUAL);
	assert_true(sim_xyza_axis_state(b->nodes[0].xyza, XYZA_X).standing);
}

static void replies_on_the_line_are_no_requests(void **state)
{
	struct bench *b = *state;
	const uint8_t frame[] = { 0x5a, 0xa5, 0x0c, 0xaa, 0x00, 0x01, 0x00, 0xf1, 0x9c };

	send_bytes(b, frame, sizeof(frame));
	assert_int_equal(b->length, 0);
	assert_int_equal(b->nodes[0].received, 0);
}

static void noise_before_a_request_does_no_harm(void **state)
{
	struct bench *b = *state;
	const uint8_t frame[] = { 0xff, 0x5a, 0x00, 0x5a, 0xa5, 0x0b, 0xf1, 0x5a,
		                  0xa5, 0x0a, 0xac, 0x01, 0x01, 0xac, 0xac, 0x06 };
	struct xyza_reply reply;

	send_bytes(b, frame, sizeof(frame));
	assert_int_equal(xyza_decode_reply(b->bytes, b->length, &reply), XYZA_OK);
	assert_true(xyza_fits(&online, &reply));
}

static void half_a_request_is_forgotten(void **state)
{
	struct bench *b = *state;
	/* Would wait for ten more bytes, and so swallow the next request. */
	const uint8_t half[] = { 0x5a, 0xa5, 0x0f, 0xf1, 0x01, 0x01, 0xe1, 0xa1, 0x00 };

	send_bytes(b, half, sizeof(half));
	assert_int_equal(b->length, 0);
	b->now += SECOND;
	assert_int_equal(reply_to(b, &online).kind, XYZA_REPLY_DONE);
	assert_int_equal(b->bus->stats.missed, 1);
}

/* --- faults --------------------------------------------------------------------------------------- */

static void fault(struct bench *b, const char *text)
{
	assert_null(sim_faults_set(&b->nodes[0].faults, text));
}

static void dropped_is_carried_out_and_lost_is_not(void **state)
{
	struct bench *b = *state;
	const struct xyza_request output = {
		.verb = XYZA_WRITE_OUTPUT, .object = 1, .number = 1, .on = true
	};

	fault(b, "lose-request 1");
	ask(b, &output);
	assert_int_equal(b->length, 0);
	assert_int_equal(b->nodes[0].xyza->outputs, 0);
	fault(b, "drop 1");
	ask(b, &output);
	assert_int_equal(b->length, 0);
	assert_int_equal(b->nodes[0].xyza->outputs, 1);
	assert_int_equal(reply_to(b, &output).kind, XYZA_REPLY_DONE);
}

static void late_replies_come_late(void **state)
{
	struct bench *b = *state;
	db_time start = b->now;

	fault(b, "delay 200 1");
	assert_int_equal(reply_to(b, &online).kind, XYZA_REPLY_DONE);
	assert_true(b->last_byte - start > SECOND / 5);
}

static void damaged_replies_are_not_taken(void **state)
{
	struct bench *b = *state;
	struct xyza_reply reply;
	size_t skip;
	size_t length;

	for (unsigned i = 0; i < 50; i++) {
		fault(b, "corrupt 1");
		ask(b, &magnitude);
		assert_int_equal(b->length, XYZA_DATA_FRAME);
		assert_int_not_equal(xyza_decode_reply(b->bytes, b->length, &reply), XYZA_OK);
	}
	fault(b, "truncate 1");
	ask(b, &magnitude);
	assert_int_equal(b->length, XYZA_DATA_FRAME / 2);
	xyza_cut(b->bytes, b->length, &skip, &length);
	assert_int_equal(length, 0);
}

static void a_reply_is_found_behind_garbage(void **state)
{
	struct bench *b = *state;

	for (unsigned i = 0; i < 50; i++) {
		struct xyza_reply reply;
		size_t skip;
		size_t length;

		fault(b, "garbage 1");
		ask(b, &magnitude);
		assert_true(b->length > XYZA_DATA_FRAME);
		xyza_cut(b->bytes, b->length, &skip, &length);
		assert_int_equal(length, XYZA_DATA_FRAME);
		assert_int_equal(xyza_decode_reply(b->bytes + skip, length, &reply), XYZA_OK);
		assert_true(xyza_fits(&magnitude, &reply));
	}
}

static void a_reply_in_anothers_name_does_not_fit(void **state)
{
	struct bench *b = *state;
	struct xyza_reply reply;

	fault(b, "wrong-id 1");
	ask(b, &magnitude);
	assert_int_equal(xyza_decode_reply(b->bytes, b->length, &reply), XYZA_OK);
	assert_int_equal(reply.object, 2);
	assert_false(xyza_fits(&magnitude, &reply));
}

static void an_echo_is_no_reply(void **state)
{
	struct bench *b = *state;
	struct xyza_reply reply;

	assert_null(sim_faults_set(sim_serial_bus_faults(b->bus), "echo on"));
	ask(b, &online);
	assert_int_equal(b->length, 2 * XYZA_COMMAND_FRAME);
	assert_int_equal(xyza_decode_reply(b->bytes, XYZA_COMMAND_FRAME, &reply), XYZA_ERR_SIDE);
	assert_int_equal(
		xyza_decode_reply(b->bytes + XYZA_COMMAND_FRAME, XYZA_COMMAND_FRAME, &reply),
		XYZA_OK);
}

static void silence_and_no_power_are_silent(void **state)
{
	struct bench *b = *state;

	fault(b, "silence on");
	ask(b, &online);
	assert_int_equal(b->length, 0);
	fault(b, "none");
	sim_xyza_power(b->nodes[0].xyza, false, b->now);
	ask(b, &online);
	assert_int_equal(b->length, 0);
	sim_xyza_power(b->nodes[0].xyza, true, b->now);
	assert_int_equal(reply_to(b, &online).kind, XYZA_REPLY_DONE);
	assert_int_equal(b->bus->stats.missed, 2);
}

static void two_of_one_number_are_not_understood(void **state)
{
	struct bench *b = *state;
	struct xyza_reply reply;

	replace_controller(b, 1, 1, (struct xyza_style){ .answer_mark_0a = true });
	ask(b, &online);
	assert_int_equal(b->length, XYZA_COMMAND_FRAME);
	/* 0A and 0C at once are 08. */
	assert_int_equal(xyza_decode_reply(b->bytes, b->length, &reply), XYZA_ERR_FORM);
}

/* --- ways to say the same ------------------------------------------------------------------------- */

static void controllers_differ_in_style(void **state)
{
	struct bench *b = *state;
	const struct xyza_request standing = { .verb = XYZA_READ_STANDING, .object = 1 };
	const struct xyza_request start = { .verb = XYZA_PROGRAM_START, .object = 1 };

	(void)reply_to(b, &online);
	assert_int_equal(b->bytes[2], 0x0c);
	assert_int_equal(reply_to(b, &start).kind, XYZA_REPLY_FAILED);
	assert_int_equal(b->bytes[3], 0xab);
	replace_controller(
		b, 0, 1,
		(struct xyza_style){ .answer_mark_0a = true, .failure_bb = true, .echo_a4 = true });
	(void)reply_to(b, &online);
	assert_int_equal(b->bytes[2], 0x0a);
	assert_int_equal(reply_to(b, &start).kind, XYZA_REPLY_FAILED);
	assert_int_equal(b->bytes[3], 0xbb);
	assert_int_equal(reply_to(b, &standing).target, 0xa4);
}

static void a_new_number_answers_from_the_next_request_on(void **state)
{
	struct bench *b = *state;
	const struct xyza_request change = {
		.verb = XYZA_WRITE_ITEM, .object = 1, .item = XYZA_ITEM_SLAVE_NUMBER, .value = 6
	};
	const struct xyza_request sixth = { .verb = XYZA_VERB_ONLINE, .object = 6 };

	assert_int_equal(reply_to(b, &change).object, 1);
	ask(b, &online);
	assert_int_equal(b->length, 0);
	assert_int_equal(reply_to(b, &sixth).object, 6);
}

/* --- the whole simulator -------------------------------------------------------------------------- */

#define GOOD                                                                        \
	"bus b { protocol = xyza\n baud = 9600 }\n"                                 \
	"drive c { bus = b\n address = 40\n answer-mark = 0a\n failure-code = bb\n" \
	" set = {\"lead.y=2000\", \"microstep=8\", \"stop_key=2\"} }\n"

static int load(const char *text, struct sim_config *config)
{
	char path[] = "/tmp/sim-xyza-XXXXXX";
	int fd = mkstemp(path);
	int result;

	assert_true(fd >= 0);
	assert_int_equal(write(fd, text, strlen(text)), strlen(text));
	(void)close(fd);
	result = sim_config_load(path, config);
	(void)unlink(path);
	return result;
}

static void wrong_configurations_are_refused(void **state)
{
	static const char *const wrong[] = {
		"address = 256",
		"address = 0",
		"axes = 5",
		"answer-mark = 0d",
		"failure-code = aa",
		"set = {\"lead=0\"}",
		"set = {\"sound.x=1\"}",
		"set = {\"lead.b=1\"}",
		"set = {\"lead\"}",
		"set = {\"pause_key=7\"}",
		"set = {\"nope=1\"}",
		"set = {\"slave_number=2\"}",
		"set = {\"factory_reset=1\"}",
	};

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		struct sim_config config;
		char text[256];

		(void)snprintf(text, sizeof(text),
		               "bus b { protocol = xyza }\ndrive c { bus = b\n %s }\n", wrong[i]);
		if (load(text, &config) == 0)
			fail_msg("%s was taken", wrong[i]);
	}
}

struct sim_bench {
	struct sim_config config;
	struct sim_world world;
	db_time now;
	char answer[4096];
};

static const char *command(struct sim_bench *bench, const char *text)
{
	char line[128];
	FILE *out = fmemopen(bench->answer, sizeof(bench->answer), "w");

	assert_non_null(out);
	(void)snprintf(line, sizeof(line), "%s", text);
	sim_command(&bench->world, line, bench->now, out);
	assert_int_equal(fclose(out), 0);
	return bench->answer;
}

static int open_world(void **state)
{
	static struct sim_bench bench;

	bench = (struct sim_bench){ .now = SECOND };
	assert_int_equal(load(GOOD, &bench.config), 0);
	assert_int_equal(sim_world_open(&bench.world, &bench.config, NULL, bench.now), 0);
	*state = &bench;
	return 0;
}

static int close_world(void **state)
{
	struct sim_bench *bench = *state;

	sim_world_close(&bench->world);
	sim_config_free(&bench->config);
	return 0;
}

static void the_file_says_what_a_controller_is_like(void **state)
{
	struct sim_bench *b = *state;
	const struct sim_xyza *xyza = b->world.nodes[0].xyza;

	assert_int_equal(sim_xyza_memory_get(&xyza->memory, XYZA_ITEM_SLAVE_NUMBER, XYZA_X), 40);
	assert_true(xyza->config.style.answer_mark_0a);
	assert_true(xyza->config.style.failure_bb);
	assert_false(xyza->config.style.echo_a4);
	assert_int_equal(sim_xyza_memory_get(&xyza->memory, XYZA_ITEM_LEAD, XYZA_X), 5000);
	assert_int_equal(sim_xyza_memory_get(&xyza->memory, XYZA_ITEM_LEAD, XYZA_Y), 2000);
	assert_int_equal(sim_xyza_memory_get(&xyza->memory, XYZA_ITEM_MICROSTEP, XYZA_A), 8);
	assert_int_equal(sim_xyza_memory_get(&xyza->memory, XYZA_ITEM_KEYS, XYZA_X), 0x080206);
}

static void commands_reach_controllers(void **state)
{
	struct sim_bench *b = *state;
	static const char *const refused[] = {
		"input c 17 1", "input c 0 1",  "input c 1 2", "place c b 5", "place c x",
		"place c x 5x", "identity c x", "stall c",     "bits c 1",    "reports c 1 1 1",
	};

	assert_string_equal(command(b, "place c y -17"), "ok\n");
	assert_string_equal(command(b, "input c 16 1"), "ok\n");
	assert_non_null(strstr(command(b, "get c"), " y=-17 "));
	assert_non_null(strstr(b->answer, " inputs=0x8000 "));
	assert_non_null(strstr(b->answer, " address=40 "));
	assert_non_null(strstr(command(b, "list"), "drive c 40\n"));
	assert_string_equal(command(b, "fault c drop 2"), "ok\n");
	assert_string_equal(command(b, "baud b 19200"), "ok\n");
	assert_string_equal(command(b, "power c cycle"), "ok\n");
	assert_non_null(strstr(command(b, "get c"), " y=0 "));
	for (size_t i = 0; i < sizeof(refused) / sizeof(refused[0]); i++) {
		if (strncmp(command(b, refused[i]), "error ", 6) != 0)
			fail_msg("\"%s\" was answered \"%s\"", refused[i], b->answer);
	}
}

static void the_world_carries_a_programs_motion_on(void **state)
{
	struct sim_bench *b = *state;

	assert_int_equal(sim_world_next(&b->world, b->now), NEVER);
	assert_string_equal(command(b, "input c 6 1"), "ok\n"); /* the start key */
	assert_true(sim_world_next(&b->world, b->now) < b->now + SECOND);
	b->now += SECOND;
	sim_world_run(&b->world, b->now);
	assert_non_null(strstr(command(b, "get c"), " program_state=1 program=1 step=3 "));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
#define WORLD_TEST(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)
	const struct CMUnitTest tests[] = {
		TEST(a_reply_takes_its_time),
		TEST(only_the_one_that_is_meant_answers),
		TEST(a_wrong_sum_is_answered_as_failed),
		TEST(replies_on_the_line_are_no_requests),
		TEST(noise_before_a_request_does_no_harm),
		TEST(half_a_request_is_forgotten),
		TEST(dropped_is_carried_out_and_lost_is_not),
		TEST(late_replies_come_late),
		TEST(damaged_replies_are_not_taken),
		TEST(a_reply_is_found_behind_garbage),
		TEST(a_reply_in_anothers_name_does_not_fit),
		TEST(an_echo_is_no_reply),
		TEST(silence_and_no_power_are_silent),
		TEST(two_of_one_number_are_not_understood),
		TEST(controllers_differ_in_style),
		TEST(a_new_number_answers_from_the_next_request_on),
		cmocka_unit_test(wrong_configurations_are_refused),
		WORLD_TEST(the_file_says_what_a_controller_is_like),
		WORLD_TEST(commands_reach_controllers),
		WORLD_TEST(the_world_carries_a_programs_motion_on),
	};

	return cmocka_run_group_tests_name("sim/xyza_bus", tests, NULL, NULL);
}
