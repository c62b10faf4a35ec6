/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD drives on RS485 in simulated time, byte by byte: the real engine and the family's own driver
 * with simulated drives, which may be deaf after their answers, late, or hold the line. Header
 * only; one thread.
 *
 *	struct rs485 *line = rs485_new((const unsigned[]){ 1, 2, 0 });
 *
 *	line->nodes[0].deaf = 4 * DB_NS_PER_MS;
 *	rs485_begin(line);
 *	fake_pass(line->bus, 3000 * DB_NS_PER_MS);
 *	rs485_free(line);
 */
#ifndef DRIVEBRIDGE_FAKES_RS485_H
#define DRIVEBRIDGE_FAKES_RS485_H

#include "drivebridge/transport.h"
#include "fakes/bus.h"
#include "fakes/must.h"
#include "sim/serial_bus.h"
#include "transport/serial.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RS485_BAUD 115200
/* Rounded up, as in the simulator. */
#define RS485_CHARACTER ((10 * DB_NS_PER_S + RS485_BAUD - 1) / RS485_BAUD)
#define RS485_LATENCY (800 * DB_NS_PER_US)

struct rs485 {
	struct fake_bus *bus;
	struct sim_serial_bus *wire;
	struct sim_serial_config config;
	struct sim_vsmd_config drives[FAKE_DRIVES];
	struct sim_node nodes[FAKE_DRIVES];
	unsigned told[DB_EVENT_COUNT];
	unsigned told_others; /* that others do not receive what follows a drive's answers */
	db_time learnt;

	const char *
		/* for the test: its drive answers such a request without carrying it out; null:
		 * none */
		ignored;
	const char *awaited; /* for the test: beginning of an awaited request; null: none */
	db_time awaited_at;  /* when a request with this beginning was sent; 0: not yet */
	unsigned meanwhile;  /* requests sent before it */
};

static inline bool rs485_begins(const uint8_t *bytes, size_t length, const char *beginning)
{
	return length >= strlen(beginning) && memcmp(bytes, beginning, strlen(beginning)) == 0;
}

static inline db_time rs485_send(void *context, const uint8_t *bytes, size_t length)
{
	struct rs485 *line = context;
	char status[16];

	if (line->awaited && line->awaited_at == 0) {
		if (rs485_begins(bytes, length, line->awaited))
			line->awaited_at = line->bus->now;
		else
			line->meanwhile++;
	}
	if (line->ignored && rs485_begins(bytes, length, line->ignored)) {
		int written = snprintf(status, sizeof status, "%d sts\n", atoi(line->ignored));

		must(written > 0);
		bytes = (const uint8_t *)status;
		length = (size_t)written;
	}
	sim_serial_bus_receive(line->wire, bytes, length, line->bus->now);
	return line->bus->now;
}

static inline void rs485_note_timing(void *context, const struct db_drive_config *drive,
                                     const struct db_engine_timing *timing)
{
	struct rs485 *line = context;

	(void)drive;
	line->told[timing->event]++;
	line->told_others += timing->others;
	line->learnt = timing->learnt;
}

static const struct db_engine_ops rs485_ops = { .send = rs485_send,
	                                        .on_timing = rs485_note_timing };

static inline db_time rs485_next(void *context)
{
	struct rs485 *line = context;

	return sim_serial_bus_next(line->wire);
}

static inline void rs485_take(void *context)
{
	struct rs485 *line = context;
	uint8_t bytes[512];
	size_t length;

	while ((length = sim_serial_bus_run(line->wire, line->bus->now, bytes, sizeof bytes)) > 0)
		fake_receive(line->bus, bytes, length);
}

/* `addresses` end with 0. The port is down, and bus->config, config, drives and nodes may still be
 * changed. */
