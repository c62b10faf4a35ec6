/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The frames on a serial line of VSMD drives: where they begin and end, their addresses, and their
 * time on the wire. Members of db_driver, where they are described. Internal to the driver; pure,
 * any thread.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_SERIAL_WIRE_H
#define DRIVEBRIDGE_DRIVER_VSMD_SERIAL_WIRE_H

#include "drivebridge/driver.h"

void vsmd_serial_cut_frame(const struct db_received *received, size_t *skip, size_t *length);
enum db_frame vsmd_serial_accept(const struct db_bus_config *bus, const uint8_t *frame,
                                 size_t length, int *address);
uint32_t vsmd_serial_part(const struct db_bus_config *bus, const uint8_t *frame, size_t length);
void vsmd_serial_describe_any(const struct db_bus_config *bus, bool sent, const uint8_t *frame,
                              size_t length, struct db_description *description);
db_time vsmd_serial_poll_time(const struct db_bus_config *bus);
db_time vsmd_serial_command_time(const struct db_bus_config *bus);
bool vsmd_serial_mishears(unsigned address, const uint8_t *request, size_t length);

#endif
