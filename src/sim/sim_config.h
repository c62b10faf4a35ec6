/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The simulator's configuration file (libconfuse syntax), checked and as plain structs.
 */
#ifndef DRIVEBRIDGE_SIM_CONFIG_H
#define DRIVEBRIDGE_SIM_CONFIG_H

#include "sim/sim_bus.h"

struct sim_config {
	struct sim_bus_config *buses;
	size_t bus_count;
	struct sim_drive_config *drives;
	size_t drive_count;
	void *source; /* owns the strings */
};

/*
 * On success 0, and the configuration is to be freed. Otherwise -1, and everything wrong was
 * reported to standard error as "file:line: what is wrong; what would be right".
 */
int sim_config_load(const char *path, struct sim_config *config);
void sim_config_free(struct sim_config *config);

/* --- for media and kinds, while a section is loaded --------------------------------------------------- */

/* Reports something about option `name` (null: about the section); returns -1. */
int sim_config_wrong(cfg_t *cfg, const char *name, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* 0, or -1 after a report. */
int sim_config_check_int(cfg_t *cfg, const char *name, long min, long max);

/* The index of a word in a null-terminated list, or -1 after a report. */
int sim_config_check_word(cfg_t *cfg, const char *name, const char *const *words);

#endif
