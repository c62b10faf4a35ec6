/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What somebody wants of a drive, out of the text of a message:
 *
 *   {"id": "4711", "time": "2026-03-01T12:00:00Z", "command": "move_absolute", "arguments": {"target_position": 3200}}
 *   {"id": "4712", "time": "2026-03-01T12:00:01Z", "user": "anna", "write": {"spd": 6400}}
 *   {"id": "4713", "token": "8f3a2c71-123456", "command": "jog_positive"}
 *
 * Pure but for jansson's memory.
 */
#ifndef DRIVEBRIDGE_MQTT_COMMAND_H
#define DRIVEBRIDGE_MQTT_COMMAND_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DB_MQTT_ID_MAX 64
#define DB_MQTT_USER_MAX 32       /* bytes */
#define DB_MQTT_COMMAND_MAX 16384 /* bytes of a message */

struct db_mqtt_command {
	json_t *message;             /* owns what follows */
	char id[DB_MQTT_ID_MAX + 1]; /* "" when there is none */
	bool timed;                  /* it says when it was sent: */
	int64_t us;                  /* microseconds since 1970-01-01 UTC */
	const char *user;            /* who wants it, as the sender says; "": not said */
	const char *
		token; /* of the service's clock, as it was when the sender wanted it; NULL: not said */
	const char *name; /* of a command; NULL: registers are written */
	json_t *arguments; /* of the command, NULL when there are none; or the values to be written */
};

/* NULL, or what is wrong with it, in words; `id` is then as far as it could be read. The command is to be cleared in
 * any case. */
const char *db_mqtt_command_parse(const char *text, size_t length, struct db_mqtt_command *command);

/* The same of a message where only stops belong: one that is no command is "stop", whatever it says. */
const char *db_mqtt_command_parse_stop(const char *text, size_t length,
                                       struct db_mqtt_command *command);
void db_mqtt_command_clear(struct db_mqtt_command *command);

/* Whether the command can only stop a drive: that does no harm late or twice. */
bool db_mqtt_command_is_stop(const struct db_mqtt_command *command);

#endif
