/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The network side with everything that it remembers: the server with several connections, the register
 * view with the vendor's layout, the commanders. Clients are sockets of this process that pipeline,
 * send half a frame, close half or at once, and come back; buses complete, refuse and forget what they
 * are given; time is the input's, also the event loop's.
 *
 * What must hold: answers come in the order of their requests and belong to them; a write that is to be
 * answered later is answered once, and in time; a stop is never answered 06; a number of a command is
 * not executed a second time; an armed watchdog trips when everybody is silent; and when everything has
 * been completed, every request of a connection that is still there has its answer.
 */
#include "config/config_private.h"
#include "drivebridge/driver.h"
#include "drivebridge/registers.h"
#include "drivebridge/server.h"
#include "fakes/nameplate.h"
#include "fakes/places.h"
#include "input.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <sys/syscall.h>
#include <systemd/sd-event.h>
#include <time.h>
#include <unistd.h>

#define MS DB_NS_PER_MS
#define S DB_NS_PER_S

#define DRIVES 4
#define CLIENTS 5
#define VARIANTS 4
#define STEPS_MAX 120
#define QUEUE 6          /* commands a bus takes */
#define REQUESTS_MAX 256 /* stops included */
#define LATER_MAX 512
#define ASKED_MAX 64 /* by one client, not answered */
#define CONFIRM_MS 40

/* Registers of a drive. */
#define WATCHDOG_MS 46
#define COMMAND_ID 100
#define COMMAND 101
#define STATUS_LATCHED_BIT 10

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* --- time ------------------------------------------------------------------------------------------ */

static db_time fake_now; /* 0: it is the machine's */

/* Seen by the libraries, too, whatever else is hidden. */
__attribute__((visibility("default"))) int clock_gettime(clockid_t clock, struct timespec *time)
{
	if (fake_now == 0 || clock == CLOCK_REALTIME)
		return (int)syscall(SYS_clock_gettime, clock, time);
	time->tv_sec = (time_t)(fake_now / S);
	time->tv_nsec = (long)(fake_now % S);
	return 0;
}

/* --- the configuration ------------------------------------------------------------------------------- */

static const char *const modbus_sections[VARIANTS] = {
	"gateway-unit = 200\n max-clients = 64\n max-pipelined = 4\n",
	"command-id-scope = client\n max-pipelined = 16\n word-order = low-first\n",
	"control = drive\n control-timeout-ms = 1000\n max-clients = 3\n idle-timeout-s = 2\n",
	"max-requests-per-second = 20\n write-confirm = accepted\n stale = value\n",
};

static const char plant_sections[] =
	"bus p { protocol = vsmd-serial\n device = \"/dev/p\" }\n"
	"bus q { protocol = xyza\n device = \"/dev/q\" }\n"
	"bus r { protocol = servo-can\n interface = \"can0\" }\n"
	"drive a { bus = p\n address = 1\n unit = 1\n vendor-unit = 11\n watchdog-ms = 500 }\n"
	"drive b { bus = p\n address = 2\n unit = 2\n layout = vsmd\n watchdog-ms = 700\n"
	" max-velocity = 5000.0 }\n"
	"drive c { bus = q\n address = 1\n axis = x\n unit = 3\n watchdog-feed = heartbeat }\n"
	"drive d { bus = r\n address = 1\n unit = 4\n watchdog-feed = writes\n"
	" on-client-loss = disable }\n";

/* Read once: what no input changes. */
static const struct db_config *config_of(size_t variant)
{
	static struct db_config *configs[VARIANTS];
	char text[2048];

	if (configs[variant])
		return configs[variant];
	(void)snprintf(text, sizeof text,
	               "modbus { listen = \"127.0.0.1:0\"\n allow-write = {\"127.0.0.0/30\"}\n"
	               " confirm-ms = %d\n %s }\n%s",
	               CONFIRM_MS, modbus_sections[variant], plant_sections);
	must(db_load_text(&db_load_built_in, text, "f", stderr, &configs[variant]) == 0);
	return configs[variant];
}

