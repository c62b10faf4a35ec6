/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/can_bus.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GARBAGE_ID 0x7F0u /* an id that no station uses */

/* Bits of an error frame and of the wait after it. */
#define ERROR_BITS 23u

size_t sim_can_text(const struct db_can_frame *frame, char text[SIM_CAN_TEXT_MAX])
{
	bool extended = frame->id & DB_CAN_EXTENDED;
	int length = snprintf(text, SIM_CAN_TEXT_MAX, extended ? "%08X#" : "%03X#",
	                      frame->id & DB_CAN_ID_MASK);

	for (unsigned i = 0; i < frame->length; i++)
		length += snprintf(text + length, SIM_CAN_TEXT_MAX - (size_t)length, "%02X",
		                   frame->data[i]);
	return (size_t)length;
}

struct sim_can_bus *sim_can_bus_new(unsigned bitrate, sim_can_trace_fn *trace, void *context)
{
	struct sim_can_bus *bus = calloc(1, sizeof(*bus));

	if (!bus)
		return NULL;
	bus->bitrate = bitrate;
	bus->trace = trace;
	bus->context = context;
	return bus;
}

bool sim_can_bus_attach(struct sim_can_bus *bus, const struct sim_can_station *station)
{
	if (bus->station_count == SIM_CAN_STATIONS_MAX)
		return false;
	bus->stations[bus->station_count++].ops = *station;
	return true;
}

void sim_can_bus_cut(struct sim_can_bus *bus, bool cut)
{
	bus->cut = cut;
	if (cut)
		bus->host_count = bus->to_host_count = 0;
}

bool sim_can_bus_put(struct sim_can_bus *bus, const struct db_can_frame *frame, db_time now)
{
	struct sim_can_waiting *place;

	if (bus->cut || bus->host_count == SIM_CAN_HOST_QUEUE) {
		bus->stats.overflows++;
		return false;
	}
	place = &bus->host[(bus->host_first + bus->host_count++) % SIM_CAN_HOST_QUEUE];
	*place = (struct sim_can_waiting){ .frame = *frame, .ready = now };
	return true;
}

static bool take_fault(struct sim_can_bus *bus, const struct sim_can_place *station,
                       enum sim_fault fault)
{
	return sim_faults_take(station->ops.faults, fault) || sim_faults_take(&bus->faults, fault);
}

static bool is_silent(const struct sim_can_bus *bus, const struct sim_can_place *station)
{
	return station->ops.faults->left[SIM_FAULT_SILENCE] != 0 ||
	       bus->faults.left[SIM_FAULT_SILENCE] != 0;
}

/* --- frames of drives ------------------------------------------------------------------------- */

/* Takes the next due frame from a drive's own queue, with the faults of its connection and of the
 * bus. */
static void fetch_frame(struct sim_can_bus *bus, struct sim_can_place *station, db_time now)
{
	struct sim_faults *own = station->ops.faults;

	while (!station->has_frame && station->ops.next(station->ops.self) <= now) {
		db_time ready = station->ops.next(station->ops.self);
		struct db_can_frame frame;

		if (!station->ops.send(station->ops.self, now, &frame))
			return;
		if (is_silent(bus, station) || take_fault(bus, station, SIM_FAULT_DROP))
			continue;
		if (take_fault(bus, station, SIM_FAULT_TRUNCATE))
			frame.length /= 2;
		if (take_fault(bus, station, SIM_FAULT_WRONG_ID)) {
			/* Changes the sender to another drive. */
			if (station->ops.sender_bit)
				frame.id ^= station->ops.sender_bit;
			else
				frame.id ^= frame.id & DB_CAN_EXTENDED ? 1u << 10 : 1u << 1;
		}
		/* Frames after a late answer wait for it. */
		if (sim_faults_take(own, SIM_FAULT_DELAY))
			ready += (db_time)own->delay_ms * DB_NS_PER_MS;
		else if (sim_faults_take(&bus->faults, SIM_FAULT_DELAY))
			ready += (db_time)bus->faults.delay_ms * DB_NS_PER_MS;
		station->frame = frame;
		station->ready = ready;
		station->has_frame = true;
	}
}

/* --- arbitration ------------------------------------------------------------------------------ */

/* A lower rank goes first: the eleven high bits, then standard before extended, then the rest. */
static uint64_t rank_of(const struct db_can_frame *frame)
{
	bool extended = frame->id & DB_CAN_EXTENDED;
	uint64_t id = frame->id & DB_CAN_ID_MASK;

	return extended ? (id >> 18) << 20 | 1u << 19 | (id & 0x3FFFF) : id << 20;
}

/* When the next frame can start: the wire is free and a station is ready. */
static db_time start_time(const struct sim_can_bus *bus)
{
	db_time ready = DB_TIME_NEVER;

	if (bus->host_count > 0)
		ready = bus->host[bus->host_first].ready;
	for (size_t i = 0; i < bus->station_count; i++) {
		if (bus->stations[i].has_frame && bus->stations[i].ready < ready)
			ready = bus->stations[i].ready;
	}
	return ready < bus->wire_end ? bus->wire_end : ready;
}

