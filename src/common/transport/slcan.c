/* SPDX-License-Identifier: Apache-2.0 */
/* A CAN adapter on a serial port that uses the LAWICEL protocol. */
#include "codec/slcan.h"

#include "drivebridge/transport.h"
#include "transport/serial.h"
#include "transport/transport_private.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define FRAME_SIZE sizeof(struct db_can_frame)

/* The handshake: the time-out of a step, and the silence after which the adapter is taken to have
 * finished (USB serial chips delay characters by 16 ms). */
#define STEP_TIME (300 * DB_NS_PER_MS)
#define QUIET_TIME (50 * DB_NS_PER_MS)

/* After this number of failed handshakes the port is given up: opening it again may help. Some
 * adapters are reset by opening and need seconds until they answer. */
#define ATTEMPTS 10

/* How long a channel that was closed because of errors stays closed. */
#define RESTART_TIME (500 * DB_NS_PER_MS)

#define STATUS_INTERVAL DB_NS_PER_S
#define STATUS_TIME STEP_TIME
#define STATUS_SILENCES 3 /* unanswered status requests in a row */

/* After this number of refused frames in a row, the adapter's status is read. */
#define REFUSED_IN_A_ROW 3

/* Lines for which the serial port had no room are tried again after this time. */
#define FLUSH_RETRY DB_NS_PER_MS

/* Room for a few lines only: what waits here cannot be taken back. */
#define OUT_SIZE (8 * SLCAN_LINE_MAX)

#define SHORTEST_FRAME_LINE 6 /* t, three digits of id, length, carriage return */
#define READ_MAX 4096         /* bytes in one call: an adapter may send all the time */

enum step { STEP_FLUSH, STEP_CLOSE, STEP_RATE, STEP_TIMESTAMPS, STEP_OPEN, STEP_READY };

struct db_port {
	struct db_serial *serial;
	struct slcan_reader reader;
	struct db_can_filter *filters;
	size_t filter_count;
	bool passes_all;
	int lost; /* negative errno */
	struct db_port_health health;
	uint32_t bitrate;

	enum step step;
	db_time step_ends; /* latest end of the step */
	db_time quiet_at;  /* when flushing */
	unsigned attempts;
	bool timestamps_settled; /* set once per opening: some adapters store it in an EEPROM */

	bool acknowledges;   /* it acknowledges accepted frames; some adapters never do */
	unsigned unanswered; /* frames sent that were neither taken nor refused, as far as known */
	unsigned refused_in_a_row;

	bool status_known;   /* it has answered F once */
	bool status_useless; /* it never did */
	bool status_asked;
	unsigned before_status; /* number of unanswered frames sent before the status request */
	unsigned status_silences;
	db_time status_at; /* when to ask, or the time-out of the answer */

	char out[OUT_SIZE];
	size_t out_length;
};

/* --- sending ---------------------------------------------------------------------------------- */

static void flush(struct db_port *port)
{
	ssize_t sent;

	if (port->out_length == 0 || port->lost != 0)
		return;
	sent = db_serial_write(port->serial, port->out, port->out_length);
	if (sent < 0) {
		port->lost = (int)sent;
		return;
	}
	port->out_length -= (size_t)sent;
	memmove(port->out, port->out + sent, port->out_length);
}

static bool has_room(const struct db_port *port)
{
	return sizeof(port->out) - port->out_length >= SLCAN_LINE_MAX;
}

/* Whole lines only; false when there is no such line or no room. */
static bool send_line(struct db_port *port, const struct slcan_command *command)
{
	int length = slcan_encode_command(command, port->out + port->out_length,
	                                  sizeof(port->out) - port->out_length);

	if (length < 0)
		return false;
	port->out_length += (size_t)length;
	return true;
}

static void send_verb(struct db_port *port, enum slcan_verb verb, int digit)
{
	const struct slcan_command command = { .verb = verb, .digit = (uint8_t)digit };

	send_line(port, &command);
	flush(port);
}

/* --- the handshake ---------------------------------------------------------------------------- */

static void start_flush(struct db_port *port, db_time pause, db_time now)
{
	port->step = STEP_FLUSH;
	port->quiet_at = now + pause;
	port->step_ends = port->quiet_at + STEP_TIME;
	port->out_length = 0;
	/* Ends anything that the adapter has partly read. */
	for (unsigned i = 0; i < 3; i++)
		send_verb(port, SLCAN_NOTHING, 0);
}

