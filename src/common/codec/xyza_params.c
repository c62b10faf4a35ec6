/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/xyza_params.h"

#include <float.h>
#include <math.h>
#include <string.h>

const struct xyza_item_place xyza_items[XYZA_ITEM_COUNT] = {
	[XYZA_ITEM_MIN_SPEED] = { XYZA_CLASS_SPEED, 1 },
	[XYZA_ITEM_MAX_SPEED] = { XYZA_CLASS_SPEED, 2 },
	[XYZA_ITEM_ACCELERATION_TIME] = { XYZA_CLASS_SPEED, 3 },
	[XYZA_ITEM_MANUAL_SPEED] = { XYZA_CLASS_SPEED, 4 },
	[XYZA_ITEM_STEP_ANGLE] = { XYZA_CLASS_MOTOR, 1 },
	[XYZA_ITEM_MICROSTEP] = { XYZA_CLASS_MOTOR, 2 },
	[XYZA_ITEM_LEAD] = { XYZA_CLASS_MOTOR, 3 },
	[XYZA_ITEM_ENABLE] = { XYZA_CLASS_SYSTEM, 1 },
	[XYZA_ITEM_KEYS] = { XYZA_CLASS_SYSTEM, 2 },
	[XYZA_ITEM_BRAKE] = { XYZA_CLASS_SYSTEM, 3 },
	[XYZA_ITEM_SOUND] = { XYZA_CLASS_SYSTEM, 4 },
	[XYZA_ITEM_READ_PASSWORD] = { XYZA_CLASS_SYSTEM, 5 },
	[XYZA_ITEM_PASSWORD] = { XYZA_CLASS_SYSTEM, 6 },
	[XYZA_ITEM_START_UP] = { XYZA_CLASS_SYSTEM, 7 },
	[XYZA_ITEM_SYSTEM_INFO] = { XYZA_CLASS_SYSTEM, 8 },
	[XYZA_ITEM_PULSE_MODE] = { XYZA_CLASS_SYSTEM, 9 },
	[XYZA_ITEM_FACTORY_RESET] = { XYZA_CLASS_SYSTEM, 10 },
	[XYZA_ITEM_SLAVE_NUMBER] = { XYZA_CLASS_SYSTEM, 11 },
};

#define U32_MAX 4294967295.0
#define AXES_MAX 15 /* a bit for each axis */
#define AXES "bit 0=x 1=y 2=z 3=a"

