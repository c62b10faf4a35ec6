/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include <stdlib.h>
#include <string.h>

/* --- writers ---------------------------------------------------------------------------------- */

void db_writers_set(struct db_writers *writers, bool by_address)
{
	writers->by_address = by_address;
	writers->all = (struct db_writer){ .taken = false };
	if (!by_address) {
		free(writers->each);
		writers->each = NULL;
	}
	for (size_t i = 0; writers->each && i < DB_WRITERS; i++)
		writers->each[i] = writers->all;
}

/* What is remembered of writers: a record for each client address, or one for all. */
struct records {
	struct db_writer *list;
	size_t count;
};

static struct records records_of(struct db_writers *writers)
{
	if (writers->by_address)
		return (struct records){ .list = writers->each, .count = DB_WRITERS };
	return (struct records){ .list = &writers->all, .count = 1 };
}

/* All outcomes, from 0 to records.count: the latest of all writers, then each writer's own. */
static struct db_outcome *outcome_at(struct db_writers *writers, struct records records, size_t i)
{
	return i == 0 ? &writers->latest : &records.list[i - 1].own;
}

/* The outcomes that a request of this writer (null: none) changes: the latest of all writers, then
 * its own. `before` is null, or the one that was returned last; null: no more. */
static struct db_outcome *next_outcome(struct db_writers *writers, struct db_writer *writer,
                                       const struct db_outcome *before)
{
	if (!before)
		return &writers->latest;
	return before == &writers->latest && writer ? &writer->own : NULL;
}

struct db_writer *db_writers_find(struct db_writers *writers, const struct db_client *client)
{
	if (!writers->by_address)
		return &writers->all;
	for (size_t i = 0; client && i < DB_WRITERS; i++) {
		struct db_writer *writer = &writers->each[i];

		if (writer->taken && db_client_same(writer->address, client->address))
			return writer;
	}
	return NULL;
}

struct db_writer *db_writers_claim(struct db_writers *writers, const struct db_client *client,
                                   db_time now)
{
	struct db_writer *writer = db_writers_find(writers, client);

	if (writer || !client)
		return writer;
	/* A free place, or that of the writer that was silent longest. */
	writer = &writers->each[0];
	for (size_t i = 0; i < DB_WRITERS; i++) {
		if (!writers->each[i].taken) {
			writer = &writers->each[i];
			break;
		}
		if (writers->each[i].heard < writer->heard)
			writer = &writers->each[i];
	}
	*writer = (struct db_writer){ .taken = true, .heard = now };
	memcpy(writer->address, client->address, sizeof(writer->address));
	return writer;
}

/* --- tickets ---------------------------------------------------------------------------------- */

static void replace_ticket(uint32_t *kept, uint32_t ticket, uint32_t to)
{
	if (*kept == ticket)
		*kept = to;
}

void db_writers_retarget(struct db_writers *writers, uint32_t ticket, uint32_t to)
{
	struct records records = records_of(writers);

	for (size_t i = 0; i <= records.count; i++) {
		struct db_outcome *outcome = outcome_at(writers, records, i);

		replace_ticket(&outcome->ticket, ticket, to);
		replace_ticket(&outcome->write_ticket, ticket, to);
	}
	for (size_t i = 0; i < records.count; i++) {
		struct db_writer *writer = &records.list[i];

		replace_ticket(&writer->last.ticket, ticket, to);
		replace_ticket(&writer->previous.ticket, ticket, to);
		replace_ticket(&writer->execution.ticket, ticket, to);
	}
}

/* --- commands and writes ---------------------------------------------------------------------- */

void db_writers_set_write(struct db_writers *writers, struct db_writer *writer,
                          enum db_result result, uint16_t refused_register, uint32_t ticket)
{
	struct db_outcome *outcome = NULL;

	while ((outcome = next_outcome(writers, writer, outcome))) {
		outcome->results.write_result = (uint16_t)result;
		outcome->results.write_register = refused_register;
		outcome->write_ticket = ticket;
	}
}

