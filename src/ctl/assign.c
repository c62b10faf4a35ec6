/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/assign.h"
#include "ctl/value.h"

#include <stdio.h>
#include <string.h>

/* One of them into `values`. */
static enum db_ctl_status read_one(const struct db_ctl *ctl, const json_t *registers,
                                   const char *unknown, const char *argument, json_t *values)
{
	const char *equals = strchr(argument, '=');
	char name[128];
	char problem[256] = "";
	const json_t *reg;
	json_t *value;

	if (!equals || equals == argument || (size_t)(equals - argument) >= sizeof(name))
		return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
		                       "\"%s\": right is NAME=VALUE", argument);
	(void)snprintf(name, sizeof(name), "%.*s", (int)(equals - argument), argument);
	reg = db_ctl_find(ctl, registers, name, DB_CLIENT_SERVICE "NoSuchRegister", unknown);
	if (!reg)
		return DB_CTL_USAGE;
	if (!json_is_true(json_object_get(reg, "writable")))
		return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue",
		                       "%s can only be read", name);
	value = db_ctl_parse_value(reg, equals + 1, problem, sizeof(problem));
	if (!value)
		return db_ctl_complain(ctl, DB_CTL_USAGE, DB_CLIENT_SERVICE "BadValue", "%s: %s",
		                       name, problem);
	(void)json_object_set_new(values, name, value);
	return DB_CTL_OK;
}

json_t *db_ctl_read_assignments(const struct db_ctl *ctl, const json_t *registers,
                                const char *unknown, int count, char **arguments,
                                enum db_ctl_status *status)
{
	json_t *values = json_object();

	*status = DB_CTL_OK;
	for (int i = 0; i < count && *status == DB_CTL_OK; i++)
		*status = read_one(ctl, registers, unknown, arguments[i], values);
	if (*status == DB_CTL_OK)
		return values;
	json_decref(values);
	return NULL;
}
