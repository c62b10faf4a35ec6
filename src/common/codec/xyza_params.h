/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parameters of XYZA stepper controllers, and the items in which they are read and written.
 * Pure; any thread. Source: the vendor's protocol V1.00 of 2016-10-20, sections 3 and 4.
 */
#ifndef DRIVEBRIDGE_CODEC_XYZA_PARAMS_H
#define DRIVEBRIDGE_CODEC_XYZA_PARAMS_H

#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define XYZA_OBJECT_MAX 255 /* slave numbers are 1..255; there is no broadcast */

/* Items, which are read and written as a whole: four bytes. Those before XYZA_ITEM_ENABLE belong to
 * an axis. */
enum xyza_item {
	XYZA_ITEM_MIN_SPEED,
	XYZA_ITEM_MAX_SPEED,
	XYZA_ITEM_ACCELERATION_TIME,
	XYZA_ITEM_MANUAL_SPEED,
	XYZA_ITEM_STEP_ANGLE,
	XYZA_ITEM_MICROSTEP,
	XYZA_ITEM_LEAD,
	XYZA_ITEM_ENABLE,
	XYZA_ITEM_KEYS, /* three parameters in one: write all as read, with one changed */
	XYZA_ITEM_BRAKE,
	XYZA_ITEM_SOUND,
	XYZA_ITEM_READ_PASSWORD,
	XYZA_ITEM_PASSWORD,
	XYZA_ITEM_START_UP,
	XYZA_ITEM_SYSTEM_INFO,
	XYZA_ITEM_PULSE_MODE,
	XYZA_ITEM_FACTORY_RESET,
	XYZA_ITEM_SLAVE_NUMBER,
	XYZA_ITEM_COUNT
};

/* False for items common to all axes of a controller. */
bool xyza_item_of_axis(enum xyza_item item);

/* The index is used only in this program. */
enum xyza_param {
	XYZA_MIN_SPEED,
	XYZA_MAX_SPEED,
	XYZA_ACCELERATION_TIME,
	XYZA_MANUAL_SPEED,
	XYZA_STEP_ANGLE,
	XYZA_MICROSTEP,
	XYZA_LEAD,
	XYZA_ENABLE,
	XYZA_START_KEY,
	XYZA_STOP_KEY,
	XYZA_PAUSE_KEY,
	XYZA_BRAKE,
	XYZA_SOUND,
	XYZA_READ_PASSWORD,
	XYZA_PASSWORD,
	XYZA_START_UP,
	XYZA_SYSTEM_INFO,
	XYZA_PULSE_MODE,
	XYZA_FACTORY_RESET,
	XYZA_SLAVE_NUMBER,
	XYZA_PARAM_COUNT,

	/* The controller stores none of these: they follow from its other parameters. */
	XYZA_RAMP_ACCELERATION = XYZA_PARAM_COUNT,
	XYZA_RAMP_DECELERATION,
	XYZA_SHOWN_COUNT
};

extern const struct db_param xyza_params[XYZA_SHOWN_COUNT];

enum xyza_access {
	XYZA_CAN_READ = 1u << 0,
	XYZA_CAN_WRITE = 1u << 1,
	XYZA_NEEDS_UNLOCK =
		1u << 2, /* to be written only when the user has explicitly allowed it */
};

/* Position of a parameter in its item, in bits. */
struct xyza_param_place {
	enum xyza_item item;
	uint8_t shift;
	uint8_t width;
	unsigned access; /* a set of enum xyza_access */
};

extern const struct xyza_param_place xyza_param_places[XYZA_PARAM_COUNT];

/* True when the value is inside the documented range, also where that has holes (pause_key: 0 or
 * 8). */
bool xyza_param_in_range(enum xyza_param param, union db_value value);

/* Index of a parameter's name, or -1. The name need not be terminated. */
int xyza_param_find(const char *name, size_t length);

/*
 * Takes a parameter from its item's four bytes, and stores it there: the item's other parameters
 * stay unchanged, bits of no parameter become 0. A factory_reset is 1 here and sent as 0. A
 * start_key or stop_key that was never assigned in a controller is 0: outside its range, but
 * written back together with another key.
 */
union db_value xyza_param_get(enum xyza_param param, uint32_t content);
uint32_t xyza_param_put(enum xyza_param param, union db_value value, uint32_t content);

/*
 * A ramp, Hz/s: from min_speed to max_speed (Hz) in `time` (0.1 s); 0 when there is none. And the
 * time of a ramp, rounded to a possible value; 0 when no possible value is near it.
 */
float xyza_ramp(uint32_t min_speed, uint32_t max_speed, uint32_t time);
uint32_t xyza_ramp_time(uint32_t min_speed, uint32_t max_speed, float ramp);

/* --- items in frames -------------------------------------------------------------------------- */

/* Classes of order F1. */
enum xyza_class {
	XYZA_CLASS_POSITION = 0xE1,
	XYZA_CLASS_SPEED = 0xE2,
	XYZA_CLASS_MOTOR = 0xE3,
	XYZA_CLASS_PORTS = 0xE4,
	XYZA_CLASS_SYSTEM = 0xE5,
};

/* The place of an item: its class, and the number of its target in that. */
struct xyza_item_place {
	uint8_t item_class; /* enum xyza_class */
	uint8_t number;
};

extern const struct xyza_item_place xyza_items[XYZA_ITEM_COUNT];

/* True if it can be read, or written: an enum xyza_access. */
bool xyza_item_can(enum xyza_item item, unsigned access);

/*
 * True if its content has only values in range, and nothing in unused bytes. The bits `kept` are
 * written back as they were read, whatever they are: a controller may have undocumented content.
 */
bool xyza_item_in_range(enum xyza_item item, uint32_t content, uint32_t kept);

#endif
