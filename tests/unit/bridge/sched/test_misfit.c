/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A controller whose answers differ from its document, or that keeps silent about one of its axes.
 * The answers are reported with their bytes, and not as silence or as lost requests; the silent
 * axis is offline. The real engine and the real driver (xyza) in made-up time.
 */
#include "codec/xyza.h"
#include "drivebridge/transport.h"
#include "drivebridge/trouble.h"
#include "fakes/bus.h"
#include "sched/sched_private.h"
#include "transport/serial.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

struct story {
	struct fake_bus *bus;
	uint32_t standing;             /* as it tells it */
	uint8_t asked[XYZA_FRAME_MAX]; /* last */
	size_t asked_length;
	bool silent;
	bool echoes;     /* the line, where it is silent ... */
	uint8_t changes; /* ... with this much added to the byte before the sum */
	unsigned told[DB_EVENT_COUNT];
	unsigned timing;
	struct db_unusable heard;
	bool y_is_silent;
	unsigned reads_of[2]; /* answered readings of the axes x and y */
	unsigned stops;
};

static db_time send(void *context, const uint8_t *bytes, size_t length)
{
	const struct xyza_style style = { .echo_a4 = false };
	struct story *story = context;
	struct xyza_request request;
	struct xyza_reply reply;
	uint8_t frame[XYZA_FRAME_MAX];
	bool reads_axis;
	int answered;

	memcpy(story->asked, bytes, length);
	story->asked_length = length;
	if (story->silent && story->echoes) {
		memcpy(frame, bytes, length);
		frame[length - 2] = (uint8_t)(frame[length - 2] + story->changes);
		frame[length - 1] = (uint8_t)(frame[length - 1] + story->changes);
		fake_answer_after(story->bus, MS, frame, length);
	}
	if (story->silent)
		return story->bus->now;
	assert_int_equal(xyza_decode_request(bytes, length, &request), XYZA_OK);
	reads_axis = request.verb == XYZA_READ_MAGNITUDE || request.verb == XYZA_READ_SIGN ||
	             request.verb == XYZA_READ_STANDING;
	if (reads_axis && request.axis == XYZA_Y && story->y_is_silent)
		return story->bus->now;
	if (reads_axis)
		story->reads_of[request.axis]++;
	story->stops += request.verb == XYZA_MANUAL_STOP;
	reply = (struct xyza_reply){ .kind = XYZA_REPLY_DONE,
		                     .object = request.object,
		                     .order = request.order };
	if (request.verb == XYZA_PROGRAM_STATE)
		reply.kind = XYZA_REPLY_PROGRAM_STATE;
	else if (request.verb != XYZA_VERB_ONLINE && xyza_is_read(request.verb))
		xyza_fill_data(&request, request.verb == XYZA_READ_STANDING ? story->standing : 0,
		               &style, &reply);
	if (request.verb == XYZA_WRITE_ITEM && request.item == XYZA_ITEM_SLAVE_NUMBER)
		reply.object = (uint8_t)request.value;
	answered = xyza_encode_reply(&reply, &style, frame, sizeof frame);
	assert_true(answered > 0);
	fake_answer_after(story->bus, MS, frame, (size_t)answered);
	return story->bus->now;
}

static void tell(void *context, const struct db_drive_config *drive, enum db_event event,
                 const struct db_feedback *feedback, const struct db_outage *outage)
{
	(void)outage;
	(void)drive;
	(void)feedback;
	((struct story *)context)->told[event]++;
}

static void tell_heard(void *context, const struct db_drive_config *drive,
                       const struct db_unusable *heard)
{
	struct story *story = context;

	(void)drive;
	story->told[DB_EVENT_DRIVE_HEARD]++;
	story->heard = *heard;
}

static void tell_timing(void *context, const struct db_drive_config *drive,
                        const struct db_engine_timing *timing)
{
	(void)drive;
	(void)timing;
	((struct story *)context)->timing++;
}

static const struct db_engine_ops ops = {
	.send = send,
	.on_event = tell,
	.on_unusable = tell_heard,
	.on_timing = tell_timing,
};

