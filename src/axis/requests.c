/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/requests.h"

#include "axis/state.h"

#include <math.h>
#include <string.h>

uint16_t db_ticket_drive(uint32_t ticket)
{
	return (uint16_t)((ticket >> 16) - 1);
}

enum db_result db_requests_reach(const struct db_commander *commander, enum db_command command)
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

struct db_slot *db_requests_find(const struct db_commander *commander, uint32_t ticket)
{
	return db_pending_find(&commander->pending, ticket);
}

/* --- to the bus -------------------------------------------------------------------------------------- */

/* Of no request that is pending, however long; what it meant before is over. */
static uint32_t new_ticket(struct db_commander *commander)
{
	uint32_t ticket;

	do
		ticket = ((uint32_t)commander->config.drive + 1) << 16 |
		         (commander->submitted++ & 0xFFFFu);
	while (db_requests_find(commander, ticket));
	db_writers_retire(&commander->writers, ticket);
	return ticket;
}

struct db_slot *db_requests_submit(struct db_commander *commander, const struct db_client *client,
                                   struct db_request *request, uint16_t id)
{
	struct db_slot *slot = db_pending_place(&commander->pending, request->command);
	struct db_slot taken = { .command = request->command, .cause = request->cause };

	if (!slot)
		return NULL;
	request->ticket = new_ticket(commander);
	request->drive = commander->config.drive;
	if (!commander->ops->submit(commander->context, request))
		return NULL;
	taken.ticket = request->ticket;
	taken.order = commander->submitted - 1;
	taken.id = id;
	taken.halts = request->command == DB_CMD_MOVE_VELOCITY &&
	              fpclassify(request->args.target_velocity) == FP_ZERO;
	taken.delay = request->command == DB_CMD_START_PROGRAM ?
	                      (uint8_t)request->args.program_delay :
	                      0;
	taken.arrived = request->submitted;
	if (client) {
		taken.has_client = true;
		taken.port = client->port;
		memcpy(taken.address, client->address, sizeof taken.address);
	}
	db_pending_add(&commander->pending, slot, &taken);
	return slot;
}

/* --- stops that stand for others ----------------------------------------------------------------------- */

/* The clients' stops of one kind that are pending, `but` one, and the youngest of them; null. */
static struct db_slot *youngest_stop(struct db_commander *commander, enum db_command command,
                                     const struct db_slot *but, unsigned *count)
{
	struct db_slot *youngest = NULL;

	*count = 0;
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot == but || !db_command_is_stop(command) || slot->reaction ||
		    slot->command != command)
			continue;
		(*count)++;
		if (!youngest ||
		    commander->submitted - slot->order < commander->submitted - youngest->order)
			youngest = slot;
	}
	return youngest;
}

void db_requests_take_over(struct db_commander *commander, struct db_slot *stop)
{
	unsigned count;
	struct db_slot *older = youngest_stop(commander, stop->command, stop, &count);

	if (!older)
		return;
	memcpy(stop->waiters, older->waiters, sizeof stop->waiters);
	stop->waiter_count = older->waiter_count;
	older->waiter_count = 0;
	db_writers_retarget(&commander->writers, older->ticket, stop->ticket);
}

struct db_slot *db_requests_join_stop(struct db_commander *commander, enum db_command command)
{
	struct db_slot *newest = db_requests_find(commander, commander->newest);
	struct db_slot *youngest;
	unsigned count;

	if (newest && newest->command == command)
		return newest;
	youngest = youngest_stop(commander, command, NULL, &count);
	if (count < DB_COMMANDER_STOPS_OF_A_KIND && !(youngest && youngest->again))
		return NULL;
	youngest->again = true;
	commander->newest = youngest->ticket;
	return youngest;
}

bool db_requests_has_stop_to_repeat(const struct db_commander *commander)
{
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->again)
			return true;
	}
	return false;
}

