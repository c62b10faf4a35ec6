/* SPDX-License-Identifier: Apache-2.0 */
/* What a reload takes for unchanged: every key of the table is changed in turn. */
#include "config/config_private.h"
#include "config/keys.h"
#include "drivebridge/driver.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define TEXT_MAX 2048

/* One section of the text under test, as `name = value` lines. */
struct lines {
	const char *section;
	const char *keys; /* "name=value" separated by semicolons */
};

/* Two families, so that every key of the table has a place; d is the drive that changes. */
static const struct lines SERIAL[] = {
	{ "modbus", "confirm-ms=40" },
	{ "control", "act-group=drivebridge" },
	{ "role r", "control=no" },
	{ "bus b", "protocol=vsmd-serial;device=\"/dev/ttyX\"" },
	{ "bus c", "protocol=vsmd-serial;device=\"/dev/ttyY\"" },
	{ "drive d", "bus=b;address=1;unit=1" },
	{ "modbus-rtu p", "device=\"/dev/ttyP\"" },
	{ "endpoint e", "listen=\"127.0.0.1:503\"" },
	{ NULL, NULL },
};
static const struct lines AXES[] = {
	{ "bus b", "protocol=xyza;device=\"/dev/ttyX\"" },
	{ "drive d", "bus=b;address=1;axis=x;unit=1" },
	{ NULL, NULL },
};
static const struct lines CAN[] = {
	{ "bus b", "protocol=vsmd-can;interface=can0" },
	{ "drive d", "bus=b;address=1;unit=1" },
	{ NULL, NULL },
};

/* Another value for keys that a number more or another word does not do for. */
struct other {
	const char *section;
	const char *name;
	const struct lines *base;
	const char *change; /* as in struct lines: replaces or adds; "-name" takes away */
};

static const struct other OTHERS[] = {
	{ "modbus", "listen", SERIAL, "listen=\"127.0.0.1:1503\"" },
	{ "modbus", "allow-read", SERIAL, "allow-read={\"10.0.0.0/8\"}" },
	{ "modbus", "allow-write", SERIAL, "allow-write={\"127.0.0.0/8\"}" },
	{ "modbus", "gateway-unit", SERIAL, "gateway-unit=200" },
	{ "modbus", "secure-socket", SERIAL, "secure-socket=\"/run/x\"" },
	{ "role", "read", SERIAL, "read={\"d\"}" },
	{ "role", "write", SERIAL, "write={\"d\"}" },
	{ "endpoint", "listen", SERIAL, "listen=\"127.0.0.1:504\"" },
	{ "endpoint", "allow-read", SERIAL, "allow-read={\"10.0.0.0/8\"}" },
	{ "endpoint", "allow-write", SERIAL, "allow-write={\"10.0.0.0/8\"}" },
	{ "endpoint", "secure-socket", SERIAL, "secure-socket=\"/run/x\"" },
	{ "endpoint", "gateway-unit", SERIAL, "gateway-unit=200" },
	{ "endpoint", "max-clients", SERIAL, "max-clients=65" },
	{ "modbus-rtu", "endpoint", SERIAL, "endpoint=e" },
	{ "drive", "endpoint", SERIAL, "endpoint=e" },
	{ "modbus-rtu", "device", SERIAL, "device=\"/dev/ttyQ\"" },
	{ "modbus-rtu", "units", SERIAL, "units={\"1\"}" },
	{ "modbus-rtu", "role", SERIAL, "role=r" },
	{ "control", "socket", SERIAL, "socket=off" },
	{ "control", "read-group", SERIAL, "read-group=adm" },
	{ "control", "act-group", SERIAL, "act-group=plant" },
	{ "bus", "protocol", SERIAL, "protocol=xyza" },
	{ "bus", "transport", CAN, "transport=slcan;device=\"/dev/ttyX\";-interface" },
	{ "bus", "device", SERIAL, "device=\"/dev/ttyZ\"" },
	{ "bus", "interface", CAN, "interface=can1" },
	{ "bus", "bitrate", CAN, "bitrate=250000" },
	{ "bus", "baud", SERIAL, "baud=19200" },
	{ "bus", "line", AXES, "line=rs232" },
	{ "drive", "bus", SERIAL, "bus=c" },
	{ "drive", "address", SERIAL, "address=2" },
	{ "drive", "axis", AXES, "axis=y" },
	{ "drive", "unit", SERIAL, "unit=2" },
	{ "drive", "unit-name", SERIAL, "unit-name=mm" },
	{ "drive", "vendor-unit", SERIAL, "vendor-unit=9" },
	{ "drive", "on-exit", SERIAL, "on-exit=none" },
	{ "drive", "min-position", SERIAL, "min-position=-5" },
	{ "drive", "max-position", SERIAL, "max-position=5" },
	{ "drive", "max-velocity", SERIAL, "max-velocity=5" },
	{ "drive", "max-acceleration", SERIAL, "max-acceleration=5" },
};

