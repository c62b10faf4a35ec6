/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <float.h>
#include <math.h>
#include <string.h>
#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define I32_MIN (-2147483648.0)
#define I32_MAX 2147483647.0
#define MODEL true

/* What the document says, written out a second time; `word` must occur in the description. */
static const struct row {
	enum vsmd_param param;
	const char *name;
	enum db_type type;
	const char *unit;
	double min;
	double max;
	bool model;
	const char *word;
} rows[] = {
	{ VSMD_BDR, "bdr", DB_U32, "bit/s", 2400, 921600, false, "Baud rate" },
	{ VSMD_CID, "cid", DB_U16, "", 1, 32, false, "Device id" },
	{ VSMD_MCS, "mcs", DB_U16, "", 0, 8, false, "8=1/256" },
	{ VSMD_SPD, "spd", DB_F32, "pulses/s", -192000, 192000, false, "Preset speed" },
	{ VSMD_ACC, "acc", DB_F32, "pulses/s^2", 0, 192000000, false, "Acceleration" },
	{ VSMD_DEC, "dec", DB_F32, "pulses/s^2", 0, 192000000, false, "Deceleration" },
	{ VSMD_CRA, "cra", DB_F32, "A", 0, 10, MODEL, "while accelerating" },
	{ VSMD_CRN, "crn", DB_F32, "A", 0, 10, MODEL, "at constant speed" },
	{ VSMD_CRH, "crh", DB_F32, "A", 0, 10, MODEL, "at standstill" },
	{ VSMD_S1F, "s1f", DB_U16, "", 0, 9, false, "falling edge of sensor 1" },
	{ VSMD_S1R, "s1r", DB_U16, "", 0, 9, false, "rising edge of sensor 1" },
	{ VSMD_S2F, "s2f", DB_U16, "", 0, 9, false, "falling edge of sensor 2" },
	{ VSMD_S2R, "s2r", DB_U16, "", 0, 9, false, "rising edge of sensor 2" },
	{ VSMD_S3F, "s3f", DB_U16, "", 0, 9, false, "falling edge of sensor 3" },
	{ VSMD_S3R, "s3r", DB_U16, "", 0, 9, false, "rising edge of sensor 3" },
	{ VSMD_S4F, "s4f", DB_U16, "", 0, 9, false, "falling edge of sensor 4" },
	{ VSMD_S4R, "s4r", DB_U16, "", 0, 9, false, "rising edge of sensor 4" },
	{ VSMD_S5F, "s5f", DB_U16, "", 0, 9, false, "falling edge of sensor 5" },
	{ VSMD_S5R, "s5r", DB_U16, "", 0, 9, false, "rising edge of sensor 5" },
	{ VSMD_S6F, "s6f", DB_U16, "", 0, 9, false, "falling edge of sensor 6" },
	{ VSMD_S6R, "s6r", DB_U16, "", 0, 9, false, "rising edge of sensor 6" },
	{ VSMD_S1, "s1", DB_U16, "", 0, 1, false, "sensor port 1: 0=input 1=output" },
	{ VSMD_S2, "s2", DB_U16, "", 0, 1, false, "sensor port 2: 0=input 1=output" },
	{ VSMD_S3, "s3", DB_U16, "", 0, 1, false, "sensor port 3: 0=input 1=output" },
	{ VSMD_S4, "s4", DB_U16, "", 0, 1, false, "sensor port 4: 0=input 1=output" },
	{ VSMD_S5, "s5", DB_U16, "", 0, 1, false, "sensor port 5: 0=input 1=output" },
	{ VSMD_S6, "s6", DB_U16, "", 0, 1, false, "sensor port 6: 0=input 1=output" },
	{ VSMD_PUD, "pud", DB_U16, "", 0, 63, false, "1=up 0=down" },
	{ VSMD_PAE, "pae", DB_U16, "", 0, 1, false, "power-up" },
	{ VSMD_DAR, "dar", DB_U16, "s", 0, 60, false, "0=never" },
	{ VSMD_ZMD, "zmd", DB_U16, "", 0, 7, false, "5=sensorless" },
	{ VSMD_ZAR, "zar", DB_U16, "", 0, 1, false, "Home at power-up" },
	{ VSMD_SNR, "snr", DB_U16, "", 0, 5, false, "0=s1 ... 5=s6" },
	{ VSMD_OSV, "osv", DB_U16, "", 0, 1, false, "open" },
	{ VSMD_ZSD, "zsd", DB_F32, "pulses/s", -192000, 192000, false, "Homing speed" },
	{ VSMD_ZSP, "zsp", DB_I32, "pulses", I32_MIN, I32_MAX, false, "Safe position" },
	{ VSMD_ZCR, "zcr", DB_F32, "A", 0, 10, MODEL, "homing by encoder" },
	{ VSMD_MSR, "msr", DB_U16, "", 0, 6, false, "0=none 1=s1 ... 6=s6" },
	{ VSMD_MSV, "msv", DB_U16, "", 0, 1, false, "triggers the negative limit" },
	{ VSMD_PSR, "psr", DB_U16, "", 0, 6, false, "0=none 1=s1 ... 6=s6" },
	{ VSMD_PSV, "psv", DB_U16, "", 0, 1, false, "triggers the positive limit" },
	{ VSMD_SML, "sml", DB_I32, "pulses", I32_MIN, I32_MAX, false, "Negative software limit" },
	{ VSMD_SPL, "spl", DB_I32, "pulses", I32_MIN, I32_MAX, false, "Positive software limit" },
	{ VSMD_EMOD, "emod", DB_U16, "", 0, 2, false, "Encoder mode" },
	{ VSMD_ELNS, "elns", DB_U16, "lines", 10, 10000, false, "Encoder lines" },
	{ VSMD_ESTP, "estp", DB_U16, "steps", 1, 65535, false, "Full steps per motor turn" },
	{ VSMD_EZ, "ez", DB_U16, "", 0, 100, false, "smaller is more sensitive" },
	{ VSMD_ESDS, "esds", DB_F32, "", 0.1, 0.9, false, "larger is more sensitive" },
	{ VSMD_ERTY, "erty", DB_U16, "", 0, 100, false, "0=without limit" },
	{ VSMD_EDIR, "edir", DB_U16, "", 0, 1, false, "Encoder direction" },
	{ VSMD_EWR, "ewr", DB_U16, "", 0, 2, false, "2=stop and disable" },
	{ VSMD_ERATIO, "eratio", DB_F32, "", 0, (double)FLT_MAX, false, "Gear ratio" },
	{ VSMD_N1RATIO, "n1ratio", DB_F32, "", 0, 1, false, "cs1" },
	{ VSMD_N2RATIO, "n2ratio", DB_F32, "", 0, 1, false, "cs2" },
	{ VSMD_N3RATIO, "n3ratio", DB_F32, "", 0, 1, false, "cs3" },
	{ VSMD_RES, "res", DB_U32, "ohm", 0, 100000, false, "1000..100000" },
};

