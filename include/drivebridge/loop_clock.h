/* SPDX-License-Identifier: Apache-2.0 */
/* The time at which an event loop began to serve what is ready. */
#ifndef DRIVEBRIDGE_LOOP_CLOCK_H
#define DRIVEBRIDGE_LOOP_CLOCK_H

#include "drivebridge/time.h"

#include <stdint.h>
#include <systemd/sd-event.h>
#include <time.h>

static inline db_time db_loop_now(sd_event *loop)
{
	uint64_t us = 0;

	(void)sd_event_now(loop, CLOCK_MONOTONIC, &us);
	return (db_time)us * DB_NS_PER_US;
}

#endif
