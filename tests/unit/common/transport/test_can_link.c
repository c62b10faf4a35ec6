/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/transport_private.h"

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

/* A link message as the kernel builds it, attribute by attribute. */
struct message {
	uint8_t bytes[256];
	size_t length;
};

static size_t begin(struct message *message, uint16_t type)
{
	const struct nlattr head = { .nla_len = sizeof head, .nla_type = type };
	size_t start = message->length;

	memcpy(message->bytes + start, &head, sizeof head);
	message->length += sizeof head;
	return start;
}

static void end(struct message *message, size_t start)
{
	const uint16_t length = (uint16_t)(message->length - start);

	memcpy(message->bytes + start, &length, sizeof length);
	message->length = (message->length + 3) & ~(size_t)3;
}

static void add(struct message *message, uint16_t type, const void *content, size_t length)
{
	size_t start = begin(message, type);

	memcpy(message->bytes + message->length, content, length);
	message->length += length;
	end(message, start);
}

static void start(struct message *message)
{
	memset(message, 0, sizeof *message);
	message->length = sizeof(struct nlmsghdr) + sizeof(struct ifinfomsg);
	add(message, IFLA_IFNAME, "can0", 5);
}

static void finish(struct message *message)
{
	const struct nlmsghdr head = { .nlmsg_len = (uint32_t)message->length,
		                       .nlmsg_type = RTM_NEWLINK };

	memcpy(message->bytes, &head, sizeof head);
}

/* 250 kbit/s, bus off */
static void make_can_link(struct message *message, const char *kind)
{
	const struct can_bittiming timing = { .bitrate = 250000, .sample_point = 875 };
	const uint32_t state = CAN_STATE_BUS_OFF;
	size_t info;
	size_t data;

	start(message);
	info = begin(message, IFLA_LINKINFO);
	add(message, IFLA_INFO_KIND, kind, strlen(kind) + 1);
	data = begin(message, IFLA_INFO_DATA | NLA_F_NESTED);
	add(message, IFLA_CAN_STATE, &state, sizeof state);
	add(message, IFLA_CAN_BITTIMING, &timing, sizeof timing);
	end(message, data);
	end(message, info);
	finish(message);
}

static void bit_rate_and_state_are_found(void **state)
{
	struct message message;
	struct db_can_link link;

	(void)state;
	make_can_link(&message, "can");
	assert_true(db_can_link_parse(message.bytes, message.length, &link));
	assert_int_equal(link.bitrate, 250000);
	assert_true(link.has_state);
	assert_int_equal(link.state, CAN_STATE_BUS_OFF);
}

/* Other kinds number their own attributes alike. */
static void other_kinds_of_links_tell_nothing(void **state)
{
	struct message message;
	struct db_can_link link;

	(void)state;
	make_can_link(&message, "vcan");
	assert_true(db_can_link_parse(message.bytes, message.length, &link));
	assert_int_equal(link.bitrate, 0);
	assert_false(link.has_state);
	start(&message);
	finish(&message);
	assert_true(db_can_link_parse(message.bytes, message.length, &link));
	assert_int_equal(link.bitrate, 0);
}

static void other_messages_and_cut_ones_are_refused(void **state)
{
	const uint16_t done = NLMSG_ERROR;
	struct message message;
	struct db_can_link link;

	(void)state;
	make_can_link(&message, "can");
	for (size_t length = 0; length < message.length; length++)
		assert_false(db_can_link_parse(message.bytes, length, &link));
	memcpy(message.bytes + offsetof(struct nlmsghdr, nlmsg_type), &done, sizeof done);
	assert_false(db_can_link_parse(message.bytes, message.length, &link));
}

/* Lengths inside that lead outside end the search; memory tools see it when they do not. */
static void wrong_lengths_inside_end_the_search(void **state)
{
	const size_t name = sizeof(struct nlmsghdr) + sizeof(struct ifinfomsg);
	const uint16_t wrong[] = { 0, 1, 3, 0x7FFF, 0xFFFF };
	struct message message;
	struct db_can_link link;

	(void)state;
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
		for (size_t at = name; at < sizeof message.bytes - 2; at += 4) {
			uint8_t *exact;

			make_can_link(&message, "can");
			memcpy(message.bytes + at, &wrong[i], sizeof wrong[i]);
			exact = test_malloc(message.length);
			memcpy(exact, message.bytes, message.length);
			assert_true(db_can_link_parse(exact, message.length, &link));
			/* The first attribute's length hides all behind it. */
			if (at == name)
				assert_int_equal(link.bitrate, 0);
			test_free(exact);
		}
	}
}

static void a_link_that_is_not_can_is_answered_for(void **state)
{
	struct db_can_link link = { .bitrate = 1, .has_state = true };

	(void)state;
	assert_true(db_can_link_read(if_nametoindex("lo"), &link));
	assert_int_equal(link.bitrate, 0);
	assert_false(link.has_state);
	assert_false(db_can_link_read(0x7FFFFFFF, &link));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(bit_rate_and_state_are_found),
		cmocka_unit_test(other_kinds_of_links_tell_nothing),
		cmocka_unit_test(other_messages_and_cut_ones_are_refused),
		cmocka_unit_test(wrong_lengths_inside_end_the_search),
		cmocka_unit_test(a_link_that_is_not_can_is_answered_for),
	};

	return cmocka_run_group_tests_name("CAN link", tests, NULL, NULL);
}