static union db_value value_of(enum db_type type, double number)
{
	union db_value value = { .u = 0 };

	assert_true(db_value_from_number(type, number, &value));
	return value;
}

static bool fits(enum vsmd_param param, double number)
{
	return vsmd_param_in_range(param, value_of(vsmd_params[param].type, number));
}

static void table_is_the_documents(void **state)
{
	(void)state;
	assert_int_equal(COUNT(rows), 56);
	assert_int_equal(VSMD_PARAM_COUNT, COUNT(rows) + 3); /* and those in no document */
	for (size_t i = 0; i < COUNT(rows); i++) {
		const struct db_param *param = &vsmd_params[i];

		assert_int_equal((int)rows[i].param, (int)i);
		assert_string_equal(param->name, rows[i].name);
		assert_int_equal((int)param->type, (int)rows[i].type);
		assert_string_equal(param->unit, rows[i].unit);
		assert_true(param->min == rows[i].min);
		assert_true(param->max == rows[i].max);
		assert_int_equal(param->max_is_model, rows[i].model);
	}
}

/* Of the same names and types, so that registers are at the same addresses. */
static void the_table_of_can_differs_in_two(void **state)
{
	(void)state;
	for (size_t i = 0; i < VSMD_PARAM_COUNT; i++) {
		const struct db_param *serial = &vsmd_params[i];
		const struct db_param *can = &vsmd_can_params[i];
		bool same = i != VSMD_BDR && i != VSMD_CID;

		assert_string_equal(serial->name, can->name);
		assert_int_equal((int)serial->type, (int)can->type);
		assert_string_equal(serial->unit, can->unit);
		assert_int_equal(strcmp(serial->description, can->description) == 0, same);
		assert_int_equal(serial->min == can->min && serial->max == can->max, same);
	}
	assert_true(vsmd_can_params[VSMD_BDR].min == 20e3 && vsmd_can_params[VSMD_BDR].max == 1e6);
	assert_true(vsmd_can_params[VSMD_CID].min == 1 && vsmd_can_params[VSMD_CID].max == 110);
}

