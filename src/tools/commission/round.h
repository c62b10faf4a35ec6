/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A round through the steps of a commissioning with one drive: from the configured values to the
 * report. It has connections of its own to the service. One thread.
 */
#ifndef DRIVEBRIDGE_COMMISSION_ROUND_H
#define DRIVEBRIDGE_COMMISSION_ROUND_H

#include "commission/act.h"
#include "commission/report.h"

/* Limits of one motion, in seconds. */
#define DB_COMMISSION_SHORTEST_S 0.2
#define DB_COMMISSION_LONGEST_S 5.0

struct db_commission_order {
	const char *socket;
	const char *user; /* NULL: the service does not get the acting user */
	const char *drive;
	double velocity; /* of trial motions, above 0, as target_velocity; 0: a slow default */
	double seconds;  /* duration of one; 0: the default */
};

struct db_commission_round {
	json_t *done; /* names of completed steps */
	struct db_commission engine;
	struct db_commission_act act;
	const struct db_commission_asker *asker;
	json_t *description; /* the answer of Describe */
	const json_t *drive; /* in the description */
	const json_t *bus;
	json_t *registers;
	json_t *drive_keys;
	json_t *bus_keys;
	char problem[300];
	char identity[160];
	bool touched; /* the motor's power was switched */
};

/* 0, or -1 with the error. In both cases to be closed. `order` and what it points to are used until
 * then. */
int db_commission_round_open(struct db_commission_round *round,
                             const struct db_commission_order *order,
                             const struct db_commission_asker *asker,
                             struct db_client_error *error);
void db_commission_round_close(struct db_commission_round *round);

/*
 * Runs the steps that are not done, or only step `only` of db_commission_list (-1: all). At the
 * end, also after an interruption, the drive stands without power, and the verdicts are complete.
 */
void db_commission_round_run(struct db_commission_round *round, int only);

/* The results so far. They belong to the round. */
struct db_commission_report db_commission_round_report(const struct db_commission_round *round);

#endif
