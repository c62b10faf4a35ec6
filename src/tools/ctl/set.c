/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/assign.h"
#include "ctl/ctl_private.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "words/value.h"

#include <stdio.h>

enum db_ctl_status db_ctl_set(struct db_ctl *ctl, int count, char **arguments)
{
	const json_t *unit = db_ctl_find_unit(ctl, arguments[0]);
	enum db_ctl_status status = DB_CTL_USAGE;
	json_t *registers = NULL;
	json_t *values = NULL;
	json_t *answer = NULL;
	char unknown[128];
	char text[DB_WORDS_VALUE_MAX];
	const char *name;
	const json_t *value;

	if (!unit)
		return DB_CTL_USAGE;
	snprintf(unknown, sizeof(unknown), "%s has no register", arguments[0]);
	registers = db_ctl_read_registers(ctl, db_words_text(unit, "name"), &status);
	if (registers)
		values = db_ctl_read_assignments(
			ctl,
			&(struct db_ctl_assignable){ .drive = db_words_text(unit, "name"),
		                                     .registers = registers,
		                                     .taken = registers,
		                                     .unknown = unknown },
			count - 1, arguments + 1, &status);
	if (values)
		answer = db_ctl_call(ctl, "Write",
		                     json_pack("{s:O, s:O}", "drive", json_object_get(unit, "name"),
		                               "values", values),
		                     DB_CTL_DRIVE_TIMEOUT_MS, &status);
	if (answer && ctl->json) {
		(void)json_object_set_new(answer, "drive", json_string(arguments[0]));
		(void)json_object_set(answer, "values", values);
		db_ctl_print_json(answer);
	} else if (answer) {
		json_object_foreach(values, name, value)
		{
			db_words_write_value(db_words_look_up(registers, name), value, text,
			                     sizeof(text));
			printf("%s = %s: %s\n", name, text,
			       db_ctl_say_name(db_words_text(answer, "result")));
		}
	}
	json_decref(answer);
	json_decref(values);
	json_decref(registers);
	return status;
}
