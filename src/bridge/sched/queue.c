/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/queue.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/mman.h>

/* The state of a place. That of a posted one is counted up from PLACE_POSTED in the order of
 * posting, by POSTED_STEP: the bus finds exactly the next one. */
enum place_state {
	PLACE_FREE,      /* owned by the network thread */
	PLACE_POSTED,    /* owned by the bus thread, not looked at */
	PLACE_TAKEN,     /* owned by the bus thread, in progress */
	PLACE_DONE,      /* owned by the network thread, to be collected */
	PLACE_COLLECTED, /* owned by the network thread, to be released */
};
#define POSTED_STEP 8u

/* What a command or a parameter write needs in addition. */
struct room {
	struct db_args args;
	struct db_setting settings[DB_SETTINGS_MAX];
	uint8_t bytes[DB_REQUEST_MAX]; /* the bus thread's, for what it sends */
	struct db_write_part part;     /* the bus thread's, of a parameter write */
	struct db_request *joined;     /* the bus thread's: the request whose part is next; null */
};

/* Places that were allocated together. The first block has those for everything and some for stops,
 * the later ones have more for stops. */
struct db_block {
	struct db_block *_Atomic next;
	struct db_queue *queue;
	size_t commands; /* this number at the beginning are for everything */
	size_t total;
	struct room *rooms;  /* of those places; null: there are none */
	atomic_uint *states; /* of each place */
	struct db_request requests[];
};

struct db_queue {
	struct db_block *first;
	size_t drives;       /* network's: number of drives for whose stops there is room */
	atomic_uint posted;  /* number of requests so far; lets the bus skip the search */
	uint32_t next_order; /* network's: of the next request posted */
	bool gathers;        /* network's: the bus does not see new requests yet */
	uint32_t next_taken; /* bus's: of the next request to take */
	bool finished;       /* bus's: a request was finished since the last query */
};

static struct db_block *next_of(struct db_block *block)
{
	return atomic_load_explicit(&block->next, memory_order_acquire);
}

/* Null on failure. */
static struct db_block *new_block(struct db_queue *queue, size_t commands, size_t drives)
{
	size_t total = commands + drives * DB_QUEUE_STOPS_EACH;
	struct db_block *block = calloc(1, sizeof(*block) + total * sizeof(block->requests[0]));

