/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/asker.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool db_commission_choose(const char *choices, const char *text, char *answer, size_t size)
{
	size_t length = strlen(text);
	unsigned found = 0;
	char *end = NULL;
	double number;

	if (choices[0] == '\0') {
		number = strtod(text, &end);
		snprintf(answer, size, "%s", text);
		return end != text && *end == '\0' && isfinite(number) && number > 0;
	}
	for (const char *at = choices; *at && length > 0;) {
		size_t word = strcspn(at, " ");
		bool whole = word == length;

		/* An answer that lets a motor turn has to be written in full. */
		if (word >= length && strncmp(at, text, length) == 0 &&
		    (whole || strncmp(at, "yes", word) != 0)) {
			found = whole ? 1 : found + 1;
			snprintf(answer, size, "%.*s", (int)word, at);
			if (whole)
				return true;
		}
		at += word + strspn(at + word, " ");
	}
	return found == 1;
}
