/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/assign.h"
#include "ctl/units.h"

#include <stdio.h>
#include <string.h>

/* The first register that has no value yet. */
static const json_t *find_next(const struct db_ctl_assignable *to, const json_t *values)
{
	size_t i;
	const json_t *reg;

	json_array_foreach(to->taken, i, reg)
	{
		if (!json_object_get(values, db_words_text(reg, "name")))
			return reg;
	}
	return NULL;
}

/* Reads one argument into `values`. */
static enum db_ctl_status read_one(struct db_ctl *ctl, const struct db_ctl_assignable *to,
                                   const char *argument, json_t *values)
{
	const char *equals = strchr(argument, '=');
	const char *text = equals ? equals + 1 : argument;
	const json_t *reg = NULL;
	char name[128];
	char problem[256] = "";
	json_t *value;

	if (!equals && to->in_order) {
		reg = find_next(to, values);
		if (!reg)
			return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
			                       "%s \"%s\"", to->unknown, argument);
	} else if (!equals || equals == argument || (size_t)(equals - argument) >= sizeof(name)) {
		return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
		                       "\"%s\": right is NAME=VALUE", argument);
	} else {
		snprintf(name, sizeof(name), "%.*s", (int)(equals - argument), argument);
		reg = db_ctl_find(ctl, to->taken, name, DB_CLIENT_SERVICE "NoSuchRegister",
		                  to->unknown);
	}
	if (!reg)
		return DB_CTL_USAGE;
	snprintf(name, sizeof(name), "%s", db_words_text(reg, "name"));
	if (!json_is_true(json_object_get(reg, "writable")))
		return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
		                       "%s can only be read", name);
	value = db_ctl_read_quantity(ctl, to->drive, to->registers, reg, text, problem,
	                             sizeof(problem));
	if (!value)
		return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue", "%s: %s",
		                       name, problem);
	(void)json_object_set_new(values, name, value);
	return DB_CTL_OK;
}

json_t *db_ctl_read_assignments(struct db_ctl *ctl, const struct db_ctl_assignable *to, int count,
                                char **arguments, enum db_ctl_status *status)
{
	json_t *values = json_object();

	*status = DB_CTL_OK;
	for (int i = 0; i < count && *status == DB_CTL_OK; i++)
		*status = read_one(ctl, to, arguments[i], values);
	if (*status == DB_CTL_OK)
		return values;
	json_decref(values);
	return NULL;
}
