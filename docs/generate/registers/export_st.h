/* SPDX-License-Identifier: Apache-2.0 */
/* The tables as constants of a Structured Text library. For a program of its own. */
#ifndef DRIVEBRIDGE_REGMAP_EXPORT_ST_H
#define DRIVEBRIDGE_REGMAP_EXPORT_ST_H

#include <stdio.h>

/*
 * The Structured Text library: `blocks` with the tables' constants in the place of its line
 * "@constants@". -ENOENT when it has no such line, or the table no register that the library needs;
 * -EIO when it cannot be read.
 */
int db_export_st(FILE *out, FILE *blocks);

#endif
