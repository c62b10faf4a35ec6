/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Typed values with a unit: "10mm" for a register in counts, "100mm/s" for one in counts per
 * second. Numbers without a unit are in the register's own. A unit that is neither the register's
 * nor the drive's is refused.
 */
#ifndef DRIVEBRIDGE_CTL_UNITS_H
#define DRIVEBRIDGE_CTL_UNITS_H

#include "ctl/session.h"

/*
 * The user unit for this register of a drive, "mm" or "mm/s", of `counts_per_unit` of the
 * register's own. NULL: there is none, because the drive's user units have no name, or because the
 * register counts something else (a velocity in rpm). Pure; the text belongs to `registers`.
 */
const char *db_ctl_users_unit(const json_t *registers, const json_t *reg);

/*
 * As db_words_parse_value(), which also accepts the register's own unit, and `users` (NULL: none),
 * one of which is `per_unit` of the register's own; 0: unknown. A value in user units is rounded to
 * the nearest integer for an integer register. Pure.
 */
json_t *db_ctl_parse_quantity(const json_t *reg, const char *users, double per_unit,
                              const char *text, char *problem, size_t size);

/* The configured number of the drive's own units per user unit; 0: unknown. */
double db_ctl_read_scale(struct db_ctl *ctl, const char *drive);

/* db_ctl_parse_quantity() for a register of a drive; asks the service for counts_per_unit if the
 * text needs it. */
json_t *db_ctl_read_quantity(struct db_ctl *ctl, const char *drive, const json_t *registers,
                             const json_t *reg, const char *text, char *problem, size_t size);

#endif
