/* SPDX-License-Identifier: Apache-2.0 */
#include "client/client.h"
#include "client/clock.h"
#include "client/frames.h"

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/* The longest message, the metrics of 500 drives, has less than a megabyte. */
#define MESSAGE_MAX ((size_t)16 * 1024 * 1024)

/* The answer to the first call when the service has too many sessions; it then closes the
 * connection. */
#define BUSY DB_CLIENT_SERVICE "Busy"

struct call {
	db_client_answer_fn *answer;
	void *data;
	struct call *next;
};

struct db_client {
	int fd;
	struct db_frames frames;
	char *out; /* bytes not sent yet */
	size_t out_size;
	struct call *first; /* in the order in which they are answered */
	struct call **last;
	unsigned waiting;
	bool heard;                  /* an answer was received */
	bool refused;                /* that answer was Busy, and no other followed */
	struct db_client_error lost; /* why the connection was lost; no name: it is not lost */
};

static void explain_failure(struct db_client_error *error, const char *path, int cause)
{
	switch (cause) {
	case ENOENT:
		db_client_error_set(
			error, DB_CLIENT_UNREACHABLE,
			"there is no %s; is the service running? systemctl status drivebridge",
			path);
		break;
	case ECONNREFUSED:
		db_client_error_set(error, DB_CLIENT_UNREACHABLE,
		                    "nobody listens on %s; is the service running? systemctl "
		                    "status drivebridge",
		                    path);
		break;
	case EACCES:
		db_client_error_set(error, DB_CLIENT_UNREACHABLE,
		                    "no right to use %s: become a member of the group drivebridge "
		                    "(adduser USER drivebridge, then log in again), or be root",
		                    path);
		break;
	default:
		db_client_error_set(error, DB_CLIENT_UNREACHABLE, "%s: %s", path, strerror(cause));
	}
}

int db_client_open(const char *path, struct db_client **client, struct db_client_error *error)
{
	struct sockaddr_un address = { .sun_family = AF_UNIX };
	struct db_client *opened;

	*client = NULL;
	if (strlen(path) >= sizeof(address.sun_path)) {
		explain_failure(error, path, ENAMETOOLONG);
		return -1;
	}
	memcpy(address.sun_path, path, strlen(path));
	opened = calloc(1, sizeof(*opened));
	if (opened) {
		opened->last = &opened->first;
		opened->frames.limit = MESSAGE_MAX;
		opened->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
	} else {
		db_client_error_set(error, DB_CLIENT_NO_MEMORY, "no memory");
		return -1;
	}
	if (opened->fd < 0 ||
	    connect(opened->fd, (struct sockaddr *)&address, sizeof(address)) != 0) {
		/* The socket's backlog is full. */
		if (errno == EAGAIN)
			db_client_error_set(error, DB_CLIENT_SERVICE "Busy",
			                    "the service has too much to do at once; try again");
		else
			explain_failure(error, path, errno);
		db_client_close(opened);
		return -1;
	}
	*client = opened;
	return 0;
}

void db_client_close(struct db_client *client)
{
	if (!client)
		return;
	while (client->first) {
		struct call *call = client->first;

		client->first = call->next;
		free(call);
	}
	if (client->fd >= 0)
		(void)close(client->fd);
	free(client->frames.bytes);
	db_client_error_clear(&client->lost);
	free(client->out);
	free(client);
}

struct pollfd db_client_poll_fd(const struct db_client *client)
{
	return (struct pollfd){ .fd = client->fd,
		                .events = client->out_size > 0 ? POLLIN | POLLOUT : POLLIN };
}

unsigned db_client_waiting(const struct db_client *client)
{
	return client->waiting;
}

static void free_first_call(struct db_client *client)
{
	struct call *call = client->first;

	client->first = call->next;
	if (!client->first)
		client->last = &client->first;
	client->waiting--;
	free(call);
}

/* Ends every waiting call with this error. */
static void give_up(struct db_client *client, const char *name, const char *text)
{
	if (client->lost.name[0] != '\0')
		return;
	db_client_error_set(&client->lost, name, "%s", text);
	(void)shutdown(client->fd, SHUT_RDWR);
	while (client->first) {
		struct call call = *client->first;

		free_first_call(client);
		if (call.answer)
			call.answer(call.data, NULL, &client->lost, false);
	}
}

static void send_rest(struct db_client *client)
{
	ssize_t sent;

	while (client->out_size > 0) {
		sent = send(client->fd, client->out, client->out_size, MSG_NOSIGNAL);
		if (sent < 0 && errno == EINTR)
			continue;
		if (sent < 0 && errno == EAGAIN)
			return;
		if (sent < 0) {
			/* Answers that the service sent before it closed are read first. */
			client->out_size = 0;
			return;
		}
		client->out_size -= (size_t)sent;
		memmove(client->out, client->out + sent, client->out_size);
	}
}

/* Queues a call for sending. Takes `parameters` over. 0 or -1. */
static int put_call(struct db_client *client, const char *method, json_t *parameters,
                    const char *flag)
{
	size_t size = 0;
	char *whole = NULL;
	char *grown = NULL;
	char *text;

	if (asprintf(&whole, "%s%s", strchr(method, '.') ? "" : DB_CLIENT_SERVICE, method) < 0)
		whole = NULL;
	text = whole ? db_frames_write_call(whole, parameters, flag, &size) : NULL;
	free(whole);
	json_decref(parameters);
	if (text && client->lost.name[0] == '\0')
		grown = realloc(client->out, client->out_size + size);
	if (grown) {
		memcpy(grown + client->out_size, text, size);
		client->out = grown;
		client->out_size += size;
	}
	free(text);
	return grown ? 0 : -1;
}

