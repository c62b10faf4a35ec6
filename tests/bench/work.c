/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The same work again and again, for callgrind to count its instructions: requests of a Modbus client,
 * from the event loop to the answer, and cycles of a bus, without the drives' part of it.
 *
 *   work KIND TIMES      KIND: read, write, vsmd-serial, vsmd-can, servo-can, xyza
 *
 * What counts is in work_of_the_loop(), db_engine_run() and db_engine_receive(); tests/bench/instructions asks
 * callgrind for these. Nothing here depends on time or chance.
 */
#include "../fuzz/line.h"
#include "config/config_private.h"
#include "drivebridge/registers.h"
#include "drivebridge/server.h"
#include "fakes/places.h"
#include "sched/engine.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <systemd/sd-event.h>
#include <unistd.h>

#define MS DB_NS_PER_MS

/* By this name callgrind finds it. */
__attribute__((noinline)) void work_of_the_loop(sd_event *loop);

/* --- requests ---------------------------------------------------------------------------------------- */

struct front {
	sd_event *loop;
	struct db_axis *axes[LINE_DRIVES];
	struct db_registers *registers;
	struct db_server *server;
	struct fake_place place; /* of the request that is to be completed */
	int client;
};

static const db_time standing = 1000 * DB_NS_PER_S; /* the time, always */

static db_time now_of(void *context)
{
	(void)context;
	return standing;
}

static uint64_t wall_us(void *context)
{
	(void)context;
	return 1;
}

static struct db_request *submit(void *context, struct db_bus *bus,
                                 const struct db_request *request)
{
	(void)bus;
	return fake_place_fill(&((struct front *)context)->place, 1, request);
}

static void release(void *context, struct db_request *request)
{
	fake_place_release(&((struct front *)context)->place, 1, request);
}

static void answer(void *context, struct db_write_token token, uint8_t exception)
{
	db_server_answer(((struct front *)context)->server, token, exception);
}

static void bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	(void)context;
	(void)bus;
	*stats = (struct db_bus_stats){ .up = true };
}

static void server_stats(void *context, struct db_server_stats *stats)
{
	db_server_stats(((struct front *)context)->server, stats);
}

static const struct db_registers_ops ops = {
	.now = now_of,
	.wall_us = wall_us,
	.submit = submit,
	.release = release,
	.answer = answer,
	.bus_stats = bus_stats,
	.server_stats = server_stats,
};

static const struct db_config *read_config(enum family family)
{
	char text[2048];
	struct db_config *config;

	(void)snprintf(text, sizeof text, "modbus { listen = \"127.0.0.1:0\" }\n%s",
	               line_configs[family]);
	must(db_load_text(&db_load_built_in, text, "work", stderr, &config) == 0);
	return config;
}

static void make_registers(struct front *front, const struct db_config *config)
{
	const struct db_snapshot snapshot = {
		.feedback = { .taken = standing,
		              .state = DB_AXIS_STANDSTILL,
		              .status = DB_STATUS_ONLINE | DB_STATUS_BUS_UP | DB_STATUS_ENABLED },
	};
	struct db_roster_bus bus = { &config->buses[0], NULL };
	struct db_roster_drive drives[LINE_DRIVES];
	const struct db_roster roster = { &config->modbus, &bus, 1, drives, LINE_DRIVES };

	for (size_t i = 0; i < LINE_DRIVES; i++) {
		front->axes[i] = db_axis_new(config->buses[0].driver->param_count);
		must(front->axes[i]);
		db_axis_publish(front->axes[i], &snapshot);
		drives[i] = (struct db_roster_drive){ (uint16_t)i, 0, &config->drives[i],
			                              front->axes[i] };
	}
	must(db_registers_new(&roster, &ops, front, &front->registers) == 0);
}

static void open_front(struct front *front)
{
	const char *where;
	static const struct db_log_source quiet = { 0 };
	const struct db_config *config = read_config(FAMILY_VSMD_SERIAL);
	struct sockaddr_in address = { .sin_family = AF_INET };

	*front = (struct front){ .loop = NULL };
	make_registers(front, config);
	must(sd_event_new(&front->loop) >= 0);
	must(db_server_new(front->loop, &config->modbus, &db_registers_backend, front->registers,
	                   &quiet, &front->server, &where) == 0);
	address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	address.sin_port = htons(db_server_port(front->server, DB_ENDPOINT_FIRST));
	front->client = socket(AF_INET, SOCK_STREAM, 0);
	must(front->client >= 0);
	must(connect(front->client, (struct sockaddr *)&address, sizeof address) == 0);
	/* The connection is taken before anything counts. */
	must(sd_event_run(front->loop, UINT64_MAX) >= 0);
}

void work_of_the_loop(sd_event *loop)
{
	must(sd_event_run(loop, UINT64_MAX) > 0);
}

