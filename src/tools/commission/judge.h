/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Shared by the steps of a commissioning: verdicts, today's settings, and the actions to request.
 *
 * Pure but for memory.
 */
#ifndef DRIVEBRIDGE_COMMISSION_JUDGE_H
#define DRIVEBRIDGE_COMMISSION_JUDGE_H

#include "commission/steps.h"

/* A setting's value today: the given one, or the default; "" if that is not a single value. */
const char *db_commission_setting(const struct db_commission *commission, const char *section,
                                  const char *name);

/* The defaults of settings, for a test to compare with the service's. */
struct db_commission_preset {
	const char *section;
	const char *name;
	const char *families; /* with spaces around each */
	const char *preset;
};
extern const struct db_commission_preset db_commission_presets[];

/* The earlier verdict of this setting, or NULL. */
json_t *db_commission_find_verdict(const struct db_commission *commission, const char *section,
                                   const char *setting);

/*
 * Adds a verdict of a setting, of section "drive" or "bus"; with section "" it is a finding that no
 * key can change, and `right` is NULL or advice. A contradiction is not withdrawn within a round.
 */
void db_commission_judge(struct db_commission *commission, const char *section, const char *setting,
                         const char *verdict, const char *right, const char *format, ...)
	__attribute__((format(printf, 6, 7)));

/* True, for the caller to return. */
bool db_commission_ask(struct db_commission_action *action, const char *id, const char *choices,
                       const char *format, ...) __attribute__((format(printf, 4, 5)));

bool db_commission_answered(const struct db_commission_outcome *outcome, const char *answer);

/* Actions; each returns true too. `factor` is relative to a motion's usual time, below 0
 * backwards. */
bool db_commission_watch(struct db_commission_action *action, unsigned ms,
                         enum db_commission_until until);
bool db_commission_run(struct db_commission_action *action, const char *command);
bool db_commission_move(struct db_commission *commission, struct db_commission_action *action,
                        double factor, const char *ending);

/* Today's value as a number; 0 without one. */
double db_commission_number(const struct db_commission *commission, const char *section,
                            const char *name);

/* A time for a setting: rounded up to 50 ms. */
void db_commission_write_ms(double ms, char text[32]);

#endif
