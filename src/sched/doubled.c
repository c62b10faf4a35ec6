/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/doubled.h"

#include <string.h>

/* A second drive's answer comes so soon behind the first one's; what comes later was sent unasked. */
#define TOGETHER (30 * DB_NS_PER_MS)
/* Who sends unasked is taken for one who does for so long. */
#define UNASKED_TIME (5 * DB_NS_PER_S)

/* FNV-1a, eight bytes at a time. */
static uint32_t hash(const uint8_t *bytes, size_t length)
{
	uint64_t value = UINT64_C(14695981039346656037);

	while (length > 0) {
		size_t take = length < sizeof(uint64_t) ? length : sizeof(uint64_t);
		uint64_t word = 0;

		memcpy(&word, bytes, take);
		value = (value ^ word) * UINT64_C(1099511628211);
		bytes += take;
		length -= take;
	}
	return (uint32_t)(value ^ value >> 32);
}

void doubled_begin(struct doubled *doubled)
{
	doubled->seen_count = 0;
}

/* A first one may be chance: a late frame, a report that nobody configured. */
static enum doubled_kind count_other(struct doubled *doubled, db_time now)
{
	bool known = now < doubled->until;
	bool again = doubled->first != 0 && now - doubled->first < DOUBLED_TIME;

	if (!again && !known) {
		doubled->first = now;
		return DOUBLED_OTHER;
	}
	doubled->until = now + DOUBLED_TIME;
	return known ? DOUBLED_OTHER : DOUBLED_TWO;
}

enum doubled_kind doubled_take(struct doubled *doubled, uint32_t part, const uint8_t *frame,
                               size_t length, bool asked, db_time now)
{
	uint32_t content = hash(frame, length);
	unsigned at = 0;

	if (!asked && now - doubled->last > TOGETHER) {
		doubled->unasked = now;
		return DOUBLED_NOT;
	}
	if (asked)
		doubled->last = now;
	while (at < doubled->seen_count && doubled->seen[at].part != part)
		at++;
	if (at == doubled->seen_count) {
		if (at < DOUBLED_PARTS) {
			doubled->seen[at].part = part;
			doubled->seen[at].content = content;
			doubled->seen_count++;
		}
		return DOUBLED_NOT;
	}
	if (doubled->seen[at].content == content)
		return DOUBLED_SAME;
	if (doubled->unasked != 0 && now - doubled->unasked < UNASKED_TIME)
		return DOUBLED_NOT;
	return count_other(doubled, now);
}
