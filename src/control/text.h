/* SPDX-License-Identifier: Apache-2.0 */
/* Texts of people and of drives, which may hold any bytes. Pure. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_TEXT_H
#define DRIVEBRIDGE_CONTROL_TEXT_H

#include <stddef.h>

/* How many bytes the character of UTF-8 takes that a text begins with. 0: it begins with its end, with bytes that are
 * none, or with a character that nobody sees or that changes how the rest is seen. */
size_t db_text_character(const char *text);

#endif
