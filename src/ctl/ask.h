/* SPDX-License-Identifier: Apache-2.0 */
/* Questions that somebody at the terminal has to answer before something is done. */
#ifndef DRIVEBRIDGE_CTL_ASK_H
#define DRIVEBRIDGE_CTL_ASK_H

#include "ctl/session.h"

/* DB_CTL_OK: yes, or --yes said so before; else the reason is printed. */
enum db_ctl_status db_ctl_ask(const struct db_ctl *ctl, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

#endif
