/* SPDX-License-Identifier: Apache-2.0 */
#include "setup/sections.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

#define UNIT_MAX 247

const char *db_setup_speed_key(const json_t *bus)
{
	return json_is_true(json_object_get(bus, "can")) ? "bitrate" : "baud";
}

/* The wanted number if it is free, else the next free one. */
static json_int_t choose_unit(json_t *taken, json_int_t wanted)
{
	char key[24];

	for (json_int_t tried = 0; tried < UNIT_MAX; tried++) {
		json_int_t unit = (wanted + tried + UNIT_MAX - 1) % UNIT_MAX + 1;

		snprintf(key, sizeof(key), "%lld", (long long)unit);
		if (json_object_get(taken, key))
			continue;
		(void)json_object_set_new(taken, key, json_true());
		return unit;
	}
	return UNIT_MAX;
}

/* `taken` has the names and the units of the drives that there are. */
static void write_drive(FILE *out, const json_t *bus, const json_t *find, json_t *taken)
{
	json_int_t address = db_words_number(find, "address");
	char identity[DB_WORDS_VALUE_MAX];
	char name[128];

	snprintf(name, sizeof(name), "%s-%lld", db_words_text(bus, "name"), (long long)address);
	while (json_object_get(taken, name) && strlen(name) + 2 < sizeof(name))
		(void)strcat(name, "-b");
	(void)json_object_set_new(taken, name, json_true());
	snprintf(identity, sizeof(identity), "%s", db_words_text(find, "identity"));
	db_words_clean(identity);
	fprintf(out, "drive %s {%s%s\n    bus = %s\n", name, identity[0] ? "    # " : "", identity,
	        db_words_text(bus, "name"));
	if (address > 0)
		fprintf(out, "    address = %lld\n", (long long)address);
	if (json_integer_value(json_object_get(bus, "axes")) > 0)
		fputs("    axis = x    # and a drive each for y, z and a, as far as it has them\n",
		      out);
	fprintf(out, "    unit = %lld\n}\n", (long long)choose_unit(taken, address));
}

char *db_setup_write_sections(const json_t *bus, const json_t *finds, const json_t *drives)
{
	json_int_t here = db_words_number(bus, "speed");
	json_int_t told = here;
	json_t *taken = json_object();
	char key[24];
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);
	size_t i;
	const json_t *one;

	json_array_foreach(drives, i, one)
	{
		snprintf(key, sizeof(key), "%lld", (long long)db_words_number(one, "unit"));
		/* The same unit of another endpoint is free for these. */
		if (db_words_text(one, "endpoint")[0] == '\0')
			(void)json_object_set_new(taken, key, json_true());
		(void)json_object_set_new(taken, db_words_text(one, "name"), json_true());
	}
	json_array_foreach(finds, i, one)
	{
		json_int_t speed = db_words_number(one, "speed");

		if (!out || strcmp(db_words_text(one, "verdict"), "one") != 0 ||
		    json_array_size(json_object_get(one, "drives")) > 0)
			continue;
		if (speed != told && speed != here)
			fprintf(out,
			        "# at %lld bit/s, while bus %s is set to %lld: all drives of a bus "
			        "and its %s must be the same\n",
			        (long long)speed, db_words_text(bus, "name"), (long long)here,
			        db_setup_speed_key(bus));
		told = speed;
		write_drive(out, bus, one, taken);
	}
	json_decref(taken);
	if (out)
		(void)fclose(out);
	return text;
}
