/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The line of a bus: its port, opened, watched, lost and opened again, what the port has not taken yet, and whose it is:
 * the drives', or a scan's that wants it alone. Bus thread only; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_BUS_LINE_H
#define DRIVEBRIDGE_SCHED_BUS_LINE_H

#include "drivebridge/config.h"
#include "drivebridge/driver.h"
#include "drivebridge/log.h"
#include "drivebridge/transport.h"

#include <poll.h>

struct db_engine;

enum line_use {
	LINE_IN_SERVICE,
	LINE_CLEARING, /* its drives do what their on_exit says, then it is set aside */
	LINE_ASIDE,    /* the scan's */
};

struct bus_line {
	/* To be set before the first call; they outlive it. */
	const struct db_bus_config *config;
	const struct db_transport *transport;
	const struct db_log_source *log;
	struct db_engine *engine; /* is told of what comes, and of the port */

	/* For others to look at. */
	enum line_use use;
	db_time reopen_at; /* while the port is not open */
	bool troubled; /* something came to the trace that is to be looked into; for others to clear */

	/* Its own. */
	struct db_port *port;
	bool line_up;         /* the port is open and carries frames */
	bool passes_all;      /* the port's filters are open for a scan */
	unsigned aside_speed; /* of the port, bit/s */
	db_time clear_by;
	int open_error; /* the last one reported, so that it is reported once */
	int port_error; /* the open port failed with it */
	uint8_t unsent[2 * DB_REQUEST_MAX];
	size_t unsent_length;
	db_time unsent_since; /* when the port last took something */
};

/* The clock of the bus. */
db_time bus_line_now(void);

/* Its port, as people know it. */
const char *bus_line_place(const struct bus_line *line);
/* "Up" when the port says nothing, or is not open. */
const struct db_port_health *bus_line_health(const struct bus_line *line);

/* Its part of a turn: opens the port, gives it to a scan and back, sends what waits. Returns when it wants the next
 * one. */
db_time bus_line_run(struct bus_line *line, db_time now);
/* Behind everything else of a turn: closes a port that has failed since. True when it did. */
bool bus_line_check(struct bus_line *line, db_time now);

/* What to wait for, and what came of it. */
void bus_line_poll(const struct bus_line *line, struct pollfd *poll);
void bus_line_take(struct bus_line *line, short revents);

/* What the port does not take at once is kept. Returns when it was handed over. */
db_time bus_line_send(struct bus_line *line, const uint8_t *bytes, size_t length);

/* An event among the frames of the trace. `drive`: null when it is the bus's. */
void bus_line_trace(struct bus_line *line, enum db_event event, const struct db_drive_config *drive,
                    db_time now);

/* A scan that follows the last one before the line is back in service opens the port for itself. */
void bus_line_begin_scan(struct bus_line *line, db_time now);

void bus_line_close(struct bus_line *line);

#endif