/* --- the wire --------------------------------------------------------------------------------- */

/* Of all that are ready at this time, the frame with the lowest rank goes on the wire. */
static void start_frame(struct sim_can_bus *bus, db_time start)
{
	const struct sim_can_waiting *host = &bus->host[bus->host_first];
	bool host_sends = bus->host_count > 0 && host->ready <= start;
	struct sim_can_place *sender = NULL;
	db_time time;

	for (size_t i = 0; i < bus->station_count; i++) {
		struct sim_can_place *station = &bus->stations[i];

		if (station->has_frame && station->ready <= start &&
		    (!sender || rank_of(&station->frame) < rank_of(&sender->frame)))
			sender = station;
	}
	if (host_sends && sender && rank_of(&host->frame) >= rank_of(&sender->frame)) {
		host_sends = false;
		bus->stats.arbitration_lost++;
	}
	if (!host_sends && !sender)
		return;
	bus->sender = host_sends ? NULL : sender;
	bus->frame = host_sends ? host->frame : sender->frame;
	if (!host_sends) {
		sender->has_frame = false;
	} else {
		bus->host_first = (bus->host_first + 1) % SIM_CAN_HOST_QUEUE;
		bus->host_count--;
		bus->stats.host_frames++;
	}
	time = (db_time)db_can_frame_bits(&bus->frame) * DB_NS_PER_S / (db_time)bus->bitrate;
	/* All stations see a damaged frame and discard it, and it is sent again. */
	if (!host_sends && take_fault(bus, sender, SIM_FAULT_CORRUPT)) {
		time += time / 2 + (db_time)ERROR_BITS * DB_NS_PER_S / (db_time)bus->bitrate;
		bus->stats.corrupted++;
	}
	bus->on_wire = true;
	bus->wire_end = start + time;
	bus->stats.frames++;
	bus->stats.busy_ns += (uint64_t)time;
	if (bus->trace)
		bus->trace(bus->context, bus->wire_end, bus->sender ? '<' : '>', &bus->frame);
}

static void queue_to_host(struct sim_can_bus *bus, const struct db_can_frame *frame)
{
	if (bus->to_host_count < SIM_CAN_HOST_QUEUE)
		bus->to_host[(bus->to_host_first + bus->to_host_count++) % SIM_CAN_HOST_QUEUE]
			.frame = *frame;
	else
		bus->stats.overflows++;
}

static void end_frame(struct sim_can_bus *bus)
{
	bus->on_wire = false;
	if (bus->sender) {
		struct db_can_frame garbage = { .id = GARBAGE_ID,
			                        .length = 3,
			                        .data = { 0xFF, 1, 2 } };
		bool disturbed = sim_faults_take(&bus->faults, SIM_FAULT_GARBAGE);

		disturbed |= sim_faults_take(bus->sender->ops.faults, SIM_FAULT_GARBAGE);
		if (!bus->cut) {
			if (disturbed)
				queue_to_host(bus, &garbage);
			queue_to_host(bus, &bus->frame);
			if (take_fault(bus, bus->sender, SIM_FAULT_DOUBLE))
				queue_to_host(bus, &bus->frame);
		}
	} else {
		for (size_t i = 0; i < bus->station_count; i++) {
			struct sim_can_place *station = &bus->stations[i];
			const struct sim_can_station *ops = &station->ops;

			if (is_silent(bus, station))
				continue;
			/* A request to one drive does not count as a loss of another drive. */
			if ((!ops->wants || ops->wants(ops->self, &bus->frame)) &&
			    take_fault(bus, station, SIM_FAULT_LOSE_REQUEST))
				continue;
			ops->receive(ops->self, &bus->frame, bus->wire_end);
		}
		if (sim_faults_take(&bus->faults, SIM_FAULT_ECHO))
			queue_to_host(bus, &bus->frame);
	}
}

bool sim_can_bus_run(struct sim_can_bus *bus, db_time now, struct db_can_frame *frame)
{
	for (;;) {
		db_time start;

		if (bus->to_host_count > 0) {
			*frame = bus->to_host[bus->to_host_first].frame;
			bus->to_host_first = (bus->to_host_first + 1) % SIM_CAN_HOST_QUEUE;
			bus->to_host_count--;
			return true;
		}
		if (bus->on_wire) {
			if (bus->wire_end > now)
				return false;
			end_frame(bus);
			continue;
		}
		for (size_t i = 0; i < bus->station_count; i++)
			fetch_frame(bus, &bus->stations[i], now);
		start = start_time(bus);
		if (start > now)
			return false;
		start_frame(bus, start);
	}
}

db_time sim_can_bus_next(struct sim_can_bus *bus)
{
	db_time next;

	if (bus->to_host_count > 0)
		return 0;
	if (bus->on_wire)
		return bus->wire_end;
	next = start_time(bus);
	for (size_t i = 0; i < bus->station_count; i++) {
		struct sim_can_place *station = &bus->stations[i];
		db_time due = station->has_frame ? DB_TIME_NEVER :
		                                   station->ops.next(station->ops.self);

		if (due < next)
			next = due;
	}
	return next;
}
