/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether two sections have the same meaning, key by key in the table: so a new key is compared
 * automatically. Values are compared, not texts: a default that is spelled out is no difference,
 * nor are the order and the lines of sections.
 */
#include "config/keys.h"
#include "drivebridge/driver.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Two sections of the same kind. */
struct pair {
	const void *a;
	const void *b;
};

static bool same_text(const char *a, const char *b)
{
	return a && b ? strcmp(a, b) == 0 : a == b;
}

static bool same_real(double a, double b)
{
	return isnan(a) ? isnan(b) : a >= b && a <= b;
}

/* True if every network of a is among b's. */
static bool has_networks(const struct db_network *a, size_t count_a, const struct db_network *b,
                         size_t count_b)
{
	for (size_t i = 0; i < count_a; i++) {
		size_t j = 0;

		while (j < count_b && memcmp(&a[i], &b[j], sizeof(a[i])) != 0)
			j++;
		if (j == count_b)
			return false;
	}
	return true;
}

/* Lists are equal in any order. */
static bool same_networks(const void *member_a, const void *member_b)
{
	struct db_network *a;
	struct db_network *b;
	size_t count_a;
	size_t count_b;

	memcpy(&a, member_a, sizeof(a));
	memcpy(&b, member_b, sizeof(b));
	memcpy(&count_a, (const char *)member_a + sizeof(a), sizeof(count_a));
	memcpy(&count_b, (const char *)member_b + sizeof(b), sizeof(count_b));
	return has_networks(a, count_a, b, count_b) && has_networks(b, count_b, a, count_a);
}

/* True if every drive of a is in b. */
static bool has_drives(const struct db_drive_set *a, const struct db_drive_set *b)
{
	if (a->all || b->all)
		return b->all;
	for (const char *name = a->names; name && *name; name += strlen(name) + 1) {
		if (!db_drive_set_has(b, name))
			return false;
	}
	return true;
}

static bool same_value(const struct pair *pair, const struct db_config_key *key)
{
	const void *a = (const char *)pair->a + key->offset;
	const void *b = (const char *)pair->b + key->offset;
	const char *text_a;
	const char *text_b;
	double real_a;
	double real_b;

	switch (key->kind) {
	case DB_KEY_TEXT:
	case DB_KEY_LISTEN:
		memcpy(&text_a, a, sizeof(text_a));
		memcpy(&text_b, b, sizeof(text_b));
		return same_text(text_a, text_b);
	case DB_KEY_REAL:
		memcpy(&real_a, a, sizeof(real_a));
		memcpy(&real_b, b, sizeof(real_b));
		return same_real(real_a, real_b);
	case DB_KEY_NETWORKS:
		return same_networks(a, b);
	case DB_KEY_DRIVES:
		return has_drives(a, b) && has_drives(b, a);
	case DB_KEY_PROFILE:
		/* Its contents are compared, wherever they are. */
		return true;
	case DB_KEY_BUS:
		/* An index in each one's own list: db_config_same_drive() compares the names. */
		return true;
	default:
		/* Numbers, words, and the pointers for words like protocol. */
		return memcmp(a, b, key->size) == 0;
	}
}

static bool same_section(const char *section, const struct pair *pair)
{
	size_t count;
	const struct db_config_key *keys = db_keys_all(&count);

	for (size_t i = 0; i < count; i++) {
		if (strcmp(keys[i].section, section) == 0 && !same_value(pair, &keys[i]))
			return false;
	}
	return true;
}

/* The family's own settings of this kind of section. */
static bool same_options(const char *section, const struct db_driver *driver, const void *a,
                         const void *b)
{
	for (size_t i = 0; i < driver->option_count; i++) {
		const struct db_option *option = &driver->options[i];

		if (strcmp(option->section, section) == 0 &&
		    !same_real(db_option_value(option, a), db_option_value(option, b)))
			return false;
	}
	return true;
}