static void descriptions_tell_the_point(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		const char *description = vsmd_params[i].description;

		assert_non_null(description);
		assert_null(strchr(description, '\n'));
		if (!strstr(description, rows[i].word))
			fail_msg("%s: \"%s\" lacks \"%s\"", rows[i].name, description,
			         rows[i].word);
	}
}

/* Those that the drive takes over only after saving and a power cycle. */
static void descriptions_warn_of_late_effect(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		bool late = i == VSMD_BDR || i == VSMD_CID || i == VSMD_EMOD;

		assert_int_equal(strstr(vsmd_params[i].description, "power cycle") != NULL, late);
	}
}

static void closed_loop_parameters_say_so(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		bool closed = (i >= VSMD_EMOD && i <= VSMD_ERATIO) || i == VSMD_ZCR;

		assert_int_equal(strstr(vsmd_params[i].description, "closed loop only") != NULL,
		                 closed);
	}
}

static void integer_ranges(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		enum vsmd_param param = rows[i].param;
		union db_value value;

		if (rows[i].type == DB_F32)
			continue;
		assert_true(fits(param, rows[i].min));
		assert_true(fits(param, rows[i].max));
		/* Where the type itself ends at the bound, there is nothing outside to try. */
		if (db_value_from_number(rows[i].type, rows[i].min - 1, &value))
			assert_false(vsmd_param_in_range(param, value));
		if (db_value_from_number(rows[i].type, rows[i].max + 1, &value))
			assert_false(vsmd_param_in_range(param, value));
		if (param != VSMD_RES)
			assert_true(fits(param, floor((rows[i].min + rows[i].max) / 2)));
	}
}

static void float_ranges(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		enum vsmd_param param = rows[i].param;
		float min = (float)rows[i].min;
		float max = (float)rows[i].max;

		if (rows[i].type != DB_F32 || param == VSMD_ERATIO)
			continue;
		assert_true(fits(param, rows[i].min));
		assert_true(fits(param, rows[i].max));
		assert_true(fits(param, (rows[i].min + rows[i].max) / 2));
		assert_false(fits(param, (double)nextafterf(min, -FLT_MAX)));
		assert_false(fits(param, (double)nextafterf(max, FLT_MAX)));
	}
}

static void floats_that_are_no_numbers(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		if (rows[i].type != DB_F32)
			continue;
		assert_false(vsmd_param_in_range(rows[i].param, (union db_value){ .f = NAN }));
		assert_false(vsmd_param_in_range(rows[i].param, (union db_value){ .f = INFINITY }));
		assert_false(
			vsmd_param_in_range(rows[i].param, (union db_value){ .f = -INFINITY }));
	}
}

/* 16-bit parameters travel in 32 bits: what does not fit must not be seen modulo 65536. */
static void upper_half_counts(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		if (rows[i].type == DB_U16)
			assert_false(vsmd_param_in_range(
				rows[i].param,
				(union db_value){ .u = 65536u + (uint32_t)rows[i].min }));
	}
}

static void res_has_a_hole(void **state)
{
	(void)state;
	assert_true(fits(VSMD_RES, 0));
	assert_false(fits(VSMD_RES, 1));
	assert_false(fits(VSMD_RES, 999));
	assert_true(fits(VSMD_RES, 1000));
	assert_true(fits(VSMD_RES, 100000));
	assert_false(fits(VSMD_RES, 100001));
	assert_false(vsmd_param_in_range(VSMD_RES, (union db_value){ .u = UINT32_MAX }));
}

