/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/heartbeat.h"

#include <string.h>

bool db_heartbeat_write(struct db_heartbeat *heartbeat, const uint8_t writer[16], uint16_t value)
{
	bool same = memcmp(heartbeat->writer, writer, sizeof heartbeat->writer) == 0;
	bool beats = same && value != heartbeat->value;

	memcpy(heartbeat->writer, writer, sizeof heartbeat->writer);
	heartbeat->value = value;
	return beats;
}
