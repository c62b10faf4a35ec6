/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The listening socket.
 */
#ifndef DRIVEBRIDGE_SERVER_LISTENER_H
#define DRIVEBRIDGE_SERVER_LISTENER_H

#include <stdint.h>

/*
 * Opens a non-blocking listening socket on "ADDRESS:PORT" or "[V6]:PORT" (numeric; port 0 is any
 * free one; "[::]" takes IPv4 clients too). The descriptor, or a negative errno; EINVAL for text
 * that cannot be read.
 */
int db_listener_open(const char *address);

/* The port it is bound to, in host order; 0 if that cannot be told. */
uint16_t db_listener_port(int fd);

/*
 * Sets up an accepted socket: answers leave at once, and a peer that is gone is noticed: after
 * keepalive_s of silence and three probes as far apart, so after four times this time; or, while
 * there is something to send to it, when it has taken none of it for as long. 0: only the latter,
 * after a minute.
 */
void db_listener_tune(int fd, unsigned keepalive_s);

#endif
