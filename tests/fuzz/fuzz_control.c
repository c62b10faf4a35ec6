/* SPDX-License-Identifier: Apache-2.0 */
/* Any message to the control socket: it is a call, or what is wrong with it is said; its parameters go out again
 * in an answer that is one message. */
#include "control/message.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct db_message message;
	const char *wrong;
	size_t length = 0;
	char *text;

	if (size > DB_MESSAGE_MAX)
		return 0;
	wrong = db_message_parse((const char *)data, size, &message);
	if (wrong) {
		if (wrong[0] == '\0' || message.root)
			abort();
		return 0;
	}
	if (!message.method || (message.parameters && !json_is_object(message.parameters)))
		abort();
	text = db_message_answer(message.method, json_incref(message.parameters), message.more,
	                         &length);
	if (!text || text[length - 1] != '\0' || strlen(text) != length - 1)
		abort();
	free(text);
	db_message_clear(&message);
	return 0;
}
