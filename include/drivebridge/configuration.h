/* SPDX-License-Identifier: Apache-2.0 */
/* The running configuration compared with the configuration's files and the installed programs, for
 * all that show it. */
#ifndef DRIVEBRIDGE_CONFIGURATION_H
#define DRIVEBRIDGE_CONFIGURATION_H

#include <stdint.h>

/* Numbers are those of the register configuration_state: append, never renumber. */
enum db_configuration_state {
	DB_CONFIGURATION_IN_FORCE, /* the files agree with what runs */
	/* they are wrong, or were refused; the former configuration keeps running */
	DB_CONFIGURATION_REFUSED,
	DB_CONFIGURATION_LAST_GOOD, /* they were wrong at the start: the last good copy runs */
	DB_CONFIGURATION_CHANGED,   /* they are valid, differ and were not loaded */
	DB_CONFIGURATION_STATES
};

/* "in_force", "refused", "last_good", "changed" */
#define DB_CONFIGURATION_NAMES                                \
	{                                                     \
		"in_force", "refused", "last_good", "changed" \
	}

struct db_configuration_report {
	enum db_configuration_state state;
	/* microseconds since 1970-01-01 UTC; of this state with these messages */
	uint64_t since_us;
	const char *messages; /* one line each, "" for none; owned by the reporter */
	/* A running program or library that an upgrade has replaced: a restart is needed; "" when
	 * there is none. Owned by the reporter. */
	const char *replaced;
};

#endif
