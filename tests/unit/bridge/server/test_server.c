/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The server over loopback, with a backend made for the purpose. Server and clients share one
 * thread: whoever waits for something runs the event loop meanwhile.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <systemd/sd-event.h>
#include <time.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivebridge/server.h"
#include "server/listener.h"

#define REGISTERS 1000u /* addresses beyond do not exist */
#define LATER 200u      /* writes from here on are answered later */
#define STOP 300u       /* a write here cancels the oldest pending one with exception 04 */
#define STALE 400u      /* reading here gives 0B */
#define NO_UNIT 9
#define PENDING 64
#define PATIENCE_MS 10000

struct rig {
	sd_event *loop;
	struct db_server *server;
	struct db_modbus_config config;
	char listen[32];
	struct db_modbus_config next; /* see change() */
	char next_listen[32];
	uint16_t registers[REGISTERS];
	struct pending {
		struct db_write_token token;
		uint16_t address, count, values[128];
	} pending[PENDING];
	unsigned writes, later, connected, restricted;
	db_time arrived; /* the latest request that reached the backend */
};

/* The backend. */

/* The address that cannot be listened on, of the latest attempt. */
static const char *where;
/* In whose units the latest request was. */
static uint32_t asked_endpoint;

static uint8_t fake_unit(void *context, const struct db_client *client, uint8_t unit)
{
	asked_endpoint = client->endpoint;
	(void)context;
	return unit == NO_UNIT ? 0x0A : 0;
}

static uint8_t fake_read(void *context, const struct db_client *client, uint8_t unit,
                         enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	struct rig *rig = context;

	(void)unit;
	assert_int_not_equal(client->id, 0);
	rig->arrived = client->arrived;
	if (address + count > REGISTERS)
		return 2;
	if (address == STALE)
		return 0x0B;
	for (unsigned i = 0; i < count; i++) {
		values[i] = rig->registers[address + i];
		if (table == DB_TABLE_COILS || table == DB_TABLE_DISCRETE)
			values[i] &= 1;
	}
	return 0;
}

static void apply(struct rig *rig, uint16_t address, uint16_t count, const uint16_t *values)
{
	memcpy(rig->registers + address, values, count * sizeof(*values));
}

static int fake_write(void *context, const struct db_client *client, uint8_t unit,
                      enum db_table table, uint16_t address, uint16_t count, const uint16_t *values,
                      struct db_write_token token)
{
	struct rig *rig = context;
	struct pending *pending = &rig->pending[rig->later % PENDING];

	(void)unit;
	(void)table;
	assert_true(client->may_write);
	assert_int_equal(token.client, client->id);
	rig->arrived = client->arrived;
	if (address + count > REGISTERS)
		return 2;
	rig->writes++;
	if (address == STOP && rig->later > 0)
		db_server_answer(rig->server, rig->pending[0].token, 4);
	if (address < LATER || address >= STOP) {
		apply(rig, address, count, values);
		return 0;
	}
	*pending = (struct pending){ .token = token, .address = address, .count = count };
	memcpy(pending->values, values, count * sizeof(*values));
	rig->later++;
	return DB_WRITE_LATER;
}

/* Ends a pending write. */
static void finish(struct rig *rig, unsigned index, uint8_t exception)
{
	struct pending *pending = &rig->pending[index];

	assert_true(index < rig->later);
	if (exception == 0)
		apply(rig, pending->address, pending->count, pending->values);
	db_server_answer(rig->server, pending->token, exception);
}

static int fake_write_same(void *context, const struct db_client *client, uint8_t unit,
                           uint16_t address, uint16_t value, struct db_write_token token)
{
	struct rig *rig = context;

	(void)unit;
	(void)token;
	assert_true(client->may_write);
	assert_int_equal(rig->registers[address], value);
	return 0;
}

static size_t fake_server_id(void *context, const struct db_client *client, uint8_t unit,
                             char *text, size_t size, bool *running)
{
	(void)client;
	(void)context;
	*running = true;
	return (size_t)snprintf(text, size, "unit%u", unit);
}

static const char *fake_device_id(void *context, const struct db_client *client, uint8_t unit,
                                  uint8_t object)
{
	(void)client;
	static const char *const objects[] = { "vendor", "code", "1.0" };

	(void)context;
	(void)unit;
	return object < 3 ? objects[object] : NULL;
}

static void fake_client(void *context, const struct db_client *client, bool connected)
{
	struct rig *rig = context;

	assert_int_not_equal(client->port, 0);
	rig->connected += connected ? 1u : -1u;
}

static void fake_restricted(void *context, const struct db_client *client)
{
	struct rig *rig = context;

	assert_false(client->may_write);
	rig->restricted++;
}

static const struct db_log_source QUIET = { 0 };

static const struct db_backend BACKEND = {
	.unit = fake_unit,
	.read = fake_read,
	.write = fake_write,
	.write_same = fake_write_same,
	.server_id = fake_server_id,
	.device_id = fake_device_id,
	.client = fake_client,
	.restricted = fake_restricted,
};

/* The rig. */

static int set_up(void **state)
{
	struct rig *rig = calloc(1, sizeof(*rig));

	if (!rig || sd_event_new(&rig->loop) < 0)
		return -1;
	strcpy(rig->listen, "127.0.0.1:0");
	rig->config = (struct db_modbus_config){
		.listen = rig->listen,
		.max_clients = 64,
		.max_pipelined = 16,
		.frame_timeout_ms = 5000,
	};
	for (unsigned i = 0; i < REGISTERS; i++)
		rig->registers[i] = (uint16_t)i;
	*state = rig;
	return 0;
}

static int tear_down(void **state)
{
	struct rig *rig = *state;

	db_server_free(rig->server);
	sd_event_unref(rig->loop);
	free(rig);
	return 0;
}

static void start(struct rig *rig)
{
	assert_int_equal(
		db_server_new(rig->loop, &rig->config, &BACKEND, rig, &QUIET, &rig->server, &where),
		0);
}

static struct db_server_stats stats(const struct rig *rig)
{
	struct db_server_stats s;

	db_server_stats(rig->server, &s);
	return s;
}

