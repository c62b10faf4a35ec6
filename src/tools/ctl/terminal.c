/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/terminal.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#define ESCAPE '\033'

bool db_ctl_terminal_open(struct db_ctl_terminal *terminal, bool screen)
{
	struct termios raw;

	*terminal = (struct db_ctl_terminal){ .screen = screen };
	if (!isatty(STDIN_FILENO) || !isatty(STDOUT_FILENO) ||
	    tcgetattr(STDIN_FILENO, &terminal->before) != 0)
		return false;
	raw = terminal->before;
	raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO | ISIG | IEXTEN);
	raw.c_iflag &= ~(tcflag_t)(IXON | ICRNL);
	raw.c_cc[VMIN] = 0;
	raw.c_cc[VTIME] = 0;
	if (tcsetattr(STDIN_FILENO, TCSAFLUSH, &raw) != 0)
		return false;
	terminal->open = true;
	if (screen)
		fputs("\033[?1049h\033[?25l", stdout);
	(void)fflush(stdout);
	return true;
}

void db_ctl_terminal_close(struct db_ctl_terminal *terminal)
{
	if (!terminal->open)
		return;
	terminal->open = false;
	if (terminal->screen)
		fputs("\033[?25h\033[?1049l", stdout);
	if (db_ctl_terminal_takes_output())
		(void)fflush(stdout);
	/* Not TCSAFLUSH, which would block on a stopped terminal. */
	(void)tcflush(STDIN_FILENO, TCIFLUSH);
	(void)tcsetattr(STDIN_FILENO, TCSANOW, &terminal->before);
}

bool db_ctl_terminal_takes_output(void)
{
	struct pollfd out = { .fd = STDOUT_FILENO, .events = POLLOUT };

	return poll(&out, 1, 0) == 1 && (out.revents & POLLOUT);
}

void db_ctl_terminal_size(unsigned *lines, unsigned *columns)
{
	struct winsize size = { .ws_row = 0 };

	(void)ioctl(STDOUT_FILENO, TIOCGWINSZ, &size);
	*lines = size.ws_row > 0 ? size.ws_row : 24;
	*columns = size.ws_col > 0 ? size.ws_col : 80;
}

enum db_ctl_key db_ctl_terminal_next_key(const char *bytes, size_t count, size_t *at)
{
	const char *from = bytes + *at;
	size_t left = count - *at;

	if (left == 0)
		return DB_CTL_KEY_NONE;
	if (from[0] == ESCAPE && left >= 3 && (from[1] == '[' || from[1] == 'O')) {
		size_t length = 2;

		/* Parameters precede the letter that identifies the key. */
		while (length < left && from[length] >= '0' && from[length] <= '?')
			length++;
		*at += length < left ? length + 1 : length;
		switch (length < left ? from[length] : '\0') {
		case 'A':
		case 'C':
			return DB_CTL_KEY_FORWARD;
		case 'B':
		case 'D':
			return DB_CTL_KEY_BACKWARD;
		default:
			return DB_CTL_KEY_OTHER;
		}
	}
	*at += 1;
	return from[0] == ESCAPE || from[0] == 'q' || from[0] == 'Q' || from[0] == 3 ||
	                       from[0] == 4 || from[0] == 0x1c || from[0] == 0x1a ?
	               DB_CTL_KEY_QUIT :
	               DB_CTL_KEY_OTHER;
}
