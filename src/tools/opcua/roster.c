/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/roster.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The index of the drive of this name in the list, or where to insert it. */
static size_t find_place(const struct db_opcua_roster *roster, const char *name, size_t length)
{
	size_t low = 0;
	size_t high = roster->count;

	while (low < high) {
		size_t middle = (low + high) / 2;

		/* Names that begin with it come after it. */
		if (strncmp(name, roster->drives[middle]->name, length) <= 0)
			high = middle;
		else
			low = middle + 1;
	}
	return low;
}

struct db_opcua_shown *db_opcua_roster_find(const struct db_opcua_roster *roster, const char *name,
                                            size_t length)
{
	size_t place = find_place(roster, name, length);

	if (place == roster->count || strncmp(name, roster->drives[place]->name, length) != 0 ||
	    roster->drives[place]->name[length] != '\0')
		return NULL;
	return roster->drives[place];
}

static void free_shown(struct db_opcua_shown *shown)
{
	if (shown->tree && --shown->tree->users == 0)
		db_opcua_tree_free(shown->tree);
	free(shown);
}

struct db_opcua_shown *db_opcua_roster_add(struct db_opcua_roster *roster,
                                           const struct db_opcua_config *config,
                                           struct db_opcua_drive *drive, const json_t *description)
{
	const char *axis = json_string_value(json_object_get(description, "axis"));
	struct db_opcua_shown *shown = calloc(1, sizeof(*shown));
	struct db_opcua_shown **grown = realloc(
		roster->drives, (roster->count + 1) * sizeof(struct db_opcua_shown *));
	size_t place;

	if (grown)
		roster->drives = grown;
	if (!shown || !grown) {
		free(shown);
		return NULL;
	}
	shown->drive = drive;
	shown->gateway = drive->name[0] == '\0';
	shown->name = shown->gateway ? DB_OPCUA_GATEWAY : drive->name;
	/* The tree of the drive's kind: another drive's, or a new one. */
	for (size_t i = 0; i < roster->count && !shown->tree; i++) {
		if (roster->drives[i]->drive->kind == drive->kind)
			shown->tree = roster->drives[i]->tree;
	}
	if (!shown->tree)
		shown->tree = db_opcua_tree_new(drive->kind, config, shown->gateway);
	if (!shown->tree) {
		free_shown(shown);
		return NULL;
	}
	shown->tree->users++;
	snprintf(shown->location, sizeof(shown->location), "%s/%lld%s%s", drive->bus,
	         (long long)json_integer_value(json_object_get(description, "address")),
	         axis && axis[0] ? "/" : "", axis ? axis : "");
	place = find_place(roster, shown->name, strlen(shown->name) + 1);
	memmove(roster->drives + place + 1, roster->drives + place,
	        (roster->count - place) * sizeof(struct db_opcua_shown *));
	roster->drives[place] = shown;
	roster->count++;
	return shown;
}

void db_opcua_roster_remove(struct db_opcua_roster *roster, struct db_opcua_shown *shown)
{
	size_t place = find_place(roster, shown->name, strlen(shown->name) + 1);

	roster->count--;
	memmove(roster->drives + place, roster->drives + place + 1,
	        (roster->count - place) * sizeof(struct db_opcua_shown *));
	free_shown(shown);
}

void db_opcua_roster_clear(struct db_opcua_roster *roster)
{
	for (size_t i = 0; i < roster->count; i++)
		free_shown(roster->drives[i]);
	free(roster->drives);
	db_opcua_buses_free(&roster->buses);
	db_opcua_alarms_free(&roster->alarms);
	*roster = (struct db_opcua_roster){ .count = 0 };
}

static bool is_text(const char *text, size_t length, const char *other)
{
	return strlen(other) == length && memcmp(text, other, length) == 0;
}

static bool identify_bus(const struct db_opcua_roster *roster, const char *id, size_t length,
                         struct db_opcua_subject *subject)
{
	struct db_opcua_bus *bus;
	struct db_opcua_fact *fact;

	if (!db_opcua_buses_find(roster->buses, id, length, &bus, &fact))
		return false;
	*subject = (struct db_opcua_subject){
		.type = fact ? DB_OPCUA_FACT : DB_OPCUA_BUS,
		.bus = bus,
		.fact = fact,
	};
	return true;
}

bool db_opcua_roster_identify(const struct db_opcua_roster *roster, const char *id, size_t length,
                              struct db_opcua_subject *subject)
{
	static const char of_bus[] = DB_OPCUA_BUSES ".";
	static const char of_alarm[] = DB_OPCUA_ALARMS ".";
	bool drives = is_text(id, length, DB_OPCUA_DRIVES);

	/* Names end with a zero byte; an id from a client may have bytes after one. */
	if (length > 0 && memchr(id, '\0', length))
		return false;
	if (drives || is_text(id, length, DB_OPCUA_BUSES)) {
		*subject = (struct db_opcua_subject){
			.type = drives ? DB_OPCUA_ALL_DRIVES : DB_OPCUA_ALL_BUSES,
		};
		return true;
	}
	if (is_text(id, length, DB_OPCUA_ALARMS)) {
		*subject = (struct db_opcua_subject){ .type = DB_OPCUA_ALL_ALARMS };
		return true;
	}
	if (length >= sizeof(of_alarm) && memcmp(id, of_alarm, sizeof(of_alarm) - 1) == 0) {
		*subject = (struct db_opcua_subject){ .type = DB_OPCUA_CONDITION,
			                              .member = DB_OPCUA_MEMBERS };
		subject->alarm = db_opcua_alarms_find(&roster->alarms, id, length,
		                                      &subject->member);
		return subject->alarm;
	}
	if (length >= sizeof(of_bus) && memcmp(id, of_bus, sizeof(of_bus) - 1) == 0)
		return identify_bus(roster, id + sizeof(of_bus) - 1, length - (sizeof(of_bus) - 1),
		                    subject);
	/* A drive's name may itself contain dots, but not end with one. */
	for (size_t end = 1; end <= length; end++) {
		size_t path = end < length ? end + 1 : end;
		const struct db_opcua_branch *branch = NULL;
		struct db_opcua_shown *shown = NULL;

		if (end == length || (id[end] == '.' && path < length))
			shown = db_opcua_roster_find(roster, id, end);
		if (shown)
			branch = db_opcua_tree_find(shown->tree, id + path, length - path);
		if (branch) {
			*subject = (struct db_opcua_subject){
				.type = DB_OPCUA_OF_DRIVE,
				.shown = shown,
				.branch = branch,
			};
			return true;
		}
	}
	return false;
}
