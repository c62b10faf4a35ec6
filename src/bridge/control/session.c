/* SPDX-License-Identifier: Apache-2.0 */
#include "control/session.h"

#include "control/control_private.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#define INTERFACE "io.drivebridge.Control."
#define NOT_ALLOWED INTERFACE "NotAllowed"

struct db_session *db_session_new(struct db_control_socket *control, int fd,
                                  const struct db_client *client, db_time now)
{
	struct db_session *session = calloc(1, sizeof(*session));
	struct epoll_event event = { .events = EPOLLIN | EPOLLRDHUP, .data.ptr = session };

	if (!session || epoll_ctl(control->epoll, EPOLL_CTL_ADD, fd, &event) != 0) {
		free(session);
		close(fd);
		return NULL;
	}
	session->control = control;
	session->client = *client;
	session->fd = fd;
	session->events = event.events;
	session->in_arrived = now;
	session->due = DB_TIME_NEVER;
	return session;
}

void db_session_free(struct db_session *session)
{
	if (!session)
		return;
	db_actors_let_go(&session->control->actors, session->actor);
	close(session->fd);
	free(session->in);
	free(session->out);
	free(session->job);
	free(session);
}

void db_session_set_actor(struct db_session *session, uint32_t user, const char *process_user,
                          const char *named)
{
	struct db_actors *actors = &session->control->actors;
	uint32_t before = session->actor;
	struct db_client_session shown = { .user = user, .named = named[0] != '\0' };

	shown.actor = db_actors_hold(actors, user, process_user, named);
	session->actor = shown.actor;
	db_actors_let_go(actors, before);
	db_client_address_of_session(&shown, session->client.address);
}

void db_session_text(const struct db_session *session, char text[DB_CLIENT_TEXT_MAX])
{
	struct db_client_words words;

	db_actors_words(&session->control->actors, session->client.address, &words);
	db_client_words_join(&words, text);
}

/* --- input ------------------------------------------------------------------------------------ */

bool db_session_receive(struct db_session *session, db_time now)
{
	size_t room = DB_MESSAGE_MAX + 1 - session->in_used;
	ssize_t got;

	if (session->ended || room == 0)
		return true;
	if (!session->in)
		session->in = malloc(DB_MESSAGE_MAX + 1);
	if (!session->in)
		return false;
	do
		got = recv(session->fd, session->in + session->in_used, room, MSG_DONTWAIT);
	while (got < 0 && errno == EINTR);
	if (got > 0) {
		if (session->in_used == 0)
			session->in_arrived = session->behind_since != 0 ? session->behind_since :
			                                                   now;
		session->in_used += (size_t)got;
	}
	/* Fewer bytes than there was room for: nothing waits now. */
	session->behind_since = got == (ssize_t)room ? now : 0;
	if (got == 0)
		session->ended = true;
	if (session->in_used == 0) {
		free(session->in);
		session->in = NULL;
	}
	return got >= 0 || errno == EAGAIN || errno == EWOULDBLOCK;
}

bool db_session_has_whole(const struct db_session *session, size_t *length)
{
	const char *end = session->in_used > 0 ? memchr(session->in, '\0', session->in_used) : NULL;

	if (end)
		*length = (size_t)(end - session->in);
	return end;
}

bool db_session_has_message(const struct db_session *session, size_t *length)
{
	return session->wait == DB_WAITS_FOR_NOTHING && !session->out && !session->broken &&
	       db_session_has_whole(session, length);
}

db_time db_session_owes_until(struct db_session *session, db_time now)
{
	size_t length;
	bool whole = db_session_has_whole(session, &length);
	bool idle = session->wait == DB_WAITS_FOR_NOTHING && !session->out;

	if (whole || !(session->in_used > 0 || (session->stops_only && idle)))
		session->owes_since = 0;
	else if (session->owes_since == 0)
		session->owes_since = now;
	if (session->owes_since == 0)
		return DB_TIME_NEVER;
	return session->owes_since + (session->stops_only ? DB_SESSION_STOPLESS : DB_SESSION_HALF);
}

void db_session_drop_message(struct db_session *session, size_t length)
{
	session->next = DB_NEXT_UNKNOWN;
	session->in_used -= length + 1;
	memmove(session->in, session->in + length + 1, session->in_used);
	if (session->in_used > 0)
		return;
	free(session->in);
	session->in = NULL;
}

bool db_session_is_over(const struct db_session *session)
{
	size_t length;

	if (session->broken)
		return !session->out;
	return session->ended && session->wait == DB_WAITS_FOR_NOTHING && !session->out &&
	       !db_session_has_message(session, &length);
}

