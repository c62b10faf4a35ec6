/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <string.h>

void db_ctl_csv_add_text(FILE *file, bool first, const char *text)
{
	if (!first)
		fputc(',', file);
	if (!text)
		return;
	if (!strpbrk(text, ",\"\r\n")) {
		fputs(text, file);
		return;
	}
	fputc('"', file);
	for (; *text; text++) {
		if (*text == '"')
			fputc('"', file);
		fputc(*text, file);
	}
	fputc('"', file);
}

void db_ctl_csv_add_value(FILE *file, bool first, const json_t *value)
{
	char text[64];

	if (json_is_string(value)) {
		db_ctl_csv_add_text(file, first, json_string_value(value));
		return;
	}
	text[0] = '\0';
	if (json_is_boolean(value))
		snprintf(text, sizeof(text), "%d", json_is_true(value));
	else if (json_is_integer(value))
		snprintf(text, sizeof(text), "%lld", (long long)json_integer_value(value));
	else if (json_is_real(value))
		snprintf(text, sizeof(text), "%.9g", json_real_value(value));
	db_ctl_csv_add_text(file, first, text);
}

void db_ctl_csv_end_line(FILE *file)
{
	fputs("\r\n", file);
}