static void begin(struct story *story, unsigned axes)
{
	story->bus = fake_bus_new(db_driver_find("xyza"), axes);
	story->bus->context = story;
	story->bus->config.transport = &db_transport_serial;
	story->bus->config.baud = 115200;
	story->bus->config.stop_bits = 1;
	story->bus->config.drive_latency_ms = 20;
	story->bus->config.retries = 2;
	story->bus->config.adapt = true;
	for (unsigned i = 0; i < axes; i++) {
		story->bus->drives[i].address = 3;
		story->bus->drives[i].axis = i;
	}
	fake_bus_open(story->bus, axes, &ops);
	fake_port(story->bus, 0);
}

static void a_state_that_is_a_mask_is_named(void **state)
{
	struct story story = { .standing = 0x0F };
	static const uint8_t head[] = { 0x5A, 0xA5, 0x0B, 0xF1, 0x00, 0x03, 0xE1, 0xA3, 0x0F };

	(void)state;
	begin(&story, 1);
	fake_pass(story.bus, 10000 * MS);
	assert_false(fake_is_online(story.bus, 0));
	assert_int_equal(story.told[DB_EVENT_DRIVE_HEARD], 1);
	assert_true(story.heard.length >= sizeof head);
	assert_memory_equal(story.heard.bytes, head, sizeof head);
	assert_int_equal(fake_snapshot(story.bus, 0).trouble.cause, DB_TROUBLE_NOT_UNDERSTOOD);
	assert_int_equal(story.timing, 0);
	assert_int_equal(story.told[DB_EVENT_DRIVE_LOST], 0);
	fake_bus_free(story.bus);
}

