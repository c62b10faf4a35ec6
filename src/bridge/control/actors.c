/* SPDX-License-Identifier: Apache-2.0 */
#include "control/actors.h"

#include "control/control_private.h"
#include "identity/rights.h"

#include <stdio.h>
#include <string.h>

bool db_actors_name_is_good(const char *name)
{
	size_t size = strlen(name);

	if (size == 0 || size >= DB_CLIENT_USER_MAX || name[0] == ' ' || name[size - 1] == ' ')
		return false;
	for (size_t at = 0, length; at < size; at += length) {
		length = db_text_character(name + at);
		if (length == 0)
			return false;
	}
	return true;
}

const struct db_actor *db_actors_find(const struct db_actors *actors, uint32_t number)
{
	const struct db_actor *actor = &actors->places[number % DB_ACTORS_MAX];

	return number != 0 && actor->number == number ? actor : NULL;
}

/* A free place, or the one without sessions for longest. */
static struct db_actor *find_place(struct db_actors *actors)
{
	struct db_actor *chosen = NULL;

	for (size_t i = 0; i < DB_ACTORS_MAX; i++) {
		struct db_actor *place = &actors->places[i];

		if (place->number == 0)
			return place;
		if (place->sessions == 0 && (!chosen || place->left < chosen->left))
			chosen = place;
	}
	return chosen;
}

uint32_t db_actors_hold(struct db_actors *actors, uint32_t user, const char *process_user,
                        const char *named)
{
	struct db_actor *place;
	uint32_t number;

	for (size_t i = 0; i < DB_ACTORS_MAX; i++) {
		place = &actors->places[i];
		if (place->number == 0 || place->user != user ||
		    strcmp(place->process_user, process_user) != 0 ||
		    strcmp(place->named, named) != 0)
			continue;
		place->sessions++;
		return place->number;
	}
	place = find_place(actors);
	if (!place)
		return 0;
	/* A number that the place never had, until they repeat; never 0. */
	number = place->number + DB_ACTORS_MAX;
	if (place->number == 0 || number < DB_ACTORS_MAX)
		number = (uint32_t)(place - actors->places) + DB_ACTORS_MAX;
	*place = (struct db_actor){ .number = number, .user = user, .sessions = 1 };
	snprintf(place->process_user, sizeof(place->process_user), "%s", process_user);
	snprintf(place->named, sizeof(place->named), "%s", named);
	return number;
}

void db_actors_let_go(struct db_actors *actors, uint32_t number)
{
	struct db_actor *place = &actors->places[number % DB_ACTORS_MAX];

	if (number == 0 || place->number != number || place->sessions == 0)
		return;
	if (--place->sessions == 0)
		place->left = ++actors->leavings;
}

void db_actors_words(const struct db_actors *actors, const uint8_t address[16],
                     struct db_client_words *words)
{
	struct db_client_session session;
	bool is_session = db_client_session_of_address(address, &session);
	char name[DB_CLIENT_PROCESS_USER_MAX] = "";
	uint32_t user;
	const struct db_actor *actor = actors && is_session ?
	                                       db_actors_find(actors, session.actor) :
	                                       NULL;

	if (actor)
		db_client_words_init(words, address, actor->process_user, actor->named);
	else if (is_session)
		db_client_words_init(words, address, "", session.named ? "?" : "");
	else {
		if (db_client_user_of_address(address, &user))
			db_rights_name(user, name);
		db_client_words_init(words, address, name, "");
	}
}