static void enter(struct db_port *port, enum step step, db_time now)
{
	if (step == STEP_TIMESTAMPS && port->timestamps_settled)
		step = STEP_OPEN;
	port->step = step;
	port->step_ends = now + STEP_TIME;
	switch (step) {
	case STEP_CLOSE:
		send_verb(port, SLCAN_CLOSE, 0);
		break;
	case STEP_RATE:
		send_verb(port, SLCAN_SET_RATE, slcan_bitrate_digit(port->bitrate));
		break;
	case STEP_TIMESTAMPS:
		port->timestamps_settled = true;
		send_verb(port, SLCAN_TIMESTAMPS, 0);
		break;
	case STEP_OPEN:
		send_verb(port, SLCAN_OPEN, 0);
		break;
	default:
		port->step = STEP_READY;
		port->attempts = 0;
		port->unanswered = 0;
		port->refused_in_a_row = 0;
		port->status_asked = false;
		port->status_silences = 0;
		port->status_at = now + STATUS_INTERVAL;
		port->health.up = true;
		port->health.error = 0;
		port->health.error_warning = false;
		port->health.error_passive = false;
		port->health.bitrate = port->bitrate;
		break;
	}
}

static void start_over(struct db_port *port, int error, db_time now)
{
	port->health.error = error;
	port->attempts++;
	if (port->attempts >= ATTEMPTS)
		port->lost = -error;
	else
		start_flush(port, QUIET_TIME, now);
}

/* The channel is closed or the controller bus off: closing and opening it again helps. It is closed
 * at once, so that frames in the adapter are not sent at some later time. */
static void go_down(struct db_port *port, int error, db_time now)
{
	port->health.up = false;
	port->health.error = error;
	if (error == ENETRESET)
		port->health.bus_offs++;
	start_flush(port, RESTART_TIME, now);
	send_verb(port, SLCAN_CLOSE, 0);
}

/* --- status ----------------------------------------------------------------------------------- */

static void status_answered(struct db_port *port, db_time now)
{
	port->status_asked = false;
	/* Answers arrive in order: earlier frames without an answer will not be answered. */
	port->unanswered -= port->before_status;
	port->before_status = 0;
	port->status_at = now + STATUS_INTERVAL;
}

static void note_flags(struct db_port *port, uint8_t flags, db_time now)
{
	struct db_port_health *health = &port->health;
	bool passive = flags & SLCAN_ERROR_PASSIVE;

	status_answered(port, now);
	port->status_known = true;
	port->status_silences = 0;
	if (flags & (SLCAN_RX_FULL | SLCAN_DATA_OVERRUN))
		health->overflows++;
	if (flags & SLCAN_ARBITRATION_LOST)
		health->arbitration_lost++;
	if (flags & SLCAN_BUS_ERROR)
		health->line_errors++;
	if (passive && !health->error_passive)
		health->error_passives++;
	health->error_passive = passive;
	health->error_warning = passive || flags & SLCAN_ERROR_WARNING;
	if (port->refused_in_a_row >= REFUSED_IN_A_ROW) {
		port->refused_in_a_row = 0;
		if (flags & SLCAN_TX_FULL) {
			/* Busy; or no node acknowledges, and waiting frames would be sent at any
			 * later time. */
			if (flags & SLCAN_ERROR_PASSIVE)
				go_down(port, ENOBUFS, now);
		} else {
			go_down(port, flags & SLCAN_ERROR_PASSIVE ? ENETRESET : EPROTO, now);
		}
	}
}

static void run_status(struct db_port *port, db_time now)
{
	if (port->status_asked && now >= port->status_at) {
		bool in_vain;

		status_answered(port, now);
		in_vain = ++port->status_silences >= STATUS_SILENCES;
		if (port->refused_in_a_row >= REFUSED_IN_A_ROW)
			go_down(port, EPROTO, now);
		else if (in_vain && port->status_known)
			go_down(port, ETIMEDOUT, now);
		else if (in_vain)
			port->status_useless = true;
	} else if (!port->status_asked && !port->status_useless && now >= port->status_at) {
		if (!has_room(port)) {
			port->status_at = now + FLUSH_RETRY;
		} else {
			send_verb(port, SLCAN_FLAGS, 0);
			port->status_asked = true;
			port->before_status = port->unanswered;
			port->status_at = now + STATUS_TIME;
		}
	}
}

/* --- receiving -------------------------------------------------------------------------------- */

static void one_answered(struct db_port *port)
{
	if (port->unanswered > 0)
		port->unanswered--;
	if (port->before_status > 0)
		port->before_status--;
}

