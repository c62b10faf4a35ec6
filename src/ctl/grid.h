/* SPDX-License-Identifier: Apache-2.0 */
/* Tables for people: columns as wide as what stands in them. Pure but for printing. */
#ifndef DRIVEBRIDGE_CTL_GRID_H
#define DRIVEBRIDGE_CTL_GRID_H

#include <stdbool.h>
#include <stdio.h>

enum db_ctl_colour { DB_CTL_PLAIN, DB_CTL_BOLD, DB_CTL_GREEN, DB_CTL_YELLOW, DB_CTL_RED };

struct db_ctl_grid;

/* One letter for each column: l or r, where it stands. NULL without memory. */
struct db_ctl_grid *db_ctl_grid_new(const char *columns);
void db_ctl_grid_free(struct db_ctl_grid *grid);

/* The next cell, from left to right; rows begin by themselves. Without memory it is left out. */
void db_ctl_grid_add(struct db_ctl_grid *grid, enum db_ctl_colour colour, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* Cut off at `width` letters (0: not), `end` behind each line. */
void db_ctl_grid_print(const struct db_ctl_grid *grid, bool coloured, unsigned width,
                       const char *end, FILE *out);

/* What a terminal takes for this colour, and for its end; "" when not coloured. */
const char *db_ctl_colour_begin(bool coloured, enum db_ctl_colour colour);
const char *db_ctl_colour_end(bool coloured, enum db_ctl_colour colour);

#endif
