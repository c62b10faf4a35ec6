/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/serial_bus.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BITS_PER_BYTE 10 /* 8N1 */
/* A burst is handed out in at most this many chunks, and each chunk has at least this length in
 * time: a host sees bytes arrive gradually, and the simulator does not wake up for each. */
#define CHUNKS_MAX 8
#define CHUNK_NS DB_NS_PER_MS

struct sim_serial_bus *sim_serial_bus_new(const struct sim_serial_protocol *protocol,
                                          const struct sim_serial_config *config,
                                          sim_trace_fn *trace, void *context)
{
	struct sim_serial_bus *bus = calloc(1, sizeof(*bus));

	if (!bus)
		return NULL;
	bus->protocol = protocol;
	bus->config = *config;
	bus->trace = trace;
	bus->context = context;
	bus->random = 0x2545f491u;
	bus->reply_end = -config->line_hold;
	return bus;
}

bool sim_serial_bus_attach(struct sim_serial_bus *bus, struct sim_node *node)
{
	if (bus->node_count == SIM_SERIAL_DRIVES_MAX)
		return false;
	bus->nodes[bus->node_count++] = node;
	return true;
}

struct sim_faults *sim_serial_bus_faults(void *wire)
{
	struct sim_serial_bus *bus = wire;

	return &bus->faults;
}

/* Wire time of this number of bytes, rounded up. */
static db_time wire_time(const struct sim_serial_bus *bus, size_t bytes)
{
	db_time bits = (db_time)bytes * BITS_PER_BYTE;

	if (!bus->config.paced)
		return 0;
	return (bits * DB_NS_PER_S + (db_time)bus->config.baud - 1) / (db_time)bus->config.baud;
}

/* Faults need variety, not quality; the same seed gives the same run. */
static uint32_t random_below(struct sim_serial_bus *bus, uint32_t limit)
{
	bus->random ^= bus->random << 13;
	bus->random ^= bus->random >> 17;
	bus->random ^= bus->random << 5;
	return bus->random % limit;
}

static struct sim_burst *new_burst(struct sim_serial_bus *bus)
{
	for (size_t i = 0; i < SIM_SERIAL_BURSTS_MAX; i++) {
		if (!bus->bursts[i].used)
			return &bus->bursts[i];
	}
	return NULL;
}

static void send_burst(struct sim_serial_bus *bus, struct sim_burst *burst, char direction,
                       db_time start)
{
	db_time duration = wire_time(bus, burst->length);
	size_t chunks = (size_t)(duration / CHUNK_NS) + 1;

	if (chunks > CHUNKS_MAX)
		chunks = CHUNKS_MAX;
	burst->used = burst->length > 0;
	burst->direction = direction;
	burst->node = NULL;
	burst->start = start;
	burst->sent = 0;
	burst->chunk = (burst->length + chunks - 1) / chunks;
}

static void end_request(struct sim_serial_bus *bus, db_time now)
{
	db_time end = bus->input_start + wire_time(bus, bus->input_length);
	size_t untraced = bus->input_overflow ? 0 : bus->protocol->untraced;
	struct sim_serial_line *line;
	struct sim_burst *echo = NULL;

	if (end < now)
		end = now;
	bus->request_end = end;
	bus->stats.requests++;
	if (bus->trace)
		bus->trace(bus->context, now, '>', bus->input, bus->input_length - untraced);
	if (!bus->input_overflow && sim_faults_take(&bus->faults, SIM_FAULT_ECHO))
		echo = new_burst(bus);
	if (echo) {
		memcpy(echo->bytes, bus->input, bus->input_length);
		echo->length = bus->input_length;
		send_burst(bus, echo, 'e', bus->input_start);
	}
	if (bus->input_overflow || bus->line_count == SIM_SERIAL_LINES_MAX) {
		bus->stats.missed++;
	} else {
		line = &bus->lines[(bus->first_line + bus->line_count++) % SIM_SERIAL_LINES_MAX];
		line->start = bus->input_start;
		line->end = end;
		line->length = bus->input_length;
		memcpy(line->bytes, bus->input, bus->input_length);
	}
	bus->input_length = 0;
	bus->input_overflow = false;
}

void sim_serial_bus_receive(void *wire, const uint8_t *bytes, size_t length, db_time now)
{
	struct sim_serial_bus *bus = wire;

	if (bus->protocol->patience > 0 && bus->input_length > 0 &&
	    now - bus->input_newest > bus->protocol->patience) {
		bus->input_length = 0;
		bus->stats.missed++;
	}
	for (size_t i = 0; i < length; i++) {
		size_t before;

		if (bus->input_length == 0 && !bus->input_overflow) {
			bool replying = false;

			for (size_t k = 0; k < SIM_SERIAL_BURSTS_MAX; k++)
				replying |= bus->bursts[k].used &&
				            bus->bursts[k].direction == '<' &&
				            bus->bursts[k].start <= now;
			bus->input_start = now > bus->request_end ? now : bus->request_end;
			bus->stats.collisions += replying;
		}
		if (bus->input_length < sizeof(bus->input))
			bus->input[bus->input_length++] = bytes[i];
		else
			bus->input_overflow = true;
		bus->input_newest = now;
		before = bus->input_length;
		if (!bus->protocol->ends(bus->input, &bus->input_length, bytes[i]))
			bus->input_start += wire_time(bus, before - bus->input_length);
		else if (!sim_faults_take(&bus->faults, SIM_FAULT_LOSE_END))
			end_request(bus, now);
		else
			bus->input_length--;
	}
}

