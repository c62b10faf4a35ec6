/* SPDX-License-Identifier: Apache-2.0 */
#include "server/connection.h"

#include "server/acl.h"
#include "server/listener.h"

#include <errno.h>
#include <linux/sockios.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

/* A request whose answer has to wait: the request itself, or one before it, is an unfinished
 * write. */
struct db_connection_entry {
	/* data is invalid: a write has been handed over already */
	struct db_modbus_request request;
	bool unfinished;   /* the backend owes an answer */
	uint8_t exception; /* of a finished write, or of a request that was refused */
};

/* Events to wait for while requests are read. */
#define READING (EPOLLIN | EPOLLRDHUP)

/* What happened to the next request in the buffer. */
enum taken { TAKEN, NOTHING_TO_TAKE, MUST_WAIT, BROKEN };

void db_connection_count_refusal(struct db_connection_shared *shared, struct db_peer *peer,
                                 enum db_refusal kind, db_time now)
{
	uint32_t *const counters[DB_REFUSAL_COUNT] = {
		[DB_REFUSED_ADDRESS] = &shared->stats.refused_address,
		[DB_REFUSED_FULL] = &shared->stats.refused_full,
		[DB_REFUSED_RESERVED] = &shared->stats.refused_reserved,
		[DB_REFUSED_PER_ADDRESS] = &shared->stats.refused_per_address,
		[DB_REFUSED_WRITE] = &shared->stats.refused_writes,
		[DB_REFUSED_USER] = &shared->stats.refused_writes,
		[DB_REFUSED_USER_READ] = &shared->stats.refused_address,
		[DB_REFUSED_CONTROL] = &shared->stats.refused_control,
		[DB_REFUSED_DESCRIPTORS] = &shared->stats.refused_full,
		[DB_REFUSED_INSECURE] = &shared->stats.refused_address,
		[DB_REFUSED_NO_ROLE] = &shared->stats.refused_writes,
		[DB_REFUSED_ROLE] = &shared->stats.refused_writes,
		[DB_REFUSED_LINE] = &shared->stats.refused_writes,
		[DB_REFUSED_BROADCAST] = &shared->stats.refused_writes,
		[DB_REFUSED_PACE] = &shared->stats.held_back,
	};

	(*counters[kind])++;
	db_peers_refused(shared->peers, peer, kind, now);
}

/* Bytes in the socket. */
static size_t count_unread(const struct db_connection *c)
{
	int count = 0;

	return ioctl(c->fd, SIOCINQ, &count) == 0 && count > 0 ? (size_t)count : 0;
}

/* Everything in the socket has arrived by now. */
static void mark_arrived(struct db_connection *c, db_time now)
{
	c->marked = count_unread(c);
	c->mark_time = now;
}

struct db_connection *db_connection_new(struct db_connection_shared *shared, int fd,
                                        const struct db_client *client, const char *role,
                                        struct db_peer *peer, db_time now)
{
	struct db_connection *c = calloc(1, sizeof(*c));
	struct epoll_event event = { .events = READING, .data.ptr = c };

	if (c && role)
		c->role = strdup(role);
	if (!c || (role && !c->role) || epoll_ctl(shared->epoll, EPOLL_CTL_ADD, fd, &event) < 0) {
		if (c)
			free(c->role);
		free(c);
		close(fd);
		return NULL;
	}
	c->shared = shared;
	c->client = *client;
	c->peer = peer;
	c->peer->connections++;
	c->fd = fd;
	c->events = READING;
	c->since = now;
	c->active_since = now;
	if (client->arrived == 0) {
		c->client.arrived = now;
	} else {
		mark_arrived(c, now);
		c->behind = c->marked > 0;
	}
	return c;
}

void db_connection_free(struct db_connection *c)
{
	if (!c)
		return;
	c->peer->connections--;
	close(c->fd);
	free(c->queue);
	free(c->out);
	free(c->role);
	free(c);
}

/* Output. */

/* Sends bytes; returns how many the socket took, or -1 when the connection is broken. */
static ssize_t send_bytes(struct db_connection *c, const uint8_t *bytes, size_t length)
{
	ssize_t sent;

	do
		sent = send(c->fd, bytes, length, MSG_NOSIGNAL | MSG_DONTWAIT);
	while (sent < 0 && errno == EINTR);
	if (sent < 0)
		return errno == EAGAIN || errno == EWOULDBLOCK ? 0 : -1;
	return sent;
}