/* --- the world --------------------------------------------------------------------------------------- */

/* A request that was sent whole, and what its answer must look like. */
struct asked {
	uint16_t transaction;
	uint8_t unit;
	uint8_t function;
	bool stop;
};

struct peer {
	int fd;       /* -1: none */
	bool wild;    /* has sent what is no Modbus */
	bool partial; /* may have been closed for half a frame */
	uint16_t transaction;
	uint8_t out[4096]; /* not sent yet */
	size_t out_length;
	uint8_t in[1024];
	size_t in_length;
	struct asked asked[ASKED_MAX];
	size_t asked_count;
	size_t answered;
};

struct pending {
	uint32_t ticket;
	uint16_t drive;
	bool stop;
};

/* The last number that a drive was given, by whom, and whether it was executed. */
struct numbered {
	uint16_t id;
	uint8_t address[16];
	bool executed;
};

struct world {
	sd_event *loop;
	const struct db_config *config; /* whose plant it is */
	const struct db_config *modbus; /* whose section modbus is in force */
	struct db_axis *axes[DRIVES];
	struct db_registers *registers;
	struct db_server *server;
	struct peer peers[CLIENTS];
	struct pending pending[REQUESTS_MAX];
	struct fake_place places[REQUESTS_MAX];
	size_t pending_count;
	struct {
		struct db_write_token token;
		db_time since;
	} later[LATER_MAX];
	size_t later_count;
	struct numbered numbered[DRIVES];
	unsigned submitted; /* motions and others that are no stops, in this write */
	bool full;
	uint32_t trips;
};

static struct world *the_world; /* the backend's context is the registers' */

/* --- buses ------------------------------------------------------------------------------------------- */

static struct db_request *submit(void *context, struct db_bus *bus,
                                 const struct db_request *request)
{
	struct world *world = context;
	bool stop = request->setting_count == 0 && db_command_is_stop(request->command);
	size_t commands = 0;

	(void)bus;
	must(request->ticket != 0 && request->drive < DRIVES);
	must(request->setting_count > 0 || request->command != DB_CMD_NONE);
	for (size_t i = 0; i < world->pending_count; i++) {
		must(world->pending[i].ticket != request->ticket);
		commands += !world->pending[i].stop;
	}
	if (!stop && (world->full || commands >= QUEUE))
		return NULL;
	must(world->pending_count < REQUESTS_MAX);
	world->pending[world->pending_count++] = (struct pending){ request->ticket, request->drive,
		                                                   stop };
	world->submitted += !stop;
	return fake_place_fill(world->places, REQUESTS_MAX, request);
}

static void release(void *context, struct db_request *request)
{
	fake_place_release(((struct world *)context)->places, REQUESTS_MAX, request);
}

static void complete(struct world *world, size_t index, enum db_result result)
{
	struct pending pending = world->pending[index];
	struct db_request *kept = fake_place_find(world->places, REQUESTS_MAX, pending.ticket);

	must(kept);
	kept->sent = fake_now - MS;
	world->pending[index] = world->pending[--world->pending_count];
	db_registers_complete(world->registers, fake_place_end(kept, result, fake_now), fake_now);
}

static void publish(struct world *world, size_t drive, uint32_t status, db_time age)
{
	struct db_snapshot snapshot = {
		.feedback = { .taken = fake_now - age,
		              .taken_wall_us = 1,
		              .position = (int32_t)status,
		              .velocity = 1.0f,
		              .state = status & DB_STATUS_ONLINE ? DB_AXIS_STANDSTILL :
		                                                   DB_AXIS_OFFLINE,
		              .status = status },
	};

	db_axis_publish(world->axes[drive], &snapshot);
}

/* --- between server and registers -------------------------------------------------------------------- */

static db_time now_of(void *context)
{
	(void)context;
	return fake_now;
}

static uint64_t wall_us(void *context)
{
	(void)context;
	return 1700000000000000u + (uint64_t)fake_now / 1000;
}

