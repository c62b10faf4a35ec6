/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Any text as a file of parameters, of a family that is known and of one that is not: the reader must not crash or
 * leak.
 *
 * What must hold: a refused text has a message with a reason; one that is taken has only values that the family's
 * parameters may have, and written and read again it says the same.
 */
#include "fakes/must.h"
#include "params/file.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define PARAMETER(name, type, min, max) \
	name, "type", type, "unit", "", "parameter", 1, "min", (double)(min), "max", (double)(max)

static json_t *make_families(void)
{
	return json_pack("{s:[{s:s, s:s, s:s, s:b, s:f, s:f}, {s:s, s:s, s:s, s:b, s:f, s:f},"
	                 "{s:s, s:s, s:s, s:b, s:f, s:f}]}",
	                 "vsmd-serial", "name", PARAMETER("spd", "f32", -192000, 192000), "name",
	                 PARAMETER("mcs", "u16", 0, 8), "name",
	                 PARAMETER("zsp", "i32", INT32_MIN, INT32_MAX));
}

static bool read_text(struct db_params *params, const char *text, const json_t *families)
{
	char *said = NULL;
	size_t length = 0;
	FILE *errors = open_memstream(&said, &length);
	bool right;

	must(errors);
	right = db_params_read(params, "f", text, families, errors);
	fclose(errors);
	must(right == (length == 0));
	must(right || strncmp(said, "f:", 2) == 0);
	free(said);
	return right;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	json_t *families = make_families();
	struct db_params params;
	struct db_params again;
	char *text = size <= 4096 ? strndup((const char *)data, size) : NULL;
	char *written;
	json_t *differ;
	size_t i;
	const json_t *reg;

	must(families);
	if (text && read_text(&params, text, families) && params.registers) {
		json_array_foreach(params.registers, i, reg)
		{
			const json_t *value = db_params_value(
				&params, json_string_value(json_object_get(reg, "name")));

			must(!value || (json_number_value(value) >=
			                        json_number_value(json_object_get(reg, "min")) &&
			                json_number_value(value) <=
			                        json_number_value(json_object_get(reg, "max"))));
		}
		written = db_params_write(&params);
		must(written && read_text(&again, written, families));
		differ = db_params_compare(&params, &again);
		must(json_array_size(differ) == 0);
		must(strcmp(params.identity, again.identity) == 0);
		json_decref(differ);
		free(written);
		db_params_clear(&again);
	}
	if (text)
		db_params_clear(&params);
	free(text);
	json_decref(families);
	return 0;
}
