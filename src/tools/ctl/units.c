/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/units.h"
#include "words/value.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

const char *db_ctl_users_unit(const json_t *registers, const json_t *reg)
{
	static const struct {
		const char *own;
		const char *users;
	} pairs[] = { { "position", "position_units" }, { "velocity", "velocity_units" } };
	const char *of_position = db_words_text(db_words_look_up(registers, "position"), "unit");
	const char *unit = db_words_text(reg, "unit");

	for (size_t i = 0; unit[0] != '\0' && i < sizeof(pairs) / sizeof(pairs[0]); i++) {
		const char *own = db_words_text(db_words_look_up(registers, pairs[i].own), "unit");
		const char *users = db_words_text(db_words_look_up(registers, pairs[i].users),
		                                  "unit");

		/* counts_per_unit only fits registers that count in the position's unit. */
		if (strcmp(unit, own) == 0 && strncmp(own, of_position, strlen(of_position)) == 0 &&
		    users[0] != '\0' && strncmp(users, "user units", strlen("user units")) != 0)
			return users;
	}
	return NULL;
}

/* Where the unit begins after a number, NULL when there is no number or no unit. */
static const char *find_unit(const char *text)
{
	const char *digits = text + strspn(text, "+-");
	char *end = NULL;

	if (strncasecmp(digits, "0x", 2) == 0 || digits[strspn(digits, "0123456789.")] == '\0' ||
	    strspn(digits, "0123456789.") == 0)
		return NULL;
	(void)strtod(text, &end);
	end += strspn(end, " ");
	return *end != '\0' ? end : NULL;
}

json_t *db_ctl_parse_quantity(const json_t *reg, const char *users, double per_unit,
                              const char *text, char *problem, size_t size)
{
	const char *type = db_words_text(reg, "type");
	const char *unit = strcmp(type, "text") == 0 || strcmp(type, "bool") == 0 ||
	                                   strncmp(type, "bits", 4) == 0 ?
	                           NULL :
	                           find_unit(text);
	const char *regs = db_words_text(reg, "unit");
	bool own = unit && strcmp(unit, regs) == 0;
	char number[64];
	size_t length;

	if (!unit)
		return db_words_parse_value(reg, text, problem, size);
	if (!own && (!users || strcmp(unit, users) != 0)) {
		if (regs[0] == '\0')
			snprintf(problem, size, "it has no unit, and \"%s\" is none of it", unit);
		else if (users)
			snprintf(problem, size, "\"%s\" is no unit of it; right are %s and %s",
			         unit, regs, users);
		else
			snprintf(problem, size, "\"%s\" is no unit of it; right is %s", unit, regs);
		return NULL;
	}
	if (own) {
		length = (size_t)(unit - text);
		while (length > 0 && text[length - 1] == ' ')
			length--;
		snprintf(number, sizeof(number), "%.*s", (int)length, text);
	} else if (!(per_unit > 0.0) || !isfinite(per_unit)) {
		snprintf(problem, size, "how many %s one %s is is not known", regs, users);
		return NULL;
	} else if (strcmp(type, "f32") == 0) {
		snprintf(number, sizeof(number), "%.10g", strtod(text, NULL) * per_unit);
	} else {
		/* A register's range is far within the integers that a double holds exactly;
		 * numbers beyond it are refused in any case. */
		snprintf(number, sizeof(number), "%.0f",
		         fmax(-1e18, fmin(1e18, round(strtod(text, NULL) * per_unit))));
	}
	return db_words_parse_value(reg, number, problem, size);
}

/* The configured number, which the register has in single precision: 640.1, not 640.099976. */
static double read_as_written(double value)
{
	char text[32];

	for (int digits = 6; digits <= 9; digits++) {
		snprintf(text, sizeof(text), "%.*g", digits, value);
		if (strtof(text, NULL) == (float)value)
			break;
	}
	return strtod(text, NULL);
}

double db_ctl_read_scale(struct db_ctl *ctl, const char *drive)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *answer = NULL;
	double scale = 0.0;

	if (db_client_call(ctl->client, "Read",
	                   json_pack("{s:s, s:[s]}", "drive", drive, "names", "counts_per_unit"),
	                   DB_CTL_TIMEOUT_MS, &answer, &error) == 0)
		scale = read_as_written(json_number_value(
			json_object_get(json_object_get(answer, "values"), "counts_per_unit")));
	db_client_error_clear(&error);
	json_decref(answer);
	return scale;
}

json_t *db_ctl_read_quantity(struct db_ctl *ctl, const char *drive, const json_t *registers,
                             const json_t *reg, const char *text, char *problem, size_t size)
{
	const char *users = db_ctl_users_unit(registers, reg);
	const char *unit = find_unit(text);
	double per_unit = 0.0;

	if (users && unit && strcmp(unit, users) == 0)
		per_unit = db_ctl_read_scale(ctl, drive);
	return db_ctl_parse_quantity(reg, users, per_unit, text, problem, size);
}
