/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The user of the process at the other end of a TCP connection, where that is on this machine, in
 * the same network namespace: the kernel is asked for the owner of the peer's socket
 * (sock_diag(7)). So a client on the loopback, or on the machine's own address, has an identity
 * that it cannot choose. No state, and no wait: the kernel answers within the call. Network thread.
 */
#ifndef DRIVEBRIDGE_IDENTITY_LOCAL_USER_H
#define DRIVEBRIDGE_IDENTITY_LOCAL_USER_H

#include <sys/types.h>

enum db_local {
	DB_LOCAL_NO,      /* the peer's socket is not on this machine */
	DB_LOCAL_USER,    /* it is, and this user made it */
	DB_LOCAL_UNKNOWN, /* it was on this machine and is gone, or the kernel could not be asked */
};

/* `fd` is an accepted TCP socket. */
enum db_local db_local_user(int fd, uid_t *user);

#endif
