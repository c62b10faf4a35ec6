/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_private.h"

#include "sim/commands.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#define LINE_MAX_BYTES 512

struct client {
	int fd; /* -1: free */
	size_t length;
	char line[LINE_MAX_BYTES];
};

struct sim_control {
	struct sim_world *world;
	int poll;
	int listener;
	struct sockaddr_un address;
	struct client clients[SIM_CONTROL_CLIENTS];
};

/* data.ptr is null for the listener, else the client. */
static int watch_client(struct sim_control *control, int fd, struct client *client)
{
	struct epoll_event event = { .events = EPOLLIN, .data.ptr = client };

	return epoll_ctl(control->poll, EPOLL_CTL_ADD, fd, &event) != 0 ? -errno : 0;
}

int sim_control_open(const char *path, struct sim_world *world, struct sim_control **control)
{
	struct sim_control *made;
	struct stat status;
	int result = 0;

	if (strlen(path) >= sizeof(made->address.sun_path))
		return -ENAMETOOLONG;
	made = calloc(1, sizeof(*made));
	if (!made)
		return -ENOMEM;
	made->world = world;
	made->poll = made->listener = -1;
	made->address.sun_family = AF_UNIX;
	for (size_t i = 0; i < SIM_CONTROL_CLIENTS; i++)
		made->clients[i].fd = -1;
	strcpy(made->address.sun_path, path);
	if (stat(path, &status) == 0 && S_ISSOCK(status.st_mode))
		(void)unlink(path);
	made->poll = epoll_create1(EPOLL_CLOEXEC);
	made->listener = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	if (made->poll < 0 || made->listener < 0 ||
	    bind(made->listener, (const struct sockaddr *)&made->address, sizeof(made->address)) !=
	            0 ||
	    listen(made->listener, SIM_CONTROL_CLIENTS) != 0) {
		/* An existing file there is not ours to remove. */
		made->address.sun_path[0] = '\0';
		result = -errno;
	}
	if (result == 0)
		result = watch_client(made, made->listener, NULL);
	if (result != 0) {
		sim_control_close(made);
		return result;
	}
	*control = made;
	return made->poll;
}

static void drop_client(struct client *client)
{
	(void)close(client->fd);
	client->fd = -1;
	client->length = 0;
}

void sim_control_close(struct sim_control *control)
{
	if (!control)
		return;
	for (size_t i = 0; i < SIM_CONTROL_CLIENTS; i++) {
		if (control->clients[i].fd >= 0)
			drop_client(&control->clients[i]);
	}
	if (control->listener >= 0) {
		(void)close(control->listener);
		if (control->address.sun_path[0] != '\0')
			(void)unlink(control->address.sun_path);
	}
	if (control->poll >= 0)
		(void)close(control->poll);
	free(control);
}

static void serve_client(struct sim_control *control, struct client *client, db_time now)
{
	ssize_t count = recv(client->fd, client->line + client->length,
	                     sizeof(client->line) - client->length, 0);
	char *end;

	if (count < 0 && (errno == EAGAIN || errno == EINTR))
		return;
	if (count <= 0) {
		drop_client(client);
		return;
	}
	client->length += (size_t)count;
	while ((end = memchr(client->line, '\n', client->length)) != NULL) {
		size_t used = (size_t)(end - client->line) + 1;
		char *text = NULL;
		size_t length = 0;
		FILE *out = open_memstream(&text, &length);
		bool sent = false;

		*end = '\0';
		if (out) {
			sim_command(control->world, client->line, now, out);
			sent = fclose(out) == 0 &&
			       send(client->fd, text, length, MSG_NOSIGNAL) == (ssize_t)length;
		}
		free(text);
		/* A client that does not read its answer is disconnected rather than waited for. */
		if (!sent) {
			drop_client(client);
			return;
		}
		client->length -= used;
		memmove(client->line, client->line + used, client->length);
	}
	if (client->length == sizeof(client->line))
		drop_client(client);
}

void sim_control_run(struct sim_control *control, db_time now)
{
	struct epoll_event events[SIM_CONTROL_CLIENTS];
	int count = epoll_wait(control->poll, events, SIM_CONTROL_CLIENTS, 0);

	for (int i = 0; i < count; i++) {
		size_t place = 0;
		int fd;

		if (events[i].data.ptr) {
			serve_client(control, events[i].data.ptr, now);
			continue;
		}
		fd = accept4(control->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
		while (place < SIM_CONTROL_CLIENTS && control->clients[place].fd >= 0)
			place++;
		if (fd >= 0 && place < SIM_CONTROL_CLIENTS &&
		    watch_client(control, fd, &control->clients[place]) == 0)
			control->clients[place].fd = fd;
		else if (fd >= 0)
			(void)close(fd);
	}
}
