/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The port of a serial CAN adapter against a hostile adapter: any bytes at any time, a serial line that
 * takes nothing or is lost, frames to send while the handshake goes on, in made-up time. The transport
 * itself is compiled in here, on a serial port that is the input.
 *
 * What must hold: it always wants to be called again later than now, tells only whole frames that the
 * filters pass, writes only lines that an adapter understands, and never sends a frame before it is
 * ready; once lost it stays lost; when the adapter behaves again, it becomes ready.
 */
#define db_serial_open fake_serial_open
#define db_serial_close fake_serial_close
#define db_serial_fd fake_serial_fd
#define db_serial_latency fake_serial_latency
#define db_serial_read fake_serial_read
#define db_serial_write fake_serial_write
#include "transport/slcan.c"

#include "input.h"

#define S DB_NS_PER_S
#define MS DB_NS_PER_MS
#define STEPS_MAX 400

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The line between port and adapter. */
struct db_serial {
	uint8_t in[1024]; /* for the port to read */
	size_t in_length;
	size_t room;       /* characters that the line takes now */
	int error;         /* it is lost with this negative errno */
	bool behaves;      /* the adapter understands everything and answers */
	bool cut;          /* it did not take the whole of what was written */
	bool sent_a_frame; /* the port did, since it was asked last */
	struct slcan_reader reader;
};

static struct db_serial line;

int fake_serial_open(const struct db_bus_config *config, struct db_serial **serial)
{
	(void)config;
	*serial = &line;
	return 0;
}

void fake_serial_close(struct db_serial *serial)
{
	(void)serial;
}

int fake_serial_fd(const struct db_serial *serial)
{
	(void)serial;
	return 0;
}

enum db_port_latency fake_serial_latency(const struct db_serial *serial)
{
	(void)serial;
	return DB_PORT_LATENCY_UNKNOWN;
}

ssize_t fake_serial_read(struct db_serial *serial, void *bytes, size_t size)
{
	size_t length = size < serial->in_length ? size : serial->in_length;

	if (serial->error != 0 && serial->in_length == 0)
		return serial->error;
	memcpy(bytes, serial->in, length);
	serial->in_length -= length;
	memmove(serial->in, serial->in + length, serial->in_length);
	return (ssize_t)length;
}

/* The adapter says something; what does not fit is lost. */
static void say(const uint8_t *bytes, size_t length)
{
	if (length > sizeof line.in - line.in_length)
		length = sizeof line.in - line.in_length;
	memcpy(line.in + line.in_length, bytes, length);
	line.in_length += length;
}

static void reply(const struct slcan_command *command)
{
	struct slcan_reply answer = { .kind = SLCAN_REPLY_DONE };
	char text[SLCAN_LINE_MAX];
	int length;

	if (command->verb == SLCAN_FLAGS)
		answer.kind = SLCAN_REPLY_FLAGS;
	if (command->verb == SLCAN_SEND) {
		answer.kind = SLCAN_REPLY_SENT;
		answer.extended = command->frame.id & DB_CAN_EXTENDED;
	}
	length = slcan_encode_reply(&answer, text, sizeof text);
	must(length > 0);
	say((const uint8_t *)text, (size_t)length);
}

/* Every line that the port writes is a command, or an empty one. */
static void hear(uint8_t byte)
{
	struct slcan_command command;
	enum slcan_took took = slcan_take(&line.reader, byte);

	must(took != SLCAN_TOOK_SPOILT);
	if (took != SLCAN_TOOK_LINE)
		return;
	if (slcan_decode_command(line.reader.line, line.reader.length, &command) != SLCAN_OK) {
		/* Only the half of one whose rest is not to be sent any more. */
		must(line.cut);
		line.cut = false;
		return;
	}
	line.sent_a_frame = line.sent_a_frame || command.verb == SLCAN_SEND;
	if (line.behaves && command.verb != SLCAN_NOTHING)
		reply(&command);
}

ssize_t fake_serial_write(struct db_serial *serial, const void *bytes, size_t length)
{
	const uint8_t *text = bytes;

	if (serial->error != 0)
		return serial->error;
	line.cut = line.cut || length > serial->room;
	if (length > serial->room)
		length = serial->room;
	serial->room -= length;
	for (size_t i = 0; i < length; i++)
		hear(text[i]);
	return (ssize_t)length;
}

/* --- the port's owner ------------------------------------------------------------------------------ */

static const struct db_can_filter passing = { .id = DB_CAN_EXTENDED | 0x100,
	                                      .mask = DB_CAN_EXTENDED | 0x700 };

struct owner {
	struct db_port *port;
	bool filtered;
	bool lost;
	db_time now;
};

