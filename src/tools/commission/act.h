/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Carries out the actions of a commissioning over three connections: the first sends commands and
 * holds motions, the second stops the drive when the first waits, and the third streams the drive's
 * data together with the service's clock. When this program ends in any way, or hangs, the service
 * stops what it holds.
 */
#ifndef DRIVEBRIDGE_COMMISSION_ACT_H
#define DRIVEBRIDGE_COMMISSION_ACT_H

#include "client/client.h"
#include "commission/asker.h"

#include <stdint.h>

struct db_commission_act {
	/* Set by the caller: */
	const char *socket; /* of the service */
	const char *user;   /* the acting user, for the service's history; NULL: not sent */
	const char *drive;
	json_t *registers; /* not owned */
	/* Older events (microseconds since 1970) belong to another configuration. */
	json_int_t since_us;
	const struct db_commission_asker *asker;
	double low; /* counts that a trial must not leave */
	double high;
	double counts_per_velocity; /* counts a second for 1 of target_velocity; 0: unknown */
	/* Private: */
	struct db_client *client;
	struct db_client *stream;
	struct db_client *stopper;
	bool interrupted; /* by the user, or a connection is lost: nothing more is to be done */
	bool lost;
	char token[64];
	int64_t wall_us; /* start of the trial's time */
	bool recording;
	struct db_trial trial;
	struct db_trial_sample latest; /* its `ms` is wall time */
	unsigned stops;                /* number without an answer */
	bool waiting;                  /* for the answer to a command */
	char result[64];
	json_t *values; /* of the latest outcome */
};

/* 0, or -1 with the error. In both cases to be closed. */
int db_commission_act_open(struct db_commission_act *act, struct db_client_error *error);
void db_commission_act_close(struct db_commission_act *act);

/* Makes a call on the commanding connection and waits for it; takes `parameters` over. NULL: it
 * failed. */
json_t *db_commission_act_call(struct db_commission_act *act, const char *method,
                               json_t *parameters);

/* All but DB_COMMISSION_ASK. What `outcome` points to is valid until the next call. */
void db_commission_act_do(struct db_commission_act *act, const struct db_commission_action *action,
                          struct db_commission_outcome *outcome);

/*
 * Handles the connections and the asker's descriptor for `timeout_ms` at most, or until `fd` (or
 * -1) is readable. True: it is.
 */
bool db_commission_act_wait(struct db_commission_act *act, int fd, int timeout_ms);

#endif