static void answer(void *context, struct db_write_token token, uint8_t exception)
{
	struct world *world = context;

	for (size_t i = 0; i < world->later_count; i++) {
		if (world->later[i].token.client != token.client ||
		    world->later[i].token.sequence != token.sequence)
			continue;
		world->later[i] = world->later[--world->later_count];
		db_server_answer(world->server, token, exception);
		return;
	}
	must(false); /* nobody waits for that answer */
}

static void bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	(void)context;
	(void)bus;
	*stats = (struct db_bus_stats){ .up = true };
}

static void server_stats(void *context, struct db_server_stats *stats)
{
	db_server_stats(((struct world *)context)->server, stats);
}

static size_t server_clients(void *context, struct db_server_client *clients, size_t max)
{
	return db_server_clients(((struct world *)context)->server, clients, max);
}

static void refused(void *context, const struct db_client *client, enum db_refusal kind)
{
	db_server_refused(((struct world *)context)->server, client, kind);
}

static void tripped(void *context, const struct db_bus_config *bus,
                    const struct db_drive_config *drive, const struct db_client *last)
{
	must(bus && drive && last);
	((struct world *)context)->trips++;
}

static const struct db_registers_ops ops = {
	.now = now_of,
	.wall_us = wall_us,
	.submit = submit,
	.release = release,
	.answer = answer,
	.bus_stats = bus_stats,
	.server_stats = server_stats,
	.server_clients = server_clients,
	.refused = refused,
	.tripped = tripped,
};

/* Place of the drive whose neutral view has this unit, or DRIVES. */
static size_t drive_at(uint8_t unit)
{
	return unit == 2 || unit == 0 || unit > DRIVES ? DRIVES : (size_t)unit - 1;
}

/* A block with a number: not executed when the one before had the same, from the same client. */
static void check_number(struct world *world, const struct db_client *client, uint8_t unit,
                         const uint16_t *values)
{
	size_t drive = drive_at(unit);
	struct numbered *last = &world->numbered[drive < DRIVES ? drive : 0];
	bool again = last->id == values[0] &&
	             memcmp(last->address, client->address, sizeof last->address) == 0;

	if (drive == DRIVES || values[0] == 0)
		return;
	must(!again || !last->executed || world->submitted == 0);
	last->executed = (again && last->executed) || world->submitted > 0;
	last->id = values[0];
	memcpy(last->address, client->address, sizeof last->address);
}

static int write_through(void *context, const struct db_client *client, uint8_t unit,
                         enum db_table table, uint16_t address, uint16_t count,
                         const uint16_t *values, struct db_write_token token)
{
	struct world *world = the_world;
	size_t drive = drive_at(unit);
	int result;

	must(client->may_write && token.client == client->id);
	world->submitted = 0;
	result = db_registers_backend.write(context, client, unit, table, address, count, values,
	                                    token);
	must(result == DB_WRITE_LATER || (result >= 0 && result <= 0x0B));
	if (table == DB_TABLE_HOLDING && address == COMMAND_ID && count >= 2)
		check_number(world, client, unit, values);
	else if (drive < DRIVES && table == DB_TABLE_HOLDING && address <= COMMAND_ID &&
	         address + count > COMMAND_ID)
		world->numbered[drive].executed = false; /* a number that is not looked at here */
	if (result == DB_WRITE_LATER) {
		must(world->later_count < LATER_MAX);
		world->later[world->later_count].token = token;
		world->later[world->later_count++].since = fake_now;
	}
	return result;
}

/* The registers' own, but for writes. */
static struct db_backend backend_through(void)
{
	struct db_backend backend = db_registers_backend;

	backend.write = write_through;
	return backend;
}

/* --- time goes on -------------------------------------------------------------------------------------- */

static void run_loop(struct world *world)
{
	unsigned turns = 0;

	while (sd_event_run(world->loop, 0) > 0)
		must(++turns < 10000);
}

