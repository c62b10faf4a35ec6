/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct scan {
	const char *at;
	bool quoted;
};

/*
 * The next word of a configuration that begins with /dev/: in quotes, or up to a character that a
 * bare word cannot have. The scan continues after it. NULL: there is none.
 */
static const char *next_port(struct scan *scan, size_t *length)
{
	for (; *scan->at; scan->at++) {
		if (!scan->quoted && *scan->at == '#') {
			scan->at += strcspn(scan->at, "\n");
			if (!*scan->at)
				return NULL;
		} else if (*scan->at == '"') {
			scan->quoted = !scan->quoted;
		} else if (*scan->at == '\n') {
			scan->quoted = false;
		} else if (strncmp(scan->at, "/dev/", 5) == 0) {
			*length = strcspn(scan->at, scan->quoted ? "\"\n" : " \t\r\n\"#{},;=");
			scan->at += *length;
			return scan->at - *length;
		}
	}
	return NULL;
}

void db_ctl_ports_find(const char *text, json_t *ports)
{
	struct scan scan = { .at = text };
	const char *found;
	size_t length = 0;

	while ((found = next_port(&scan, &length)) != NULL) {
		json_t *port = json_stringn(found, length);
		bool known = false;
		size_t i;
		const json_t *other;

		json_array_foreach(ports, i, other) known = known || json_equal(port, other);
		if (!known)
			(void)json_array_append(ports, port);
		json_decref(port);
	}
}

char *db_ctl_ports_replace(const char *text, const json_t *others)
{
	char *replaced = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&replaced, &size);
	struct scan scan = { .at = text };
	const char *from = text;
	const char *port;
	size_t length = 0;

	if (!out)
		return NULL;
	while ((port = next_port(&scan, &length)) != NULL) {
		char *name = strndup(port, length);
		const char *other = name ? json_string_value(json_object_get(others, name)) : NULL;

		(void)fwrite(from, 1, (size_t)(port - from), out);
		fputs(other ? other : name ? name : "", out);
		free(name);
		from = port + length;
	}
	fputs(from, out);
	return fclose(out) == 0 ? replaced : NULL;
}
