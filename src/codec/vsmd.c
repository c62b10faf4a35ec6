/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd.h"

#include <string.h>

#define POSITION_MIN (-2147483648.0)
#define POSITION_MAX 2147483647.0
#define SPEED ((double)VSMD_SPEED_MAX)

/* The strongest model of the family; the document leaves the bound of each to the model. */
#define CURRENT_MAX 10.0

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
	               "Baud rate (波特率); effective after save_parameters and a power cycle" },
	[VSMD_CID] = { "cid", DB_U16, "", 1, 32, false,
	               "Device id on RS485 (设备 ID); effective after save_parameters and a power cycle" },
	[VSMD_MCS] = { "mcs", DB_U16, "", 0, 8, false,
	               "Microstepping (细分): 0=full 1=1/2 2=1/4 3=1/8 4=1/16 5=1/32 6=1/64 7=1/128 8=1/256" },
	[VSMD_SPD] = { "spd", DB_F32, "pulses/s", -SPEED, SPEED, false,
	               "Preset speed (运行速度); the sign is the direction" },
	[VSMD_ACC] = { "acc", DB_F32, "pulses/s^2", 0, 192000000, false,
	               "Acceleration (加速度); 0 = none: straight to the target speed" },
	[VSMD_DEC] = { "dec", DB_F32, "pulses/s^2", 0, 192000000, false,
	               "Deceleration (减速度); 0 = none: every stop is immediate" },
	[VSMD_CRA] = { "cra", DB_F32, "A", 0, CURRENT_MAX, true,
	               "Current while accelerating (加速电流); upper bound depends on the model" },
	[VSMD_CRN] = { "crn", DB_F32, "A", 0, CURRENT_MAX, true,
	               "Current at constant speed (工作电流); upper bound depends on the model" },
	[VSMD_CRH] = { "crh", DB_F32, "A", 0, CURRENT_MAX, true,
	               "Current at standstill (保持电流); upper bound depends on the model" },
	[VSMD_S1F] = { "s1f", DB_U16, "", 0, 9, false, FALLING("1") },
	[VSMD_S1R] = { "s1r", DB_U16, "", 0, 9, false, RISING("1") },
	[VSMD_S2F] = { "s2f", DB_U16, "", 0, 9, false, FALLING("2") },
	[VSMD_S2R] = { "s2r", DB_U16, "", 0, 9, false, RISING("2") },
	[VSMD_S3F] = { "s3f", DB_U16, "", 0, 9, false, FALLING("3") },
	[VSMD_S3R] = { "s3r", DB_U16, "", 0, 9, false, RISING("3") },
	[VSMD_S4F] = { "s4f", DB_U16, "", 0, 9, false, FALLING("4") },
	[VSMD_S4R] = { "s4r", DB_U16, "", 0, 9, false, RISING("4") },
	[VSMD_S5F] = { "s5f", DB_U16, "", 0, 9, false, FALLING("5") },
	[VSMD_S5R] = { "s5r", DB_U16, "", 0, 9, false, RISING("5") },
	[VSMD_S6F] = { "s6f", DB_U16, "", 0, 9, false, FALLING("6") },
	[VSMD_S6R] = { "s6r", DB_U16, "", 0, 9, false, RISING("6") },
	[VSMD_S1] = { "s1", DB_U16, "", 0, 1, false, MODE("1") },
	[VSMD_S2] = { "s2", DB_U16, "", 0, 1, false, MODE("2") },
	[VSMD_S3] = { "s3", DB_U16, "", 0, 1, false, MODE("3") },
	[VSMD_S4] = { "s4", DB_U16, "", 0, 1, false, MODE("4") },
	[VSMD_S5] = { "s5", DB_U16, "", 0, 1, false, MODE("5") },
	[VSMD_S6] = { "s6", DB_U16, "", 0, 1, false, MODE("6") },
	[VSMD_PUD] = { "pud", DB_U16, "", 0, 63, false,
	               "Pull resistors of the sensor ports (上拉/下拉): bit 0 = s1 ... bit 5 = s6; 1=up 0=down" },
	[VSMD_PAE] = { "pae", DB_U16, "", 0, 1, false,
	               "Enable the motor at power-up (上电电机使能): 0=no 1=yes" },
	[VSMD_DAR] = { "dar", DB_U16, "s", 0, 60, false,
	               "Start the offline program when nobody speaks for so long (无握手启动等待时间); 0=never" },
	[VSMD_ZMD] = { "zmd", DB_U16, "", 0, 7, false,
	               "Homing mode (归零模式): 0=off 1=once 2=once then safe position 3=twice "
	               "4=twice then safe position 5=sensorless (some models) 6=encoder 7=Z signal" },
	[VSMD_ZAR] = { "zar", DB_U16, "", 0, 1, false,
	               "Home at power-up (上电自动归零): 0=no 1=yes" },
	[VSMD_SNR] = { "snr", DB_U16, "", 0, 5, false,
	               "Origin sensor's port (原点传感器端口) counted from 0: 0=s1 ... 5=s6" },
	[VSMD_OSV] = { "osv", DB_U16, "", 0, 1, false,
	               "Level of the origin sensor when it is open (开放电平): 0=low 1=high" },
	[VSMD_ZSD] = { "zsd", DB_F32, "pulses/s", -SPEED, SPEED, false,
	               "Homing speed (归零速度); the sign is the direction" },
	[VSMD_ZSP] = { "zsp", DB_I32, "pulses", POSITION_MIN, POSITION_MAX, false,
	               "Safe position where homing ends (归零安全位置)" },
	[VSMD_ZCR] = { "zcr", DB_F32, "A", 0, CURRENT_MAX, true,
	               "Current of homing by encoder (编码器归零电流); closed loop only" },
	[VSMD_MSR] = { "msr", DB_U16, "", 0, 6, false,
	               "Negative limit sensor (负极限传感器): 0=none 1=s1 ... 6=s6" },
	[VSMD_MSV] = { "msv", DB_U16, "", 0, 1, false,
	               "Level that triggers the negative limit (触发电平): 0=low 1=high" },
	[VSMD_PSR] = { "psr", DB_U16, "", 0, 6, false,
	               "Positive limit sensor (正极限传感器): 0=none 1=s1 ... 6=s6" },
	[VSMD_PSV] = { "psv", DB_U16, "", 0, 1, false,
	               "Level that triggers the positive limit (触发电平): 0=low 1=high" },
	[VSMD_SML] = { "sml", DB_I32, "pulses", POSITION_MIN, POSITION_MAX, false,
	               "Negative software limit (软件负限位); 0=none" },
	[VSMD_SPL] = { "spl", DB_I32, "pulses", POSITION_MIN, POSITION_MAX, false,
	               "Positive software limit (软件正限位); 0=none" },
	[VSMD_EMOD] = { "emod", DB_U16, "", 0, 2, false,
	                "Encoder mode (编码器模式): 0=none 1=A and B 2=A B and Z; closed loop only; effective "
	                "after save_parameters and a power cycle" },
	[VSMD_ELNS] = { "elns", DB_U16, "lines", 10, 10000, false,
	                "Encoder lines (编码器线数); closed loop only" },
	[VSMD_ESTP] = { "estp", DB_U16, "steps", 1, 65535, false,
	                "Full steps per motor turn (电机单圈整步数); closed loop only" },
	[VSMD_EZ] = { "ez", DB_U16, "", 0, 100, false,
	              "Encoder sensitivity (编码器灵敏度), smaller is more sensitive; closed loop only" },
	[VSMD_ESDS] = { "esds", DB_F32, "", 0.1, 0.9, false,
	                "Stall detection sensitivity (堵转检测灵敏度), larger is more sensitive; closed loop only" },
	[VSMD_ERTY] = { "erty", DB_U16, "", 0, 100, false,
	                "Stall retries (堵转重试次数); 0=without limit; closed loop only" },
	[VSMD_EDIR] = { "edir", DB_U16, "", 0, 1, false,
	                "Encoder direction (编码器方向): 0=against the motor 1=with the motor; closed loop only" },
	[VSMD_EWR] = { "ewr", DB_U16, "", 0, 2, false,
	               "After an encoder error (编码器错误处理方式): 0=nothing 1=stop 2=stop and disable; closed "
	               "loop only" },
	[VSMD_ERATIO] = { "eratio", DB_F32, "", 0, 3.4028234663852886e38, false,
	                  "Gear ratio between motor and encoder (电机减速比), above 0; closed loop only" },
	[VSMD_N1RATIO] = { "n1ratio", DB_F32, "", 0, 1, false,
	                   "Output ratio of port cs1 for set_nmos (输出比率)" },
	[VSMD_N2RATIO] = { "n2ratio", DB_F32, "", 0, 1, false,
	                   "Output ratio of port cs2 for set_nmos (输出比率)" },
	[VSMD_N3RATIO] = { "n3ratio", DB_F32, "", 0, 1, false,
	                   "Output ratio of port cs3 for set_nmos (输出比率)" },
	[VSMD_RES] = { "res", DB_U32, "ohm", 0, 100000, false,
	               "Potentiometer that sets the speed (外接电位器阻值): 0=none or 1000..100000" },
};

bool vsmd_param_in_range(enum vsmd_param param, union db_value value)
{
	const struct db_param *row = &vsmd_params[param];
	double number = db_value_number(row->type, value);
	double min = row->min;
	double max = row->max;

	/* A bound such as 0.1 must admit the float nearest to it. */
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
