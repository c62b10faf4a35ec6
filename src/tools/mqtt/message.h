/* SPDX-License-Identifier: Apache-2.0 */
/* A message on its way to the broker. */
#ifndef DRIVEBRIDGE_MQTT_MESSAGE_H
#define DRIVEBRIDGE_MQTT_MESSAGE_H

#include <stdbool.h>
#include <stddef.h>

struct db_mqtt_message {
	const char *topic;
	const void *payload;
	size_t length; /* bytes of the payload */
	bool retained;
	int qos; /* 0 or 1 */
};

#endif
