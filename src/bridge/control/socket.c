/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/clock.h"
#include "drivebridge/control_socket.h"
#include "drivebridge/health.h"

#include "control/act.h"
#include "control/control_private.h"
#include "control/once.h"
#include "transport/unix_listener.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* Until clients are accepted again after there were no descriptors left. */
#define ACCEPT_PAUSE (100 * DB_NS_PER_MS)
#define EVENTS_AT_ONCE 8
#define TIMER_ACCURACY_US 200

/* After serving a stream none is served for this many times the time that it took: however many
 * there are and however much they request, most of the thread's time is for Modbus. */
#define STREAMS_REST 4

static struct db_session *find(const struct db_control_socket *control, uint32_t id)
{
	for (size_t i = 0; i < control->count; i++) {
		if (control->sessions[i]->client.id == id)
			return control->sessions[i];
	}
	return NULL;
}

/* Next time due, or DB_TIME_NEVER. */
static db_time due_of(const struct db_control_socket *control, const struct db_session *session)
{
	bool streams = session->wait == DB_WAITS_FOR_REGISTERS ||
	               session->wait == DB_WAITS_FOR_VALUES ||
	               session->wait == DB_WAITS_FOR_EVENTS ||
	               session->wait == DB_WAITS_FOR_TRACE ||
	               session->wait == DB_WAITS_FOR_TROUBLES ||
	               session->wait == DB_WAITS_FOR_ALARMS;

	if (session->wait == DB_WAITS_FOR_NOTHING)
		return DB_TIME_NEVER;
	return streams && session->due < control->rest_until ? control->rest_until : session->due;
}

/* --- coming and going ------------------------------------------------------------------------- */

/* Nobody waits any more for what its call waits for. */
static void abandon_call(struct db_session *session)
{
	const struct db_control_socket *control = session->control;

	if (session->wait == DB_WAITS_FOR_SCAN)
		db_scan_forget(session);
	else if (session->wait == DB_WAITS_FOR_AUDIT)
		db_audit_forget(*control->setup.audit, session->client.id);
	else if (session->wait == DB_WAITS_FOR_HEALTH)
		db_health_forget(*control->setup.health, session->client.id);
	db_once_abandon(session);
}

static void end_session(struct db_control_socket *control, size_t place)
{
	struct db_session *session = control->sessions[place];
	char text[DB_CLIENT_TEXT_MAX];
	struct db_log_about about = { .client = text };

	abandon_call(session);
	control->sessions[place] = control->sessions[--control->count];
	/* For the registers it is an ordinary client. */
	db_registers_backend.client(control->setup.registers, &session->client, false);
	db_session_text(session, text);
	if (session->acted)
		db_log(&control->log, db_control_now(control), DB_EVENT_CLIENT_GONE, &about,
		       "disconnected (session %u)", (unsigned)session->client.port);
	db_session_free(session);
}

static void refuse(struct db_control_socket *control, int fd)
{
	static const char busy[] = "{\"error\":\"io.drivebridge.Control.Busy\",\"parameters\":{}}";

	/* A client that reads the answer to its first call receives this. */
	(void)!send(fd, busy, sizeof(busy), MSG_NOSIGNAL | MSG_DONTWAIT);
	close(fd);
	control->stats.refused++;
}

static void refuse_user(struct db_control_socket *control, int fd, uint32_t user, const char *name,
                        const char *why)
{
	const struct db_client_session session = { .user = user };
	struct db_client_words words;
	struct db_log_about about = { .client = words.address };
	uint8_t address[16];

	db_client_address_of_session(&session, address);
	db_client_words_init(&words, address, name, "");
	db_log(&control->log, db_control_now(control), DB_EVENT_CLIENT_REFUSED, &about,
	       "connection refused: %s", why);
	refuse(control, fd);
}

/* Reads what has arrived. With the first bytes a session gets its turn. */
static void hear(struct db_control_socket *control, struct db_session *session, db_time now)
{
	bool first = session->in_used == 0;

	if (!db_session_receive(session, now))
		session->gone = session->ended = true;
	if (!first)
		return;
	session->turn = ++control->last_turn;
	session->turn_bytes = session->in_used;
	session->turn_kept = false;
}

