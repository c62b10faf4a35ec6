/* SPDX-License-Identifier: Apache-2.0 */
/* The form of Sparkplug B 3.0: this gateway is an edge node, its drives are devices. */
#ifndef DRIVEBRIDGE_MQTT_NODE_H
#define DRIVEBRIDGE_MQTT_NODE_H

#include "mqtt/form.h"

extern const struct db_mqtt_form_ops db_mqtt_node;

#endif