bool sim_serial_bus_connects(const struct sim_serial_bus *bus, const struct sim_node *node)
{
	return node->faults.left[SIM_FAULT_SILENCE] == 0 &&
	       bus->faults.left[SIM_FAULT_SILENCE] == 0;
}

size_t sim_serial_bus_missed(struct sim_serial_bus *bus, const struct sim_node *node,
                             const struct sim_serial_request *request)
{
	db_time listens_from = bus->reply_end + bus->config.line_hold;
	size_t missed = 0;

	if (listens_from < node->deaf_until)
		listens_from = node->deaf_until;
	while (missed < request->length && request->start + wire_time(bus, missed) < listens_from)
		missed++;
	return missed;
}

bool sim_serial_bus_take(struct sim_serial_bus *bus, struct sim_node *node, enum sim_fault fault)
{
	return sim_faults_take(&node->faults, fault) || sim_faults_take(&bus->faults, fault);
}

void sim_serial_bus_log(struct sim_node *node, const struct sim_serial_request *request,
                        const char *text, size_t length)
{
	struct sim_log_entry *entry = &node->log[node->received++ % SIM_LOG_LINES];

	if (length >= SIM_LOG_LENGTH)
		length = SIM_LOG_LENGTH - 1;
	entry->time = request->end;
	for (size_t i = 0; i < length; i++)
		entry->line[i] = text[i] >= ' ' && text[i] <= '~' ? text[i] : '?';
	entry->line[length] = '\0';
}

void sim_serial_bus_testify(const struct sim_node *node, bool obeyed)
{
	const struct sim_log_entry *entry = &node->log[(node->received - 1) % SIM_LOG_LINES];

	sim_witness_report(&node->witness, entry->time, entry->line, obeyed);
}

static void insert_garbage(struct sim_serial_bus *bus, struct sim_burst *burst, size_t place)
{
	size_t count = 1 + random_below(bus, SIM_SERIAL_GARBAGE_MAX);
	uint8_t *hole = burst->bytes + place;

	memmove(hole + count, hole, burst->length - place);
	for (size_t i = 0; i < count; i++)
		hole[i] = (uint8_t)random_below(bus, 256);
	hole[random_below(bus, (uint32_t)count)] = bus->protocol->garbage;
	burst->length += count;
}

struct sim_burst *sim_serial_bus_begin(struct sim_serial_bus *bus, struct sim_node *node)
{
	struct sim_burst *burst = new_burst(bus);

	return sim_serial_bus_take(bus, node, SIM_FAULT_DROP) ? NULL : burst;
}

void sim_serial_bus_send(struct sim_serial_bus *bus, struct sim_node *node, struct sim_burst *burst,
                         size_t length, db_time request_end)
{
	uint32_t place = node->faults.left[SIM_FAULT_CORRUPT_AT] != 0 ? node->faults.corrupt_at :
	                                                                bus->faults.corrupt_at;
	db_time start = request_end + bus->config.latency + node->latency;

	burst->length = length;
	/* Damage to its bytes. */
	if (sim_serial_bus_take(bus, node, SIM_FAULT_CORRUPT_AT))
		burst->bytes[(place - 1) % burst->length] ^= (uint8_t)(1u << random_below(bus, 7));
	if (sim_serial_bus_take(bus, node, SIM_FAULT_CORRUPT)) {
		size_t victim = 1 + random_below(bus, (uint32_t)burst->length - 2);

		burst->bytes[victim] ^= (uint8_t)(1u << random_below(bus, 7));
	}
	if (sim_serial_bus_take(bus, node, SIM_FAULT_TRUNCATE))
		burst->length /= 2;
	if (sim_serial_bus_take(bus, node, SIM_FAULT_SPLIT))
		insert_garbage(bus, burst, burst->length / 2);
	if (sim_serial_bus_take(bus, node, SIM_FAULT_GARBAGE))
		insert_garbage(bus, burst, 0);
	if (sim_serial_bus_take(bus, node, SIM_FAULT_DOUBLE)) {
		memcpy(burst->bytes + burst->length, burst->bytes, burst->length);
		burst->length *= 2;
	}
	/* When it begins. */
	if (sim_faults_take(&node->faults, SIM_FAULT_DELAY))
		start += (db_time)node->faults.delay_ms * DB_NS_PER_MS;
	else if (sim_faults_take(&bus->faults, SIM_FAULT_DELAY))
		start += (db_time)bus->faults.delay_ms * DB_NS_PER_MS;
	/* After a late answer a drive's next answers are late too. */
	if (start < node->thinks_until)
		start = node->thinks_until;
	node->thinks_until = start + wire_time(bus, burst->length);
	send_burst(bus, burst, '<', start);
	burst->node = node;
	node->replies++;
	bus->stats.replies++;
}