/* True when it is a frame to be returned. */
static bool ready_reply(struct db_port *port, const struct slcan_reply *reply, db_time now)
{
	switch (reply->kind) {
	case SLCAN_REPLY_FRAME:
		return port->passes_all ||
		       db_can_filter_passes(port->filters, port->filter_count, &reply->frame);
	case SLCAN_REPLY_SENT:
	case SLCAN_REPLY_DONE:
		port->acknowledges = true;
		port->refused_in_a_row = 0;
		one_answered(port);
		return false;
	case SLCAN_REPLY_REFUSED:
		/* It does not show what was refused: answers arrive in order. */
		if (!port->status_asked || (port->before_status > 0 && port->acknowledges)) {
			port->health.refused++;
			port->refused_in_a_row++;
			one_answered(port);
			if (port->refused_in_a_row == REFUSED_IN_A_ROW && !port->status_asked) {
				port->status_useless = false;
				port->status_at = now;
			}
			return false;
		}
		/* The status: the channel is not open any more, or the adapter has no such
		 * command. */
		status_answered(port, now);
		if (port->status_known || port->refused_in_a_row >= REFUSED_IN_A_ROW)
			go_down(port, EPROTO, now);
		else
			port->status_useless = true;
		return false;
	case SLCAN_REPLY_FLAGS:
		note_flags(port, reply->flags, now);
		return false;
	default:
		return false;
	}
}

/* Takes one byte from the adapter. True when it completes a frame to be returned. */
static bool take(struct db_port *port, uint8_t byte, struct slcan_reply *reply, db_time now)
{
	enum slcan_took took = slcan_take(&port->reader, byte);
	bool refused;

	if (took == SLCAN_TOOK_MORE)
		return false;
	if (took == SLCAN_TOOK_SPOILT ||
	    slcan_decode_reply(port->reader.line, port->reader.length, reply) != SLCAN_OK) {
		if (port->step == STEP_READY)
			port->health.line_errors++;
		return false;
	}
	if (port->step == STEP_READY)
		return ready_reply(port, reply, now);
	/* An answer to the step: a refusal, or that it is done. */
	refused = reply->kind == SLCAN_REPLY_REFUSED;
	if (!refused && reply->kind != SLCAN_REPLY_DONE)
		return false;
	if (refused && (port->step == STEP_RATE || port->step == STEP_OPEN)) {
		port->health.refused++;
		start_over(port, port->step == STEP_RATE ? EINVAL : EPROTO, now);
	} else if (port->step != STEP_FLUSH) {
		/* If refused, it was closed already, or has no time stamps to turn off. */
		enter(port, port->step + 1, now);
	} else if (port->quiet_at < now + QUIET_TIME) {
		port->quiet_at = now + QUIET_TIME;
	}
	return false;
}

/* --- as a transport --------------------------------------------------------------------------- */

static void port_close(struct db_port *port)
{
	if (!port)
		return;
	/* The channel stays open: closing it could drop the last frames, perhaps stops. */
	db_serial_close(port->serial);
	free(port->filters);
	free(port);
}

static void port_pass(struct db_port *port, bool everything)
{
	port->passes_all = everything;
}

static int port_open(const struct db_bus_config *bus, const struct db_can_filter *filters,
                     size_t filter_count, db_time now, struct db_port **port)
{
	struct db_port *made;
	int error = 0;

	if (slcan_bitrate_digit(bus->bitrate) < 0)
		return -EINVAL;
	made = calloc(1, sizeof(*made));
	if (!made)
		return -ENOMEM;
	made->bitrate = bus->bitrate;
	made->health.error = EINPROGRESS;
	if (filter_count > 0) {
		made->filters = calloc(filter_count, sizeof(*filters));
		error = made->filters ? 0 : -ENOMEM;
	}
	if (made->filters) {
		memcpy(made->filters, filters, filter_count * sizeof(*filters));
		made->filter_count = filter_count;
	}
	if (error == 0)
		error = db_serial_open(bus, &made->serial);
	if (error != 0) {
		port_close(made);
		return error;
	}
	made->health.latency = db_serial_latency(made->serial);
	start_flush(made, QUIET_TIME, now);
	*port = made;
	return 0;
}

static int port_fd(const struct db_port *port)
{
	return db_serial_fd(port->serial);
}

