/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Messages for people: a line for each event, which names bus and drive, says what happened and what
 * to check. They go to the journal with fields to filter by when standard error is the journal, else
 * to standard error as text.
 *
 * Nothing here ever makes the caller wait for whoever reads the log: a line is put into a bounded
 * queue, and a thread of the log's own writes it. What finds no room is counted, and the count told.
 * What repeats is told a few times and then by its count, at most once a minute.
 */
#ifndef DRIVEBRIDGE_LOG_H
#define DRIVEBRIDGE_LOG_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/* Values are syslog's. */
enum db_log_level {
	DB_LOG_ERROR = 3,
	DB_LOG_WARNING = 4,
	DB_LOG_NOTICE = 5,
	DB_LOG_INFO = 6,
};

/* What can happen. Level, name and how often it is told: src/log/event.c. */
enum db_event {
	/* the service */
	DB_EVENT_LISTENING,
	DB_EVENT_NO_DRIVES,
	DB_EVENT_FAILED, /* it cannot go on */
	DB_EVENT_RELOAD,
	DB_EVENT_RELOAD_FAILED,
	DB_EVENT_CONFIG_WRONG,
	DB_EVENT_CONFIG_CHANGED,   /* on disk, and it is right */
	DB_EVENT_CONFIG_LAST_GOOD, /* the start found wrong files */
	DB_EVENT_CONFIG_UNKEPT,    /* a copy could not be written */
	DB_EVENT_MEMORY_UNLOCKED,
	DB_EVENT_THREAD_HANGS,
	DB_EVENT_LOG_LOST,
	DB_EVENT_CONTROL_FAILED, /* there is no control socket */
	/* its clients */
	DB_EVENT_CLIENT_CONNECTED,
	DB_EVENT_CLIENT_GONE,
	DB_EVENT_CLIENT_REFUSED,
	DB_EVENT_WATCHDOG_TRIPPED,
	DB_EVENT_HOLD_LOST, /* the holder of a motion is missed, and its drive stopped */
	/* a bus */
	DB_EVENT_BUS_UP,
	DB_EVENT_BUS_BITRATE,
	DB_EVENT_BUS_LOST, /* the port cannot be opened, or is gone */
	DB_EVENT_BUS_OFF,  /* it is open and carries nothing */
	DB_EVENT_BUS_SLOW,
	DB_EVENT_BUS_ASIDE, /* a scan has it, or it returns from that */
	DB_EVENT_PRIORITY_REFUSED,
	DB_EVENT_CPUS_REFUSED,
	DB_EVENT_SERIAL_LATENCY,
	/* a drive */
	DB_EVENT_DRIVE_ONLINE,
	DB_EVENT_DRIVE_LOST,
	DB_EVENT_DRIVE_FAULT,
	DB_EVENT_DRIVE_FAULT_GONE,
	DB_EVENT_DRIVE_WARNING,
	DB_EVENT_DRIVE_RESTARTED,
	DB_EVENT_DRIVE_UNCONFIRMED,    /* it is let go and has not confirmed its on-exit */
	DB_EVENT_DRIVE_RUNS_ON,        /* it was told to stop, and does not slow down */
	DB_EVENT_DRIVE_PARAMS_MISSING, /* it does not answer for some of its parameters */
	DB_EVENT_DRIVE_HEARD,          /* it does not answer, but something came from there */
	DB_EVENT_DRIVE_LATE,           /* it answers later than drive-latency-ms */
	DB_EVENT_COMMAND_REFUSED,
	DB_EVENT_RAW_FRAME,  /* a client's own frame, and what answered it */
	DB_EVENT_DRIVE_DEAF, /* it does not hear what follows its answers within turnaround-us */
	DB_EVENT_DRIVE_MAY_HAVE_RESTARTED, /* one sign of a restart came, and nothing that confirms or refutes it */
	DB_EVENT_DRIVE_DOUBLED, /* two drives answer at its address */
	DB_EVENT_COUNT
};

struct db_log;

/*
 * Lines go to the journal or to standard error, whichever this process has. One log per process is
 * enough; it must outlive everything that has a source of it. 0 or a negative errno.
 */
int db_log_new(struct db_log **log);
/* Writes what is left, for a second at most; for the end of the process. Null is fine. */
void db_log_free(struct db_log *log);

/* Who speaks: one bus, or the network side when `bus` is null. Copied around freely. */
struct db_log_source {
	struct db_log *log; /* null: nobody listens */
	const char *bus;
	enum db_log_level level; /* less important ones are left out */
};

/* Whom a line is about, beside its source's bus. */
struct db_log_about {
	const char *drive;  /* null: none */
	unsigned unit;      /* the drive's Modbus unit; 0: none */
	const char *client; /* who it is, such as its address; null: none */
};

/*
 * Any thread; does not wait, allocate or call the system beside waking the log's thread. `about` may
 * be null. The line begins with "bus NAME: ", "drive NAME: " and "client ADDRESS: " as far as they
 * are given; texts are copied. `now` is of CLOCK_MONOTONIC.
 */
__attribute__((format(printf, 5, 6))) void db_log(const struct db_log_source *source, db_time now,
                                                  enum db_event event,
                                                  const struct db_log_about *about,
                                                  const char *format, ...);

/* The latest lines, as far as their texts find room: at most so many. */
#define DB_LOG_RECENT 256

struct db_log_line {
	uint64_t number;  /* from 1, without gaps */
	uint64_t time_us; /* since 1970-01-01 UTC */
	enum db_event event;
	char bus[64]; /* "": none, likewise the next two */
	char drive[64];
	char client[96];
	char text[512]; /* without these names before it */
};

/* The line of this number, or the first one behind it that is kept. False: there is none (yet). Any thread;
 * does not wait for who writes or reads the log. */
bool db_log_recent(struct db_log *log, uint64_t from, struct db_log_line *line);

#define DB_EVENT_BIT(event) (UINT64_C(1) << (event))

/* The latest line of one of these events (DB_EVENT_BIT() each) about a drive, or where that is null about a bus alone, at
 * or after a moment in microseconds since 1970-01-01 UTC. False: none is kept. As db_log_recent(). */
bool db_log_latest(struct db_log *log, uint64_t events, const char *bus, const char *drive,
                   uint64_t since_us, struct db_log_line *line);

/* For the documents and the configuration. */
const char *db_event_name(enum db_event event); /* "drive-lost" ... */
enum db_log_level db_event_level(enum db_event event);

#endif
