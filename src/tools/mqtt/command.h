/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A command for a drive, parsed from the text of a message:
 *
 *   {"id": "4711", "time": "2026-03-01T12:00:00Z", "command": "move_absolute",
 *    "arguments": {"target_position": 3200}}
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
	json_t *message;             /* owner of the pointers below */
	char id[DB_MQTT_ID_MAX + 1]; /* "": none */
	bool timed;                  /* it has the time of its sending: */
	int64_t us;                  /* microseconds since 1970-01-01 UTC */
	const char *user;            /* the user, as given by the sender; "": not given */
	const char *token;           /* of the service's clock, the sender's newest; NULL: none */
	const char *name;            /* of a command; NULL: registers are written */
	bool stops;                  /* it can only stop a drive: that does no harm late or twice */
	/* of the command, NULL when there are none; or the values to be written */
	json_t *arguments;
};

/* NULL, or the mistake in words; then `id` is set if it could be read. `stops`: an object with the
 * names of commands that stop. The command is to be cleared in every case. */
const char *db_mqtt_command_parse(const char *text, size_t length, const json_t *stops,
                                  struct db_mqtt_command *command);

/* The same for a message on the topic of stops: a message that is no valid command counts as
 * "stop". */
const char *db_mqtt_command_parse_stop(const char *text, size_t length, const json_t *stops,
                                       struct db_mqtt_command *command);

/* A first check of a user's name, which may be NULL; the service decides. */
bool db_mqtt_command_user_is_good(const json_t *user);
void db_mqtt_command_clear(struct db_mqtt_command *command);

#endif