static void complete(struct front *front)
{
	db_registers_complete(front->registers,
	                      fake_place_end(&front->place.request, DB_RESULT_OK, 0), standing);
}

static void ask(struct front *front, const uint8_t *adu, size_t length, bool write)
{
	uint8_t bytes[260];

	must(send(front->client, adu, length, 0) == (ssize_t)length);
	work_of_the_loop(front->loop);
	if (write)
		complete(front);
	must(recv(front->client, bytes, sizeof bytes, 0) > 8);
	must(!(bytes[7] & 0x80));
}

static void run_requests(bool write, unsigned times)
{
	/* The process data that every drive has; and the command block with a stop. */
	static const uint8_t reads[] = { 0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 30 };
	static const uint8_t writes[] = { 0, 1, 0, 0, 0, 15, 1, 16, 0, 100, 0,
		                          4, 8, 0, 0, 0, 3,  0, 0,  0, 0 };
	static struct front front;

	open_front(&front);
	for (unsigned i = 0; i < times; i++)
		ask(&front, write ? writes : reads, write ? sizeof writes : sizeof reads, write);
	close(front.client);
	db_server_free(front.server);
	db_registers_free(front.registers);
	sd_event_unref(front.loop);
}

/* --- cycles ------------------------------------------------------------------------------------------ */

struct back {
	struct line line;
	struct db_engine *engine;
	db_time now;
	uint8_t sent[4096]; /* since the engine was called, for the drives */
	size_t sent_length;
	size_t ends[64];
	size_t end_count;
};

/* The drives hear it when the engine's part is over. */
static db_time on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct back *back = context;

	must(back->sent_length + length <= sizeof back->sent && back->end_count < 64);
	memcpy(back->sent + back->sent_length, bytes, length);
	back->sent_length += length;
	back->ends[back->end_count++] = back->sent_length;
	return back->now;
}

static const struct db_engine_ops engine_ops = { .send = on_send };

static void pass_on(struct back *back)
{
	uint8_t bytes[256];
	size_t from = 0;
	size_t length;

	for (size_t i = 0; i < back->end_count; i++) {
		line_hear(&back->line, back->sent + from, back->ends[i] - from, back->now);
		from = back->ends[i];
	}
	back->sent_length = back->end_count = 0;
	while ((length = line_say(&back->line, back->now, bytes, sizeof bytes)) > 0)
		db_engine_receive(back->engine, bytes, length, back->now);
}

static void run_cycles(enum family family, unsigned times)
{
	const struct db_config *config = read_config(family);
	struct db_bus_drive drives[LINE_DRIVES];
	struct db_bus_stats stats = { .cycles = 0 };
	struct db_bus_config bus = config->buses[0];
	struct db_queue *queue;
	static struct back back;

	/* So that a cycle fits. */
	bus.baud = 115200;
	back.now = standing;
	line_open(&back.line, family, &bus, LINE_DRIVES, 0, back.now);
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		drives[i] = (struct db_bus_drive){ (uint16_t)i, &config->drives[i],
			                           db_axis_new(bus.driver->param_count) };
		must(drives[i].axis);
	}
	must(db_queue_new(8, LINE_DRIVES, &queue) == 0);
	must(db_engine_new(&bus, drives, LINE_DRIVES, queue, &engine_ops, &back, &back.engine) ==
	     0);
	db_engine_port(back.engine, true, 0, back.now);
	while (stats.cycles < times) {
		db_time next = db_engine_run(back.engine, back.now);

		pass_on(&back);
		if (line_next(&back.line) < next)
			next = line_next(&back.line);
		back.now = next > back.now ? next : back.now;
		db_engine_stats(back.engine, &stats);
	}
	must(stats.online == LINE_DRIVES);
	db_engine_free(back.engine);
	db_queue_free(queue);
	line_close(&back.line);
	for (size_t i = 0; i < LINE_DRIVES; i++)
		db_axis_free(drives[i].axis);
}

int main(int argc, char **argv)
{
	static const char *const families[FAMILIES] = {
		[FAMILY_VSMD_SERIAL] = "vsmd-serial",
		[FAMILY_VSMD_CAN] = "vsmd-can",
		[FAMILY_SERVO] = "servo-can",
		[FAMILY_XYZA] = "xyza",
	};
	const char *kind = argc == 3 ? argv[1] : "";
	unsigned times = argc == 3 ? (unsigned)strtoul(argv[2], NULL, 10) : 0;

	if (strcmp(kind, "read") == 0 || strcmp(kind, "write") == 0) {
		run_requests(kind[0] == 'w', times);
		return EXIT_SUCCESS;
	}
	for (enum family i = 0; i < FAMILIES; i++) {
		if (strcmp(kind, families[i]) != 0)
			continue;
		run_cycles(i, times);
		return EXIT_SUCCESS;
	}
	(void)fprintf(stderr, "usage: %s KIND TIMES\n", argv[0]);
	return EXIT_FAILURE;
}
