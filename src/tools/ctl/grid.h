/* SPDX-License-Identifier: Apache-2.0 */
/* Tables for people: each column is as wide as its content. Pure but for printing. */
#ifndef DRIVEBRIDGE_CTL_GRID_H
#define DRIVEBRIDGE_CTL_GRID_H

#include <stdbool.h>
#include <stdio.h>

enum db_ctl_colour { DB_CTL_PLAIN, DB_CTL_BOLD, DB_CTL_GREEN, DB_CTL_YELLOW, DB_CTL_RED };

struct db_ctl_grid;

/* One letter per column: l or r, its alignment. NULL without memory. */
struct db_ctl_grid *db_ctl_grid_new(const char *columns);
void db_ctl_grid_free(struct db_ctl_grid *grid);

/* The next cell, from left to right; a new row begins by itself. Without memory it is left out. */
void db_ctl_grid_add(struct db_ctl_grid *grid, enum db_ctl_colour colour, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* A row of heads, in the language of the terminal. */
void db_ctl_grid_add_heads(struct db_ctl_grid *grid, const char *const *heads, size_t count);

/* Hides these columns, counted from 0, one after the other until its lines have at most `width`
 * characters; 0: no limit. */
void db_ctl_grid_fit(struct db_ctl_grid *grid, unsigned width, const size_t *columns, size_t count);

/* Lines are cut off at `width` characters (0: never) and end with `end`. */
void db_ctl_grid_print(const struct db_ctl_grid *grid, bool coloured, unsigned width,
                       const char *end, FILE *out);

/* The terminal's escape sequence for this colour, and for its end; "" when not coloured. */
const char *db_ctl_colour_begin(bool coloured, enum db_ctl_colour colour);
const char *db_ctl_colour_end(bool coloured, enum db_ctl_colour colour);

#endif
