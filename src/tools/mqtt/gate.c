/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/gate.h"

#include "mqtt/packet.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* At least the longest packet; more bytes of the same read are passed on together. */
#define IN_MAX (2 * DB_MQTT_PACKET_MAX)
#define OUT_MAX 16384

struct db_mqtt_gate {
	int broker;
	int library; /* the other end of the library's socket pair */
	bool version_5;
	size_t in_used;
	size_t out_used;
	size_t out_sent;
	uint8_t in[IN_MAX];
	uint8_t out[OUT_MAX];
};

struct db_mqtt_gate *db_mqtt_gate_open(int library, bool version_5)
{
	struct db_mqtt_gate *gate = calloc(1, sizeof(*gate));
	int pair[2] = { -1, -1 };
	int cause;

	if (!gate)
		return NULL;
	gate->version_5 = version_5;
	gate->library = -1;
	gate->broker = fcntl(library, F_DUPFD_CLOEXEC, 0);
	if (gate->broker >= 0 &&
	    socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair) == 0) {
		gate->library = pair[1];
		/* gcc's analyzer: the descriptor is the library's, which closes it. */
		if (dup3(pair[0], library, O_CLOEXEC) == library) {
			(void)close(pair[0]);
			return gate;
		}
	}
	cause = errno;
	if (pair[0] >= 0)
		(void)close(pair[0]);
	db_mqtt_gate_close(gate);
	errno = cause;
	return NULL;
}

void db_mqtt_gate_close(struct db_mqtt_gate *gate)
{
	if (!gate)
		return;
	if (gate->broker >= 0)
		(void)close(gate->broker);
	if (gate->library >= 0)
		(void)close(gate->library);
	free(gate);
}

struct pollfd db_mqtt_gate_poll_fd(const struct db_mqtt_gate *gate)
{
	return (struct pollfd){ .fd = gate->broker,
		                .events = gate->out_sent < gate->out_used ? POLLIN | POLLOUT :
		                                                            POLLIN };
}

enum db_mqtt_gate_end db_mqtt_gate_receive(struct db_mqtt_gate *gate)
{
	ssize_t got = recv(gate->broker, gate->in + gate->in_used, IN_MAX - gate->in_used,
	                   MSG_DONTWAIT);
	enum db_mqtt_verdict verdict;
	size_t whole = 0;
	size_t length;

	if (got == 0)
		return DB_MQTT_GATE_CLOSED;
	if (got < 0)
		return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ?
		               DB_MQTT_GATE_OPEN :
		               DB_MQTT_GATE_BROKEN;
	gate->in_used += (size_t)got;
	/* Whole packets are passed on, as many as there are. */
	while ((verdict = db_mqtt_packet_check(gate->in + whole, gate->in_used - whole,
	                                       gate->version_5, &length)) == DB_MQTT_PACKET_WHOLE)
		whole += length;
	/* The library's end is closed or full; it is never full, because the library reads all
	 * before more bytes arrive. */
	if (whole > 0 &&
	    send(gate->library, gate->in, whole, MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)whole)
		return DB_MQTT_GATE_BROKEN;
	gate->in_used -= whole;
	memmove(gate->in, gate->in + whole, gate->in_used);
	return verdict == DB_MQTT_PACKET_WRONG ? DB_MQTT_GATE_WRONG : DB_MQTT_GATE_OPEN;
}

bool db_mqtt_gate_send(struct db_mqtt_gate *gate)
{
	for (;;) {
		ssize_t sent;

		/* The library's next bytes for the broker. */
		if (gate->out_sent == gate->out_used) {
			ssize_t got = recv(gate->library, gate->out, OUT_MAX, MSG_DONTWAIT);

			gate->out_sent = 0;
			gate->out_used = got > 0 ? (size_t)got : 0;
			if (got <= 0)
				return true;
		}
		sent = send(gate->broker, gate->out + gate->out_sent,
		            gate->out_used - gate->out_sent, MSG_DONTWAIT | MSG_NOSIGNAL);
		if (sent < 0)
			return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
		gate->out_sent += (size_t)sent;
	}
}
