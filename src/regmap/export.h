/* SPDX-License-Identifier: Apache-2.0 */
/* The register and command tables as documents. All families of db_drivers are in them. */
#ifndef DRIVEBRIDGE_REGMAP_EXPORT_H
#define DRIVEBRIDGE_REGMAP_EXPORT_H

#include <stdio.h>

/* 0, or -ENOMEM. Errors of the stream are the caller's to look for. */
int db_export_csv(FILE *out);
int db_export_markdown(FILE *out);
int db_export_commands(FILE *out);

/*
 * The Structured Text library: `blocks` with the tables' constants in the place of its line
 * "@constants@". -ENOENT when it has no such line, or the table no register that the library needs;
 * -EIO when it cannot be read.
 */
int db_export_st(FILE *out, FILE *blocks);

#endif
