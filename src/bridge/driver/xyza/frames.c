/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

#include "codec/xyza_frames.h"

#include <string.h>

enum db_step xyza_send(struct db_conversation *talk, struct xyza_request request, bool repeatable)
{
	struct db_exchange *exchange = talk->exchange;
	int length;

	request.object = talk->device->object;
	if (talk->job->kind == DB_JOB_POLL)
		talk->device->poll_request = request;
	length = xyza_encode_request(&request, exchange->request, exchange->request_size);
	if (length < 0)
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	exchange->request_length = (size_t)length;
	exchange->answer_length = xyza_reply_length(request.verb);
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
	exchange->also_from = xyza_new_number(&request);
	return DB_STEP_SEND;
}

unsigned xyza_new_number(const struct xyza_request *request)
{
	return request->verb == XYZA_WRITE_ITEM && request->item == XYZA_ITEM_SLAVE_NUMBER ?
	               request->value :
	               0;
}

/* --- raw frames ------------------------------------------------------------------------------- */

int xyza_write_raw(const struct db_args *args, uint8_t object, uint8_t *frame, size_t size)
{
	uint8_t content[2 * DB_RAW_REQUEST_WORDS];

	if (args->raw_length > sizeof(content))
		return XYZA_ERR_FORM;
	for (size_t i = 0; i < sizeof(content); i++)
		content[i] = (uint8_t)(args->raw_request[i / 2] >> (i % 2 == 0 ? 8 : 0));
	return xyza_encode_raw(content, args->raw_length, object, frame, size);
}

static void show_answer(struct db_device *device, const uint8_t *frame, size_t length)
{
	struct db_nameplate *plate = &device->plate;

	memset(plate->raw_answer, 0, sizeof(plate->raw_answer));
	for (size_t i = 0; i < length; i++)
		plate->raw_answer[i / 2] |= (uint16_t)(frame[i] << (i % 2 == 0 ? 8 : 0));
	plate->raw_length = (uint16_t)length;
	plate->generation++;
}

/* Its effect is not known, so it is sent once. */
enum db_step xyza_begin_raw(struct db_conversation *talk)
{
	struct db_exchange *exchange = talk->exchange;
	int length = xyza_write_raw(talk->job->request->args, talk->device->object,
	                            exchange->request, exchange->request_size);

	show_answer(talk->device, NULL, 0);
	if (length < 0)
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	exchange->request_length = (size_t)length;
	exchange->answer_length = XYZA_FRAME_MAX;
	exchange->extra_time = 0;
	exchange->repeatable = false;
	exchange->also_from = 0;
	return DB_STEP_SEND;
}

/* It may have changed anything. An acknowledgement shows nothing about that. */
enum db_step xyza_answer_raw(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	const struct db_exchange *exchange = talk->exchange;
	struct xyza_request said;
	bool failed;
	bool shows;

	if (!xyza_raw_fits(exchange->request, frame, length, &failed, &shows))
		return DB_STEP_IGNORE;
	show_answer(talk->device, frame, length);
	if (xyza_decode_request(exchange->request, exchange->request_length, &said) != XYZA_OK ||
	    !xyza_is_read(said.verb))
		xyza_forget_all(talk->device->first);
	talk->device->refused = failed;
	return end_job(talk, failed ? DB_RESULT_REFUSED :
	                     shows  ? DB_RESULT_OK :
	                              DB_RESULT_UNPROVEN);
}
