/* SPDX-License-Identifier: Apache-2.0 */
/* How long things take on the buses of a configuration, as far as that can be computed. Pure. */
#ifndef DRIVEBRIDGE_CONFIG_TIMES_H
#define DRIVEBRIDGE_CONFIG_TIMES_H

#include "config/section.h"

/* Drives of a bus (its index), and nodes: what answers at an address and is asked in each cycle.
 * Axes of one controller are one node. */
size_t db_times_drives_on(const struct db_config *config, size_t bus);
size_t db_times_nodes_on(const struct db_config *config, size_t bus);

/* One transaction on the wire that a command may have to wait for, and its own: nanoseconds. */
int64_t db_times_confirm(const struct db_bus_config *bus);

/* For people. */
double db_times_in_ms(db_time time);

#define DB_SPEED_TEXT_MAX 32

/* How fast the wire is, for people: "9600 baud", "500000 bit/s". */
void db_times_speed(const struct db_bus_config *bus, char text[DB_SPEED_TEXT_MAX]);

/* Cycles that were not given: what the buses need. Everything else is there and right. */
void db_times_fill(struct db_load *load);

/* Warns of times that cannot be met, before anybody waits for them. */
void db_times_check(struct db_load *load);

#endif
