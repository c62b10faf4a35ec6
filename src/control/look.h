/* SPDX-License-Identifier: Apache-2.0 */
/* The calls that only look: Describe, Registers, Commands, Read, Figures. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_LOOK_H
#define DRIVEBRIDGE_CONTROL_LOOK_H

#include "control/call.h"

void db_look_describe(const struct db_call *call);
void db_look_registers(const struct db_call *call);
void db_look_commands(const struct db_call *call);
void db_look_read(const struct db_call *call);
void db_look_figures(const struct db_call *call);

/* It is due (DB_WAITS_FOR_REGISTERS): writes some more of the answer. */
void db_look_describe_more(struct db_session *session, db_time now);

/* Whether a register belongs to what is shown of a drive or of the gateway when no names are given. */
bool db_look_is_process(const struct db_entry *entry);

#endif
