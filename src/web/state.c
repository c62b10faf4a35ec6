/* SPDX-License-Identifier: Apache-2.0 */
#include "web/state.h"

#include <time.h>

db_time db_web_clock(void)
{
	struct timespec time;

	(void)clock_gettime(CLOCK_MONOTONIC, &time);
	return (db_time)time.tv_sec * DB_NS_PER_S + time.tv_nsec;
}

void db_web_server_wake(struct db_web_server *server)
{
	(void)sd_event_source_set_enabled(server->turn, SD_EVENT_ONESHOT);
}