static inline struct rs485 *rs485_new(const unsigned *addresses)
{
	struct rs485 *line = calloc(1, sizeof *line);
	size_t count = 0;

	must(line);
	while (addresses[count] != 0)
		count++;
	line->bus = fake_bus_new(db_driver_find("vsmd-serial"), count);
	line->bus->context = line;
	line->bus->next = rs485_next;
	line->bus->happen = rs485_take;
	line->bus->config.transport = &db_transport_serial;
	line->bus->config.baud = RS485_BAUD;
	line->bus->config.stop_bits = 1;
	line->bus->config.drive_latency_ms = 30;
	line->bus->config.turnaround_us = 1000;
	line->bus->config.adapt = true;
	fake_preset_options(line->bus->config.driver, &line->bus->options);
	line->config = (struct sim_serial_config){
		.baud = RS485_BAUD, .rs485 = true, .paced = true, .latency = RS485_LATENCY
	};
	for (size_t i = 0; i < count; i++) {
		line->bus->drives[i].address = addresses[i];
		sim_vsmd_config_init(&line->drives[i], addresses[i], RS485_BAUD);
	}
	return line;
}

static inline void rs485_begin(struct rs485 *line)
{
	line->wire = sim_serial_bus_new(&sim_vsmd_serial_protocol, &line->config, NULL, NULL);
	must(line->wire);
	for (size_t i = 0; i < line->bus->drive_count; i++) {
		line->nodes[i].drive = sim_vsmd_new(&line->drives[i], line->bus->now);
		must(line->nodes[i].drive);
		must(sim_serial_bus_attach(line->wire, &line->nodes[i]));
	}
	fake_bus_open(line->bus, line->bus->drive_count, &rs485_ops);
	fake_port(line->bus, 0);
}

static inline void rs485_free(struct rs485 *line)
{
	free(line->wire);
	for (size_t i = 0; i < line->bus->drive_count; i++)
		free(line->nodes[i].drive);
	fake_bus_free(line->bus);
	free(line);
}

static inline enum db_result rs485_command(struct rs485 *line, size_t drive,
                                           struct db_request request)
{
	enum db_result result = DB_RESULT_NONE;

	fake_request(line->bus, drive, request);
	for (unsigned ms = 0; ms < 3000 && result == DB_RESULT_NONE; ms++) {
		fake_pass(line->bus, DB_NS_PER_MS);
		result = fake_result(line->bus);
	}
	return result;
}

static inline enum db_result rs485_enable(struct rs485 *line, size_t drive)
{
	return rs485_command(line, drive, (struct db_request){ .command = DB_CMD_ENABLE });
}

static inline enum db_result rs485_turn(struct rs485 *line, size_t drive, float velocity)
{
	return rs485_command(
		line, drive,
		(struct db_request){ .command = DB_CMD_MOVE_VELOCITY,
	                             .args = &(struct db_args){ .target_velocity = velocity } });
}

/* How often a drive has received a line with this beginning, among the latest ones. */
static inline unsigned rs485_count_heard(const struct sim_node *node, const char *beginning)
{
	unsigned found = 0;

	for (uint32_t i = 0; i < node->received && i < SIM_LOG_LINES; i++)
		found += strncmp(node->log[i].line, beginning, strlen(beginning)) == 0;
	return found;
}

/* The time from now, 300 ms at most, until a request with this beginning is sent. */
static inline db_time rs485_wait_for(struct rs485 *line, const char *beginning)
{
	db_time begin = line->bus->now;

	line->awaited = beginning;
	line->awaited_at = 0;
	line->meanwhile = 0;
	while (line->awaited_at == 0 && line->bus->now < begin + 300 * DB_NS_PER_MS)
		fake_pass(line->bus, DB_NS_PER_MS / 10);
	line->awaited = NULL;
	return line->awaited_at != 0 ? line->awaited_at - begin : DB_TIME_NEVER;
}

static inline uint32_t rs485_samples(const struct rs485 *line, size_t drive)
{
	return fake_snapshot(line->bus, drive).stats.samples;
}

#endif
