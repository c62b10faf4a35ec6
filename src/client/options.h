/* SPDX-License-Identifier: Apache-2.0 */
/* The command line of a tool that serves. */
#ifndef DRIVEBRIDGE_CLIENT_OPTIONS_H
#define DRIVEBRIDGE_CLIENT_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

#define DB_CLIENT_EXIT_USAGE 2
/* From sysexits.h: RestartPreventExitStatus of the units. */
#define DB_CLIENT_EXIT_CONFIG 78

#define DB_CLIENT_OPTIONS_MAX 8

struct db_client_option {
	const char *name;  /* without the dashes; NULL behind the last one */
	const char **text; /* where its argument goes; NULL: it has none, and sets */
	bool *flag;
};

/*
 * Reads options, with --help and --version besides. -1: the program goes on; else what there is to be said was printed,
 * and this is the status to exit with. `usage` is all that --help says.
 */
int db_client_options_read(const char *program, const char *usage,
                           const struct db_client_option *options, int argc, char **argv);

#endif
