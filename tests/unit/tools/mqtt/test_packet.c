/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/packet.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

struct example {
	const char *what;
	const char *bytes; /* hexadecimal */
	enum db_mqtt_verdict verdict;
	enum db_mqtt_verdict old; /* with MQTT 3.1.1 */
};

#define PART DB_MQTT_PACKET_PART
#define WHOLE DB_MQTT_PACKET_WHOLE
#define WRONG DB_MQTT_PACKET_WRONG

/* clang-format off */
static const struct example examples[] = {
	{ "nothing", "", PART, PART },
	{ "a first byte", "30", PART, PART },
	{ "half a length", "30ff", PART, PART },
	{ "a length that does not end", "30ffffffff01", WRONG, WRONG },
	{ "longer than was agreed", "30fdff7f", WRONG, WRONG },
	{ "the connection is taken", "2003000000", WHOLE, WHOLE },
	{ "... by a broker of 3.1.1", "20020001", WHOLE, WHOLE },
	{ "... with properties", "20080000052700004000", WHOLE, WHOLE },
	{ "... with one that there is not", "2005000002 7f01", WRONG, WHOLE },
	{ "... with one that is cut", "20050000022700", WRONG, WHOLE },
	{ "... cut itself", "200100", WRONG, WRONG },
	{ "a message", "30050001610078", WHOLE, WHOLE },
	{ "... that is not whole yet", "300500016100", PART, PART },
	{ "... with a property that there is not", "3006000161027f01", WRONG, WHOLE },
	{ "... with one of two bytes that is none", "30070001610380017f", WRONG, WHOLE },
	{ "... with a subscription's number", "3006000161020b01", WHOLE, WHOLE },
	{ "... with a longer one", "3009000161050bffffff7f", WHOLE, WHOLE },
	{ "... with one that is too long", "300a000161060bffffffff01", WRONG, WHOLE },
	{ "... with a user property", "300b00016107260001610001 62", WHOLE, WHOLE },
	{ "... with half of one", "3008000161042600 0161", WRONG, WHOLE },
	{ "... with properties longer than itself", "3006000161030b01", WRONG, WHOLE },
	{ "... whose topic is longer than itself", "3004000a6100", WRONG, WRONG },
	{ "... confirmed", "3206000161000700", WHOLE, WHOLE },
	{ "... confirmed, without a number", "3203000161", WRONG, WRONG },
	{ "... of a quality that there is not", "3606000161000700", WRONG, WRONG },
	{ "a confirmation", "40020001", WHOLE, WHOLE },
	{ "... with a reason", "4003000110", WHOLE, WHOLE },
	{ "... and no properties", "400400011000", WHOLE, WHOLE },
	{ "... and one that there is not", "4006000110027f01", WRONG, WHOLE },
	{ "... without a number", "400100", WRONG, WRONG },
	{ "other confirmations", "50020001", WHOLE, WHOLE },
	{ "other confirmations", "62020001", WHOLE, WHOLE },
	{ "other confirmations", "70020001", WHOLE, WHOLE },
	{ "a subscription is taken", "900400010001", WHOLE, WHOLE },
	{ "... without properties", "90020001", WRONG, WHOLE },
	{ "... with one that there is not", "90060001027f0101", WRONG, WHOLE },
	{ "an answer to a ping", "d000", WHOLE, WHOLE },
	{ "... that says something", "d00100", WRONG, WRONG },
	{ "an end", "e000", WHOLE, WRONG },
	{ "... with a reason", "e0018e", WHOLE, WRONG },
	{ "... in words", "e0068e041f000161", WHOLE, WRONG },
	{ "... in words that are cut", "e0058e031f0005", WRONG, WRONG },
	{ "an authentication that was not offered", "f000", WRONG, WRONG },
	{ "what clients send", "1000", WRONG, WRONG },
	{ "what clients send", "82050001000000", WRONG, WRONG },
	{ "what clients send", "c000", WRONG, WRONG },
	{ "what nobody sends", "0000", WRONG, WRONG },
};
/* clang-format on */

static size_t read_bytes(const char *text, uint8_t *bytes)
{
	size_t count = 0;
	unsigned byte;

	for (; *text; text++) {
		if (*text == ' ')
			continue;
		assert_int_equal(sscanf(text, "%2x", &byte), 1);
		bytes[count++] = (uint8_t)byte;
		text++;
	}
	return count;
}

static void packets_of_every_kind(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(examples) / sizeof(examples[0]); i++) {
		const struct example *example = &examples[i];
		uint8_t bytes[64];
		size_t count = read_bytes(example->bytes, bytes);
		size_t length;

		if (db_mqtt_packet_check(bytes, count, true, &length) != example->verdict ||
		    db_mqtt_packet_check(bytes, count, false, &length) != example->old)
			fail_msg("%s: %s", example->what, example->bytes);
	}
}

/* One after the other out of a stream, and none before its last byte. */
static void packets_behind_each_other(void **state)
{
	uint8_t bytes[64];
	size_t count = read_bytes("2003000000 3006000161020b01 d000", bytes);
	size_t length;

	(void)state;
	for (size_t at = 0, end = 5; at < count; at = end, end = at == 5 ? 13 : 15) {
		for (size_t some = at; some < end; some++)
			assert_int_equal(db_mqtt_packet_check(bytes + at, some - at, true, &length),
			                 DB_MQTT_PACKET_PART);
		assert_int_equal(db_mqtt_packet_check(bytes + at, count - at, true, &length),
		                 DB_MQTT_PACKET_WHOLE);
		assert_int_equal(length, end - at);
	}
}

static void the_longest_one(void **state)
{
	static uint8_t bytes[DB_MQTT_PACKET_MAX + 1];
	size_t body = DB_MQTT_PACKET_MAX - 4;
	size_t length;

	(void)state;
	bytes[0] = 0x30;
	bytes[1] = (uint8_t)(body | 0x80);
	bytes[2] = (uint8_t)(body >> 7 | 0x80);
	bytes[3] = (uint8_t)(body >> 14);
	assert_int_equal(db_mqtt_packet_check(bytes, DB_MQTT_PACKET_MAX, true, &length),
	                 DB_MQTT_PACKET_WHOLE);
	assert_int_equal(length, DB_MQTT_PACKET_MAX);
	bytes[1]++;
	assert_int_equal(db_mqtt_packet_check(bytes, 4, true, &length), DB_MQTT_PACKET_WRONG);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(packets_of_every_kind),
		cmocka_unit_test(packets_behind_each_other),
		cmocka_unit_test(the_longest_one),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
