/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state of drives and buses: the values of one moment, and what the service says that somebody
 * has to do.
 *
 * Registers are read once per family: status and watch need those that all families have.
 */
#ifndef DRIVEBRIDGE_CTL_PLANT_H
#define DRIVEBRIDGE_CTL_PLANT_H

#include "client/troubles.h"
#include "ctl/grid.h"
#include "ctl/session.h"

struct db_ctl_judgement {
	enum db_client_need need;
	char cause[32];                        /* the service's name of it; "" when all is well */
	char why[DB_CLIENT_TROUBLE_WORDS_MAX]; /* the cause, with details that `next` does not have
	                                        */
	char next[320];                        /* advice */
};

/* The names of the registers that status and watch read, as an array that the caller frees; without
 * those newer than the service, which an upgrade does not restart. */
json_t *db_ctl_process_names(const json_t *registers);

/* Pure: the service's record of a drive, of a bus or of the configuration in words. Null: nothing
 * is wrong. */
void db_ctl_judge(const json_t *record, struct db_ctl_judgement *judgement);

/* A row of the tables of status and watch: the heads, and one drive. */
#define DB_CTL_DRIVE_COLUMNS "lllrrrl"
void db_ctl_add_heads(struct db_ctl_grid *grid);
void db_ctl_add_drive(struct db_ctl_grid *grid, const json_t *drive, const json_t *registers,
                      const json_t *values, const struct db_ctl_judgement *judgement);
/* Removes columns until the table is at most this wide; 0: no limit. */
void db_ctl_fit_drives(struct db_ctl_grid *grid, unsigned width);

/* Registers by family, as an object that the caller frees: from the protocol of a bus to its
 * drives' registers. */
json_t *db_ctl_read_families(struct db_ctl *ctl, enum db_ctl_status *status);
const json_t *db_ctl_registers_of(const struct db_ctl *ctl, const json_t *families,
                                  const json_t *drive);

#endif
