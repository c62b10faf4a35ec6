/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_serial.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define NO_ID        VSMD_SERIAL_NO_ID
#define UNREAD_ID    (-2)

/* --- helpers -------------------------------------------------------------------------------------- */

struct decoded {
	struct vsmd_command command;
	struct vsmd_setting settings[VSMD_PARAM_COUNT];
	enum vsmd_error error;
};

static void decode(const char *line, bool rs485, struct decoded *decoded)
{
	memset(decoded, 0, sizeof *decoded);
	decoded->error = vsmd_serial_decode_command(line, strlen(line), rs485, &decoded->command,
	                                            decoded->settings, COUNT(decoded->settings));
}

static bool begins_with_id(const char *line)
{
	return line[0] >= '0' && line[0] <= '9';
}

static void assert_encodes(const struct vsmd_command *command, const char *line)
{
	char text[VSMD_SERIAL_LINE_MAX];
	int length = vsmd_serial_encode_command(command, text, sizeof text);

	if (length < 0)
		fail_msg("\"%s\" was not encoded: error %d", line, length);
	assert_int_equal(length, strlen(line) + 1);
	assert_int_equal(text[length - 1], '\n');
	assert_memory_equal(text, line, strlen(line));
}

static void assert_error(const char *line, bool rs485, enum vsmd_error error)
{
	struct decoded decoded;

	decode(line, rs485, &decoded);
	if (decoded.error != error)
		fail_msg("\"%s\": error %d instead of %d", line, (int)decoded.error, (int)error);
}

static void assert_refused(struct vsmd_command command, enum vsmd_error error)
{
	char text[VSMD_SERIAL_LINE_MAX];

	assert_int_equal(vsmd_serial_encode_command(&command, text, sizeof text), error);
}

static void assert_same(const struct vsmd_command *a, const struct vsmd_command *b)
{
	assert_int_equal(a->verb, b->verb);
	assert_int_equal(a->id, b->id);
	assert_int_equal(a->has_value, b->has_value);
	assert_int_equal(a->has_velocity, b->has_velocity);
	assert_int_equal(a->position, b->position);
	assert_true(a->velocity == b->velocity);
	assert_int_equal(a->port, b->port);
	assert_int_equal(a->value, b->value);
	assert_int_equal(a->shake_start, b->shake_start);
	assert_int_equal(a->shake_end, b->shake_end);
	assert_true(a->shake_frequency == b->shake_frequency);
	assert_int_equal(a->shake_count, b->shake_count);
	assert_int_equal(a->setting_count, b->setting_count);
}

/* --- command lines of the document ---------------------------------------------------------------- */