static int64_t now_ms(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

/* Everything that the server can do without waiting. */
static void settle(struct rig *rig)
{
	while (sd_event_run(rig->loop, 0) > 0)
		;
}

#define WAIT_FOR(rig, condition)                                           \
	do {                                                               \
		int64_t end_ = now_ms() + PATIENCE_MS;                     \
		while (!(condition)) {                                     \
			assert_true(now_ms() < end_);                      \
			assert_true(sd_event_run((rig)->loop, 5000) >= 0); \
		}                                                          \
	} while (0)

/* From 127.0.0.`last`. */
static int open_client_from(const struct rig *rig, uint32_t last)
{
	struct sockaddr_in address = { .sin_family = AF_INET };
	int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

	assert_true(fd >= 0);
	address.sin_addr.s_addr = htonl((INADDR_LOOPBACK & ~UINT32_C(0xFF)) | last);
	assert_int_equal(bind(fd, (struct sockaddr *)&address, sizeof(address)), 0);
	address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	address.sin_port = htons(db_server_port(rig->server, DB_ENDPOINT_FIRST));
	assert_int_equal(connect(fd, (struct sockaddr *)&address, sizeof(address)), 0);
	return fd;
}

static int open_client(const struct rig *rig)
{
	return open_client_from(rig, 1);
}

static int connect_client_from(struct rig *rig, uint32_t last)
{
	uint64_t before = stats(rig).accepted;
	int fd = open_client_from(rig, last);

	WAIT_FOR(rig, stats(rig).accepted > before);
	return fd;
}

static int connect_client(struct rig *rig)
{
	return connect_client_from(rig, 1);
}

static void send_bytes(int fd, const void *bytes, size_t length)
{
	assert_int_equal(send(fd, bytes, length, MSG_NOSIGNAL), (ssize_t)length);
}

/* One request in a frame of its own; the transaction is the number given. */
static size_t make(uint8_t *adu, uint16_t transaction, const uint8_t *pdu, size_t length)
{
	adu[0] = (uint8_t)(transaction >> 8);
	adu[1] = (uint8_t)transaction;
	adu[2] = adu[3] = adu[4] = 0;
	adu[5] = (uint8_t)(length + 1);
	adu[6] = 1;
	memcpy(adu + 7, pdu, length);
	return 7 + length;
}

#define SEND(fd, transaction, ...)                                                     \
	do {                                                                           \
		const uint8_t pdu_[] = { __VA_ARGS__ };                                \
		uint8_t adu_[260];                                                     \
		send_bytes((fd), adu_, make(adu_, (transaction), pdu_, sizeof(pdu_))); \
	} while (0)

static void receive(struct rig *rig, int fd, uint8_t *bytes, size_t length)
{
	int64_t end = now_ms() + PATIENCE_MS;
	ssize_t got;

	while (length > 0) {
		got = recv(fd, bytes, length, MSG_DONTWAIT);
		if (got > 0) {
			bytes += got;
			length -= (size_t)got;
			continue;
		}
		assert_true(got < 0 && errno == EAGAIN);
		assert_true(now_ms() < end);
		assert_true(sd_event_run(rig->loop, 5000) >= 0);
	}
}

static void expect(struct rig *rig, int fd, uint16_t transaction, const uint8_t *pdu, size_t length)
{
	uint8_t expected[260], got[260];
	size_t size = make(expected, transaction, pdu, length);

	receive(rig, fd, got, size);
	assert_memory_equal(got, expected, size);
}

#define EXPECT(rig, fd, transaction, ...)                                    \
	expect((rig), (fd), (transaction), (const uint8_t[]){ __VA_ARGS__ }, \
	       sizeof((const uint8_t[]){ __VA_ARGS__ }))

static void expect_silence(struct rig *rig, int fd)
{
	uint8_t byte;

	settle(rig);
	assert_int_equal(recv(fd, &byte, 1, MSG_DONTWAIT), -1);
	assert_int_equal(errno, EAGAIN);
}

static void expect_closed(struct rig *rig, int fd)
{
	int64_t end = now_ms() + PATIENCE_MS;
	uint8_t byte;
	ssize_t got;

	while ((got = recv(fd, &byte, 1, MSG_DONTWAIT)) < 0 && errno == EAGAIN) {
		assert_true(now_ms() < end);
		assert_true(sd_event_run(rig->loop, 5000) >= 0);
	}
	assert_true(got == 0 || (got < 0 && errno == ECONNRESET));
	close(fd);
}

/* Tests. */

static void every_function(void **state)
{
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 1, 0, 1, 0, 3);
	EXPECT(rig, fd, 1, 1, 1, 5);
	SEND(fd, 2, 2, 0, 2, 0, 2);
	EXPECT(rig, fd, 2, 2, 1, 2);
	SEND(fd, 3, 3, 0, 7, 0, 2);
	EXPECT(rig, fd, 3, 3, 4, 0, 7, 0, 8);
	SEND(fd, 4, 4, 1, 0, 0, 1);
	EXPECT(rig, fd, 4, 4, 2, 1, 0);
	SEND(fd, 5, 5, 0, 1, 0xFF, 0);
	EXPECT(rig, fd, 5, 5, 0, 1, 0xFF, 0);
	SEND(fd, 6, 6, 0, 2, 0xAB, 0xCD);
	EXPECT(rig, fd, 6, 6, 0, 2, 0xAB, 0xCD);
	assert_int_equal(rig->registers[2], 0xABCD);
	SEND(fd, 7, 15, 0, 10, 0, 3, 1, 5);
	EXPECT(rig, fd, 7, 15, 0, 10, 0, 3);
	assert_int_equal(rig->registers[12], 1);
	SEND(fd, 8, 16, 0, 20, 0, 2, 4, 1, 2, 3, 4);
	EXPECT(rig, fd, 8, 16, 0, 20, 0, 2);
	assert_int_equal(rig->registers[21], 0x304);
	SEND(fd, 9, 17);
	EXPECT(rig, fd, 9, 17, 7, 1, 0xFF, 'u', 'n', 'i', 't', '1');
	rig->registers[30] = 0x12;
	SEND(fd, 10, 22, 0, 30, 0, 0xF2, 0, 0x25);
	EXPECT(rig, fd, 10, 22, 0, 30, 0, 0xF2, 0, 0x25);
	assert_int_equal(rig->registers[30], 0x17);
	SEND(fd, 11, 23, 0, 31, 0, 2, 0, 31, 0, 1, 2, 9, 9);
	EXPECT(rig, fd, 11, 23, 4, 9, 9, 0, 32);
	SEND(fd, 12, 43, 14, 4, 1);
	EXPECT(rig, fd, 12, 43, 14, 4, 0x82, 0, 0, 1, 1, 4, 'c', 'o', 'd', 'e');
	assert_int_equal(stats(rig).requests, 12);
	assert_int_equal(stats(rig).exceptions, 0);
	assert_int_equal(rig->connected, 1);
	close(fd);
	WAIT_FOR(rig, rig->connected == 0);
	assert_int_equal(stats(rig).clients, 0);
}

static void exceptions_keep_the_connection(void **state)
{
	static const uint8_t no_unit[] = { 0, 7, 0, 0, 0, 6, NO_UNIT, 3, 0, 0, 0, 1 };
	uint8_t got[9];
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 7);
	EXPECT(rig, fd, 1, 0x87, 1);
	SEND(fd, 2, 3, 0, 0, 0, 126);
	EXPECT(rig, fd, 2, 0x83, 3);
	SEND(fd, 3, 3, 0xFF, 0xFF, 0, 2);
	EXPECT(rig, fd, 3, 0x83, 2);
	SEND(fd, 4, 3, 0x10, 0, 0, 1);
	EXPECT(rig, fd, 4, 0x83, 2);
	SEND(fd, 5, 6, 0x10, 0, 0, 1);
	EXPECT(rig, fd, 5, 0x86, 2);
	SEND(fd, 6, 43, 14, 4, 5);
	EXPECT(rig, fd, 6, 0xAB, 2);
	send_bytes(fd, no_unit, sizeof(no_unit));
	receive(rig, fd, got, sizeof(got));
	assert_memory_equal(got, ((uint8_t[]){ 0, 7, 0, 0, 0, 3, NO_UNIT, 0x83, 0x0A }), 9);
	/* A write hidden behind a read in one frame. */
	SEND(fd, 8, 3, 0, 0, 0, 1, 0, 2, 0, 0, 0, 9, 5, 16, 0, 0, 0, 1, 2, 0, 1);
	EXPECT(rig, fd, 8, 0x83, 3);
	SEND(fd, 9, 3, 0, 1, 0, 1);
	EXPECT(rig, fd, 9, 3, 2, 0, 1);
	assert_int_equal(rig->writes, 0);
	assert_int_equal(stats(rig).exceptions, 8);
	assert_int_equal(stats(rig).exceptions_by_code[0x0A], 1);
	assert_int_equal(stats(rig).exceptions_by_code[0], 0);
	assert_int_equal(stats(rig).bad_frames, 0);
	close(fd);
}

