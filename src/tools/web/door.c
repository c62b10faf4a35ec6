/* SPDX-License-Identifier: Apache-2.0 */
#include "web/door.h"
#include "web/address.h"

#include "client/clock.h"
#include "client/log.h"
#include "drivebridge/version.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

/* Most bytes in the kernel for a browser that does not read: they get old there. */
#define UNSENT_MAX (32 * 1024)
#define BACKLOG 128
/* Before others have their turn. */
#define ACCEPTED_AT_ONCE 16
/* More than that are closed before their time, the oldest first. */
#define HELD_MAX 256
#define HELD_TIME DB_NS_PER_S

struct held {
	int fd;
	db_time since;
};

struct db_web_door {
	int fd;
	sd_event_source *ready;
	db_web_door_fn *take;
	void *context;
	struct held held[HELD_MAX]; /* a ring */
	size_t oldest;
	size_t count;
};

static void close_oldest(struct db_web_door *door)
{
	(void)close(door->held[door->oldest].fd);
	door->oldest = (door->oldest + 1) % HELD_MAX;
	door->count--;
}

static int on_connection(sd_event_source *source, int listening, uint32_t events, void *data)
{
	struct db_web_door *door = data;

	(void)events;
	for (unsigned i = 0; i < ACCEPTED_AT_ONCE; i++) {
		struct sockaddr_storage peer;
		socklen_t size = sizeof(peer);
		int fd = accept4(listening, (struct sockaddr *)&peer, &size,
		                 SOCK_NONBLOCK | SOCK_CLOEXEC);

		/* One that may not come in is held: closed at once, it would come again at once. */
		if (fd >= 0 && !door->take(door->context, fd, (struct sockaddr *)&peer, size)) {
			if (door->count == HELD_MAX)
				close_oldest(door);
			door->held[(door->oldest + door->count) % HELD_MAX] =
				(struct held){ fd, db_client_now() };
			door->count++;
		}
		if (fd >= 0 || errno == ECONNABORTED || errno == EINTR)
			continue;
		/* It would make events without end; the next tick tries again. */
		if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM)
			(void)sd_event_source_set_enabled(source, SD_EVENT_OFF);
		break;
	}
	return 0;
}

static int open_port(const struct db_web_config *config)
{
	struct sockaddr_storage endpoint;
	struct db_web_address address;
	char text[DB_WEB_ADDRESS_TEXT];
	socklen_t size = 0;
	int unsent = UNSENT_MAX;
	int on = 1;
	int fd;

	(void)db_web_endpoint_parse(config->listen, &endpoint, &size);
	fd = socket(endpoint.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0 ||
	    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &unsent, sizeof(unsent)) != 0 ||
	    bind(fd, (struct sockaddr *)&endpoint, size) != 0 || listen(fd, BACKLOG) != 0) {
		db_client_log(DB_CLIENT_ERROR, "cannot listen on %s: %s", config->listen,
		              strerror(errno));
		if (fd >= 0)
			(void)close(fd);
		return -1;
	}
	size = sizeof(endpoint);
	(void)getsockname(fd, (struct sockaddr *)&endpoint, &size);
	(void)db_web_address_of((struct sockaddr *)&endpoint, &address);
	db_web_address_write(&address, text);
	db_client_log(DB_CLIENT_NOTICE, "drivebridge-webd " DB_VERSION " at %s://%s%s%s:%u/",
	              config->tls ? "https" : "http", endpoint.ss_family == AF_INET6 ? "[" : "",
	              text, endpoint.ss_family == AF_INET6 ? "]" : "",
	              ntohs(endpoint.ss_family == AF_INET6 ?
	                            ((struct sockaddr_in6 *)&endpoint)->sin6_port :
	                            ((struct sockaddr_in *)&endpoint)->sin_port));
	return fd;
}

struct db_web_door *db_web_door_new(sd_event *loop, const struct db_web_config *config,
                                    db_web_door_fn *take, void *context)
{
	struct db_web_door *door = calloc(1, sizeof(*door));

	if (!door) {
		db_client_log(DB_CLIENT_ERROR, "out of memory");
		return NULL;
	}
	door->take = take;
	door->context = context;
	door->fd = open_port(config);
	if (door->fd < 0 ||
	    sd_event_add_io(loop, &door->ready, door->fd, EPOLLIN, on_connection, door) < 0) {
		db_web_door_free(door);
		return NULL;
	}
	return door;
}

void db_web_door_tick(struct db_web_door *door, db_time now)
{
	while (door->count > 0 && now - door->held[door->oldest].since >= HELD_TIME)
		close_oldest(door);
	(void)sd_event_source_set_enabled(door->ready, SD_EVENT_ON);
}

void db_web_door_free(struct db_web_door *door)
{
	if (!door)
		return;
	sd_event_source_disable_unref(door->ready);
	while (door->count > 0)
		close_oldest(door);
	if (door->fd >= 0)
		(void)close(door->fd);
	free(door);
}
