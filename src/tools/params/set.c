/* SPDX-License-Identifier: Apache-2.0 */
#include "params/set.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

void db_params_clear(struct db_params *params)
{
	json_decref(params->values);
	json_decref(params->missing);
	json_decref(params->ages);
	*params = (struct db_params){ .values = NULL };
}

bool db_params_has_name(const json_t *names, const char *name)
{
	size_t i;
	const json_t *item;

	json_array_foreach(names, i, item)
	{
		if (json_is_string(item) && strcmp(json_string_value(item), name) == 0)
			return true;
	}
	return false;
}

bool db_params_has_trait(const json_t *reg, const char *trait)
{
	return db_params_has_name(json_object_get(reg, "traits"), trait);
}

bool db_params_is_kept(const json_t *reg)
{
	return json_is_true(json_object_get(reg, "parameter")) &&
	       !db_params_has_trait(reg, "derived") && !db_params_has_trait(reg, "action") &&
	       !db_params_has_trait(reg, "secret");
}

/* --- a drive's -------------------------------------------------------------------------------- */

json_t *db_params_names(const json_t *registers)
{
	json_t *names = json_pack("[s,s]", "status", "identity");
	size_t i;
	const json_t *reg;

	json_array_foreach(registers, i, reg)
	{
		if (json_is_true(json_object_get(reg, "parameter")))
			(void)json_array_append(names, json_object_get(reg, "name"));
	}
	return names;
}

bool db_params_take(struct db_params *params, const char *name, const char *family,
                    const json_t *registers, const json_t *answer)
{
	json_t *values = json_object_get(answer, "values");

	*params = (struct db_params){
		.values = json_incref(values),
		.missing = json_incref(json_object_get(answer, "missing")),
		.ages = json_incref(json_object_get(answer, "ages_ms")),
		.registers = registers,
	};
	snprintf(params->name, sizeof(params->name), "%s", name);
	snprintf(params->family, sizeof(params->family), "%s", family);
	snprintf(params->identity, sizeof(params->identity), "%s",
	         db_words_text(values, "identity"));
	return db_words_has_bit(db_words_look_up(registers, "status"),
	                        json_object_get(values, "status"), "params_valid");
}

json_t *db_params_untold(const struct db_params *drive)
{
	json_t *untold = json_array();
	size_t i;
	const json_t *reg;

	json_array_foreach(drive->registers, i, reg)
	{
		const char *name = db_words_text(reg, "name");

		if (db_params_is_kept(reg) && !db_params_value(drive, name) &&
		    !db_params_has_name(drive->missing, name))
			(void)json_array_append(untold, json_object_get(reg, "name"));
	}
	return untold;
}

json_int_t db_params_oldest_ms(const struct db_params *drive)
{
	json_int_t oldest = -1;
	const char *name;
	json_t *age;

	json_object_foreach(drive->ages, name, age)
	{
		if (json_integer_value(age) > oldest)
			oldest = json_integer_value(age);
	}
	return oldest;
}

void db_params_take_defaults(const struct db_params *like, struct db_params *params)
{
	size_t i;
	const json_t *reg;

	*params = (struct db_params){ .name = "default",
		                      .values = json_object(),
		                      .registers = like->registers };
	json_array_foreach(like->registers, i, reg)
	{
		json_t *preset = json_object_get(reg, "default");

		if (json_is_number(preset))
			(void)json_object_set(params->values, db_words_text(reg, "name"), preset);
	}
}

/* --- differences ------------------------------------------------------------------------------ */

const json_t *db_params_value(const struct db_params *params, const char *name)
{
	const json_t *value = json_object_get(params->values, name);

	return json_is_number(value) ? value : NULL;
}