void db_requests_repeat_stop(struct db_commander *commander, struct db_slot *slot, db_time now)
{
	struct db_request request = {
		.ticket = new_ticket(commander),
		.drive = commander->config.drive,
		.command = slot->command,
		.cause = slot->cause,
		.submitted = now,
	};
	uint32_t before = slot->ticket;

	slot->over = !commander->ops->submit(commander->context, &request);
	if (slot->over) {
		commander->stop_repeat_at = now + DB_STOP_RETRY;
		return;
	}
	slot->again = false;
	slot->ticket = request.ticket;
	slot->order = commander->submitted - 1;
	db_writers_retarget(&commander->writers, before, slot->ticket);
	commander->newest = slot->ticket;
}

void db_requests_repeat_stops(struct db_commander *commander, db_time now)
{
	if (commander->stop_repeat_at > now)
		return;
	commander->stop_repeat_at = DB_TIME_NEVER;
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->over)
			db_requests_repeat_stop(commander, slot, now);
	}
}

/* --- who waits ------------------------------------------------------------------------------------------ */

struct db_write_answer db_requests_wait(struct db_commander *commander, struct db_slot *slot,
                                        struct db_write_token token, db_time now)
{
	/* Sessions of the control socket wait for the end, however long that takes: they have no timeouts of PLCs. */
	bool patient = db_client_is_session(token.client);

	if (commander->config.accept_writes && !patient)
		return (struct db_write_answer){ .result = DB_RESULT_OK };
	if (slot->waiter_count == DB_COMMANDER_WAITERS)
		return (struct db_write_answer){ .result = DB_RESULT_PENDING };
	slot->waiters[slot->waiter_count++] = (struct db_waiter){
		.token = token,
		.deadline = patient ? DB_TIME_NEVER :
		                      now + (db_time)commander->config.confirm_ms * DB_NS_PER_MS,
	};
	commander->waiting++;
	return (struct db_write_answer){ .later = true };
}

static void answer_waiters(struct db_commander *commander, struct db_slot *slot,
                           enum db_result result)
{
	/* Taken out first: an answer may let the writer's next request in. */
	unsigned count = slot->waiter_count;
	struct db_waiter waiters[DB_COMMANDER_WAITERS];

	memcpy(waiters, slot->waiters, sizeof waiters);
	slot->waiter_count = 0;
	commander->waiting -= count;
	for (unsigned i = 0; i < count; i++)
		commander->ops->answer(commander->context, waiters[i].token, result);
}

void db_requests_end(struct db_commander *commander, struct db_slot *slot, enum db_result result)
{
	struct db_slot ended = *slot;

	db_pending_remove(&commander->pending, slot);
	answer_waiters(commander, &ended, result);
}

void db_requests_dismiss(struct db_commander *commander, enum db_result result)
{
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next)
		answer_waiters(commander, slot, result);
}

void db_requests_expire(struct db_commander *commander, db_time now)
{
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		struct db_slot due = { .waiter_count = 0 };
		enum db_result result;
		unsigned left = 0;

		for (unsigned i = 0; i < slot->waiter_count; i++) {
			if (slot->waiters[i].deadline <= now)
				due.waiters[due.waiter_count++] = slot->waiters[i];
			else
				slot->waiters[left++] = slot->waiters[i];
		}
		slot->waiter_count = left & DB_COMMANDER_WAITERS_MASK;
		if (due.waiter_count == 0)
			continue;
		/* They are told that it takes longer, or why it surely will. */
		result = db_requests_reach(commander, DB_CMD_NONE);
		answer_waiters(commander, &due,
		               result == DB_RESULT_OK ? DB_RESULT_PENDING : result);
	}
}

db_time db_requests_deadline(const struct db_commander *commander)
{
	db_time next = commander->stop_repeat_at;

	if (commander->waiting == 0)
		return next;
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		for (unsigned i = 0; i < slot->waiter_count; i++) {
			if (slot->waiters[i].deadline < next)
				next = slot->waiters[i].deadline;
		}
	}
	return next;
}
