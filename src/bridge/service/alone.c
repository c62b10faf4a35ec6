/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The lock is the name of an abstract socket: the kernel releases it however the process ends, it
 * needs no folder that both root and the service may write, and it belongs to a network namespace
 * just as CAN interfaces do.
 */
#include "service/service_private.h"

#include "drivebridge/hash.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/* Finds the process that has the name. False when it is another user's: any user can take a name,
 * and must not be able to prevent the service from starting with it. */
static bool is_drivebridge(const struct sockaddr_un *name, socklen_t length, pid_t *holder)
{
	int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	struct ucred peer = { 0 };
	socklen_t size = sizeof(peer);
	bool known = fd >= 0 && connect(fd, (const struct sockaddr *)name, length) == 0 &&
	             getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0;

	if (fd >= 0)
		close(fd);
	*holder = known ? peer.pid : 0;
	/* Called by root: the process with the name is most likely the service under its own
	 * user. */
	return !known || geteuid() == 0 || peer.uid == 0 || peer.uid == geteuid();
}

int alone_take(const char *path, pid_t *holder)
{
	struct sockaddr_un name = { .sun_family = AF_UNIX };
	uint64_t hash;
	char real[PATH_MAX];
	socklen_t length = offsetof(struct sockaddr_un, sun_path) + 1;
	int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	int error;

	if (fd < 0)
		return -errno;
	if (!realpath(path, real))
		snprintf(real, sizeof(real), "%s", path);
	/* A socket's name has no room for every path. */
	hash = db_hash_add(DB_HASH_BEGIN, real, strlen(real));
	length += (socklen_t)snprintf(name.sun_path + 1, sizeof(name.sun_path) - 1,
	                              "drivebridge-%016" PRIx64, hash);
	if (bind(fd, (const struct sockaddr *)&name, length) == 0 && listen(fd, 1) == 0)
		return fd;
	error = errno;
	if (error == EADDRINUSE) {
		if (!is_drivebridge(&name, length, holder))
			return fd;
		error = EBUSY;
	}
	close(fd);
	return -error;
}