static void check_later(const struct world *world)
{
	for (size_t i = 0; i < world->later_count; i++)
		must(fake_now - world->later[i].since <= CONFIRM_MS * MS);
}

static void expire(struct world *world)
{
	unsigned rounds = 0;

	while (db_registers_next_deadline(world->registers) <= fake_now) {
		db_registers_expire(world->registers, fake_now);
		must(++rounds < 100);
	}
	check_later(world);
	run_loop(world);
}

static void pass(struct world *world, db_time span)
{
	db_time end = fake_now + span;

	expire(world);
	while (fake_now < end) {
		db_time next = db_registers_next_deadline(world->registers);
		db_time most = fake_now + 20 * MS < end ? fake_now + 20 * MS : end;

		fake_now = next < most ? next : most;
		expire(world);
	}
}

/* --- clients ------------------------------------------------------------------------------------------- */

static void forget(struct peer *peer)
{
	if (peer->fd >= 0)
		close(peer->fd);
	*peer = (struct peer){ .fd = -1 };
}

static void come(struct world *world, struct peer *peer, uint8_t last)
{
	struct sockaddr_in address = { .sin_family = AF_INET };
	struct linger linger = { .l_onoff = 1 };

	forget(peer);
	peer->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
	must(peer->fd >= 0);
	/* No ports are left waiting. */
	must(setsockopt(peer->fd, SOL_SOCKET, SO_LINGER, &linger, sizeof linger) == 0);
	address.sin_addr.s_addr = htonl(INADDR_LOOPBACK + last % 4u);
	must(bind(peer->fd, (struct sockaddr *)&address, sizeof address) == 0);
	address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	address.sin_port = htons(db_server_port(world->server, DB_ENDPOINT_FIRST));
	if (connect(peer->fd, (struct sockaddr *)&address, sizeof address) < 0 &&
	    errno != EINPROGRESS)
		forget(peer);
}

static void take_answer(struct peer *peer, const uint8_t *adu, size_t length)
{
	struct asked asked = peer->asked[0];
	uint8_t function = adu[7];

	must(peer->asked_count > 0 && length >= 8);
	must((adu[0] << 8 | adu[1]) == asked.transaction && adu[2] == 0 && adu[3] == 0);
	must(adu[6] == asked.unit && (function & 0x7F) == asked.function);
	if (function & 0x80) {
		must(length == 9 && adu[8] > 0 && adu[8] <= 0x0B);
		must(!asked.stop || adu[8] != 0x06);
	}
	peer->asked_count--;
	memmove(peer->asked, peer->asked + 1, peer->asked_count * sizeof asked);
	peer->answered++;
}

static void take_answers(struct peer *peer)
{
	size_t done = 0;

	while (peer->in_length - done >= 6) {
		const uint8_t *adu = peer->in + done;
		size_t length = 6 + (size_t)(adu[4] << 8 | adu[5]);

		must(length >= 8 && length <= 260);
		if (peer->in_length - done < length)
			break;
		if (!peer->wild)
			take_answer(peer, adu, length);
		done += length;
	}
	peer->in_length -= done;
	memmove(peer->in, peer->in + done, peer->in_length);
}

static void receive(struct peer *peer)
{
	for (;;) {
		ssize_t got = recv(peer->fd, peer->in + peer->in_length,
		                   sizeof peer->in - peer->in_length, MSG_DONTWAIT);

		if (got < 0 && errno == EAGAIN)
			return;
		if (got <= 0) {
			forget(peer);
			return;
		}
		peer->in_length += (size_t)got;
		take_answers(peer);
	}
}

static void transmit(struct peer *peer, size_t length)
{
	ssize_t sent;

	if (length > peer->out_length)
		length = peer->out_length;
	if (length == 0)
		return;
	sent = send(peer->fd, peer->out, length, MSG_NOSIGNAL | MSG_DONTWAIT);
	if (sent < 0)
		return;
	peer->out_length -= (size_t)sent;
	memmove(peer->out, peer->out + sent, peer->out_length);
	peer->partial = peer->partial || peer->out_length > 0;
}

