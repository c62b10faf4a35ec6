/* SPDX-License-Identifier: Apache-2.0 */
/* Numbers in a text. Pure. */
#ifndef DRIVEBRIDGE_SIM_NUMBERS_H
#define DRIVEBRIDGE_SIM_NUMBERS_H

#include <stdbool.h>
#include <stddef.h>

/* So many numbers of 0 to max and nothing else; false when it is not so. */
bool sim_read_numbers(const char *text, long *numbers, size_t count, long max);

#endif
