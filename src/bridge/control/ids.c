/* SPDX-License-Identifier: Apache-2.0 */
#include "control/ids.h"

#include <stdlib.h>
#include <string.h>

#define DRIVE_NAME_MAX 32

struct place {
	struct db_id_call call; /* number 0: the place is free */
	db_time until;
	uint64_t order; /* order of being added, over all drives */
	uint32_t user;
	char named[DB_CLIENT_USER_MAX];
	char id[DB_ID_MAX + 1];
};

struct db_id_block {
	char drive[DRIVE_NAME_MAX];
	struct place places[DB_IDS_EACH];
};

/* The handle of a call contains its place, and how often all places were used before. */
#define PLACES_MAX ((uint64_t)DB_IDS_DRIVES * DB_IDS_EACH)

void db_ids_clear(struct db_ids *ids)
{
	for (size_t i = 0; i < DB_IDS_DRIVES; i++)
		free(ids->blocks[i]);
	*ids = (struct db_ids){ .added = 0 };
}

static size_t find_block(const struct db_ids *ids, const char *drive)
{
	size_t i = 0;

	while (i < DB_IDS_DRIVES && ids->blocks[i] && strcmp(ids->blocks[i]->drive, drive) != 0)
		i++;
	return i;
}

struct db_id_call *db_ids_find(struct db_ids *ids, const struct db_id_key *key)
{
	size_t b = find_block(ids, key->drive);

	for (size_t i = 0; b < DB_IDS_DRIVES && ids->blocks[b] && i < DB_IDS_EACH; i++) {
		struct place *place = &ids->blocks[b]->places[i];

		if (place->call.number != 0 && place->user == key->user &&
		    strcmp(place->id, key->id) == 0 && strcmp(place->named, key->named) == 0)
			return &place->call;
	}
	return NULL;
}

static bool may_be_forgotten(const struct place *place, db_time now)
{
	return place->call.number == 0 ||
	       (place->until < now && place->call.result != DB_RESULT_PENDING);
}

/* The drive's block, a new one if necessary: its index, DB_IDS_DRIVES when there is none. */
static size_t reserve_block(struct db_ids *ids, const char *drive, db_time now)
{
	size_t b = find_block(ids, drive);
	struct db_id_block *spent = NULL;
	uint64_t spent_order = 0;

	if (b < DB_IDS_DRIVES) {
		if (!ids->blocks[b]) {
			ids->blocks[b] = calloc(1, sizeof(struct db_id_block));
			if (!ids->blocks[b])
				return DB_IDS_DRIVES;
			memcpy(ids->blocks[b]->drive, drive, strlen(drive) + 1);
		}
		return b;
	}
	/* The one whose ids may all be forgotten, and that is unused for longest. */
	for (b = 0; b < DB_IDS_DRIVES; b++) {
		uint64_t order = 0;
		bool busy = false;

		for (size_t i = 0; i < DB_IDS_EACH; i++) {
			const struct place *place = &ids->blocks[b]->places[i];

			busy = busy || !may_be_forgotten(place, now);
			order = place->order > order ? place->order : order;
		}
		if (busy || (spent && order >= spent_order))
			continue;
		spent = ids->blocks[b];
		spent_order = order;
	}
	if (!spent)
		return DB_IDS_DRIVES;
	*spent = (struct db_id_block){ .drive = "" };
	memcpy(spent->drive, drive, strlen(drive) + 1);
	return find_block(ids, drive);
}

/* A free place of the block, or that of the oldest id that may be forgotten; DB_IDS_EACH: none, or
 * this user has its share. */
static size_t choose_place(const struct db_id_block *block, const struct db_id_key *key,
                           db_time now)
{
	size_t chosen = DB_IDS_EACH;
	size_t count = 0;

	for (size_t i = 0; i < DB_IDS_EACH; i++) {
		const struct place *place = &block->places[i];

		count += !may_be_forgotten(place, now) && place->user == key->user &&
		         strcmp(place->named, key->named) == 0;
	}
	if (count >= DB_IDS_OF_USER)
		return DB_IDS_EACH;

	for (size_t i = 0; i < DB_IDS_EACH; i++) {
		const struct place *place = &block->places[i];

		if (place->call.number == 0)
			return i;
		if (may_be_forgotten(place, now) &&
		    (chosen == DB_IDS_EACH || place->order < block->places[chosen].order))
			chosen = i;
	}
	return chosen;
}

struct db_id_call *db_ids_add(struct db_ids *ids, const struct db_id_key *key, db_time until,
                              db_time now)
{
	bool fits = strlen(key->drive) < DRIVE_NAME_MAX && strlen(key->id) <= DB_ID_MAX &&
	            strlen(key->named) < DB_CLIENT_USER_MAX;
	size_t b = fits ? reserve_block(ids, key->drive, now) : DB_IDS_DRIVES;
	size_t i = b < DB_IDS_DRIVES ? choose_place(ids->blocks[b], key, now) : DB_IDS_EACH;
	struct place *place;

	if (i == DB_IDS_EACH)
		return NULL;
	place = &ids->blocks[b]->places[i];
	*place = (struct place){
		.call = { .number = ++ids->added * PLACES_MAX + b * DB_IDS_EACH + i,
		          .result = DB_RESULT_PENDING },
		.until = until,
		.order = ids->added,
		.user = key->user,
	};
	memcpy(place->named, key->named, strlen(key->named) + 1);
	memcpy(place->id, key->id, strlen(key->id) + 1);
	return &place->call;
}

struct db_id_call *db_ids_at(struct db_ids *ids, uint64_t number)
{
	size_t at = (size_t)(number % PLACES_MAX);
	struct db_id_block *block = ids->blocks[at / DB_IDS_EACH];
	struct db_id_call *call = block ? &block->places[at % DB_IDS_EACH].call : NULL;

	return number != 0 && call && call->number == number ? call : NULL;
}

void db_ids_drop(struct db_ids *ids, uint64_t number)
{
	struct db_id_call *call = db_ids_at(ids, number);

	if (call)
		call->number = 0;
}

void db_ids_end_by_token(struct db_ids *ids, struct db_write_token token, enum db_result result)
{
	for (size_t b = 0; b < DB_IDS_DRIVES && ids->blocks[b]; b++) {
		for (size_t i = 0; i < DB_IDS_EACH; i++) {
			struct db_id_call *call = &ids->blocks[b]->places[i].call;

			if (call->number != 0 && call->result == DB_RESULT_PENDING &&
			    call->token.client == token.client &&
			    call->token.sequence == token.sequence)
				call->result = result;
		}
	}
}