static bool is_stop(uint8_t unit, const uint8_t *pdu, size_t length)
{
	return drive_at(unit) < DRIVES && length == 5 && pdu[0] == 6 && pdu[1] == 0 &&
	       pdu[2] == COMMAND && pdu[3] == 0 && db_command_is_stop((enum db_command)pdu[4]);
}

static void ask(struct peer *peer, uint8_t unit, const uint8_t *pdu, size_t length)
{
	uint8_t *adu = peer->out + peer->out_length;

	if (length == 0 || length > 253 || peer->out_length + 260 > sizeof peer->out ||
	    peer->asked_count == ASKED_MAX)
		return;
	peer->transaction++;
	adu[0] = (uint8_t)(peer->transaction >> 8);
	adu[1] = (uint8_t)peer->transaction;
	adu[2] = adu[3] = adu[4] = 0;
	adu[5] = (uint8_t)(length + 1);
	adu[6] = unit;
	memcpy(adu + 7, pdu, length);
	peer->out_length += 7 + length;
	peer->asked[peer->asked_count++] = (struct asked){ peer->transaction, unit, pdu[0] & 0x7F,
		                                           is_stop(unit, pdu, length) };
	/* Nothing is said of how such a thing is answered. */
	peer->wild = peer->wild || pdu[0] & 0x80;
}

/* --- what the input decides ----------------------------------------------------------------------------- */

/* A register near those that matter, or any. */
static uint16_t some_address(struct input *input)
{
	static const uint16_t places[] = { 0,       22,  WATCHDOG_MS, 56,  66,   COMMAND_ID,
		                           COMMAND, 124, 200,         300, 1000, 2000 };
	uint8_t choice = input_u8(input);

	if (choice >= 240)
		return input_u16(input);
	return (uint16_t)(places[choice % 12] + choice / 12 % 4);
}

static uint8_t some_unit(struct input *input)
{
	static const uint8_t units[] = { 1, 1, 1, 2, 3, 4, 11, 0, 255, 200, 9 };

	return units[input_below(input, sizeof units)];
}

static size_t put_u16(uint8_t *to, unsigned value)
{
	to[0] = (uint8_t)(value >> 8);
	to[1] = (uint8_t)value;
	return 2;
}

/* Command id, command and the first arguments in one write. */
static size_t make_block(struct input *input, uint8_t *pdu)
{
	size_t length = 1;

	pdu[0] = 16;
	length += put_u16(pdu + length, COMMAND_ID);
	length += put_u16(pdu + length, 6);
	pdu[length++] = 12;
	length += put_u16(pdu + length, input_u8(input) % 4);
	length += put_u16(pdu + length, input_u8(input) % DB_CMD_LIMIT);
	length += put_u16(pdu + length, 0);
	length += put_u16(pdu + length, input_u8(input));
	length += put_u16(pdu + length, 0x4280 + input_u8(input) % 16);
	return length + put_u16(pdu + length, 0);
}

static size_t make_read(struct input *input, uint8_t *pdu)
{
	pdu[0] = (uint8_t)(1 + input_below(input, 4));
	put_u16(pdu + 1, some_address(input));
	put_u16(pdu + 3, input_u8(input));
	return 5;
}

static size_t make_single(struct input *input, uint8_t *pdu)
{
	pdu[0] = input_u8(input) & 1 ? 5 : 6;
	put_u16(pdu + 1, some_address(input));
	put_u16(pdu + 3, pdu[0] == 5 && input_u8(input) & 1 ? 0xFF00 : input_u8(input));
	return 5;
}

static size_t make_command(struct input *input, uint8_t *pdu)
{
	pdu[0] = 6;
	put_u16(pdu + 1, COMMAND);
	put_u16(pdu + 3, input_u8(input) % DB_CMD_LIMIT);
	return 5;
}

