/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/unix_listener.h"

#include <errno.h>
#include <stdbool.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#define BACKLOG 64

/* True if it is a socket at which no process listens. */
static bool is_left_over(const struct sockaddr_un *name)
{
	struct stat stat;
	int fd;
	bool refused;

	if (lstat(name->sun_path, &stat) != 0 || !S_ISSOCK(stat.st_mode))
		return false;
	fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	if (fd < 0)
		return false;
	refused = connect(fd, (const struct sockaddr *)name, sizeof(*name)) != 0 &&
	          errno == ECONNREFUSED;
	close(fd);
	return refused;
}

int db_unix_listener_open(const char *path, const char **why)
{
	struct sockaddr_un name = { .sun_family = AF_UNIX };
	int fd;
	int error;

	if (strlen(path) >= sizeof(name.sun_path)) {
		*why = "the path is too long for a socket";
		return -1;
	}
	strcpy(name.sun_path, path);
	fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	if (fd < 0) {
		*why = strerror(errno);
		return -1;
	}
	error = bind(fd, (struct sockaddr *)&name, sizeof(name)) == 0 ? 0 : errno;
	if (error == EADDRINUSE && is_left_over(&name) && unlink(path) == 0)
		error = bind(fd, (struct sockaddr *)&name, sizeof(name)) == 0 ? 0 : errno;
	/* Before it listens: access must not depend on the process's umask. */
	if (error == 0 && (chmod(path, 0666) != 0 || listen(fd, BACKLOG) != 0)) {
		error = errno;
		unlink(path);
	}
	if (error == 0)
		return fd;
	*why = error == EADDRINUSE ? "something else is there already" : strerror(error);
	close(fd);
	return -1;
}