bool db_params_agree(const json_t *one, const json_t *other)
{
	double difference;

	if (!json_is_number(one) || !json_is_number(other))
		return json_is_number(one) == json_is_number(other);
	if (json_is_integer(one) && json_is_integer(other))
		return json_integer_value(one) == json_integer_value(other);
	/* Fractions have single precision in the drive. */
	difference = (double)(float)json_number_value(one) -
	             (double)(float)json_number_value(other);
	return !(difference < 0.0 || difference > 0.0);
}

/* Every name that at least one of both sets may have. */
static json_t *list_names(const struct db_params *one, const struct db_params *other)
{
	const json_t *registers = one->registers ? one->registers : other->registers;
	json_t *names = json_array();
	const char *name;
	size_t i;
	json_t *item;

	json_array_foreach(registers, i, item)
	{
		if (db_params_is_kept(item))
			(void)json_array_append(names, json_object_get(item, "name"));
	}
	if (registers)
		return names;
	json_object_foreach(one->values, name, item)
	{
		(void)json_array_append_new(names, json_string(name));
	}
	json_object_foreach(other->values, name, item)
	{
		if (!json_object_get(one->values, name))
			(void)json_array_append_new(names, json_string(name));
	}
	return names;
}

json_t *db_params_compare(const struct db_params *one, const struct db_params *other)
{
	bool of_defaults = strcmp(one->name, "default") == 0 || strcmp(other->name, "default") == 0;
	json_t *names = list_names(one, other);
	json_t *differ = json_array();
	size_t i;
	json_t *item;

	json_array_foreach(names, i, item)
	{
		const json_t *value = db_params_value(one, json_string_value(item));
		const json_t *beside = db_params_value(other, json_string_value(item));

		if (!db_params_agree(value, beside) && !(of_defaults && (!value || !beside)))
			(void)json_array_append(differ, item);
	}
	json_decref(names);
	return differ;
}

/* --- writing ---------------------------------------------------------------------------------- */

enum { RANKS = 4 };

static int rank_of(const json_t *reg)
{
	return db_params_has_trait(reg, "address") ? RANKS - 1 :
	       db_params_has_trait(reg, "first")   ? 0 :
	       db_params_has_trait(reg, "last")    ? 2 :
	                                             1;
}

json_t *db_params_order(const json_t *registers, const json_t *names)
{
	json_t *plan = json_array();

	for (int rank = 0; rank < RANKS; rank++) {
		json_t *group = NULL; /* the latest one, while more names may join it */
		size_t i;
		const json_t *reg;

		json_array_foreach(registers, i, reg)
		{
			json_t *name = json_object_get(reg, "name");

			if (rank_of(reg) != rank ||
			    !db_params_has_name(names, db_words_text(reg, "name")))
				continue;
			if (group && db_params_has_trait(reg, "together")) {
				(void)json_array_append(group, name);
				continue;
			}
			group = json_pack("[O]", name);
			(void)json_array_append_new(plan, group);
			if (!db_params_has_trait(reg, "together"))
				group = NULL;
		}
	}
	return plan;
}

void db_params_find_changes(const struct db_params *drive, const struct db_params *file,
                            struct db_params_changes *changes)
{
	json_t *differ = db_params_compare(drive, file);
	size_t i;
	json_t *name;

	*changes = (struct db_params_changes){ .settings = json_array(),
		                               .addresses = json_array(),
		                               .states = json_array() };
	json_array_foreach(differ, i, name)
	{
		const json_t *reg = db_words_look_up(drive->registers, json_string_value(name));

		if (!db_params_value(file, json_string_value(name)))
			continue;
		(void)json_array_append(db_params_has_trait(reg, "state")   ? changes->states :
		                        db_params_has_trait(reg, "address") ? changes->addresses :
		                                                              changes->settings,
		                        name);
	}
	json_decref(differ);
}

void db_params_clear_changes(struct db_params_changes *changes)
{
	json_decref(changes->settings);
	json_decref(changes->addresses);
	json_decref(changes->states);
	*changes = (struct db_params_changes){ .settings = NULL };
}
