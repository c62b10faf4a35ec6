/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include <string.h>

enum db_result db_flight_reach(const struct db_commander *commander, enum db_command command)
{
	struct db_snapshot snapshot;

	if (db_command_is_stop(command))
		return DB_RESULT_OK;
	db_axis_read(commander->config.axis, &snapshot);
	if (!(snapshot.feedback.status & DB_STATUS_BUS_UP))
		return DB_RESULT_BUS_DOWN;
	if (!(snapshot.feedback.status & DB_STATUS_ONLINE))
		return DB_RESULT_OFFLINE;
	return DB_RESULT_OK;
}

struct db_request *db_flight_find(const struct db_commander *commander, uint32_t ticket)
{
	for (struct db_request *request = commander->pending; request && ticket != 0;
	     request = request->next) {
		if (request->ticket == ticket)
			return request;
	}
	return NULL;
}

bool db_flight_has(const struct db_commander *commander, enum db_pending kind,
                   const struct db_request *but)
{
	for (const struct db_request *request = commander->pending; request;
	     request = request->next) {
		if (request == but)
			continue;
		switch (kind) {
		case DB_PENDING_SETTINGS:
			if (request->command == DB_CMD_NONE)
				return true;
			break;
		case DB_PENDING_MOTION:
			if (db_command_replaces_motion(request->command))
				return true;
			break;
		case DB_PENDING_HELD_MOTION:
			if (request->held)
				return true;
			break;
		case DB_PENDING_STOP_AGAIN:
			if (request->again)
				return true;
			break;
		}
	}
	return false;
}

/* --- submitting ------------------------------------------------------------------------------- */

struct db_request *db_flight_submit(struct db_commander *commander, struct db_request *request)
{
	struct db_request *pending;
	struct db_snapshot snapshot;
	unsigned others = 0;

	/* Stops are limited by their kinds, see db_flight_join_stop(). */
	for (pending = commander->pending; pending; pending = pending->next)
		others += !db_command_is_stop(pending->command);
	if (!db_command_is_stop(request->command) && others >= DB_COMMANDER_PENDING)
		return NULL;
	/* A ticket that no pending request has, however old; its former meaning is over. */
	do {
		request->number = commander->submitted++;
		request->ticket = ((uint32_t)commander->config.drive + 1) << 16 |
		                  (request->number & 0xFFFFu);
	} while (db_flight_find(commander, request->ticket));
	db_writers_retarget(&commander->writers, request->ticket, 0);
	request->drive = commander->config.drive;
	if (request->command == DB_CMD_MOVE_VELOCITY) {
		db_axis_read(commander->config.axis, &snapshot);
		request->before = snapshot.feedback.velocity;
	}
	pending = commander->ops->submit(commander->context, request);
	if (!pending)
		return NULL;
	pending->next = commander->pending;
	commander->pending = pending;
	switch (pending->command) {
	case DB_CMD_HOME:
	case DB_CMD_SET_POSITION:
	/* A raw frame and a program may do what the bridge does not see. */
	case DB_CMD_RAW_FRAME:
	case DB_CMD_START_PROGRAM:
	case DB_CMD_CONTINUE_PROGRAM:
	case DB_CMD_SINGLE_STEP:
		commander->origin.count++;
		commander->origin.last = pending->command;
		break;
	default:
		break;
	}
	return pending;
}

/* It is no longer pending, and its place is free; returns what it was. */
static struct db_request take_out(struct db_commander *commander, struct db_request *request)
{
	struct db_request **link = &commander->pending;
	struct db_request ended = *request;

	while (*link != request)
		link = &(*link)->next;
	*link = request->next;
	commander->ops->release(commander->context, request);
	return ended;
}

/* --- stops that serve several requests -------------------------------------------------------- */

/* The pending stops of clients of one kind, except `but`, and the newest of them; null. */
static struct db_request *youngest_stop(const struct db_commander *commander,
                                        enum db_command command, const struct db_request *but,
                                        unsigned *count)
{
	struct db_request *youngest = NULL;

	*count = 0;
	for (struct db_request *request = commander->pending; request; request = request->next) {
		if (request == but || !db_command_is_stop(command) || request->reaction ||
		    request->command != command)
			continue;
		(*count)++;
		/* The first one: pending requests are kept newest first. */
		if (!youngest)
			youngest = request;
	}
	return youngest;
}

void db_flight_replace_stop(struct db_commander *commander, struct db_request *stop)
{
	unsigned count;
	struct db_request *older = youngest_stop(commander, stop->command, stop, &count);

	if (!older)
		return;
	memcpy(stop->waiters, older->waiters, sizeof(stop->waiters));
	stop->waiter_count = older->waiter_count;
	older->waiter_count = 0;
	db_writers_retarget(&commander->writers, older->ticket, stop->ticket);
}

_Static_assert(DB_CMD_STOP < 8 && DB_CMD_QUICK_STOP < 8 && DB_CMD_DISABLE < 8,
               "`again` has three bits");
_Static_assert(DB_STAND_COUNT <= 16, "`again_cause` has four bits");

void db_flight_stop_again(struct db_request *stop, enum db_command command,
                          enum db_stand_cause cause)
{
	stop->again = command & 7;
	stop->again_cause = cause & 15;
	atomic_store_explicit(&stop->stop_follows, true, memory_order_release);
}

struct db_request *db_flight_join_stop(struct db_commander *commander, enum db_command command)
{
	struct db_request *newest = db_flight_find(commander, commander->newest);
	struct db_request *youngest;
	unsigned count;
	/* A controller's stop is for all of its axes, and another one may have been set going since
	 * the controller has answered. */
	bool answered_before = newest && !newest->again && commander->config.driver->axes > 1;

