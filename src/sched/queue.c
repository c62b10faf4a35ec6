/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/queue.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/mman.h>

enum slot_state {
	SLOT_FREE,   /* network's */
	SLOT_POSTED, /* bus's, not looked at */
	SLOT_TAKEN,  /* bus's, in work */
	SLOT_DONE,   /* network's, to be collected */
};

/* What comes with a command or a parameter write. */
struct room {
	struct db_request request;
	struct db_setting settings[DB_SETTINGS_MAX];
	uint8_t bytes[DB_REQUEST_MAX]; /* the bus's, for what it sends */
};

/* There are several of each drive for its stops: they hold no more than a stop needs. */
struct db_queued {
	atomic_uint state;
	uint32_t order;
	uint32_t ticket;
	uint16_t axis;
	enum db_command command : 8;
	enum db_result result : 8;
	enum db_stand_cause cause : 8;
	struct block *block;
	db_time sent;
	db_time finished;
};

/* Slots that were allocated together. The first block has those for everything and some for stops,
 * the later ones have more for stops. */
struct block {
	struct block *_Atomic next;
	struct db_queue *queue;
	size_t commands; /* so many at the beginning are for everything */
	size_t total;
	struct room *rooms; /* of those; null: there are none */
	struct db_queued slots[];
};

struct db_queue {
	struct block *first;
	size_t drives;       /* network's: there is room for the stops of so many */
	atomic_uint posted;  /* requests so far, so that the bus need not look for none */
	uint32_t next_order; /* network's: of the next request posted */
	bool gathers;        /* network's: the bus does not see yet what is posted */
	uint32_t next_taken; /* bus's: of the next request to take */
	bool finished;       /* bus's: some request was finished since it asked */
};

static struct block *next_of(struct block *block)
{
	return atomic_load_explicit(&block->next, memory_order_acquire);
}

/* Mapped, because most of them are never used: then they are not in memory. Zeroed; null. */
static struct room *new_rooms(size_t count)
{
	void *rooms = mmap(NULL, count * sizeof(struct room), PROT_READ | PROT_WRITE,
	                   MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);

	return rooms == MAP_FAILED ? NULL : rooms;
}

static struct block *new_block(struct db_queue *queue, size_t commands, size_t drives)
{
	size_t total = commands + drives * DB_QUEUE_STOPS_EACH;
	struct block *block = calloc(1, sizeof *block + total * sizeof block->slots[0]);

	if (!block)
		return NULL;
	if (commands > 0)
		block->rooms = new_rooms(commands);
	if (commands > 0 && !block->rooms) {
		free(block);
		return NULL;
	}
	block->queue = queue;
	block->commands = commands;
	block->total = total;
	for (size_t i = 0; i < total; i++)
		block->slots[i].block = block;
	return block;
}

int db_queue_new(size_t commands, size_t drives, struct db_queue **queue)
{
	struct db_queue *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	made->first = new_block(made, commands, drives);
	if (!made->first) {
		free(made);
		return -ENOMEM;
	}
	made->drives = drives;
	*queue = made;
	return 0;
}

void db_queue_free(struct db_queue *queue)
{
	struct block *block = queue ? queue->first : NULL;

	while (block) {
		struct block *next = next_of(block);

		if (block->rooms)
			munmap(block->rooms, block->commands * sizeof block->rooms[0]);
		free(block);
		block = next;
	}
	free(queue);
}

int db_queue_grow(struct db_queue *queue, size_t drives)
{
	struct block *last = queue->first;
	struct block *block;

	if (drives <= queue->drives)
		return 0;
	block = new_block(queue, 0, drives - queue->drives);
	if (!block)
		return -ENOMEM;
	queue->drives = drives;
	while (next_of(last))
		last = next_of(last);
	atomic_store_explicit(&last->next, block, memory_order_release);
	return 0;
}

/* Null: it is for stops, which need none. */
static struct room *room_of(const struct db_queued *queued)
{
	size_t place = (size_t)(queued - queued->block->slots);

	return place < queued->block->commands ? &queued->block->rooms[place] : NULL;
}

static enum slot_state state_of(struct db_queued *queued)
{
	return (enum slot_state)atomic_load_explicit(&queued->state, memory_order_acquire);
}

static void hand_over(struct db_queued *queued, enum slot_state state)
{
	atomic_store_explicit(&queued->state, state, memory_order_release);
}

static void fill_slot(struct db_queued *queued, const struct db_request *request)
{
	struct room *room = room_of(queued);

	queued->ticket = request->ticket;
	queued->axis = request->drive;
	queued->command = request->command;
	queued->cause = request->cause;
	queued->sent = 0;
	if (!room)
		return;
	room->request = *request;
	room->request.settings = room->settings;
	for (size_t i = 0; i < request->setting_count && i < DB_SETTINGS_MAX; i++)
		room->settings[i] = request->settings[i];
}

