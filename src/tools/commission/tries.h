/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The steps themselves, only for steps.c. Each is called stage by stage (from 0) for its next
 * action, with the outcome of the one before, and judges that outcome. False: it has ended.
 *
 * Pure but for memory.
 */
#ifndef DRIVEBRIDGE_COMMISSION_TRIES_H
#define DRIVEBRIDGE_COMMISSION_TRIES_H

#include "commission/steps.h"

typedef bool db_commission_try(struct db_commission *commission, unsigned stage,
                               const struct db_commission_outcome *outcome,
                               struct db_commission_action *action);

bool db_commission_try_presence(struct db_commission *commission, unsigned stage,
                                const struct db_commission_outcome *outcome,
                                struct db_commission_action *action);
bool db_commission_try_round_trips(struct db_commission *commission, unsigned stage,
                                   const struct db_commission_outcome *outcome,
                                   struct db_commission_action *action);
bool db_commission_try_standing(struct db_commission *commission, unsigned stage,
                                const struct db_commission_outcome *outcome,
                                struct db_commission_action *action);
bool db_commission_try_power(struct db_commission *commission, unsigned stage,
                             const struct db_commission_outcome *outcome,
                             struct db_commission_action *action);
bool db_commission_try_motion(struct db_commission *commission, unsigned stage,
                              const struct db_commission_outcome *outcome,
                              struct db_commission_action *action);
bool db_commission_try_speed(struct db_commission *commission, unsigned stage,
                             const struct db_commission_outcome *outcome,
                             struct db_commission_action *action);

/*
 * From sending the command to the first change of the position, for the figures of the last motion.
 * False: nothing moved, and for that reason `setting` is not seen.
 */
bool db_commission_judge_reaction(struct db_commission *commission, const char *setting,
                                  const char *result);

#endif