/* The use of the places, and the place for the next stop. */
struct places {
	size_t all;
	size_t readers;
	size_t stops;
	struct db_session *oldest_stop; /* the oldest stop that waits for its drive; null */
};

static struct places count_places(const struct db_control_socket *control)
{
	struct places places = { .all = 0 };

	for (size_t i = 0; i < control->count; i++) {
		struct db_session *session = control->sessions[i];

		places.readers += !session->client.may_write;
		places.all += !session->stops_only;
		/* Ended ones are freed before the loop waits again. */
		if (!session->stops_only || (session->broken && !session->out))
			continue;
		places.stops++;
		if (!session->broken && session->wait != DB_WAITS_FOR_NOTHING &&
		    (!places.oldest_stop || session->turn < places.oldest_stop->turn))
			places.oldest_stop = session;
	}
	return places;
}

/* True if a client that may act would have a place. If not, a session that may be about to send a
 * stop has a little time for it, and new clients wait for that. */
static bool has_place(const struct db_control_socket *control)
{
	struct places places = count_places(control);

	return places.all < DB_SESSIONS_MAX || places.stops < DB_SESSIONS_FOR_STOPS ||
	       places.oldest_stop;
}

/* False: there is no place for this one. */
static bool find_place(struct db_control_socket *control, bool may_act, bool *stops_only)
{
	struct places places = count_places(control);
	struct db_session *oldest = places.oldest_stop;

	*stops_only = places.all == DB_SESSIONS_MAX;
	if (!may_act)
		return !*stops_only && places.readers < DB_SESSIONS_MAX - DB_SESSIONS_RESERVED;
	if (*stops_only && places.stops == DB_SESSIONS_FOR_STOPS) {
		/* Its stop continues without it. Freed in settle(): pending epoll events may refer
		 * to it. */
		db_stops_leave(oldest);
		(void)db_session_send(oldest, db_control_now(control));
		free(oldest->out);
		oldest->out = NULL;
		oldest->broken = oldest->ended = true;
	}
	return true;
}

static void admit(struct db_control_socket *control, int fd)
{
	uid_t user;
	enum db_right right = db_rights_find(&control->rights, fd, &user);
	struct db_client client = { .may_write = right == DB_RIGHT_ACT };
	char name[DB_CLIENT_PROCESS_USER_MAX];
	db_time now = db_control_now(control);
	struct db_session *session;
	bool stops_only;
	size_t count = 0;

	db_rights_name(user, name);
	if (right == DB_RIGHT_NONE) {
		refuse_user(control, fd, (uint32_t)user, name,
		            "it is in neither read-group nor act-group");
		return;
	}
	/* One program of a user who may not act must not leave others without any session. */
	for (size_t i = 0; i < control->count; i++)
		count += !control->sessions[i]->client.may_write &&
		         control->sessions[i]->user == (uint32_t)user;
	if (right != DB_RIGHT_ACT && count >= DB_SESSIONS_OF_READER) {
		refuse_user(control, fd, (uint32_t)user, name,
		            "a user who may only read has no more sessions than this one has");
		return;
	}
	if (!find_place(control, client.may_write, &stops_only)) {
		refuse(control, fd);
		return;
	}
	do
		control->last_id = db_client_number_after(control->last_id);
	while (find(control, control->last_id));
	client.id = control->last_id;
	client.port = (uint16_t)(1 + (client.id - DB_CLIENT_FIRST_SESSION) % UINT16_MAX);
	session = db_session_new(control, fd, &client, now);
	if (!session)
		return;
	session->stops_only = stops_only;
	session->user = (uint32_t)user;
	db_session_set_actor(session, (uint32_t)user, name, "");
	control->sessions[control->count++] = session;
	control->stats.accepted++;
	db_registers_backend.client(control->setup.registers, &session->client, true);
	/* Bytes that came with it arrived before later ones of others. */
	hear(control, session, now);
}

static void set_accepting(struct db_control_socket *control, bool accepts)
{
	struct epoll_event event = { .events = accepts ? EPOLLIN : 0 };

	if (control->listener < 0 || control->accepts == accepts)
		return;
	control->accepts = accepts;
	epoll_ctl(control->epoll, EPOLL_CTL_MOD, control->listener, &event);
}

