/* SPDX-License-Identifier: Apache-2.0 */
/* The form of texts: JSON under topics of this program's own (topics.h). */
#ifndef DRIVEBRIDGE_MQTT_PLAIN_H
#define DRIVEBRIDGE_MQTT_PLAIN_H

#include "mqtt/form.h"

extern const struct db_mqtt_form_ops db_mqtt_plain;

#endif
