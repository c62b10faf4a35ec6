/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds out whether an upgrade has replaced running code. What runs is then the code of before,
 * with the faults that the upgrade mends.
 */
#ifndef DRIVEBRIDGE_UPGRADE_H
#define DRIVEBRIDGE_UPGRADE_H

#include <stdio.h>

/* `maps` is in the form of /proc/self/maps: the path of the first program or library whose file is
 * no longer the running one, to be freed; null: none. `program` stands for a path that the kernel
 * does not know any more. Pure but for the stream. */
char *db_upgrade_find(FILE *maps, const char *program);

/* The same for this process; null also when the kernel does not report it. */
char *db_upgrade_look(void);

#endif
