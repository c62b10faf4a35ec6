/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include <stdint.h>

/* Control characters, direction marks, joiners, line separators, unusual spaces, private use, tags;
 * and invalid code points. */
static const struct range {
	uint32_t first;
	uint32_t last;
} unseen[] = {
	{ 0x0000, 0x001F },    { 0x007F, 0x00A0 }, { 0x00AD, 0x00AD },   { 0x061C, 0x061C },
	{ 0x115F, 0x1160 },    { 0x17B4, 0x17B5 }, { 0x180B, 0x180F },   { 0x2000, 0x200F },
	{ 0x2028, 0x202F },    { 0x205F, 0x206F }, { 0x3000, 0x3000 },   { 0x3164, 0x3164 },
	{ 0xD800, 0xF8FF },    { 0xFDD0, 0xFDEF }, { 0xFE00, 0xFE0F },   { 0xFEFF, 0xFEFF },
	{ 0xFFA0, 0xFFA0 },    { 0xFFF0, 0xFFFF }, { 0x1D173, 0x1D17A }, { 0x1FFFE, 0x1FFFF },
	{ 0xE0000, 0x10FFFF },
};

size_t db_text_character(const char *text)
{
	static const uint32_t shortest[] = { 0, 0, 0x80, 0x800, 0x10000 };
	uint8_t first = (uint8_t)text[0];
	size_t length = first < 0x80 ? 1 :
	                first < 0xC0 ? 0 :
	                first < 0xE0 ? 2 :
	                first < 0xF0 ? 3 :
	                first < 0xF8 ? 4 :
	                               0;
	uint32_t character = length < 2 ? first : first & (0x7Fu >> length);

	for (size_t i = 1; i < length; i++) {
		if (((uint8_t)text[i] & 0xC0) != 0x80)
			return 0;
		character = character << 6 | ((uint8_t)text[i] & 0x3F);
	}
	if (length == 0 || character < shortest[length] || character > 0x10FFFF)
		return 0;
	for (size_t i = 0; i < sizeof(unseen) / sizeof(unseen[0]); i++) {
		if (character >= unseen[i].first && character <= unseen[i].last)
			return 0;
	}
	return length;
}
