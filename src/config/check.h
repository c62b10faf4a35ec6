/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What only shows between sections: twice the same device, address, axis or unit; then, when
 * nothing is wrong, buses that share an interface, what the families say, and times that cannot be
 * met. Devices are compared by what the file system says of their paths.
 */
#ifndef DRIVEBRIDGE_CONFIG_CHECK_H
#define DRIVEBRIDGE_CONFIG_CHECK_H

#include "config/section.h"

/* Behind db_sections_read(). Also fills the times that were not given. */
void db_check(struct db_load *load);

#endif
