/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Between libmosquitto's socket and the broker: the library gets whole packets whose form was checked, and nothing else.
 * Of its own it takes whatever comes, and ends the program with some of it (2.0.11: an unknown property). It keeps its
 * descriptor, behind which is a pair of sockets from then on; the connection is the gate's.
 *
 * Not with TLS, which the library does itself on that descriptor. One thread; never waits.
 */
#ifndef DRIVEBRIDGE_MQTT_GATE_H
#define DRIVEBRIDGE_MQTT_GATE_H

#include <stdbool.h>

struct db_mqtt_gate;

/* Takes the connection behind the descriptor over, which may still be under way. NULL with errno. The library's
 * descriptor stays its own. Closed with db_mqtt_gate_close(), NULL is allowed. */
struct db_mqtt_gate *db_mqtt_gate_open(int library, bool version_5);
void db_mqtt_gate_close(struct db_mqtt_gate *gate);

/* The connection. */
int db_mqtt_gate_fd(const struct db_mqtt_gate *gate);

enum db_mqtt_gate_end {
	DB_MQTT_GATE_OPEN,
	DB_MQTT_GATE_CLOSED, /* by the broker */
	DB_MQTT_GATE_BROKEN, /* errno says why */
	DB_MQTT_GATE_WRONG,  /* what comes is no packet of MQTT that a broker may send */
};

/* What has come, as much as fits at once, goes to the library; also what came before an end. */
enum db_mqtt_gate_end db_mqtt_gate_receive(struct db_mqtt_gate *gate);

/* What the library has sent goes to the broker, as far as there is room. False with errno: the connection is broken. */
bool db_mqtt_gate_send(struct db_mqtt_gate *gate);

/* Whether something waits for room. */
bool db_mqtt_gate_is_choked(const struct db_mqtt_gate *gate);

#endif
