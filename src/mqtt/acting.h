/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Commands to drivebridged, over sessions of their own. A session belongs to one drive: while it waits for the end of a
 * motion it feeds the drive's watchdog, and when it is closed that is the loss of a client. One thread; never waits.
 */
#ifndef DRIVEBRIDGE_MQTT_ACTING_H
#define DRIVEBRIDGE_MQTT_ACTING_H

#include "drivebridge/time.h"
#include "mqtt/command.h"

#include <poll.h>

struct db_mqtt_acting;

/* What became of a command. The texts live for the call that has them. */
struct db_mqtt_outcome {
	const char *drive;
	const char *sender; /* as the command has it, "": it does not say */
	const char *id;
	const char *command;
	const char *result;
	const char *why;
	bool repeated; /* it had come before, and was not carried out again */
	bool refused;  /* it was not begun */
};

/* How a command goes: "pending" once the service has taken it and it takes time, then its end, by the names that the
 * service has for results; not_allowed, bad_value, no_such_command, busy, lost ... for its other errors. `why` is ""
 * when all is well. Of a stop that had to go out without a session "pending" is all. */
typedef void db_mqtt_result_fn(void *context, const struct db_mqtt_outcome *outcome);

/* The texts must outlive it. NULL without memory; freed with db_mqtt_acting_free(), NULL is allowed. */
struct db_mqtt_acting *db_mqtt_acting_new(const char *socket, db_mqtt_result_fn *result,
                                          void *context);
void db_mqtt_acting_free(struct db_mqtt_acting *acting);

/* Carries it out; its result comes, perhaps at once. The service begins it within `within_ms` or not at all; a stop
 * always. */
void db_mqtt_acting_run(struct db_mqtt_acting *acting, const char *drive,
                        const struct db_mqtt_command *command, unsigned within_ms, db_time now);

/* Who commands this drive is alive: tells its watchdog so, where a session has commanded it. */
void db_mqtt_acting_feed(struct db_mqtt_acting *acting, const char *drive, db_time now);

/* Ends all sessions, without a result for what is under way. Whether there were any. */
bool db_mqtt_acting_drop(struct db_mqtt_acting *acting);

/* Twelve drives can be commanded at the same time, and all of them be stopped; the service has 64 sessions for all its
 * tools. */
#define DB_MQTT_ACTING_FDS 13

void db_mqtt_acting_watch(const struct db_mqtt_acting *acting,
                          struct pollfd fds[DB_MQTT_ACTING_FDS]);
void db_mqtt_acting_handle(struct db_mqtt_acting *acting);

#endif
