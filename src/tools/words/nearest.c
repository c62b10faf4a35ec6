/* SPDX-License-Identifier: Apache-2.0 */
#include "words/nearest.h"
#include "words/value.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define LETTERS_MAX 63U
#define NAMES_MAX 3U
/* Lists of up to this number of names are shown whole. */
#define SHORT_LIST 8U

static unsigned least(unsigned a, unsigned b)
{
	return a < b ? a : b;
}

unsigned db_words_distance(const char *one, const char *other)
{
	size_t rows = strlen(one);
	size_t columns = strlen(other);
	unsigned cost[LETTERS_MAX + 1][LETTERS_MAX + 1] = { 0 };

	if (rows > LETTERS_MAX || columns > LETTERS_MAX)
		return UINT32_MAX;
	for (size_t i = 0; i <= rows; i++)
		cost[i][0] = (unsigned)i;
	for (size_t j = 0; j <= columns; j++)
		cost[0][j] = (unsigned)j;
	for (size_t i = 1; i <= rows; i++) {
		for (size_t j = 1; j <= columns; j++) {
			unsigned same = one[i - 1] == other[j - 1] ? 0 : 1;

			cost[i][j] = least(least(cost[i - 1][j], cost[i][j - 1]) + 1,
			                   cost[i - 1][j - 1] + same);
			if (i > 1 && j > 1 && one[i - 1] == other[j - 2] &&
			    one[i - 2] == other[j - 1])
				cost[i][j] = least(cost[i][j], cost[i - 2][j - 2] + 1);
		}
	}
	return cost[rows][columns];
}

void db_words_nearest_names(const json_t *list, const char *name, char *text, size_t size)
{
	size_t count = json_array_size(list);
	size_t nearest[NAMES_MAX];
	unsigned distance[NAMES_MAX];
	size_t found = 0;
	size_t used = 0;
	/* With more than a third of its letters changed it is another word. */
	unsigned far = 2 + (unsigned)(strlen(name) / 3);

	text[0] = '\0';
	for (size_t i = 0; i < count; i++) {
		const char *other = db_words_text(json_array_get(list, i), "name");
		/* A typed beginning or part of a name is nearly right. */
		const char *part = strlen(name) >= 3 ? strstr(other, name) : NULL;
		unsigned here = part == other ? 1 : part ? 2 : db_words_distance(name, other);
		size_t at = found;

		while (at > 0 && distance[at - 1] > here)
			at--;
		if (here >= far || at >= NAMES_MAX)
			continue;
		found += found < NAMES_MAX ? 1 : 0;
		for (size_t j = found - 1; j > at; j--) {
			distance[j] = distance[j - 1];
			nearest[j] = nearest[j - 1];
		}
		distance[at] = here;
		nearest[at] = i;
	}
	if (found == 0 && (count == 0 || count > SHORT_LIST))
		return;
	used = (size_t)snprintf(text, size, "%s", found > 0 ? "; did you mean " : "; there are ");
	for (size_t i = 0, all = found > 0 ? found : count; i < all && used < size; i++)
		used += (size_t)snprintf(
			text + used, size - used, "%s%s",
			i == 0       ? "" :
			i + 1 == all ? (found > 0 ? " or " : " and ") :
				       ", ",
			db_words_text(json_array_get(list, found > 0 ? nearest[i] : i), "name"));
	if (found > 0 && used < size)
		snprintf(text + used, size - used, "?");
}