static const struct {
	const char *line;
	struct vsmd_command command;
} documented[] = {
	{ "dev", { .verb = VSMD_DEV, .id = NO_ID } },
	{ "1 dev", { .verb = VSMD_DEV, .id = 1 } },
	{ "sts", { .verb = VSMD_STS, .id = NO_ID } },
	{ "ena", { .verb = VSMD_ENA, .id = NO_ID } },
	{ "off", { .verb = VSMD_OFF, .id = NO_ID } },
	{ "mov", { .verb = VSMD_MOV, .id = NO_ID } },
	{ "mov spd=6400",
	  { .verb = VSMD_MOV, .id = NO_ID, .has_velocity = true, .velocity = 6400 } },
	{ "pos 10000", { .verb = VSMD_POS, .id = NO_ID, .position = 10000 } },
	{ "2 pos 10000", { .verb = VSMD_POS, .id = 2, .position = 10000 } },
	{ "pos 10000 spd=20000",
	  { .verb = VSMD_POS,
	    .id = NO_ID,
	    .position = 10000,
	    .has_velocity = true,
	    .velocity = 20000 } },
	{ "rmv -6400", { .verb = VSMD_RMV, .id = NO_ID, .position = -6400 } },
	{ "rmv -1000 spd=20000",
	  { .verb = VSMD_RMV,
	    .id = NO_ID,
	    .position = -1000,
	    .has_velocity = true,
	    .velocity = 20000 } },
	{ "stp", { .verb = VSMD_STP, .id = NO_ID } },
	{ "stp 0", { .verb = VSMD_STP, .id = NO_ID, .has_value = true } },
	{ "stp 1", { .verb = VSMD_STP, .id = NO_ID, .has_value = true, .value = 1 } },
	{ "org", { .verb = VSMD_ORG, .id = NO_ID } },
	{ "org -7", { .verb = VSMD_ORG, .id = NO_ID, .has_value = true, .position = -7 } },
	{ "eclr", { .verb = VSMD_ECLR, .id = NO_ID } },
	{ "s1 on", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 1, .value = 1 } },
	{ "s1 off", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 1 } },
	{ "s2 on", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 2, .value = 1 } },
	{ "s2 off", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 2 } },
	{ "s3 on", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 3, .value = 1 } },
	{ "s3 off", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 3 } },
	{ "s4 on", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 4, .value = 1 } },
	{ "s4 off", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 4 } },
	{ "s5 on", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 5, .value = 1 } },
	{ "s5 off", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 5 } },
	{ "s6 on", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 6, .value = 1 } },
	{ "s6 off", { .verb = VSMD_SENSOR_OUT, .id = NO_ID, .port = 6 } },
	{ "sv1 160", { .verb = VSMD_SV, .id = NO_ID, .port = 1, .value = 160 } },
	{ "sv2 160", { .verb = VSMD_SV, .id = NO_ID, .port = 2, .value = 160 } },
	{ "sv3 160", { .verb = VSMD_SV, .id = NO_ID, .port = 3, .value = 160 } },
	{ "nmos1 160", { .verb = VSMD_NMOS, .id = NO_ID, .port = 1, .value = 160 } },
	{ "nmos2 160", { .verb = VSMD_NMOS, .id = NO_ID, .port = 2, .value = 160 } },
	{ "nmos3 160", { .verb = VSMD_NMOS, .id = NO_ID, .port = 3, .value = 160 } },
	{ "zero start", { .verb = VSMD_ZERO_START, .id = NO_ID } },
	{ "zero stop", { .verb = VSMD_ZERO_STOP, .id = NO_ID } },
	{ "shake start spos=-100 epos=200 freq=0.5 cycles=3",
	  { .verb = VSMD_SHAKE_CYCLES,
	    .id = NO_ID,
	    .shake_start = -100,
	    .shake_end = 200,
	    .shake_frequency = 0.5f,
	    .shake_count = 3 } },
	{ "32 shake start spos=0 epos=1600 freq=20 time=0",
	  { .verb = VSMD_SHAKE_TIME, .id = 32, .shake_end = 1600, .shake_frequency = 20 } },
	{ "shake stop", { .verb = VSMD_SHAKE_STOP, .id = NO_ID } },
	{ "cfg", { .verb = VSMD_CFG_READ, .id = NO_ID } },
	{ "sav", { .verb = VSMD_SAV, .id = NO_ID } },
};

static void documented_lines(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(documented); i++) {
		const char *line = documented[i].line;
		struct decoded decoded;

		decode(line, begins_with_id(line), &decoded);
		if (decoded.error != VSMD_OK)
			fail_msg("\"%s\": error %d", line, (int)decoded.error);
		assert_same(&decoded.command, &documented[i].command);
		assert_encodes(&documented[i].command, line);
		assert_encodes(&decoded.command, line);
	}
}

/* Each RS232 line with an id in front is the RS485 line, and the other way round is an error. */
static void documented_lines_on_rs485(void **state)
{
	static const int ids[] = { VSMD_SERIAL_BROADCAST, 1, 9, 10, 32 };

	(void)state;
	for (size_t i = 0; i < COUNT(documented); i++) {
		if (begins_with_id(documented[i].line)) {
			assert_error(documented[i].line, false, VSMD_ERR_SYNTAX);
			continue;
		}
		assert_error(documented[i].line, true, VSMD_ERR_SYNTAX);
		for (size_t j = 0; j < COUNT(ids); j++) {
			struct vsmd_command command = documented[i].command;
			struct decoded decoded;
			char line[128];

			snprintf(line, sizeof line, "%d %s", ids[j], documented[i].line);
			command.id = ids[j];
			decode(line, true, &decoded);
			assert_int_equal(decoded.error, VSMD_OK);
			assert_same(&decoded.command, &command);
			assert_encodes(&command, line);
		}
	}
}

