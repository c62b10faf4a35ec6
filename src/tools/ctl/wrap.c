/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "words/language.h"

#include <stdbool.h>
#include <string.h>
#include <sys/ioctl.h>

/* The bytes of the character that begins here; of a colour sequence from an escape to the next m.
 */
static size_t count_bytes(const char *text)
{
	size_t bytes = 1;

	if (text[0] == '\033')
		return strcspn(text, "m") + (strchr(text, 'm') ? 1 : 0);
	while (((unsigned char)text[bytes] & 0xc0) == 0x80)
		bytes++;
	return bytes;
}

/* Signs that no line begins with. */
static bool ends_something(const char *text)
{
	static const char *const signs[] = { "，", "。", "；", "：", "、",
		                             "！", "？", "）", "”",  "」" };

	for (size_t i = 0; i < sizeof(signs) / sizeof(signs[0]); i++) {
		if (strncmp(text, signs[i], strlen(signs[i])) == 0)
			return true;
	}
	return false;
}

/* The bytes of the next piece that stays in one line, and its columns: up to a blank, or one
 * Chinese character. */
static size_t find_piece(const char *text, unsigned *columns)
{
	size_t bytes = 0;

	*columns = 0;
	while (text[bytes] && text[bytes] != ' ') {
		size_t more = count_bytes(text + bytes);
		bool escape = text[bytes] == '\033';
		unsigned wide = escape ? 0 : db_words_columns(text + bytes, more);

		if (wide == 2 && bytes > 0 && !ends_something(text + bytes))
			break;
		bytes += more;
		*columns += wide;
		if (wide == 2 && !ends_something(text + bytes))
			break;
	}
	return bytes;
}

void db_ctl_wrap(FILE *out, unsigned width, unsigned first, unsigned rest, const char *text)
{
	unsigned column = first;
	bool begun = false;

	fprintf(out, "%*s", (int)first, "");
	text += strspn(text, " ");
	while (*text) {
		unsigned columns;
		size_t blanks = begun ? strspn(text, " ") : 0;
		unsigned gap = blanks > 0 ? 1 : 0;
		size_t bytes = find_piece(text + blanks, &columns);

		text += blanks;
		if (bytes == 0)
			break;
		if (begun && width > 0 && column + gap + columns > width) {
			fprintf(out, "\n%*s", (int)rest, "");
			column = rest;
		} else {
			fprintf(out, "%*s", (int)gap, "");
			column += gap;
		}
		(void)fwrite(text, 1, bytes, out);
		column += columns;
		begun = true;
		text += bytes;
	}
	fputc('\n', out);
}

unsigned db_ctl_width(FILE *out)
{
	struct winsize size = { .ws_col = 0 };

	if (ioctl(fileno(out), TIOCGWINSZ, &size) != 0)
		return 0;
	return size.ws_col > 0 ? size.ws_col : DB_CTL_WIDTH;
}
