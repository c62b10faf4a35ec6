/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/can_bus.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HOST_QUEUE 64
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

struct waiting {
	struct db_can_frame frame;
	db_time ready;
};

struct station {
	struct sim_can_station ops;
	bool has_frame; /* a frame from its queue is ready to send */
	struct db_can_frame frame;
	db_time ready;
};

struct sim_can_bus {
	unsigned bitrate;
	sim_can_trace_fn *trace;
	void *context;
	struct sim_faults faults;
	struct sim_can_stats stats;
	bool cut;

	struct waiting host[HOST_QUEUE]; /* a ring */
	size_t host_first;
	size_t host_count;
	struct waiting to_host[HOST_QUEUE]; /* a ring: echoes */
	size_t to_host_first;
	size_t to_host_count;
	struct station stations[SIM_CAN_STATIONS_MAX];
	size_t station_count;

	bool on_wire;
	struct db_can_frame frame;
	const struct station *sender; /* null: the host */
	db_time wire_end;
};

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

void sim_can_bus_free(struct sim_can_bus *bus)
{
	free(bus);
}

bool sim_can_bus_attach(struct sim_can_bus *bus, const struct sim_can_station *station)
{
	if (bus->station_count == SIM_CAN_STATIONS_MAX)
		return false;
	bus->stations[bus->station_count++].ops = *station;
	return true;
}

size_t sim_can_bus_waiting(const struct sim_can_bus *bus)
{
	return bus->host_count;
}

struct sim_faults *sim_can_bus_faults(struct sim_can_bus *bus)
{
	return &bus->faults;
}

const struct sim_can_stats *sim_can_bus_stats(const struct sim_can_bus *bus)
{
	return &bus->stats;
}

bool sim_can_bus_is_cut(const struct sim_can_bus *bus)
{
	return bus->cut;
}

void sim_can_bus_cut(struct sim_can_bus *bus, bool cut)
{
	bus->cut = cut;
	if (cut)
		bus->host_count = bus->to_host_count = 0;
}

bool sim_can_bus_put(struct sim_can_bus *bus, const struct db_can_frame *frame, db_time now)
{
	struct waiting *place;

	if (bus->cut || bus->host_count == HOST_QUEUE) {
		bus->stats.overflows++;
		return false;
	}
	place = &bus->host[(bus->host_first + bus->host_count++) % HOST_QUEUE];
	*place = (struct waiting){ .frame = *frame, .ready = now };
	return true;
}

static bool take_fault(struct sim_can_bus *bus, const struct station *station, enum sim_fault fault)
{
	return sim_faults_take(station->ops.faults, fault) || sim_faults_take(&bus->faults, fault);
}

static bool is_silent(const struct sim_can_bus *bus, const struct station *station)
{
	return station->ops.faults->left[SIM_FAULT_SILENCE] != 0 ||
	       bus->faults.left[SIM_FAULT_SILENCE] != 0;
}

/* --- frames of drives ------------------------------------------------------------------------- */

static db_time delay_of(struct sim_can_bus *bus, const struct station *station)
{
	if (sim_faults_take(station->ops.faults, SIM_FAULT_DELAY))
		return (db_time)station->ops.faults->delay_ms * DB_NS_PER_MS;
	if (sim_faults_take(&bus->faults, SIM_FAULT_DELAY))
		return (db_time)bus->faults.delay_ms * DB_NS_PER_MS;
	return 0;
}

/* Applies faults to a frame that a drive wants to send. False: it is not sent at all. */
static bool damage_frame(struct sim_can_bus *bus, const struct station *station,
                         struct db_can_frame *frame)
{
	if (is_silent(bus, station) || take_fault(bus, station, SIM_FAULT_DROP))
		return false;
	if (take_fault(bus, station, SIM_FAULT_TRUNCATE))
		frame->length /= 2;
	if (take_fault(bus, station, SIM_FAULT_WRONG_ID)) {
		/* Changes the sender to another drive. */
		if (station->ops.sender_bit)
			frame->id ^= station->ops.sender_bit;
		else
			frame->id ^= frame->id & DB_CAN_EXTENDED ? 1u << 10 : 1u << 1;
	}
	return true;
}

