/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether a drive has been without power since it was read last, for families whose status tells
 * little of it: judged by its counter, its power and earlier events. One sign has other
 * explanations (the position is set at the drive, its motor is switched off, it is unplugged), so
 * only two signs that agree count as a restart. Pure; bus thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_RESTART_H
#define DRIVEBRIDGE_DRIVER_RESTART_H

#include "drivebridge/axis.h"
#include "drivebridge/command.h"

struct restart_sample {
	int32_t position;
	bool stands;
	/* busy with something that may set its position or move it far: nothing is judged */
	bool busy;
	/* the motor lost power since the sample before, unasked and without a fault */
	bool power_went;
};

enum restart_verdict {
	RESTART_NONE,  /* no sign, or a refuted one */
	RESTART_DOUBT, /* one sign */
	RESTART_SEEN,  /* two signs */
};

struct restart {
	bool known; /* the next two are */
	bool stood;
	int32_t position;
	bool away;            /* it did not answer at some time since */
	db_time power_went;   /* when the motor lost power, unasked; 0 */
	db_time judged_from;  /* until then, a command may explain what is seen */
	db_time doubted;      /* when the doubt began */
	int32_t doubted_from; /* its position then */
	enum db_doubt doubt;
	bool origin_lost;
	uint32_t restarts;
	uint32_t doubts;
};

enum restart_verdict restart_judge(struct restart *restart, const struct restart_sample *sample,
                                   db_time now);
/* A second sign from elsewhere: another axis of its controller has restarted at the same time.
 * False: there is no doubt to be confirmed, or it is an old one. */
bool restart_confirm(struct restart *restart, db_time now);

/* A command begins: the effects of one that moves the drive, or sets its position, are no sign. */
void restart_note_command(struct restart *restart, enum db_command command, db_time now);
/* It is at a position that it cannot have reached: the origin of its position is not known. */
void restart_note_jump(struct restart *restart, int32_t from, db_time now);
/* Its position was set: its origin is known again. */
void restart_note_placed(struct restart *restart, int32_t position);
/* A user confirms that the position is right. False: there was no doubt. */
bool restart_settle(struct restart *restart);
void restart_note_away(struct restart *restart);

/* Writes its part of the feedback and of the status. */
void restart_show(const struct restart *restart, struct db_feedback *feedback);

#endif
