/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The secure socket: a Unix socket at which drivebridge-tls hands over clients whose certificates
 * it has verified, each on a connection of its own that begins with a hello
 * (codec/secure_hello.h). Only processes of its own user, of root and of the service's user are
 * believed; others are closed at once. Another connection of it tells how the program itself is.
 * Network thread only.
 */
#ifndef DRIVEBRIDGE_SERVER_SECURE_H
#define DRIVEBRIDGE_SERVER_SECURE_H

#include "codec/secure_hello.h"
#include "drivebridge/log.h"

#include <systemd/sd-event.h>

struct db_secure;

/* A client was handed over: its non-blocking descriptor, which is taken over, carries Modbus from
 * here on. */
typedef void db_secure_admit_fn(void *context, int fd, const struct db_secure_client *client);

/* Listens at the path. The log must outlive it. 0 or a negative errno; *why then is the reason in
 * words, or null. */
int db_secure_new(sd_event *loop, const char *path, const struct db_log_source *log,
                  db_secure_admit_fn *admit, void *context, struct db_secure **secure,
                  const char **why);
/* Removes the socket. Clients that were handed over stay. Null is fine. */
void db_secure_free(struct db_secure *secure);

/* How the program is. False: it is not connected, or silent. `secure` may be null. */
bool db_secure_read_status(const struct db_secure *secure, struct db_secure_status *status);

#endif
