/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The network thread's loop: signals, buses' completions, the first client that waits no longer,
 * and systemd's watchdog. Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_LOOP_H
#define DRIVEBRIDGE_SERVICE_LOOP_H

#include "drivebridge/time.h"

#include <stdbool.h>

struct service;

/* With the plant's buses watched; the registers come later, but before it runs. 0 or a negative
 * errno. */
int loop_new(struct service *service);

/* Does nothing where systemd does not want it. 0 or a negative errno. A hung bus thread is as bad
 * as a hung network: both must turn for systemd to be content. */
int loop_feed_watchdog(struct service *service);

/* Whether every bus's thread has turned within half of systemd's patience; one that has not is
 * logged. */
bool loop_buses_are_alive(struct service *service, db_time now);

void loop_free(struct service *service);

#endif