static void accept_some(struct db_control_socket *control)
{
	for (int i = 0; i < DB_SESSIONS_ACCEPTED_AT_ONCE && has_place(control); i++) {
		int fd = accept4(control->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);

		if (fd >= 0) {
			admit(control, fd);
			continue;
		}
		/* The listener stays readable: without a pause the loop would spin. */
		if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
			control->accept_again = db_control_now(control) + ACCEPT_PAUSE;
			return;
		}
		if (errno != ECONNABORTED && errno != EINTR)
			return;
	}
}

/* --- what comes next -------------------------------------------------------------------------- */

/* Sets what epoll waits for: bytes where there is room for them, room where bytes wait. */
static void watch(struct db_control_socket *control, struct db_session *session)
{
	struct epoll_event event = { .data.ptr = session };

	if (!session->ended && !session->broken && session->in_used <= DB_MESSAGE_MAX)
		event.events = EPOLLIN | EPOLLRDHUP;
	else if (!session->ended && session->behind_since == 0)
		session->behind_since = db_control_now(control);
	if (session->out && !session->gone)
		event.events |= EPOLLOUT;
	/* A connection that has ended is reported for ever. */
	if (session->gone || event.events == session->events)
		return;
	session->events = event.events;
	epoll_ctl(control->epoll, EPOLL_CTL_MOD, session->fd, &event);
}

static void arm(struct db_control_socket *control, db_time due)
{
	if (due == control->armed)
		return;
	control->armed = due;
	if (due == DB_TIME_NEVER) {
		sd_event_source_set_enabled(control->timer, SD_EVENT_OFF);
		return;
	}
	sd_event_source_set_time(control->timer, (uint64_t)(due / DB_NS_PER_US));
	sd_event_source_set_enabled(control->timer, SD_EVENT_ONESHOT);
}

/* Whether the loop must return for a waiting call. As an event like those of sockets: then
 * everything else that is ready is served first. */
static void want_turn(struct db_control_socket *control, bool wanted)
{
	uint64_t count = 1;

	if (wanted == control->wants_turn)
		return;
	control->wants_turn = wanted;
	if (wanted)
		(void)!write(control->turn_fd, &count, sizeof(count));
	else
		(void)!read(control->turn_fd, &count, sizeof(count));
}

/* After serving: free finished sessions, update epoll interest and the timer. */
static void settle(struct db_control_socket *control)
{
	db_time now = db_control_now(control);
	db_time due = DB_TIME_NEVER;
	bool work = false;

	for (size_t i = control->count; i-- > 0;) {
		struct db_session *session = control->sessions[i];
		size_t length;

		if (session->out && !session->gone && !db_session_send(session, now))
			session->gone = session->ended = true;
		/* No beat can arrive from it any more. */
		if (session->ended && !session->deserted) {
			db_named_desert(control->setup.registers, &session->client);
			session->deserted = true;
		}
		if (session->gone) {
			/* Calls after this one are still carried out. */
			abandon_call(session);
			free(session->out);
			session->out = NULL;
			free(session->job);
			session->job = NULL;
			session->wait = DB_WAITS_FOR_NOTHING;
		}
		/* A message that does not fit. */
		if (!session->broken && session->in_used == DB_MESSAGE_MAX + 1 &&
		    !memchr(session->in, '\0', session->in_used)) {
			session->oneway = false;
			db_session_fail_parameter(session, "the message is too long");
			session->broken = true;
			(void)db_session_send(session, now);
		}
		if (db_session_is_over(session)) {
			end_session(control, i);
			continue;
		}
		watch(control, session);
		work = work || db_calls_has_next(session, &length);
		if (due_of(control, session) < due)
			due = due_of(control, session);
		if (db_session_stuck_at(session) < due)
			due = db_session_stuck_at(session);
		if (db_session_owes_until(session, now) < due)
			due = db_session_owes_until(session, now);
	}
	if (now < control->accept_again && control->accept_again < due)
		due = control->accept_again;
	set_accepting(control, now >= control->accept_again && has_place(control));
	arm(control, due);
	want_turn(control, work);
}

/* --- serving ---------------------------------------------------------------------------------- */

/*
 * Takes one call, of the session whose turn it is: then the loop serves the others, Modbus above
 * all. In the order of arrival, so that a stop comes after the move that it is to end, over any
 * session; further calls of a session come after those of all others.
 */
