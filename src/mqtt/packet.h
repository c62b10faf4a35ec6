/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a broker sends, packet by packet, as far as its form goes: types that a broker may send, lengths that fit each
 * other, and properties that there are in MQTT 5. What the packets mean the library knows. Pure.
 */
#ifndef DRIVEBRIDGE_MQTT_PACKET_H
#define DRIVEBRIDGE_MQTT_PACKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The longest packet that is taken, in bytes: commands are short. */
#define DB_MQTT_PACKET_MAX 16384

enum db_mqtt_verdict {
	DB_MQTT_PACKET_PART, /* more has to come before it can be told */
	DB_MQTT_PACKET_WHOLE,
	DB_MQTT_PACKET_WRONG,
};

/* The packet that the bytes begin with; *length is that of a whole one. */
enum db_mqtt_verdict db_mqtt_packet_check(const uint8_t *bytes, size_t count, bool version_5,
                                          size_t *length);

#endif