/* Sends the batch, and keeps what the socket does not take. */
static bool flush_batch(struct db_connection *c, db_time now)
{
	struct db_connection_shared *shared = c->shared;
	size_t length = shared->batch_used;
	ssize_t sent;

	shared->batch_used = 0;
	if (length == 0)
		return true;
	sent = send_bytes(c, shared->batch, length);
	if (sent < 0)
		return false;
	if (sent > 0)
		c->active_since = now;
	if ((size_t)sent == length)
		return true;
	c->out_used = length - (size_t)sent;
	c->out_sent = 0;
	c->out = malloc(c->out_used);
	if (!c->out)
		return false;
	memcpy(c->out, shared->batch + sent, c->out_used);
	return true;
}

/* Requests. */

/* Adds the answer to a finished request to the batch, which has room for it. */
static void add_answer(struct db_connection *c, const struct db_modbus_request *request,
                       uint8_t exception)
{
	struct db_connection_shared *shared = c->shared;
	uint8_t *adu = shared->batch + shared->batch_used;

	if (exception)
		shared->batch_used += db_pdu_exception(request, exception, adu);
	else if (request->function == DB_FC_DIAGNOSTICS)
		shared->batch_used += db_pdu_diagnostic(request, &c->diagnostics, adu);
	else
		shared->batch_used += db_execute_answer(&shared->executor, &c->client, request, adu,
		                                        &exception);
	db_diagnostics_count_answer(&c->diagnostics, exception);
	if (exception > 0 && exception < DB_EXCEPTION_CODES) {
		shared->stats.exceptions++;
		shared->stats.exceptions_by_code[exception]++;
	}
}

static struct db_connection_entry *entry_at(const struct db_connection *c, unsigned index)
{
	return &c->queue[(c->first + index) % c->room];
}

static bool ensure_queue(struct db_connection *c)
{
	if (c->queue)
		return true;
	c->first = 0;
	c->room = c->shared->config->max_pipelined;
	c->queue = malloc(c->room * sizeof(*c->queue));
	return c->queue;
}

/*
 * FC 22 computes from the register's value, which a write in flight may be about to change. It has
 * to wait for that write, and later requests wait too, so that writes keep their order. FC 8 waits
 * for everything before it: the queue keeps no data to echo.
 */
static bool depends_on_unfinished(const struct db_connection *c,
                                  const struct db_modbus_request *request)
{
	const struct db_modbus_request *other;

	if (request->function == DB_FC_DIAGNOSTICS)
		return c->queued > 0;
	if (request->function != MODBUS_FC_MASK_WRITE_REGISTER)
		return false;
	for (unsigned i = 0; i < c->queued; i++) {
		other = &entry_at(c, i)->request;
		if (entry_at(c, i)->unfinished && other->unit == request->unit &&
		    request->write_address >= other->write_address &&
		    request->write_address - other->write_address < other->write_count)
			return true;
	}
	return false;
}

/* Refuses or dispatches a request: 0, an exception, or DB_WRITE_LATER. */
static int start_request(struct db_connection *c, const struct db_modbus_request *request,
                         db_time now)
{
	struct db_connection_shared *shared = c->shared;
	const struct db_executor *executor = &shared->executor;
	struct db_write_token token = { c->client.id, c->sequence + c->queued };
	uint8_t exception = executor->backend->unit(executor->context, &c->client, request->unit);
	enum db_refusal refusal = DB_REFUSED_INSECURE;
	uint32_t user;

	if (!exception && c->client.role)
		exception = executor->backend->role(executor->context, &c->client, request->unit);
	if (exception || request->write_count == 0)
		return exception;
	if (!c->client.may_write) {
		/* Why it may not. */
		if (db_acl_access(shared->config, c->client.endpoint, c->peer->address) !=
		    DB_ACCESS_WRITE)
			refusal = DB_REFUSED_WRITE;
		else if (c->role)
			refusal = DB_REFUSED_ROLE;
		else if (db_client_user_of_address(c->client.address, &user))
			refusal = DB_REFUSED_USER;
		db_connection_count_refusal(c->shared, c->peer, refusal, now);
		if (executor->backend->denied)
			executor->backend->denied(executor->context, &c->client, request->unit,
			                          request->write_address);
		return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	}
	/* First make sure that the result can be stored. */
	if (!ensure_queue(c))
		return MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY;
	return db_execute_write(executor, &c->client, request, token);
}