/* Takes the next due frame from a drive's own queue. */
static void fetch_frame(struct sim_can_bus *bus, struct station *station, db_time now)
{
	while (!station->has_frame && station->ops.next(station->ops.self) <= now) {
		db_time ready = station->ops.next(station->ops.self);
		struct db_can_frame frame;

		if (!station->ops.send(station->ops.self, now, &frame))
			return;
		if (!damage_frame(bus, station, &frame))
			continue;
		/* Frames after a late answer wait for it. */
		station->frame = frame;
		station->ready = ready + delay_of(bus, station);
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

struct candidate {
	const struct db_can_frame *frame;
	struct station *station; /* null: the host */
	db_time ready;
};

static void consider_sender(struct candidate *best, const struct candidate *next, db_time start)
{
	if (next->ready > start)
		return;
	if (!best->frame || rank_of(next->frame) < rank_of(best->frame))
		*best = *next;
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

static struct candidate arbitrate(struct sim_can_bus *bus, db_time start)
{
	struct candidate best = { .frame = NULL };

	for (size_t i = 0; i < bus->station_count; i++) {
		struct station *station = &bus->stations[i];

		if (station->has_frame)
			consider_sender(&best,
			                &(struct candidate){ .frame = &station->frame,
			                                     .station = station,
			                                     .ready = station->ready },
			                start);
	}
	if (bus->host_count > 0) {
		const struct waiting *host = &bus->host[bus->host_first];
		const struct db_can_frame *winner = best.frame;

		consider_sender(&best,
		                &(struct candidate){ .frame = &host->frame, .ready = host->ready },
		                start);
		bus->stats.arbitration_lost += winner && host->ready <= start &&
		                               best.frame == winner;
	}
	return best;
}

/* --- the wire --------------------------------------------------------------------------------- */

static db_time bits_time(const struct sim_can_bus *bus, unsigned bits)
{
	return (db_time)bits * DB_NS_PER_S / (db_time)bus->bitrate;
}

static void start_frame(struct sim_can_bus *bus, db_time start)
{
	struct candidate best = arbitrate(bus, start);
	db_time time;

	if (!best.frame)
		return;
	bus->frame = *best.frame;
	bus->sender = best.station;
	if (best.station) {
		best.station->has_frame = false;
	} else {
		bus->host_first = (bus->host_first + 1) % HOST_QUEUE;
		bus->host_count--;
		bus->stats.host_frames++;
	}
	time = bits_time(bus, db_can_frame_bits(&bus->frame));
	/* All stations see a damaged frame and discard it, and it is sent again. */
	if (best.station && take_fault(bus, best.station, SIM_FAULT_CORRUPT)) {
		time += time / 2 + bits_time(bus, ERROR_BITS);
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
	if (bus->to_host_count < HOST_QUEUE)
		bus->to_host[(bus->to_host_first + bus->to_host_count++) % HOST_QUEUE].frame =
			*frame;
	else
		bus->stats.overflows++;
}

/* A request to one drive does not count as a loss of another drive. */
static bool loses_frame(struct sim_can_bus *bus, const struct station *station)
{
	if (station->ops.wants && !station->ops.wants(station->ops.self, &bus->frame))
		return false;
	return take_fault(bus, station, SIM_FAULT_LOSE_REQUEST);
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
			struct station *station = &bus->stations[i];

			if (!is_silent(bus, station) && !loses_frame(bus, station))
				station->ops.receive(station->ops.self, &bus->frame, bus->wire_end);
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
			bus->to_host_first = (bus->to_host_first + 1) % HOST_QUEUE;
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
		struct station *station = &bus->stations[i];
		db_time due = station->has_frame ? DB_TIME_NEVER :
		                                   station->ops.next(station->ops.self);

		if (due < next)
			next = due;
	}
	return next;
}
