/* SPDX-License-Identifier: Apache-2.0 */
/* Names that a mistyped name may stand for. Pure. */
#ifndef DRIVEBRIDGE_WORDS_NEAREST_H
#define DRIVEBRIDGE_WORDS_NEAREST_H

#include <jansson.h>
#include <stddef.h>

/* The number of letters to insert, remove, exchange or swap with a neighbour. For names up to 63
 * letters; longer ones count as far. */
unsigned db_words_distance(const char *one, const char *other);

/*
 * Of a list of objects with a `name`: "; did you mean a, b or c?", or, if the list is short and no
 * name is near, "; there are a, b and c", else "".
 */
void db_words_nearest_names(const json_t *list, const char *name, char *text, size_t size);

#endif
