/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/types.h"
#include "opcua/names.h"

#include <stdio.h>
#include <string.h>

/* The standard's abstract type of all enumerations. */
#define ENUMERATION 29

/* Longest id. */
#define ID_MAX 160

const struct db_opcua_type_row *db_opcua_type_find(const char *id, size_t length)
{
	size_t low = 0;
	size_t high = db_opcua_type_count;

	while (low < high) {
		size_t middle = (low + high) / 2;
		const struct db_opcua_type_row *row = &db_opcua_type_rows[middle];
		int order = strncmp(id, row->id, length);

		/* Equal up to the end of the one; the other one is longer. */
		if (order == 0 && row->id[length] != '\0')
			order = -1;
		if (order == 0)
			return row;
		if (order < 0)
			high = middle;
		else
			low = middle + 1;
	}
	return NULL;
}

const struct db_opcua_type_row *db_opcua_type_of_family(const char *family)
{
	static const char of_all[] = "DriveType";
	char words[DB_OPCUA_NAME_MAX];
	char name[DB_OPCUA_NAME_MAX];
	char id[DB_OPCUA_NAME_MAX + sizeof(of_all)];
	const struct db_opcua_type_row *row;

	snprintf(words, sizeof(words), "%s", family);
	for (char *at = words; *at; at++)
		*at = *at == '-' ? '_' : *at;
	db_opcua_name_of(words, name);
	snprintf(id, sizeof(id), "%s%s", name, of_all);
	row = db_opcua_type_find(id, strlen(id));
	return row ? row : db_opcua_type_find(of_all, strlen(of_all));
}

const struct db_opcua_type_row *db_opcua_type_of_gateway(void)
{
	static const char gateway[] = "GatewayType";

	return db_opcua_type_find(gateway, strlen(gateway));
}

const struct db_opcua_type_row *db_opcua_type_of_bus(void)
{
	static const char bus[] = "BusType";

	return db_opcua_type_find(bus, strlen(bus));
}

const struct db_opcua_type_row *db_opcua_type_member(const struct db_opcua_type_row *type,
                                                     const char *path)
{
	while (type) {
		char id[ID_MAX];
		int length = snprintf(id, sizeof(id), "%s.%s", type->id, path);
		const struct db_opcua_type_row *row = NULL;

		if (length > 0 && (size_t)length < sizeof(id))
			row = db_opcua_type_find(id, (size_t)length);
		if (row)
			return row;
		type = type->above >= 0 ? &db_opcua_type_rows[type->above] : NULL;
	}
	return NULL;
}

bool db_opcua_type_has_vendor(const struct db_opcua_type_row *type)
{
	return db_opcua_type_member(type, "Identification.Model") != NULL;
}

const struct db_opcua_type_row *db_opcua_type_data(const struct db_opcua_type_row *row)
{
	return row && row->data >= 0 ? &db_opcua_type_rows[row->data] : NULL;
}

bool db_opcua_type_is_enumeration(const struct db_opcua_type_row *data)
{
	return data->standard == ENUMERATION;
}

const char *db_opcua_type_name(const struct db_opcua_type_row *row)
{
	const char *dot = strrchr(row->id, '.');

	return dot ? dot + 1 : row->id;
}
