/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/writers.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int db_writers_reserve(struct db_writers *writers)
{
	if (!writers->each)
		writers->each = calloc(DB_WRITERS, sizeof writers->each[0]);
	return writers->each ? 0 : -ENOMEM;
}

void db_writers_set(struct db_writers *writers, bool by_address)
{
	writers->by_address = by_address;
	writers->all = (struct db_writer){ .taken = false };
	if (!by_address)
		db_writers_release(writers);
	for (size_t i = 0; writers->each && i < DB_WRITERS; i++)
		writers->each[i] = writers->all;
}

void db_writers_release(struct db_writers *writers)
{
	free(writers->each);
	writers->each = NULL;
}

static struct db_writer *first_of(struct db_writers *writers)
{
	return writers->by_address ? writers->each : &writers->all;
}

static size_t count_of(const struct db_writers *writers)
{
	return writers->by_address ? DB_WRITERS : 1;
}

struct db_writer *db_writers_find(struct db_writers *writers, const struct db_client *client)
{
	if (!writers->by_address)
		return &writers->all;
	for (size_t i = 0; client && i < DB_WRITERS; i++) {
		struct db_writer *writer = &writers->each[i];

		if (writer->taken &&
		    memcmp(writer->address, client->address, sizeof writer->address) == 0)
			return writer;
	}
	return NULL;
}

/* A free place, or that of the one that was silent longest. */
static struct db_writer *place(struct db_writers *writers)
{
	struct db_writer *chosen = &writers->each[0];

	for (size_t i = 0; i < DB_WRITERS; i++) {
		struct db_writer *writer = &writers->each[i];

		if (!writer->taken)
			return writer;
		if (writer->heard < chosen->heard)
			chosen = writer;
	}
	return chosen;
}

struct db_writer *db_writers_claim(struct db_writers *writers, const struct db_client *client,
                                   db_time now)
{
	struct db_writer *writer = db_writers_find(writers, client);

	if (writer || !client)
		return writer;
	writer = place(writers);
	*writer = (struct db_writer){ .taken = true, .heard = now };
	memcpy(writer->address, client->address, sizeof writer->address);
	return writer;
}

void db_writers_hear(struct db_writers *writers, const struct db_client *client, db_time now)
{
	struct db_writer *writer = db_writers_find(writers, client);

	if (writer)
		writer->heard = now;
}

static void retarget(uint32_t *kept, uint32_t ticket, uint32_t to)
{
	if (*kept == ticket)
		*kept = to;
}

void db_outcome_retarget(struct db_outcome *outcome, uint32_t ticket, uint32_t to)
{
	retarget(&outcome->ticket, ticket, to);
	retarget(&outcome->write_ticket, ticket, to);
}

void db_writers_retarget(struct db_writers *writers, uint32_t ticket, uint32_t to)
{
	for (size_t i = 0; i < count_of(writers); i++) {
		struct db_writer *writer = first_of(writers) + i;

		retarget(&writer->last.ticket, ticket, to);
		retarget(&writer->previous.ticket, ticket, to);
		retarget(&writer->execution.ticket, ticket, to);
		db_outcome_retarget(&writer->shown, ticket, to);
	}
}

void db_outcome_retire(struct db_outcome *outcome, uint32_t ticket)
{
	db_outcome_retarget(outcome, ticket, 0);
}

void db_writers_retire(struct db_writers *writers, uint32_t ticket)
{
	db_writers_retarget(writers, ticket, 0);
}

void db_writer_remember(struct db_writer *writer, uint16_t id, enum db_result result,
                        uint32_t ticket)
{
	/* A stop repeated under its own id does not make an older id new again. */
	if (id != writer->last.id)
		writer->previous = writer->last;
	writer->last = (struct db_used_id){
		.id = id,
		.result = result,
		.sent = ticket != 0,
		.ticket = ticket,
	};
}

void db_outcome_complete(struct db_outcome *outcome, uint32_t ticket, enum db_result result,
                         uint32_t took_us)
{
	if (outcome->ticket == ticket) {
		outcome->result = (uint16_t)result;
		outcome->result_time_us = took_us;
	}
	if (outcome->write_ticket == ticket)
		outcome->write_result = (uint16_t)result;
}

static void complete_ids(struct db_writer *writer, uint32_t ticket, enum db_result result)
{
	if (writer->previous.ticket == ticket)
		writer->previous.result = result;
	if (writer->last.ticket != ticket)
		return;
	writer->last.result = result;
	if (result != DB_RESULT_BUSY)
		return;
	/* The bus turned it away after all: the id is as good as never seen. */
	writer->last = writer->previous;
	writer->previous = (struct db_used_id){ 0 };
}

void db_writers_complete(struct db_writers *writers, uint32_t ticket, enum db_result result,
                         uint32_t took_us)
{
	for (size_t i = 0; i < count_of(writers); i++) {
		struct db_writer *writer = first_of(writers) + i;

		db_outcome_complete(&writer->shown, ticket, result, took_us);
		complete_ids(writer, ticket, result);
		if (writer->execution.ticket != ticket)
			continue;
		writer->execution.result = result;
		writer->has_executed = result != DB_RESULT_BUSY;
	}
}

static void abort_motion(struct db_outcome *outcome)
{
	outcome->motion_result = DB_RESULT_CANCELLED;
	if (!outcome->motion_ends)
		return;
	outcome->aborted = true;
	outcome->aborted_id = outcome->motion_id;
}

void db_outcome_ask_motion(struct db_outcome *outcome)
{
	outcome->done = outcome->aborted = false;
	outcome->motion_refused = false;
}

void db_outcome_refuse_motion(struct db_outcome *outcome)
{
	outcome->done = outcome->aborted = false;
	outcome->motion_refused = true;
}

void db_outcome_begin_motion(struct db_outcome *outcome, uint16_t id, bool ends, bool cancelled)
{
	outcome->motion_id = id;
	outcome->motion_ends = ends;
	outcome->motion_result = DB_RESULT_PENDING;
	outcome->motion_refused = false;
	if (cancelled)
		abort_motion(outcome);
}

void db_outcome_cancel_motion(struct db_outcome *outcome)
{
	if (outcome->motion_result == DB_RESULT_PENDING)
		abort_motion(outcome);
}

void db_writers_cancel_motion(struct db_writers *writers)
{
	for (size_t i = 0; i < count_of(writers); i++)
		db_outcome_cancel_motion(&first_of(writers)[i].shown);
}

void db_outcome_end_motion(struct db_outcome *outcome, uint32_t ticket, enum db_result result)
{
	if (outcome->motion_result != DB_RESULT_PENDING)
		return;
	outcome->motion_result = (uint16_t)result;
	outcome->done = result == DB_RESULT_OK && !outcome->motion_refused;
	if (outcome->ticket == ticket)
		outcome->result = (uint16_t)result;
}

void db_writers_end_motion(struct db_writers *writers, uint32_t ticket, enum db_result result)
{
	for (size_t i = 0; i < count_of(writers); i++)
		db_outcome_end_motion(&first_of(writers)[i].shown, ticket, result);
}
