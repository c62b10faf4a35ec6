/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/mailbox.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/mman.h>

enum letter_state {
	LETTER_FREE,   /* network's */
	LETTER_POSTED, /* bus's, not looked at */
	LETTER_TAKEN,  /* bus's, in work */
	LETTER_DONE,   /* network's, to be collected */
};

/* What comes with a command or a parameter write. */
struct room {
	struct db_request request;
	struct db_setting settings[DB_SETTINGS_MAX];
	uint8_t bytes[DB_REQUEST_MAX]; /* the bus's, for what it sends */
};

/* There are several of each drive for its stops: they hold no more than a stop needs. */
struct db_letter {
	atomic_uint state;
	uint32_t order;
	uint32_t ticket;
	uint16_t axis;
	enum db_command command : 8;
	enum db_result result : 8;
	struct block *block;
	db_time sent;
	db_time finished;
};

/* Slots that were allocated together. The first block has those for everything and some for stops,
 * the later ones have more for stops. */
struct block {
	struct block *_Atomic next;
	struct db_mailbox *mailbox;
	size_t commands; /* so many at the beginning are for everything */
	size_t total;
	struct room *rooms; /* of those; null: there are none */
	struct db_letter letters[];
};

struct db_mailbox {
	struct block *first;
	size_t drives;       /* network's: there is room for the stops of so many */
	atomic_uint posted;  /* letters so far, so that the bus need not look for none */
	uint32_t next_order; /* network's: of the next letter posted */
	uint32_t next_taken; /* bus's: of the next letter to take */
	bool finished;       /* bus's: some letter was finished since it asked */
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

static struct block *new_block(struct db_mailbox *mailbox, size_t commands, size_t drives)
{
	size_t total = commands + drives * DB_MAILBOX_STOPS_EACH;
	struct block *block = calloc(1, sizeof *block + total * sizeof block->letters[0]);

	if (!block)
		return NULL;
	if (commands > 0)
		block->rooms = new_rooms(commands);
	if (commands > 0 && !block->rooms) {
		free(block);
		return NULL;
	}
	block->mailbox = mailbox;
	block->commands = commands;
	block->total = total;
	for (size_t i = 0; i < total; i++)
		block->letters[i].block = block;
	return block;
}

int db_mailbox_new(size_t commands, size_t drives, struct db_mailbox **mailbox)
{
	struct db_mailbox *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	made->first = new_block(made, commands, drives);
	if (!made->first) {
		free(made);
		return -ENOMEM;
	}
	made->drives = drives;
	*mailbox = made;
	return 0;
}

void db_mailbox_free(struct db_mailbox *mailbox)
{
	struct block *block = mailbox ? mailbox->first : NULL;

	while (block) {
		struct block *next = next_of(block);

		if (block->rooms)
			munmap(block->rooms, block->commands * sizeof block->rooms[0]);
		free(block);
		block = next;
	}
	free(mailbox);
}

int db_mailbox_grow(struct db_mailbox *mailbox, size_t drives)
{
	struct block *last = mailbox->first;
	struct block *block;

	if (drives <= mailbox->drives)
		return 0;
	block = new_block(mailbox, 0, drives - mailbox->drives);
	if (!block)
		return -ENOMEM;
	mailbox->drives = drives;
	while (next_of(last))
		last = next_of(last);
	atomic_store_explicit(&last->next, block, memory_order_release);
	return 0;
}

/* Null: it is for stops, which need none. */
static struct room *room_of(const struct db_letter *letter)
{
	size_t place = (size_t)(letter - letter->block->letters);

	return place < letter->block->commands ? &letter->block->rooms[place] : NULL;
}

static enum letter_state state_of(struct db_letter *letter)
{
	return (enum letter_state)atomic_load_explicit(&letter->state, memory_order_acquire);
}

static void pass(struct db_letter *letter, enum letter_state state)
{
	atomic_store_explicit(&letter->state, state, memory_order_release);
}

static void fill(struct db_letter *letter, const struct db_request *request)
{
	struct room *room = room_of(letter);

	letter->ticket = request->ticket;
	letter->axis = request->drive;
	letter->command = request->command;
	letter->sent = 0;
	if (!room)
		return;
	room->request = *request;
	room->request.settings = room->settings;
	for (size_t i = 0; i < request->setting_count && i < DB_SETTINGS_MAX; i++)
		room->settings[i] = request->settings[i];
}

static struct db_letter *free_letter(struct db_mailbox *mailbox)
{
	struct block *block = mailbox->first; /* only the first has such */

