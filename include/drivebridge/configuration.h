/* SPDX-License-Identifier: Apache-2.0 */
/* What runs beside what the configuration's files say, for all who show it. */
#ifndef DRIVEBRIDGE_CONFIGURATION_H
#define DRIVEBRIDGE_CONFIGURATION_H

#include <stdint.h>

/* Numbers are those of the register configuration_state: they are added, never changed. */
enum db_configuration_state {
	DB_CONFIGURATION_IN_FORCE,  /* the files say what runs */
	DB_CONFIGURATION_REFUSED,   /* they are wrong, or were refused; what ran before goes on */
	DB_CONFIGURATION_LAST_GOOD, /* they were wrong at the start: the last good copy runs */
	DB_CONFIGURATION_CHANGED,   /* they are right, say something else and were not loaded */
	DB_CONFIGURATION_STATES
};

/* "in_force", "refused", "last_good", "changed" */
#define DB_CONFIGURATION_NAMES                                \
	{                                                     \
		"in_force", "refused", "last_good", "changed" \
	}

struct db_configuration_report {
	enum db_configuration_state state;
	uint64_t since_us;    /* since 1970-01-01 UTC; of this state with these messages */
	const char *messages; /* a line each, "" when there is nothing to say; the reporter's own */
};

#endif