static struct db_queued *find_free_slot(struct db_queue *queue)
{
	struct block *block = queue->first; /* only the first has such */

	for (size_t i = 0; i < block->commands; i++) {
		if (state_of(&block->slots[i]) == SLOT_FREE)
			return &block->slots[i];
	}
	return NULL;
}

/* Null when the drive has as many as it may: the free ones are the other drives'. */
static struct db_queued *find_free_stop_slot(struct db_queue *queue, uint16_t drive)
{
	struct db_queued *found = NULL;
	unsigned used = 0;

	for (struct block *block = queue->first; block; block = next_of(block)) {
		for (size_t i = block->commands; i < block->total; i++) {
			struct db_queued *queued = &block->slots[i];

			if (state_of(queued) == SLOT_FREE)
				found = found ? found : queued;
			else if (queued->axis == drive)
				used++;
		}
	}
	return used < DB_QUEUE_STOPS_EACH ? found : NULL;
}

bool db_queue_post(struct db_queue *queue, const struct db_request *request)
{
	bool stop = db_command_is_stop(request->command);
	struct db_queued *queued = stop ? find_free_stop_slot(queue, request->drive) :
	                                  find_free_slot(queue);

	if (!queued)
		return false;
	fill_slot(queued, request);
	queued->order = queue->next_order++;
	hand_over(queued, SLOT_POSTED);
	if (!queue->gathers)
		atomic_store_explicit(&queue->posted, queue->next_order, memory_order_release);
	return true;
}

bool db_queue_gather(struct db_queue *queue, bool gathers)
{
	bool unseen = atomic_load_explicit(&queue->posted, memory_order_relaxed) !=
	              queue->next_order;

	queue->gathers = gathers;
	if (!gathers)
		atomic_store_explicit(&queue->posted, queue->next_order, memory_order_release);
	return !gathers && unseen;
}

/* Some request in this state; of posted ones only the oldest not taken. */
static struct db_queued *find_slot(struct db_queue *queue, enum slot_state state)
{
	for (struct block *block = queue->first; block; block = next_of(block)) {
		for (size_t i = 0; i < block->total; i++) {
			struct db_queued *queued = &block->slots[i];

			if (state_of(queued) == state &&
			    (state != SLOT_POSTED || queued->order == queue->next_taken))
				return queued;
		}
	}
	return NULL;
}

bool db_queue_collect(struct db_queue *queue, struct db_completion *completion)
{
	struct db_queued *queued = find_slot(queue, SLOT_DONE);

	if (!queued)
		return false;
	*completion = (struct db_completion){
		.ticket = queued->ticket,
		.drive = queued->axis,
		.result = queued->result,
		.sent = queued->sent,
		.finished = queued->finished,
	};
	hand_over(queued, SLOT_FREE);
	return true;
}

/*
 * Strictly in the order of posting: a scan may miss a request that is posted behind its back, and must
 * then not overtake it with a younger one.
 */
struct db_queued *db_queue_take(struct db_queue *queue)
{
	struct db_queued *queued;

	if (atomic_load_explicit(&queue->posted, memory_order_acquire) == queue->next_taken)
		return NULL;
	queued = find_slot(queue, SLOT_POSTED);
	if (!queued)
		return NULL;
	queue->next_taken++;
	hand_over(queued, SLOT_TAKEN);
	return queued;
}

uint32_t db_queued_ticket(const struct db_queued *queued)
{
	return queued->ticket;
}

uint16_t db_queued_drive(const struct db_queued *queued)
{
	return queued->axis;
}

enum db_command db_queued_command(const struct db_queued *queued)
{
	return queued->command;
}

enum db_stand_cause db_queued_cause(const struct db_queued *queued)
{
	return queued->cause;
}

const struct db_request *db_queued_request(const struct db_queued *queued)
{
	const struct room *room = room_of(queued);

	return room ? &room->request : NULL;
}

uint8_t *db_queued_bytes(struct db_queued *queued)
{
	return room_of(queued)->bytes;
}

void db_queued_sent(struct db_queued *queued, db_time now)
{
	if (queued->sent == 0)
		queued->sent = now;
}

void db_queued_finish(struct db_queued *queued, enum db_result result, db_time now)
{
	queued->result = result;
	queued->finished = now;
	queued->block->queue->finished = true;
	hand_over(queued, SLOT_DONE);
}

bool db_queue_take_finished(struct db_queue *queue)
{
	bool finished = queue->finished;

	queue->finished = false;
	return finished;
}
