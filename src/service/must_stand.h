/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which drives must stand, over a restart of the service and over reloads: a drive at the same place on the wire must
 * stand, too, whatever it is called. A motion that is held has no holder in another run: its drive must stand there. Kept in a small file beside the control socket, in memory that a
 * reboot clears; without a socket a restart forgets it. Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_MUST_STAND_H
#define DRIVEBRIDGE_SERVICE_MUST_STAND_H

struct service;

/* Reads the file, and has its drives stand as soon as their buses are there. 0 or a negative errno; a file that cannot
 * be read is logged. */
int must_stand_begin(struct service *service);
/* Looks at the drives of the plant now, and again and again while one of them must stand. Before and after the plant
 * becomes another one. */
void must_stand_look(struct service *service);
/* A stop was handed to a bus, or something ended there. */
void must_stand_look_soon(struct service *service);
/* The buses have ended: what still must stand is in the file then. */
void must_stand_end(struct service *service);

#endif