static void answers_keep_their_order(void **state)
{
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 3, 0, 200, 0, 1);
	SEND(fd, 2, 6, 0, 200, 0x77, 0x77);
	SEND(fd, 3, 3, 0, 200, 0, 1);
	SEND(fd, 4, 6, 0, 201, 0, 1);
	SEND(fd, 5, 99);
	EXPECT(rig, fd, 1, 3, 2, 0, 200);
	expect_silence(rig, fd);
	/* Both writes were dispatched; the second ends first and has to wait. */
	assert_int_equal(rig->later, 2);
	finish(rig, 1, 4);
	expect_silence(rig, fd);
	finish(rig, 0, 0);
	EXPECT(rig, fd, 2, 6, 0, 200, 0x77, 0x77);
	EXPECT(rig, fd, 3, 3, 2, 0x77, 0x77);
	EXPECT(rig, fd, 4, 0x86, 4);
	EXPECT(rig, fd, 5, 0xE3, 1);
	/* A second answer to the same write is nobody's. */
	finish(rig, 0, 0);
	expect_silence(rig, fd);
	close(fd);
}

static void stop_overtakes(void **state)
{
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 16, 0, 200, 0, 1, 2, 0, 1);
	WAIT_FOR(rig, rig->later == 1);
	SEND(fd, 2, 6, 0, 210, 0, 1);
	WAIT_FOR(rig, rig->later == 2);
	expect_silence(rig, fd);
	/* This one cancels the first from inside the backend's write. */
	SEND(fd, 3, 6, STOP >> 8, STOP & 0xFF, 0, 1);
	EXPECT(rig, fd, 1, 0x90, 4);
	expect_silence(rig, fd);
	finish(rig, 1, 0);
	EXPECT(rig, fd, 2, 6, 0, 210, 0, 1);
	EXPECT(rig, fd, 3, 6, STOP >> 8, STOP & 0xFF, 0, 1);
	close(fd);
}

static void other_clients_stop_cancels(void **state)
{
	struct rig *rig = *state;
	int first, second;

	start(rig);
	first = connect_client(rig);
	second = connect_client(rig);
	SEND(first, 1, 6, 0, 200, 0, 1);
	WAIT_FOR(rig, rig->later == 1);
	SEND(second, 2, 6, STOP >> 8, STOP & 0xFF, 0, 1);
	EXPECT(rig, second, 2, 6, STOP >> 8, STOP & 0xFF, 0, 1);
	EXPECT(rig, first, 1, 0x86, 4);
	close(first);
	close(second);
}

static void mask_waits_for_its_register(void **state)
{
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 16, 0, 200, 0, 2, 4, 0, 0, 0x0F, 0x0F);
	SEND(fd, 2, 22, 0, 203, 0xFF, 0, 0, 0);
	SEND(fd, 3, 22, 0, 201, 0xFF, 0, 0, 1);
	SEND(fd, 4, 6, 0, 205, 0, 5);
	settle(rig);
	assert_int_equal(rig->later, 2);
	finish(rig, 1, 0);
	settle(rig);
	assert_int_equal(rig->later, 2);
	finish(rig, 0, 0);
	EXPECT(rig, fd, 1, 16, 0, 200, 0, 2);
	EXPECT(rig, fd, 2, 22, 0, 203, 0xFF, 0, 0, 0);
	assert_int_equal(rig->later, 4);
	assert_int_equal(rig->pending[2].values[0], 0x0F01);
	finish(rig, 3, 0);
	finish(rig, 2, 0);
	EXPECT(rig, fd, 3, 22, 0, 201, 0xFF, 0, 0, 1);
	EXPECT(rig, fd, 4, 6, 0, 205, 0, 5);
	close(fd);
}

static void write_and_read(void **state)
{
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 23, 0, 200, 0, 1, 0, 200, 0, 1, 2, 0x55, 0x66);
	WAIT_FOR(rig, rig->later == 1);
	expect_silence(rig, fd);
	finish(rig, 0, 0);
	EXPECT(rig, fd, 1, 23, 2, 0x55, 0x66);
	SEND(fd, 2, 23, 0, 200, 0, 1, 0, 200, 0, 1, 2, 0, 0);
	WAIT_FOR(rig, rig->later == 2);
	finish(rig, 1, 6);
	EXPECT(rig, fd, 2, 0x97, 6);
	/* Nothing is written when there is nothing to read; an old value does not keep it back. */
	SEND(fd, 3, 23, 0x10, 0, 0, 1, 0, 1, 0, 1, 2, 0, 0);
	EXPECT(rig, fd, 3, 0x97, 2);
	assert_int_equal(rig->writes, 2);
	SEND(fd, 4, 23, STALE >> 8, STALE & 0xFF, 0, 1, 0, 1, 0, 1, 2, 0, 9);
	EXPECT(rig, fd, 4, 0x97, 0x0B);
	assert_int_equal(rig->registers[1], 9);
	close(fd);
}

static void pipeline_limit(void **state)
{
	struct rig *rig = *state;
	int fd;

	rig->config.max_pipelined = 2;
	start(rig);
	fd = connect_client(rig);
	for (uint8_t i = 0; i < 4; i++)
		SEND(fd, i, 6, 0, 200, 0, i);
	settle(rig);
	assert_int_equal(rig->later, 2);
	finish(rig, 0, 0);
	settle(rig);
	assert_int_equal(rig->later, 3);
	finish(rig, 1, 0);
	finish(rig, 2, 0);
	settle(rig);
	finish(rig, 3, 0);
	for (uint8_t i = 0; i < 4; i++)
		EXPECT(rig, fd, i, 6, 0, 200, 0, i);
	close(fd);
}

static void many_clients(void **state)
{
	enum { CLIENTS = 100 };
	struct rig *rig = *state;
	int fds[CLIENTS], extra;

	rig->config.max_clients = CLIENTS;
	start(rig);
	for (int i = 0; i < CLIENTS; i++)
		fds[i] = connect_client(rig);
	extra = open_client(rig);
	expect_closed(rig, extra);
	assert_int_equal(stats(rig).refused_full, 1);
	assert_int_equal(stats(rig).clients, CLIENTS);
	for (uint16_t i = 0; i < CLIENTS; i++)
		SEND(fds[i], i, 3, 0, (uint8_t)i, 0, 1);
	for (uint16_t i = 0; i < CLIENTS; i++)
		EXPECT(rig, fds[i], i, 3, 2, 0, (uint8_t)i);
	for (int i = 0; i < CLIENTS; i++)
		close(fds[i]);
	WAIT_FOR(rig, stats(rig).clients == 0);
	assert_int_equal(stats(rig).clients_peak, CLIENTS);
	close(connect_client(rig));
}

static void slow_client_delays_nobody(void **state)
{
	static const uint8_t request[] = { 0, 9, 0, 0, 0, 6, 1, 3, 0, 3, 0, 1 };
	struct rig *rig = *state;
	int slow, other;

	start(rig);
	slow = connect_client(rig);
	other = connect_client(rig);
	for (uint16_t i = 0; i < sizeof(request); i++) {
		send_bytes(slow, request + i, 1);
		SEND(other, i, 3, 0, 1, 0, 1);
		EXPECT(rig, other, i, 3, 2, 0, 1);
	}
	EXPECT(rig, slow, 9, 3, 2, 0, 3);
	close(slow);
	close(other);
}

static void unfinished_frames_time_out(void **state)
{
	static const uint8_t part[] = { 0, 9, 0, 0, 0, 6, 1, 3, 0 };
	struct rig *rig = *state;
	int64_t began;
	int fd, quiet;

	rig->config.frame_timeout_ms = 100;
	start(rig);
	quiet = connect_client(rig);
	fd = connect_client(rig);
	began = now_ms();
	/* A whole request before it does not count, and more bytes do not prolong it. */
	SEND(fd, 1, 3, 0, 1, 0, 1);
	send_bytes(fd, part, sizeof(part));
	EXPECT(rig, fd, 1, 3, 2, 0, 1);
	while (now_ms() < began + 60)
		assert_true(sd_event_run(rig->loop, 5000) >= 0);
	send_bytes(fd, part, 1);
	expect_closed(rig, fd);
	assert_in_range(now_ms() - began, 95, 2000);
	assert_int_equal(stats(rig).timeouts, 1);
	SEND(quiet, 1, 3, 0, 1, 0, 1);
	EXPECT(rig, quiet, 1, 3, 2, 0, 1);
	close(quiet);
}

