/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant as drivebridged shows it: its drives with their registers and commands, streams of
 * values, of events and of what is wrong, the figures of its buses. Connects by itself, and again
 * each second after a loss; when the drives change, all is read again. One thread; never waits.
 */
#ifndef DRIVEBRIDGE_CLIENT_PLANT_H
#define DRIVEBRIDGE_CLIENT_PLANT_H

#include "client/link.h"
#include "client/troubles.h"
#include "drivebridge/time.h"

struct db_plant;

struct db_plant_drive {
	/* Of the interface's type Drive; an empty object for the gateway. */
	json_t *description;
	json_t *registers; /* arrays of its types Register and Command */
	json_t *commands;
};

struct db_plant_wishes {
	const char *socket;
	/* Without them a drive has none here, and other drives are read over the same
	 * connection. */
	bool registers;
	bool gateway; /* it counts as a drive without a name, the last one */
	bool events;
	bool troubles;
	bool alarms;
	/* The figures are asked for at this interval, and then the description; 0: neither is. */
	db_time interval;
};

/* All objects stay the plant's. Handlers of what was not wished for may be NULL. */
struct db_plant_ops {
	/* Takes out of a description what the owner does not want; may be NULL. */
	void (*choose)(void *context, json_t *description);
	/* What is kept of a drive's registers or commands: a new reference, perhaps to an equal
	 * object that the owner has already. NULL: what was received is. */
	json_t *(*keep)(void *context, const char *drive, json_t *received, bool commands);
	/* The service is connected, or has other drives: its Describe, and all drives. Streams of
	 * values begin here. */
	void (*found)(void *context, json_t *description, const struct db_plant_drive *drives,
	              size_t count);
	/* After an answer to a later Describe, if the drives are the same; may be NULL. */
	void (*described)(void *context, json_t *description);
	void (*lost)(void *context);
	/* A sample of the interface's type Sample; when it was sent. */
	void (*sample)(void *context, const json_t *sample, int64_t us);
	/* This number of samples was left out because this program read too slowly; may be NULL. */
	void (*skipped)(void *context, int64_t count);
	void (*event)(void *context, json_t *event);
	/* By bus. */
	void (*figures)(void *context, json_t *buses);
	/* What is wrong has changed: `news` is the answer with the changes. */
	void (*troubles)(void *context, const struct db_client_troubles *troubles,
	                 const json_t *news);
	/* Alarms, an answer to the interface's method Alarms: after `first` all there are, also in
	 * further answers, and then what changes. A service that has none never answers. */
	void (*alarms)(void *context, const json_t *answer, bool first);
};

/* Its texts and `ops` must outlive it. NULL without memory; freed with db_plant_free(), NULL is
 * allowed. */
struct db_plant *db_plant_new(sd_event *loop, const struct db_plant_wishes *wishes,
                              const struct db_plant_ops *ops, void *context);
void db_plant_free(struct db_plant *plant);

/* Does the work that is due; returns when it is to be called next without an answer. */
db_time db_plant_tend(struct db_plant *plant, db_time now);

/* The service is connected, and all was known; it may be reading other drives now. */
bool db_plant_is_there(const struct db_plant *plant);

/* True while an answer is awaited for longer than a second: a service that hangs keeps its
 * connections open, with silent streams. */
bool db_plant_is_late(const struct db_plant *plant, db_time now);

/* The names of the commands that stop a drive: an object, with what the service has told of any of
 * its drives' commands; it stays the plant's. They are remembered when the service is lost. */
json_t *db_plant_stops(const struct db_plant *plant);
bool db_plant_is_stop(const struct db_plant *plant, const char *command);

/* The stream of values, instead of a former one; both arrays stay the caller's. No drives: all of
 * them; NULL names: none. `changes`: messages have what differs from the one before. */
void db_plant_subscribe(struct db_plant *plant, json_t *drives, json_t *names, unsigned interval_ms,
                        bool changes);

/* For calls that only read. NULL while the service is not there. */
struct db_link *db_plant_reader(const struct db_plant *plant);

/* What a user did at this tool, for the audit trail. Texts in UTF-8; NULL: none. */
struct db_plant_note {
	const char *kind; /* "login", "users" or "denied" */
	const char *what; /* "in", "changed", a command; up to 31 bytes */
	const char *user;
	const char *from; /* where the user is */
	const char *text; /* details; up to 255 bytes */
	const char *drive;
	bool refused;
};

/* Adds it to the audit trail, if the service has one and this tool may
 * command there. While there is no service, up to DB_PLANT_NOTES are kept, with their time, and
 * added when it comes; more are counted. */
#define DB_PLANT_NOTES 64
void db_plant_note(struct db_plant *plant, const struct db_plant_note *note);

/* Reads the description again, unless an answer is awaited anyway. */
void db_plant_refresh(struct db_plant *plant);

/* The owner cannot go on with this connection: all is closed and read again later. The reason is
 * logged once. */
void db_plant_fail(struct db_plant *plant, const char *why);

#endif
