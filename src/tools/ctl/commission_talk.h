/* SPDX-License-Identifier: Apache-2.0 */
/* The source of a commissioning's answers: a person at the terminal or a program, line by line, or
 * a file with answers by name. */
#ifndef DRIVEBRIDGE_CTL_COMMISSION_TALK_H
#define DRIVEBRIDGE_CTL_COMMISSION_TALK_H

#include "commission/act.h"
#include "ctl/session.h"

struct db_ctl_talk {
	const struct db_ctl *ctl;
	json_t *prepared; /* answers by the names of their questions; NULL: lines */
	char line[256];
	size_t length;
	char answer[64];
};

/* DB_CTL_OK, or the reason is printed: --answers names a file that cannot be read, or standard
 * input is closed. */
enum db_ctl_status db_ctl_talk_open(struct db_ctl_talk *talk, const struct db_ctl *ctl);
void db_ctl_talk_close(struct db_ctl_talk *talk);

/*
 * Asks until the answer is one of the choices; a prefix that no other choice shares is enough, but
 * not for yes. NULL: skipped, or the input ended (then act->interrupted is set). Valid until the
 * next call.
 */
const char *db_ctl_talk_ask(struct db_ctl_talk *talk, struct db_commission_act *act,
                            const struct db_commission_action *question);

#endif
