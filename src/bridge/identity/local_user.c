/* SPDX-License-Identifier: Apache-2.0 */
#include "identity/local_user.h"

#include <errno.h>
#include <linux/inet_diag.h>
#include <linux/netlink.h>
#include <linux/sock_diag.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* The set of states of a connection that has begun and has not ended. */
#define STATES                                                               \
	(1u << TCP_ESTABLISHED | 1u << TCP_FIN_WAIT1 | 1u << TCP_FIN_WAIT2 | \
	 1u << TCP_CLOSE_WAIT | 1u << TCP_LAST_ACK | 1u << TCP_CLOSING)

struct question {
	struct nlmsghdr head;
	struct inet_diag_req_v2 body;
};

struct end {
	uint32_t address[4]; /* as in struct inet_diag_sockid: an IPv4 address is the first word */
	uint16_t port;       /* network order */
	bool is_v4;
};

static bool read_end(const struct sockaddr_storage *from, struct end *end)
{
	static const uint8_t mapped[12] = { [10] = 0xFF, [11] = 0xFF };
	struct sockaddr_in6 v6;
	struct sockaddr_in v4;

	memset(end, 0, sizeof(*end));
	if (from->ss_family == AF_INET) {
		memcpy(&v4, from, sizeof(v4));
		end->address[0] = v4.sin_addr.s_addr;
		end->port = v4.sin_port;
		end->is_v4 = true;
	} else if (from->ss_family == AF_INET6) {
		memcpy(&v6, from, sizeof(v6));
		end->port = v6.sin6_port;
		end->is_v4 = memcmp(&v6.sin6_addr, mapped, sizeof(mapped)) == 0;
		if (end->is_v4)
			memcpy(end->address, v6.sin6_addr.s6_addr + sizeof(mapped), 4);
		else
			memcpy(end->address, &v6.sin6_addr, sizeof(end->address));
	} else {
		return false;
	}
	return true;
}

/*
 * True if it is an address of this machine. Nothing is sent: the kernel only chooses the address
 * from which it would send there, which is the same address, or another one of the loopback.
 * Whether a socket can be bound to it proves nothing: net.ipv4.ip_nonlocal_bind.
 */
static bool is_own_address(const struct sockaddr_storage *address, socklen_t size,
                           const struct end *peer)
{
	int fd = socket(address->ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	struct sockaddr_storage from = { 0 };
	socklen_t from_size = sizeof(from);
	struct end source;
	bool own;

	own = fd >= 0 && connect(fd, (const struct sockaddr *)address, size) == 0 &&
	      getsockname(fd, (struct sockaddr *)&from, &from_size) == 0 &&
	      read_end(&from, &source) &&
	      (memcmp(source.address, peer->address, sizeof(source.address)) == 0 ||
	       (source.is_v4 && *(const uint8_t *)source.address == IN_LOOPBACKNET));
	if (fd >= 0)
		close(fd);
	return own;
}

/* Asks for one socket: that of the peer, whose own end is `from`. 0 or a negative errno. */
static int ask(int netlink, const struct end *from, const struct end *to)
{
	struct question question = {
		.head = { .nlmsg_len = sizeof(question),
		          .nlmsg_type = SOCK_DIAG_BY_FAMILY,
		          .nlmsg_flags = NLM_F_REQUEST },
		.body = { .sdiag_family = from->is_v4 ? AF_INET : AF_INET6,
		          .sdiag_protocol = IPPROTO_TCP,
		          .idiag_states = UINT32_MAX,
		          .id = { .idiag_sport = from->port,
		                  .idiag_dport = to->port,
		                  .idiag_cookie = { INET_DIAG_NOCOOKIE, INET_DIAG_NOCOOKIE } } },
	};

	memcpy(question.body.id.idiag_src, from->address, sizeof(from->address));
	memcpy(question.body.id.idiag_dst, to->address, sizeof(to->address));
	return send(netlink, &question, sizeof(question), 0) < 0 ? -errno : 0;
}

/* 0 and the user, or a negative errno; ENOENT: there is no such socket. */
static int hear(int netlink, const struct end *from, const struct end *to, uid_t *user)
{
	union {
		struct nlmsghdr head;
		uint8_t bytes[1024];
	} answer;
	struct inet_diag_msg found;
	struct nlmsgerr failure;
	ssize_t length = recv(netlink, &answer, sizeof(answer), MSG_DONTWAIT);

	if (length < 0)
		return -errno;
	if (!NLMSG_OK(&answer.head, (size_t)length))
		return -EBADMSG;
	if (answer.head.nlmsg_type == NLMSG_ERROR &&
	    answer.head.nlmsg_len >= NLMSG_LENGTH(sizeof(failure))) {
		memcpy(&failure, NLMSG_DATA(&answer.head), sizeof(failure));
		return failure.error < 0 ? failure.error : -EBADMSG;
	}
	if (answer.head.nlmsg_type != SOCK_DIAG_BY_FAMILY ||
	    answer.head.nlmsg_len < NLMSG_LENGTH(sizeof(found)))
		return -EBADMSG;
	memcpy(&found, NLMSG_DATA(&answer.head), sizeof(found));
	/* The kernel falls back to a listening socket: only the connection itself counts. A socket
	 * that its process has closed has no inode any more, and its owner is then said to be
	 * root. */
	if (found.idiag_inode == 0 || found.idiag_state >= 32 ||
	    (STATES >> found.idiag_state & 1) == 0 || found.id.idiag_sport != from->port ||
	    found.id.idiag_dport != to->port ||
	    memcmp(found.id.idiag_src, from->address, from->is_v4 ? 4 : 16) != 0 ||
	    memcmp(found.id.idiag_dst, to->address, to->is_v4 ? 4 : 16) != 0)
		return -ENOENT;
	*user = found.idiag_uid;
	return 0;
}

enum db_local db_local_user(int fd, uid_t *user)
{
	struct sockaddr_storage peer = { 0 };
	struct sockaddr_storage own = { 0 };
	socklen_t size = sizeof(peer);
	socklen_t own_size = sizeof(own);
	struct end from, to;
	int netlink;
	int error;

	if (getpeername(fd, (struct sockaddr *)&peer, &size) < 0 ||
	    getsockname(fd, (struct sockaddr *)&own, &own_size) < 0 || !read_end(&peer, &from) ||
	    !read_end(&own, &to))
		return DB_LOCAL_UNKNOWN;
	netlink = socket(AF_NETLINK, SOCK_DGRAM | SOCK_CLOEXEC, NETLINK_SOCK_DIAG);
	error = netlink < 0 ? -errno : ask(netlink, &from, &to);
	if (error == 0)
		error = hear(netlink, &from, &to, user);
	if (netlink >= 0)
		close(netlink);
	if (error == 0)
		return DB_LOCAL_USER;
	return is_own_address(&peer, size, &from) ? DB_LOCAL_UNKNOWN : DB_LOCAL_NO;
}
