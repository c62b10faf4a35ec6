/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/pending.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

struct db_room {
	size_t users;
	struct db_slot *free;
	struct db_slot slots[];
};

static struct db_room *new_room(size_t count)
{
	struct db_room *room = calloc(1, sizeof *room + count * sizeof room->slots[0]);

	for (size_t i = 0; room && i < count; i++) {
		room->slots[i].next = room->free;
		room->free = &room->slots[i];
	}
	return room;
}

int db_pending_init(struct db_pending *pending, size_t commands, const struct db_pending *neighbour)
{
	*pending = (struct db_pending){ .room = neighbour ? neighbour->room : new_room(commands) };
	if (!pending->room)
		return -ENOMEM;
	pending->room->users++;
	return 0;
}

void db_pending_release(struct db_pending *pending)
{
	while (pending->first)
		db_pending_remove(pending, pending->first);
	if (pending->room && --pending->room->users == 0)
		free(pending->room);
	pending->room = NULL;
}

struct db_slot *db_pending_place(struct db_pending *pending, enum db_command command)
{
	if (!db_command_is_stop(command))
		return pending->commands < DB_COMMANDER_PENDING ? pending->room->free : NULL;
	/* As many as there may be of a drive at its bus: there is always one. */
	for (size_t i = 0; i < DB_COMMANDER_STOPS; i++) {
		if (pending->stops[i].ticket == 0)
			return &pending->stops[i];
	}
	return NULL;
}

void db_pending_add(struct db_pending *pending, struct db_slot *place,
                    const struct db_slot *request)
{
	if (!db_command_is_stop(request->command)) {
		pending->room->free = place->next;
		pending->commands++;
	}
	*place = *request;
	place->next = pending->first;
	pending->first = place;
}

void db_pending_remove(struct db_pending *pending, struct db_slot *slot)
{
	bool stop = db_command_is_stop(slot->command);
	struct db_slot **link = &pending->first;

	while (*link != slot)
		link = &(*link)->next;
	*link = slot->next;
	*slot = (struct db_slot){ .ticket = 0 };
	if (stop)
		return;
	slot->next = pending->room->free;
	pending->room->free = slot;
	pending->commands--;
}

struct db_slot *db_pending_find(const struct db_pending *pending, uint32_t ticket)
{
	for (struct db_slot *slot = pending->first; slot && ticket != 0; slot = slot->next) {
		if (slot->ticket == ticket)
			return slot;
	}
	return NULL;
}

const struct db_client *db_slot_client(const struct db_slot *slot, struct db_client *client)
{
	*client = (struct db_client){ .id = DB_CLIENT_NOBODY, .port = slot->port };
	memcpy(client->address, slot->address, sizeof client->address);
	return slot->has_client ? client : NULL;
}