/* --- parameter lines of the document -------------------------------------------------------------- */

static const struct {
	const char *line;
	double number;
	const char *canonical; /* where the codec writes fewer digits than the document */
} examples[VSMD_PARAM_COUNT] = {
	[VSMD_BDR] = { "cfg bdr=115200", 115200, NULL },
	[VSMD_CID] = { "cfg cid=1", 1, NULL },
	[VSMD_MCS] = { "cfg mcs=5", 5, NULL },
	[VSMD_SPD] = { "cfg spd=1200", 1200, NULL },
	[VSMD_ACC] = { "cfg acc=12000", 12000, NULL },
	[VSMD_DEC] = { "cfg dec=12000", 12000, NULL },
	[VSMD_CRA] = { "cfg cra=0.8", 0.8, NULL },
	[VSMD_CRN] = { "cfg crn=0.4", 0.4, NULL },
	[VSMD_CRH] = { "cfg crh=0.0", 0, "cfg crh=0" },
	[VSMD_S1F] = { "cfg s1f=3", 3, NULL },
	[VSMD_S1R] = { "cfg s1r=2", 2, NULL },
	[VSMD_S2F] = { "cfg s2f=3", 3, NULL },
	[VSMD_S2R] = { "cfg s2r=2", 2, NULL },
	[VSMD_S3F] = { "cfg s3f=3", 3, NULL },
	[VSMD_S3R] = { "cfg s3r=2", 2, NULL },
	[VSMD_S4F] = { "cfg s4f=3", 3, NULL },
	[VSMD_S4R] = { "cfg s4r=2", 2, NULL },
	[VSMD_S5F] = { "cfg s5f=3", 3, NULL },
	[VSMD_S5R] = { "cfg s5r=2", 2, NULL },
	[VSMD_S6F] = { "cfg s6f=3", 3, NULL },
	[VSMD_S6R] = { "cfg s6r=2", 2, NULL },
	[VSMD_S1] = { "cfg s1=1", 1, NULL },
	[VSMD_S2] = { "cfg s2=1", 1, NULL },
	[VSMD_S3] = { "cfg s3=1", 1, NULL },
	[VSMD_S4] = { "cfg s4=1", 1, NULL },
	[VSMD_S5] = { "cfg s5=1", 1, NULL },
	[VSMD_S6] = { "cfg s6=1", 1, NULL },
	[VSMD_PUD] = { "cfg pud=63", 63, NULL },
	[VSMD_PAE] = { "cfg pae=1", 1, NULL },
	[VSMD_DAR] = { "cfg dar=10", 10, NULL },
	[VSMD_ZMD] = { "cfg zmd=1", 1, NULL },
	[VSMD_ZAR] = { "cfg zar=1", 1, NULL },
	[VSMD_SNR] = { "cfg snr=0", 0, NULL },
	[VSMD_OSV] = { "cfg osv=0", 0, NULL },
	[VSMD_ZSD] = { "cfg zsd=-1200", -1200, NULL },
	[VSMD_ZSP] = { "cfg zsp=2400", 2400, NULL },
	[VSMD_ZCR] = { "cfg zcr=0.4", 0.4, NULL },
	[VSMD_MSR] = { "cfg msr=1", 1, NULL },
	[VSMD_MSV] = { "cfg msv=1", 1, NULL },
	[VSMD_PSR] = { "cfg psr=1", 1, NULL },
	[VSMD_PSV] = { "cfg psv=1", 1, NULL },
	[VSMD_SML] = { "cfg sml=-2000", -2000, NULL },
	[VSMD_SPL] = { "cfg spl=-50000", -50000, NULL },
	[VSMD_EMOD] = { "cfg emod=1", 1, NULL },
	[VSMD_ELNS] = { "cfg elns=1000", 1000, NULL },
	[VSMD_ESTP] = { "cfg estp=200", 200, NULL },
	[VSMD_EZ] = { "cfg ez=4", 4, NULL },
	[VSMD_ESDS] = { "cfg esds=0.5", 0.5, NULL },
	[VSMD_ERTY] = { "cfg erty=2", 2, NULL },
	[VSMD_EDIR] = { "cfg edir=0", 0, NULL },
	[VSMD_EWR] = { "cfg ewr=2", 2, NULL },
	[VSMD_ERATIO] = { "cfg eratio=1.0", 1, "cfg eratio=1" },
	[VSMD_N1RATIO] = { "cfg n1ratio=0.5", 0.5, NULL },
	[VSMD_N2RATIO] = { "cfg n2ratio=0.5", 0.5, NULL },
	[VSMD_N3RATIO] = { "cfg n3ratio=0.5", 0.5, NULL },
	[VSMD_RES] = { "cfg res=2000", 2000, NULL },
};

