/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd.h"

#include <string.h>

#define POSITION_MIN (-2147483648.0)
#define POSITION_MAX 2147483647.0
#define SPEED ((double)VSMD_SPEED_MAX)

/* The strongest model of the family; the document leaves each bound to the model. */
#define CURRENT_MAX 10.0

/* Parameters whose values on delivery are documented; events and limits depend on them. */
#define AS_DELIVERED(number) .traits = DB_PARAM_FIRST | DB_PARAM_HAS_PRESET, .preset = (number)

#define EVENTS                                                                                 \
	"0=none 1=set origin 2=decelerate 3=decelerate then set origin 4=stop at once "        \
	"5=stop at once then set origin 6=run forward 7=run backward 8=start offline program " \
	"9=stop offline program"
#define FALLING(n) "What a falling edge of sensor " n " does: " EVENTS
#define RISING(n) "What a rising edge of sensor " n " does: " EVENTS
#define MODE(n) "Direction of sensor port " n ": 0=input 1=output"

const struct db_drive_bit vsmd_status_bits[VSMD_STATUS_BITS] = {
	{ 0, "s1", "Level of sensor port 1" },
	{ 1, "s2", "Level of sensor port 2" },
	{ 2, "s3", "Level of sensor port 3" },
	{ 3, "s4", "Level of sensor port 4" },
	{ 4, "pos_reached",
	  "Target position reached; on later models only and a hint: see at_target" },
	{ 5, "spd_reached", "Target speed reached; on later models only and a hint" },
	{ 6, "flt", "Hardware fault" },
	{ 7, "org", "The position is the origin" },
	{ 8, "stp", "The motor stands" },
	{ 9, "cmd_wrg", "The latest command or value was refused" },
	{ 10, "flash_err", "The memory for parameters could not be read or written" },
	{ 11, "action", "An offline program runs" },
	{ 12, "hs", "Somebody has spoken to the drive" },
	{ 13, "pwr", "The motor has power" },
	{ 14, "zero", "Homing has ended; 0 while it goes on or was never asked for" },
	{ 16, "s5", "Level of sensor port 5" },
	{ 17, "s6", "Level of sensor port 6" },
	{ 20, "over_temperature", "Over-temperature; on later models only" },
	{ 21, "over_current", "Over-current; on later models only" },
	{ 22, "voltage", "Supply voltage out of range; on later models only" },
	{ 24, "enc_err", "Encoder error; closed loop only" },
	{ 27, "act", "A special motion has ended; 0 while it goes on or there is none" },
};

const struct db_param vsmd_params[VSMD_PARAM_COUNT] = {
	[VSMD_BDR] = { "bdr", DB_U32, "bit/s", 2400, 921600, false,
	               .description =
	                       "Baud rate (波特率); effective after save_parameters and a power "
	                       "cycle",
	               .traits = DB_PARAM_ADDRESS },
	[VSMD_CID] = { "cid", DB_U16, "", 1, 32, false,
	               .description =
	                       "Device id on RS485 (设备 ID); effective after save_parameters and "
	                       "a power cycle",
	               .traits = DB_PARAM_ADDRESS },
#include "codec/vsmd_params.inc"
};

const struct db_param vsmd_can_params[VSMD_PARAM_COUNT] = {
	[VSMD_BDR] = { "bdr", DB_U32, "bit/s", 20000, 1000000, false,
	               .description =
	                       "Bit rate on CAN (波特率), one of the vendor's table: 20 25 30 40 50 "
	                       "60 75 80 90 100 125 150 200 250 300 400 500 600 750 900 1000 "
	                       "kbit/s; effective after save_parameters and a power cycle",
	               .traits = DB_PARAM_ADDRESS | DB_PARAM_HAS_PRESET, .preset = 100000 },
	[VSMD_CID] = { "cid", DB_U16, "", 1, 110, false,
	               .description = "Device id on CAN (设备 ID); standard frames reach 1 to 15; "
	                              "effective after save_parameters and a power cycle",
	               .traits = DB_PARAM_ADDRESS },
#include "codec/vsmd_params.inc"
};

bool vsmd_param_in_range(enum vsmd_param param, union db_value value)
{
	const struct db_param *row = &vsmd_params[param];
	double number = db_value_number(row->type, value);
	double min = row->min;
	double max = row->max;

	/* A bound such as 0.1 must accept the nearest float. */
	if (row->type == DB_F32) {
		min = (double)(float)min;
		max = (double)(float)max;
	}
	if (!(number >= min && number <= max))
		return false;
	if (param == VSMD_RES)
		return number == 0 || number >= 1000;
	if (param == VSMD_ERATIO)
		return number > 0;
	return true;
}

int vsmd_param_find(const char *name, size_t length)
{
	for (int i = 0; i < VSMD_PARAM_COUNT; i++) {
		if (strlen(vsmd_params[i].name) == length &&
		    memcmp(vsmd_params[i].name, name, length) == 0)
			return i;
	}
	return -1;
}