static void idle_clients_time_out(void **state)
{
	struct rig *rig = *state;
	int idle, busy;

	rig->config.idle_timeout_s = 1;
	start(rig);
	busy = connect_client(rig);
	SEND(busy, 1, 6, 0, 200, 0, 1);
	WAIT_FOR(rig, rig->later == 1);
	idle = connect_client(rig);
	expect_closed(rig, idle);
	assert_int_equal(stats(rig).timeouts, 1);
	finish(rig, 0, 0);
	EXPECT(rig, busy, 1, 6, 0, 200, 0, 1);
	expect_closed(rig, busy);
}

static void broken_frames_close(void **state)
{
	static const uint8_t frames[][12] = {
		{ 0, 1, 0x12, 0x34, 0, 6, 1, 3, 0, 0, 0, 1 },
		{ 0, 1, 0, 0, 0, 0, 1, 3, 0, 0, 0, 1 },
		{ 0, 1, 0, 0, 0, 1, 1, 3, 0, 0, 0, 1 },
		{ 0, 1, 0, 0, 0, 255, 1, 3, 0, 0, 0, 1 },
	};
	struct rig *rig = *state;
	int fd;

	start(rig);
	for (unsigned i = 0; i < 4; i++) {
		fd = connect_client(rig);
		SEND(fd, 7, 3, 0, 1, 0, 1);
		EXPECT(rig, fd, 7, 3, 2, 0, 1);
		send_bytes(fd, frames[i], sizeof(frames[i]));
		expect_closed(rig, fd);
		assert_int_equal(stats(rig).bad_frames, i + 1);
	}
}

/* Sends reads of 125 registers until the server does not take any more; returns the bytes sent. */
static size_t flood(struct rig *rig, int fd, int other)
{
	static const uint8_t request[] = { 0, 0, 0, 0, 0, 6, 1, 3, 0, 0, 0, 125 };
	size_t total = 0;
	unsigned refused = 0;
	ssize_t sent;

	while (refused < 10) {
		sent = send(fd, request + total % 12, 12 - total % 12, MSG_DONTWAIT | MSG_NOSIGNAL);
		if (sent > 0) {
			total += (size_t)sent;
			refused = 0;
			continue;
		}
		assert_int_equal(errno, EAGAIN);
		refused++;
		SEND(other, 1, 3, 0, 1, 0, 1);
		EXPECT(rig, other, 1, 3, 2, 0, 1);
		settle(rig);
	}
	return total;
}

static void flood_is_held_back(void **state)
{
	const int small = 16384;
	struct rig *rig = *state;
	uint8_t answer[259];
	int fd, other;
	size_t sent;

	start(rig);
	other = connect_client(rig);
	fd = connect_client(rig);
	assert_int_equal(setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &small, sizeof(small)), 0);
	sent = flood(rig, fd, other);
	/* What was answered is in the two kernels' buffers and one batch; it is far from all. */
	assert_true((stats(rig).requests - 10) * 259 < 1024 * 1024);
	assert_true(stats(rig).requests < sent / 12);
	for (size_t i = 0; i < sent / 12; i++) {
		receive(rig, fd, answer, sizeof(answer));
		assert_int_equal(answer[8], 250);
		assert_int_equal(answer[258], 124);
	}
	expect_silence(rig, fd);
	close(fd);
	close(other);
}

static void readers_may_not_write(void **state)
{
	struct db_network elsewhere = { .address = { [10] = 0xFF, [11] = 0xFF, [12] = 10 },
		                        .prefix = 104 };
	struct rig *rig = *state;
	int fd;

	rig->config.allow_write = &elsewhere;
	rig->config.allow_write_count = 1;
	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 6, 0, 1, 0, 1);
	EXPECT(rig, fd, 1, 0x86, 1);
	SEND(fd, 2, 22, 0, 1, 0, 1, 0, 0);
	EXPECT(rig, fd, 2, 0x96, 1);
	SEND(fd, 3, 3, 0, 1, 0, 1);
	EXPECT(rig, fd, 3, 3, 2, 0, 1);
	assert_int_equal(rig->writes, 0);
	assert_int_equal(stats(rig).refused_writes, 2);
	close(fd);
}

static void strangers_are_closed(void **state)
{
	struct db_network elsewhere = { .address = { [10] = 0xFF, [11] = 0xFF, [12] = 10 },
		                        .prefix = 104 };
	struct rig *rig = *state;

	rig->config.allow_write = rig->config.allow_read = &elsewhere;
	rig->config.allow_write_count = rig->config.allow_read_count = 1;
	start(rig);
	expect_closed(rig, open_client(rig));
	assert_int_equal(stats(rig).refused_address, 1);
	assert_int_equal(stats(rig).accepted, 0);
}

/* 127.0.0.`last` and nothing else. */
static struct db_network only(uint8_t last)
{
	return (struct db_network){
		.address = { [10] = 0xFF, [11] = 0xFF, [12] = 127, [15] = last },
		.prefix = 128,
	};
}

static void readers_leave_room_for_writers(void **state)
{
	enum { PLACES = 5, RESERVED = 2 };
	struct db_network writers = only(9);
	struct rig *rig = *state;
	int readers[PLACES], fds[PLACES];

	rig->config.max_clients = PLACES;
	rig->config.reserved_writers = RESERVED;
	rig->config.allow_write = &writers;
	rig->config.allow_write_count = 1;
	start(rig);
	for (int i = 0; i < PLACES - RESERVED; i++)
		readers[i] = connect_client_from(rig, 1);
	expect_closed(rig, open_client_from(rig, 2));
	assert_int_equal(stats(rig).refused_reserved, 1);
	for (int i = 0; i < RESERVED; i++)
		fds[i] = connect_client_from(rig, 9);
	expect_closed(rig, open_client_from(rig, 9));
	assert_int_equal(stats(rig).refused_full, 1);
	/* A reader's place is for anybody, a writer's for a writer. */
	close(fds[0]);
	WAIT_FOR(rig, stats(rig).clients == PLACES - 1);
	expect_closed(rig, open_client_from(rig, 1));
	assert_int_equal(stats(rig).refused_reserved, 2);
	close(readers[0]);
	WAIT_FOR(rig, stats(rig).clients == PLACES - 2);
	readers[0] = connect_client_from(rig, 2);
	fds[0] = connect_client_from(rig, 9);
	SEND(fds[0], 1, 6, 0, 1, 0, 1);
	EXPECT(rig, fds[0], 1, 6, 0, 1, 0, 1);
	for (int i = 0; i < PLACES - RESERVED; i++)
		close(readers[i]);
	close(fds[0]);
	close(fds[1]);
}

static void writers_may_take_every_place(void **state)
{
	struct rig *rig = *state;
	int fds[3];

	rig->config.max_clients = 3;
	rig->config.reserved_writers = 2;
	start(rig);
	for (int i = 0; i < 3; i++)
		fds[i] = connect_client(rig);
	for (int i = 0; i < 3; i++)
		close(fds[i]);
}

static void connections_of_one_address(void **state)
{
	struct rig *rig = *state;
	int first, second, other;

	rig->config.max_clients_per_address = 2;
	start(rig);
	first = connect_client_from(rig, 2);
	second = connect_client_from(rig, 2);
	expect_closed(rig, open_client_from(rig, 2));
	assert_int_equal(stats(rig).refused_per_address, 1);
	other = connect_client_from(rig, 3);
	close(first);
	WAIT_FOR(rig, stats(rig).clients == 2);
	first = connect_client_from(rig, 2);
	assert_int_equal(stats(rig).refused_per_address, 1);
	close(first);
	close(second);
	close(other);
}

