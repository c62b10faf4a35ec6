/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A command for a drive, from the payload of a DCMD. The oldest time among its metrics, or where
 * they have none that of the payload, is when it was sent. Pure but for memory.
 */
#ifndef DRIVEBRIDGE_MQTT_ORDER_H
#define DRIVEBRIDGE_MQTT_ORDER_H

#include "mqtt/command.h"
#include "mqtt/points.h"

/*
 * NULL, or the mistake in words; then the id is set if it could be read. `stops`: an object with
 * the names of commands that stop: where one of them is among the metrics it is the command,
 * whatever else there is. *alive: there is no command, and `wrong` is not to be told: it is a sign
 * of life. The command is to be cleared in every case.
 */
const char *db_mqtt_order_read(const struct db_mqtt_points *points, const json_t *stops,
                               const void *bytes, size_t length, struct db_mqtt_command *command,
                               bool *alive);

/* True if the payload of an NCMD has true for the metric with this name. */
bool db_mqtt_order_asks(const void *bytes, size_t length, const char *name);

#endif
