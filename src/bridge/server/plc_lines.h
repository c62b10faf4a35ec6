/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The serial lines of the configuration, at each of which a PLC is the master: one client each,
 * with the name of the line for its address and the rights that its section gives. One request at
 * a time is in work on a line. Network thread only.
 */
#ifndef DRIVEBRIDGE_SERVER_PLC_LINES_H
#define DRIVEBRIDGE_SERVER_PLC_LINES_H

#include "drivebridge/server.h"
#include "server/execute.h"
#include "server/peers.h"

#include <systemd/sd-event.h>

/* What lines need of the server that they belong to, which outlives them. */
struct db_plc_lines_host {
	sd_event *loop;
	const struct db_log_source *log;
	const struct db_executor *executor;
	struct db_server_stats *stats;
	/* A number that no client has. */
	uint32_t (*number)(void *context);
	/* Counts a refusal to a client with this address, and logs it where due. */
	void (*refused)(void *context, const uint8_t address[16], enum db_refusal kind);
	/* Around calls of the backend: answers that it gives meanwhile are sent by the second, see
	 * db_plc_lines_flush(). */
	void (*begin)(void *context);
	void (*end)(void *context);
	void *context;
};

struct db_plc_lines;
struct db_plc_lines_change;

/* Null when out of memory. The host is copied. */
struct db_plc_lines *db_plc_lines_new(const struct db_plc_lines_host *host);
void db_plc_lines_free(struct db_plc_lines *lines);

/* The lines of another configuration, in two steps as db_server_prepare(). Those whose ports do not
 * change go on. 0 or a negative errno. */
int db_plc_lines_prepare(struct db_plc_lines *lines, const struct db_modbus_config *config,
                         struct db_plc_lines_change **change);
void db_plc_lines_apply(struct db_plc_lines *lines, struct db_plc_lines_change *change);
void db_plc_lines_change_free(struct db_plc_lines_change *change);

/* True if a line's client has this number. */
bool db_plc_lines_has(const struct db_plc_lines *lines, uint32_t client);

/* Notes the answer to a write. False: it is of none of the lines' clients. */
bool db_plc_lines_answer(struct db_plc_lines *lines, struct db_write_token token,
                         uint8_t exception);
/* Sends the answers that were noted. */
void db_plc_lines_flush(struct db_plc_lines *lines);

/* See db_server_clients(): the lines that are up. */
size_t db_plc_lines_list(const struct db_plc_lines *lines, struct db_server_client *clients,
                         size_t max, db_time now);
bool db_plc_lines_read(const struct db_plc_lines *lines, size_t index, struct db_server_line *line);

#endif
