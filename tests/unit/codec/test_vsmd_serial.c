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
