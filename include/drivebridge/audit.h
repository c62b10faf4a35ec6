/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The audit trail: who had which drive do what, and what was refused to whom. Each record goes to
 * the journal with fields of its own, and into files that the service keeps: bounded, and each
 * record sealed with a keyed hash over itself and the one before.
 *
 * Posting a record costs a copy into a bounded queue; a thread of its own writes, because a disk
 * may take seconds. Records that find no room, or that the disk does not take, are counted, and the
 * count is a record. Refusals of one kind that a client repeats are counted per minute.
 */
#ifndef DRIVEBRIDGE_AUDIT_H
#define DRIVEBRIDGE_AUDIT_H

#include "drivebridge/client.h"
#include "drivebridge/command.h"
#include "drivebridge/log.h"
#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum db_audit_kind {
	DB_AUDIT_COMMAND,  /* a drive is to do something */
	DB_AUDIT_WRITE,    /* parameters, and the settings that a drive has here */
	DB_AUDIT_END,      /* of an earlier record: how it ended */
	DB_AUDIT_CONTROL,  /* control of a drive was taken or released */
	DB_AUDIT_DENIED,   /* something that this client has no right to, or that is not there */
	DB_AUDIT_RELOAD,   /* the configuration */
	DB_AUDIT_SET_UP,   /* a scan of a bus, an address, a speed */
	DB_AUDIT_LOGIN,    /* told by a tool that has users of its own; also the next one */
	DB_AUDIT_USERS,    /* these users, their roles or passwords */
	DB_AUDIT_SERVICE,  /* it begins or ends */
	DB_AUDIT_REPEATED, /* so many more like an earlier record */
	DB_AUDIT_LOST,     /* so many are missing here */
	DB_AUDIT_TRAIL,    /* the files themselves: something was cut off, another key */
	DB_AUDIT_ALARM,    /* somebody has acknowledged it */
	DB_AUDIT_POSITION, /* a named position was taught, forgotten, or not gone to */
	DB_AUDIT_KIND_COUNT
};
const char *db_audit_kind_name(enum db_audit_kind kind); /* "command" ... */

/* For whom a session acts from where: "page, 10.0.0.5"; as its tool says it. */
#define DB_AUDIT_FROM_MAX 65

/* A parameter that is written. */
struct db_audit_value {
	const char *name; /* lives as long as the program */
	enum db_type type;
	union db_value old; /* valid with `known` */
	union db_value new;
	bool known;
	bool secret; /* neither value is recorded */
	/* of a record that was read: the new value, whose type its driver knows */
	double number;
};

/* A record. What its kind does not have is 0 or null. Texts are copied. */
struct db_audit_entry {
	enum db_audit_kind kind;
	enum db_result result; /* PENDING: a record of the kind END follows */
	uint64_t number;       /* from 1; set when it is posted */
	uint64_t time_us;      /* since 1970-01-01 UTC */
	uint64_t of;      /* number of the record that this is about, or whose stop it shares */
	uint64_t count;   /* of REPEATED and LOST */
	uint64_t took_us; /* of END: since it was asked for */

	/* Who: a client as in struct db_client, port 0: the service itself. */
	uint8_t address[16];
	uint16_t port;
	/* user of a session's process, or name of a client's certificate; "" or null: no name */
	const char *login;
	const char *user; /* for whom the session says it acts, or role of the certificate */
	const char *from; /* from where */
	/* the endpoint in whose units the client speaks; "" or null: the first one's, or no client */
	const char *endpoint;

	/* What. */
	const char *drive;
	const char *bus;
	uint16_t node;    /* the drive's address on its bus */
	uint16_t axis;    /* there; 0: the address has one drive */
	const char *what; /* not of commands, whose names are known */
	const char *text; /* details */
	uint16_t command; /* enum db_command */
	uint16_t id;      /* its command_id */
	uint16_t unit;    /* Modbus unit, where there is no drive */
	uint16_t first;   /* register that was refused */
	struct db_args args;
	const struct db_audit_value *values; /* DB_SETTINGS_MAX at most */
	size_t value_count;
};

struct db_audit;

struct db_audit_setup {
	struct db_log_source log; /* for trouble with the files; and records go to its journal */
	const char *folder;       /* where the files are, made if need be; null: nowhere */
	bool on;
	unsigned mib; /* size that they may take */
	/* Called for the latest records while the trail is made, in their order. May be null. */
	void (*past)(void *context, const struct db_audit_entry *entry);
	void *context;
};

/* Makes the trail; an unusable folder is logged. 0 or a negative errno. */
int db_audit_new(const struct db_audit_setup *setup, db_time now, struct db_audit **audit);
/* Writes the remaining records, for a second at most. Null is fine. False: the disk still holds up
 * the thread, which goes on using the log until the process ends. */
bool db_audit_free(struct db_audit *audit);
void db_audit_change(struct db_audit *audit, bool on, unsigned mib);

/*
 * Any thread; does not wait for the disk. `audit` may be null. Returns the lower half of the
 * record's number, for db_audit_end(); 0: it was counted, or lost, or the trail is off.
 */
uint32_t db_audit_post(struct db_audit *audit, const struct db_audit_entry *entry, db_time now);
/* How a record of this drive with the result PENDING ended, maybe more than once: a motion is
 * accepted, and then it ends. */
void db_audit_end(struct db_audit *audit, uint32_t number, const char *drive, enum db_result result,
                  uint32_t took_us, uint64_t time_us);

struct db_audit_state {
	bool on;
	bool kept;         /* in files; else only in the journal */
	unsigned mib;      /* that the files may take */
	uint64_t bytes;    /* that they take */
	uint64_t newest;   /* number of the newest record; 0: none */
	uint64_t lost;     /* records that are missing in the files, since the start */
	char trouble[128]; /* why they cannot be written at present; "" */
};

/* Any thread. */
void db_audit_state(struct db_audit *audit, struct db_audit_state *state);

/* --- reading ---------------------------------------------------------------------------------- */

/* One page of the trail is read for one owner at a time. */
struct db_audit_query {
	uint64_t from;     /* number of the first record */
	uint64_t since_us; /* older ones are left out; 0: none */
	bool refused;      /* only what was refused or failed */
	bool verify;       /* no records, only what does not verify */
	char drive[64];    /* only of this drive; "": all */
	char who[64];      /* only where the words for who contain this; "": all */
};

#define DB_AUDIT_BROKEN_MAX 16

/* Why a line does not belong to the chain. */
struct db_audit_broken {
	uint64_t number; /* of the last good record before it */
	char segment[32];
	uint64_t line;
	const char *why;
};

struct db_audit_page {
	char *records; /* members of a JSON array, to be freed; null: none */
	size_t length;
	uint64_t checked; /* lines that were looked at */
	uint64_t next;    /* where the next page begins */
	bool over;        /* there are no more at present */
	struct db_audit_broken broken[DB_AUDIT_BROKEN_MAX];
	size_t broken_count;
	uint64_t more_broken; /* that found no place */
};

/* Begins to read; false: another owner's page is being read. */
bool db_audit_ask(struct db_audit *audit, uint32_t owner, const struct db_audit_query *query);
/* False: it is not there yet. */
bool db_audit_take(struct db_audit *audit, uint32_t owner, struct db_audit_page *page);
/* The owner is gone. */
void db_audit_forget(struct db_audit *audit, uint32_t owner);

#endif
