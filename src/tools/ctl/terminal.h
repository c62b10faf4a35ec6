/* SPDX-License-Identifier: Apache-2.0 */
/* A terminal whose keys arrive at once and without echo; its former state is restored at the
 * end. */
#ifndef DRIVEBRIDGE_CTL_TERMINAL_H
#define DRIVEBRIDGE_CTL_TERMINAL_H

#include <stdbool.h>
#include <stddef.h>
#include <termios.h>

struct db_ctl_terminal {
	struct termios before;
	bool open;
	bool screen; /* the alternate screen, without a cursor */
};

enum db_ctl_key {
	DB_CTL_KEY_NONE,
	DB_CTL_KEY_OTHER,
	DB_CTL_KEY_FORWARD,  /* right or up */
	DB_CTL_KEY_BACKWARD, /* left or down */
	DB_CTL_KEY_QUIT,     /* Escape, q, Ctrl-C, Ctrl-D, Ctrl-\, Ctrl-Z */
};

/* False when standard input or output is no terminal. */
bool db_ctl_terminal_open(struct db_ctl_terminal *terminal, bool screen);

/* Also after the terminal is closed, and twice. Waiting keys are discarded. */
void db_ctl_terminal_close(struct db_ctl_terminal *terminal);

/* True if it accepts a line now: a stopped terminal must not keep the program from stopping a
 * drive. */
bool db_ctl_terminal_takes_output(void);

/* Lines and columns; 24 and 80 if the terminal does not report them. */
void db_ctl_terminal_size(unsigned *lines, unsigned *columns);

/*
 * The next key of the bytes read; `at` moves past it. DB_CTL_KEY_NONE at the end. An Escape with
 * nothing after it is the key Escape: a sequence split in two ends a jog, which is the safe side.
 * Pure.
 */
enum db_ctl_key db_ctl_terminal_next_key(const char *bytes, size_t count, size_t *at);

#endif
