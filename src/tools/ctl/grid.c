/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/grid.h"
#include "ctl/say.h"
#include "words/language.h"
#include "words/value.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

struct cell {
	char *text;
	enum db_ctl_colour colour;
};

struct db_ctl_grid {
	const char *columns;
	size_t column_count;
	uint64_t hidden; /* a bit for each column */
	struct cell *cells;
	size_t count;
};

struct db_ctl_grid *db_ctl_grid_new(const char *columns)
{
	struct db_ctl_grid *grid = calloc(1, sizeof(*grid));

	if (grid) {
		grid->columns = columns;
		grid->column_count = strlen(columns);
	}
	return grid;
}

void db_ctl_grid_free(struct db_ctl_grid *grid)
{
	if (!grid)
		return;
	for (size_t i = 0; i < grid->count; i++)
		free(grid->cells[i].text);
	free(grid->cells);
	free(grid);
}

void db_ctl_grid_add(struct db_ctl_grid *grid, enum db_ctl_colour colour, const char *format, ...)
{
	struct cell *grown = realloc(grid->cells, (grid->count + 1) * sizeof(*grown));
	va_list arguments;
	char *text = NULL;
	int length;

	if (!grown)
		return;
	grid->cells = grown;
	va_start(arguments, format);
	length = vasprintf(&text, format, arguments);
	va_end(arguments);
	if (length < 0)
		text = NULL;
	if (text)
		db_words_clean(text);
	grid->cells[grid->count++] = (struct cell){ .text = text, .colour = colour };
}

void db_ctl_grid_add_heads(struct db_ctl_grid *grid, const char *const *heads, size_t count)
{
	for (size_t i = 0; i < count; i++)
		db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_ctl_say(heads[i]));
}

const char *db_ctl_colour_begin(bool coloured, enum db_ctl_colour colour)
{
	static const char *const begin[] = {
		[DB_CTL_PLAIN] = "",         [DB_CTL_BOLD] = "\033[1m",
		[DB_CTL_GREEN] = "\033[32m", [DB_CTL_YELLOW] = "\033[33m",
		[DB_CTL_RED] = "\033[1;31m",
	};

	return coloured ? begin[colour] : "";
}

const char *db_ctl_colour_end(bool coloured, enum db_ctl_colour colour)
{
	return coloured && colour != DB_CTL_PLAIN ? "\033[0m" : "";
}

static size_t width_of(const struct db_ctl_grid *grid, size_t column)
{
	size_t width = 0;

	for (size_t i = column; i < grid->count; i += grid->column_count) {
		const char *text = grid->cells[i].text;
		/* Columns, not bytes: units may be in any script. */
		size_t letters = text ? db_words_columns(text, strlen(text)) : 0;

		width = letters > width ? letters : width;
	}
	return width;
}

static size_t grid_width(const struct db_ctl_grid *grid)
{
	size_t width = 0;

	for (size_t column = 0; column < grid->column_count; column++) {
		if (!(grid->hidden >> column & 1))
			width += width_of(grid, column) + (width > 0 ? 2 : 0);
	}
	return width;
}

void db_ctl_grid_fit(struct db_ctl_grid *grid, unsigned width, const size_t *columns, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		if (width > 0 && grid_width(grid) > width)
			grid->hidden |= UINT64_C(1) << columns[i];
	}
}

/* Cells of the row that begins here, without the empty ones at its end. */
static size_t filled_of(const struct db_ctl_grid *grid, size_t row)
{
	size_t filled = 0;

	for (size_t i = 0; i < grid->column_count && row + i < grid->count; i++)
		filled = grid->cells[row + i].text && grid->cells[row + i].text[0] ? i + 1 : filled;
	return filled;
}

void db_ctl_grid_print(const struct db_ctl_grid *grid, bool coloured, unsigned width,
                       const char *end, FILE *out)
{
	for (size_t row = 0; row < grid->count; row += grid->column_count) {
		size_t filled = filled_of(grid, row);
		size_t left = width > 0 ? width : SIZE_MAX;

		for (size_t column = 0; column < filled; column++) {
			const struct cell *cell = &grid->cells[row + column];
			const char *text = cell->text ? cell->text : "";
			bool to_the_right = grid->columns[column] == 'r';
			size_t letters = db_words_columns(text, strlen(text));
			size_t gap = width_of(grid, column) - letters;

			if (!to_the_right && column + 1 == filled)
				gap = 0;
			if (grid->hidden >> column & 1)
				continue;
			letters = letters < left ? letters : left;
			gap = gap < left - letters ? gap : left - letters;
			fprintf(out, "%*s%s%.*s%s%*s", to_the_right ? (int)gap : 0, "",
			        db_ctl_colour_begin(coloured, cell->colour),
			        db_words_fit(text, (unsigned)letters), text,
			        db_ctl_colour_end(coloured, cell->colour),
			        to_the_right ? 0 : (int)gap, "");
			left -= letters + gap;
			if (column + 1 < filled && left >= 2) {
				fputs("  ", out);
				left -= 2;
			}
		}
		fputs(end, out);
	}
}
