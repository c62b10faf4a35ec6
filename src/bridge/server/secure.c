/* SPDX-License-Identifier: Apache-2.0 */
#include "server/secure.h"

#include "drivebridge/loop_clock.h"
#include "identity/rights.h"
#include "transport/unix_listener.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/* The user that drivebridge-tls runs as. */
#define USER "drivebridge-tls"

/* Connections without a whole hello, and those that tell a status. A hello comes at once: its
 * sender is on this machine. */
#define VISITORS_MAX 32
#define HELLO_TIMEOUT (2 * DB_NS_PER_S)
/* The status comes every 5 s. */
#define STATUS_TIME (12 * DB_NS_PER_S)
#define ACCEPTS_AT_ONCE 16

/* A connection until its hello is there; one with a status stays. */
struct visitor {
	struct db_secure *secure;
	int fd; /* -1: the place is free */
	sd_event_source *io;
	db_time until; /* DB_TIME_NEVER: it tells a status */
	size_t used;
	uint8_t bytes[DB_SECURE_HELLO_SIZE];
};

struct db_secure {
	const struct db_log_source *log;
	sd_event *loop;
	sd_event_source *io;
	int listener;
	char *path;
	db_secure_admit_fn *admit;
	void *context;
	const struct visitor *teller; /* whose status counts: the latest one; null */
	struct db_secure_status status;
	db_time told; /* when it came */
	struct visitor visitors[VISITORS_MAX];
};

/* Returns the descriptor, which is no longer watched. */
static int end_visit(struct visitor *visitor)
{
	struct db_secure *secure = visitor->secure;
	int fd = visitor->fd;

	visitor->io = sd_event_source_disable_unref(visitor->io);
	visitor->fd = -1;
	if (secure->teller == visitor) {
		secure->teller = NULL;
		db_log(secure->log, db_loop_now(secure->loop), DB_EVENT_SECURE_CHANGED, NULL,
		       "drivebridge-tls is gone");
	}
	return fd;
}

static int on_bytes(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct visitor *visitor = data;
	/* Not one byte more: what follows is Modbus. */
	ssize_t got = recv(fd, visitor->bytes + visitor->used,
	                   sizeof(visitor->bytes) - visitor->used, MSG_DONTWAIT);

	(void)source;
	(void)events;
	if (got < 0 && (errno == EAGAIN || errno == EINTR))
		return 0;
	if (got <= 0) {
		close(end_visit(visitor));
		return 0;
	}
	visitor->used += (size_t)got;
	if (visitor->used == sizeof(visitor->bytes)) {
		struct db_secure *secure = visitor->secure;
		struct db_secure_hello hello;

		visitor->used = 0;
		switch (db_secure_hello_read(visitor->bytes, &hello)) {
		case DB_SECURE_CLIENT:
			/* One connection is one or the other. */
			if (visitor->until == DB_TIME_NEVER)
				close(end_visit(visitor));
			else
				secure->admit(secure->context, end_visit(visitor), &hello.client);
			break;
		case DB_SECURE_STATUS:
			if (!secure->teller)
				db_log(secure->log, db_loop_now(secure->loop),
				       DB_EVENT_SECURE_CHANGED, NULL, "drivebridge-tls is there");
			secure->status = hello.status;
			secure->told = db_loop_now(secure->loop);
			secure->teller = visitor;
			visitor->until = DB_TIME_NEVER;
			break;
		case DB_SECURE_WRONG:
			db_log(secure->log, db_loop_now(secure->loop), DB_EVENT_CLIENT_REFUSED,
			       NULL,
			       "secure socket: what came is not of this version; the packages "
			       "drivebridge and drivebridge-tls must be of the same");
			close(end_visit(visitor));
			break;
		}
	}
	return 0;
}

/* A free place, or one whose time is over. */
static struct visitor *find_place(struct db_secure *secure)
{
	db_time now = db_loop_now(secure->loop);

	for (size_t i = 0; i < VISITORS_MAX; i++) {
		struct visitor *visitor = &secure->visitors[i];

		if (visitor->fd >= 0 && visitor->until <= now)
			close(end_visit(visitor));
		if (visitor->fd < 0)
			return visitor;
	}
	return NULL;
}

static int on_visitors(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_secure *secure = data;

	(void)source;
	(void)events;
	for (int i = 0; i < ACCEPTS_AT_ONCE; i++) {
		int accepted = accept4(fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
		char name[DB_CLIENT_PROCESS_USER_MAX];
		struct visitor *visitor = NULL;
		struct ucred peer;
		socklen_t size = sizeof(peer);

		if (accepted < 0)
			break;
		/* Others than the users that secure.h names are closed at once. */
		if (getsockopt(accepted, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0) {
			db_rights_name(peer.uid, name);
			if (peer.uid == 0 || peer.uid == geteuid() || strcmp(name, USER) == 0)
				visitor = find_place(secure);
		}
		if (!visitor || sd_event_add_io(secure->loop, &visitor->io, accepted, EPOLLIN,
		                                on_bytes, visitor) < 0) {
			close(accepted);
			continue;
		}
		visitor->fd = accepted;
		visitor->used = 0;
		visitor->until = db_loop_now(secure->loop) + HELLO_TIMEOUT;
		/* Usually the hello has already been received. */
		(void)on_bytes(NULL, accepted, EPOLLIN, visitor);
	}
	return 0;
}

int db_secure_new(sd_event *loop, const char *path, const struct db_log_source *log,
                  db_secure_admit_fn *admit, void *context, struct db_secure **secure,
                  const char **why)
{
	struct db_secure *made = calloc(1, sizeof(*made));
	int error;

	*why = NULL;
	if (!made)
		return -ENOMEM;
	made->log = log;
	made->loop = sd_event_ref(loop);
	made->admit = admit;
	made->context = context;
	for (size_t i = 0; i < VISITORS_MAX; i++)
		made->visitors[i] = (struct visitor){ .secure = made, .fd = -1 };
	made->listener = db_unix_listener_open(path, why);
	made->path = made->listener >= 0 ? strdup(path) : NULL;
	error = made->listener < 0 ? -EADDRINUSE : made->path ? 0 : -ENOMEM;
	if (error == 0)
		error = sd_event_add_io(loop, &made->io, made->listener, EPOLLIN, on_visitors,
		                        made);
	if (error < 0) {
		db_secure_free(made);
		return error;
	}
	*secure = made;
	return 0;
}

void db_secure_free(struct db_secure *secure)
{
	if (!secure)
		return;
	secure->teller = NULL;
	for (size_t i = 0; i < VISITORS_MAX; i++) {
		if (secure->visitors[i].fd >= 0)
			close(end_visit(&secure->visitors[i]));
	}
	sd_event_source_disable_unref(secure->io);
	if (secure->path)
		unlink(secure->path);
	if (secure->listener >= 0)
		close(secure->listener);
	sd_event_unref(secure->loop);
	free(secure->path);
	free(secure);
}

bool db_secure_read_status(const struct db_secure *secure, struct db_secure_status *status)
{
	if (!secure || !secure->teller || db_loop_now(secure->loop) - secure->told > STATUS_TIME)
		return false;
	*status = secure->status;
	return true;
}
