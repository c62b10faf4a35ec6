/* SPDX-License-Identifier: Apache-2.0 */
/* The published form of what is wrong: the service's records with their times as texts. Allocates
 * as jansson does. */
#ifndef DRIVEBRIDGE_MQTT_TROUBLE_H
#define DRIVEBRIDGE_MQTT_TROUBLE_H

#include <jansson.h>

/* Of a drive, of a bus or of the configuration; the caller frees it. NULL for an unknown one: each
 * member is null. */
json_t *db_mqtt_trouble_write(const json_t *record);

/* An event of the log; the caller frees it. */
json_t *db_mqtt_trouble_write_event(json_t *event);

#endif
