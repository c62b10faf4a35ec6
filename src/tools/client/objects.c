/* SPDX-License-Identifier: Apache-2.0 */
#include "client/objects.h"

#include <string.h>

const char *db_client_text(const json_t *object, const char *key)
{
	const char *text = json_string_value(json_object_get(object, key));

	return text ? text : "";
}

json_t *db_client_named(const json_t *objects, const char *name)
{
	size_t i;
	json_t *object;

	json_array_foreach(objects, i, object)
	{
		if (strcmp(db_client_text(object, "name"), name) == 0)
			return object;
	}
	return NULL;
}

bool db_client_has_text(const json_t *texts, const char *text)
{
	size_t i;
	const json_t *one;

	json_array_foreach(texts, i, one)
	{
		if (json_is_string(one) && strcmp(json_string_value(one), text) == 0)
			return true;
	}
	return false;
}