const struct db_param xyza_params[XYZA_SHOWN_COUNT] = {
	[XYZA_MIN_SPEED] = { "min_speed", DB_U32, "Hz", 0, U32_MAX, true,
	                     .description = "Speed at which a motion starts and ends (最低速度)" },
	[XYZA_MAX_SPEED] = { "max_speed", DB_U32, "Hz", 1, U32_MAX, true,
	                     .description = "Highest speed, of programs (最高速度)" },
	[XYZA_ACCELERATION_TIME] = { "acceleration_time", DB_U32, "0.1 s", 0, U32_MAX, true,
	                             .description = "Time from min_speed to max_speed (加速时间)" },
	[XYZA_MANUAL_SPEED] = { "manual_speed", DB_U32, "Hz", 1, U32_MAX, true,
	                        .description = "Speed of manual mode (手动速度)" },
	[XYZA_STEP_ANGLE] = { "step_angle", DB_U32, "steps/rev", 1, U32_MAX, true,
	                      .description =
	                              "Full steps per motor turn (电机步进角); 200 = 1.8 degrees" },
	[XYZA_MICROSTEP] = { "microstep", DB_U32, "", 1, U32_MAX, true,
	                     .description = "Microsteps per full step (驱动器细分)" },
	[XYZA_LEAD] = { "lead", DB_U32, "0.001 mm", 1, U32_MAX, true,
	                .description = "Way per motor turn (导程); 5000 = 5 mm" },
	[XYZA_ENABLE] = { "enable", DB_U16, "", 0, AXES_MAX, false,
	                  .description = "Motors that are always enabled (电机使能): " AXES,
	                  .traits = DB_PARAM_LAST | DB_PARAM_STATE },
	[XYZA_START_KEY] = { "start_key", DB_U16, "", 1, 7, false,
	                     .description = "Input that starts a program (启动键): 1=K1 ... 7=K7" },
	[XYZA_STOP_KEY] = { "stop_key", DB_U16, "", 1, 7, false,
	                    .description = "Input that stops a program (停止键): 1=K1 ... 7=K7" },
	[XYZA_PAUSE_KEY] = { "pause_key", DB_U16, "", 0, 8, false,
	                     .description =
	                             "Input that pauses a program (暂停键): 0=none or 8=K8" },
	[XYZA_BRAKE] = { "brake", DB_U16, "", 0, AXES_MAX, false,
	                 .description = "Axes that decelerate before they stand (刹车设置): " AXES
	                                "; the others stop at once" },
	[XYZA_SOUND] = { "sound", DB_U16, "", 0, 1, false,
	                 .description = "Sound while a motor turns (声音设置): 0=off 1=on" },
	[XYZA_READ_PASSWORD] = { "read_password", DB_U32, "", 0, U32_MAX, false,
	                         .description = "Item C5 (读取密码); its content is not documented",
	                         .traits = DB_PARAM_SECRET },
	[XYZA_PASSWORD] = { "password", DB_U32, "", 0, U32_MAX, false,
	                    .description = "Item C6 (密码设置); its content is not documented",
	                    .traits = DB_PARAM_SECRET },
	[XYZA_START_UP] = { "start_up", DB_U16, "", 0, 1, false,
	                    .description = "Run the program at power-up (启动设置): 0=no 1=yes" },
	[XYZA_SYSTEM_INFO] = { "system_info", DB_U32, "", 0, U32_MAX, false,
	                       .description =
	                               "Item C8 (系统信息); its codes are the vendor's; to be "
	                               "unlocked" },
	[XYZA_PULSE_MODE] = { "pulse_mode", DB_U16, "", 0, AXES_MAX, false,
	                      .description =
	                              "Axes with a pulse line per direction (脉冲方式): " AXES
	                              "; the others have pulse and direction" },
	[XYZA_FACTORY_RESET] = { "factory_reset", DB_U16, "", 1, 1, false,
	                         .description =
	                                 "1=all parameters as delivered (恢复出厂); cannot be read; "
	                                 "to be unlocked; needs 10 s and a power cycle",
	                         .traits = DB_PARAM_ACTION | DB_PARAM_WRITE_ONLY },
	[XYZA_SLAVE_NUMBER] = { "slave_number", DB_U16, "", 1, XYZA_OBJECT_MAX, false,
	                        .description =
	                                "The controller's number on the bus (从机序号); cannot be "
	                                "read; to be unlocked; effective at once",
	                        .traits = DB_PARAM_ADDRESS | DB_PARAM_WRITE_ONLY },
	[XYZA_RAMP_ACCELERATION] = { "ramp_acceleration", DB_F32, "Hz/s", 0, FLT_MAX, false,
	                             .description =
	                                     "Acceleration, from min_speed, max_speed and "
	                                     "acceleration_time, which is what a write changes; "
	                                     "0 = none: straight to the speed",
	                             .traits = DB_PARAM_DERIVED },
	[XYZA_RAMP_DECELERATION] = { "ramp_deceleration", DB_F32, "Hz/s", 0, FLT_MAX, false,
	                             .description =
	                                     "Deceleration: the same ramp where the axis has "
	                                     "brake, and a write changes both; 0 = none: every "
	                                     "stop is immediate",
	                             .traits = DB_PARAM_DERIVED },
};

#define READ_WRITE (XYZA_CAN_READ | XYZA_CAN_WRITE)
#define LOCKED (XYZA_CAN_WRITE | XYZA_NEEDS_UNLOCK)

const struct xyza_param_place xyza_param_places[XYZA_PARAM_COUNT] = {
	[XYZA_MIN_SPEED] = { XYZA_ITEM_MIN_SPEED, 0, 32, READ_WRITE },
	[XYZA_MAX_SPEED] = { XYZA_ITEM_MAX_SPEED, 0, 32, READ_WRITE },
	[XYZA_ACCELERATION_TIME] = { XYZA_ITEM_ACCELERATION_TIME, 0, 32, READ_WRITE },
	[XYZA_MANUAL_SPEED] = { XYZA_ITEM_MANUAL_SPEED, 0, 32, READ_WRITE },
	[XYZA_STEP_ANGLE] = { XYZA_ITEM_STEP_ANGLE, 0, 32, READ_WRITE },
	[XYZA_MICROSTEP] = { XYZA_ITEM_MICROSTEP, 0, 32, READ_WRITE },
	[XYZA_LEAD] = { XYZA_ITEM_LEAD, 0, 32, READ_WRITE },
	[XYZA_ENABLE] = { XYZA_ITEM_ENABLE, 0, 8, READ_WRITE },
	[XYZA_START_KEY] = { XYZA_ITEM_KEYS, 0, 8, READ_WRITE },
	[XYZA_STOP_KEY] = { XYZA_ITEM_KEYS, 8, 8, READ_WRITE },
	[XYZA_PAUSE_KEY] = { XYZA_ITEM_KEYS, 16, 8, READ_WRITE },
	[XYZA_BRAKE] = { XYZA_ITEM_BRAKE, 0, 8, READ_WRITE },
	[XYZA_SOUND] = { XYZA_ITEM_SOUND, 0, 8, READ_WRITE },
	[XYZA_READ_PASSWORD] = { XYZA_ITEM_READ_PASSWORD, 0, 32, READ_WRITE },
	[XYZA_PASSWORD] = { XYZA_ITEM_PASSWORD, 0, 32, READ_WRITE },
	[XYZA_START_UP] = { XYZA_ITEM_START_UP, 0, 8, READ_WRITE },
	/* The table of writes has it, but the effect of a write is not documented. */
	[XYZA_SYSTEM_INFO] = { XYZA_ITEM_SYSTEM_INFO, 0, 32, READ_WRITE | XYZA_NEEDS_UNLOCK },
	[XYZA_PULSE_MODE] = { XYZA_ITEM_PULSE_MODE, 0, 8, READ_WRITE },
	[XYZA_FACTORY_RESET] = { XYZA_ITEM_FACTORY_RESET, 0, 8, LOCKED },
	[XYZA_SLAVE_NUMBER] = { XYZA_ITEM_SLAVE_NUMBER, 0, 8, LOCKED },
};

