/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/mailbox.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>

enum letter_state {
	LETTER_FREE,   /* network's */
	LETTER_POSTED, /* bus's, not looked at */
	LETTER_TAKEN,  /* bus's, in work */
	LETTER_DONE,   /* network's, to be collected */
};

struct db_letter {
	atomic_uint state;
	uint32_t order;
	struct db_mailbox *mailbox;
	enum db_result result;
	db_time sent;
	db_time finished;
	struct db_request request;
};

struct db_mailbox {
	size_t commands;
	size_t total;
	uint32_t next_order; /* network's: of the next letter posted */
	uint32_t next_taken; /* bus's: of the next letter to take */
	bool finished;       /* bus's: some letter was finished since it asked */
	struct db_letter letters[];
};

int db_mailbox_new(size_t commands, size_t stops, struct db_mailbox **mailbox)
{
	struct db_mailbox *made;

	made = calloc(1, sizeof *made + (commands + stops) * sizeof made->letters[0]);
	if (!made)
		return -ENOMEM;
	made->commands = commands;
	made->total = commands + stops;
	for (size_t i = 0; i < made->total; i++)
		made->letters[i].mailbox = made;
	*mailbox = made;
	return 0;
}

void db_mailbox_free(struct db_mailbox *mailbox)
{
	free(mailbox);
}

static enum letter_state state_of(struct db_letter *letter)
{
	return (enum letter_state)atomic_load_explicit(&letter->state, memory_order_acquire);
}

static void pass(struct db_letter *letter, enum letter_state state)
{
	atomic_store_explicit(&letter->state, state, memory_order_release);
}

/* Copies only the settings in use: most requests have none, and the array is most of the size. */
static void fill(struct db_request *to, const struct db_request *from)
{
	to->ticket = from->ticket;
	to->axis = from->axis;
	to->setting_count = from->setting_count;
	to->command = from->command;
	to->args = from->args;
	to->submitted = from->submitted;
	for (size_t i = 0; i < from->setting_count && i < DB_SETTINGS_MAX; i++)
		to->settings[i] = from->settings[i];
}

bool db_mailbox_post(struct db_mailbox *mailbox, const struct db_request *request)
{
	bool stop = request->setting_count == 0 && db_command_is_stop(request->command);
	size_t first = stop ? mailbox->commands : 0;
	size_t end = stop ? mailbox->total : mailbox->commands;

	for (size_t i = first; i < end; i++) {
		struct db_letter *letter = &mailbox->letters[i];

		if (state_of(letter) != LETTER_FREE)
			continue;
		fill(&letter->request, request);
		letter->order = mailbox->next_order++;
		letter->sent = 0;
		pass(letter, LETTER_POSTED);
		return true;
	}
	return false;
}

bool db_mailbox_collect(struct db_mailbox *mailbox, struct db_completion *completion)
{
	for (size_t i = 0; i < mailbox->total; i++) {
		struct db_letter *letter = &mailbox->letters[i];

		if (state_of(letter) != LETTER_DONE)
			continue;
		*completion = (struct db_completion){
			.ticket = letter->request.ticket,
			.axis = letter->request.axis,
			.result = letter->result,
			.sent = letter->sent,
			.finished = letter->finished,
		};
		pass(letter, LETTER_FREE);
		return true;
	}
	return false;
}

/*
 * Strictly in the order of posting: a scan may miss a letter that is posted behind its back, and must
 * then not overtake it with a younger one.
 */
struct db_letter *db_mailbox_take(struct db_mailbox *mailbox)
{
	for (size_t i = 0; i < mailbox->total; i++) {
		struct db_letter *letter = &mailbox->letters[i];

		if (state_of(letter) != LETTER_POSTED || letter->order != mailbox->next_taken)
			continue;
		mailbox->next_taken++;
		pass(letter, LETTER_TAKEN);
		return letter;
	}
	return NULL;
}

const struct db_request *db_letter_request(const struct db_letter *letter)
{
	return &letter->request;
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
	letter->mailbox->finished = true;
	pass(letter, LETTER_DONE);
}

bool db_mailbox_take_finished(struct db_mailbox *mailbox)
{
	bool finished = mailbox->finished;

	mailbox->finished = false;
	return finished;
}
