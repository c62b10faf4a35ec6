/* SPDX-License-Identifier: Apache-2.0 */
/* Commands and parameter writes: a plan (plan.h), step by step. Internal to the driver; bus thread
 * only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_COMMANDS_H
#define DRIVEBRIDGE_DRIVER_XYZA_COMMANDS_H

#include "driver/conversation.h"

/* By enum xyza_plan_kind. */
extern const struct conversation_step xyza_plan_steps[];

/* Not for read_parameters and raw_frame, which have no plan. */
enum db_step xyza_begin_command(struct db_conversation *talk);
enum db_step xyza_begin_settings(struct db_conversation *talk);

/* An answer to a step of a plan was received. */
void xyza_note_answer(struct db_conversation *talk);
/* True for a refusal that is no failure, or that is looked into first: it is not sent again. */
bool xyza_is_refusal_final(const struct db_conversation *talk);

#endif