static bool take_call(struct db_control_socket *control)
{
	struct db_session *next = NULL;
	size_t length = 0;

	for (size_t i = 0; i < control->count; i++) {
		struct db_session *session = control->sessions[i];
		size_t found = 0;

		if ((next && session->turn >= next->turn) || !db_calls_has_next(session, &found))
			continue;
		next = session;
		length = found;
	}
	if (!next)
		return false;
	next->introduced = false;
	next->client.arrived = next->in_arrived;
	db_calls_take(next, next->in, length);
	db_session_drop_message(next, length);
	/* Then it is the turn of all others. Only an Introduce shares its turn with the call that
	 * came together with it; not twice in a row. */
	next->turn_bytes -= length + 1 < next->turn_bytes ? length + 1 : next->turn_bytes;
	next->turn_kept = next->introduced && !next->turn_kept && next->turn_bytes > 0 &&
	                  memchr(next->in, '\0', next->turn_bytes);
	if (!next->turn_kept)
		next->turn = ++control->last_turn;
	return true;
}

/* Returns how many sockets were ready. */
static int serve(struct db_control_socket *control)
{
	struct epoll_event events[EVENTS_AT_ONCE];
	db_time now = db_control_now(control);
	int count = epoll_wait(control->epoll, events, EVENTS_AT_ONCE, 0);
	bool take = false;

	for (int i = 0; i < count; i++) {
		struct db_session *session = events[i].data.ptr;

		if (events[i].data.ptr == &control->turn_fd) {
			take = true;
			continue;
		}
		if (!session) {
			accept_some(control);
			continue;
		}
		if (events[i].events & (EPOLLIN | EPOLLRDHUP | EPOLLHUP | EPOLLERR))
			hear(control, session, now);
		/* Closed, and everything it had sent is here: it is no longer polled. */
		if ((events[i].events & (EPOLLHUP | EPOLLERR)) && session->ended &&
		    !session->gone) {
			session->gone = true;
			epoll_ctl(control->epoll, EPOLL_CTL_DEL, session->fd, NULL);
		} else if ((events[i].events & (EPOLLHUP | EPOLLERR)) &&
		           session->in_used > DB_MESSAGE_MAX) {
			/* Level triggered: it would be reported again and again. */
			session->gone = session->ended = true;
			epoll_ctl(control->epoll, EPOLL_CTL_DEL, session->fd, NULL);
		}
	}
	if (take)
		(void)take_call(control);
	settle(control);
	return count;
}

static int on_ready(sd_event_source *source, int fd, uint32_t revents, void *context)
{
	(void)source;
	(void)fd;
	(void)revents;
	(void)serve(context);
	return 0;
}

void db_control_socket_catch_up(struct db_control_socket *control)
{
	if (!control)
		return;
	for (size_t served = 0; served <= DB_SESSIONS_MOST; served += EVENTS_AT_ONCE) {
		if (serve(control) < EVENTS_AT_ONCE)
			break;
	}
	settle(control);
	/* A session whose answer was not sent yet would lose its turn. */
	for (size_t i = 0; i < control->count && take_call(control); i++)
		settle(control);
}

/* True if it was one that keeps its place without using it. */
static bool drop_idler(struct db_control_socket *control, size_t place, db_time now)
{
	struct db_session *session = control->sessions[place];
	char text[DB_CLIENT_TEXT_MAX];
	struct db_log_about about = { .client = text };
	const char *why = NULL;

	if (db_session_stuck_at(session) <= now) {
		why = "it does not read its answers";
	} else if (db_session_owes_until(session, now) <= now) {
		/* Bytes that arrived while this program did not run count. */
		hear(control, session, now);
		if (db_session_owes_until(session, now) <= now)
			why = session->in_used > 0 ? "it has not ended a message that it began" :
			                             "it has a place for a stop and sends none";
	}
	if (!why)
		return false;
	db_session_text(session, text);
	db_log(&control->log, now, DB_EVENT_CLIENT_REFUSED, &about, "connection closed: %s", why);
	control->stats.dropped++;
	end_session(control, place);
	return true;
}

