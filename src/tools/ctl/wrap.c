/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <stdbool.h>
#include <string.h>
#include <sys/ioctl.h>

/* Characters, not bytes, without colour sequences: from an escape to the next m. */
static unsigned count_letters(const char *text, size_t bytes)
{
	unsigned letters = 0;
	bool escape = false;

	for (size_t i = 0; i < bytes; i++) {
		escape = escape || text[i] == '\033';
		if (!escape && ((unsigned char)text[i] & 0xc0) != 0x80)
			letters++;
		escape = escape && text[i] != 'm';
	}
	return letters;
}

void db_ctl_wrap(FILE *out, unsigned width, unsigned first, unsigned rest, const char *text)
{
	unsigned column = first;
	bool begun = false;

	(void)fprintf(out, "%*s", (int)first, "");
	for (text += strspn(text, " "); *text; text += strspn(text, " ")) {
		size_t bytes = strcspn(text, " ");
		unsigned letters = count_letters(text, bytes);

		if (begun && width > 0 && column + 1 + letters > width) {
			(void)fprintf(out, "\n%*s", (int)rest, "");
			column = rest;
		} else if (begun) {
			(void)fputc(' ', out);
			column++;
		}
		(void)fwrite(text, 1, bytes, out);
		column += letters;
		begun = true;
		text += bytes;
	}
	(void)fputc('\n', out);
}

unsigned db_ctl_width(FILE *out)
{
	struct winsize size = { .ws_col = 0 };

	if (ioctl(fileno(out), TIOCGWINSZ, &size) != 0)
		return 0;
	return size.ws_col > 0 ? size.ws_col : DB_CTL_WIDTH;
}