static ssize_t port_read(struct db_port *port, void *bytes, size_t size, db_time now)
{
	uint8_t *to = bytes;
	size_t filled = 0;
	size_t done = 0;

	while (port->lost == 0 && size - filled >= FRAME_SIZE && done < READ_MAX) {
		uint8_t raw[256];
		/* Never more bytes than frames there is room for: the rest waits in the serial
		 * port, where poll() sees it. The first byte may complete a partly read frame. */
		size_t wanted = 1 + ((size - filled) / FRAME_SIZE - 1) * SHORTEST_FRAME_LINE;
		ssize_t got;

		if (wanted > READ_MAX - done)
			wanted = READ_MAX - done;
		if (wanted > sizeof(raw))
			wanted = sizeof(raw);
		got = db_serial_read(port->serial, raw, wanted);
		if (got < 0)
			port->lost = (int)got;
		for (ssize_t i = 0; i < got; i++) {
			struct slcan_reply reply;

			if (!take(port, raw[i], &reply, now))
				continue;
			memcpy(to + filled, &reply.frame, FRAME_SIZE);
			filled += FRAME_SIZE;
		}
		if (got < (ssize_t)wanted)
			break;
		done += (size_t)got;
	}
	return filled == 0 && port->lost != 0 ? port->lost : (ssize_t)filled;
}

static ssize_t port_write(struct db_port *port, const void *bytes, size_t length, db_time now)
{
	struct slcan_command command = { .verb = SLCAN_SEND };
	size_t done = 0;

	(void)now;
	if (port->step != STEP_READY && port->lost == 0)
		return 0;
	while (port->lost == 0 && done + FRAME_SIZE <= length) {
		if (!has_room(port))
			flush(port);
		if (!has_room(port))
			break;
		command.frame = db_can_frame_at(bytes, done);
		if (send_line(port, &command))
			port->unanswered++;
		else
			port->health.refused++;
		done += FRAME_SIZE;
	}
	flush(port);
	return done == 0 && port->lost != 0 ? port->lost : (ssize_t)done;
}

static db_time port_run(struct db_port *port, db_time now, int *error)
{
	db_time next;

	flush(port);
	if (port->lost == 0) {
		if (port->step == STEP_READY)
			run_status(port, now);
		else if (port->step == STEP_FLUSH && now >= port->quiet_at)
			enter(port, STEP_CLOSE, now);
		else if (now >= port->step_ends) {
			if (port->step == STEP_FLUSH || port->step == STEP_TIMESTAMPS)
				enter(port, port->step + 1, now);
			else
				start_over(port, ETIMEDOUT, now);
		}
	}
	*error = port->lost;
	if (port->step == STEP_READY)
		next = port->status_useless && !port->status_asked ? DB_TIME_NEVER :
		                                                     port->status_at;
	else if (port->step == STEP_FLUSH && port->quiet_at < port->step_ends)
		next = port->quiet_at;
	else
		next = port->step_ends;
	if (port->out_length > 0 && next > now + FLUSH_RETRY)
		next = now + FLUSH_RETRY;
	return next;
}

static const struct db_port_health *port_health(const struct db_port *port)
{
	return &port->health;
}

/*
 * The slowest of three stages that work in parallel: characters down, the bus, characters up. The
 * additional time of a single exchange, which passes them one after the other, is latency.
 */
static db_time port_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                              size_t request_length, size_t answer_length)
{
	struct slcan_command command = { .verb = SLCAN_SEND };
	uint64_t bits = db_can_wire_bits(request, request_length, answer_length);
	db_time wire = (db_time)bits * DB_NS_PER_S / (db_time)bus->bitrate;
	/* Characters of the answer's frames, extended ones: T, id, length, carriage return, two a
	 * byte. */
	size_t frames = (answer_length + 15) / 16;
	size_t data = answer_length > 8 * frames ? answer_length - 8 * frames : 0;
	db_time up = db_serial_wire_time(bus, 11 * frames + 2 * data);
	char line[SLCAN_LINE_MAX];
	size_t characters = 0;
	db_time down;

	for (size_t at = 0; at + FRAME_SIZE <= request_length; at += FRAME_SIZE) {
		int length;

		command.frame = db_can_frame_at(request, at);
		length = slcan_encode_command(&command, line, sizeof(line));
		characters += length > 0 ? (size_t)length : 0;
	}
	down = db_serial_wire_time(bus, characters);
	wire = wire > down ? wire : down;
	return wire > up ? wire : up;
}

const struct db_transport db_transport_slcan = {
	.name = "slcan",
	.medium = DB_MEDIUM_CAN,
	.open = port_open,
	.pass = port_pass,
	.close = port_close,
	.holder = db_port_holder,
	.fd = port_fd,
	.read = port_read,
	.write = port_write,
	.run = port_run,
	.health = port_health,
	.wire_time = port_wire_time,
};
