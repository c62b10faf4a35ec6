/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The tables of registers, commands and events as documents. All families of db_drivers are in them. For a
 * program of its own: it allocates, and writes to a stream.
 */
#ifndef DRIVEBRIDGE_REGMAP_EXPORT_H
#define DRIVEBRIDGE_REGMAP_EXPORT_H

#include <stdio.h>

/* 0, or -ENOMEM. Errors of the stream are the caller's to look for. */
int db_export_csv(FILE *out);
int db_export_markdown(FILE *out);
int db_export_commands(FILE *out);
/* The kinds of events, with the level of their lines in the log. */
int db_export_events(FILE *out);

#endif
