/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A filter between the broker and libmosquitto's socket: the library gets whole packets with a
 * checked form, and nothing else. By itself it takes any bytes, and some of them end the program
 * (2.0.11: an unknown property). It keeps its descriptor, which is one end of a socket pair from
 * then on; the gate has the connection.
 *
 * Not with TLS, which the library itself does on that descriptor. One thread; never waits.
 */
#ifndef DRIVEBRIDGE_MQTT_GATE_H
#define DRIVEBRIDGE_MQTT_GATE_H

#include <poll.h>
#include <stdbool.h>

struct db_mqtt_gate;

/* Takes over the connection of the descriptor, which may still be in progress. NULL with errno. The
 * library's descriptor stays its own. Closed with db_mqtt_gate_close(), NULL is allowed. */
struct db_mqtt_gate *db_mqtt_gate_open(int library, bool version_5);
void db_mqtt_gate_close(struct db_mqtt_gate *gate);

/* For poll(): the descriptor of the connection, with POLLOUT while bytes wait for room. */
struct pollfd db_mqtt_gate_poll_fd(const struct db_mqtt_gate *gate);

enum db_mqtt_gate_end {
	DB_MQTT_GATE_OPEN,
	DB_MQTT_GATE_CLOSED, /* by the broker */
	DB_MQTT_GATE_BROKEN, /* errno has the reason */
	DB_MQTT_GATE_WRONG,  /* the bytes are no packet of MQTT that a broker may send */
};

/* Passes received bytes to the library, as many as fit at once; also those received before an
 * end. */
enum db_mqtt_gate_end db_mqtt_gate_receive(struct db_mqtt_gate *gate);

/* Sends the library's bytes to the broker, as far as there is room. False with errno: the
 * connection is broken. */
bool db_mqtt_gate_send(struct db_mqtt_gate *gate);

#endif
