/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is left of commands and parameter writes for those who look later: an entry in the history,
 * and a refusal for the log. Network thread only.
 */
#ifndef DRIVEBRIDGE_AXIS_ACCOUNT_H
#define DRIVEBRIDGE_AXIS_ACCOUNT_H

#include "axis/pending.h"
#include "drivebridge/commander.h"

/* `client` is null for the bridge's own; `slot` for what ends without the bus. */
void db_account_add_command(struct db_commander *commander, const struct db_client *client,
                            const struct db_command_block *block, uint16_t id,
                            enum db_result result, struct db_slot *slot);
/* Of several settings the first counts. */
void db_account_add_settings(struct db_commander *commander, const struct db_client *client,
                             const struct db_setting *settings, enum db_result result,
                             struct db_slot *slot);

/* Reports a write that did not bring about what its writer wanted; what did is left out. */
void db_account_log_refusal(const struct db_commander *commander, const struct db_client *client,
                            const struct db_refused_write *write);

#endif