/* Twenty a second from one address, two connections of it, and somebody else. */
static void too_many_requests_wait(void **state)
{
	enum { RATE = 20, REQUESTS = 15 };
	struct rig *rig = *state;
	int64_t began, took;
	int fds[2], other;

	rig->config.max_requests_per_second = RATE;
	rig->config.idle_timeout_s = 1;
	rig->config.frame_timeout_ms = 100;
	start(rig);
	fds[0] = connect_client_from(rig, 2);
	fds[1] = connect_client_from(rig, 2);
	other = connect_client_from(rig, 3);
	began = now_ms();
	for (uint16_t i = 0; i < REQUESTS; i++) {
		SEND(fds[0], i, 3, 0, 1, 0, 1);
		SEND(fds[1], i, 6, 0, 5, 0, (uint8_t)i);
	}
	settle(rig);
	assert_in_range(stats(rig).held_back, 1, 2);
	SEND(other, 1, 3, 0, 2, 0, 1);
	EXPECT(rig, other, 1, 3, 2, 0, 2);
	assert_true(now_ms() - began < 1000);
	/* Every one is answered, in order, and nobody is closed for the time it took. */
	for (uint16_t i = 0; i < REQUESTS; i++) {
		EXPECT(rig, fds[0], i, 3, 2, 0, 1);
		EXPECT(rig, fds[1], i, 6, 0, 5, 0, (uint8_t)i);
	}
	took = now_ms() - began;
	/* All but the two that come at once. */
	assert_in_range(took, (2 * REQUESTS - 2) * 1000 / RATE - 10, 5000);
	assert_int_equal(rig->writes, REQUESTS);
	assert_int_equal(stats(rig).exceptions, 0);
	close(fds[0]);
	close(fds[1]);
	close(other);
}

static db_time now_ns(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (db_time)t.tv_sec * DB_NS_PER_S + t.tv_nsec;
}

/* It is for nobody to serve for that time. */
static void let_pass(unsigned ms)
{
	poll(NULL, 0, (int)ms);
}

/* The backend is told when a request came, not when it is its turn: also of one that had not left the
 * kernel when its client was held back. */
static void what_waits_is_as_old_as_it_is(void **state)
{
	enum { RATE = 100, REQUESTS = 60 };
	struct rig *rig = *state;
	db_time sent, done;
	int fd;

	rig->config.max_requests_per_second = RATE;
	start(rig);
	fd = connect_client(rig);
	for (uint16_t i = 0; i < REQUESTS; i++)
		SEND(fd, i, 6, 0, 5, 0, (uint8_t)i);
	settle(rig);
	sent = now_ns();
	for (uint16_t i = 0; i < REQUESTS; i++)
		EXPECT(rig, fd, i, 6, 0, 5, 0, (uint8_t)i);
	done = now_ns();
	assert_true(done - sent > 300 * DB_NS_PER_MS);
	assert_true(rig->arrived <= sent);
	/* What comes then is of now again. */
	let_pass(200);
	for (uint16_t i = 0; i < 2; i++) {
		SEND(fd, i, 6, 0, 5, 0, 1);
		EXPECT(rig, fd, i, 6, 0, 5, 0, 1);
	}
	assert_true(rig->arrived > done);
	close(fd);
}

/* Without a pace: what came while nothing was read, because the client took no answers. */
static void what_came_in_a_pause_is_no_younger(void **state)
{
	static const uint8_t write_pdu[] = { 6, 0, LATER, 0, 1 };
	static const uint8_t mask_pdu[] = { 22, 0, LATER, 0, 0, 0, 2 };
	struct rig *rig = *state;
	uint8_t both[64];
	db_time paused;
	size_t length;
	int fd;

	start(rig);
	fd = connect_client(rig);
	length = make(both, 1, write_pdu, sizeof(write_pdu));
	length += make(both + length, 2, mask_pdu, sizeof(mask_pdu));
	for (unsigned i = 0; i < 8; i += 2) {
		/* The FC 22 waits for the write before it. */
		send_bytes(fd, both, length);
		WAIT_FOR(rig, rig->later == i + 1);
		paused = now_ns();
		let_pass(30);
		SEND(fd, 3, 3, 0, 1, 0, 1);
		let_pass(30);
		finish(rig, rig->later - 1, 0);
		assert_int_equal(rig->later, i + 2);
		finish(rig, rig->later - 1, 0);
		EXPECT(rig, fd, 1, 6, 0, LATER, 0, 1);
		EXPECT(rig, fd, 2, 22, 0, LATER, 0, 0, 0, 2);
		EXPECT(rig, fd, 3, 3, 2, 0, 1);
		assert_true(rig->arrived <= paused + 30 * DB_NS_PER_MS);
	}
	close(fd);
}

/* It may have gone long before. */
static void who_has_closed_its_side_shows_no_life(void **state)
{
	struct rig *rig = *state;
	db_time connected;
	int fd;

	start(rig);
	fd = connect_client(rig);
	connected = now_ns();
	let_pass(30);
	SEND(fd, 1, 6, 0, 5, 0, 1);
	assert_int_equal(shutdown(fd, SHUT_WR), 0);
	EXPECT(rig, fd, 1, 6, 0, 5, 0, 1);
	assert_true(rig->arrived <= connected);
	close(fd);
}

/* Everybody is served once by it, however many they are. */
static void catching_up_serves_everybody(void **state)
{
	enum { CLIENTS = 64 };
	struct rig *rig = *state;
	int fds[CLIENTS];

	start(rig);
	for (size_t i = 0; i < CLIENTS; i++)
		fds[i] = connect_client(rig);
	for (size_t i = 0; i < CLIENTS; i++)
		SEND(fds[i], 1, 6, 0, 5, 0, 1);
	db_server_catch_up(rig->server);
	assert_int_equal(rig->writes, CLIENTS);
	for (size_t i = 0; i < CLIENTS; i++)
		close(fds[i]);
}

static void a_held_back_client_may_vanish(void **state)
{
	struct rig *rig = *state;
	int fd;

	rig->config.max_requests_per_second = 1;
	start(rig);
	fd = connect_client(rig);
	for (uint16_t i = 0; i < 50; i++)
		SEND(fd, i, 3, 0, 1, 0, 1);
	EXPECT(rig, fd, 0, 3, 2, 0, 1);
	close(fd);
	WAIT_FOR(rig, rig->connected == 0);
	assert_true(stats(rig).requests <= 3);
}

