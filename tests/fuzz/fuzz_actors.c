/* SPDX-License-Identifier: Apache-2.0 */
/* Any name of somebody for whom a session acts: what is taken is what jansson takes as UTF-8, short, and nothing that
 * breaks a line; and it comes back as it was. Names between zero bytes come and go in a table. */
#include "control/actors.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void take(struct db_actors *actors, const char *name)
{
	json_t *text;
	uint32_t number;
	const struct db_actor *actor;

	if (!db_actors_name_is_good(name))
		return;
	text = json_string(name);
	if (!text || strlen(name) >= DB_CLIENT_USER_MAX || strpbrk(name, "\r\n\t\x1B\x7F"))
		abort();
	json_decref(text);
	number = db_actors_hold(actors, 1000, "anna", name);
	actor = db_actors_find(actors, number);
	if (!actor || strcmp(actor->named, name) != 0 || actor->sessions == 0)
		abort();
	db_actors_let_go(actors, number);
	if (db_actors_find(actors, number) != actor)
		abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct db_actors *actors = calloc(1, sizeof *actors);
	char *names = malloc(size + 1);

	if (!actors || !names)
		abort();
	memcpy(names, data, size);
	names[size] = '\0';
	for (size_t at = 0; at <= size; at += strlen(names + at) + 1)
		take(actors, names + at);
	free(names);
	free(actors);
	return 0;
}