static void assert_setting(const struct vsmd_setting *setting, enum vsmd_param param, double number)
{
	union db_value expected = { .u = 0 };

	assert_true(db_value_from_number(vsmd_params[param].type, number, &expected));
	assert_int_equal(setting->param, param);
	assert_int_equal(setting->value.u, expected.u);
}

static void documented_parameters(void **state)
{
	(void)state;
	for (int i = 0; i < VSMD_PARAM_COUNT; i++) {
		const char *line = examples[i].line;
		struct decoded decoded;

		decode(line, false, &decoded);
		if (decoded.error != VSMD_OK)
			fail_msg("\"%s\": error %d", line, (int)decoded.error);
		assert_int_equal(decoded.command.verb, VSMD_CFG_WRITE);
		assert_int_equal(decoded.command.id, NO_ID);
		assert_int_equal(decoded.command.setting_count, 1);
		assert_ptr_equal(decoded.command.settings, decoded.settings);
		assert_setting(&decoded.settings[0], (enum vsmd_param)i, examples[i].number);
		assert_encodes(&decoded.command, examples[i].canonical ? examples[i].canonical : line);
	}
}

static void broadcast_parameter(void **state)
{
	struct decoded decoded;

	(void)state;
	decode("0 cfg bdr=115200", true, &decoded);
	assert_int_equal(decoded.error, VSMD_OK);
	assert_int_equal(decoded.command.id, VSMD_SERIAL_BROADCAST);
	assert_setting(&decoded.settings[0], VSMD_BDR, 115200);
	assert_encodes(&decoded.command, "0 cfg bdr=115200");
	decode("cfg pud=39", false, &decoded);
	assert_int_equal(decoded.error, VSMD_OK);
	assert_setting(&decoded.settings[0], VSMD_PUD, 39);
}

static void several_parameters(void **state)
{
	static const char *const lines[] = { "cfg spd=2400 acc=24000 dec=24000",
		                             "8 cfg spd=2400 acc=24000 dec=24000" };

	(void)state;
	for (size_t i = 0; i < COUNT(lines); i++) {
		struct decoded decoded;

		decode(lines[i], i == 1, &decoded);
		assert_int_equal(decoded.error, VSMD_OK);
		assert_int_equal(decoded.command.verb, VSMD_CFG_WRITE);
		assert_int_equal(decoded.command.id, i == 1 ? 8 : NO_ID);
		assert_int_equal(decoded.command.setting_count, 3);
		assert_setting(&decoded.settings[0], VSMD_SPD, 2400);
		assert_setting(&decoded.settings[1], VSMD_ACC, 24000);
		assert_setting(&decoded.settings[2], VSMD_DEC, 24000);
		assert_encodes(&decoded.command, lines[i]);
	}
}

