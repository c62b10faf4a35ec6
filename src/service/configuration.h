/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether the configuration's files say what runs, and whether a restart would come up with them; and the last good
 * configuration, for a start that finds wrong files. Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_CONFIGURATION_H
#define DRIVEBRIDGE_SERVICE_CONFIGURATION_H

#include "drivebridge/configuration.h"

#include <stdbool.h>
#include <stdint.h>

struct db_config;
struct service;

/* What the service starts with. */
struct configuration_start {
	struct db_config *config;
	char *copy; /* to be kept once it is in force; null: there is none */
	char *why;  /* null, or what is wrong with the files: the last good configuration is used */
	uint64_t signature;
};

/* Where the last good configuration is kept, to be freed: in systemd's StateDirectory. Null: nowhere. */
char *configuration_copy_path(void);

/* Reads the files at `path`, or when they are wrong and `last_good` says so the last good configuration. False when there
 * is none that can be used; why was written to standard error. */
bool configuration_load(const char *path, bool last_good, struct configuration_start *start);
void configuration_start_clear(struct configuration_start *start);

/* The service runs: from now on it is known what the files say. 0 or a negative errno. */
int configuration_begin(struct service *service, struct configuration_start *start);
void configuration_end(struct service *service);

/* The outcome of a reload, which read files with this signature: what they say is in force, `copy` of it is taken over; or
 * it was refused, for reasons that stand in a line each. */
void configuration_loaded(struct service *service, uint64_t signature, char *copy);
void configuration_refused(struct service *service, uint64_t signature, const char *reasons);

/* What there is to know now; messages until the next turn of the loop. */
struct db_configuration_report configuration_report(const struct service *service);

#endif
