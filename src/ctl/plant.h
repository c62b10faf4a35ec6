/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How drives and buses are, from the values of one moment, and what somebody has to do about it.
 *
 * The registers of a drive are asked for once for each family: status and watch need those that all have.
 */
#ifndef DRIVEBRIDGE_CTL_PLANT_H
#define DRIVEBRIDGE_CTL_PLANT_H

#include "ctl/grid.h"
#include "ctl/session.h"

/* In this order; with a hint all is well. */
enum db_ctl_need { DB_CTL_FINE, DB_CTL_HINT, DB_CTL_LOOK, DB_CTL_ACT };

struct db_ctl_judgement {
	enum db_ctl_need need;
	char why[160];  /* "" when all is well */
	char next[320]; /* what to do next */
};

/* The registers' names that db_ctl_judge_drive() and db_ctl_add_drive() read, as an array that the caller frees: of
 * newer ones those that the service has, which an upgrade does not restart. */
json_t *db_ctl_process_names(const json_t *registers);

/* Pure. `values` may lack anything: a drive that has never answered. */
void db_ctl_judge_drive(const json_t *drive, const json_t *registers, const json_t *values,
                        struct db_ctl_judgement *judgement);
void db_ctl_judge_bus(const json_t *bus, struct db_ctl_judgement *judgement);
/* What the service says of its configuration's files, from the answer of Describe. */
void db_ctl_judge_configuration(const json_t *description, struct db_ctl_judgement *judgement);

/* A row of the tables of status and watch: the heads, and one drive. */
#define DB_CTL_DRIVE_COLUMNS "lllrrrl"
void db_ctl_add_heads(struct db_ctl_grid *grid);
void db_ctl_add_drive(struct db_ctl_grid *grid, const json_t *drive, const json_t *registers,
                      const json_t *values, const struct db_ctl_judgement *judgement);

/* Registers by family, as an object that the caller frees: protocol of a bus to its drives' registers. */
json_t *db_ctl_read_families(struct db_ctl *ctl, enum db_ctl_status *status);
const json_t *db_ctl_registers_of(const struct db_ctl *ctl, const json_t *families,
                                  const json_t *drive);

#endif