static struct db_used_id used_id(const struct db_request *request, enum db_result result,
                                 uint32_t ticket)
{
	return (struct db_used_id){
		.id = request->id,
		.result = result,
		.sent = ticket != 0,
		.ticket = ticket,
	};
}

void db_writers_set_command(struct db_writers *writers, struct db_writer *writer,
                            const struct db_request *request, enum db_result result,
                            uint32_t ticket)
{
	struct db_outcome *outcome = NULL;

	db_writers_set_write(writers, writer, result, 0, ticket);
	while ((outcome = next_outcome(writers, writer, outcome))) {
		outcome->results.result_id = request->id;
		outcome->results.result_command = (uint16_t)request->command;
		outcome->results.result = (uint16_t)result;
		outcome->ticket = ticket;
	}
	if (!writer)
		return;
	writer->commanded = true;
	if (request->id == 0 || result == DB_RESULT_BUSY)
		return;
	/* A stop repeated with its own id does not make an older id new again. */
	if (request->id != writer->last.id)
		writer->previous = writer->last;
	writer->last = used_id(request, result, ticket);
}

void db_writers_set_limit(struct db_writers *writers, struct db_writer *writer, enum db_limit limit)
{
	struct db_outcome *outcome = NULL;

	while ((outcome = next_outcome(writers, writer, outcome)))
		outcome->results.result_limit = (uint16_t)limit;
}

void db_writer_set_executed(struct db_writer *writer, const struct db_request *request,
                            enum db_result result, uint32_t ticket)
{
	/* Only of the command block something is repeated by a write of `command` alone. */
	if (!writer || !request->by_block)
		return;
	writer->has_executed = true;
	writer->executed_command = (uint16_t)request->command;
	writer->executed_args = *request->args;
	writer->execution = used_id(request, result, ticket);
}

