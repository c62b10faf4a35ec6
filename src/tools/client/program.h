/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The life of a program that serves: its command line, its configuration file and its users,
 * --check, signals, and one sd-event loop.
 */
#ifndef DRIVEBRIDGE_CLIENT_PROGRAM_H
#define DRIVEBRIDGE_CLIENT_PROGRAM_H

#include "drivebridge/time.h"
#include "reader/settings.h"
#include "users/users.h"

#include <systemd/sd-event.h>

#define DB_CLIENT_EXIT_USAGE 2
/* From sysexits.h; RestartPreventExitStatus of the units. */
#define DB_CLIENT_EXIT_CONFIG 78

struct db_program {
	const char *name;
	const char *path;  /* of the configuration file when none is given */
	const char *usage; /* the whole text of --help */
	const struct db_settings_form *form;
	/* Of the users' file, whose path is a text of the configuration; NULL: there are none. */
	const struct db_users_keeper *keeper;
	size_t users_at;
	size_t least_at; /* the number of characters that a password has at least */
	/* An option whose argument replaces a text of the configuration; NULL: there is none. */
	const char *option;
	size_t option_at;
	/* What --check has to check in addition; NULL: nothing. False: an error, which is
	 * printed. */
	bool (*check)(const void *config);
	/* Returns the exit status. SIGTERM, SIGINT and SIGHUP are blocked. */
	int (*serve)(const void *config, sd_event *loop);
};

/* Returns the exit status. */
int db_program_main(const struct db_program *program, int argc, char **argv);

/* Does the work that is due. Returns when it is to be called next without anything in the loop.
 * `us`: microseconds since 1970-01-01 UTC. */
typedef db_time db_program_turn_fn(void *context, db_time now, int64_t us);

/* SIGHUP: what can be renewed is read again, and what cannot be used is left as it was. */
typedef void db_program_renew_fn(void *context);

/* Tells systemd that the program is ready, and runs the loop until SIGTERM or SIGINT, with a turn
 * each time something was served or is due. Returns the exit status. */
int db_program_loop(sd_event *loop, db_program_turn_fn *turn, db_program_renew_fn *renew,
                    void *context);

/* A descriptor that is not served by the loop but in the turn. */
struct db_waker {
	sd_event_source *source;
	uint32_t events; /* of epoll(7): what has happened */
};

/* Until db_waker_take() the loop waits for these events of the descriptor, too; -1: for none. */
void db_waker_arm(struct db_waker *waker, sd_event *loop, int fd, uint32_t events);

/* What has happened. To be called before the descriptor may be closed, which the loop does not
 * notice. */
uint32_t db_waker_take(struct db_waker *waker);

/* --- for tests -------------------------------------------------------------------------------- */

#define DB_CLIENT_OPTIONS_MAX 12

struct db_client_option {
	const char *name;  /* without the dashes; NULL ends the list */
	const char **text; /* receives its argument; NULL: it has none, and sets */
	bool *flag;
};

/*
 * Reads options, --help and --version among them. -1: the program continues; else the output is
 * printed, and this is the exit status. `usage` is the whole text of --help.
 */
int db_client_options_read(const char *program, const char *usage,
                           const struct db_client_option *options, int argc, char **argv);

#endif
