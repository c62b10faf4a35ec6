/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A CAN interface of the kernel: error frames and other frames in any order, sockets that fail, and what
 * the kernel answers over netlink about the controller. The transport itself is compiled in here, on a
 * pair of sockets instead of an interface; the answers over netlink are the input's.
 *
 * What must hold: nothing that is no frame of the bus is handed over; nothing is written while bus off;
 * counters never fall; it is up exactly when no error is told; a lost port stays lost.
 */
#define db_can_link_read fake_link_read
#include "transport/socketcan.c"

#include "input.h"

#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>

#define STEPS_MAX 200

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What the kernel would answer now. */
static struct {
	const uint8_t *bytes;
	size_t length;
} netlink;

bool fake_link_read(unsigned index, struct db_can_link *link)
{
	(void)index;
	*link = (struct db_can_link){ 0 };
	return netlink.length > 0 && db_can_link_parse(netlink.bytes, netlink.length, link);
}

struct bench {
	struct db_port *port;
	int bus; /* the other end */
	db_time now;
	struct db_port_health before;
	bool lost;
};

static void check_health(struct bench *bench)
{
	const struct db_port_health *health = db_transport_socketcan.health(bench->port);

	must(health->up == (health->error == 0));
	must(!health->up || health->error != ENETRESET);
	must(health->bus_offs >= bench->before.bus_offs &&
	     health->error_passives >= bench->before.error_passives &&
	     health->arbitration_lost >= bench->before.arbitration_lost &&
	     health->line_errors >= bench->before.line_errors &&
	     health->overflows >= bench->before.overflows);
	bench->before = *health;
}

static void from_bus(struct bench *bench, struct input *input, bool error)
{
	struct db_can_frame frame = { .id = 0 };
	const uint8_t *bytes;
	size_t length = input_bytes(input, sizeof frame, &bytes);

	memcpy(&frame, bytes, length);
	frame.length %= 9;
	if (error)
		frame.id = (frame.id & 0x3FF) | DB_CAN_ERROR;
	(void)!send(bench->bus, &frame, sizeof frame, MSG_DONTWAIT | MSG_NOSIGNAL);
}

static void take_frames(struct bench *bench)
{
	struct db_can_frame frames[3];
	ssize_t got = db_transport_socketcan.read(bench->port, frames, sizeof frames, bench->now);

	must(!bench->lost || got < 0);
	must(got < 0 || got % (ssize_t)sizeof frames[0] == 0);
	for (ssize_t i = 0; i < got / (ssize_t)sizeof frames[0]; i++)
		must(!(frames[i].id & DB_CAN_ERROR) && frames[i].length <= DB_CAN_DATA_MAX);
	bench->lost = bench->lost || got < 0;
}

static void send_frames(struct bench *bench)
{
	const struct db_can_frame frames[2] = { { .id = 1 }, { .id = 2 } };
	bool up = db_transport_socketcan.health(bench->port)->up;
	ssize_t sent = db_transport_socketcan.write(bench->port, frames, sizeof frames, bench->now);

	must(!bench->lost || sent < 0);
	must(sent < 0 || sent % (ssize_t)sizeof frames[0] == 0);
	must(up || sent <= 0);
	bench->lost = bench->lost || sent < 0;
}

static void run_port(struct bench *bench, struct input *input)
{
	const struct db_port_health *health = db_transport_socketcan.health(bench->port);
	db_time next;
	int error;

	bench->now += input_u8(input) * 20 * DB_NS_PER_MS;
	next = db_transport_socketcan.run(bench->port, bench->now, &error);
	must(next > bench->now);
	must(!bench->lost || error < 0);
	/* Whoever is bus off is looked after. */
	must(health->up || next < DB_TIME_NEVER);
}

/* A message as the kernel builds it, with the input's content. */
static size_t make_link(struct input *input, uint8_t *message)
{
	const uint32_t state = input_u8(input) % 8;
	const struct can_bittiming timing = { .bitrate = input_u32(input) };
	struct nlattr data = { .nla_type = IFLA_INFO_DATA };
	struct nlattr info = { .nla_type = IFLA_LINKINFO };
	const struct nlattr kind = { .nla_len = sizeof kind + 4, .nla_type = IFLA_INFO_KIND };
	const struct nlattr bits = { .nla_len = sizeof bits + sizeof timing,
		                     .nla_type = IFLA_CAN_BITTIMING };
	const struct nlattr word = { .nla_len = sizeof word + sizeof state,
		                     .nla_type = IFLA_CAN_STATE };
	struct nlmsghdr head = { .nlmsg_type = RTM_NEWLINK };
	const struct ifinfomsg link = { .ifi_index = 1 };
	size_t length = 0;

	data.nla_len = (uint16_t)(sizeof data + bits.nla_len + word.nla_len);
	info.nla_len = (uint16_t)(sizeof info + kind.nla_len + data.nla_len);
	head.nlmsg_len = (uint32_t)(sizeof head + sizeof link + info.nla_len);
#define PUT(thing)                                         \
	memcpy(message + length, &(thing), sizeof(thing)); \
	length += sizeof(thing)
	PUT(head);
	PUT(link);
	PUT(info);
	PUT(kind);
	memcpy(message + length, "can", 4);
	length += 4;
	PUT(data);
	PUT(bits);
	PUT(timing);
	PUT(word);
	PUT(state);
#undef PUT
	must(length == head.nlmsg_len);
	return length;
}

/* The message, whole or with some bytes that the input has changed. */
static void set_link(struct input *input)
{
	static uint8_t message[512];
	uint8_t changes = input_u8(input) % 8;

	netlink.length = make_link(input, message);
	for (unsigned i = 0; i < changes; i++)
		message[input_u8(input) % netlink.length] = input_u8(input);
	netlink.bytes = message;
	if (changes == 7)
		netlink.length = input_u8(input);
}

static void act(struct bench *bench, struct input *input)
{
	switch (input_u8(input) % 8) {
	case 0:
	case 1:
		from_bus(bench, input, true);
		break;
	case 2:
		from_bus(bench, input, false);
		break;
	case 3:
		take_frames(bench);
		break;
	case 4:
		send_frames(bench);
		break;
	case 5:
		run_port(bench, input);
		break;
	case 6:
		set_link(input);
		break;
	default:
		/* The other side goes, or says what is no frame. */
		if (input_u8(input) % 4 == 0)
			shutdown(bench->bus, SHUT_RDWR);
		else
			(void)!send(bench->bus, "x", 1, MSG_DONTWAIT | MSG_NOSIGNAL);
		break;
	}
	check_health(bench);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct input input = { data, size };
	struct bench bench = { .now = DB_NS_PER_S };
	struct db_can_link link;
	int pair[2];

	/* As a message by itself, too. */
	if (db_can_link_parse(data, size, &link))
		must(size >= sizeof(struct nlmsghdr));
	netlink.length = 0;
	must(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair) == 0);
	bench.port = calloc(1, sizeof *bench.port);
	must(bench.port);
	*bench.port = (struct db_port){
		.fd = pair[0], .index = 1, .ask_state_at = DB_TIME_NEVER, .health = { .up = true }
	};
	bench.bus = pair[1];
	if (input_u8(&input) & 1)
		set_link(&input);
	note_link(bench.port, bench.now);
	for (unsigned i = 0; i < STEPS_MAX && input.left > 0; i++)
		act(&bench, &input);
	db_transport_socketcan.close(bench.port);
	close(bench.bus);
	return 0;
}
