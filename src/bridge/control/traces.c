/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "codec/can.h"
#include "codec/description.h"
#include "control/values.h"
#include "drivebridge/clock.h"
#include "drivebridge/trace_keeper.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Interval at which a bus is checked, and the most that is sent of it at once: Modbus has its turn
 * in between. */
#define LOOK_INTERVAL (20 * DB_NS_PER_MS)
#define RECORDS_AT_ONCE 32

/* What a session reads: the current trace of a bus, or a kept one. */
struct tracing {
	char bus[DB_TRACE_NAME_MAX + 1];
	uint32_t number; /* number of the bus; it changes when a reload replaces the bus */
	uint32_t kept;   /* 0: none, the current trace */
	struct db_trace_place place;
	struct db_trace_record record; /* a member because it is large */
	struct db_description description;
};

static json_int_t wall_us(db_time time, int64_t offset)
{
	return (json_int_t)((time + offset) / DB_NS_PER_US);
}

static const struct db_trace_kept *find_kept(const struct db_control_socket *control,
                                             uint32_t number)
{
	const struct db_trace_kept *kept;

	for (size_t i = 0; (kept = db_trace_keeper_at(control->setup.traces, i)) != NULL; i++) {
		if (kept->number == number)
			return kept;
	}
	return NULL;
}

/* --- records ---------------------------------------------------------------------------------- */

/* The drive of a frame, if it is only one; null. */
static const char *find_drive(const struct db_registers *registers, const char *bus,
                              const struct db_description *description)
{
	const char *found = NULL;

	for (size_t i = 0; i < db_named_drive_count(registers); i++) {
		struct db_named_drive drive;

		if (!db_named_drive_at(registers, i, &drive) || strcmp(drive.bus->name, bus) != 0 ||
		    (int)drive.config->address != description->address ||
		    (description->axis >= 0 && (int)drive.config->axis != description->axis))
			continue;
		if (found)
			return NULL;
		found = drive.config->name;
	}
	return found;
}

static json_t *write_hex(const uint8_t *bytes, size_t length)
{
	static const char digits[] = "0123456789ABCDEF";
	char text[2 * DB_TRACE_BYTES_MAX];

	for (size_t i = 0; i < length; i++) {
		text[2 * i] = digits[bytes[i] >> 4];
		text[2 * i + 1] = digits[bytes[i] & 0x0F];
	}
	return json_stringn(text, 2 * length);
}

static void add_frame(json_t *object, const struct db_registers *registers,
                      const struct db_bus_config *bus, struct tracing *tracing)
{
	const struct db_trace_record *record = &tracing->record;
	struct db_description *description = &tracing->description;
	const char *drive;

	db_description_begin(description);
	if (record->kind != DB_TRACE_GARBAGE && bus->driver->describe)
		bus->driver->describe(bus, db_trace_is_sent(record->kind), record->bytes,
		                      record->length, description);
	if (!description->secret) {
		struct db_can_frame frame;

		if (!(bus->driver->medium == DB_MEDIUM_CAN) || record->length != sizeof(frame)) {
			json_object_set_new(object, "data",
			                    write_hex(record->bytes, record->length));
		} else {
			memcpy(&frame, record->bytes, sizeof(frame));
			json_object_set_new(object, "id", json_integer((json_int_t)frame.id));
			json_object_set_new(object, "data",
			                    write_hex(frame.data, frame.length <= DB_CAN_DATA_MAX ?
			                                                  frame.length :
			                                                  DB_CAN_DATA_MAX));
		}
	}
	json_object_set_new(object, "words", db_values_text(description->text));
	if (description->address == DB_DESCRIBED_NOBODY)
		return;
	json_object_set_new(object, "address", json_integer(description->address));
	drive = find_drive(registers, bus->name, description);
	if (drive)
		json_object_set_new(object, "drive", json_string(drive));
}

static json_t *describe_record(const struct db_registers *registers,
                               const struct db_bus_config *bus, struct tracing *tracing,
                               int64_t offset)
{
	const struct db_trace_record *record = &tracing->record;
	bool sent = db_trace_is_sent(record->kind);
	bool received = db_trace_is_received(record->kind);
	json_t *object = json_pack("{s:I, s:I, s:s, s:s}", "number", (json_int_t)record->number,
	                           "time_us", wall_us(record->time, offset), "kind",
	                           db_trace_kind_name(record->kind), "direction",
	                           sent     ? "sent" :
	                           received ? "received" :
	                                      "none");

	if (record->question != 0)
		json_object_set_new(object, "question", json_integer(record->question));
	if (record->kind == DB_TRACE_EVENT) {
		char drive[DB_TRACE_NAME_MAX + 1];
		enum db_event event = db_trace_event_of(record, drive);

		json_object_set_new(
			object, "words",
			json_string(event < DB_EVENT_COUNT ? db_event_name(event) : ""));
		if (drive[0] != '\0')
			json_object_set_new(object, "drive", db_values_text(drive));
	} else if (sent || received)
		add_frame(object, registers, bus, tracing);
	else
		json_object_set_new(object, "words", json_string(""));
	return object;
}

/* --- Trace ------------------------------------------------------------------------------------ */

