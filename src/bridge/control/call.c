/* SPDX-License-Identifier: Apache-2.0 */
#include "control/call.h"

#include "control/control_private.h"

static bool refuse(const struct db_call *call, const char *name)
{
	db_session_fail_parameter(call->session, name);
	return false;
}

bool db_call_text(const struct db_call *call, const char *name, const char **text)
{
	*text = json_string_value(json_object_get(call->parameters, name));
	return *text ? true : refuse(call, name);
}

bool db_call_number(const struct db_call *call, const char *name, int64_t min, int64_t max,
                    int64_t *number)
{
	const json_t *value = json_object_get(call->parameters, name);

	*number = json_integer_value(value);
	return json_is_integer(value) && *number >= min && *number <= max ? true :
	                                                                    refuse(call, name);
}

bool db_call_optional_flag(const struct db_call *call, const char *name, bool *flag)
{
	const json_t *value = json_object_get(call->parameters, name);

	if (!value || json_is_null(value))
		return true;
	*flag = json_is_true(value);
	return json_is_boolean(value) ? true : refuse(call, name);
}

bool db_call_optional_number(const struct db_call *call, const char *name, int64_t min, int64_t max,
                             int64_t *number, bool *given)
{
	const json_t *value = json_object_get(call->parameters, name);

	*given = value && !json_is_null(value);
	return !*given || db_call_number(call, name, min, max, number);
}

bool db_call_optional_text(const struct db_call *call, const char *name, const char **text)
{
	const json_t *value = json_object_get(call->parameters, name);

	return !value || json_is_null(value) || db_call_text(call, name, text);
}

bool db_call_object(const struct db_call *call, const char *name, bool optional, json_t **object)
{
	json_t *value = json_object_get(call->parameters, name);

	*object = NULL;
	if (optional && (!value || json_is_null(value)))
		return true;
	*object = value;
	return json_is_object(value) ? true : refuse(call, name);
}

bool db_call_texts(const struct db_call *call, const char *name, json_t **texts)
{
	const json_t *item;
	size_t i;

	*texts = json_object_get(call->parameters, name);
	if (!json_is_array(*texts))
		return refuse(call, name);
	json_array_foreach(*texts, i, item)
	{
		if (!json_is_string(item))
			return refuse(call, name);
	}
	return true;
}

bool db_call_drive(const struct db_call *call, bool gateway, struct db_named_drive *drive,
                   const char **name)
{
	if (!db_call_text(call, "drive", name))
		return false;
	if (gateway && (*name)[0] == '\0') {
		drive->number = DB_NAMED_GATEWAY;
		return true;
	}
	if (db_named_drive_find(call->session->control->setup.registers, *name, drive))
		return true;
	db_session_fail_drive(call->session, *name);
	return false;
}