static size_t make_several(struct input *input, uint8_t *pdu)
{
	const uint8_t *bytes;
	unsigned count = 1u + input_u8(input) % 16;
	bool coils = input_u8(input) & 1;
	size_t wanted = coils ? (count + 7) / 8 : 2 * count;
	size_t given;

	pdu[0] = coils ? 15 : 16;
	put_u16(pdu + 1, some_address(input));
	put_u16(pdu + 3, count);
	pdu[5] = (uint8_t)wanted;
	given = input_bytes(input, wanted, &bytes);
	memset(pdu + 6, 0, wanted);
	memcpy(pdu + 6, bytes, given);
	return 6 + wanted;
}

static size_t make_mask(struct input *input, uint8_t *pdu)
{
	pdu[0] = 22;
	put_u16(pdu + 1, some_address(input));
	put_u16(pdu + 3, input_u16(input));
	put_u16(pdu + 5, input_u16(input));
	return 7;
}

static size_t make_read_write(struct input *input, uint8_t *pdu)
{
	size_t length = 1;

	pdu[0] = 23;
	length += put_u16(pdu + length, some_address(input));
	length += put_u16(pdu + length, 1u + input_u8(input) % 125);
	length += put_u16(pdu + length, some_address(input));
	length += put_u16(pdu + length, 2);
	pdu[length++] = 4;
	length += put_u16(pdu + length, input_u8(input));
	return length + put_u16(pdu + length, input_u8(input));
}

static size_t make_other(struct input *input, uint8_t *pdu)
{
	const uint8_t *bytes;
	size_t given;

	if (input_u8(input) & 1) {
		pdu[0] = 43;
		pdu[1] = 14;
		pdu[2] = input_u8(input) % 6;
		pdu[3] = input_u8(input);
		return 4;
	}
	given = input_bytes(input, 1 + input_u8(input) % 32, &bytes);
	memcpy(pdu, bytes, given);
	return given;
}

static void send_request(struct peer *peer, struct input *input)
{
	static size_t (*const makers[])(struct input *, uint8_t *) = {
		make_block,  make_block,   make_command, make_command,    make_read,
		make_single, make_several, make_mask,    make_read_write, make_other,
	};
	uint8_t unit = some_unit(input);
	uint8_t pdu[256];
	size_t maker = input_below(input, sizeof makers / sizeof makers[0]);

	ask(peer, unit, pdu, makers[maker](input, pdu));
}

static void send_garbage(struct peer *peer, struct input *input)
{
	const uint8_t *bytes;
	size_t length = input_bytes(input, 1 + input_u8(input) % 16, &bytes);

	if (peer->out_length + length > sizeof peer->out)
		return;
	memcpy(peer->out + peer->out_length, bytes, length);
	peer->out_length += length;
	peer->wild = true;
}

static void use_client(struct world *world, struct input *input)
{
	uint8_t choice = input_u8(input);
	struct peer *peer = &world->peers[choice % CLIENTS];

	if (peer->fd < 0) {
		come(world, peer, choice / CLIENTS);
		run_loop(world);
		return;
	}
	switch (choice / CLIENTS % 16) {
	default:
		send_request(peer, input);
		if (input_u8(input) & 1)
			return; /* pipelined with the next */
		transmit(peer, sizeof peer->out);
		break;
	case 9:
		transmit(peer, 1 + input_u8(input) % 32);
		break;
	case 10:
		receive(peer);
		break;
	case 11:
		send_garbage(peer, input);
		break;
	case 12:
		shutdown(peer->fd, SHUT_WR);
		break;
	case 13:
		forget(peer);
		break;
	}
	run_loop(world);
}

static void use_bus(struct world *world, struct input *input)
{
	static const enum db_result results[] = {
		DB_RESULT_OK,        DB_RESULT_OK,       DB_RESULT_REFUSED, DB_RESULT_TIMEOUT,
		DB_RESULT_CANCELLED, DB_RESULT_BUS_DOWN, DB_RESULT_OFFLINE, DB_RESULT_INDETERMINATE,
		DB_RESULT_FAILED,    DB_RESULT_BUSY,
	};
	uint8_t choice = input_u8(input);
	enum db_result result = results[choice / 16 % (sizeof results / sizeof results[0])];
	size_t index;

	if (world->pending_count == 0)
		return;
	/* A bus has room for stops: fuzz_engine holds it to that. */
	index = choice % world->pending_count;
	if (world->pending[index].stop && result == DB_RESULT_BUSY)
		result = DB_RESULT_FAILED;
	complete(world, index, result);
	run_loop(world);
}

