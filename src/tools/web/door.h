/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The port on which browsers connect. A connection that may not come in is not closed at once: a
 * program that opens a new one wherever one is closed would keep the server busy. It is held for a
 * second, and nothing is read from it. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_DOOR_H
#define DRIVEBRIDGE_WEB_DOOR_H

#include "drivebridge/time.h"
#include "web/config.h"

#include <stdbool.h>
#include <sys/socket.h>
#include <systemd/sd-event.h>

struct db_web_door;

/* A new connection. True: it is taken over, with its descriptor. */
typedef bool db_web_door_fn(void *context, int fd, const struct sockaddr *peer, socklen_t size);

/* Listens as `config` says. NULL with an error in the log. Freed with db_web_door_free(), NULL is
 * allowed. */
struct db_web_door *db_web_door_new(sd_event *loop, const struct db_web_config *config,
                                    db_web_door_fn *take, void *context);
void db_web_door_free(struct db_web_door *door);

/* To be called every 100 ms or so: closes what was held for long enough. */
void db_web_door_tick(struct db_web_door *door, db_time now);

#endif
