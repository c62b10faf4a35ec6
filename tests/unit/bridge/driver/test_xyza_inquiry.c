/* SPDX-License-Identifier: Apache-2.0 */
/* What a scan asks XYZA controllers, and which of their frames it takes for an answer. */
#include "codec/xyza.h"
#include "driver/list.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static const struct db_driver *const driver = &db_driver_xyza;
static const struct db_bus_config bus = { .driver = &db_driver_xyza };

/* False: there is no such question. Else it is in `request`. */
static bool ask(const struct db_inquiry *inquiry, struct xyza_request *request)
{
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_exchange exchange = { .request = bytes, .request_size = sizeof bytes };

	if (!driver->inquire(&bus, inquiry, &exchange))
		return false;
	assert_int_equal(xyza_decode_request(bytes, exchange.request_length, request), XYZA_OK);
	assert_int_equal(exchange.answer_length, xyza_reply_length(request->verb));
	return true;
}

static enum db_recognised take(const struct db_inquiry *inquiry, struct xyza_reply reply,
                               struct db_inquired *found)
{
	const struct xyza_style style = { .answer_mark_0a = false };
	uint8_t frame[32];
	int length = xyza_encode_reply(&reply, &style, frame, sizeof frame);

	assert_true(length > 0);
	return driver->recognise(&bus, inquiry, frame, (size_t)length, found);
}

static void every_question_is_about_its_controller(void **state)
{
	struct db_inquiry inquiry = { .kind = DB_INQUIRY_THERE, .address = 7 };
	struct xyza_request request;

	(void)state;
	assert_true(ask(&inquiry, &request));
	assert_int_equal(request.verb, XYZA_VERB_ONLINE);
	assert_int_equal(request.object, 7);
	inquiry.kind = DB_INQUIRY_STANDING;
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		inquiry.value = axis;
		assert_true(ask(&inquiry, &request));
		assert_int_equal(request.verb, XYZA_READ_STANDING);
		assert_int_equal(request.axis, axis);
		assert_int_equal(request.object, 7);
	}
	inquiry.value = XYZA_AXIS_COUNT;
	assert_false(ask(&inquiry, &request));
	inquiry.kind = DB_INQUIRY_SET_ADDRESS;
	inquiry.value = 9;
	assert_true(ask(&inquiry, &request));
	assert_int_equal(request.verb, XYZA_WRITE_ITEM);
	assert_int_equal(request.item, XYZA_ITEM_SLAVE_NUMBER);
	assert_int_equal(request.value, 9);
	/* Numbers that no controller has. */
	inquiry.value = 0;
	assert_false(ask(&inquiry, &request));
	inquiry.value = XYZA_OBJECT_MAX + 1;
	assert_false(ask(&inquiry, &request));
	inquiry.kind = DB_INQUIRY_THERE;
	inquiry.address = 0;
	assert_false(ask(&inquiry, &request));
	inquiry.address = XYZA_OBJECT_MAX + 1;
	assert_false(ask(&inquiry, &request));
	inquiry.address = XYZA_OBJECT_MAX;
	assert_true(ask(&inquiry, &request));
	/* The document has none of these. */
	inquiry.kind = DB_INQUIRY_IDENTITY;
	assert_false(ask(&inquiry, &request));
}

static void an_answer_is_from_the_controller_that_was_asked(void **state)
{
	const struct db_inquiry inquiry = { .kind = DB_INQUIRY_STANDING, .address = 7, .value = 1 };
	struct xyza_request request;
	struct xyza_reply reply = { .kind = XYZA_REPLY_DATA, .object = 7, .value = 1 };
	struct db_inquired found = { .parts = 0 };

	(void)state;
	assert_true(ask(&inquiry, &request));
	reply.item_class = 0xE1;
	reply.target = 0xB3;
	assert_int_equal(take(&inquiry, reply, &found), DB_RECOGNISED_ANSWER);
	assert_true(found.tells_standing && found.stands);
	assert_false(found.refused);
	assert_int_equal(take(&inquiry, reply, &found), DB_RECOGNISED_AGAIN);
	found = (struct db_inquired){ .parts = 0 };
	reply.value = 0;
	assert_int_equal(take(&inquiry, reply, &found), DB_RECOGNISED_ANSWER);
	assert_true(found.tells_standing);
	assert_false(found.stands);
	found = (struct db_inquired){ .parts = 0 };
	reply.object = 8;
	assert_int_equal(take(&inquiry, reply, &found), DB_RECOGNISED_NOTHING);
	reply.object = 7;
	reply.target = 0xA3; /* of another axis */
	assert_int_equal(take(&inquiry, reply, &found), DB_RECOGNISED_NOTHING);
	assert_int_equal(driver->recognise(&bus, &inquiry, (const uint8_t *)"\x5A\xA5", 2, &found),
	                 DB_RECOGNISED_NOTHING);
	assert_int_equal(found.parts, 0);
}

/* It may answer with the number that it has from now on. */
static void a_new_number_may_answer_at_once(void **state)
{
	const struct db_inquiry inquiry = { .kind = DB_INQUIRY_SET_ADDRESS,
		                            .address = 7,
		                            .value = 9 };
	struct xyza_reply reply = { .kind = XYZA_REPLY_DONE, .order = XYZA_ORDER_DATA };
	static const struct {
		uint8_t object;
		enum db_recognised is;
	} cases[] = { { 7, DB_RECOGNISED_ANSWER },
		      { 9, DB_RECOGNISED_ANSWER },
		      { 8, DB_RECOGNISED_NOTHING } };

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		struct db_inquired found = { .parts = 0 };

		reply.object = cases[i].object;
		assert_int_equal(take(&inquiry, reply, &found), cases[i].is);
		assert_false(found.refused);
	}
	reply.kind = XYZA_REPLY_FAILED;
	reply.object = 7;
	{
		struct db_inquired found = { .parts = 0 };

		assert_int_equal(take(&inquiry, reply, &found), DB_RECOGNISED_ANSWER);
		assert_true(found.refused);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_question_is_about_its_controller),
		cmocka_unit_test(an_answer_is_from_the_controller_that_was_asked),
		cmocka_unit_test(a_new_number_may_answer_at_once),
	};

	return cmocka_run_group_tests_name("driver/xyza_inquiry", tests, NULL, NULL);
}