static bool is_key(const char *line, size_t length, const char *other)
{
	size_t name = strcspn(line, "=;");

	if (*other == '-')
		return length >= name && strlen(other) == name + 1 &&
		       strncmp(line, other + 1, name) == 0;
	return strcspn(other, "=") == name && strncmp(line, other, name) == 0;
}

/* Whether one of the changes is about this line. */
static bool is_changed(const char *line, size_t length, const char *change)
{
	while (*change) {
		char one[128];
		size_t size = strcspn(change, ";");

		snprintf(one, sizeof one, "%.*s", (int)size, change);
		if (is_key(line, length, one))
			return true;
		change += size;
		change += *change == ';';
	}
	return false;
}

static void put_lines(char text[TEXT_MAX], const char *lines, const char *except)
{
	while (*lines) {
		size_t used = strlen(text);
		size_t size = strcspn(lines, ";");

		if (*lines != '-' && !is_changed(lines, size, except))
			snprintf(text + used, TEXT_MAX - used, " %.*s\n", (int)size, lines);
		lines += size;
		lines += *lines == ';';
	}
}

/* The base with a change in its first section of this kind. */
static void write_text(char text[TEXT_MAX], const struct lines *base, const char *section,
                       const char *change)
{
	bool done = change[0] == '\0';

	text[0] = '\0';
	for (; base->section; base++) {
		bool here = !done && strncmp(base->section, section, strlen(section)) == 0;

		snprintf(text + strlen(text), TEXT_MAX - strlen(text), "%s {\n", base->section);
		put_lines(text, base->keys, here ? change : "");
		if (here)
			put_lines(text, change, "");
		done = done || here;
		snprintf(text + strlen(text), TEXT_MAX - strlen(text), "}\n");
	}
	assert_true(done);
}

/* Null when the text is wrong. */
static struct db_config *try_parse(const char *text)
{
	struct db_config *config = NULL;
	char *messages = NULL;
	size_t size;
	FILE *errors = open_memstream(&messages, &size);
	int result;

	assert_non_null(errors);
	result = db_load_text(&db_load_built_in, text, "test.conf", errors, &config);
	fclose(errors);
	free(messages);
	return result == 0 ? config : NULL;
}

static struct db_config *parse(const char *text)
{
	struct db_config *config = try_parse(text);

	if (!config)
		fail_msg("a wrong text:\n%s", text);
	return config;
}

static bool same_section(const char *section, const struct db_config *a, const struct db_config *b)
{
	/* Roles, endpoints and lines are for Modbus clients. */
	if (strcmp(section, "modbus") == 0 || strcmp(section, "role") == 0 ||
	    strcmp(section, "modbus-rtu") == 0 || strcmp(section, "endpoint") == 0)
		return db_config_same_modbus(a, b);
	if (strcmp(section, "control") == 0)
		return db_config_same_control(a, b);
	if (strcmp(section, "bus") == 0)
		return db_config_same_bus(&a->buses[0], &b->buses[0]);
	return db_config_same_drive(a, &a->drives[0], b, &b->drives[0]);
}

/* Another value that needs nothing else. */
static const char *plain_change(const struct db_config_key *key, char text[64])
{
	if (key->kind == DB_KEY_WORD) {
		const char *words = key->words;
		size_t first = strcspn(words, " ");

		if (strncmp(words, key->preset, first) == 0)
			words += first + 1;
		snprintf(text, 64, "%s=%.*s", key->name, (int)strcspn(words, " "), words);
	} else {
		double preset = strtod(key->preset, NULL);

		snprintf(text, 64, "%s=%g", key->name,
		         preset + 1 <= key->max ? preset + 1 : preset - 1);
	}
	return text;
}

static const struct other *find_other(const struct db_config_key *key)
{
	for (size_t i = 0; i < sizeof OTHERS / sizeof OTHERS[0]; i++) {
		if (strcmp(OTHERS[i].section, key->section) == 0 &&
		    strcmp(OTHERS[i].name, key->name) == 0)
			return &OTHERS[i];
	}
	return NULL;
}

static void every_key_counts(void **state)
{
	size_t count;
	const struct db_config_key *keys = db_keys_all(&count);

	(void)state;
	for (size_t i = 0; i < count; i++) {
		const struct db_config_key *key = &keys[i];
		const struct other *other = find_other(key);
		const struct lines *base = other ? other->base : SERIAL;
		struct db_config *a;
		struct db_config *b;
		char change[64];
		char text[TEXT_MAX];

		/* What it says counts, not where that stands: test_profiles.c. */
		if (key->kind == DB_KEY_PROFILE)
			continue;
		if (key->size == 0)
			fail_msg("%s: its row does not say where it is kept", key->name);
		write_text(text, base, key->section, "");
		a = parse(text);
		b = parse(text);
		assert_true(same_section(key->section, a, b));
		db_config_free(b);
		write_text(text, base, key->section,
		           other ? other->change : plain_change(key, change));
		b = parse(text);
		if (same_section(key->section, a, b))
			fail_msg("%s { %s }: the change is not seen", key->section, key->name);
		db_config_free(b);
		db_config_free(a);
	}
}