	if (!block)
		return NULL;
	block->states = calloc(total, sizeof(block->states[0]));
	/* Mapped, because most of them are never used and then take no memory. */
	if (commands > 0)
		block->rooms = mmap(NULL, commands * sizeof(block->rooms[0]),
		                    PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
	if (!block->states || block->rooms == MAP_FAILED) {
		if (block->rooms && block->rooms != MAP_FAILED)
			munmap(block->rooms, commands * sizeof(block->rooms[0]));
		free(block->states);
		free(block);
		return NULL;
	}
	block->queue = queue;
	block->commands = commands;
	block->total = total;
	return block;
}

int db_queue_new(size_t commands, size_t drives, struct db_queue **queue)
{
	struct db_queue *made = calloc(1, sizeof(*made));

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
	struct db_block *block = queue ? queue->first : NULL;

	while (block) {
		struct db_block *next = next_of(block);

		if (block->rooms)
			munmap(block->rooms, block->commands * sizeof(block->rooms[0]));
		free(block->states);
		free(block);
		block = next;
	}
	free(queue);
}

int db_queue_grow(struct db_queue *queue, size_t drives)
{
	struct db_block *last = queue->first;
	struct db_block *block;

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

static unsigned state_of(const struct db_block *block, size_t place)
{
	return atomic_load_explicit(&block->states[place], memory_order_acquire);
}

static void hand_over(const struct db_request *request, unsigned state)
{
	const struct db_block *block = request->block;

	atomic_store_explicit(&block->states[request - block->requests], state,
	                      memory_order_release);
}

/* Null for a stop, which needs none. */
static struct room *room_of(const struct db_request *request)
{
	size_t place = (size_t)(request - request->block->requests);

	return place < request->block->commands ? &request->block->rooms[place] : NULL;
}

/* --- network thread --------------------------------------------------------------------------- */

/* Only the first block has these places. */
static struct db_request *find_free_place(struct db_block *first)
{
	for (size_t i = 0; i < first->commands; i++) {
		if (state_of(first, i) == PLACE_FREE)
			return &first->requests[i];
	}
	return NULL;
}

/* Null when the drive has as many as it may: the free places belong to the other drives. */
static struct db_request *find_free_stop_place(struct db_queue *queue, uint16_t drive,
                                               struct db_block **block)
{
	struct db_request *found = NULL;
	unsigned used = 0;

	for (struct db_block *each = queue->first; each; each = next_of(each)) {
		for (size_t i = each->commands; i < each->total; i++) {
			if (state_of(each, i) != PLACE_FREE) {
				used += each->requests[i].drive == drive;
			} else if (!found) {
				found = &each->requests[i];
				*block = each;
			}
		}
	}
	return used < DB_QUEUE_STOPS_EACH ? found : NULL;
}

struct db_request *db_queue_post(struct db_queue *queue, const struct db_request *request)
{
	struct db_block *block = queue->first;
	struct db_request *posted = db_command_is_stop(request->command) ?
	                                    find_free_stop_place(queue, request->drive, &block) :
	                                    find_free_place(queue->first);
	struct room *room;

	if (!posted)
		return NULL;
	*posted = *request;
	posted->block = block;
	posted->args = NULL;
	posted->result = DB_RESULT_PENDING;
	posted->sent = posted->finished = 0;
	atomic_store_explicit(&posted->acknowledged, false, memory_order_relaxed);
	atomic_store_explicit(&posted->stop_follows, false, memory_order_relaxed);
	room = room_of(posted);
	if (room) {
		room->part = (struct db_write_part){ .request = posted,
			                             .result = DB_RESULT_PENDING };
		room->joined = NULL;
	}
	if (room && request->setting_count > 0) {
		for (size_t i = 0; i < request->setting_count && i < DB_SETTINGS_MAX; i++)
			room->settings[i] = request->settings[i];
		posted->settings = room->settings;
	} else if (room) {
		room->args = request->args ? *request->args : (struct db_args){ 0 };
		posted->args = &room->args;
	}
	hand_over(posted, PLACE_POSTED + queue->next_order++ * POSTED_STEP);
	if (!queue->gathers)
		atomic_store_explicit(&queue->posted, queue->next_order, memory_order_release);
	return posted;
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

static struct db_request *find_state(struct db_queue *queue, unsigned state)
{
	for (struct db_block *block = queue->first; block; block = next_of(block)) {
		for (size_t i = 0; i < block->total; i++) {
			if (state_of(block, i) == state)
				return &block->requests[i];
		}
	}
	return NULL;
}

struct db_request *db_queue_collect(struct db_queue *queue)
{
	struct db_request *request = find_state(queue, PLACE_DONE);

	if (request)
		hand_over(request, PLACE_COLLECTED);
	return request;
}

void db_queue_release(struct db_request *request)
{
	hand_over(request, PLACE_FREE);
}

/* --- bus thread ------------------------------------------------------------------------------- */

/*
 * Strictly in the order of posting: a search may miss a request that is posted meanwhile, and must
 * then not overtake it with a younger one.
 */
struct db_request *db_queue_take(struct db_queue *queue)
{
	struct db_request *request;

	if (atomic_load_explicit(&queue->posted, memory_order_acquire) == queue->next_taken)
		return NULL;
	request = find_state(queue, PLACE_POSTED + queue->next_taken * POSTED_STEP);
	if (!request)
		return NULL;
	queue->next_taken++;
	hand_over(request, PLACE_TAKEN);
	return request;
}

uint8_t *db_queue_bytes(const struct db_request *request)
{
	return room_of(request)->bytes;
}

struct db_write_part *db_queue_parts(const struct db_request *request)
{
	return &room_of(request)->part;
}

/* The next request that joined it; null. */
static struct db_request *joined_to(const struct db_request *request)
{
	const struct room *room = room_of(request);

	return room ? room->joined : NULL;
}

void db_queue_join(struct db_request *request, struct db_request *more)
{
	while (joined_to(request))
		request = joined_to(request);
	/* gcc's analyzer: only stops have no room, and no stop is joined. */
	room_of(request)->joined = more;
	room_of(request)->part.next = db_queue_parts(more);
}

void db_queue_show_acknowledged(struct db_request *request)
{
	for (; request; request = joined_to(request))
		atomic_store_explicit(&request->acknowledged, db_queue_parts(request)->taken,
		                      memory_order_release);
}

void db_queue_note_sent(struct db_request *request, db_time now)
{
	for (; request; request = joined_to(request)) {
		if (request->sent == 0)
			request->sent = now;
	}
}

void db_queue_finish(struct db_request *request, enum db_result result, db_time now)
{
	while (request) {
		/* After it is handed over its room may be reused. */
		struct db_request *next = joined_to(request);
		const struct room *room = room_of(request);

		request->result = (uint8_t)(room && room->part.result != DB_RESULT_PENDING ?
		                                    room->part.result :
		                                    result);
		request->finished = now;
		request->block->queue->finished = true;
		hand_over(request, PLACE_DONE);
		request = next;
	}
}

bool db_queue_has_finished(struct db_queue *queue)
{
	bool finished = queue->finished;

	queue->finished = false;
	return finished;
}
