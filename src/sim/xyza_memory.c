/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/xyza_memory.h"

#include "codec/xyza_params.h"
#include "sim/sim_private.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TEXT_MAX 4096
#define END "end\n"

/* The axis under which the item is stored. */
static enum xyza_axis home(enum xyza_item item, enum xyza_axis axis)
{
	return xyza_item_of_axis(item) ? axis : XYZA_X;
}

uint32_t sim_xyza_memory_get(const struct sim_xyza_memory *memory, enum xyza_item item,
                             enum xyza_axis axis)
{
	return memory->items[home(item, axis)][item];
}

void sim_xyza_memory_set(struct sim_xyza_memory *memory, enum xyza_item item, enum xyza_axis axis,
                         uint32_t content, db_time now, db_time shown)
{
	axis = home(item, axis);
	if (memory->older[axis][item].until <= now)
		memory->older[axis][item].content = memory->items[axis][item];
	memory->older[axis][item].until = shown;
	memory->items[axis][item] = content;
}

uint32_t sim_xyza_memory_show(const struct sim_xyza_memory *memory, enum xyza_item item,
                              enum xyza_axis axis, db_time now)
{
	axis = home(item, axis);
	return now < memory->older[axis][item].until ? memory->older[axis][item].content :
	                                               memory->items[axis][item];
}

/* One line of numbers in the order of axes and items. */
int sim_xyza_memory_save(const struct sim_xyza_memory *memory, const char *path)
{
	char text[TEXT_MAX];
	size_t length = 0;

	_Static_assert(sizeof(memory->items) / sizeof(memory->items[0][0]) * sizeof("4294967295") +
	                               sizeof(END) <=
	                       sizeof(text),
	               "each number fits, with a blank behind it");
	for (size_t axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		for (size_t item = 0; item < XYZA_ITEM_COUNT; item++)
			length += (size_t)snprintf(text + length, sizeof(text) - length, "%lu ",
			                           (unsigned long)memory->items[axis][item]);
	}
	length += (size_t)snprintf(text + length, sizeof(text) - length, END);
	return sim_flash_write(path, text, length);
}

int sim_xyza_memory_load(struct sim_xyza_memory *memory, const char *path)
{
	uint32_t items[XYZA_AXIS_COUNT][XYZA_ITEM_COUNT];
	char text[TEXT_MAX];
	char *cursor = text;
	int length = sim_flash_read(path, text, sizeof(text));

	if (length < 0)
		return length;
	for (size_t axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		for (size_t item = 0; item < XYZA_ITEM_COUNT; item++)
			items[axis][item] = (uint32_t)strtoul(cursor, &cursor, 10);
	}
	if (strcmp(cursor, " " END) != 0)
		return -EBADMSG;
	memcpy(memory->items, items, sizeof(items));
	return 0;
}