/*
 * True if the next request may be taken now: its address does not exceed its rate. Otherwise the
 * request waits here, and later ones wait in the kernel and then at the client.
 */
static bool take_turn(struct db_connection *c, db_time now)
{
	unsigned per_second = c->shared->config->max_requests_per_second;

	if (per_second == 0)
		return true;
	if (c->turn == 0) {
		c->turn = db_rate_take(&c->peer->rate, per_second, now);
		if (c->turn > now)
			db_connection_count_refusal(c->shared, c->peer, DB_REFUSED_PACE, now);
	}
	if (c->turn > now)
		return false;
	c->turn = 0;
	/* The time in which we did not read does not count for the client. */
	c->active_since = now;
	return true;
}

/* Takes the request at `*offset` of the input buffer. */
static enum taken take_request(struct db_connection *c, size_t *offset, db_time now)
{
	struct db_connection_entry *entry;
	struct db_modbus_request request;
	const uint8_t *adu = c->in + *offset;
	int length = db_pdu_cut(adu, c->in_used - *offset);
	int result;

	if (length < 0) {
		c->shared->stats.bad_frames++;
		return BROKEN;
	}
	if (length == 0)
		return NOTHING_TO_TAKE;
	if (c->queue && (c->queued == c->room || c->queued >= c->shared->config->max_pipelined))
		return MUST_WAIT;
	result = db_pdu_parse(adu, (size_t)length, &request);
	if (c->barred)
		result = MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	if (result == 0 && depends_on_unfinished(c, &request))
		return MUST_WAIT;
	if (!take_turn(c, now))
		return MUST_WAIT;
	if (c->barred)
		db_connection_count_refusal(c->shared, c->peer, DB_REFUSED_NO_ROLE, now);
	*offset += (size_t)length;
	c->shared->stats.requests++;
	c->requests++;
	db_diagnostics_add(&c->diagnostics, DB_DIAGNOSTIC_BUS_MESSAGES, 1);
	db_diagnostics_add(&c->diagnostics, DB_DIAGNOSTIC_MESSAGES, 1);
	if (result == 0)
		result = start_request(c, &request, now);
	if (result != DB_WRITE_LATER && c->queued == 0) {
		add_answer(c, &request, (uint8_t)result);
		c->sequence++;
		free(c->queue);
		c->queue = NULL;
		return TAKEN;
	}
	/* It is answered after the unfinished ones. */
	if (!ensure_queue(c))
		return BROKEN;
	entry = entry_at(c, c->queued++);
	entry->request = request;
	entry->request.data = NULL;
	entry->unfinished = result == DB_WRITE_LATER;
	entry->exception = entry->unfinished ? 0 : (uint8_t)result;
	c->unfinished += entry->unfinished;
	return TAKEN;
}

/* Answers and takes requests until there is nothing more to do or the socket is full. */
static bool handle_requests(struct db_connection *c, size_t *offset, db_time now)
{
	enum taken taken = TAKEN;

	while (!c->out && taken == TAKEN) {
		if (c->shared->batch_used + DB_ADU_MAX > DB_BATCH_SIZE) {
			if (!flush_batch(c, now))
				return false;
			continue;
		}
		/* Answers the first request in the queue, if its turn has come. */
		if (c->queued > 0 && !entry_at(c, 0)->unfinished) {
			struct db_connection_entry *entry = entry_at(c, 0);

			add_answer(c, &entry->request, entry->exception);
			c->first = (c->first + 1) % c->room;
			c->sequence++;
			if (--c->queued == 0) {
				free(c->queue);
				c->queue = NULL;
			}
			continue;
		}
		taken = take_request(c, offset, now);
	}
	c->waiting = taken == MUST_WAIT;
	if (taken == BROKEN) {
		/* Requests before the broken frame are still answered. */
		flush_batch(c, now);
		return false;
	}
	return c->out || flush_batch(c, now);
}

/* --- when requests arrived -------------------------------------------------------------------- */

/*
 * Bytes were read. As a rule they were read when they arrived. After a time in which nothing was
 * read, or while more arrives than is read, the socket has older ones: for those only the marks
 * before and after their arrival are known. The earlier mark counts, because a request that waited
 * is no sign of life.
 */