static void use_drive(struct world *world, struct input *input)
{
	size_t drive = input_below(input, DRIVES);
	uint32_t status = input_u16(input) | (uint32_t)input_u8(input) << 16;

	publish(world, drive, status, input_u8(input) * MS);
}

/* Another section modbus, in the order of a reload. */
static void reload(struct world *world, struct input *input);

/* What a client that may only read sees of a drive: this feeds nothing. */
static bool look(struct world *world, uint8_t unit, uint16_t address, uint16_t count,
                 uint16_t *values)
{
	static const struct db_client watcher = { .id = 0xFFFFFFF0, .address = { 1 } };

	return db_registers_backend.read(world->registers, &watcher, unit, DB_TABLE_HOLDING,
	                                 address, count, values) == 0;
}

static uint32_t number_at(const struct world *world, const uint16_t *values, size_t at)
{
	uint32_t low_first = world->modbus->modbus.low_word_first;

	return (uint32_t)values[at + !low_first] | (uint32_t)values[at + low_first] << 16;
}

/* Whether some request may still wait in a buffer. */
static bool is_busy(struct world *world)
{
	for (size_t i = 0; i < CLIENTS; i++) {
		struct peer *peer = &world->peers[i];

		if (peer->fd >= 0)
			receive(peer);
		if (peer->fd >= 0 && (peer->wild || peer->asked_count > 0))
			return true;
	}
	return false;
}

/* Everybody is silent for longer than any watchdog waits. */
static void be_silent(struct world *world)
{
	static const uint8_t units[] = { 1, 3, 4 };
	uint32_t before[3] = { 0 };
	bool armed[3] = { false };
	uint16_t values[6];
	db_time longest = 0;

	run_loop(world);
	if (is_busy(world))
		return;
	for (size_t i = 0; i < 3; i++) {
		if (!look(world, units[i], WATCHDOG_MS, 6, values) ||
		    number_at(world, values, 2) == 0)
			continue;
		armed[i] = true;
		before[i] = number_at(world, values, 4);
		if (number_at(world, values, 0) * MS > longest)
			longest = number_at(world, values, 0) * MS;
	}
	if (longest > 5 * S)
		return;
	pass(world, longest + MS);
	for (size_t i = 0; i < 3; i++) {
		if (!armed[i])
			continue;
		must(look(world, units[i], WATCHDOG_MS, 6, values));
		must(number_at(world, values, 2) == 0);
		must(number_at(world, values, 4) == before[i] + 1);
	}
}

static void act(struct world *world, struct input *input)
{
	switch (input_u8(input) % 16) {
	default:
		use_client(world, input);
		break;
	case 9:
	case 10:
		use_bus(world, input);
		break;
	case 11:
		use_drive(world, input);
		break;
	case 12:
		pass(world, (1 + input_u8(input)) * MS);
		break;
	case 13:
		world->full = input_u8(input) & 1;
		break;
	case 14:
		reload(world, input);
		break;
	case 15:
		be_silent(world);
		break;
	}
}

/* --- a whole story ------------------------------------------------------------------------------------- */

struct sheet {
	struct db_roster_bus buses[3];
	struct db_roster_drive drives[DRIVES];
	struct db_roster roster;
};