	for (size_t i = 0; i < block->commands; i++) {
		if (state_of(&block->letters[i]) == LETTER_FREE)
			return &block->letters[i];
	}
	return NULL;
}

/* Null when the drive has as many as it may: the free ones are the other drives'. */
static struct db_letter *free_stop(struct db_mailbox *mailbox, uint16_t drive)
{
	struct db_letter *found = NULL;
	unsigned used = 0;

	for (struct block *block = mailbox->first; block; block = next_of(block)) {
		for (size_t i = block->commands; i < block->total; i++) {
			struct db_letter *letter = &block->letters[i];

			if (state_of(letter) == LETTER_FREE)
				found = found ? found : letter;
			else if (letter->axis == drive)
				used++;
		}
	}
	return used < DB_MAILBOX_STOPS_EACH ? found : NULL;
}

bool db_mailbox_post(struct db_mailbox *mailbox, const struct db_request *request)
{
	bool stop = db_command_is_stop(request->command);
	struct db_letter *letter = stop ? free_stop(mailbox, request->drive) : free_letter(mailbox);

	if (!letter)
		return false;
	fill(letter, request);
	letter->order = mailbox->next_order++;
	pass(letter, LETTER_POSTED);
	atomic_store_explicit(&mailbox->posted, mailbox->next_order, memory_order_release);
	return true;
}

/* Some letter in this state; of posted ones only the oldest not taken. */
static struct db_letter *find(struct db_mailbox *mailbox, enum letter_state state)
{
	for (struct block *block = mailbox->first; block; block = next_of(block)) {
		for (size_t i = 0; i < block->total; i++) {
			struct db_letter *letter = &block->letters[i];

			if (state_of(letter) == state &&
			    (state != LETTER_POSTED || letter->order == mailbox->next_taken))
				return letter;
		}
	}
	return NULL;
}

bool db_mailbox_collect(struct db_mailbox *mailbox, struct db_completion *completion)
{
	struct db_letter *letter = find(mailbox, LETTER_DONE);

	if (!letter)
		return false;
	*completion = (struct db_completion){
		.ticket = letter->ticket,
		.drive = letter->axis,
		.result = letter->result,
		.sent = letter->sent,
		.finished = letter->finished,
	};
	pass(letter, LETTER_FREE);
	return true;
}

/*
 * Strictly in the order of posting: a scan may miss a letter that is posted behind its back, and must
 * then not overtake it with a younger one.
 */
struct db_letter *db_mailbox_take(struct db_mailbox *mailbox)
{
	struct db_letter *letter;

	if (atomic_load_explicit(&mailbox->posted, memory_order_acquire) == mailbox->next_taken)
		return NULL;
	letter = find(mailbox, LETTER_POSTED);
	if (!letter)
		return NULL;
	mailbox->next_taken++;
	pass(letter, LETTER_TAKEN);
	return letter;
}

uint32_t db_letter_ticket(const struct db_letter *letter)
{
	return letter->ticket;
}

uint16_t db_letter_axis(const struct db_letter *letter)
{
	return letter->axis;
}

enum db_command db_letter_command(const struct db_letter *letter)
{
	return letter->command;
}

const struct db_request *db_letter_request(const struct db_letter *letter)
{
	const struct room *room = room_of(letter);

	return room ? &room->request : NULL;
}

uint8_t *db_letter_bytes(struct db_letter *letter)
{
	return room_of(letter)->bytes;
}

void db_letter_sent(struct db_letter *letter, db_time now)
{
	if (letter->sent == 0)
		letter->sent = now;
}

void db_letter_finish(struct db_letter *letter, enum db_result result, db_time now)
{
	letter->result = result;
	letter->finished = now;
	letter->block->mailbox->finished = true;
	pass(letter, LETTER_DONE);
}

bool db_mailbox_take_finished(struct db_mailbox *mailbox)
{
	bool finished = mailbox->finished;

	mailbox->finished = false;
	return finished;
}
