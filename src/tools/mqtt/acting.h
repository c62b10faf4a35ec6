/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sends commands to drivebridged, over sessions of its own. A session belongs to one drive: while
 * it waits for the end of a motion it feeds the drive's watchdog, and closing it counts as the loss
 * of a client. Stops go past them (client/stops.h). One thread; never waits.
 */
#ifndef DRIVEBRIDGE_MQTT_ACTING_H
#define DRIVEBRIDGE_MQTT_ACTING_H

#include "drivebridge/time.h"
#include "mqtt/command.h"

#include <systemd/sd-event.h>

struct db_mqtt_acting;

/* The result of a command. The texts are valid during the call. */
struct db_mqtt_outcome {
	const char *drive;
	const char *sender; /* from the command, "": not given */
	const char *id;
	const char *command;
	const char *result;
	const char *why;
	bool repeated; /* it was received before, and not carried out again */
	bool refused;  /* it was not started */
};

/* Reports a command's progress: "pending" when the service has accepted it and it takes time, then
 * its result, by the service's names; not_allowed, bad_value, no_such_command, busy, lost ... for
 * other errors. `why` is "" without an error. For a stop that was sent without a session "pending"
 * is the only result. */
typedef void db_mqtt_result_fn(void *context, const struct db_mqtt_outcome *outcome);

/* The texts must outlive it. NULL without memory; freed with db_mqtt_acting_free(), NULL is
 * allowed. */
struct db_mqtt_acting *db_mqtt_acting_new(sd_event *loop, const char *socket,
                                          db_mqtt_result_fn *result, void *context);
void db_mqtt_acting_free(struct db_mqtt_acting *acting);

/* Carries it out; the result may be reported before this returns. The service starts it within
 * `within_ms` or not at all; a stop always. */
void db_mqtt_acting_run(struct db_mqtt_acting *acting, const char *drive,
                        const struct db_mqtt_command *command, unsigned within_ms, db_time now);

/* The sender of this drive's commands is alive: feeds the drive's watchdog, if a session has
 * commanded it, and for this user; NULL: whoever it was. */
void db_mqtt_acting_feed(struct db_mqtt_acting *acting, const char *drive, const char *user,
                         db_time now);

/* Whether the service has an audit trail, which is to say that it was MQTT. */
void db_mqtt_acting_set_audit(struct db_mqtt_acting *acting, bool has_audit);

/* Ends all sessions, without results for commands under way. True if there were any. */
bool db_mqtt_acting_drop(struct db_mqtt_acting *acting);

#endif