	if (newest && db_request_stop(newest) == command && !answered_before)
		return newest;
	youngest = youngest_stop(commander, command, NULL, &count);
	if (count < DB_COMMANDER_STOPS_OF_A_KIND && !(youngest && youngest->again))
		return NULL;
	db_flight_stop_again(youngest, command, (enum db_stand_cause)youngest->cause);
	commander->newest = youngest->ticket;
	return youngest;
}

/* --- waiting ---------------------------------------------------------------------------------- */

struct db_write_answer db_flight_wait(struct db_commander *commander, struct db_request *request,
                                      struct db_write_token token, db_time now)
{
	/* Sessions of the control socket wait for the end, however long that takes: they have no
	 * PLC time-outs. */
	bool patient = db_client_is_session(token.client);

	if (commander->config.accept_writes && !patient)
		return (struct db_write_answer){ .result = DB_RESULT_OK };
	if (request->waiter_count == DB_REQUEST_WAITERS)
		return (struct db_write_answer){ .result = DB_RESULT_PENDING };
	if (!patient && request->command == DB_CMD_NONE)
		request->early = (request->early | 1u << request->waiter_count) &
		                 DB_REQUEST_EARLY_MASK;
	request->waiters[request->waiter_count++] = (struct db_waiter){
		.token = token,
		.deadline = patient ? DB_TIME_NEVER :
		                      now + (db_time)commander->config.confirm_ms * DB_NS_PER_MS,
	};
	commander->waiting++;
	return (struct db_write_answer){ .later = true };
}

static void answer_waiters(struct db_commander *commander, struct db_request *request,
                           enum db_result result)
{
	/* Removed first: an answer may let the writer's next request in. */
	unsigned count = request->waiter_count;
	struct db_waiter waiters[DB_REQUEST_WAITERS];

	memcpy(waiters, request->waiters, sizeof(waiters));
	request->waiter_count = 0;
	request->early = 0;
	commander->waiting -= count;
	for (unsigned i = 0; i < count; i++)
		commander->ops->answer(commander->context, waiters[i].token, result);
}

void db_flight_repeat_stop(struct db_commander *commander, struct db_request *stop, db_time now)
{
	struct db_request next = take_out(commander, stop);
	uint32_t before = next.ticket;
	struct db_request *pending;

	next.command = (enum db_command)next.again;
	next.cause = next.again_cause;
	next.again = DB_CMD_NONE;
	pending = db_flight_submit(commander, &next);
	/* A bus never lacks room for a stop, least of all when one has just left it. If it does
	 * all the same, the bridge's own stop follows. */
	if (!pending) {
		commander->reaction_cause = (enum db_stand_cause)next.cause;
		commander->reaction_again_at = now + DB_STOP_RETRY;
		answer_waiters(commander, &next, DB_RESULT_BUSY);
		return;
	}
	db_writers_retarget(&commander->writers, before, pending->ticket);
	commander->newest = pending->ticket;
}

void db_flight_end(struct db_commander *commander, struct db_request *request)
{
	struct db_request ended = take_out(commander, request);

	answer_waiters(commander, &ended, (enum db_result)ended.result);
}

void db_commander_dismiss(struct db_commander *commander)
{
	for (struct db_request *request = commander->pending; request; request = request->next)
		answer_waiters(commander, request, DB_RESULT_CANCELLED);
}

/*
 * A parameter write that the drive has accepted, and that is not proved yet, is answered early
 * enough before confirm-ms is over for the answer to arrive in time.
 */
static db_time early_time(const struct db_commander *commander, const struct db_waiter *waiter)
{
	return waiter->deadline - (db_time)commander->config.confirm_ms * DB_NS_PER_MS / 8;
}

void db_flight_expire(struct db_commander *commander, db_time now)
{
	for (struct db_request *request = commander->pending; request; request = request->next) {
		bool acknowledged = atomic_load_explicit(&request->acknowledged,
		                                         memory_order_acquire);
		struct db_request due = { .waiter_count = 0 };
		enum db_result result;
		unsigned early = 0;
		unsigned left = 0;

		for (unsigned i = 0; i < request->waiter_count; i++) {
			struct db_waiter *waiter = &request->waiters[i];
			bool is_early = request->early >> i & 1;
			bool is_due = early_time(commander, waiter) <= now;

			if ((is_early && is_due && acknowledged) || waiter->deadline <= now) {
				due.waiters[due.waiter_count++] = *waiter;
				continue;
			}
			if (is_early && !is_due)
				early |= 1u << left;
			request->waiters[left++] = *waiter;
		}
		request->waiter_count = left & DB_REQUEST_WAITERS_MASK;
		request->early = early & DB_REQUEST_EARLY_MASK;
		if (due.waiter_count == 0)
			continue;
		/* Time-out of the wait: answer 05, or the reason if the drive or bus is gone. A
		 * parameter write that the drive has accepted is a success without proof; the
		 * result registers show later what the proof shows. */
		result = db_flight_reach(commander, DB_CMD_NONE);
		if (result == DB_RESULT_OK)
			result = acknowledged ? DB_RESULT_UNPROVEN : DB_RESULT_PENDING;
		answer_waiters(commander, &due, result);
	}
}

db_time db_flight_deadline(const struct db_commander *commander)
{
	db_time next = DB_TIME_NEVER;

	if (commander->waiting == 0)
		return next;
	for (const struct db_request *request = commander->pending; request;
	     request = request->next) {
		for (unsigned i = 0; i < request->waiter_count; i++) {
			const struct db_waiter *waiter = &request->waiters[i];
			db_time at = request->early >> i & 1 ? early_time(commander, waiter) :
			                                       waiter->deadline;

			if (at < next)
				next = at;
		}
	}
	return next;
}
