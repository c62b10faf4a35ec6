/* SPDX-License-Identifier: Apache-2.0 */
/* Moments of the calendar as texts, ISO 8601 in UTC: "2026-03-01T12:00:00.000125Z". Pure. */
#ifndef DRIVEBRIDGE_MQTT_MOMENT_H
#define DRIVEBRIDGE_MQTT_MOMENT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

/* Of microseconds since 1970-01-01 UTC: a new JSON text. */
json_t *db_mqtt_moment_describe(int64_t us);

/* Also with another offset from UTC and with fewer digits after the seconds; false when it is no
 * such text. */
bool db_mqtt_moment_read(const char *text, int64_t *us);

#endif
