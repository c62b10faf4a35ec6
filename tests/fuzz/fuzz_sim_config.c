/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Any text as the simulator's configuration, whose files may say more than the service's: the
 * reader must not crash or leak, and a refused text has a message with a reason.
 */
#include "sim/sim_config.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct sim_config config;
	char *messages = NULL, *text;
	size_t length = 0;
	FILE *errors;
	int result;

	if (size > 16384)
		return 0;
	text = strndup((const char *)data, size);
	errors = open_memstream(&messages, &length);
	if (!text || !errors)
		abort();
	setenv("FUZZ", "a value", 1);
	result = sim_config_parse(text, "f", errors, &config);
	fclose(errors);
	/* Without a line it is that there is nothing to simulate, or out of memory, and there was
	 * enough. */
	if (result != 0 && (strncmp(messages, "f:", 2) != 0 ||
	                    (messages[2] == ' ' && !strstr(messages, "at least one bus"))))
		abort();
	if (result == 0)
		sim_config_free(&config);
	free(messages);
	free(text);
	return 0;
}
