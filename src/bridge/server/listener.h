/* SPDX-License-Identifier: Apache-2.0 */
/* The listening socket, and accepted ones as they begin. Network thread only. */
#ifndef DRIVEBRIDGE_SERVER_LISTENER_H
#define DRIVEBRIDGE_SERVER_LISTENER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/*
 * Number of connections that may wait to be accepted, including those that have already ended. A
 * client that finds no room tries again after one second, then after three.
 */
#define DB_LISTENER_BACKLOG 1024

/*
 * Opens a non-blocking listening socket on "ADDRESS:PORT" or "[V6]:PORT" (numeric; port 0 is any
 * free one; "[::]" takes IPv4 clients too). An address that the machine does not have yet is
 * accepted: clients reach the socket when the address is there. The descriptor, or a negative
 * errno; EINVAL for text that cannot be read.
 *
 * `others` are listening meanwhile, perhaps with the same port at another, or at every, address of
 * the machine. The kernel allows that for two sockets of one user only if both agree, which they do
 * during this call: afterwards each of them excludes others as before.
 */
int db_listener_open(const int *others, size_t count, const char *address);

/* True if the machine did not have the address when the socket was opened. */
bool db_listener_is_early(int fd);

/* The port it is bound to, in host order; 0 if not known. */
uint16_t db_listener_port(int fd);

/*
 * Sets up an accepted socket: answers are sent at once, and a lost client is noticed: 40 s after it
 * fell silent, or after it has taken nothing for as long while there is something to send to it.
 */
void db_listener_tune(int fd);

#endif
