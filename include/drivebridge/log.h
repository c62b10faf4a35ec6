/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Messages for people: one line per event, with bus and drive, what happened and what to check.
 * They go to the journal with fields to filter by when standard error is the journal, else to
 * standard error as text.
 *
 * Nothing here makes the caller wait for a reader of the log: a line is put into a bounded queue,
 * and the log's own thread writes it. Lines that find no room are counted, and the count is logged.
 * A repeated event is logged a few times and then by its count, at most once a minute.
 */
#ifndef DRIVEBRIDGE_LOG_H
#define DRIVEBRIDGE_LOG_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Values are syslog's. */
enum db_log_level {
	DB_LOG_ERROR = 3,
	DB_LOG_WARNING = 4,
	DB_LOG_NOTICE = 5,
	DB_LOG_INFO = 6,
};

/* The events. Level, name and how often each is logged: src/bridge/log/event.c. */
enum db_event {
	/* the service */
	DB_EVENT_LISTENING,
	DB_EVENT_NO_DRIVES,
	DB_EVENT_FAILED, /* it cannot continue */
	DB_EVENT_RELOAD,
	DB_EVENT_RELOAD_FAILED,
	DB_EVENT_CONFIG_WRONG,
	DB_EVENT_CONFIG_CHANGED,   /* changed on disk, and valid */
	DB_EVENT_CONFIG_LAST_GOOD, /* the start found wrong files */
	DB_EVENT_CONFIG_UNKEPT,    /* a copy could not be written */
	DB_EVENT_MEMORY_UNLOCKED,
	DB_EVENT_THREAD_HANGS,
	DB_EVENT_LOG_LOST,
	DB_EVENT_CONTROL_FAILED, /* there is no control socket */
	DB_EVENT_SECURE_FAILED,  /* there is no secure socket */
	DB_EVENT_SECURE_CHANGED, /* drivebridge-tls is there, or gone */
	/* its clients */
	DB_EVENT_CLIENT_CONNECTED,
	DB_EVENT_CLIENT_GONE,
	DB_EVENT_CLIENT_REFUSED,
	DB_EVENT_LINE_UP,   /* the serial line of a PLC can be heard */
	DB_EVENT_LINE_LOST, /* its port cannot be opened, or is lost */
	DB_EVENT_WATCHDOG_TRIPPED,
	DB_EVENT_HOLD_LOST, /* the holder of a motion is missed, and its drive was stopped */
	/* a bus */
	DB_EVENT_BUS_UP,
	DB_EVENT_BUS_BITRATE,
	DB_EVENT_BUS_LOST, /* the port cannot be opened, or is lost */
	DB_EVENT_BUS_OFF,  /* the port is open but carries nothing */
	DB_EVENT_BUS_SLOW,
	DB_EVENT_BUS_ASIDE, /* a scan uses the bus alone, or has returned it */
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
	DB_EVENT_DRIVE_UNCONFIRMED,    /* it is released and has not confirmed its on-exit */
	DB_EVENT_DRIVE_RUNS_ON,        /* it was told to stop, and does not slow down */
	DB_EVENT_DRIVE_PARAMS_MISSING, /* it does not answer for some of its parameters */
	DB_EVENT_DRIVE_HEARD,          /* it does not answer, but something was received from it */
	DB_EVENT_DRIVE_LATE,           /* it answers later than drive-latency-ms */
	DB_EVENT_COMMAND_REFUSED,
	DB_EVENT_RAW_FRAME, /* a client's raw frame, and its answer */
	/* it does not receive requests that follow its answers within turnaround-us */
	DB_EVENT_DRIVE_DEAF,
	/* one sign of a restart, and nothing that confirms or refutes it */
	DB_EVENT_DRIVE_MAY_HAVE_RESTARTED,
	DB_EVENT_DRIVE_DOUBLED,  /* two drives answer at its address */
	DB_EVENT_RESTART_NEEDED, /* an upgrade has replaced a running program or library */
	DB_EVENT_AUDIT_UNKEPT,   /* the audit trail cannot be written, or something of it is lost */
	DB_EVENT_AUDIT_KEPT,     /* it is written again */
	/* health values and alarms cannot be written, or something of them is lost */
	DB_EVENT_HEALTH_UNKEPT,
	DB_EVENT_HEALTH_KEPT, /* they are written again */
	DB_EVENT_COUNT
};

struct db_log;

/*
 * Lines go to the journal or to standard error, depending on this process. One log per process is
 * enough; it must outlive every source that refers to it. 0 or a negative errno.
 */
int db_log_new(struct db_log **log);
/* Writes the remaining lines, for a second at most; for the end of the process. Null is fine. */
void db_log_free(struct db_log *log);
/* The same while a thread that cannot be ended may still add lines: its memory stays. */
void db_log_leave(struct db_log *log);

/* The source of a line: one bus, or the network side when `bus` is null. May be copied. */
struct db_log_source {
	struct db_log *log; /* null: nothing is logged */
	const char *bus;
	enum db_log_level level; /* less important ones are left out */
};

/* The subject of a line, in addition to its source's bus. */
struct db_log_about {
	const char *drive;  /* null: none */
	unsigned unit;      /* the drive's Modbus unit; 0: none */
	const char *client; /* the client, such as its address; null: none */
};

/*
 * Any thread; does not wait, allocate or call the system except to wake the log's thread. `about`
 * may be null. The line begins with "bus NAME: ", "drive NAME: " and "client ADDRESS: " as far as
 * they are given; texts are copied. `now` is of CLOCK_MONOTONIC.
 */
__attribute__((format(printf, 5, 6))) void db_log(const struct db_log_source *source, db_time now,
                                                  enum db_event event,
                                                  const struct db_log_about *about,
                                                  const char *format, ...);

/* One entry of the journal, of fields "NAME=value": the caller waits for it, and needs a thread that
 * may. Nothing where the log goes elsewhere. */
void db_log_fields(const struct db_log *log, char *const fields[], size_t count);

/* Maximum number of the latest lines kept, as far as their texts find room. */
#define DB_LOG_RECENT 256

struct db_log_line {
	uint64_t number;  /* from 1, without gaps */
	uint64_t time_us; /* since 1970-01-01 UTC */
	enum db_event event;
	char bus[64]; /* "": none; also in the next two */
	char drive[64];
	char client[160];
	char text[512]; /* without these names before it */
};

/* The line of this number, or the first one after it that is kept. False: there is none (yet). Any
 * thread; does not wait for writers or readers of the log. */
bool db_log_recent(struct db_log *log, uint64_t from, struct db_log_line *line);

/* The number of the latest line; 0: there is none yet. As db_log_recent(). */
uint64_t db_log_newest(struct db_log *log);

#define DB_EVENT_BIT(event) (UINT64_C(1) << (event))

/* The latest line of one of these events (DB_EVENT_BIT() each) about a drive, or with null about a
 * bus alone, at or after a time in microseconds since 1970-01-01 UTC. False: none is kept. As
 * db_log_recent(). */
bool db_log_latest(struct db_log *log, uint64_t events, const char *bus, const char *drive,
                   uint64_t since_us, struct db_log_line *line);

/* For the documents and the configuration. */
const char *db_event_name(enum db_event event); /* "drive-lost" ... */
enum db_log_level db_event_level(enum db_event event);

#endif
