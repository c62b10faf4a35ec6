/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/transport.h"

#include <string.h>

const struct db_transport *const db_transports[] = {
	&db_transport_serial,
	&db_transport_socketcan,
	&db_transport_slcan,
	NULL,
};

const struct db_transport *db_transport_find(const char *name)
{
	for (size_t i = 0; db_transports[i]; i++) {
		if (strcmp(db_transports[i]->name, name) == 0)
			return db_transports[i];
	}
	return NULL;
}