static void check_result(struct owner *owner, ssize_t result)
{
	must(!owner->lost || result < 0);
	owner->lost = owner->lost || result < 0;
}

static void take_frames(struct owner *owner)
{
	struct db_can_frame frames[8];
	ssize_t got = db_transport_slcan.read(owner->port, frames, sizeof frames, owner->now);

	check_result(owner, got);
	must(got < 0 || got % (ssize_t)sizeof frames[0] == 0);
	for (ssize_t i = 0; i < got / (ssize_t)sizeof frames[0]; i++) {
		must(frames[i].length <= DB_CAN_DATA_MAX && !(frames[i].id & DB_CAN_ERROR));
		must(!owner->filtered || db_can_filter_passes(&passing, 1, &frames[i]));
	}
}

static void send_frames(struct owner *owner, struct input *input)
{
	struct db_can_frame frames[4] = { { .id = 0 } };
	size_t count = 1 + input_below(input, 4);
	bool up = db_transport_slcan.health(owner->port)->up;
	ssize_t sent;

	for (size_t i = 0; i < count; i++) {
		frames[i].id = input_u16(input) & DB_CAN_STANDARD_MASK;
		if (input_u8(input) & 1)
			frames[i].id |= DB_CAN_EXTENDED | 0x10000;
		frames[i].length = input_u8(input) % 9;
	}
	sent = db_transport_slcan.write(owner->port, frames, count * sizeof frames[0], owner->now);
	check_result(owner, sent);
	must(sent <= 0 || (up && sent % (ssize_t)sizeof frames[0] == 0));
	must(sent <= (ssize_t)(count * sizeof frames[0]));
}

static db_time run_port(struct owner *owner)
{
	int error = 0;
	db_time next = db_transport_slcan.run(owner->port, owner->now, &error);

	check_result(owner, error);
	must(owner->lost || next > owner->now);
	return next;
}

static void pass(struct owner *owner, db_time span)
{
	db_time end = owner->now + span;

	while (owner->now < end && !owner->lost) {
		db_time next = run_port(owner);

		take_frames(owner);
		owner->now = next < end ? next : end;
	}
}

static void act(struct owner *owner, struct input *input)
{
	static const char *const lines[] = { "\r",           "\a",      "z\r",   "Z\r",
		                             "F00\r",        "FA1\r",   "F20\r", "t10021122\r",
		                             "T000001000\r", "V1013\r", "F04\r" };
	const uint8_t *bytes;
	size_t length;
	uint8_t choice = input_u8(input);

	switch (choice % 8) {
	case 0:
	case 1:
		choice /= 8;
		say((const uint8_t *)lines[choice % 11], strlen(lines[choice % 11]));
		break;
	case 2:
		length = input_bytes(input, choice / 8, &bytes);
		say(bytes, length);
		break;
	case 3:
		line.room = choice / 8 < 24 ? 4096 : choice % 24;
		break;
	case 4:
		send_frames(owner, input);
		break;
	case 5:
		take_frames(owner);
		break;
	case 6:
		line.behaves = choice & 8;
		break;
	default:
		pass(owner, (1 + choice / 8) * 12 * MS);
		break;
	}
	/* What was not ready must not have let a frame through. */
	must(!line.sent_a_frame || db_transport_slcan.health(owner->port)->bitrate != 0);
	line.sent_a_frame = false;
}

static void recover(struct owner *owner)
{
	db_time end = owner->now + 30 * S;

	line.behaves = true;
	while (!owner->lost && !db_transport_slcan.health(owner->port)->up) {
		must(owner->now < end);
		line.room = 4096;
		pass(owner, 10 * MS);
	}
}

/* The adapter is unplugged. */
static void be_lost(struct owner *owner)
{
	line.in_length = 0;
	line.error = -EIO;
	pass(owner, 2 * S);
	must(owner->lost);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static const unsigned rates[] = { 1000000, 500000, 125000 };
	struct input input = { data, size };
	uint8_t choice = input_u8(&input);
	const struct db_bus_config bus = { .baud = 115200,
		                           .stop_bits = 1,
		                           .bitrate = rates[choice % 3] };
	struct owner owner = { .filtered = choice & 4, .now = 1000 * S };

	line = (struct db_serial){ .room = 4096 };
	must(db_transport_slcan.open(&bus, &passing, owner.filtered, owner.now, &owner.port) == 0);
	for (unsigned i = 0; i < STEPS_MAX && input.left > 0 && !owner.lost; i++)
		act(&owner, &input);
	if (choice & 8)
		be_lost(&owner);
	else
		recover(&owner);
	db_transport_slcan.close(owner.port);
	return 0;
}
