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
static struct db_writer *find_place(struct db_writers *writers)
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
	writer = find_place(writers);
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

const struct db_command_results *db_writers_results(struct db_writers *writers,
                                                    const struct db_client *client)
{
	const struct db_writer *writer = db_writers_find(writers, client);

	return writers->by_address && writer && writer->commanded ? &writer->own.results :
	                                                            &writers->latest.results;
}

/* --- tickets --------------------------------------------------------------------------------------- */

static void replace_ticket(uint32_t *kept, uint32_t ticket, uint32_t to)
{
	if (*kept == ticket)
		*kept = to;
}

void db_writers_retarget(struct db_writers *writers, uint32_t ticket, uint32_t to)
{
	replace_ticket(&writers->latest.ticket, ticket, to);
	replace_ticket(&writers->latest.write_ticket, ticket, to);
	for (size_t i = 0; i < count_of(writers); i++) {
		struct db_writer *writer = first_of(writers) + i;

		replace_ticket(&writer->last.ticket, ticket, to);
		replace_ticket(&writer->previous.ticket, ticket, to);
		replace_ticket(&writer->execution.ticket, ticket, to);
		replace_ticket(&writer->own.ticket, ticket, to);
		replace_ticket(&writer->own.write_ticket, ticket, to);
	}
}

void db_writers_retire(struct db_writers *writers, uint32_t ticket)
{
	db_writers_retarget(writers, ticket, 0);
}

/* --- commands and writes ----------------------------------------------------------------------------- */

static void set_write(struct db_outcome *outcome, enum db_result result, uint16_t refused_register,
                      uint32_t ticket)
{
	outcome->results.write_result = (uint16_t)result;
	outcome->results.write_register = refused_register;
	outcome->write_ticket = ticket;
}

void db_writers_set_write(struct db_writers *writers, struct db_writer *writer,
                          enum db_result result, uint16_t refused_register, uint32_t ticket)
{
	set_write(&writers->latest, result, refused_register, ticket);
	if (writer)
		set_write(&writer->own, result, refused_register, ticket);
}

static void set_command(struct db_outcome *outcome, uint16_t id, uint16_t command,
                        enum db_result result, uint32_t ticket)
{
	outcome->results.result_id = id;
	outcome->results.result_command = command;
	outcome->results.result = (uint16_t)result;
	outcome->ticket = ticket;
	set_write(outcome, result, 0, ticket);
}

void db_writers_set_command(struct db_writers *writers, struct db_writer *writer, uint16_t id,
                            uint16_t command, enum db_result result, uint32_t ticket)
{
	set_command(&writers->latest, id, command, result, ticket);
	if (!writer)
		return;
	set_command(&writer->own, id, command, result, ticket);
	writer->commanded = true;
	if (id == 0 || result == DB_RESULT_BUSY)
		return;
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

void db_writers_set_limit(struct db_writers *writers, struct db_writer *writer, enum db_limit limit)
{
	writers->latest.results.result_limit = (uint16_t)limit;
	if (writer)
		writer->own.results.result_limit = (uint16_t)limit;
}

void db_writer_set_executed(struct db_writer *writer, const struct db_command_block *block,
                            uint16_t id, enum db_result result, uint32_t ticket)
{
	writer->has_executed = true;
	writer->executed = *block;
	writer->execution = (struct db_used_id){
		.id = id,
		.result = result,
		.sent = ticket != 0,
		.ticket = ticket,
	};
}

static void complete_outcome(struct db_outcome *outcome, uint32_t ticket, enum db_result result,
                             uint32_t took_us)
{
	if (outcome->ticket == ticket) {
		outcome->results.result = (uint16_t)result;
		outcome->results.result_time_us = took_us;
	}
	if (outcome->write_ticket == ticket)
		outcome->results.write_result = (uint16_t)result;
}

void db_writers_complete(struct db_writers *writers, uint32_t ticket, enum db_result result,
                         uint32_t took_us)
{
	complete_outcome(&writers->latest, ticket, result, took_us);
	for (size_t i = 0; i < count_of(writers); i++) {
		struct db_writer *writer = first_of(writers) + i;

		complete_outcome(&writer->own, ticket, result, took_us);
		if (writer->previous.ticket == ticket)
			writer->previous.result = result;
		if (writer->last.ticket == ticket) {
			writer->last.result = result;
			/* The bus turned it away after all: the id is as good as never seen. */
			if (result == DB_RESULT_BUSY) {
				writer->last = writer->previous;
				writer->previous = (struct db_used_id){ 0 };
			}
		}
		if (writer->execution.ticket == ticket) {
			writer->execution.result = result;
			writer->has_executed = result != DB_RESULT_BUSY;
		}
	}
}

/* --- motions ----------------------------------------------------------------------------------------- */

static void ask_motion(struct db_outcome *outcome, bool refused)
{
	outcome->results.done = outcome->results.aborted = false;
	outcome->motion_refused = refused;
}

void db_writers_ask_motion(struct db_writers *writers, struct db_writer *writer)
{
	ask_motion(&writers->latest, false);
	if (writer)
		ask_motion(&writer->own, false);
}

void db_writer_ask_motion(struct db_writer *writer)
{
	ask_motion(&writer->own, false);
}

void db_writers_refuse_motion(struct db_writers *writers, struct db_writer *writer)
{
	ask_motion(&writers->latest, true);
	if (writer)
		ask_motion(&writer->own, true);
}

static void abort_motion(struct db_outcome *outcome)
{
	outcome->results.motion_result = DB_RESULT_CANCELLED;
	if (!outcome->motion_ends)
		return;
	outcome->results.aborted = true;
	outcome->results.aborted_id = outcome->results.motion_id;
}

static void begin_motion(struct db_outcome *outcome, uint16_t id, bool ends, bool cancelled)
{
	outcome->results.motion_id = id;
	outcome->results.motion_result = DB_RESULT_PENDING;
	outcome->motion_ends = ends;
	outcome->motion_refused = false;
	if (cancelled)
		abort_motion(outcome);
}

void db_writers_begin_motion(struct db_writers *writers, struct db_writer *writer, uint16_t id,
                             bool ends, bool cancelled)
{
	begin_motion(&writers->latest, id, ends, cancelled);
	if (writer)
		begin_motion(&writer->own, id, ends, cancelled);
}

void db_writers_cancel_motion(struct db_writers *writers)
{
	struct db_outcome *latest = &writers->latest;

	latest->results.done = latest->results.aborted = false;
	if (latest->results.motion_result == DB_RESULT_PENDING)
		abort_motion(latest);
	for (size_t i = 0; i < count_of(writers); i++) {
		struct db_outcome *own = &first_of(writers)[i].own;

		if (own->results.motion_result == DB_RESULT_PENDING)
			abort_motion(own);
	}
}

static void end_motion(struct db_outcome *outcome, uint32_t ticket, enum db_result result)
{
	if (outcome->results.motion_result != DB_RESULT_PENDING)
		return;
	outcome->results.motion_result = (uint16_t)result;
	outcome->results.done = result == DB_RESULT_OK && !outcome->motion_refused;
	if (outcome->ticket == ticket)
		outcome->results.result = (uint16_t)result;
}

void db_writers_end_motion(struct db_writers *writers, uint32_t ticket, enum db_result result)
{
	end_motion(&writers->latest, ticket, result);
	for (size_t i = 0; i < count_of(writers); i++)
		end_motion(&first_of(writers)[i].own, ticket, result);
}
