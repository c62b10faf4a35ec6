/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Compares the configuration's files with what runs, and whether a restart would succeed with them;
 * also the last good configuration, for a start with invalid files. Internal to src/bridge/service;
 * network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_CONFIGURATION_H
#define DRIVEBRIDGE_SERVICE_CONFIGURATION_H

#include "drivebridge/configuration.h"

#include <stdbool.h>
#include <stdint.h>

struct db_config;
struct disk_job;
struct service;

/* The data with which the service starts. */
struct configuration_start {
	struct db_config *config;
	char *copy; /* to be stored once it is in force; null: none */
	char *why;  /* null, or the errors in the files: the last good configuration is used */
	uint64_t signature;
};

/* Reads the files at `path`, or when they are invalid and `last_good` is set the last good
 * configuration. False when there is none that can be used; the reason was written to standard
 * error. */
bool configuration_load(const char *path, bool last_good, struct configuration_start *start);
void configuration_start_clear(struct configuration_start *start);

/* The service runs: from now on the files are watched. 0 or a negative errno. */
int configuration_begin(struct service *service, struct configuration_start *start);
void configuration_end(struct service *service);

/* The outcome of a reload, which read files with this signature: their content is in force, and
 * `copy` of it is taken over; or it was refused, for reasons given one per line. */
void configuration_loaded(struct service *service, uint64_t signature, char *copy);
void configuration_refused(struct service *service, uint64_t signature, const char *reasons);

/* Has a job worked on by the thread that reads the files, see disk.h; its `done` is called in the
 * loop. False: it has no place. */
bool configuration_work(struct service *service, struct disk_job *job);

/* The present report, of a struct service; messages are valid until the next turn of the loop. */
struct db_configuration_report configuration_report(void *context);

#endif
