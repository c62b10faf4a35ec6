/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Checks the form of a broker's packets: types that a broker may send, matching lengths, and
 * properties that MQTT 5 defines. The library knows the meaning of the packets. Pure.
 */
#ifndef DRIVEBRIDGE_MQTT_PACKET_H
#define DRIVEBRIDGE_MQTT_PACKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The longest accepted packet, in bytes: commands are short. */
#define DB_MQTT_PACKET_MAX 16384

enum db_mqtt_verdict {
	DB_MQTT_PACKET_PART, /* incomplete: more bytes are needed */
	DB_MQTT_PACKET_WHOLE,
	DB_MQTT_PACKET_WRONG,
};

/* Checks the packet at the beginning of the bytes; *length is that of a whole one. */
enum db_mqtt_verdict db_mqtt_packet_check(const uint8_t *bytes, size_t count, bool version_5,
                                          size_t *length);

#endif