bool xyza_item_of_axis(enum xyza_item item)
{
	return (unsigned)item < XYZA_ITEM_COUNT && xyza_items[item].item_class != XYZA_CLASS_SYSTEM;
}

bool xyza_param_in_range(enum xyza_param param, union db_value value)
{
	const struct db_param *row = &xyza_params[param];
	double number = db_value_number(row->type, value);

	if (param == XYZA_PAUSE_KEY)
		return number == row->min || number == row->max;
	return number >= row->min && number <= row->max;
}

int xyza_param_find(const char *name, size_t length)
{
	for (int i = 0; i < XYZA_PARAM_COUNT; i++) {
		if (strlen(xyza_params[i].name) == length &&
		    memcmp(xyza_params[i].name, name, length) == 0)
			return i;
	}
	return -1;
}

static uint32_t field_mask(enum xyza_param param)
{
	return UINT32_MAX >> (32 - xyza_param_places[param].width);
}

union db_value xyza_param_get(enum xyza_param param, uint32_t content)
{
	if (param == XYZA_FACTORY_RESET)
		return (union db_value){ .u = 1 };
	return (union db_value){ .u = (content >> xyza_param_places[param].shift) &
		                      field_mask(param) };
}

float xyza_ramp(uint32_t min_speed, uint32_t max_speed, uint32_t time)
{
	if (time == 0 || max_speed <= min_speed)
		return 0.0f;
	return (float)(10.0 * ((double)max_speed - (double)min_speed) / (double)time);
}

uint32_t xyza_ramp_time(uint32_t min_speed, uint32_t max_speed, float ramp)
{
	double time;

	if (max_speed <= min_speed || !(ramp > 0.0f))
		return 0;
	time = round(10.0 * ((double)max_speed - (double)min_speed) / (double)ramp);
	return time <= (double)UINT32_MAX ? (uint32_t)time : 0;
}

/* The bits of an item's content that belong to a parameter. */
static uint32_t item_mask(enum xyza_item item)
{
	uint32_t mask = 0;

	for (int i = 0; i < XYZA_PARAM_COUNT; i++) {
		if (xyza_param_places[i].item == item && i != XYZA_FACTORY_RESET)
			mask |= field_mask((enum xyza_param)i) << xyza_param_places[i].shift;
	}
	return mask;
}

uint32_t xyza_param_put(enum xyza_param param, union db_value value, uint32_t content)
{
	uint32_t mask = field_mask(param);
	uint32_t kept = item_mask(xyza_param_places[param].item) &
	                ~(mask << xyza_param_places[param].shift);

	if (param == XYZA_FACTORY_RESET)
		return 0;
	return (content & kept) | ((value.u & mask) << xyza_param_places[param].shift);
}

bool xyza_item_in_range(enum xyza_item item, uint32_t content, uint32_t kept)
{
	for (int i = 0; i < XYZA_PARAM_COUNT; i++) {
		enum xyza_param param = (enum xyza_param)i;
		bool is_key = param == XYZA_START_KEY || param == XYZA_STOP_KEY;
		union db_value written;

		/* In a parameter that is a set of axes each bit is a separate value. */
		if (xyza_param_places[i].item != item ||
		    ((field_mask(param) << xyza_param_places[param].shift) & ~kept) == 0)
			continue;
		written = xyza_param_get(param, content & ~kept);
		/* A key that was never assigned must not prevent the assignment of the others,
		 * which are written together with it. */
		if (!(is_key && written.u == 0) && !xyza_param_in_range(param, written))
			return false;
	}
	return (content & ~kept & ~item_mask(item)) == 0;
}

bool xyza_item_can(enum xyza_item item, unsigned access)
{
	for (int i = 0; i < XYZA_PARAM_COUNT; i++) {
		if (xyza_param_places[i].item == item)
			return (xyza_param_places[i].access & access) != 0;
	}
	return false;
}