static void eratio_is_above_zero(void **state)
{
	(void)state;
	assert_false(fits(VSMD_ERATIO, 0));
	assert_false(fits(VSMD_ERATIO, -0.0));
	assert_false(fits(VSMD_ERATIO, -1));
	assert_true(vsmd_param_in_range(VSMD_ERATIO, (union db_value){ .f = FLT_TRUE_MIN }));
	assert_true(fits(VSMD_ERATIO, 1));
	assert_true(vsmd_param_in_range(VSMD_ERATIO, (union db_value){ .f = FLT_MAX }));
}

static void every_homing_mode_is_legal(void **state)
{
	(void)state;
	for (int mode = 0; mode <= 7; mode++)
		assert_true(fits(VSMD_ZMD, mode));
	assert_false(fits(VSMD_ZMD, 8));
}

static void names_are_found(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++)
		assert_int_equal(vsmd_param_find(rows[i].name, strlen(rows[i].name)), (int)i);
	/* Not terminated: only the given length counts. */
	assert_int_equal(vsmd_param_find("s1f=3", 3), VSMD_S1F);
	assert_int_equal(vsmd_param_find("s1f=3", 2), VSMD_S1);
}

static void other_names_are_not(void **state)
{
	static const char *const others[] = { "",     "dmx",  "sd",   "BDR", "bd",
		                              "bdrx", " bdr", "s7",   "s0",  "n4ratio",
		                              "mbs",  "s",    "spd ", "ra",  "eratio\n" };

	(void)state;
	for (size_t i = 0; i < COUNT(others); i++)
		assert_int_equal(vsmd_param_find(others[i], strlen(others[i])), -1);
	assert_int_equal(vsmd_param_find("bdr", 4), -1);
	assert_int_equal(vsmd_param_find("s1\0f", 4), -1);
}

static void status_bits(void **state)
{
	static const struct {
		enum vsmd_status_bit bit;
		unsigned number;
	} bits[] = {
		{ VSMD_ST_S1, 0 },
		{ VSMD_ST_S2, 1 },
		{ VSMD_ST_S3, 2 },
		{ VSMD_ST_S4, 3 },
		{ VSMD_ST_POS_REACHED, 4 },
		{ VSMD_ST_SPD_REACHED, 5 },
		{ VSMD_ST_FLT, 6 },
		{ VSMD_ST_ORG, 7 },
		{ VSMD_ST_STP, 8 },
		{ VSMD_ST_CMD_WRG, 9 },
		{ VSMD_ST_FLASH_ERR, 10 },
		{ VSMD_ST_ACTION, 11 },
		{ VSMD_ST_HS, 12 },
		{ VSMD_ST_PWR, 13 },
		{ VSMD_ST_ZERO, 14 },
		{ VSMD_ST_S5, 16 },
		{ VSMD_ST_S6, 17 },
		{ VSMD_ST_OVER_TEMPERATURE, 20 },
		{ VSMD_ST_OVER_CURRENT, 21 },
		{ VSMD_ST_VOLTAGE, 22 },
		{ VSMD_ST_ENC_ERR, 24 },
		{ VSMD_ST_ACT, 27 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(bits); i++)
		assert_int_equal((unsigned)bits[i].bit, 1u << bits[i].number);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(table_is_the_documents),
		cmocka_unit_test(the_table_of_can_differs_in_two),
		cmocka_unit_test(descriptions_tell_the_point),
		cmocka_unit_test(descriptions_warn_of_late_effect),
		cmocka_unit_test(closed_loop_parameters_say_so),
		cmocka_unit_test(integer_ranges),
		cmocka_unit_test(float_ranges),
		cmocka_unit_test(floats_that_are_no_numbers),
		cmocka_unit_test(upper_half_counts),
		cmocka_unit_test(res_has_a_hole),
		cmocka_unit_test(eratio_is_above_zero),
		cmocka_unit_test(every_homing_mode_is_legal),
		cmocka_unit_test(names_are_found),
		cmocka_unit_test(other_names_are_not),
		cmocka_unit_test(status_bits),
	};

	return cmocka_run_group_tests_name("codec/vsmd", tests, NULL, NULL);
}