/* One that was understood is no stranger when it falls silent. */
static void what_came_before_it_fell_silent_does_not_explain_that(void **state)
{
	struct story story = { .standing = 1 };

	(void)state;
	begin(&story, 1);
	fake_pass(story.bus, 2000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	story.standing = 0x0F;
	fake_pass(story.bus, 30 * MS);
	story.silent = true;
	fake_pass(story.bus, 8000 * MS);
	assert_false(fake_is_online(story.bus, 0));
	assert_int_equal(story.told[DB_EVENT_DRIVE_LOST], 1);
	assert_int_equal(story.told[DB_EVENT_DRIVE_HEARD], 0);
	assert_int_equal(fake_snapshot(story.bus, 0).trouble.cause, DB_TROUBLE_NO_ANSWER);
	fake_bus_free(story.bus);
}

static void an_echo_is_no_answer(void **state)
{
	struct story story = { .silent = true, .echoes = true };

	(void)state;
	begin(&story, 1);
	fake_pass(story.bus, 10000 * MS);
	assert_int_equal(story.told[DB_EVENT_DRIVE_HEARD], 0);
	assert_int_equal(fake_snapshot(story.bus, 0).trouble.cause, DB_TROUBLE_NO_ANSWER);
	fake_bus_free(story.bus);
}

/* As long as what was asked, but other bytes. */
static void an_answer_in_the_form_of_a_question_is_named(void **state)
{
	struct story story = { .silent = true, .echoes = true, .changes = 1 };

	(void)state;
	begin(&story, 1);
	fake_pass(story.bus, 10000 * MS);
	assert_int_equal(story.told[DB_EVENT_DRIVE_HEARD], 1);
	assert_int_equal(fake_snapshot(story.bus, 0).trouble.cause, DB_TROUBLE_NOT_UNDERSTOOD);
	fake_bus_free(story.bus);
}

/* The last question, for another address, as another host on the line would ask it. */
static void ask_as_another_host(struct story *story, uint8_t address)
{
	uint8_t frame[XYZA_FRAME_MAX];
	size_t last = story->asked_length - 1;

	memcpy(frame, story->asked, story->asked_length);
	frame[last - 1]++;
	frame[last] = (uint8_t)(frame[last] + 1 + address - frame[5]);
	frame[5] = address;
	fake_receive(story->bus, frame, story->asked_length);
}

/* It is no explanation for the silence of one that was understood before, or was not asked, or is not there. */
static void what_another_host_says_does_not_explain_a_silence(void **state)
{
	struct story story = { .standing = 1 };

	(void)state;
	begin(&story, 1);
	fake_pass(story.bus, 2000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	story.silent = true;
	for (unsigned i = 0; i < 8000; i++) {
		fake_pass(story.bus, MS);
		ask_as_another_host(&story, 9);
		if (fake_is_online(story.bus, 0) || !story.bus->engine->nodes[0]->flight.station)
			ask_as_another_host(&story, 3);
	}
	assert_false(fake_is_online(story.bus, 0));
	assert_int_equal(story.told[DB_EVENT_DRIVE_LOST], 1);
	assert_int_equal(story.told[DB_EVENT_DRIVE_HEARD], 0);
	assert_int_equal(fake_snapshot(story.bus, 0).trouble.cause, DB_TROUBLE_NO_ANSWER);
	fake_bus_free(story.bus);
}

/* It goes by its new number at once, and says so by that. */
static void an_answer_from_the_new_number_is_one(void **state)
{
	struct story story = { .standing = 1 };
	const struct db_setting number = { XYZA_SLAVE_NUMBER, { .u = 9 } };
	enum db_result result = DB_RESULT_NONE;

	(void)state;
	begin(&story, 1);
	fake_pass(story.bus, 5000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	fake_request(story.bus, 0, (struct db_request){ .settings = &number, .setting_count = 1 });
	for (unsigned ms = 0; ms < 500 && result == DB_RESULT_NONE; ms++) {
		fake_pass(story.bus, MS);
		result = fake_result(story.bus);
	}
	assert_int_equal(result, DB_RESULT_UNPROVEN);
	fake_bus_free(story.bus);
}

/* --- an axis that keeps silent ---------------------------------------------------------------- */

static void a_reading_from_before_a_stop_does_not_confirm_it(void **state)
{
	struct story story = { .standing = 1 };

	(void)state;
	begin(&story, 2);
	fake_pass(story.bus, 2000 * MS);
	assert_true(fake_is_online(story.bus, 1));
	story.y_is_silent = true;
	fake_pass(story.bus, 100 * MS);
	story.reads_of[0] = 0;
	fake_post(story.bus, 1, DB_CMD_STOP);
	fake_pass(story.bus, 5000 * MS);
	/* Axis x is still read: readings of the controller go on without axis y. */
	assert_true(story.reads_of[0] > 10);
	assert_true(story.stops > 1);
	assert_int_not_equal(fake_result(story.bus), DB_RESULT_OK);
	fake_bus_free(story.bus);
}

static void a_silent_axis_is_offline_until_it_answers_again(void **state)
{
	struct story story = { .standing = 1 };

	(void)state;
	begin(&story, 2);
	fake_pass(story.bus, 2000 * MS);
	assert_true(fake_is_online(story.bus, 1));
	story.y_is_silent = true;
	fake_pass(story.bus, 1000 * MS);
	assert_true(fake_is_online(story.bus, 0));
	assert_false(fake_is_online(story.bus, 1));
	fake_post(story.bus, 1, DB_CMD_STOP);
	fake_pass(story.bus, 80000 * MS);
	assert_int_equal(fake_result(story.bus), DB_RESULT_RUNS_ON);
	assert_true(fake_feedback(story.bus, 1).status & DB_STATUS_MUST_STAND);
	/* Also after a long silence the axis is asked every two seconds. */
	story.y_is_silent = false;
	fake_pass(story.bus, 2200 * MS);
	assert_true(fake_is_online(story.bus, 1));
	assert_false(fake_feedback(story.bus, 1).status & DB_STATUS_MUST_STAND);
	fake_bus_free(story.bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_state_that_is_a_mask_is_named),
		cmocka_unit_test(what_came_before_it_fell_silent_does_not_explain_that),
		cmocka_unit_test(an_echo_is_no_answer),
		cmocka_unit_test(an_answer_in_the_form_of_a_question_is_named),
		cmocka_unit_test(what_another_host_says_does_not_explain_a_silence),
		cmocka_unit_test(an_answer_from_the_new_number_is_one),
		cmocka_unit_test(a_reading_from_before_a_stop_does_not_confirm_it),
		cmocka_unit_test(a_silent_axis_is_offline_until_it_answers_again),
	};

	return cmocka_run_group_tests_name("sched/misfit", tests, NULL, NULL);
}
