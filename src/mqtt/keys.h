/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one table of what drivebridge-mqtt's configuration may say, of which docs/mqtt-keys.csv and the manual page are
 * made; the offsets are those of struct db_mqtt_config. Pure.
 */
#ifndef DRIVEBRIDGE_MQTT_KEYS_H
#define DRIVEBRIDGE_MQTT_KEYS_H

#include "reader/settings.h"

extern const struct db_setting db_mqtt_keys[];

#endif
