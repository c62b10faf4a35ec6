/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A reload: from the plant that runs to that of the new file, while what is the same in both goes
 * on.
 *
 * First everything is made that will be needed; if anything fails, nothing has changed. Then what
 * goes is retired: buses end, and drives leave theirs, as their on-exit says. That takes its time,
 * in which the network thread does everything else. When all of it is gone, so that its ports and
 * addresses are free, the new plant takes its place. Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_RELOAD_H
#define DRIVEBRIDGE_SERVICE_RELOAD_H

struct service;

/* SIGHUP: begins a reload, or remembers that another one is wanted. */
void reload_ask(struct service *service);

/* Goes on with the one under way as far as it can. Called in every turn of the loop. */
void reload_step(struct service *service);

/* The service ends, its buses have ended: frees what the one under way has prepared. */
void reload_abandon(struct service *service);

#endif
