/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/buses.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void free_bus(struct db_opcua_bus *bus)
{
	while (bus->facts) {
		struct db_opcua_fact *fact = bus->facts;

		bus->facts = fact->next;
		json_decref(fact->value);
		free(fact);
	}
	free(bus);
}

void db_opcua_buses_free(struct db_opcua_bus **buses)
{
	while (*buses) {
		struct db_opcua_bus *bus = *buses;

		*buses = bus->next;
		free_bus(bus);
	}
}

static bool is_name(const char *name, const char *text, size_t length)
{
	return strlen(name) == length && memcmp(name, text, length) == 0;
}

static struct db_opcua_fact *find_fact(const struct db_opcua_bus *bus, const char *text,
                                       size_t length)
{
	struct db_opcua_fact *fact = bus->facts;

	while (fact && !is_name(fact->name, text, length))
		fact = fact->next;
	return fact;
}

static struct db_opcua_bus *find_bus(struct db_opcua_bus *buses, const char *name)
{
	while (buses && strcmp(buses->name, name) != 0)
		buses = buses->next;
	return buses;
}

bool db_opcua_buses_find(struct db_opcua_bus *buses, const char *text, size_t length,
                         struct db_opcua_bus **bus, struct db_opcua_fact **fact)
{
	/* A name may itself contain dots. */
	for (; buses; buses = buses->next) {
		size_t end = strlen(buses->name);

		*bus = buses;
		*fact = NULL;
		if (is_name(buses->name, text, length))
			return true;
		if (length > end && is_name(buses->name, text, end) && text[end] == '.')
			*fact = find_fact(buses, text + end + 1, length - end - 1);
		if (*fact)
			return true;
	}
	return false;
}

/* Lists and objects are no facts. Without memory the next message sets it. */
static void set_fact(struct db_opcua_bus *bus, const char *key, json_t *value, int64_t time_us)
{
	char name[DB_OPCUA_NAME_MAX];
	struct db_opcua_fact *fact;

	if (!json_is_boolean(value) && !json_is_number(value) && !json_is_string(value))
		return;
	db_opcua_name_of(key, name);
	fact = find_fact(bus, name, strlen(name));
	if (!fact) {
		struct db_opcua_fact **end = &bus->facts;

		fact = calloc(1, sizeof(*fact));
		if (!fact)
			return;
		memcpy(fact->name, name, sizeof(name));
		while (*end)
			end = &(*end)->next;
		/* gcc's analyzer: it is the bus's now, which frees it. */
		*end = fact;
	}
	json_decref(fact->value);
	fact->value = json_incref(value);
	fact->time_us = time_us;
}

void db_opcua_buses_describe(struct db_opcua_bus **buses, json_t *told, int64_t time_us)
{
	struct db_opcua_bus **at = buses;
	size_t i;
	json_t *one;

	while (*at) {
		struct db_opcua_bus *bus = *at;

		if (db_words_look_up(told, bus->name)) {
			at = &bus->next;
		} else {
			*at = bus->next;
			free_bus(bus);
		}
	}
	json_array_foreach(told, i, one)
	{
		const char *name = db_words_text(one, "name");
		struct db_opcua_bus *bus = find_bus(*buses, name);
		const char *key;
		json_t *value;

		if (!bus) {
			bus = calloc(1, sizeof(*bus));
			if (!bus)
				return;
			snprintf(bus->name, sizeof(bus->name), "%s", name);
			*at = bus;
			at = &bus->next;
		}
		json_object_foreach(one, key, value) set_fact(bus, key, value, time_us);
	}
}

void db_opcua_buses_measure(struct db_opcua_bus *buses, json_t *told, int64_t time_us)
{
	const char *name;
	json_t *figures;

	json_object_foreach(told, name, figures)
	{
		struct db_opcua_bus *bus = find_bus(buses, name);
		const char *key;
		json_t *value;

		json_object_foreach(figures, key, value)
		{
			/* The description has `up` too, as a boolean. */
			if (bus && strcmp(key, "up") != 0)
				set_fact(bus, key, value, time_us);
		}
	}
}

void db_opcua_buses_diagnose(struct db_opcua_bus *buses, json_t *records, int64_t time_us)
{
	static const char *const keys[] = { "cause", "need", "detail", "advice", "since_us" };
	const char *name;
	json_t *record;

	json_object_foreach(records, name, record)
	{
		struct db_opcua_bus *bus = find_bus(buses, name);
		const char *said = json_string_value(
			json_object_get(json_object_get(record, "event"), "text"));
		json_t *event = json_string(said ? said : "");
		char key[DB_OPCUA_NAME_MAX];

		for (size_t i = 0; bus && i < sizeof(keys) / sizeof(keys[0]); i++) {
			snprintf(key, sizeof(key), "trouble_%s", keys[i]);
			set_fact(bus, key, json_object_get(record, keys[i]), time_us);
		}
		if (bus)
			set_fact(bus, "trouble_event", event, time_us);
		json_decref(event);
	}
}