static int on_timer(sd_event_source *source, uint64_t us, void *context)
{
	struct db_control_socket *control = context;
	db_time now = db_control_now(control);
	struct db_session *stream = NULL;

	(void)source;
	(void)us;
	control->armed = DB_TIME_NEVER;
	for (size_t i = control->count; i-- > 0;) {
		struct db_session *session = control->sessions[i];

		if (drop_idler(control, i, now))
			continue;
		if (due_of(control, session) > now)
			continue;
		session->client.arrived = 0;
		if (session->wait == DB_WAITS_FOR_MOTION || session->wait == DB_WAITS_FOR_FIRST)
			db_act_look(session, now);
		else if (session->wait == DB_WAITS_FOR_SCAN)
			db_scan_look(session, now);
		else if (session->wait == DB_WAITS_FOR_AUDIT)
			db_audit_look(session, now);
		else if (session->wait == DB_WAITS_FOR_HEALTH)
			db_health_look(session, now);
		else if (session->wait == DB_WAITS_FOR_STOPS)
			db_stops_leave(session);
		else if (!stream || session->due < stream->due)
			stream = session;
	}
	/* One per turn of the loop: then Modbus has its turn. */
	if (stream) {
		db_time begun = db_clock_now();

		if (stream->wait == DB_WAITS_FOR_REGISTERS)
			db_look_describe_more(stream, now);
		else if (stream->wait == DB_WAITS_FOR_TRACE)
			db_traces_look(stream, now);
		else if (stream->wait == DB_WAITS_FOR_TROUBLES)
			db_troubles_look(stream, now);
		else if (stream->wait == DB_WAITS_FOR_ALARMS)
			db_alarms_look(stream, now);
		else
			db_streams_look(stream, now);
		control->rest_until = now + (1 + STREAMS_REST) * (db_clock_now() - begun);
	}
	settle(control);
	return 0;
}

void db_control_socket_answer(struct db_control_socket *control, struct db_write_token token,
                              enum db_result result)
{
	struct db_session *session = control ? find(control, token.client) : NULL;

	if (!control)
		return;
	if (session && session->wait == DB_WAITS_FOR_STOPS) {
		db_ids_end_by_token(&control->ids, token, result);
		db_stops_ended(session, token.sequence, result);
		want_turn(control, true);
		return;
	}
	if (!session || session->sequence != token.sequence ||
	    (session->wait != DB_WAITS_FOR_WRITE && session->wait != DB_WAITS_FOR_RUN)) {
		db_ids_end_by_token(&control->ids, token, result);
		return;
	}
	session->client.arrived = 0;
	db_act_ended(session, result);
	/* The rest waits for the loop: this may be called from within other functions. */
	want_turn(control, true);
}

void db_control_socket_words(const struct db_control_socket *control, const uint8_t address[16],
                             struct db_client_words *words)
{
	db_actors_words(control ? &control->actors : NULL, address, words);
}

void db_control_socket_names(const struct db_control_socket *control,
                             const struct db_client *client, struct db_control_socket_names *names)
{
	for (size_t i = 0; control && i < control->count; i++) {
		const struct db_session *session = control->sessions[i];
		const struct db_actor *actor = db_actors_find(&control->actors, session->actor);

		if (session->client.id != client->id || !actor)
			continue;
		names->login = actor->process_user;
		names->user = actor->named;
		names->from = session->from;
	}
}

void db_control_socket_recall(struct db_control_socket *control, uint32_t user, const char *login,
                              const char *named, uint8_t address[16])
{
	struct db_client_session session = { .user = user, .named = named[0] != '\0' };

	session.actor = db_actors_hold(&control->actors, user, login, named);
	db_actors_let_go(&control->actors, session.actor);
	db_client_address_of_session(&session, address);
}

void db_control_socket_reloaded(struct db_control_socket *control, const char *errors)
{
	for (size_t i = 0; control && i < control->count; i++)
		db_streams_reloaded(control->sessions[i], errors);
	if (control)
		want_turn(control, true);
}

void db_control_socket_edited(struct db_control_socket *control,
                              const struct db_edit_answer *answer)
{
	for (size_t i = 0; control && i < control->count; i++)
		db_edit_answered(control->sessions[i], answer);
	if (control)
		want_turn(control, true);
}

/* --- making ----------------------------------------------------------------------------------- */

