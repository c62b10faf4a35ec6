/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/description.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void db_description_begin(struct db_description *description)
{
	description->address = DB_DESCRIBED_NOBODY;
	description->axis = -1;
	description->secret = false;
	description->length = 0;
	description->text[0] = '\0';
}

void db_description_add(struct db_description *description, const char *format, ...)
{
	size_t room = sizeof(description->text) - description->length;
	va_list arguments;
	int length;

	va_start(arguments, format);
	length = vsnprintf(description->text + description->length, room, format, arguments);
	va_end(arguments);
	if (length > 0)
		description->length += (size_t)length < room ? (size_t)length : room - 1;
}

void db_description_add_float(struct db_description *description, float number, const char *unit)
{
	char text[64];

	for (int digits = 6; digits <= 9; digits++) {
		snprintf(text, sizeof(text), "%.*g", digits, (double)number);
		if (strtof(text, NULL) == number)
			break;
	}
	db_description_add(description, "%s%s%s", text, unit[0] ? " " : "", unit);
}

void db_description_add_param(struct db_description *description, const struct db_param *param,
                              union db_value value)
{
	const char *gap = param->unit[0] ? " " : "";

	db_description_add(description, "%s ", param->name);
	if (param->type == DB_F32)
		db_description_add_float(description, value.f, param->unit);
	else if (param->type == DB_I16 || param->type == DB_I32)
		db_description_add(description, "%ld%s%s", (long)value.i, gap, param->unit);
	else
		db_description_add(description, "%lu%s%s", (unsigned long)value.u, gap,
		                   param->unit);
}

void db_description_add_bits(struct db_description *description, const struct db_drive_bit *bits,
                             size_t count, uint32_t value)
{
	const char *gap = "";

	if (value == 0)
		db_description_add(description, "none");
	for (unsigned bit = 0; bit < 32; bit++) {
		const char *name = NULL;

		if (!(value >> bit & 1))
			continue;
		for (size_t i = 0; i < count; i++) {
			if (bits[i].bit == bit)
				name = bits[i].name;
		}
		if (name)
			db_description_add(description, "%s%s", gap, name);
		else
			db_description_add(description, "%sbit %u", gap, bit);
		gap = " ";
	}
}