int db_client_tell(struct db_client *client, const char *method, json_t *parameters)
{
	if (put_call(client, method, parameters, "oneway") != 0)
		return -1;
	send_rest(client);
	return 0;
}

int db_client_send(struct db_client *client, const char *method, json_t *parameters, bool more,
                   db_client_answer_fn *answer, void *data)
{
	struct call *call = calloc(1, sizeof(*call));

	if (!call) {
		json_decref(parameters);
		return -1;
	}
	if (put_call(client, method, parameters, more ? "more" : NULL) != 0) {
		free(call);
		return -1;
	}
	call->answer = answer;
	call->data = data;
	*client->last = call;
	client->last = &call->next;
	client->waiting++;
	send_rest(client);
	return 0;
}

/* False when no call waits for this message. */
static bool hand_over(struct db_client *client, json_t *message)
{
	const json_t *name = json_object_get(message, "error");
	json_t *parameters = json_object_get(message, "parameters");
	bool more = json_is_true(json_object_get(message, "continues"));
	struct db_client_error error = { .parameters = NULL };
	struct call call;

	if (!client->first || (name && !json_is_string(name)) ||
	    (parameters && !json_is_object(parameters) && !json_is_null(parameters)))
		return false;
	parameters = json_is_object(parameters) ? json_incref(parameters) : json_object();
	call = *client->first;
	if (name)
		db_client_error_read(&error, json_string_value(name), parameters);
	if (name || !more)
		free_first_call(client);
	client->refused = !client->heard && name && strcmp(error.name, BUSY) == 0;
	client->heard = true;
	if (call.answer)
		call.answer(call.data, name ? NULL : parameters, name ? &error : NULL,
		            !name && more);
	db_client_error_clear(&error);
	json_decref(parameters);
	return true;
}

/* All messages that have arrived completely. */
static void hand_over_all(struct db_client *client)
{
	json_t *message = NULL;
	int taken;

	while (client->lost.name[0] == '\0' &&
	       (taken = db_frames_take(&client->frames, &message)) != 0) {
		if (taken < 0 || !hand_over(client, message))
			give_up(client, DB_CLIENT_BAD_ANSWER,
			        taken == -EMSGSIZE ?
			                "the answer is too long" :
			                "what answers there does not speak as drivebridged does");
		json_decref(message);
		message = NULL;
	}
}

int db_client_handle(struct db_client *client)
{
	char bytes[16384];
	ssize_t count;

	if (client->lost.name[0] == '\0')
		send_rest(client);
	/* A stream without pauses must not keep its owner from other work. */
	for (unsigned turn = 0; turn < 64 && client->lost.name[0] == '\0'; turn++) {
		count = recv(client->fd, bytes, sizeof(bytes), 0);
		if (count < 0 && errno == EINTR)
			continue;
		if (count < 0 && errno == EAGAIN)
			break;
		if (count <= 0 && client->refused)
			give_up(client, BUSY, "the service has no room for one more session");
		else if (count <= 0)
			give_up(client, DB_CLIENT_LOST, "the service has closed the connection");
		else if (db_frames_add(&client->frames, bytes, (size_t)count) != 0)
			give_up(client, DB_CLIENT_NO_MEMORY, "no memory");
		else
			hand_over_all(client);
	}
	return client->lost.name[0] == '\0' ? 0 : -1;
}

/* --- waiting ---------------------------------------------------------------------------------- */

struct waiter {
	bool done;
	json_t *parameters;
	struct db_client_error *error;
};

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct waiter *waiter = data;

	(void)more;
	if (waiter->done)
		return;
	waiter->done = true;
	waiter->parameters = json_incref(parameters);
	if (!error)
		return;
	db_client_error_clear(waiter->error);
	*waiter->error = *error;
	json_incref(waiter->error->parameters);
}

int db_client_call(struct db_client *client, const char *method, json_t *parameters, int timeout_ms,
                   json_t **answer, struct db_client_error *error)
{
	struct waiter waiter = { .error = error };
	db_time deadline = db_client_now() + timeout_ms * DB_NS_PER_MS;

	*answer = NULL;
	if (db_client_send(client, method, parameters, false, on_answer, &waiter) != 0) {
		if (client->lost.name[0] != '\0')
			db_client_error_set(error, client->lost.name, "%s", client->lost.text);
		else
			db_client_error_set(error, DB_CLIENT_NO_MEMORY, "no memory");
		return -1;
	}
	while (!waiter.done) {
		struct pollfd poll_fd = db_client_poll_fd(client);
		db_time left = deadline - db_client_now();

		if (left <= 0) {
			/* Its answer is dropped when it arrives. gcc's analyzer does not see that
			 * the list, through client->last, has what was sent. */
			for (struct call *call = client->first; call; call = call->next) {
				if (call->data == &waiter)
					call->answer = NULL;
			}
			db_client_error_set(error, DB_CLIENT_TIMEOUT,
			                    "the service does not answer within %d ms", timeout_ms);
			return -1;
		}
		(void)poll(&poll_fd, 1, (int)((left + DB_NS_PER_MS - 1) / DB_NS_PER_MS));
		(void)db_client_handle(client);
	}
	*answer = waiter.parameters;
	return waiter.parameters ? 0 : -1;
}
