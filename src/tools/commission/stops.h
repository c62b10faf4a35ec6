/* SPDX-License-Identifier: Apache-2.0 */
/* Steps in the form of tries.h: about the end of a motion, its way, and the loss of power. */
#ifndef DRIVEBRIDGE_COMMISSION_STOPS_H
#define DRIVEBRIDGE_COMMISSION_STOPS_H

#include "commission/steps.h"

bool db_commission_try_stop(struct db_commission *commission, unsigned stage,
                            const struct db_commission_outcome *outcome,
                            struct db_commission_action *action);
bool db_commission_try_silence(struct db_commission *commission, unsigned stage,
                               const struct db_commission_outcome *outcome,
                               struct db_commission_action *action);
/* True if it can be tried with today's settings; if not, adds the reason as a verdict. */
bool db_commission_can_watchdog(struct db_commission *commission);
bool db_commission_can_limits(struct db_commission *commission);

bool db_commission_try_watchdog(struct db_commission *commission, unsigned stage,
                                const struct db_commission_outcome *outcome,
                                struct db_commission_action *action);
bool db_commission_try_scale(struct db_commission *commission, unsigned stage,
                             const struct db_commission_outcome *outcome,
                             struct db_commission_action *action);
bool db_commission_try_limits(struct db_commission *commission, unsigned stage,
                              const struct db_commission_outcome *outcome,
                              struct db_commission_action *action);
bool db_commission_try_power_loss(struct db_commission *commission, unsigned stage,
                                  const struct db_commission_outcome *outcome,
                                  struct db_commission_action *action);

#endif
