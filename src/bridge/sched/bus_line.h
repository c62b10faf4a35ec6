/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The line of a bus: its port (opened, watched, lost and opened again), the bytes that the port has
 * not taken yet, and the current user of the line: the drives, or a scan that wants it alone. Bus
 * thread only; internal to src/bridge/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_BUS_LINE_H
#define DRIVEBRIDGE_SCHED_BUS_LINE_H

#include "drivebridge/config.h"
#include "drivebridge/driver.h"
#include "drivebridge/log.h"
#include "drivebridge/process.h"
#include "drivebridge/transport.h"

#include <poll.h>

struct db_engine;

enum line_use {
	LINE_IN_SERVICE,
	LINE_CLEARING, /* the drives' on_exit is carried out, then the line is out of service */
	LINE_ASIDE,    /* used by the scan alone */
};

struct bus_line {
	/* Set by the owner before the first call; must outlive the line. */
	const struct db_bus_config *config;
	const struct db_transport *transport;
	const struct db_log_source *log;
	struct db_engine *engine; /* receives bytes and the port's state */

	/* May be read by others. */
	enum line_use use;
	db_time reopen_at; /* while the port is not open */
	bool has_trouble;  /* the trace has something to be looked into; cleared by others */

	/* Private. */
	struct db_port *port;
	bool line_up;         /* the port is open and carries frames */
	bool passes_all;      /* the port's filters are open */
	size_t gathers;       /* the port reports this number of bytes at a time; 0: each byte */
	db_time last_io;      /* time of the last read or write */
	unsigned aside_speed; /* of the port, bit/s */
	db_time clear_by;
	int open_error; /* the error reported last, so that each is reported once */
	int port_error; /* the error with which the open port failed */
	char holder[DB_PROCESS_WORDS_MAX]; /* the process that has the port; "": none, or unknown */
	uint8_t unsent[2 * DB_REQUEST_MAX];
	size_t unsent_length;
	db_time unsent_since; /* when the port last took something */
};

/* The name of its port for messages. */
const char *bus_line_place(const struct bus_line *line);
/* Reports "up" when the port tells nothing, or is not open. */
const struct db_port_health *bus_line_health(const struct bus_line *line);

/* The line's part of a turn: opens the port, hands it to a scan and back, sends the bytes that
 * wait. Returns when it wants the next turn. */
db_time bus_line_run(struct bus_line *line, db_time now);
/* Called at the end of a turn: closes a port that has failed meanwhile. True if it did. */
bool bus_line_check(struct bus_line *line, db_time now);

/* What to poll for, and until when; after that time bytes are to be read even if they are fewer
 * than the port reports. */
db_time bus_line_poll(const struct bus_line *line, struct pollfd *poll);
/* The result of the poll. `late`: nothing was ready in time. */
void bus_line_polled(struct bus_line *line, short revents, bool late);

/* Bytes that the port does not take at once are kept and sent later. Returns when they were handed
 * over. */
db_time bus_line_send(struct bus_line *line, const uint8_t *bytes, size_t length);

/* Records an event among the frames of the trace. `drive`: null for an event of the bus. */
void bus_line_trace(struct bus_line *line, enum db_event event, const struct db_drive_config *drive,
                    db_time now);

/* A new scan begins before the line is back in service after the last one: the port is opened for
 * it. */
void bus_line_begin_scan(struct bus_line *line, db_time now);

void bus_line_close(struct bus_line *line);

#endif
