/* SPDX-License-Identifier: Apache-2.0 */
/* A terminal whose keys come at once and unseen, and which is afterwards as it was. */
#ifndef DRIVEBRIDGE_CTL_TERMINAL_H
#define DRIVEBRIDGE_CTL_TERMINAL_H

#include <stdbool.h>
#include <stddef.h>
#include <termios.h>

struct db_ctl_terminal {
	struct termios before;
	bool open;
	bool screen; /* a screen of its own, without a cursor */
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

/* Also behind a terminal that is gone, and twice. Keys that wait are thrown away. */
void db_ctl_terminal_close(struct db_ctl_terminal *terminal);

/* Whether it takes a line now: one that is stopped must not keep its program from stopping a drive. */
bool db_ctl_terminal_takes_output(void);

/* Lines and columns, 24 and 80 where the terminal does not know. */
void db_ctl_terminal_size(unsigned *lines, unsigned *columns);

/*
 * The next key of what was read; `at` goes on behind it. DB_CTL_KEY_NONE at the end. An Escape with nothing behind it
 * is one: a sequence that came in two parts ends a jog, which is the safe side. Pure.
 */
enum db_ctl_key db_ctl_terminal_next_key(const char *bytes, size_t count, size_t *at);

#endif