/* All parameters in one line, each as wide as it gets, still fit what the header promises. */
static void all_parameters_at_once(void **state)
{
	struct vsmd_setting settings[VSMD_PARAM_COUNT];
	struct vsmd_command command = {
		.verb = VSMD_CFG_WRITE, .id = 32, .settings = settings, .setting_count = COUNT(settings)
	};
	char line[VSMD_SERIAL_LINE_MAX];
	struct decoded decoded;
	int length;

	(void)state;
	for (int i = 0; i < VSMD_PARAM_COUNT; i++) {
		const struct db_param *param = &vsmd_params[i];

		settings[i].param = (enum vsmd_param)i;
		assert_true(db_value_from_number(param->type, param->min < 0 ? param->min : param->max,
		                                 &settings[i].value));
		if (param->type == DB_F32 && i != VSMD_ESDS)
			settings[i].value.f = FLT_TRUE_MIN;
	}
	length = vsmd_serial_encode_command(&command, line, sizeof line);
	assert_in_range(length, 1, VSMD_SERIAL_LINE_MAX);
	line[length - 1] = '\0';
	decode(line, true, &decoded);
	assert_int_equal(decoded.error, VSMD_OK);
	assert_int_equal(decoded.command.setting_count, VSMD_PARAM_COUNT);
	assert_memory_equal(decoded.settings, settings, sizeof settings);
}

/* --- ranges of commands --------------------------------------------------------------------------- */

static void speeds(void **state)
{
	static const char *const good[] = { "mov spd=-192000", "mov spd=192000", "mov spd=0",
		                            "mov spd=0.1", "pos 1 spd=0", "pos 1 spd=192000",
		                            "rmv 1 spd=0", "rmv 1 spd=192000" };
	static const char *const bad[] = { "mov spd=-192000.1", "mov spd=192000.1", "pos 1 spd=-0.1",
		                           "pos 1 spd=192000.1", "rmv 1 spd=-1", "rmv 1 spd=192001",
		                           "mov spd=100000000000000000000000000000000000000000" };
	struct vsmd_command mov = { .verb = VSMD_MOV, .id = 1, .has_velocity = true };
	struct vsmd_command pos = { .verb = VSMD_POS, .id = 1, .has_velocity = true };
	struct vsmd_command rmv = { .verb = VSMD_RMV, .id = 1, .has_velocity = true };
	static const float over[] = { 192000.02f, FLT_MAX, INFINITY, -INFINITY, NAN, -192000.02f };

	(void)state;
	for (size_t i = 0; i < COUNT(good); i++) {
		struct decoded decoded;

		decode(good[i], false, &decoded);
		assert_int_equal(decoded.error, VSMD_OK);
		assert_encodes(&decoded.command, good[i]);
	}
	for (size_t i = 0; i < COUNT(bad); i++)
		assert_error(bad[i], false, VSMD_ERR_RANGE);
	for (size_t i = 0; i < COUNT(over); i++) {
		mov.velocity = pos.velocity = rmv.velocity = over[i];
		assert_refused(mov, VSMD_ERR_RANGE);
		assert_refused(pos, VSMD_ERR_RANGE);
		assert_refused(rmv, VSMD_ERR_RANGE);
	}
	pos.velocity = rmv.velocity = -1;
	assert_refused(pos, VSMD_ERR_RANGE);
	assert_refused(rmv, VSMD_ERR_RANGE);
}

static void positions(void **state)
{
	static const char *const good[] = { "pos -2147483648", "pos 2147483647", "rmv -2147483648",
		                            "rmv 2147483647",  "org -2147483648", "org 2147483647",
		                            "pos 0" };
	/* The document prints the range with its signs swapped. */
	static const char *const bad[] = { "pos 2147483648", "pos -2147483649", "rmv 2147483648",
		                           "rmv -2147483649", "org 2147483648", "org -2147483649",
		                           "pos 99999999999999999999999999999999" };

	(void)state;
	for (size_t i = 0; i < COUNT(good); i++) {
		struct decoded decoded;

		decode(good[i], false, &decoded);
		assert_int_equal(decoded.error, VSMD_OK);
		assert_encodes(&decoded.command, good[i]);
	}
	for (size_t i = 0; i < COUNT(bad); i++)
		assert_error(bad[i], false, VSMD_ERR_RANGE);
}