static void who_is_connected(void **state)
{
	struct db_network writers = only(2);
	struct db_server_client clients[4];
	struct rig *rig = *state;
	char text[DB_CLIENT_ADDRESS_MAX];
	char shown[DB_CLIENT_ADDRESS_MAX];
	int fds[3];

	rig->config.allow_write = &writers;
	rig->config.allow_write_count = 1;
	start(rig);
	assert_int_equal(db_server_clients(rig->server, clients, 4), 0);
	for (uint32_t i = 0; i < 3; i++)
		fds[i] = connect_client_from(rig, i + 1);
	SEND(fds[1], 1, 3, 0, 1, 0, 1);
	EXPECT(rig, fds[1], 1, 3, 2, 0, 1);
	assert_int_equal(db_server_clients(rig->server, clients, 2), 2);
	assert_int_equal(db_server_clients(rig->server, clients, 4), 3);
	for (unsigned i = 0; i < 3; i++) {
		assert_int_equal(clients[i].client.address[15], i + 1);
		assert_int_equal(clients[i].client.may_write, i == 1);
		assert_int_equal(clients[i].requests, i == 1);
		assert_int_not_equal(clients[i].client.port, 0);
		assert_in_range(clients[i].idle, 0, PATIENCE_MS * DB_NS_PER_MS);
	}
	/* A client on this machine: the tests' own user. */
	snprintf(shown, sizeof shown, "127.0.0.3, user %u", (unsigned)geteuid());
	db_client_address(clients[2].client.address, text);
	assert_string_equal(text, shown);
	/* The others keep their order. */
	close(fds[0]);
	WAIT_FOR(rig, stats(rig).clients == 2);
	assert_int_equal(db_server_clients(rig->server, clients, 4), 2);
	assert_int_equal(clients[0].client.address[15], 2);
	assert_int_equal(clients[1].client.address[15], 3);
	/* What the backend refuses counts here. */
	db_server_refused(rig->server, &clients[0].client, DB_REFUSED_CONTROL);
	assert_int_equal(stats(rig).refused_control, 1);
	clients[0].client.id = 0;
	db_server_refused(rig->server, &clients[0].client, DB_REFUSED_CONTROL);
	assert_int_equal(stats(rig).refused_control, 1);
	close(fds[1]);
	close(fds[2]);
}

static int option_of(int fd, int level, int name)
{
	int value = -1;
	socklen_t length = sizeof(value);

	assert_int_equal(getsockopt(fd, level, name, &value, &length), 0);
	return value;
}

static void sockets_are_tuned(void **state)
{
	int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

	(void)state;
	db_listener_tune(fd);
	assert_int_equal(option_of(fd, IPPROTO_TCP, TCP_NODELAY), 1);
	assert_int_equal(option_of(fd, SOL_SOCKET, SO_KEEPALIVE), 1);
	assert_int_equal(option_of(fd, IPPROTO_TCP, TCP_KEEPIDLE), 10);
	assert_int_equal(option_of(fd, IPPROTO_TCP, TCP_KEEPINTVL), 10);
	assert_int_equal(option_of(fd, IPPROTO_TCP, TCP_KEEPCNT), 3);
	assert_int_equal(option_of(fd, IPPROTO_TCP, TCP_USER_TIMEOUT), 40000);
	close(fd);
}

static void answers_to_nobody(void **state)
{
	struct linger reset = { .l_onoff = 1, .l_linger = 0 };
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 6, 0, 200, 0, 1);
	WAIT_FOR(rig, rig->later == 1);
	/* Reset, and another client comes in its place. */
	assert_int_equal(setsockopt(fd, SOL_SOCKET, SO_LINGER, &reset, sizeof(reset)), 0);
	close(fd);
	WAIT_FOR(rig, rig->connected == 0);
	fd = connect_client(rig);
	SEND(fd, 2, 6, 0, 201, 0, 1);
	WAIT_FOR(rig, rig->later == 2);
	finish(rig, 0, 0);
	expect_silence(rig, fd);
	finish(rig, 1, 0);
	EXPECT(rig, fd, 2, 6, 0, 201, 0, 1);
	/* The server goes with a write pending. */
	SEND(fd, 3, 6, 0, 202, 0, 1);
	WAIT_FOR(rig, rig->later == 3);
	db_server_free(rig->server);
	rig->server = NULL;
	assert_int_equal(rig->connected, 0);
	expect_closed(rig, fd);
}

static void half_closed_gets_its_answers(void **state)
{
	struct rig *rig = *state;
	int fd;

	start(rig);
	fd = connect_client(rig);
	SEND(fd, 1, 6, 0, 200, 0, 1);
	SEND(fd, 2, 3, 0, 200, 0, 1);
	shutdown(fd, SHUT_WR);
	settle(rig);
	assert_int_equal(rig->later, 1);
	assert_int_equal(rig->connected, 1);
	finish(rig, 0, 0);
	EXPECT(rig, fd, 1, 6, 0, 200, 0, 1);
	EXPECT(rig, fd, 2, 3, 2, 0, 1);
	expect_closed(rig, fd);
}

static void survives_without_descriptors(void **state)
{
	struct rlimit before, few;
	struct rig *rig = *state;
	int spare[64], fd, count = 0, runs = 0;
	int64_t end;

	start(rig);
	assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
	few = before;
	few.rlim_cur = 64;
	assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
	fd = open_client(rig);
	while (count < 64 && (spare[count] = dup(fd)) >= 0)
		count++;
	for (end = now_ms() + 50; now_ms() < end; runs++)
		assert_true(sd_event_run(rig->loop, 5000) >= 0);
	assert_int_equal(stats(rig).accepted, 0);
	/* 5 ms each, if it does not spin. */
	assert_true(runs < 40);
	while (count > 0)
		close(spare[--count]);
	assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
	SEND(fd, 1, 3, 0, 1, 0, 1);
	EXPECT(rig, fd, 1, 3, 2, 0, 1);
	close(fd);
}

static void listens_on_ipv6(void **state)
{
	struct sockaddr_in6 address = { .sin6_family = AF_INET6 };
	struct rig *rig = *state;
	int error, fd;

	strcpy(rig->listen, "[::1]:0");
	error = db_server_new(rig->loop, &rig->config, &BACKEND, rig, &QUIET, &rig->server, &where);
	if (error == -EADDRNOTAVAIL || error == -EAFNOSUPPORT)
		skip();
	assert_int_equal(error, 0);
	address.sin6_addr = in6addr_loopback;
	address.sin6_port = htons(db_server_port(rig->server, DB_ENDPOINT_FIRST));
	fd = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
	assert_int_equal(connect(fd, (struct sockaddr *)&address, sizeof(address)), 0);
	SEND(fd, 1, 6, 0, 1, 0, 1);
	EXPECT(rig, fd, 1, 6, 0, 1, 0, 1);
	close(fd);
}

static void errors_of_new(void **state)
{
	struct rig *rig = *state;
	struct db_server *second = NULL;

	start(rig);
	snprintf(rig->listen, sizeof(rig->listen), "127.0.0.1:%u",
	         db_server_port(rig->server, DB_ENDPOINT_FIRST));
	assert_int_equal(
		db_server_new(rig->loop, &rig->config, &BACKEND, rig, &QUIET, &second, &where),
		-EADDRINUSE);
	strcpy(rig->listen, "localhost");
	assert_int_equal(
		db_server_new(rig->loop, &rig->config, &BACKEND, rig, &QUIET, &second, &where),
		-EINVAL);
	assert_null(second);
}

/* Other settings while it serves. rig->config and rig->next take turns. */

static void copy_settings(struct rig *rig)
{
	rig->next = rig->config;
	strcpy(rig->next_listen, rig->listen);
	rig->next.listen = rig->next_listen;
}

static int change(struct rig *rig, const struct db_modbus_config *config)
{
	struct db_server_change *made = NULL;
	int error = db_server_prepare(rig->server, config, &made, &where);

	if (error == 0)
		db_server_apply(rig->server, made);
	else
		assert_null(made);
	return error;
}

static void expect_served(struct rig *rig, int fd)
{
	SEND(fd, 77, 3, 0, 7, 0, 1);
	EXPECT(rig, fd, 77, 3, 2, 0, 7);
}

static int connect_to(uint32_t address, uint16_t port)
{
	struct sockaddr_in to = { .sin_family = AF_INET };
	int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

	to.sin_addr.s_addr = htonl(address);
	to.sin_port = htons(port);
	if (connect(fd, (struct sockaddr *)&to, sizeof(to)) == 0)
		return fd;
	close(fd);
	return -1;
}

static struct db_endpoint_config endpoint_at(char *name, char *listen)
{
	return (struct db_endpoint_config){
		.name = name, .number = db_endpoint_number(name), .listen = listen, .max_clients = 2
	};
}

