/* SPDX-License-Identifier: Apache-2.0 */
/* Traces of buses: those that are kept when there is trouble, and all for who asks. Internal to src/service; network
 * thread. */
#ifndef DRIVEBRIDGE_SERVICE_TRACES_H
#define DRIVEBRIDGE_SERVICE_TRACES_H

#include "service/state.h"

/* 0 or a negative errno. */
int traces_begin(struct service *service);
void traces_end(struct service *service);

/* The bus has told something. */
void traces_look(struct plant_bus *bus);
/* The watchdog stops a drive of it. */
void traces_note_tripped(struct service *service, const struct db_bus_config *bus_config,
                         const struct db_drive_config *drive);
/* The bus is about to be freed. */
void traces_leave(struct plant_bus *bus);

#endif