struct sim_burst *sim_serial_bus_overlap(const struct sim_serial_bus *bus, struct sim_burst *first,
                                         struct sim_burst *second)
{
	size_t shift = bus->config.twins == SIM_TWINS_SHIFTED ? 1 : 0;

	if (!first || !second || bus->config.twins == SIM_TWINS_IN_TURN)
		return first ? first : second;
	for (size_t i = shift; i < first->length && i - shift < second->length; i++)
		first->bytes[i] &= second->bytes[i - shift];
	second->used = false;
	return first;
}

/* The burst to continue with: the begun one, else the one that starts first. */
static struct sim_burst *next_burst(struct sim_serial_bus *bus)
{
	struct sim_burst *best = bus->current;

	for (size_t i = 0; !bus->current && i < SIM_SERIAL_BURSTS_MAX; i++) {
		if (bus->bursts[i].used && (!best || bus->bursts[i].start < best->start))
			best = &bus->bursts[i];
	}
	return best;
}

static size_t next_chunk(const struct sim_burst *burst)
{
	size_t end = burst->sent + burst->chunk;

	return end < burst->length ? end : burst->length;
}

static db_time burst_due(const struct sim_serial_bus *bus, const struct sim_burst *burst)
{
	db_time start = burst->start;

	/* A burst may have to wait for the wire before its first chunk. */
	if (burst != bus->current && burst->direction == '<' && start < bus->reply_end)
		start = bus->reply_end;
	return start + wire_time(bus, next_chunk(burst));
}

db_time sim_serial_bus_next(void *wire)
{
	struct sim_serial_bus *bus = wire;
	const struct sim_burst *burst = next_burst(bus);
	db_time next = burst ? burst_due(bus, burst) : DB_TIME_NEVER;

	if (bus->line_count > 0 && bus->lines[bus->first_line].end < next)
		next = bus->lines[bus->first_line].end;
	return next;
}

/* Hands out the burst's next chunk as far as there is room. */
static size_t emit_bytes(struct sim_serial_bus *bus, struct sim_burst *burst, uint8_t *out,
                         size_t size)
{
	size_t count = next_chunk(burst) - burst->sent;

	if (!bus->current) {
		if (burst->direction == '<' && burst->start < bus->reply_end)
			burst->start = bus->reply_end;
		bus->current = burst;
	}
	if (count > size)
		count = size;
	memcpy(out, burst->bytes + burst->sent, count);
	burst->sent += count;
	if (burst->sent == burst->length) {
		db_time end = burst->start + wire_time(bus, burst->length);

		if (burst->direction == '<')
			bus->reply_end = end;
		if (burst->node)
			burst->node->deaf_until = end + bus->config.turnaround + burst->node->deaf;
		if (bus->trace)
			bus->trace(bus->context, end, burst->direction, burst->bytes,
			           burst->length);
		burst->used = false;
		bus->current = NULL;
	}
	return count;
}

size_t sim_serial_bus_run(void *wire, db_time now, uint8_t *out, size_t size)
{
	struct sim_serial_bus *bus = wire;
	size_t written = 0;

	while (written < size && sim_serial_bus_next(bus) <= now) {
		struct sim_burst *burst = next_burst(bus);
		struct sim_serial_line *line = &bus->lines[bus->first_line];

		if (bus->line_count > 0 && (!burst || line->end <= burst_due(bus, burst))) {
			struct sim_serial_request request;

			bus->first_line = (bus->first_line + 1) % SIM_SERIAL_LINES_MAX;
			bus->line_count--;
			request = (struct sim_serial_request){
				.bytes = line->bytes,
				.length = line->length,
				.start = line->start,
				.end = line->end,
			};
			bus->protocol->process(bus, &request);
		} else if (burst) {
			written += emit_bytes(bus, burst, out + written, size - written);
		}
	}
	return written;
}

/* --- for the world ---------------------------------------------------------------------------- */

static void wire_describe(void *wire, char *text, size_t size)
{
	const struct sim_serial_stats *stats = &((const struct sim_serial_bus *)wire)->stats;

	snprintf(text, size,
	         "requests=%" PRIu32 " replies=%" PRIu32 " collisions=%" PRIu32 " unheard=%" PRIu32
	         " foreign=%" PRIu32,
	         stats->requests, stats->replies, stats->collisions, stats->missed, stats->foreign);
}

const struct sim_wire_ops sim_serial_bus_ops = {
	.receive = sim_serial_bus_receive,
	.run = sim_serial_bus_run,
	.next = sim_serial_bus_next,
	.faults = sim_serial_bus_faults,
	.describe = wire_describe,
	.free = free,
};
