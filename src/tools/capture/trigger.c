/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/trigger.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

#define FORM "right is DRIVE.NAME=VALUE, with one of = != > <"

const char *db_capture_trigger_split(const char *text, struct db_capture_trigger *trigger,
                                     const char **value)
{
	const char *sign = strpbrk(text, "=!<>");
	const char *dot = strchr(text, '.');

	*trigger = (struct db_capture_trigger){ .relation = DB_CAPTURE_EQUAL };
	if (!sign || !dot || dot > sign)
		return FORM;
	if ((size_t)(dot - text) >= sizeof(trigger->drive) ||
	    (size_t)(sign - dot - 1) >= sizeof(trigger->name) || dot == text || sign == dot + 1)
		return FORM;
	memcpy(trigger->drive, text, (size_t)(dot - text));
	memcpy(trigger->name, dot + 1, (size_t)(sign - dot - 1));
	if (sign[0] == '!' && sign[1] != '=')
		return FORM;
	trigger->relation = sign[0] == '=' ? DB_CAPTURE_EQUAL :
	                    sign[0] == '!' ? DB_CAPTURE_UNEQUAL :
	                    sign[0] == '>' ? DB_CAPTURE_ABOVE :
	                                     DB_CAPTURE_BELOW;
	*value = sign + (sign[0] == '!' ? 2 : 1);
	return **value == '\0' ? FORM : NULL;
}

bool db_capture_trigger_set(struct db_capture_trigger *trigger, const json_t *reg,
                            const char *value, char *problem, size_t size)
{
	const char *type = json_string_value(json_object_get(reg, "type"));
	json_t *parsed;

	trigger->bits = type && strncmp(type, "bits", 4) == 0;
	if (type && strcmp(type, "text") == 0) {
		snprintf(problem, size, "a text cannot be waited for");
		return false;
	}
	if (trigger->bits && trigger->relation >= DB_CAPTURE_ABOVE) {
		snprintf(problem, size, "bits are set (=) or not (!=), not more or less");
		return false;
	}
	parsed = db_words_parse_value(reg, value, problem, size);
	if (!parsed)
		return false;
	trigger->mask = json_integer_value(parsed);
	trigger->value = json_is_boolean(parsed) ? json_is_true(parsed) : json_number_value(parsed);
	json_decref(parsed);
	if (trigger->bits && trigger->mask == 0) {
		snprintf(problem, size, "right is the name of a bit");
		return false;
	}
	return true;
}

bool db_capture_trigger_take(struct db_capture_trigger *trigger, const json_t *values)
{
	const json_t *value = json_object_get(values, trigger->name);
	double number = json_is_boolean(value) ? json_is_true(value) : json_number_value(value);
	bool equal = trigger->bits ? (json_integer_value(value) & trigger->mask) == trigger->mask :
	                             number == trigger->value;
	bool met = equal;
	bool comes;

	if (!json_is_number(value) && !json_is_boolean(value))
		return false;
	if (trigger->relation == DB_CAPTURE_ABOVE)
		met = number > trigger->value;
	else if (trigger->relation == DB_CAPTURE_BELOW)
		met = number < trigger->value;
	else if (trigger->relation == DB_CAPTURE_UNEQUAL)
		met = !equal;
	comes = met && trigger->known && !trigger->met;
	trigger->known = true;
	trigger->met = met;
	return comes;
}
