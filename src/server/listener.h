/* SPDX-License-Identifier: Apache-2.0 */
/* The listening socket, and accepted ones as they begin. Network thread only. */
#ifndef DRIVEBRIDGE_SERVER_LISTENER_H
#define DRIVEBRIDGE_SERVER_LISTENER_H

#include <stdbool.h>
#include <stdint.h>

/*
 * So many connections may wait to be accepted, those included that are over by then. One that finds
 * no room is tried again by its system after one second, then after three.
 */
#define DB_LISTENER_BACKLOG 1024

/*
 * Opens a non-blocking listening socket on "ADDRESS:PORT" or "[V6]:PORT" (numeric; port 0 is any
 * free one; "[::]" takes IPv4 clients too). An address that the machine does not have yet is waited
 * for: clients reach the socket when it comes. The descriptor, or a negative errno; EINVAL for text
 * that cannot be read.
 */
int db_listener_open(const char *address);

/*
 * The same beside a socket that is listening already, and that may have the same port at another,
 * or at every, address of the machine. The kernel lets two sockets of one user do that only if both
 * agree, which they do during this call: afterwards each of them keeps others out as before.
 */
int db_listener_open_beside(int other, const char *address);

/* Whether the machine did not have the address when the socket was opened. */
bool db_listener_is_early(int fd);

/* The port it is bound to, in host order; 0 if that cannot be told. */
uint16_t db_listener_port(int fd);

/*
 * Sets up an accepted socket: answers leave at once, and a peer that is gone is noticed: after
 * keepalive_s of silence and three probes as far apart, so after four times this time; or, while
 * there is something to send to it, when it has taken none of it for as long. 0: only the latter,
 * after a minute. May be called again with another time.
 */
void db_listener_tune(int fd, unsigned keepalive_s);

#endif
