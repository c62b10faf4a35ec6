/* SPDX-License-Identifier: Apache-2.0 */
/* From the sections of a file to the structs of the configuration, with what depends on more than
 * one key. */
#ifndef DRIVEBRIDGE_CONFIG_SECTIONS_H
#define DRIVEBRIDGE_CONFIG_SECTIONS_H

#include "config/section.h"

/* Fills config->modbus, control, buses and drives; members stay 0 or null where something is wrong, an error. False
 * when out of memory. */
bool db_sections_read(struct db_load *load);

#endif
