/* SPDX-License-Identifier: Apache-2.0 */
/* Conditions that always have to hold, for fuzz targets and shared parts of unit tests. Header
 * only; any thread. */
#ifndef DRIVEBRIDGE_FAKES_MUST_H
#define DRIVEBRIDGE_FAKES_MUST_H

#include <stdio.h>
#include <stdlib.h>

#define must(condition) ((condition) ? (void)0 : must_fail(#condition, __FILE__, __LINE__))

static inline _Noreturn void must_fail(const char *condition, const char *file, int line)
{
	(void)fprintf(stderr, "%s:%d: does not hold: %s\n", file, line, condition);
	abort();
}

#endif