/* Buses are known by their sections. */
static void write_sheet(struct world *world, const struct db_config *modbus, struct sheet *sheet)
{
	const struct db_config *config = world->config;

	for (size_t i = 0; i < config->bus_count; i++)
		sheet->buses[i] = (struct db_roster_bus){
			&config->buses[i], (struct db_bus *)(void *)&config->buses[i]
		};
	for (size_t i = 0; i < DRIVES; i++)
		sheet->drives[i] = (struct db_roster_drive){ (uint16_t)i, config->drives[i].bus,
			                                     &config->drives[i], world->axes[i] };
	sheet->roster = (struct db_roster){ &modbus->modbus, sheet->buses, config->bus_count,
		                            sheet->drives, DRIVES };
}

static void reload(struct world *world, struct input *input)
{
	const struct db_config *next = config_of(input_below(input, VARIANTS));
	struct db_registers_change *registers;
	struct db_server_change *server;
	const char *where;
	struct sheet sheet;

	write_sheet(world, next, &sheet);
	must(db_registers_prepare(world->registers, &sheet.roster, &registers) == 0);
	must(db_server_prepare(world->server, &next->modbus, &server, &where) == 0);
	db_registers_retire(world->registers, registers);
	db_server_apply(world->server, server);
	db_registers_apply(world->registers, registers);
	world->modbus = next;
	/* Another scope of numbers forgets them. */
	memset(world->numbered, 0, sizeof world->numbered);
	run_loop(world);
}

static void open_world(struct world *world, struct input *input)
{
	const char *where;
	static const struct db_log_source quiet = { 0 };
	static struct db_backend backend;
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX);
	struct sheet sheet;

	strcpy(plate.identity, "fuzz");
	plate.generation = 1;
	*world = (struct world){ .config = config_of(0) };
	world->modbus = config_of(input_below(input, VARIANTS));
	the_world = world;
	backend = backend_through();
	fake_now = 100000 * S;
	for (size_t i = 0; i < CLIENTS; i++)
		world->peers[i].fd = -1;
	for (size_t i = 0; i < DRIVES; i++) {
		world->axes[i] = db_axis_new(DB_PARAMS_MAX);
		must(world->axes[i]);
		db_axis_publish_nameplate(world->axes[i], &plate);
		publish(world, i,
		        DB_STATUS_ONLINE | DB_STATUS_BUS_UP | DB_STATUS_ENABLED |
		                DB_STATUS_PARAMS_VALID,
		        0);
	}
	must(sd_event_new(&world->loop) >= 0);
	write_sheet(world, world->modbus, &sheet);
	must(db_registers_new(&sheet.roster, &ops, world, &world->registers) == 0);
	must(db_server_new(world->loop, &world->modbus->modbus, &backend, world->registers, &quiet,
	                   &world->server, &where) == 0);
}

static bool all_answered(struct world *world)
{
	for (size_t i = 0; i < CLIENTS; i++) {
		struct peer *peer = &world->peers[i];

		if (peer->fd >= 0)
			receive(peer);
		if (peer->fd >= 0 && !peer->wild && peer->asked_count > 0)
			return false;
	}
	return true;
}

/* The buses complete everything, and clients send what they have begun. */
static void finish(struct world *world)
{
	unsigned rounds = 0;

	for (size_t i = 0; i < CLIENTS; i++) {
		if (world->peers[i].fd >= 0)
			transmit(&world->peers[i], sizeof world->peers[i].out);
	}
	run_loop(world);
	while (!all_answered(world) || world->later_count > 0) {
		must(++rounds < 2000);
		while (world->pending_count > 0)
			complete(world, 0, DB_RESULT_OK);
		pass(world, 10 * MS);
	}
}

static void close_world(struct world *world)
{
	for (size_t i = 0; i < CLIENTS; i++)
		forget(&world->peers[i]);
	db_server_free(world->server);
	db_registers_free(world->registers);
	sd_event_unref(world->loop);
	for (size_t i = 0; i < DRIVES; i++)
		db_axis_free(world->axes[i]);
	fake_now = 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct input input = { data, size };
	static struct world world;

	open_world(&world, &input);
	for (unsigned i = 0; i < STEPS_MAX && input.left > 0; i++)
		act(&world, &input);
	finish(&world);
	close_world(&world);
	return 0;
}