static void fail_bus(struct db_session *session, const char *bus)
{
	db_session_fail(session, "io.drivebridge.Control.NoSuchBus",
	                json_pack("{s:s}", "bus", bus));
}

static void fail_kept(struct db_session *session, uint32_t number)
{
	db_session_fail(session, "io.drivebridge.Control.NoSuchTrace",
	                json_pack("{s:I}", "number", (json_int_t)number));
}

void db_traces_follow(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_control_socket *control = session->control;
	const struct db_trace_kept *found;
	const struct db_trace *trace;
	struct tracing *tracing;
	bool past = false;
	int64_t kept = 0;
	bool given;
	const char *bus;

	if (!db_call_text(call, "bus", &bus) || !db_call_optional_flag(call, "past", &past) ||
	    !db_call_optional_number(call, "kept", 1, UINT32_MAX, &kept, &given))
		return;
	tracing = calloc(1, sizeof(*tracing));
	if (!tracing) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	session->job = tracing;
	tracing->kept = (uint32_t)kept;
	trace = control->setup.ops->trace(control->setup.context, bus, &tracing->number);
	if (!trace || strlen(bus) > DB_TRACE_NAME_MAX) {
		fail_bus(session, bus);
		return;
	}
	found = kept > 0 ? find_kept(control, tracing->kept) : NULL;
	if (kept > 0 && (!found || strcmp(found->bus, bus) != 0)) {
		fail_kept(session, tracing->kept);
		return;
	}
	strcpy(tracing->bus, bus);
	if (kept == 0 && !past)
		tracing->place = db_trace_end(trace);
	session->wait = DB_WAITS_FOR_TRACE;
	session->due = db_control_now(control);
}

/* The trace that it reads; null when it no longer exists; the call was answered then. */
static const struct db_trace *find_trace(struct db_session *session, struct tracing *tracing,
                                         int64_t *offset)
{
	struct db_control_socket *control = session->control;
	const struct db_trace_kept *kept = find_kept(control, tracing->kept);
	uint32_t before = tracing->number;
	const struct db_trace *trace;

	if (kept) {
		*offset = kept->wall_offset;
		return kept->trace;
	}
	if (tracing->kept > 0) {
		fail_kept(session, tracing->kept);
		return NULL;
	}
	/* The offset from CLOCK_MONOTONIC to wall time now, ns. */
	*offset = db_clock_read(CLOCK_REALTIME) - db_clock_now();
	trace = control->setup.ops->trace(control->setup.context, tracing->bus, &tracing->number);
	if (!trace)
		fail_bus(session, tracing->bus);
	else if (tracing->number != before)
		tracing->place = (struct db_trace_place){ .at = 0 };
	return trace;
}

void db_traces_look(struct db_session *session, db_time now)
{
	const struct db_registers *registers = session->control->setup.registers;
	struct tracing *tracing = session->job;
	const struct db_bus_config *bus;
	const struct db_trace *trace;
	json_int_t missed = 0;
	int64_t offset;
	json_t *records;
	bool full = false;

	session->due = now + LOOK_INTERVAL;
	/* A slow reader gets the rest later, as far as the ring still has it. */
	if (session->out)
		return;
	trace = find_trace(session, tracing, &offset);
	if (!trace)
		return;
	for (size_t i = 0; (bus = db_named_bus(registers, i)) != NULL; i++) {
		if (strcmp(bus->name, tracing->bus) == 0)
			break;
	}
	if (!bus) {
		fail_bus(session, tracing->bus);
		return;
	}
	records = json_array();
	while (!full) {
		struct db_trace_place place = tracing->place;
		uint32_t lost;

		if (!db_trace_read(trace, &tracing->place, &tracing->record, &lost))
			break;
		/* Lost records are reported only before the first record of an answer. */
		if (lost > 0 && json_array_size(records) > 0) {
			tracing->place = place;
			full = true;
			break;
		}
		missed += lost;
		json_array_append_new(records, describe_record(registers, bus, tracing, offset));
		full = json_array_size(records) == RECORDS_AT_ONCE;
	}
	if (json_array_size(records) == 0 && tracing->kept == 0) {
		json_decref(records);
		return;
	}
	if (full)
		session->due = now;
	session->control->stats.skipped += (uint64_t)missed;
	db_session_reply(session, json_pack("{s:o, s:I}", "records", records, "missed", missed),
	                 full || tracing->kept == 0);
}

/* --- Traces ----------------------------------------------------------------------------------- */

void db_traces_list(const struct db_call *call)
{
	struct db_control_socket *control = call->session->control;
	const struct db_trace_kept *kept;
	json_t *list = json_array();

	for (size_t i = 0; (kept = db_trace_keeper_at(control->setup.traces, i)) != NULL; i++) {
		json_t *one = json_pack("{s:I, s:s, s:I, s:s}", "number", (json_int_t)kept->number,
		                        "bus", kept->bus, "time_us",
		                        wall_us(kept->cause.time, kept->wall_offset), "event",
		                        db_event_name(kept->cause.event));

		if (kept->cause.drive[0] != '\0')
			json_object_set_new(one, "drive", db_values_text(kept->cause.drive));
		json_array_append_new(list, one);
	}
	db_session_reply(call->session, json_pack("{s:o}", "kept", list), false);
}
