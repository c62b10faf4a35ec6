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

/* Sets up an accepted socket: answers leave at once, and a peer that is gone is noticed. */
void db_listener_tune(int fd);

#endif