void db_writers_complete(struct db_writers *writers, uint32_t ticket, enum db_result result,
                         uint32_t took_us)
{
	struct records records = records_of(writers);

	for (size_t i = 0; i <= records.count; i++) {
		struct db_outcome *outcome = outcome_at(writers, records, i);

		if (outcome->ticket == ticket) {
			outcome->results.result = (uint16_t)result;
			outcome->results.result_time_us = took_us;
		}
		if (outcome->write_ticket == ticket)
			outcome->results.write_result = (uint16_t)result;
	}
	for (size_t i = 0; i < records.count; i++) {
		struct db_writer *writer = &records.list[i];

		if (writer->previous.ticket == ticket)
			writer->previous.result = result;
		if (writer->last.ticket == ticket) {
			writer->last.result = result;
			/* The bus refused it after all: the id counts as never seen. */
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

/* --- motions ---------------------------------------------------------------------------------- */

void db_outcome_ask_motion(struct db_outcome *outcome)
{
	outcome->results.done = outcome->results.aborted = false;
	outcome->motion_refused = false;
}

void db_writers_ask_motion(struct db_writers *writers, struct db_writer *writer)
{
	struct db_outcome *outcome = NULL;

	while ((outcome = next_outcome(writers, writer, outcome)))
		db_outcome_ask_motion(outcome);
}

void db_writers_refuse_motion(struct db_writers *writers, struct db_writer *writer, uint32_t number)
{
	struct db_outcome *outcome = NULL;

	while ((outcome = next_outcome(writers, writer, outcome))) {
		db_outcome_ask_motion(outcome);
		outcome->motion_refused = true;
		outcome->refused_number = number;
	}
}

static void abort_motion(struct db_outcome *outcome)
{
	outcome->results.motion_result = DB_RESULT_CANCELLED;
	if (!outcome->motion_ends)
		return;
	outcome->results.aborted = true;
	outcome->results.aborted_id = outcome->results.motion_id;
}

void db_writers_begin_motion(struct db_writers *writers, struct db_writer *writer,
                             const struct db_request *request, bool ends, bool cancelled)
{
	struct db_outcome *outcome = NULL;

	while ((outcome = next_outcome(writers, writer, outcome))) {
		outcome->results.motion_id = request->id;
		outcome->results.motion_result = DB_RESULT_PENDING;
		outcome->motion_ends = ends;
		/* One that was requested before it says nothing about it; numbers come round. */
		if (request->number - outcome->refused_number < UINT32_MAX / 2)
			outcome->motion_refused = false;
		if (cancelled)
			abort_motion(outcome);
	}
}

void db_writers_cancel_motion(struct db_writers *writers)
{
	struct records records = records_of(writers);

	writers->latest.results.done = writers->latest.results.aborted = false;
	for (size_t i = 0; i <= records.count; i++) {
		struct db_outcome *outcome = outcome_at(writers, records, i);

		if (outcome->results.motion_result == DB_RESULT_PENDING)
			abort_motion(outcome);
	}
}

void db_writers_end_motion(struct db_writers *writers, uint32_t ticket, enum db_result result,
                           bool corrected)
{
	struct records records = records_of(writers);

	for (size_t i = 0; i <= records.count; i++) {
		struct db_outcome *outcome = outcome_at(writers, records, i);
		struct db_command_results *results = &outcome->results;

		if (!corrected)
			outcome->motion_last = results->motion_result == DB_RESULT_PENDING;
		if (!outcome->motion_last)
			continue;
		results->motion_result = (uint16_t)result;
		results->done = result == DB_RESULT_OK && !outcome->motion_refused;
		if (outcome->ticket == ticket)
			results->result = (uint16_t)result;
	}
}

/* --- history, audit trail and log ------------------------------------------------------------- */

static uint32_t write_record(const struct db_commander *commander,
                             const struct db_recorded *recorded)
{
	return commander->ops->record ? commander->ops->record(commander->context, recorded) : 0;
}

void db_outcome_record(struct db_commander *commander, const struct db_request *request,
                       enum db_result result, struct db_request *pending)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_history_entry entry = {
		.timestamp_us = commander->ops->wall_us(commander->context),
		.port = request->client.port,
		.command_id = request->id,
		.command = (uint16_t)request->command,
		.result = (uint16_t)result,
	};
	struct db_noted noted = { 0 };

	memcpy(entry.address, request->client.address, sizeof(entry.address));
	if (request->command != DB_CMD_NONE) {
		db_history_args(&entry, request->command, request->args);
	} else {
		uint16_t param = request->settings[0].param;
		/* The history can be read by everybody with read access. */
		bool secret = param < driver->param_count &&
		              (driver->params[param].traits & DB_PARAM_SECRET);

		entry.number = param;
		entry.value = secret ? 0 : request->settings[0].value.u;
	}
	noted.entry = db_history_add(&commander->history, &entry, pending != NULL);
	noted.record = write_record(commander, &(struct db_recorded){
						       .request = request,
						       .result = result,
					       });
	if (pending)
		pending->noted = noted;
}

void db_outcome_end(struct db_commander *commander, struct db_noted noted, enum db_result result,
                    db_time took)
{
	db_history_end(&commander->history, noted.entry, result, took);
	if (noted.record != 0 && commander->ops->record_end)
		commander->ops->record_end(commander->context, noted.record, result, took);
}

void db_outcome_join(struct db_commander *commander, const struct db_request *request,
                     const struct db_request *stop)
{
	db_history_repeat(&commander->history, stop->noted.entry);
	(void)write_record(commander, &(struct db_recorded){
					      .request = request,
					      .result = DB_RESULT_PENDING,
					      .joined = stop->noted.record,
				      });
}

void db_outcome_log(const struct db_commander *commander, const struct db_client *client,
                    const struct db_refused_write *write)
{
	switch (write->result) {
	case DB_RESULT_NONE:
	case DB_RESULT_OK:
	case DB_RESULT_UNPROVEN:
	case DB_RESULT_PENDING:
	/* Already reported elsewhere. */
	case DB_RESULT_CANCELLED:
	case DB_RESULT_NOT_IN_CONTROL:
	case DB_RESULT_RUNS_ON:
		return;
	default:
		if (commander->ops->refused)
			commander->ops->refused(commander->context, client, write);
	}
}

/* --- parameter writes without proof ----------------------------------------------------------- */

/* Interval at which the drive's parameters are checked while a write is to be settled. */
#define LOOK_EVERY (500 * DB_NS_PER_MS)

static void forget_write(struct db_settle *settle, uint32_t ticket)
{
	for (size_t i = 0; i < settle->count; i++) {
		if (settle->places[i].ticket == ticket)
			settle->places[i].ticket = 0;
	}
}

void db_settle_submitted(struct db_commander *commander, const struct db_request *request)
{
	const struct db_setting *settings = request->settings;
	struct db_settle *settle = &commander->settle;
	size_t count = request->setting_count;

	for (size_t i = 0; i < count; i++) {
		for (size_t j = 0; j < settle->count; j++) {
			const struct db_unsettled *older = &settle->places[j];

			if (older->ticket != 0 && older->ticket != request->ticket &&
			    older->param == settings[i].param)
				forget_write(settle, older->ticket);
		}
	}
	/* A part of the write proves nothing about the whole. */
	if (count > settle->count)
		return;
	for (size_t i = 0; i < count; i++) {
		struct db_unsettled *place = &settle->places[settle->next];

		if (place->ticket != 0)
			forget_write(settle, place->ticket);
		settle->next = (settle->next + 1) % settle->count;
		*place = (struct db_unsettled){
			.ticket = request->ticket,
			.arrived = request->submitted,
			.since = DB_TIME_NEVER,
			.param = settings[i].param,
			.written = settings[i].value,
		};
	}
}

void db_settle_ended(struct db_commander *commander, const struct db_request *request, db_time end)
{
	struct db_settle *settle = &commander->settle;

	if (request->result != DB_RESULT_UNPROVEN) {
		forget_write(settle, request->ticket);
		return;
	}
	for (size_t i = 0; i < settle->count; i++) {
		struct db_unsettled *place = &settle->places[i];

		if (place->ticket != request->ticket)
			continue;
		place->noted = request->noted;
		place->since = end;
		settle->check_at = end + LOOK_EVERY;
	}
}

/* Judges all parameters of the write: PENDING while one of them was not reported since. */
static enum db_result judge_write(const struct db_commander *commander, uint32_t ticket,
                                  const struct db_nameplate *plate,
                                  const struct db_unsettled **other)
{
	const struct db_driver *driver = commander->config.driver;
	const struct db_settle *settle = &commander->settle;
	enum db_result result = DB_RESULT_OK;

	for (size_t i = 0; i < settle->count; i++) {
		const struct db_unsettled *place = &settle->places[i];
		unsigned param = place->param;

		if (place->ticket != ticket)
			continue;
		if (!(db_params_have(plate->valid, param)) ||
		    !db_told_after(plate->told[param], db_told_at(place->since)))
			return DB_RESULT_PENDING;
		if (!driver->holds(param, plate->values[param], place->written)) {
			*other = place;
			result = DB_RESULT_REFUSED;
		}
	}
	return result;
}

void db_settle_check(struct db_commander *commander, db_time now)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_settle *settle = &commander->settle;
	struct db_nameplate_copy copy;
	const struct db_nameplate *plate = &copy.plate;

	if (settle->check_at > now)
		return;
	settle->check_at = DB_TIME_NEVER;
	db_axis_read_nameplate(commander->config.axis, &copy);
	for (size_t i = 0; i < settle->count; i++) {
		struct db_unsettled write = settle->places[i];
		const struct db_unsettled *other = NULL;
		enum db_result result;

		if (write.ticket == 0 || write.since == DB_TIME_NEVER)
			continue;
		result = judge_write(commander, write.ticket, plate, &other);
		if (result == DB_RESULT_PENDING) {
			settle->check_at = now + LOOK_EVERY;
			continue;
		}
		db_writers_complete(&commander->writers, write.ticket, result,
		                    db_time_us32(now - write.arrived));
		db_outcome_end(commander, write.noted, result, now - write.arrived);
		if (other)
			db_outcome_log(
				commander, NULL,
				&(struct db_refused_write){
					.param = driver->params[other->param].name,
					.holds_other = true,
					.held = db_value_number(driver->params[other->param].type,
			                                        plate->values[other->param]),
					.result = result,
				});
		forget_write(settle, write.ticket);
	}
}
