/* SPDX-License-Identifier: Apache-2.0 */
/* Times on the buses of a configuration, as far as they can be computed. Pure. */
#ifndef DRIVEBRIDGE_CONFIG_TIMES_H
#define DRIVEBRIDGE_CONFIG_TIMES_H

#include "config/section.h"

/* Drives of a bus (its index), and nodes: a node answers at one address and is polled in each
 * cycle. Axes of one controller are one node. */
size_t db_times_drives_on(const struct db_config *config, size_t bus);
size_t db_times_nodes_on(const struct db_config *config, size_t bus);

/* One transaction on the wire that a command may have to wait for, and its own: nanoseconds. */
int64_t db_times_confirm(const struct db_bus_config *bus);

/* The longest answer on a serial line of a PLC, with the silences around it: nanoseconds. */
int64_t db_times_of_line(const struct db_rtu_config *line);

/* In milliseconds, for people. */
double db_times_in_ms(db_time time);

/* Fills in the cycles that were not given, as the buses need. Everything else must be valid. */
void db_times_fill(struct db_load *load);

/* Warns of times that cannot be met. */
void db_times_check(struct db_load *load);

#endif