static void small_numbers(void **state)
{
	static const char *const range[] = { "stp 2",   "stp -1",   "sv1 256",   "sv1 -1",
		                             "sv3 256", "nmos1 256", "nmos3 -1", "sv2 1000000" };
	static const char *const syntax[] = { "sv0 1", "sv4 1", "nmos0 1", "nmos4 1", "s0 on", "s7 on" };

	(void)state;
	for (size_t i = 0; i < COUNT(range); i++)
		assert_error(range[i], false, VSMD_ERR_RANGE);
	for (size_t i = 0; i < COUNT(syntax); i++)
		assert_error(syntax[i], false, VSMD_ERR_SYNTAX);
	for (unsigned value = 0; value <= 255; value++) {
		struct vsmd_command sv = { .verb = VSMD_SV, .id = NO_ID, .port = 2, .value = (uint8_t)value };
		char line[16];

		snprintf(line, sizeof line, "sv2 %u", value);
		assert_encodes(&sv, line);
		sv.verb = VSMD_NMOS;
		snprintf(line, sizeof line, "nmos2 %u", value);
		assert_encodes(&sv, line);
	}
}

static void refused_by_encode(void **state)
{
	(void)state;
	assert_refused((struct vsmd_command){ .verb = VSMD_STP, .id = 1, .has_value = true, .value = 2 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SENSOR_OUT, .id = 1, .port = 0 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SENSOR_OUT, .id = 1, .port = 7 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SENSOR_OUT, .id = 1, .port = 1, .value = 2 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SV, .id = 1, .port = 0 }, VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SV, .id = 1, .port = 4 }, VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_NMOS, .id = 1, .port = 0 }, VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_NMOS, .id = 1, .port = 4 }, VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_DEV, .id = 33 }, VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_DEV, .id = -2 }, VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_VERB_COUNT, .id = 1 }, VSMD_ERR_SYNTAX);
	assert_refused((struct vsmd_command){ .verb = VSMD_CFG_WRITE, .id = 1 }, VSMD_ERR_SYNTAX);
}

static void shake_ranges(void **state)
{
	static const float outside[] = { 0.19999f, 20.00001f, 0.0f, -1.0f, 0.1f, NAN, INFINITY };
	struct vsmd_command shake = { .verb = VSMD_SHAKE_CYCLES, .id = NO_ID };

	(void)state;
	for (size_t i = 0; i < COUNT(outside); i++) {
		shake.shake_frequency = outside[i];
		assert_refused(shake, VSMD_ERR_RANGE);
	}
	shake.shake_start = INT32_MIN;
	shake.shake_end = INT32_MAX;
	shake.shake_frequency = 0.2f;
	shake.shake_count = INT32_MAX;
	assert_encodes(&shake,
	               "shake start spos=-2147483648 epos=2147483647 freq=0.2 cycles=2147483647");
	shake.verb = VSMD_SHAKE_TIME;
	shake.shake_frequency = 20.0f;
	assert_encodes(&shake,
	               "shake start spos=-2147483648 epos=2147483647 freq=20 time=2147483647");
	shake.shake_count = (uint32_t)INT32_MAX + 1;
	assert_refused(shake, VSMD_ERR_RANGE);
	assert_error("shake start spos=0 epos=1 freq=0.2 time=0", false, VSMD_OK);
	assert_error("shake start spos=0 epos=1 freq=0.19 time=0", false, VSMD_ERR_RANGE);
	assert_error("shake start spos=0 epos=1 freq=20.1 time=0", false, VSMD_ERR_RANGE);
	assert_error("shake start spos=0 epos=1 freq=1 time=2147483648", false, VSMD_ERR_RANGE);
	assert_error("shake start spos=0 epos=1 freq=1 cycles=-1", false, VSMD_ERR_RANGE);
	assert_error("shake start spos=2147483648 epos=1 freq=1 cycles=1", false, VSMD_ERR_RANGE);
	assert_error("shake start spos=0 epos=-2147483649 freq=1 cycles=1", false, VSMD_ERR_RANGE);
}

