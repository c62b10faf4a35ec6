/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/doubled.h"

#include <string.h>

/* A second drive's answer arrives this soon after the first one's; a later frame was sent
 * unasked. */
#define TOGETHER (30 * DB_NS_PER_MS)
/* A drive that sent unasked is expected to do so for this time. */
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

enum doubled_kind doubled_judge(struct doubled *doubled, uint32_t part, const uint8_t *frame,
                                size_t length, bool asked, db_time now)
{
	uint32_t content = hash(frame, length);
	uint32_t previous = doubled->previous;
	bool known = now < doubled->until;
	unsigned at = 0;

	doubled->previous = content;
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
			doubled->seen[at].copied = content == previous;
			doubled->seen_count++;
		}
		return DOUBLED_NOT;
	}
	if (doubled->seen[at].content == content)
		return DOUBLED_SAME;
	if (doubled->seen[at].copied && now >= doubled->until) {
		doubled->seen[at].content = content;
		doubled->seen[at].copied = false;
		return DOUBLED_NOT;
	}
	if (doubled->unasked != 0 && now - doubled->unasked < UNASKED_TIME)
		return DOUBLED_NOT;
	/* The first one may be chance: a late frame, an unsolicited report. */
	if (!known && (doubled->first == 0 || now - doubled->first >= DOUBLED_TIME)) {
		doubled->first = now;
		return DOUBLED_OTHER;
	}
	doubled->until = now + DOUBLED_TIME;
	return known ? DOUBLED_OTHER : DOUBLED_TWO;
}
