/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The items of a simulated XYZA controller, in effect as soon as they are written, and the file
 * that keeps them without power. One thread.
 */
#ifndef DRIVEBRIDGE_SIM_XYZA_MEMORY_H
#define DRIVEBRIDGE_SIM_XYZA_MEMORY_H

#include "codec/xyza.h"
#include "drivebridge/time.h"

/* Shared items are stored with the first axis; their elements of the other axes are unused. */
struct sim_xyza_memory {
	uint32_t items[XYZA_AXIS_COUNT][XYZA_ITEM_COUNT];
	/* The values read of lately written items. */
	struct {
		uint32_t content;
		db_time until;
	} older[XYZA_AXIS_COUNT][XYZA_ITEM_COUNT];
};

uint32_t sim_xyza_memory_get(const struct sim_xyza_memory *memory, enum xyza_item item,
                             enum xyza_axis axis);

/* Until `shown`, a read returns the former value. */
void sim_xyza_memory_set(struct sim_xyza_memory *memory, enum xyza_item item, enum xyza_axis axis,
                         uint32_t content, db_time now, db_time shown);

/* The value that a read returns. */
uint32_t sim_xyza_memory_show(const struct sim_xyza_memory *memory, enum xyza_item item,
                              enum xyza_axis axis, db_time now);

/* 0 or a negative errno, as from sim_flash_write(). */
int sim_xyza_memory_save(const struct sim_xyza_memory *memory, const char *path);

/* -EBADMSG: its content is not in this form. With any errno the items are unchanged. */
int sim_xyza_memory_load(struct sim_xyza_memory *memory, const char *path);

#endif