static void expect_served_at(struct rig *rig, int fd, const char *endpoint)
{
	expect_served(rig, fd);
	assert_int_equal(asked_endpoint, db_endpoint_number(endpoint));
}

static int connect_at(const struct rig *rig, const char *endpoint)
{
	return connect_to(INADDR_LOOPBACK,
	                  db_server_port(rig->server, db_endpoint_number(endpoint)));
}

static void endpoints_exchange_their_ports(void **state)
{
	struct rig *rig = *state;
	static char name_a[] = "a";
	static char name_b[] = "b";
	static char listen_a[32] = "127.0.0.1:0";
	static char listen_b[32] = "127.0.0.1:0";
	/* The server is ended after this function. */
	static struct db_endpoint_config before[2];
	static struct db_endpoint_config after[2];
	static char swapped[2][32];
	int a, b, first, full;

	before[0] = endpoint_at(name_a, listen_a);
	before[1] = endpoint_at(name_b, listen_b);
	rig->config.endpoints = before;
	rig->config.endpoint_count = 2;
	start(rig);
	a = connect_at(rig, "a");
	b = connect_at(rig, "b");
	first = connect_client(rig);
	expect_served_at(rig, a, "a");
	expect_served_at(rig, b, "b");
	expect_served_at(rig, first, "");
	/* The places of each are its own. */
	expect_served_at(rig, full = connect_at(rig, "a"), "a");
	expect_closed(rig, connect_at(rig, "a"));
	expect_served_at(rig, connect_at(rig, "b"), "b");
	close(full);
	/* Each listens on fixed ports from now on, in the other order of the file. */
	snprintf(swapped[0], sizeof(swapped[0]), "127.0.0.1:%u",
	         db_server_port(rig->server, before[0].number));
	snprintf(swapped[1], sizeof(swapped[1]), "127.0.0.1:%u",
	         db_server_port(rig->server, before[1].number));
	copy_settings(rig);
	after[0] = endpoint_at(name_b, swapped[0]);
	after[1] = endpoint_at(name_a, swapped[1]);
	rig->next.endpoints = after;
	assert_int_equal(change(rig, &rig->next), 0);
	/* A client stays where it is connected; a new connection gets what the port stands for. */
	expect_served_at(rig, a, "a");
	expect_served_at(rig, b, "b");
	close(b);
	settle(rig);
	expect_served_at(rig,
	                 connect_to(INADDR_LOOPBACK, (uint16_t)atoi(strrchr(swapped[0], ':') + 1)),
	                 "b");
	/* An endpoint that is gone takes its clients with it, and nobody else's. */
	rig->config = rig->next;
	rig->config.endpoint_count = 1;
	assert_int_equal(change(rig, &rig->config), 0);
	expect_closed(rig, a);
	expect_served_at(rig, first, "");
	close(first);
}

static void listens_elsewhere(void **state)
{
	struct rig *rig = *state;
	uint16_t port;
	int stays, late, other;

	start(rig);
	port = db_server_port(rig->server, DB_ENDPOINT_FIRST);
	stays = connect_client(rig);
	SEND(stays, 1, 6, 0, LATER, 0, 5);
	copy_settings(rig);
	strcpy(rig->next_listen, "127.0.0.2:0");
	settle(rig);
	/* Knocked at the old address and was not let in yet. */
	late = connect_to(INADDR_LOOPBACK, port);
	assert_true(late >= 0);
	assert_int_equal(change(rig, &rig->next), 0);
	assert_int_equal(connect_to(INADDR_LOOPBACK, port), -1);
	other = connect_to(INADDR_LOOPBACK + 1, db_server_port(rig->server, DB_ENDPOINT_FIRST));
	assert_true(other >= 0);
	expect_served(rig, other);
	expect_served(rig, late);
	/* What was in flight is answered. */
	finish(rig, 0, 0);
	EXPECT(rig, stays, 1, 6, 0, LATER, 0, 5);
	expect_served(rig, stays);
	close(other);
	close(late);
	close(stays);
}

/* On a port of one address that is free at all of them: below those that the kernel gives to every
 * program's connections, one of which may always be in the way. */
static uint16_t start_where_all_is_free(struct rig *rig)
{
	unsigned port = 10000 + (unsigned)getpid() % 20000;

	for (unsigned tries = 0; tries < 100; tries++, port++) {
		char everywhere[32];
		int probe;

		snprintf(everywhere, sizeof(everywhere), "0.0.0.0:%u", port);
		probe = db_listener_open(NULL, 0, everywhere);
		if (probe < 0)
			continue;
		close(probe);
		snprintf(rig->listen, sizeof(rig->listen), "127.0.0.1:%u", port);
		start(rig);
		return (uint16_t)port;
	}
	fail_msg("no port is free");
	return 0;
}

/* From one address to all of the machine's, and back: the ports are in each other's way. */
static void listens_on_the_same_port(void **state)
{
	struct rig *rig = *state;
	struct db_server *second = NULL;
	uint16_t port = start_where_all_is_free(rig);
	int stays, other;

	stays = connect_client(rig);
	copy_settings(rig);
	snprintf(rig->next_listen, sizeof(rig->next_listen), "0.0.0.0:%u", port);
	assert_int_equal(change(rig, &rig->next), 0);
	assert_int_equal(db_server_port(rig->server, DB_ENDPOINT_FIRST), port);
	other = connect_to(INADDR_LOOPBACK + 1, port);
	assert_true(other >= 0);
	expect_served(rig, other);
	close(other);
	/* Nobody else gets in there. */
	assert_int_equal(
		db_server_new(rig->loop, &rig->next, &BACKEND, rig, &QUIET, &second, &where),
		-EADDRINUSE);
	snprintf(rig->listen, sizeof(rig->listen), "127.0.0.1:%u", port);
	assert_int_equal(change(rig, &rig->config), 0);
	assert_int_equal(connect_to(INADDR_LOOPBACK + 1, port), -1);
	expect_served(rig, stays);
	close(stays);
}

static void where_it_cannot_listen_it_stays(void **state)
{
	struct rig *rig = *state;
	struct sockaddr_in taken = { .sin_family = AF_INET };
	socklen_t length = sizeof(taken);
	int fd, blocker = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

	taken.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	assert_int_equal(bind(blocker, (struct sockaddr *)&taken, sizeof(taken)), 0);
	assert_int_equal(listen(blocker, 1), 0);
	assert_int_equal(getsockname(blocker, (struct sockaddr *)&taken, &length), 0);
	start(rig);
	fd = connect_client(rig);
	copy_settings(rig);
	rig->next.allow_write_count = 0;
	snprintf(rig->next_listen, sizeof(rig->next_listen), "127.0.0.1:%u", ntohs(taken.sin_port));
	assert_int_equal(change(rig, &rig->next), -EADDRINUSE);
	expect_served(rig, fd);
	close(fd);
	fd = connect_client(rig);
	expect_served(rig, fd);
	close(fd);
	close(blocker);
}

