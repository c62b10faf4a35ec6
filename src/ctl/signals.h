/* SPDX-License-Identifier: Apache-2.0 */
/* Signals as something to poll for, so that what has to be said or restored before the end is. */
#ifndef DRIVEBRIDGE_CTL_SIGNALS_H
#define DRIVEBRIDGE_CTL_SIGNALS_H

/*
 * Takes SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP and SIGWINCH for itself. A descriptor to poll, or -1. From here on
 * none of them ends or stops the program.
 */
int db_ctl_signals_open(void);

/* From here on they do what they did before. -1 is fine. */
void db_ctl_signals_close(int fd);

/* The next one, 0 when there is none. */
int db_ctl_signals_read(int fd);

#endif
