/* SPDX-License-Identifier: Apache-2.0 */
#include "audit/audit_private.h"

#include "drivebridge/hash.h"
#include "drivebridge/result.h"

#include <stdio.h>
#include <string.h>

#define PERIOD (DB_FLOOD_PERIOD_S * DB_NS_PER_S)

/* If two subjects have the same hash, one is only counted together with the other. */
static uint64_t hash_text(uint64_t value, const char *text)
{
	return db_hash_add(value, text ? text : "", text ? strlen(text) + 1 : 1);
}

/* The place after those of the clients: what all clients together were denied. */
#define DENIED DB_FLOODS_MAX

/* The same client, over whichever connection: a user of this machine has all of its addresses. */
static uint64_t subject_of_client(const struct db_audit_entry *entry)
{
	uint64_t value = DB_HASH_BEGIN;
	uint32_t user;

	if (db_client_user_of_address(entry->address, &user))
		value = db_hash_add(value, &user, sizeof(user));
	else
		value = db_hash_add(value, entry->address, sizeof(entry->address));
	value = hash_text(value, entry->user);
	return hash_text(value, entry->from);
}

static uint64_t subject_of_kind(const struct db_audit_entry *entry, uint64_t client)
{
	const uint32_t numbers[] = { (uint32_t)entry->kind, entry->command, (uint32_t)entry->result,
		                     entry->of != 0 };
	uint64_t value = db_hash_add(client, numbers, sizeof(numbers));

	value = hash_text(value, entry->drive);
	value = hash_text(value, entry->what);
	value = hash_text(value, entry->endpoint);
	return entry->value_count > 0 ? hash_text(value, entry->values[0].name) : value;
}

/* The subject's place, else a free one, else the oldest without a count, except `but`; else
 * null. */
static struct db_flood *find_place(struct db_floods *floods, uint64_t subject,
                                   const struct db_flood *but)
{
	struct db_flood *chosen = NULL;

	for (size_t i = 0; i < DB_FLOODS_MAX; i++) {
		struct db_flood *place = &floods->places[i];

		if (place->since != 0 && place->subject == subject)
			return place;
		if (place->counted == 0 && place != but &&
		    (!chosen || place->since < chosen->since))
			chosen = place;
	}
	if (chosen)
		*chosen = (struct db_flood){ .subject = subject };
	return chosen;
}

static struct db_flood *begin_minute(struct db_flood *place, db_time now)
{
	if (place->since == 0 || (now >= place->since + PERIOD && place->counted == 0)) {
		place->since = now;
		place->passed = 0;
	}
	return place;
}

static void copy(char *to, size_t size, const char *text)
{
	snprintf(to, size, "%s", text ? text : "");
}

static void count(struct db_flood *place, const struct db_audit_entry *entry)
{
	place->counted++;
	place->port = entry->port;
	place->command = entry->command;
	place->result = (uint8_t)entry->result;
	memcpy(place->address, entry->address, sizeof(place->address));
	copy(place->drive, sizeof(place->drive), entry->drive);
	copy(place->login, sizeof(place->login), entry->login);
	copy(place->user, sizeof(place->user), entry->user);
	copy(place->from, sizeof(place->from), entry->from);
}

/* Within what this client may leave in a minute, of this kind and of all? */
static bool client_passes(struct db_floods *floods, const struct db_audit_entry *entry, db_time now,
                          struct db_flood **place)
{
	uint64_t client = subject_of_client(entry);
	struct db_flood *whole = find_place(floods, client, NULL);
	struct db_flood *kind;

	/* More clients at once than there are places for: nothing is left out. */
	if (!whole)
		return true;
	begin_minute(whole, now)->whole = true;
	kind = find_place(floods, subject_of_kind(entry, client), whole);
	if (!kind || whole->passed >= DB_FLOOD_CLIENT) {
		if (whole->passed < DB_FLOOD_CLIENT) {
			whole->passed++;
			return true;
		}
		count(whole, entry);
		return false;
	}
	if (begin_minute(kind, now)->passed >= DB_FLOOD_FIRST) {
		count(kind, entry);
		return false;
	}
	kind->passed++;
	whole->passed++;
	*place = kind;
	return true;
}

bool db_floods_pass(struct db_floods *floods, const struct db_audit_entry *entry, db_time now,
                    struct db_flood **place)
{
	struct db_flood *denied = &floods->places[DENIED];

	*place = NULL;
	if (entry->kind != DB_AUDIT_DENIED)
		return client_passes(floods, entry, now, place);
	if (begin_minute(denied, now)->passed >= DB_FLOOD_DENIED) {
		denied->counted++;
		return false;
	}
	if (!client_passes(floods, entry, now, place))
		return false;
	denied->passed++;
	return true;
}

db_time db_floods_next(const struct db_floods *floods)
{
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i <= DENIED; i++) {
		const struct db_flood *place = &floods->places[i];

		if (place->counted > 0 && place->since + PERIOD < next)
			next = place->since + PERIOD;
	}
	return next;
}

bool db_floods_due(struct db_floods *floods, db_time now, bool all, struct db_audit_entry *entry)
{
	for (size_t i = 0; i <= DENIED; i++) {
		struct db_flood *place = &floods->places[i];

		if (place->counted == 0 || (now < place->since + PERIOD && !all))
			continue;
		*entry = (struct db_audit_entry){
			.kind = DB_AUDIT_REPEATED,
			.of = place->last,
			.count = place->counted,
			.port = place->port,
			.login = place->login,
			.user = place->user,
			.from = place->from,
			.what = i == DENIED  ? "denied to all clients" :
			        place->whole ? "of all kinds" :
			                       NULL,
			.drive = place->whole ? NULL : place->drive,
			.command = place->whole ? 0 : place->command,
			.result = place->whole || i == DENIED ? DB_RESULT_NONE :
			                                        (enum db_result)place->result,
		};
		memcpy(entry->address, place->address, sizeof(entry->address));
		/* It stays for another minute, whose first ones are counted as well. */
		place->counted = 0;
		place->since = now;
		return true;
	}
	return false;
}
