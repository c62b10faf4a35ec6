/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

#include "codec/xyza.h"

/* False: no such inquiry. The document has no identity and no baud rate, and writes need no
 * save. */
static bool request_of(const struct db_inquiry *inquiry, struct xyza_request *request)
{
	*request = (struct xyza_request){ .object = (uint8_t)inquiry->address };
	switch (inquiry->kind) {
	case DB_INQUIRY_THERE:
		request->verb = XYZA_VERB_ONLINE;
		return true;
	case DB_INQUIRY_STANDING:
		request->verb = XYZA_READ_STANDING;
		request->axis = (enum xyza_axis)inquiry->value;
		return inquiry->value < XYZA_AXIS_COUNT;
	case DB_INQUIRY_SET_ADDRESS:
		request->verb = XYZA_WRITE_ITEM;
		request->item = XYZA_ITEM_SLAVE_NUMBER;
		request->value = inquiry->value;
		return inquiry->value >= 1 && inquiry->value <= XYZA_OBJECT_MAX;
	default:
		return false;
	}
}

bool xyza_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                  struct db_exchange *exchange)
{
	struct xyza_request request;
	int length;

	(void)bus;
	if (inquiry->address < 1 || inquiry->address > XYZA_OBJECT_MAX ||
	    !request_of(inquiry, &request))
		return false;
	length = xyza_encode_request(&request, exchange->request, exchange->request_size);
	if (length < 0)
		return false;
	exchange->request_length = (size_t)length;
	exchange->answer_length = xyza_reply_length(request.verb);
	exchange->extra_time = 0;
	return true;
}

enum db_recognised xyza_recognise(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                                  const uint8_t *frame, size_t length, struct db_inquired *found)
{
	struct xyza_request request;
	struct xyza_reply reply;
	bool fits;

	(void)bus;
	if (!request_of(inquiry, &request) || xyza_decode_reply(frame, length, &reply) != XYZA_OK)
		return DB_RECOGNISED_NOTHING;
	fits = xyza_fits(&request, &reply);
	/* A controller that accepts its new number at once may already answer with it. */
	if (!fits && inquiry->kind == DB_INQUIRY_SET_ADDRESS) {
		request.object = (uint8_t)inquiry->value;
		fits = xyza_fits(&request, &reply);
	}
	if (!fits)
		return DB_RECOGNISED_NOTHING;
	if (found->parts > 0)
		return DB_RECOGNISED_AGAIN;
	found->parts = 1;
	found->refused = reply.kind == XYZA_REPLY_FAILED;
	if (inquiry->kind == DB_INQUIRY_STANDING && reply.kind == XYZA_REPLY_DATA) {
		found->tells_standing = true;
		found->stands = reply.value == 1;
	}
	return DB_RECOGNISED_ANSWER;
}
