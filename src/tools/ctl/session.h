/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What every command uses: the connection, the options, and errors in words. The manual page lists
 * the exit statuses.
 */
#ifndef DRIVEBRIDGE_CTL_SESSION_H
#define DRIVEBRIDGE_CTL_SESSION_H

#include "client/client.h"
#include "words/value.h"

#include <stdbool.h>

#define DB_CTL_SOCKET "/run/drivebridge/control"

/* How long the service may take for a call that needs no drive, and for one that does. */
#define DB_CTL_TIMEOUT_MS 5000
#define DB_CTL_DRIVE_TIMEOUT_MS 30000

enum db_ctl_status {
	DB_CTL_OK = 0,
	DB_CTL_NO = 1,          /* refused, ended with an error, or somebody has to act */
	DB_CTL_USAGE = 2,       /* no such command, drive or name */
	DB_CTL_UNREACHABLE = 3, /* no service, or the connection to it is lost */
};

struct db_ctl {
	const char *word; /* the command's name */
	const char *socket;
	bool json;
	bool colour;
	bool help;
	/* Options of single commands. */
	bool no_wait;
	bool relative;
	bool all;
	bool follow;
	bool yes;
	bool save;
	bool with_address;
	bool quick;
	bool disable;
	const char *velocity;
	const char *interval;
	bool all_speeds;
	const char *speed;
	bool past;
	const char *kept;
	const char *output;
	const char *duration;
	const char *samples;
	const char *trigger;
	const char *before;
	const char *plot;
	const char *addresses;
	bool list;
	const char *step;
	const char *answers;
	const char *state;
	const char *form;
	const char *host;
	const char *endpoint;
	const char *ports;
	const char *drive;
	const char *user;
	const char *since;
	bool refused;
	bool cef;
	const char *folder;
	const char *days;
	/* After db_ctl_open(). */
	struct db_client *client;
	json_t *description; /* the answer of Describe */
	json_t *gateway;     /* an entry like a drive's, by the name that the service knows */
};

/* Connects and reads what is configured. DB_CTL_OK, or the exit status, and the reason is
 * printed. */
enum db_ctl_status db_ctl_open(struct db_ctl *ctl);
void db_ctl_close(struct db_ctl *ctl);

/* Makes a call and waits for it; takes `parameters` over. NULL with `status` when it failed: the
 * reason is printed. */
json_t *db_ctl_call(struct db_ctl *ctl, const char *method, json_t *parameters, int timeout_ms,
                    enum db_ctl_status *status);

/* Prints an error: on standard error for people, as an object on standard output with --json. */
enum db_ctl_status db_ctl_fail(const struct db_ctl *ctl, const struct db_client_error *error);
enum db_ctl_status db_ctl_complain(const struct db_ctl *ctl, enum db_ctl_status status,
                                   const char *name, const char *format, ...)
	__attribute__((format(printf, 4, 5)));

/* That of errno about a file. */
enum db_ctl_status db_ctl_fail_file(const struct db_ctl *ctl, const char *path);

/* The same; without one it prints "no drive is called" (`unknown`) with the nearest names. */
json_t *db_ctl_find(const struct db_ctl *ctl, const json_t *list, const char *name,
                    const char *error, const char *unknown);

/* The drive of that name, or NULL and the reason is printed. The gateway does not count as one. */
json_t *db_ctl_find_drive(const struct db_ctl *ctl, const char *name);

/* The same, but "gateway" is the gateway, unless a drive has this name. Its `name` is the one to
 * send to the service. The first function prints nothing. */
json_t *db_ctl_look_up_unit(const struct db_ctl *ctl, const char *name);
json_t *db_ctl_find_unit(const struct db_ctl *ctl, const char *name);

/* The registers of a drive (an array that the caller frees), or NULL: the reason is printed. */
json_t *db_ctl_read_registers(struct db_ctl *ctl, const char *drive, enum db_ctl_status *status);

/* One line with --json. */
void db_ctl_print_json(const json_t *value);

#endif
