/* SPDX-License-Identifier: Apache-2.0 */
#include "server/listener.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdbool.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* Silence after which TCP asks whether a client is still there, and between its questions. */
#define KEEPALIVE_S 10
#define KEEPALIVE_PROBES 3
/*
 * Without a limit the kernel grows both to megabytes for every client that floods us. 32 KiB hold
 * more than a hundred of the longest answers.
 */
#define SOCKET_BUFFER (32 * 1024)

static void set_option(int fd, int level, int name, int value)
{
	/* All of these are improvements only; the service works without them. */
	(void)setsockopt(fd, level, name, &value, sizeof(value));
}

/* Splits "host:port" or "[host]:port" and reads both as numbers. */
static int resolve_address(const char *text, struct addrinfo **found)
{
	const struct addrinfo hints = {
		.ai_socktype = SOCK_STREAM,
		.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE,
	};
	const char *colon = strrchr(text, ':');
	const char *start = text;
	char host[80];
	size_t length;

	if (!colon || colon == text || colon[1] == '\0')
		return -EINVAL;
	length = (size_t)(colon - text);
	if (text[0] == '[') {
		if (length < 3 || colon[-1] != ']')
			return -EINVAL;
		start++;
		length -= 2;
	} else if (memchr(text, ':', length)) {
		/* An IPv6 address without brackets: its last group would pass for the port. */
		return -EINVAL;
	}
	if (length >= sizeof(host) || strspn(colon + 1, "0123456789") != strlen(colon + 1) ||
	    strlen(colon + 1) > 5)
		return -EINVAL;
	memcpy(host, start, length);
	host[length] = '\0';
	return getaddrinfo(host, colon + 1, &hints, found) == 0 ? 0 : -EINVAL;
}

static int open_socket(const struct addrinfo *info, bool shared)
{
	bool v6 = info->ai_family == AF_INET6;
	int fd = socket(info->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	int error;

	if (fd < 0)
		return -errno;
	set_option(fd, SOL_SOCKET, SO_REUSEADDR, 1);
	set_option(fd, SOL_SOCKET, SO_REUSEPORT, shared);
	/* Accepted sockets inherit these two; the window is settled before accept() returns. */
	set_option(fd, SOL_SOCKET, SO_RCVBUF, SOCKET_BUFFER);
	set_option(fd, SOL_SOCKET, SO_SNDBUF, SOCKET_BUFFER);
	if (v6)
		set_option(fd, IPPROTO_IPV6, IPV6_V6ONLY, 0);
	error = bind(fd, info->ai_addr, info->ai_addrlen) == 0 ? 0 : -errno;
	/* The machine may not have the address yet, because the switch or the DHCP server starts
	 * later. The socket is bound to it all the same: clients can connect as soon as the machine
	 * has the address. */
	if (error == -EADDRNOTAVAIL) {
		set_option(fd, v6 ? IPPROTO_IPV6 : IPPROTO_IP, v6 ? IPV6_FREEBIND : IP_FREEBIND, 1);
		error = bind(fd, info->ai_addr, info->ai_addrlen) == 0 ? 0 : -errno;
	}
	if (error == 0 && listen(fd, DB_LISTENER_BACKLOG) < 0)
		error = -errno;
	if (error != 0) {
		close(fd);
		return error;
	}
	set_option(fd, SOL_SOCKET, SO_REUSEPORT, 0);
	return fd;
}

int db_listener_open(const int *others, size_t count, const char *address)
{
	struct addrinfo *info;
	int fd = resolve_address(address, &info);

	if (fd < 0)
		return fd;
	for (size_t i = 0; i < count; i++)
		set_option(others[i], SOL_SOCKET, SO_REUSEPORT, 1);
	fd = open_socket(info, count > 0);
	for (size_t i = 0; i < count; i++)
		set_option(others[i], SOL_SOCKET, SO_REUSEPORT, 0);
	freeaddrinfo(info);
	return fd;
}

uint16_t db_listener_port(int fd)
{
	union {
		struct sockaddr any;
		struct sockaddr_in v4;
		struct sockaddr_in6 v6;
	} address = { .any = { .sa_family = AF_UNSPEC } };
	socklen_t length = sizeof(address);

	if (getsockname(fd, &address.any, &length) < 0)
		return 0;
	if (address.any.sa_family == AF_INET6)
		return ntohs(address.v6.sin6_port);
	return ntohs(address.v4.sin_port);
}

bool db_listener_is_early(int fd)
{
	socklen_t length = sizeof(int);
	int free_bind = 0;

	/* One flag of the socket, for both address families. */
	return getsockopt(fd, IPPROTO_IP, IP_FREEBIND, &free_bind, &length) == 0 && free_bind != 0;
}

void db_listener_tune(int fd)
{
	set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
	set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
	set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, KEEPALIVE_S);
	set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, KEEPALIVE_S);
	set_option(fd, IPPROTO_TCP, TCP_KEEPCNT, KEEPALIVE_PROBES);
	/* If this is set, the kernel ends a connection after this time instead of counting probes;
	 * also that of a client that is alive but takes no answers. */
	set_option(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, (KEEPALIVE_PROBES + 1) * KEEPALIVE_S * 1000);
}