static void rights_are_looked_at_again(void **state)
{
	struct rig *rig = *state;
	struct db_network first = only(1);
	struct db_network second = only(2);
	int writer, reader, stranger;

	start(rig);
	writer = connect_client_from(rig, 1);
	reader = connect_client_from(rig, 2);
	stranger = connect_client_from(rig, 3);
	SEND(stranger, 1, 6, 0, LATER, 0, 5);
	SEND(reader, 1, 6, 0, LATER, 0, 5);
	WAIT_FOR(rig, rig->later == 2);
	copy_settings(rig);
	rig->next.allow_write = &first;
	rig->next.allow_write_count = 1;
	rig->next.allow_read = &second;
	rig->next.allow_read_count = 1;
	assert_int_equal(change(rig, &rig->next), 0);
	assert_int_equal(rig->restricted, 1);
	expect_closed(rig, stranger);
	assert_int_equal(rig->connected, 2);
	/* What it was allowed to write when it did so is answered; it can write no more. */
	finish(rig, 0, 0);
	finish(rig, 1, 0);
	EXPECT(rig, reader, 1, 6, 0, LATER, 0, 5);
	SEND(reader, 2, 6, 0, 1, 0, 5);
	EXPECT(rig, reader, 2, 0x86, 1);
	expect_served(rig, reader);
	SEND(writer, 3, 6, 0, 1, 0, 5);
	EXPECT(rig, writer, 3, 6, 0, 1, 0, 5);
	/* And the right comes back. */
	assert_int_equal(stats(rig).clients, 2);
	rig->config = rig->next;
	rig->config.allow_write = &second;
	assert_int_equal(change(rig, &rig->config), 0);
	SEND(reader, 4, 6, 0, 1, 0, 6);
	EXPECT(rig, reader, 4, 6, 0, 1, 0, 6);
	assert_int_equal(rig->restricted, 1);
	expect_closed(rig, writer);
	close(reader);
}

static void other_numbers_of_places(void **state)
{
	struct rig *rig = *state;
	int fds[6];

	rig->config.max_clients = 2;
	start(rig);
	fds[0] = connect_client(rig);
	fds[1] = connect_client(rig);
	copy_settings(rig);
	rig->next.max_clients = 200;
	assert_int_equal(change(rig, &rig->next), 0);
	for (unsigned i = 2; i < 6; i++)
		fds[i] = connect_client_from(rig, i);
	/* Those that are there stay, new ones find no place. */
	rig->config = rig->next;
	rig->config.max_clients = 3;
	assert_int_equal(change(rig, &rig->config), 0);
	for (unsigned i = 0; i < 6; i++)
		expect_served(rig, fds[i]);
	expect_closed(rig, open_client(rig));
	assert_int_equal(stats(rig).refused_full, 1);
	for (unsigned i = 0; i < 4; i++)
		close(fds[i]);
	WAIT_FOR(rig, rig->connected == 2);
	fds[0] = connect_client(rig);
	expect_served(rig, fds[0]);
	expect_closed(rig, open_client(rig));
	close(fds[0]);
	close(fds[4]);
	close(fds[5]);
}

/* An address whose connections end with a reload that also makes more room may come back. */
static void who_is_closed_out_is_counted_out(void **state)
{
	struct db_network others = only(3);
	struct rig *rig = *state;
	int barred, stays;

	rig->config.max_clients = 2;
	rig->config.max_clients_per_address = 1;
	start(rig);
	barred = connect_client_from(rig, 2);
	stays = connect_client_from(rig, 3);
	copy_settings(rig);
	rig->next.max_clients = 200;
	rig->next.allow_read = rig->next.allow_write = &others;
	rig->next.allow_read_count = rig->next.allow_write_count = 1;
	assert_int_equal(change(rig, &rig->next), 0);
	expect_closed(rig, barred);
	expect_served(rig, stays);
	rig->config = rig->next;
	rig->config.allow_read_count = rig->config.allow_write_count = 0;
	assert_int_equal(change(rig, &rig->config), 0);
	barred = connect_client_from(rig, 2);
	expect_served(rig, barred);
	/* Still one of each. */
	expect_closed(rig, open_client_from(rig, 2));
	expect_closed(rig, open_client_from(rig, 3));
	close(barred);
	close(stays);
}

static void another_number_in_flight(void **state)
{
	struct rig *rig = *state;
	int fd;

	rig->config.max_pipelined = 3;
	start(rig);
	fd = connect_client(rig);
	for (uint16_t i = 0; i < 5; i++)
		SEND(fd, i, 6, 0, LATER, 0, (uint8_t)i);
	WAIT_FOR(rig, rig->later == 3);
	settle(rig);
	copy_settings(rig);
	rig->next.max_pipelined = 1;
	assert_int_equal(change(rig, &rig->next), 0);
	for (unsigned i = 0; i < 5; i++) {
		/* Of those that wait only one at a time is taken up. */
		assert_int_equal(rig->later, i < 3 ? 3 : i + 1);
		finish(rig, i, 0);
		EXPECT(rig, fd, (uint16_t)i, 6, 0, LATER, 0, (uint8_t)i);
	}
	rig->config = rig->next;
	rig->config.max_pipelined = 4;
	assert_int_equal(change(rig, &rig->config), 0);
	for (uint16_t i = 0; i < 4; i++)
		SEND(fd, i, 6, 0, LATER, 0, (uint8_t)i);
	WAIT_FOR(rig, rig->later == 9);
	close(fd);
}

static void another_pace(void **state)
{
	struct rig *rig = *state;
	int fd;

	rig->config.max_requests_per_second = 1;
	start(rig);
	fd = connect_client(rig);
	expect_served(rig, fd);
	for (uint16_t i = 0; i < 20; i++)
		SEND(fd, i, 3, 0, 7, 0, 1);
	settle(rig);
	copy_settings(rig);
	rig->next.max_requests_per_second = 0;
	assert_int_equal(change(rig, &rig->next), 0);
	/* At one a second they would take longer than the test's patience. */
	for (uint16_t i = 0; i < 20; i++)
		EXPECT(rig, fd, i, 3, 2, 0, 7);
	close(fd);
}

static void shorter_patience(void **state)
{
	struct rig *rig = *state;
	int idle, slow;

	start(rig);
	idle = connect_client(rig);
	slow = connect_client(rig);
	send_bytes(slow, "\0\1", 2);
	settle(rig);
	copy_settings(rig);
	rig->next.idle_timeout_s = 1;
	rig->next.frame_timeout_ms = 100;
	assert_int_equal(change(rig, &rig->next), 0);
	expect_closed(rig, slow);
	expect_closed(rig, idle);
	assert_int_equal(stats(rig).timeouts, 2);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(every_function),
		TEST(exceptions_keep_the_connection),
		TEST(answers_keep_their_order),
		TEST(stop_overtakes),
		TEST(other_clients_stop_cancels),
		TEST(mask_waits_for_its_register),
		TEST(write_and_read),
		TEST(pipeline_limit),
		TEST(many_clients),
		TEST(slow_client_delays_nobody),
		TEST(unfinished_frames_time_out),
		TEST(idle_clients_time_out),
		TEST(broken_frames_close),
		TEST(flood_is_held_back),
		TEST(readers_may_not_write),
		TEST(strangers_are_closed),
		TEST(readers_leave_room_for_writers),
		TEST(writers_may_take_every_place),
		TEST(connections_of_one_address),
		TEST(too_many_requests_wait),
		TEST(what_waits_is_as_old_as_it_is),
		TEST(what_came_in_a_pause_is_no_younger),
		TEST(who_has_closed_its_side_shows_no_life),
		TEST(catching_up_serves_everybody),
		TEST(a_held_back_client_may_vanish),
		TEST(who_is_connected),
		TEST(sockets_are_tuned),
		TEST(answers_to_nobody),
		TEST(half_closed_gets_its_answers),
		TEST(survives_without_descriptors),
		TEST(listens_on_ipv6),
		TEST(errors_of_new),
		TEST(endpoints_exchange_their_ports),
		TEST(listens_elsewhere),
		TEST(listens_on_the_same_port),
		TEST(where_it_cannot_listen_it_stays),
		TEST(rights_are_looked_at_again),
		TEST(other_numbers_of_places),
		TEST(who_is_closed_out_is_counted_out),
		TEST(another_number_in_flight),
		TEST(another_pace),
		TEST(shorter_patience),
	};

	return cmocka_run_group_tests_name("server/server", tests, NULL, NULL);
}