static void note_arrival(struct db_connection *c, size_t got, bool all, db_time now)
{
	if (!c->behind) {
		/* A client that has closed its side since may have sent this long ago. */
		if (!c->closing)
			c->client.arrived = now;
		if (all)
			return;
	} else if (c->marked > 0) {
		c->marked -= got < c->marked ? got : c->marked;
		return;
	} else {
		c->client.arrived = c->mark_time;
	}
	mark_arrived(c, now);
	c->behind = c->marked > 0;
}

/* Tells epoll what this connection waits for now. */
static bool update_events(struct db_connection *c, db_time now)
{
	struct epoll_event event = { .data.ptr = c };

	if (!c->ended && !c->waiting && !c->out)
		event.events |= READING;
	if (c->out)
		event.events |= EPOLLOUT;
	if (event.events == c->events)
		return true;
	if ((event.events ^ c->events) & EPOLLIN) {
		bool reading = event.events & EPOLLIN;

		/* Reading stops for a while, or continues. */
		if (!reading && !c->behind) {
			mark_arrived(c, now);
			c->behind = true;
		} else if (reading && c->behind && c->marked == 0) {
			c->behind = count_unread(c) > 0;
		}
	}
	c->events = event.events;
	return epoll_ctl(c->shared->epoll, EPOLL_CTL_MOD, c->fd, &event) == 0;
}

bool db_connection_advance(struct db_connection *c, db_time now)
{
	bool held = c->waiting || c->out;
	size_t offset = 0;
	ssize_t sent;

	/* Sends the bytes that were kept. */
	if (c->out) {
		sent = send_bytes(c, c->out + c->out_sent, c->out_used - c->out_sent);
		if (sent < 0)
			return false;
		if (sent > 0)
			c->active_since = now;
		c->out_sent += (size_t)sent;
		if (c->out_sent == c->out_used) {
			free(c->out);
			c->out = NULL;
		}
	}
	if (!c->out && !handle_requests(c, &offset, now))
		return false;
	if (offset > 0) {
		c->in_used = (uint16_t)(c->in_used - offset);
		memmove(c->in, c->in + offset, c->in_used);
	}
	/* The time in which we did not read does not count for the client. */
	if (offset > 0 || held)
		c->frame_since = now;
	if (c->ended && c->queued == 0 && !c->out && !c->waiting)
		return false;
	return update_events(c, now);
}

bool db_connection_ready(struct db_connection *c, uint32_t events, db_time now)
{
	/* A Unix socket hangs up while there is still something to read, as TCP does not. */
	if ((events & EPOLLERR) || ((events & EPOLLHUP) && (c->ended || !(events & EPOLLIN))))
		return false;
	c->closing = events & EPOLLRDHUP;
	if (events & EPOLLIN) {
		size_t room = sizeof(c->in) - c->in_used;
		ssize_t got = recv(c->fd, c->in + c->in_used, room, MSG_DONTWAIT);

		if (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)
			return false;
		/* Half closed: requests in progress are still answered, then we close too. */
		if (got == 0)
			c->ended = true;
		if (got > 0) {
			if (c->in_used == 0)
				c->frame_since = now;
			note_arrival(c, (size_t)got, (size_t)got < room, now);
			c->in_used = (uint16_t)(c->in_used + got);
			c->active_since = now;
		}
	}
	return db_connection_advance(c, now);
}

db_time db_connection_time_limit(const struct db_connection *c)
{
	const struct db_modbus_config *config = c->shared->config;
	db_time limit = DB_TIME_NEVER, idle;

	if (c->in_used > 0 && !c->waiting && !c->out && !c->ended)
		limit = c->frame_since + config->frame_timeout_ms * DB_NS_PER_MS;
	if (config->idle_timeout_s > 0 && c->unfinished == 0 && (c->turn == 0 || c->out)) {
		idle = c->active_since + config->idle_timeout_s * DB_NS_PER_S;
		if (idle < limit)
			limit = idle;
	}
	return limit;
}

db_time db_connection_deadline(const struct db_connection *c)
{
	db_time limit = db_connection_time_limit(c);

	return c->turn != 0 && !c->out && c->turn < limit ? c->turn : limit;
}

bool db_connection_answer(struct db_connection *c, uint32_t sequence, uint8_t exception)
{
	uint32_t index = sequence - c->sequence;
	struct db_connection_entry *entry;

	if (index >= c->queued)
		return false;
	entry = entry_at(c, index);
	if (!entry->unfinished)
		return false;
	entry->unfinished = false;
	entry->exception = exception;
	c->unfinished--;
	return index == 0 || c->waiting;
}
