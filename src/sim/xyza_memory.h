/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The items of a simulated XYZA controller, in effect as soon as they are written, and the file that
 * keeps them without power. One thread.
 */
#ifndef DRIVEBRIDGE_SIM_XYZA_MEMORY_H
#define DRIVEBRIDGE_SIM_XYZA_MEMORY_H

#include "codec/xyza.h"
#include "drivebridge/time.h"

/* Those that all axes share are kept with the first; of the other axes' places they have nothing. */
struct sim_xyza_memory {
	uint32_t items[XYZA_AXIS_COUNT][XYZA_ITEM_COUNT];
	/* What is read of an item that was written lately. */
	struct {
		uint32_t content;
		db_time until;
	} older[XYZA_AXIS_COUNT][XYZA_ITEM_COUNT];
};

uint32_t sim_xyza_memory_get(const struct sim_xyza_memory *memory, enum xyza_item item,
                             enum xyza_axis axis);

/* Until `shown`, what is read of it is what it was. */
void sim_xyza_memory_set(struct sim_xyza_memory *memory, enum xyza_item item, enum xyza_axis axis,
                         uint32_t content, db_time now, db_time shown);

/* What is read of it. */
uint32_t sim_xyza_memory_show(const struct sim_xyza_memory *memory, enum xyza_item item,
                              enum xyza_axis axis, db_time now);

/* 0 or a negative errno, as of sim_flash_write(). */
int sim_xyza_memory_save(const struct sim_xyza_memory *memory, const char *path);

/* -EBADMSG: its content is not what is saved here. With any errno the items are as before. */
int sim_xyza_memory_load(struct sim_xyza_memory *memory, const char *path);

#endif