/* --- output ----------------------------------------------------------------------------------- */

db_time db_session_stuck_at(const struct db_session *session)
{
	return session->out ? session->out_since + DB_SESSION_STUCK : DB_TIME_NEVER;
}

bool db_session_send(struct db_session *session, db_time now)
{
	ssize_t sent;

	if (!session->out)
		return true;
	do
		sent = send(session->fd, session->out + session->out_sent,
		            session->out_used - session->out_sent, MSG_NOSIGNAL | MSG_DONTWAIT);
	while (sent < 0 && errno == EINTR);
	if (sent < 0)
		return errno == EAGAIN || errno == EWOULDBLOCK;
	session->out_sent += (size_t)sent;
	session->out_since = now;
	if (session->out_sent == session->out_used) {
		free(session->out);
		session->out = NULL;
	}
	return true;
}

/* Frees what a call no longer needs. */
static void end_call(struct db_session *session)
{
	session->wait = DB_WAITS_FOR_NOTHING;
	session->due = DB_TIME_NEVER;
	free(session->job);
	session->job = NULL;
}

void db_session_append(struct db_session *session, const char *text, size_t length, bool last)
{
	char *all;

	if (last)
		end_call(session);
	if (session->oneway || session->gone)
		return;
	if (!session->out) {
		session->out_sent = 0;
		session->out_used = 0;
		session->out_since = db_control_now(session->control);
	}
	all = realloc(session->out, session->out_used + length);
	if (!all) {
		session->broken = true;
		return;
	}
	memcpy(all + session->out_used, text, length);
	session->out = all;
	session->out_used += length;
}

static void put_answer(struct db_session *session, const char *error, json_t *parameters,
                       bool continues)
{
	struct db_control_socket *control = session->control;
	size_t length;
	char *text;

	if (!continues)
		end_call(session);
	control->stats.errors += error != NULL;
	control->stats.denied += error && strcmp(error, NOT_ALLOWED) == 0;
	text = db_message_answer(error, parameters, continues, &length);
	if (text)
		db_session_append(session, text, length, false);
	else
		session->broken = true;
	free(text);
}

void db_session_reply(struct db_session *session, json_t *parameters, bool continues)
{
	put_answer(session, NULL, parameters, continues);
}

void db_session_fail(struct db_session *session, const char *error, json_t *parameters)
{
	put_answer(session, error, parameters, false);
}

void db_session_fail_parameter(struct db_session *session, const char *parameter)
{
	db_session_fail(session, "org.varlink.service.InvalidParameter",
	                json_pack("{s:s}", "parameter", parameter));
}

void db_session_fail_drive(struct db_session *session, const char *drive)
{
	db_session_fail(session, INTERFACE "NoSuchDrive", json_pack("{s:s}", "drive", drive));
}

void db_session_fail_register(struct db_session *session, const char *drive, const char *name)
{
	db_session_fail(session, INTERFACE "NoSuchRegister",
	                json_pack("{s:s, s:s}", "drive", drive, "name", name));
}

void db_session_record(struct db_session *session, const struct db_audit_entry *entry)
{
	const struct db_control_socket_setup *setup = &session->control->setup;

	(void)setup->ops->audit_post(setup->context, &session->client, entry);
}

bool db_session_require_act(struct db_session *session)
{
	if (session->client.may_write)
		return true;
	db_session_record(session, &(struct db_audit_entry){
					   .kind = DB_AUDIT_DENIED,
					   .what = session->method,
					   .text = "only root and members of act-group may act",
				   });
	db_session_fail(session, NOT_ALLOWED,
	                json_pack("{s:o}", "reason",
	                          json_sprintf("only root and members of group %s may act",
	                                       session->control->config->act_group)));
	return false;
}

void db_session_fail_value(struct db_session *session, const char *name, const char *reason)
{
	db_session_fail(session, INTERFACE "BadValue",
	                json_pack("{s:s, s:s}", "name", name, "reason", reason));
}

void db_session_fail_result(struct db_session *session, enum db_result result, const char *reason)
{
	if (result == DB_RESULT_BUSY)
		db_session_fail(session, INTERFACE "Busy", NULL);
	else if (result == DB_RESULT_NOT_IN_CONTROL)
		db_session_fail(session, NOT_ALLOWED, json_pack("{s:s}", "reason", reason));
	else
		db_session_fail(session, INTERFACE "Refused",
		                json_pack("{s:s, s:i, s:s, s:o*}", "result", db_result_name(result),
		                          "code", (int)result, "reason", reason, "repeated",
		                          session->repeated ? json_true() : NULL));
}
