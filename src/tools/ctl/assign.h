/* SPDX-License-Identifier: Apache-2.0 */
/* Arguments of the form NAME=VALUE. */
#ifndef DRIVEBRIDGE_CTL_ASSIGN_H
#define DRIVEBRIDGE_CTL_ASSIGN_H

#include "ctl/session.h"

/* What can be assigned to. */
struct db_ctl_assignable {
	const char *drive;       /* by the name that the service knows */
	const json_t *registers; /* all registers of the drive */
	const json_t
		/* registers that may be assigned here, in the order of values without a name */
		*taken;
	const char *unknown; /* begin of the error message: "feeder has no register" */
	bool in_order;       /* values may stand without a name */
};

/*
 * An object of the arguments with the values that these registers take, which the caller frees.
 * Values may have a unit, see units.h. NULL with `status` when a name or a value is wrong: the
 * reason is printed with what would be right.
 */
json_t *db_ctl_read_assignments(struct db_ctl *ctl, const struct db_ctl_assignable *to, int count,
                                char **arguments, enum db_ctl_status *status);

#endif
