/* SPDX-License-Identifier: Apache-2.0 */
/* Any text: the reader must not crash or leak, and a refused text has a message with a line and a
 * reason. What follows a line "--- profile" is the profile p. */
#include "config/config_private.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define CUT "\n--- profile\n"

/* Takes the text over. */
static int load_text(char *text, FILE *errors, struct db_config **config)
{
	struct db_source *sources = calloc(2, sizeof *sources);
	char *profile = strstr(text, CUT);

	if (!sources)
		abort();
	if (profile)
		profile[1] = '\0';
	sources[0] = (struct db_source){ .path = strdup("f"), .text = text };
	if (profile)
		sources[1] = (struct db_source){
			.path = strdup("p"),
			.text = strdup(profile + strlen(CUT)),
			.profile = true,
		};
	return db_load_sources(&db_load_built_in, sources, profile ? 2 : 1, errors, config);
}

/* "f:12: ...", or "p:...". */
static bool has_place(const char *message)
{
	return (message[0] == 'f' || message[0] == 'p') && message[1] == ':' && message[2] != ' ';
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct db_config *config = NULL;
	char *messages = NULL, *text;
	size_t length = 0;
	FILE *errors;

	if (size > 16384)
		return 0;
	text = strndup((const char *)data, size);
	errors = open_memstream(&messages, &length);
	if (!text || !errors)
		abort();
	if (load_text(text, errors, &config) == 0) {
		db_config_describe(config, errors);
		db_config_free(config);
	} else {
		fflush(errors);
		/* Without a line: out of memory, and there was enough. Comes first. */
		if (!has_place(messages))
			abort();
	}
	fclose(errors);
	free(messages);
	return 0;
}