/* Tools must not keep PLCs from being served: an error in listening is logged, and nothing else. */
static void listen_for_tools(struct db_control_socket *control)
{
	const char *path = control->config->socket;
	struct epoll_event event = { .events = EPOLLIN };
	const char *why = NULL;

	control->listener = -1;
	if (strcmp(path, DB_NO_SOCKET) == 0)
		return;
	control->listener = db_unix_listener_open(path, &why);
	if (control->listener < 0) {
		db_log(&control->log, db_control_now(control), DB_EVENT_CONTROL_FAILED, NULL,
		       "no control socket for tools such as drivebridgectl: %s: %s; correct socket "
		       "in the section control, or set it to off",
		       path, why);
		return;
	}
	control->path = strdup(path);
	control->accepts = true;
	epoll_ctl(control->epoll, EPOLL_CTL_ADD, control->listener, &event);
}

static void stop_listening(struct db_control_socket *control)
{
	if (control->listener >= 0)
		close(control->listener);
	if (control->path)
		unlink(control->path);
	free(control->path);
	control->path = NULL;
	control->listener = -1;
}

int db_control_socket_new(const struct db_control_socket_setup *setup,
                          struct db_control_socket **control)
{
	struct db_control_socket *made = calloc(1, sizeof(*made));
	struct epoll_event turn = { .events = EPOLLIN };
	int error;
	ssize_t got;

	if (!made)
		return -ENOMEM;
	made->setup = *setup;
	made->config = setup->config;
	made->log = setup->log;
	made->listener = -1;
	made->armed = DB_TIME_NEVER;
	made->last_id = DB_CLIENT_GROUP - 1; /* the next one is the first session's */
	/* A number that no other run of the service has had, in all probability. */
	do
		got = getrandom(&made->run, sizeof(made->run), 0);
	while (got < 0 && errno == EINTR);
	error = got == sizeof(made->run) ? 0 : -EIO;
	if (error < 0) {
		free(made);
		return error;
	}
	made->started_us = db_clock_wall_us();
	made->epoll = epoll_create1(EPOLL_CLOEXEC);
	made->turn_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	turn.data.ptr = &made->turn_fd;
	error = made->epoll < 0 || made->turn_fd < 0 ||
	                        epoll_ctl(made->epoll, EPOLL_CTL_ADD, made->turn_fd, &turn) < 0 ?
	                -errno :
	                0;
	if (error == 0)
		error = sd_event_add_io(setup->loop, &made->io, made->epoll, EPOLLIN, on_ready,
		                        made);
	if (error >= 0)
		error = sd_event_add_time(setup->loop, &made->timer, CLOCK_MONOTONIC, UINT64_MAX,
		                          TIMER_ACCURACY_US, on_timer, made);
	if (error >= 0)
		error = sd_event_source_set_enabled(made->timer, SD_EVENT_OFF);
	if (error < 0) {
		db_control_socket_free(made);
		return error;
	}
	made->rights = db_rights_of(made->config);
	listen_for_tools(made);
	*control = made;
	return 0;
}

void db_control_socket_free(struct db_control_socket *control)
{
	if (!control)
		return;
	while (control->count > 0)
		end_session(control, control->count - 1);
	stop_listening(control);
	sd_event_source_disable_unref(control->io);
	sd_event_source_disable_unref(control->timer);
	if (control->epoll >= 0)
		close(control->epoll);
	if (control->turn_fd >= 0)
		close(control->turn_fd);
	db_ids_clear(&control->ids);
	free(control);
}

void db_control_socket_change(struct db_control_socket *control,
                              const struct db_control_config *config,
                              const struct db_log_source *log)
{
	bool elsewhere = strcmp(config->socket, control->config->socket) != 0 ||
	                 control->listener < 0;

	control->config = config;
	control->log = *log;
	control->rights = db_rights_of(config);
	if (elsewhere) {
		stop_listening(control);
		listen_for_tools(control);
	}
	for (size_t i = control->count; i-- > 0;) {
		struct db_session *session = control->sessions[i];
		bool could_act = session->client.may_write;
		uid_t user;
		enum db_right right = db_rights_find(&control->rights, session->fd, &user);

		if (right == DB_RIGHT_NONE) {
			end_session(control, i);
			continue;
		}
		session->client.may_write = right == DB_RIGHT_ACT;
		if (could_act && !session->client.may_write)
			db_registers_backend.restricted(control->setup.registers, &session->client);
	}
}
