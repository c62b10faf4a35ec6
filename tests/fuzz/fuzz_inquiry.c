/* SPDX-License-Identifier: Apache-2.0 */
/* Inquiries of every family: whatever comes as an answer stays inside its buffer, ends, and is text. */
#include "codec/can.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"
#include "fakes/options.h"
#include "fuzz/input.h"

#include <math.h>

static void cut_frame(const struct db_driver *driver, const struct db_exchange *question,
                      const struct input *input, size_t *skip, size_t *length)
{
	const struct db_received received = {
		.bytes = input->bytes,
		.available = input->left,
		.question = question->request,
		.question_length = question->request_length,
	};

	if (driver->cut)
		driver->cut(&received, skip, length);
	else
		db_can_cut(received.bytes, received.available, skip, length);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static struct db_bus_config bus_of(const struct db_driver *driver)
{
	static struct fake_options options;
	struct db_bus_config bus = {
		.driver = driver, .baud = 9600, .bitrate = 500000, .options = options.bus
	};

	fake_preset_options(driver, &options);
	return bus;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct input input = { .bytes = data, .left = size };
	size_t families = 0;

	while (db_drivers[families])
		families++;
	{
		const struct db_driver *driver = db_drivers[input_u8(&input) % families];
		const struct db_bus_config bus = bus_of(driver);
		struct db_inquiry inquiry = {
			.kind = (enum db_inquiry_kind)(input_u8(&input) % (DB_INQUIRY_SAVE + 1)),
			.address = input_u8(&input),
			.value = input_u8(&input),
		};
		uint8_t request[DB_REQUEST_MAX];
		struct db_exchange exchange = { .request = request,
			                        .request_size = sizeof request };
		struct db_inquired said = { .parts = 0 };
		unsigned answers = 0;
		size_t skip = 0;
		size_t length = 0;

		if (!driver->inquire || !driver->inquire(&bus, &inquiry, &exchange))
			return 0;
		must(exchange.request_length > 0 && exchange.request_length <= sizeof request);
		do {
			int address;

			cut_frame(driver, &exchange, &input, &skip, &length);
			must(skip + length <= input.left);
			input.bytes += skip;
			input.left -= skip;
			if (length > 0 &&
			    (!driver->accept ||
			     driver->accept(&bus, input.bytes, length, &address) == DB_FRAME_GOOD))
				answers += driver->recognise(&bus, &inquiry, input.bytes, length,
				                             &said) == DB_RECOGNISED_ANSWER;
			input.bytes += length;
			input.left -= length;
		} while (length > 0);
		/* The first whole answer is one; what comes behind is one more of the same. */
		must(answers <= 1);
		must(memchr(said.identity, '\0', sizeof said.identity) != NULL);
	}
	return 0;
}
