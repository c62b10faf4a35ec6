/* SPDX-License-Identifier: Apache-2.0 */
#include "client/stops.h"

#include <stddef.h>
#include <string.h>

const char *const db_client_stops[] = { "stop", "quick_stop", "disable", NULL };

bool db_client_is_stop(const char *command)
{
	for (size_t i = 0; db_client_stops[i]; i++) {
		if (strcmp(db_client_stops[i], command) == 0)
			return true;
	}
	return false;
}
