/* SPDX-License-Identifier: Apache-2.0 */
/* Any text: the reader must not crash or leak, and a refused text has a message with a line and a
 * reason. */
#include "config/load.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

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
	if (db_load_text(text, "f", errors, &config) == 0) {
		db_config_describe(config, errors);
		db_config_free(config);
	} else {
		fflush(errors);
		/* Without a line: out of memory, and there was enough. Comes first. */
		if (strncmp(messages, "f:", 2) != 0 || strncmp(messages, "f: ", 3) == 0)
			abort();
	}
	fclose(errors);
	free(messages);
	free(text);
	return 0;
}
