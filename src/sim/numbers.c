/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_private.h"

#include <stdlib.h>
#include <string.h>

bool sim_read_numbers(const char *text, long *numbers, size_t count, long max)
{
	for (size_t i = 0; i < count; i++) {
		char *end;

		numbers[i] = strtol(text, &end, 0);
		if (end == text || numbers[i] < 0 || numbers[i] > max)
			return false;
		text = end + strspn(end, " \t");
	}
	return *text == '\0';
}
