/* SPDX-License-Identifier: Apache-2.0 */
/* What somebody who mistyped a name may have meant. Pure. */
#ifndef DRIVEBRIDGE_CTL_NEAREST_H
#define DRIVEBRIDGE_CTL_NEAREST_H

#include <jansson.h>
#include <stddef.h>

/* Letters to insert, remove, exchange or swap with a neighbour. Of names up to 63 letters; longer ones are far. */
unsigned db_ctl_distance(const char *one, const char *other);

/*
 * Of a list of objects with a `name`: "; did you mean a, b or c?", or where the list is short and nothing is near
 * "; there are a, b and c", else "".
 */
void db_ctl_nearest_names(const json_t *list, const char *name, char *text, size_t size);

#endif