static void shake_needs_each_word_once(void **state)
{
	/* The command table shortens the line to this; the drive has nothing to go by. */
	assert_error("shake start", false, VSMD_ERR_SYNTAX);
	(void)state;
	assert_error("shake start epos=1 freq=1 time=0", false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 freq=1 time=0", false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 epos=1 time=0", false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 epos=1 freq=1", false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 epos=1 freq=1 time=0 cycles=0", false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 spos=0 epos=1 freq=1 time=0", false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 epos=1 freq=1 freq=2 time=0", false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 epos=1 freq=1 time=0 hz=1", false, VSMD_ERR_SYNTAX);
	assert_error("shake start freq=1 time=0 epos=1 spos=0", false, VSMD_OK);
}

static void parameter_ranges(void **state)
{
	static const char *const range[] = { "cfg bdr=2399",   "cfg bdr=921601",     "cfg cid=0",
		                             "cfg cid=33",     "cfg res=999",        "cfg res=1",
		                             "cfg eratio=0",   "cfg eratio=-1",      "cfg s1f=10",
		                             "cfg s1f=-1",     "cfg cid=65537",      "cfg mcs=0.5",
		                             "cfg zsp=2147483648", "cfg spd=192001", "cfg esds=0.95",
		                             "cfg cid=4294967297", "cfg cid=1.00000000000000000001" };
	struct vsmd_setting setting = { .param = VSMD_RES, .value.u = 500 };
	struct vsmd_command cfg = {
		.verb = VSMD_CFG_WRITE, .id = 1, .settings = &setting, .setting_count = 1
	};

	(void)state;
	for (size_t i = 0; i < COUNT(range); i++)
		assert_error(range[i], false, VSMD_ERR_RANGE);
	assert_error("cfg res=0", false, VSMD_OK);
	assert_error("cfg res=1000", false, VSMD_OK);
	assert_refused(cfg, VSMD_ERR_RANGE);
	setting = (struct vsmd_setting){ .param = VSMD_ERATIO, .value.f = 0 };
	assert_refused(cfg, VSMD_ERR_RANGE);
	setting = (struct vsmd_setting){ .param = VSMD_PARAM_COUNT };
	assert_refused(cfg, VSMD_ERR_RANGE);
}

/* --- malformed lines ------------------------------------------------------------------------------ */

static void malformed_lines(void **state)
{
	static const char *const lines[] = {
		"", " ", "\t", "\r", "\n", "DEV", "devx", "de", "dev x", "sts 1", "ena on", "off 0",
		"eclr 1", "sav 1", "dev\tx", "\tdev", "dev\t", "de\rv", "dev\r\r", "dev\nsts", "\x7f",
		"\xff\xfe", "pos", "pos x", "pos 1 2", "pos 1 spd", "pos 1 spd=", "pos 1 spd=x",
		"pos 1 spd=1 spd=1", "pos 1 acc=1", "pos spd=1", "pos 1.0", "pos 1.5", "pos 1e3",
		"pos 0x10", "pos --1", "pos +-1", "pos -", "pos +", "pos 1,000", "pos\t1", "pos 1\t",
		"pos nan", "rmv", "rmv one", "rmv 1 x", "mov 100", "mov spd", "mov spd=", "mov spd=1e3",
		"mov spd=0x10", "mov spd=nan", "mov spd=inf", "mov spd=-inf", "mov spd=1.2.3",
		"mov spd=.", "mov spd=-", "mov spd= 1", "mov spd=1 2", "mov SPD=1", "mov spd==1",
		"stp x", "stp 0 1", "stp 1.0", "org x", "org 1 2", "org 0.5", "s1", "s1 1", "s1 ON",
		"s1 on off", "s1 onn", "s", "s12 on", "sv1", "sv1 x", "sv1 1 2", "sv1 0xA0", "sv1 1.0",
		"sv 1", "nmos1", "nmos1 on", "nmos 1", "zero", "zero go", "zero start 1", "zero stop x",
		"shake", "shake go", "shake stop 1", "shake start x", "shake start spos", "cfg bdr",
		"cfg bdr=", "cfg =1", "cfg =", "cfg spd=1e3", "cfg spd=nan", "cfg spd=inf", "cfg bdr=0x10",
		"cfg spd=1 x", "cfg spd=1\tacc=2", "cfg bdr= 9600", "1 dev",
	};

	(void)state;
	for (size_t i = 0; i < COUNT(lines); i++) {
		struct decoded decoded;
		char with_id[64];

		decode(lines[i], false, &decoded);
		if (decoded.error == VSMD_OK || decoded.error == VSMD_ERR_RANGE)
			fail_msg("\"%s\": error %d", lines[i], (int)decoded.error);
		assert_int_equal(decoded.command.id, NO_ID);
		snprintf(with_id, sizeof with_id, "5 %s", lines[i]);
		decode(with_id, true, &decoded);
		if (decoded.error == VSMD_OK || decoded.error == VSMD_ERR_RANGE)
			fail_msg("\"%s\": error %d", with_id, (int)decoded.error);
		assert_int_equal(decoded.command.id, 5);
	}
}

static void unknown_parameters(void **state)
{
	(void)state;
	assert_error("cfg dmd=1", false, VSMD_ERR_NAME);
	assert_error("cfg sds=0.5", false, VSMD_ERR_NAME);
	assert_error("cfg spd=1 nosuch=2", false, VSMD_ERR_NAME);
	assert_error("cfg BDR=9600", false, VSMD_ERR_NAME);
}

static void ids(void **state)
{
	static const char *const unread[] = { "33 dev", "-1 dev", "+1 dev", "1.0 dev", "x dev", "dev",
		                              "0x1 dev", "1dev", "999999999999999999999 dev", "" };
	struct decoded decoded;

	(void)state;
	for (size_t i = 0; i < COUNT(unread); i++) {
		decode(unread[i], true, &decoded);
		assert_int_not_equal(decoded.error, VSMD_OK);
		assert_int_equal(decoded.command.id, UNREAD_ID);
	}
	assert_error("33 dev", true, VSMD_ERR_RANGE);
	decode("7 mov spd=192001", true, &decoded);
	assert_int_equal(decoded.error, VSMD_ERR_RANGE);
	assert_int_equal(decoded.command.id, 7);
	decode("8 cfg dmd=1", true, &decoded);
	assert_int_equal(decoded.error, VSMD_ERR_NAME);
	assert_int_equal(decoded.command.id, 8);
	decode("9", true, &decoded);
	assert_int_equal(decoded.error, VSMD_ERR_SYNTAX);
	assert_int_equal(decoded.command.id, 9);
}

static void bytes_that_end_c_strings(void **state)
{
	struct vsmd_command command;

	(void)state;
	assert_int_equal(vsmd_serial_decode_command("dev\0", 4, false, &command, NULL, 0),
	                 VSMD_ERR_SYNTAX);
	assert_int_equal(vsmd_serial_decode_command("\0dev", 4, false, &command, NULL, 0),
	                 VSMD_ERR_SYNTAX);
	assert_int_equal(vsmd_serial_decode_command("pos 1\0", 6, false, &command, NULL, 0),
	                 VSMD_ERR_SYNTAX);
	assert_int_equal(vsmd_serial_decode_command("dev\0 x", 3, false, &command, NULL, 0), VSMD_OK);
	/* Terminals end lines with both; the drive's '\n' is already gone here. */
	assert_int_equal(vsmd_serial_decode_command("pos 10\r", 7, false, &command, NULL, 0), VSMD_OK);
	assert_int_equal(command.position, 10);
}

static void space_for_settings(void **state)
{
	struct vsmd_setting settings[2];
	struct vsmd_command command;
	const char *two = "cfg spd=1 acc=2";
	const char *three = "cfg spd=1 acc=2 dec=3";

	(void)state;
	assert_int_equal(vsmd_serial_decode_command(two, strlen(two), false, &command, settings, 2),
	                 VSMD_OK);
	assert_int_equal(vsmd_serial_decode_command(three, strlen(three), false, &command, settings, 2),
	                 VSMD_ERR_SPACE);
	assert_int_equal(vsmd_serial_decode_command("cfg", 3, false, &command, NULL, 0), VSMD_OK);
}

static void space_for_lines(void **state)
{
	const struct vsmd_command command = { .verb = VSMD_POS, .id = 12, .position = -345 };
	char line[16];

	(void)state;
	for (size_t size = 0; size < strlen("12 pos -345\n"); size++)
		assert_int_equal(vsmd_serial_encode_command(&command, line, size), VSMD_ERR_SPACE);
	assert_int_equal(vsmd_serial_encode_command(&command, line, strlen("12 pos -345\n")),
	                 strlen("12 pos -345\n"));
}