/* Whatever its default would be written as. */
static void defaults_that_are_spelled_out_change_nothing(void **state)
{
	size_t count;
	const struct db_config_key *keys = db_keys_all(&count);
	char text[TEXT_MAX];
	struct db_config *a;

	(void)state;
	write_text(text, SERIAL, "modbus", "");
	a = parse(text);
	for (size_t i = 0; i < count; i++) {
		const struct db_config_key *key = &keys[i];
		struct db_config *b;
		char change[64];

		if (!key->preset || key->preset[0] == '\0' || key->kind == DB_KEY_NETWORKS ||
		    key->scope == DB_KEY_FOR_CAN || key->scope == DB_KEY_FOR_AXES ||
		    strcmp(key->name, "counts-per-unit") == 0)
			continue;
		snprintf(change, sizeof change, key->kind == DB_KEY_LISTEN ? "%s=\"%s\"" : "%s=%s",
		         key->name, key->preset);
		write_text(text, SERIAL, key->section, change);
		b = parse(text);
		if (!same_section(key->section, a, b))
			fail_msg("%s { %s }: taken for a change", key->section, change);
		db_config_free(b);
	}
	db_config_free(a);
}

static bool same_with(const struct lines *base, const char *section, const char *one,
                      const char *two)
{
	char text[TEXT_MAX];
	struct db_config *a;
	struct db_config *b;
	bool same;

	write_text(text, base, section, one);
	a = parse(text);
	write_text(text, base, section, two);
	b = parse(text);
	same = same_section(section, a, b);
	db_config_free(a);
	db_config_free(b);
	return same;
}

static void what_defaults_depend_on(void **state)
{
	(void)state;
	assert_true(same_with(SERIAL, "bus", "", "transport=serial"));
	assert_true(same_with(SERIAL, "bus", "", "baud=9600"));
	assert_true(same_with(CAN, "bus", "", "transport=socketcan"));
	assert_true(same_with(SERIAL, "drive", "", "on-exit=stop"));
	assert_true(
		same_with(SERIAL, "modbus", "max-clients=3", "max-clients=3;reserved-writers=2"));
	assert_true(same_with(SERIAL, "modbus", "allow-read={\"::/0\", \"0.0.0.0/0\"}", ""));
	assert_false(same_with(SERIAL, "modbus", "allow-read={\"::1\", \"::1\"}",
	                       "allow-read={\"::1\", \"::2\"}"));
	assert_false(same_with(SERIAL, "modbus", "allow-read={}", ""));
	/* What the drive knows of its mechanics counts as long as the file says nothing. */
	assert_false(same_with(SERIAL, "drive", "", "counts-per-unit=1.0"));
}

static void options_of_families_count(void **state)
{
	char text[TEXT_MAX];
	struct db_config *a;
	struct db_config *b;

	(void)state;
	write_text(text, CAN, "bus", "");
	a = parse(text);
	b = parse(text);
	for (size_t i = 0; i < b->buses[0].driver->option_count; i++) {
		const struct db_option *option = &b->buses[0].driver->options[i];
		void *options = strcmp(option->section, "bus") == 0 ? b->buses[0].options :
		                                                      b->drives[0].options;
		double value = db_option_value(option, options);

		db_option_set(option, options, 77);
		assert_false(same_section(option->section, a, b));
		db_option_set(option, options, value);
	}
	assert_true(same_section("bus", a, b));
	assert_true(same_section("drive", a, b));
	db_config_free(a);
	db_config_free(b);
}

#define BUS_B "bus b {\n protocol = vsmd-serial\n device = \"/dev/ttyX\"\n}\n"
#define BUS_C "bus c {\n protocol = vsmd-serial\n device = \"/dev/ttyY\"\n}\n"
#define DRIVE_D "drive d {\n bus = c\n address = 1\n unit = 1\n}\n"
#define DRIVE_E "drive e {\n bus = c\n address = 2\n unit = 2\n}\n"

static void places_in_the_file_do_not_count(void **state)
{
	struct db_config *a = parse(BUS_B BUS_C DRIVE_D DRIVE_E);
	struct db_config *b = parse("# moved\n\n" BUS_C BUS_B DRIVE_E DRIVE_D);

	(void)state;
	assert_true(db_config_same_bus(&a->buses[0], &b->buses[1]));
	assert_true(db_config_same_bus(&a->buses[1], &b->buses[0]));
	assert_true(db_config_same_drive(a, &a->drives[0], b, &b->drives[1]));
	assert_true(db_config_same_drive(a, &a->drives[1], b, &b->drives[0]));
	assert_false(db_config_same_drive(a, &a->drives[0], b, &b->drives[0]));
	assert_false(db_config_same_bus(&a->buses[0], &b->buses[0]));
	db_config_free(a);
	db_config_free(b);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_key_counts),
		cmocka_unit_test(defaults_that_are_spelled_out_change_nothing),
		cmocka_unit_test(what_defaults_depend_on),
		cmocka_unit_test(options_of_families_count),
		cmocka_unit_test(places_in_the_file_do_not_count),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
