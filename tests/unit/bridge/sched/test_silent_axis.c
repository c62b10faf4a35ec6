/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A controller of two axes that answers everything but what is asked about the second one: the real engine and driver in
 * made-up time. What that axis told last, before its stop, does not show that it stands.
 */
#include "codec/xyza.h"
#include "drivebridge/transport.h"
#include "fakes/bus.h"
#include "sched/sched_private.h"
#include "transport/serial.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

struct story {
	struct fake_bus *bus;
	bool mute;            /* the second axis */
	unsigned reads_of[2]; /* that were answered, of each axis */
	unsigned stops;
};

static db_time send(void *context, const uint8_t *bytes, size_t length)
{
	const struct xyza_style style = { .echo_a4 = false };
	struct story *story = context;
	struct xyza_request request;
	struct xyza_reply reply;
	uint8_t frame[XYZA_FRAME_MAX];
	bool of_axis;
	int answered;

	assert_int_equal(xyza_decode_request(bytes, length, &request), XYZA_OK);
	of_axis = request.verb == XYZA_READ_MAGNITUDE || request.verb == XYZA_READ_SIGN ||
	          request.verb == XYZA_READ_STANDING;
	if (of_axis && request.axis == XYZA_Y && story->mute)
		return story->bus->now;
	if (of_axis)
		story->reads_of[request.axis]++;
	story->stops += request.verb == XYZA_MANUAL_STOP;
	reply = (struct xyza_reply){ .kind = XYZA_REPLY_DONE,
		                     .object = request.object,
		                     .order = request.order };
	if (request.verb == XYZA_PROGRAM_STATE)
		reply.kind = XYZA_REPLY_PROGRAM_STATE;
	else if (request.verb != XYZA_VERB_ONLINE && xyza_is_read(request.verb))
		xyza_fill_data(&request, request.verb == XYZA_READ_STANDING ? 1 : 0, &style,
		               &reply);
	answered = xyza_encode_reply(&reply, &style, frame, sizeof(frame));
	assert_true(answered > 0);
	fake_answer_after(story->bus, MS, frame, (size_t)answered);
	return story->bus->now;
}

static const struct db_engine_ops ops = { .send = send };

static void begin(struct story *story)
{
	story->bus = fake_bus_new(db_driver_find("xyza"), 2);
	story->bus->context = story;
	story->bus->config.transport = &db_transport_serial;
	story->bus->config.baud = 115200;
	story->bus->config.stop_bits = 1;
	story->bus->config.drive_latency_ms = 20;
	story->bus->config.retries = 2;
	for (unsigned i = 0; i < 2; i++) {
		story->bus->drives[i].address = 3;
		story->bus->drives[i].axis = i;
	}
	fake_bus_open(story->bus, 2, &ops);
	fake_port(story->bus, 0);
	fake_pass(story->bus, 2000 * MS);
	assert_true(fake_is_online(story->bus, 0) && fake_is_online(story->bus, 1));
}

static void what_it_told_before_its_stop_is_no_stand(void **state)
{
	struct story story = { 0 };

	(void)state;
	begin(&story);
	story.mute = true;
	fake_pass(story.bus, 1000 * MS);
	assert_false(fake_feedback(story.bus, 1).status & DB_STATUS_MOVING);
	story.reads_of[0] = 0;
	fake_post(story.bus, 1, DB_CMD_STOP);
	fake_pass(story.bus, 5000 * MS);
	/* The other one is read, so that readings come to their end. */
	assert_true(story.reads_of[0] > 10);
	assert_true(story.stops > 1);
	assert_int_not_equal(fake_result(story.bus), DB_RESULT_OK);
	fake_bus_free(story.bus);
}

static void once_it_answers_again_it_is_seen_to_stand(void **state)
{
	struct story story = { 0 };
	enum db_result result;

	(void)state;
	begin(&story);
	story.mute = true;
	fake_pass(story.bus, 1000 * MS);
	fake_post(story.bus, 1, DB_CMD_STOP);
	fake_pass(story.bus, 300 * MS);
	assert_int_equal(fake_result(story.bus), DB_RESULT_NONE);
	story.mute = false;
	fake_pass(story.bus, 500 * MS);
	result = fake_result(story.bus);
	assert_int_equal(result, DB_RESULT_OK);
	fake_bus_free(story.bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_it_told_before_its_stop_is_no_stand),
		cmocka_unit_test(once_it_answers_again_it_is_seen_to_stand),
	};

	return cmocka_run_group_tests_name("a silent axis", tests, NULL, NULL);
}