/* Sections of one kind, in any order: lists of the same length without two of one name. */
struct list {
	const void *first;
	size_t count;
	size_t size; /* of one */
	size_t name; /* offset of its name */
};

static bool same_list(const char *section, const struct list *a, const struct list *b)
{
	size_t same = 0;

	for (size_t i = 0; i < a->count; i++) {
		for (size_t j = 0; j < b->count; j++) {
			const struct pair pair = { .a = (const char *)a->first + i * a->size,
				                   .b = (const char *)b->first + j * b->size };
			const char *name_a;
			const char *name_b;

			memcpy(&name_a, (const char *)pair.a + a->name, sizeof(name_a));
			memcpy(&name_b, (const char *)pair.b + b->name, sizeof(name_b));
			same += same_text(name_a, name_b) && same_section(section, &pair);
		}
	}
	return a->count == b->count && same == a->count;
}

bool db_config_same_modbus(const struct db_config *a, const struct db_config *b)
{
	const struct pair pair = { .a = &a->modbus, .b = &b->modbus };
	const struct db_modbus_config *const of[] = { &a->modbus, &b->modbus };
	struct list roles[2];
	struct list lines[2];
	struct list endpoints[2];

	for (int i = 0; i < 2; i++) {
		roles[i] = (struct list){ of[i]->roles, of[i]->role_count, sizeof(*of[i]->roles),
			                  offsetof(struct db_role_config, name) };
		lines[i] = (struct list){ of[i]->lines, of[i]->line_count, sizeof(*of[i]->lines),
			                  offsetof(struct db_rtu_config, name) };
		endpoints[i] = (struct list){ of[i]->endpoints, of[i]->endpoint_count,
			                      sizeof(*of[i]->endpoints),
			                      offsetof(struct db_endpoint_config, name) };
	}
	return same_list("role", &roles[0], &roles[1]) &&
	       same_list("modbus-rtu", &lines[0], &lines[1]) &&
	       same_list("endpoint", &endpoints[0], &endpoints[1]) && same_section("modbus", &pair);
}

bool db_config_same_control(const struct db_config *a, const struct db_config *b)
{
	const struct pair pair = { .a = &a->control, .b = &b->control };

	return same_section("control", &pair);
}

bool db_config_same_bus(const struct db_bus_config *a, const struct db_bus_config *b)
{
	const struct pair pair = { .a = a, .b = b };

	return same_text(a->name, b->name) && same_section("bus", &pair) &&
	       a->driver == b->driver && same_options("bus", a->driver, a->options, b->options);
}

bool db_config_same_drive(const struct db_config *config_a, const struct db_drive_config *a,
                          const struct db_config *config_b, const struct db_drive_config *b)
{
	const struct pair pair = { .a = a, .b = b };
	const struct db_bus_config *bus_a = &config_a->buses[a->bus];
	const struct db_bus_config *bus_b = &config_b->buses[b->bus];

	/* Without counts-per-unit the value reported by the drive is used, which no default can
	 * express. */
	return same_text(a->name, b->name) && a->counts_given == b->counts_given &&
	       same_section("drive", &pair) && same_text(bus_a->name, bus_b->name) &&
	       bus_a->driver == bus_b->driver &&
	       same_options("drive", bus_a->driver, a->options, b->options);
}

bool db_config_same(const struct db_config *a, const struct db_config *b)
{
	if (a->bus_count != b->bus_count || a->drive_count != b->drive_count ||
	    !db_config_same_modbus(a, b) || !db_config_same_control(a, b))
		return false;
	for (size_t i = 0; i < a->bus_count; i++) {
		if (!db_config_same_bus(&a->buses[i], &b->buses[i]))
			return false;
	}
	for (size_t i = 0; i < a->drive_count; i++) {
		if (!db_config_same_drive(a, &a->drives[i], b, &b->drives[i]))
			return false;
	}
	return true;
}
