/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_numbers.h"
#include "codec/vsmd_serial_frames.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define NO_ID VSMD_SERIAL_NO_ID
#define UNREAD_ID (-2)

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
	/* In no document. */
	[VSMD_DMD] = { "cfg dmd=1", 1, NULL },
	[VSMD_SDS] = { "cfg sds=0.5", 0.5, NULL },
	[VSMD_CAF] = { "cfg caf=1", 1, NULL },
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
		assert_encodes(&decoded.command,
		               examples[i].canonical ? examples[i].canonical : line);
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
	struct vsmd_command command = { .verb = VSMD_CFG_WRITE,
		                        .id = 32,
		                        .settings = settings,
		                        .setting_count = COUNT(settings) };
	char line[VSMD_SERIAL_LINE_MAX];
	struct decoded decoded;
	int length;

	(void)state;
	for (int i = 0; i < VSMD_PARAM_COUNT; i++) {
		const struct db_param *param = &vsmd_params[i];

		settings[i].param = (enum vsmd_param)i;
		assert_true(db_value_from_number(
			param->type, param->min < 0 ? param->min : param->max, &settings[i].value));
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

/* A name may come twice; both reach the drive in order, where the last one wins. */
static void repeated_parameter(void **state)
{
	struct decoded decoded;

	(void)state;
	decode("3 cfg spd=100 acc=7 spd=200", true, &decoded);
	assert_int_equal(decoded.error, VSMD_OK);
	assert_int_equal(decoded.command.setting_count, 3);
	assert_setting(&decoded.settings[0], VSMD_SPD, 100);
	assert_setting(&decoded.settings[1], VSMD_ACC, 7);
	assert_setting(&decoded.settings[2], VSMD_SPD, 200);
	assert_encodes(&decoded.command, "3 cfg spd=100 acc=7 spd=200");
}

static void several_spaces(void **state)
{
	static const struct {
		const char *line;
		const char *canonical;
	} rows[] = {
		{ "  4   pos   10000    spd=20000  ", "4 pos 10000 spd=20000" },
		{ "4 zero  start ", "4 zero start" },
		{ " 4  cfg ", "4 cfg" },
		{ "4 cfg  spd=1   acc=2 \r", "4 cfg spd=1 acc=2" },
		{ "4  dev\r", "4 dev" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		struct decoded decoded;

		decode(rows[i].line, true, &decoded);
		assert_int_equal(decoded.error, VSMD_OK);
		assert_encodes(&decoded.command, rows[i].canonical);
	}
}

/* Commands are read strictly, a drive's own texts are not. */
static void half_written_fractions(void **state)
{
	static const char *const lines[] = { "mov spd=5.", "mov spd=.5", "mov spd=-.5",
		                             "cfg spd=5.", "cfg spd=.5", "cfg bdr=9600." };
	static const char text[] = "spd=5. acc=.5 bdr=9600.";
	struct vsmd_setting setting;
	size_t cursor = 0;

	(void)state;
	for (size_t i = 0; i < COUNT(lines); i++)
		assert_error(lines[i], false, VSMD_ERR_SYNTAX);
	assert_error("shake start spos=0 epos=1 freq=.5 time=0", false, VSMD_ERR_SYNTAX);
	assert_error("cfg bdr=9600.0", false, VSMD_OK);
	assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 1);
	assert_setting(&setting, VSMD_SPD, 5);
	assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 1);
	assert_setting(&setting, VSMD_ACC, 0.5);
	assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 1);
	assert_setting(&setting, VSMD_BDR, 9600);
}

/* --- ranges of commands --------------------------------------------------------------------------- */

static void speeds(void **state)
{
	static const char *const good[] = { "mov spd=-192000", "mov spd=192000",
		                            "mov spd=0",       "mov spd=0.1",
		                            "pos 1 spd=0",     "pos 1 spd=192000",
		                            "rmv 1 spd=0",     "rmv 1 spd=192000" };
	static const char *const bad[] = { "mov spd=-192000.1",
		                           "mov spd=192000.1",
		                           "pos 1 spd=-0.1",
		                           "pos 1 spd=192000.1",
		                           "rmv 1 spd=-1",
		                           "rmv 1 spd=192001",
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
	static const char *const good[] = { "pos -2147483648",
		                            "pos 2147483647",
		                            "rmv -2147483648",
		                            "rmv 2147483647",
		                            "org -2147483648",
		                            "org 2147483647",
		                            "pos 0" };
	/* The document prints the range with its signs swapped. */
	static const char *const bad[] = { "pos 2147483648",
		                           "pos -2147483649",
		                           "rmv 2147483648",
		                           "rmv -2147483649",
		                           "org 2147483648",
		                           "org -2147483649",
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
	static const char *const range[] = { "stp 2",   "stp -1",    "sv1 256",  "sv1 -1",
		                             "sv3 256", "nmos1 256", "nmos3 -1", "sv2 1000000" };
	static const char *const syntax[] = { "sv0 1",   "sv4 1", "nmos0 1",
		                              "nmos4 1", "s0 on", "s7 on" };

	(void)state;
	for (size_t i = 0; i < COUNT(range); i++)
		assert_error(range[i], false, VSMD_ERR_RANGE);
	for (size_t i = 0; i < COUNT(syntax); i++)
		assert_error(syntax[i], false, VSMD_ERR_SYNTAX);
	for (unsigned value = 0; value <= 255; value++) {
		struct vsmd_command sv = {
			.verb = VSMD_SV, .id = NO_ID, .port = 2, .value = (uint8_t)value
		};
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
	assert_refused(
		(struct vsmd_command){ .verb = VSMD_STP, .id = 1, .has_value = true, .value = 2 },
		VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SENSOR_OUT, .id = 1, .port = 0 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SENSOR_OUT, .id = 1, .port = 7 },
	               VSMD_ERR_RANGE);
	assert_refused(
		(struct vsmd_command){ .verb = VSMD_SENSOR_OUT, .id = 1, .port = 1, .value = 2 },
		VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SV, .id = 1, .port = 0 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_SV, .id = 1, .port = 4 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_NMOS, .id = 1, .port = 0 },
	               VSMD_ERR_RANGE);
	assert_refused((struct vsmd_command){ .verb = VSMD_NMOS, .id = 1, .port = 4 },
	               VSMD_ERR_RANGE);
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
	static const char *const range[] = { "cfg bdr=2399",
		                             "cfg bdr=921601",
		                             "cfg cid=0",
		                             "cfg cid=33",
		                             "cfg res=999",
		                             "cfg res=1",
		                             "cfg eratio=0",
		                             "cfg eratio=-1",
		                             "cfg s1f=10",
		                             "cfg s1f=-1",
		                             "cfg cid=65537",
		                             "cfg mcs=0.5",
		                             "cfg zsp=2147483648",
		                             "cfg spd=192001",
		                             "cfg esds=0.95",
		                             "cfg cid=4294967297",
		                             "cfg cid=1.00000000000000000001" };
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
		"",
		" ",
		"\t",
		"\r",
		"\n",
		"DEV",
		"devx",
		"de",
		"dev x",
		"sts 1",
		"ena on",
		"off 0",
		"eclr 1",
		"sav 1",
		"dev\tx",
		"\tdev",
		"dev\t",
		"de\rv",
		"dev\r\r",
		"dev\nsts",
		"\x7f",
		"\xff\xfe",
		"pos",
		"pos x",
		"pos 1 2",
		"pos 1 spd",
		"pos 1 spd=",
		"pos 1 spd=x",
		"pos 1 spd=1 spd=1",
		"pos 1 acc=1",
		"pos spd=1",
		"pos 1.0",
		"pos 1.5",
		"pos 1e3",
		"pos 0x10",
		"pos --1",
		"pos +-1",
		"pos -",
		"pos +",
		"pos 1,000",
		"pos\t1",
		"pos 1\t",
		"pos nan",
		"rmv",
		"rmv one",
		"rmv 1 x",
		"mov 100",
		"mov spd",
		"mov spd=",
		"mov spd=1e3",
		"mov spd=0x10",
		"mov spd=nan",
		"mov spd=inf",
		"mov spd=-inf",
		"mov spd=1.2.3",
		"mov spd=.",
		"mov spd=-",
		"mov spd= 1",
		"mov spd=1 2",
		"mov SPD=1",
		"mov spd==1",
		"stp x",
		"stp 0 1",
		"stp 1.0",
		"org x",
		"org 1 2",
		"org 0.5",
		"s1",
		"s1 1",
		"s1 ON",
		"s1 on off",
		"s1 onn",
		"s",
		"s12 on",
		"sv1",
		"sv1 x",
		"sv1 1 2",
		"sv1 0xA0",
		"sv1 1.0",
		"sv 1",
		"nmos1",
		"nmos1 on",
		"nmos 1",
		"zero",
		"zero go",
		"zero start 1",
		"zero stop x",
		"shake",
		"shake go",
		"shake stop 1",
		"shake start x",
		"shake start spos",
		"cfg bdr",
		"cfg bdr=",
		"cfg =1",
		"cfg =",
		"cfg spd=1e3",
		"cfg spd=nan",
		"cfg spd=inf",
		"cfg bdr=0x10",
		"cfg spd=1 x",
		"cfg spd=1\tacc=2",
		"cfg bdr= 9600",
		"1 dev",
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
	assert_error("cfg dmx=1", false, VSMD_ERR_NAME);
	assert_error("cfg sd=0.5", false, VSMD_ERR_NAME);
	assert_error("cfg spd=1 nosuch=2", false, VSMD_ERR_NAME);
	assert_error("cfg BDR=9600", false, VSMD_ERR_NAME);
}

static void ids(void **state)
{
	static const char *const unread[] = { "33 dev",  "-1 dev", "+1 dev",
		                              "1.0 dev", "x dev",  "dev",
		                              "0x1 dev", "1dev",   "999999999999999999999 dev",
		                              "" };
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
	decode("8 cfg dmx=1", true, &decoded);
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
	assert_int_equal(vsmd_serial_decode_command("dev\0 x", 3, false, &command, NULL, 0),
	                 VSMD_OK);
	/* Terminals end lines with both; the drive's '\n' is already gone here. */
	assert_int_equal(vsmd_serial_decode_command("pos 10\r", 7, false, &command, NULL, 0),
	                 VSMD_OK);
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
	assert_int_equal(
		vsmd_serial_decode_command(three, strlen(three), false, &command, settings, 2),
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

/* --- replies -------------------------------------------------------------------------------------- */

static const uint8_t status_frame[] = { 0xFF, 0x01, 0x02, 0, 0, 0,    0,    0,    0,    0,   0,
	                                0,    0,    0,    0, 0, 0x23, 0x33, 0x00, 0x13, 0xFE };

static enum vsmd_error decode_bytes(const uint8_t *frame, size_t length)
{
	struct vsmd_reply reply;

	return vsmd_serial_decode_reply(frame, length, &reply);
}

/* The texts the document prints, with the checksums it leaves out. */
static const struct {
	const char *frame;
	size_t length;
	enum vsmd_reply_code code;
	const char *text;
} documented_texts[] = {
	{ "\xFF\x01\x01"
	  "VSMD113_025T-1.0.008.170428"
	  "\x00\x31\xFE",
	  33, VSMD_REPLY_IDENTITY, "VSMD113_025T-1.0.008.170428" },
	{ "\xFF\x01\x01"
	  "VSMD113_025T-1.0.008.161228"
	  "\x00\x37\xFE",
	  33, VSMD_REPLY_IDENTITY, "VSMD113_025T-1.0.008.161228" },
	{ "\xFF\x01\x03"
	  "bdr=9600 cid=2 spd=1200 ...dmd=1 dar=10"
	  "\x00\x78\xFE",
	  45, VSMD_REPLY_PARAMS, "bdr=9600 cid=2 spd=1200 ...dmd=1 dar=10" },
};

static void documented_text_frames(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(documented_texts); i++) {
		const uint8_t *frame = (const uint8_t *)documented_texts[i].frame;
		size_t length = documented_texts[i].length;
		const char *text = documented_texts[i].text;
		struct vsmd_reply reply;
		uint8_t again[64];

		assert_int_equal(vsmd_serial_decode_reply(frame, length, &reply), VSMD_OK);
		assert_int_equal(reply.id, 1);
		assert_int_equal(reply.code, documented_texts[i].code);
		assert_int_equal(reply.text_length, strlen(text));
		assert_ptr_equal(reply.text, frame + 3);
		assert_memory_equal(reply.text, text, strlen(text));
		assert_int_equal(vsmd_serial_encode_text(1, documented_texts[i].code, text,
		                                         strlen(text), again, sizeof again),
		                 length);
		assert_memory_equal(again, frame, length);
	}
}

/* The document cuts the text short with dots, which hide a name: the others are read all the same. */
static void documented_parameter_text(void **state)
{
	static const struct {
		enum vsmd_param param;
		double number;
		int result;
	} rows[] = {
		{ VSMD_BDR, 9600, 1 }, { VSMD_CID, 2, 1 },  { VSMD_SPD, 1200, 1 },
		{ 0, 0, 2 },           { VSMD_DAR, 10, 1 },
	};
	const char *text = documented_texts[2].text;
	struct vsmd_setting setting;
	size_t cursor = 0;

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting),
		                 rows[i].result);
		if (rows[i].result == 1)
			assert_setting(&setting, rows[i].param, rows[i].number);
	}
	assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 0);
}

static void documented_status(void **state)
{
	struct vsmd_reply reply;
	uint8_t again[VSMD_SERIAL_STATUS_FRAME];

	(void)state;
	assert_int_equal(sizeof status_frame, VSMD_SERIAL_STATUS_FRAME);
	assert_int_equal(vsmd_serial_decode_reply(status_frame, sizeof status_frame, &reply),
	                 VSMD_OK);
	assert_int_equal(reply.id, 1);
	assert_int_equal(reply.code, VSMD_REPLY_STATUS);
	assert_true(reply.status.velocity == 0.0f);
	assert_int_equal(reply.status.position, 0);
	assert_int_equal(reply.status.status, 0x11B3);
	assert_int_equal(vsmd_serial_encode_status(1, &reply.status, again, sizeof again),
	                 sizeof status_frame);
	assert_memory_equal(again, status_frame, sizeof status_frame);
}

/* As the document prints its sample; zeros do not change the checksum, so only the length is wrong. */
static void documented_status_misprints(void **state)
{
	static const uint8_t one_more[] = {
		0xFF, 0x01, 0x02, 0, 0, 0, 0,    0,    0,    0,    0,
		0,    0,    0,    0, 0, 0, 0x23, 0x33, 0x00, 0x13, 0xFE
	};
	static const uint8_t three_more[] = { 0xFF, 0x01, 0x02, 0,    0,    0,    0,    0,
		                              0,    0,    0,    0,    0,    0,    0,    0,
		                              0,    0,    0,    0x23, 0x33, 0x00, 0x13, 0xFE };

	(void)state;
	assert_int_equal(sizeof one_more, 22);
	assert_int_equal(sizeof three_more, 24);
	assert_int_equal(decode_bytes(one_more, sizeof one_more), VSMD_ERR_SYNTAX);
	assert_int_equal(decode_bytes(three_more, sizeof three_more), VSMD_ERR_SYNTAX);
}

/* Any number of zeros but thirteen. */
static void status_of_wrong_length(void **state)
{
	(void)state;
	for (size_t zeros = 0; zeros <= 20; zeros++) {
		uint8_t frame[64] = { 0xFF, 0x01, 0x02 };

		memcpy(frame + 3 + zeros, "\x23\x33\x00\x13\xFE", 5);
		assert_int_equal(decode_bytes(frame, zeros + 8),
		                 zeros == 13 ? VSMD_OK : VSMD_ERR_SYNTAX);
	}
}

static void parameter_text_frame(void **state)
{
	static const char text[] = "bdr=9600 cid=2 spd=1200 dmd=1 dar=10";
	uint8_t frame[64];
	struct vsmd_reply reply;
	int length;

	(void)state;
	length = vsmd_serial_encode_text(2, VSMD_REPLY_PARAMS, text, strlen(text), frame,
	                                 sizeof frame);
	assert_int_equal(length, strlen(text) + 6);
	assert_memory_equal(frame,
	                    "\xFF\x02\x03"
	                    "bdr=9600",
	                    11);
	assert_int_equal(vsmd_serial_decode_reply(frame, (size_t)length, &reply), VSMD_OK);
	assert_int_equal(reply.id, 2);
	assert_int_equal(reply.code, VSMD_REPLY_PARAMS);
	assert_int_equal(reply.text_length, strlen(text));
	assert_memory_equal(reply.text, text, strlen(text));
}

/* Appendix 1: 32 bits are five groups of seven, the most significant first. */
static void five_groups(void **state)
{
	static const struct {
		struct vsmd_status status;
		uint8_t groups[15];
	} rows[] = {
		{ { 1.0f, 1, 1 }, { 3, 0x7C, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 } },
		{ { -1.0f, -1, UINT32_MAX },
		  { 0x0B, 0x7C, 0, 0, 0, 0x0F, 0x7F, 0x7F, 0x7F, 0x7F, 0x0F, 0x7F, 0x7F, 0x7F,
		    0x7F } },
		{ { 0.0f, INT32_MIN, 0x12345678 },
		  { 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 1, 0x11, 0x51, 0x2C, 0x78 } },
		{ { -0.0f, INT32_MAX, 0x80 },
		  { 8, 0, 0, 0, 0, 7, 0x7F, 0x7F, 0x7F, 0x7F, 0, 0, 0, 1, 0 } },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		uint8_t frame[VSMD_SERIAL_STATUS_FRAME];
		struct vsmd_reply reply;

		assert_int_equal(
			vsmd_serial_encode_status(32, &rows[i].status, frame, sizeof frame),
			sizeof frame);
		assert_memory_equal(frame, "\xFF\x20\x02", 3);
		assert_memory_equal(frame + 3, rows[i].groups, 15);
		assert_int_equal(vsmd_serial_decode_reply(frame, sizeof frame, &reply), VSMD_OK);
		assert_int_equal(reply.id, 32);
		assert_memory_equal(&reply.status, &rows[i].status, sizeof reply.status);
	}
}

/* Appendix 2 sums up bytes that no reply may carry: right by its rule, still not a frame. */
static void checksum_example(void **state)
{
	static const uint8_t frame[] = { 0xFF, 0x01, 0xA0, 0x7C, 0x6F, 0x02, 0x01, 0x30, 0xFE };
	static const uint8_t low[] = { 0xFF, 0x01, 0x01, 0x7C, 0x6F, 0x20, 0x00, 0x33, 0xFE };
	size_t skip;
	size_t length;

	(void)state;
	assert_int_equal(decode_bytes(frame, sizeof frame), VSMD_ERR_SYNTAX);
	assert_int_equal(vsmd_serial_cut(frame, sizeof frame, &skip, &length), VSMD_CUT_MORE);
	assert_int_equal(skip, sizeof frame);
	assert_int_equal(decode_bytes(low, sizeof low), VSMD_OK);
}

static void every_damaged_byte_is_noticed(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof status_frame; i++) {
		for (unsigned bit = 0; bit < 8; bit++) {
			uint8_t frame[sizeof status_frame];

			memcpy(frame, status_frame, sizeof frame);
			frame[i] = (uint8_t)(frame[i] ^ 1u << bit);
			assert_int_equal(decode_bytes(frame, sizeof frame), VSMD_ERR_SYNTAX);
		}
		assert_int_equal(decode_bytes(status_frame, i), VSMD_ERR_SYNTAX);
	}
}

/* Checksums are right here, so that only the named fault can be the reason. */
static void faults_behind_a_right_checksum(void **state)
{
	static const struct {
		const char *bytes;
		size_t length;
		enum vsmd_error error;
	} rows[] = {
		{ "\xFF\x01\x01"
		  "A"
		  "\x00\x41\xFE",
		  7, VSMD_OK },
		{ "\xFF\x00\x01"
		  "A"
		  "\x00\x40\xFE",
		  7, VSMD_OK },
		{ "\xFF\x20\x01"
		  "A"
		  "\x00\x60\xFE",
		  7, VSMD_OK },
		{ "\xFF\x01\x01\x00\x00\xFE", 6, VSMD_OK }, /* an empty text */
		{ "\xFF\x21\x01"
		  "A"
		  "\x00\x61\xFE",
		  7, VSMD_ERR_SYNTAX }, /* id 33 */
		{ "\xFF\x01\x01"
		  "A"
		  "\x01\x41\xFE",
		  7, VSMD_ERR_SYNTAX }, /* BH */
		{ "\xFF\x01\x01"
		  "A"
		  "\x00\x42\xFE",
		  7, VSMD_ERR_SYNTAX }, /* BL */
		{ "\xFF\x01\x00"
		  "A"
		  "\x00\x40\xFE",
		  7, VSMD_ERR_SYNTAX }, /* code 0 */
		{ "\xFF\x01\x04"
		  "A"
		  "\x00\x44\xFE",
		  7, VSMD_ERR_SYNTAX },                                 /* code 4 */
		{ "\xFF\x01\x01\x1F\x00\x1F\xFE", 7, VSMD_ERR_SYNTAX }, /* control characters */
		{ "\xFF\x01\x01\x0A\x00\x0A\xFE", 7,
		  VSMD_OK }, /* a line end and a NUL are blanks */
		{ "\xFF\x01\x01\x00\x00\x00\xFE", 7, VSMD_OK },
		{ "\xFF\x01\x01\x7F\x00\x7F\xFE", 7, VSMD_ERR_SYNTAX },
		{ "\xFF\x01\x03\x08\x00\x0A\xFE", 7, VSMD_ERR_SYNTAX },
		{ "\xFF\x01\x01\xFE", 4, VSMD_ERR_SYNTAX },
		{ "\xFF\xFE", 2, VSMD_ERR_SYNTAX },
		{ "\xFF", 1, VSMD_ERR_SYNTAX },
		{ "", 0, VSMD_ERR_SYNTAX },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		if (decode_bytes((const uint8_t *)rows[i].bytes, rows[i].length) != rows[i].error)
			fail_msg("row %zu", i);
	}
}

static void first_group_has_four_bits(void **state)
{
	static const size_t firsts[] = { 3, 8, 13 };

	(void)state;
	for (size_t i = 0; i < COUNT(firsts); i++) {
		uint8_t frame[sizeof status_frame];

		memcpy(frame, status_frame, sizeof frame);
		frame[firsts[i]] = 0x0F;
		frame[19] ^= 0x0F;
		assert_int_equal(decode_bytes(frame, sizeof frame), VSMD_OK);
		frame[firsts[i]] = 0x10;
		frame[19] ^= 0x1F;
		assert_int_equal(decode_bytes(frame, sizeof frame), VSMD_ERR_SYNTAX);
	}
}

static void encoders_refuse(void **state)
{
	const struct vsmd_status status = { 0 };
	char many[VSMD_SERIAL_FRAME_MAX];
	uint8_t frame[VSMD_SERIAL_FRAME_MAX + 8];

	(void)state;
	memset(many, 'x', sizeof many);
	assert_int_equal(vsmd_serial_encode_status(1, &status, frame, 20), VSMD_ERR_SPACE);
	assert_int_equal(vsmd_serial_encode_status(33, &status, frame, 21), VSMD_ERR_RANGE);
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, "abc", 3, frame, 8),
	                 VSMD_ERR_SPACE);
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, "abc", 3, frame, 9), 9);
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, "abc", 3, frame, 2),
	                 VSMD_ERR_SPACE);
	assert_int_equal(vsmd_serial_encode_text(33, VSMD_REPLY_PARAMS, "a", 1, frame, 9),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_STATUS, "a", 1, frame, 9),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_serial_encode_text(1, (enum vsmd_reply_code)4, "a", 1, frame, 9),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, "\x80", 1, frame, 9),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, "\x01", 1, frame, 9),
	                 VSMD_ERR_RANGE);
	/* What cut() would throw away is not built either. */
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, many,
	                                         VSMD_SERIAL_FRAME_MAX - 6, frame, sizeof frame),
	                 VSMD_SERIAL_FRAME_MAX);
	assert_int_equal(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, many,
	                                         VSMD_SERIAL_FRAME_MAX - 5, frame, sizeof frame),
	                 VSMD_ERR_SPACE);
}

/* --- cutting a stream ----------------------------------------------------------------------------- */

static void assert_cut(const char *bytes, size_t length, enum vsmd_cut cut, size_t skip,
                       size_t frame)
{
	size_t skipped = 999;
	size_t cut_length = 999;

	assert_int_equal(vsmd_serial_cut((const uint8_t *)bytes, length, &skipped, &cut_length),
	                 cut);
	assert_int_equal(skipped, skip);
	if (cut == VSMD_CUT_FRAME)
		assert_int_equal(cut_length, frame);
}

static void cuts(void **state)
{
	(void)state;
	assert_cut("", 0, VSMD_CUT_MORE, 0, 0);
	assert_cut("\xFF\x01\x01\xFE", 4, VSMD_CUT_FRAME, 0, 4);
	assert_cut("abc\xFE\x80\xFF\x01\xFE", 8, VSMD_CUT_FRAME, 5, 3); /* garbage before */
	assert_cut("abc\xFE", 4, VSMD_CUT_MORE, 4, 0);                  /* garbage only */
	assert_cut("\xFF\x01\x02", 3, VSMD_CUT_MORE, 0, 0);             /* truncated */
	assert_cut("ab\xFF\x01", 4, VSMD_CUT_MORE, 2, 0);
	assert_cut("\xFF", 1, VSMD_CUT_MORE, 0, 0);
	assert_cut("\xFF\x01\xFF\x02\xFE", 5, VSMD_CUT_FRAME, 2, 3); /* a new start inside */
	assert_cut("\xFF\xFF\xFF\x02\xFE", 5, VSMD_CUT_FRAME, 2, 3);
	assert_cut("\xFF\x01\x80\x02\xFE", 5, VSMD_CUT_MORE, 5, 0); /* high byte inside */
	assert_cut("\xFF\x01\xFD\x02\xFE\xFF\x03\xFE", 8, VSMD_CUT_FRAME, 5, 3);
	assert_cut("\xFF\x01\xFE\xFF\x02\x03\xFE", 7, VSMD_CUT_FRAME, 0, 3); /* two frames */
	assert_cut("\xFF\x02\x03\xFE\xFF", 4, VSMD_CUT_FRAME, 0, 4);
}

static void every_split_of_a_frame(void **state)
{
	(void)state;
	for (size_t length = 0; length < sizeof status_frame; length++)
		assert_cut((const char *)status_frame, length, VSMD_CUT_MORE, 0, 0);
	assert_cut((const char *)status_frame, sizeof status_frame, VSMD_CUT_FRAME, 0,
	           sizeof status_frame);
}

static void over_long_frames(void **state)
{
	static char bytes[VSMD_SERIAL_FRAME_MAX + 10];

	(void)state;
	memset(bytes, 'x', sizeof bytes);
	bytes[0] = (char)0xFF;
	assert_cut(bytes, VSMD_SERIAL_FRAME_MAX - 1, VSMD_CUT_MORE, 0, 0);
	assert_cut(bytes, VSMD_SERIAL_FRAME_MAX, VSMD_CUT_MORE, VSMD_SERIAL_FRAME_MAX, 0);
	bytes[VSMD_SERIAL_FRAME_MAX] = (char)0xFE;
	assert_cut(bytes, VSMD_SERIAL_FRAME_MAX + 1, VSMD_CUT_MORE, VSMD_SERIAL_FRAME_MAX + 1, 0);
	memcpy(bytes + VSMD_SERIAL_FRAME_MAX + 2, "\xFF\x01\xFE", 3);
	assert_cut(bytes, sizeof bytes, VSMD_CUT_FRAME, VSMD_SERIAL_FRAME_MAX + 2, 3);
	bytes[VSMD_SERIAL_FRAME_MAX - 1] = (char)0xFE;
	assert_cut(bytes, sizeof bytes, VSMD_CUT_FRAME, 0, VSMD_SERIAL_FRAME_MAX);
}

/* --- parameter texts ------------------------------------------------------------------------------ */

static void walks_parameters(void **state)
{
	static const char text[] =
		"  bdr=9600 cid=2.00 spd=12800.00 acc=12800 dmd=1 dmd=0.5 sds=0.5 zsp=-7.0 "
		"crn=0.8 cra= garbage =5 dec=abc mcs=1.5 cid=70000 crh==1 bdx=1 "
		"zsp=99999999999 spd=1e3x res=500 dar=10 ";
	static const struct {
		int result;
		enum vsmd_param param;
		double number;
	} rows[] = {
		{ 1, VSMD_BDR, 9600 },
		{ 1, VSMD_CID, 2 },
		{ 1, VSMD_SPD, 12800 },
		{ 1, VSMD_ACC, 12800 },
		{ 1, VSMD_DMD, 1 },
		{ 2, 0, 0 }, /* no whole number: shown nowhere */
		{ 1, VSMD_SDS, 0.5 },
		{ 1, VSMD_ZSP, -7 },
		{ 1, VSMD_CRN, 0.8 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 1, VSMD_RES, 500 }, /* outside its range: the drive knows what it holds */
		{ 1, VSMD_DAR, 10 },
	};
	struct vsmd_setting setting;
	size_t cursor = 0;

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		int result = vsmd_serial_next_param(text, strlen(text), &cursor, &setting);

		if (result != rows[i].result)
			fail_msg("row %zu: %d", i, result);
		if (result == 1)
			assert_setting(&setting, rows[i].param, rows[i].number);
	}
	assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 0);
	assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 0);
	cursor = 0;
	assert_int_equal(vsmd_serial_next_param("   ", 3, &cursor, &setting), 0);
}

/* Capitals, and commas between the pairs. A decimal comma is no separator: half a number would be believed. */
static void walks_parameters_in_capitals_and_commas(void **state)
{
	static const char text[] =
		"BDR=9600,Cid=2, acc=0.5,,spd=12800,50 dEc=7,mcs=1,,crn=\"0.8\",";
	static const struct {
		int result;
		enum vsmd_param param;
		double number;
	} rows[] = {
		{ 1, VSMD_BDR, 9600 }, { 1, VSMD_CID, 2 }, { 1, VSMD_ACC, 0.5 }, { 2, 0, 0 },
		{ 1, VSMD_DEC, 7 },    { 1, VSMD_MCS, 1 }, { 1, VSMD_CRN, 0.8 },
	};
	struct vsmd_setting setting;
	size_t cursor = 0;

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		int result = vsmd_serial_next_param(text, strlen(text), &cursor, &setting);

		if (result != rows[i].result)
			fail_msg("row %zu: %d", i, result);
		if (result == 1)
			assert_setting(&setting, rows[i].param, rows[i].number);
	}
	assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 0);
	cursor = 0;
	assert_int_equal(vsmd_serial_next_param("waytoolongname=1", 16, &cursor, &setting), 2);
	cursor = 0;
	assert_int_equal(vsmd_serial_next_param(",,", 2, &cursor, &setting), 0);
}

/* Drives print numbers, quotation marks and line ends as they like. */
static void walks_parameters_of_other_habits(void **state)
{
	static const char text[] = "\"bdr=\"9600\"\r\nacc=1.92e+08 spd=-6.4E3\tcrn=8e-1 cid=2.0e0 "
				   "mcs=1.5e0 zsp=1e99 zsd=1e crh=e5 pae=1\"\r\n";
	static const struct {
		int result;
		enum vsmd_param param;
		double number;
	} rows[] = {
		{ 1, VSMD_BDR, 9600 },
		{ 1, VSMD_ACC, 192000000 },
		{ 1, VSMD_SPD, -6400 },
		{ 1, VSMD_CRN, 0.8 },
		{ 1, VSMD_CID, 2 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 2, 0, 0 },
		{ 1, VSMD_PAE, 1 },
	};
	struct vsmd_setting setting;
	size_t cursor = 0;

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		int result = vsmd_serial_next_param(text, sizeof text, &cursor, &setting);

		if (result != rows[i].result)
			fail_msg("row %zu: %d", i, result);
		if (result == 1)
			assert_setting(&setting, rows[i].param, rows[i].number);
	}
	/* The NUL at the end is a blank, too. */
	assert_int_equal(vsmd_serial_next_param(text, sizeof text, &cursor, &setting), 0);
}

static void a_text_ends_before_its_blanks(void **state)
{
	static const char *const ends[] = { "\0", "\r", "\n", "\t", " " };
	uint8_t frame[32];
	struct vsmd_reply reply;

	(void)state;
	for (size_t i = 0; i < COUNT(ends); i++) {
		char text[4] = "A B";
		int length;

		text[3] = ends[i][0];
		length = vsmd_serial_encode_text(1, VSMD_REPLY_IDENTITY, text, 4, frame,
		                                 sizeof frame);
		assert_int_equal(length, 10);
		assert_int_equal(vsmd_serial_decode_reply(frame, (size_t)length, &reply), VSMD_OK);
		assert_int_equal(reply.text_length, 3);
	}
}

static void formats_all_parameters(void **state)
{
	union db_value values[VSMD_PARAM_COUNT];
	char text[VSMD_SERIAL_FRAME_MAX];
	uint8_t frame[VSMD_SERIAL_FRAME_MAX];
	struct vsmd_setting setting;
	size_t cursor = 0;
	int length;

	(void)state;
	for (int i = 0; i < VSMD_PARAM_COUNT; i++)
		assert_true(
			db_value_from_number(vsmd_params[i].type, examples[i].number, &values[i]));
	length = vsmd_serial_format_params(values, text, sizeof text);
	assert_in_range(length, 1, sizeof text);
	assert_memory_equal(text, "bdr=115200 cid=1 mcs=5 spd=1200 ", 32);
	assert_in_range(vsmd_serial_encode_text(1, VSMD_REPLY_PARAMS, text, (size_t)length, frame,
	                                        sizeof frame),
	                1, sizeof frame);
	/* No drive on a serial line has shown the last one. */
	for (int i = 0; i < VSMD_SERIAL_PARAM_COUNT; i++) {
		assert_int_equal(vsmd_serial_next_param(text, (size_t)length, &cursor, &setting),
		                 1);
		assert_setting(&setting, (enum vsmd_param)i, examples[i].number);
	}
	assert_int_equal(vsmd_serial_next_param(text, (size_t)length, &cursor, &setting), 0);
	assert_int_equal(vsmd_serial_format_params(values, text, (size_t)length), length);
	assert_int_equal(vsmd_serial_format_params(values, text, (size_t)length - 1),
	                 VSMD_ERR_SPACE);
	values[VSMD_SPD].f = NAN;
	assert_int_equal(vsmd_serial_format_params(values, text, sizeof text), VSMD_ERR_RANGE);
}

/* --- numbers as text ------------------------------------------------------------------------------ */

static void floats_are_short_and_plain(void **state)
{
	static const struct {
		float number;
		const char *text;
	} rows[] = {
		{ 0.0f, "0" },
		{ 0.1f, "0.1" },
		{ 0.2f, "0.2" },
		{ 0.8f, "0.8" },
		{ -1200.0f, "-1200" },
		{ 0.5f, "0.5" },
		{ 192000000.0f, "192000000" },
		{ 191999.98f, "191999.98" },
		{ -0.25f, "-0.25" },
		{ 16777216.0f, "16777216" },
		{ 8388607.5f, "8388607.5" },
		{ 1e-5f, "0.00001" },
		{ 1.17549435e-38f, "0.000000000000000000000000000000000000011754944" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		union db_value value = { .f = rows[i].number };
		char text[128];

		assert_int_equal(vsmd_format_value(DB_F32, value, text, sizeof text),
		                 strlen(rows[i].text));
		assert_string_equal(text, rows[i].text);
	}
}

static void floats_read_back_equal(void **state)
{
	uint32_t bits = 1;

	(void)state;
	/* A walk over all exponents with ever other fractions. */
	for (int i = 0; i < 2000; i++) {
		union db_value value = { .u = bits & 0x7FFFFFFF };
		struct vsmd_setting setting;
		char text[160] = "eratio=";
		size_t cursor = 0;
		int length;

		bits = bits * 1664525u + 1013904223u;
		if (!isfinite(value.f))
			continue;
		length = vsmd_format_value(DB_F32, value, text + 7, sizeof text - 7);
		assert_true(length > 0);
		assert_null(strpbrk(text + 7, "eE,+"));
		assert_true(strtof(text + 7, NULL) == value.f);
		assert_int_equal(vsmd_serial_next_param(text, strlen(text), &cursor, &setting), 1);
		assert_true(setting.value.f == value.f);
	}
}

static void values_of_other_types(void **state)
{
	char text[16];

	(void)state;
	assert_int_equal(vsmd_format_value(DB_U32, (union db_value){ .u = UINT32_MAX }, text, 16),
	                 10);
	assert_string_equal(text, "4294967295");
	assert_int_equal(vsmd_format_value(DB_I32, (union db_value){ .i = INT32_MIN }, text, 16),
	                 11);
	assert_string_equal(text, "-2147483648");
	assert_int_equal(vsmd_format_value(DB_U16, (union db_value){ .u = 65535 }, text, 6), 5);
	assert_int_equal(vsmd_format_value(DB_U16, (union db_value){ .u = 65535 }, text, 5),
	                 VSMD_ERR_SPACE);
	assert_int_equal(vsmd_format_value(DB_F32, (union db_value){ .f = 0.5f }, text, 3),
	                 VSMD_ERR_SPACE);
	assert_int_equal(vsmd_format_value(DB_F32, (union db_value){ .f = 0.5f }, text, 4), 3);
	assert_int_equal(vsmd_format_value(DB_F32, (union db_value){ .f = NAN }, text, 16),
	                 VSMD_ERR_RANGE);
	assert_int_equal(vsmd_format_value(DB_F32, (union db_value){ .f = INFINITY }, text, 16),
	                 VSMD_ERR_RANGE);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(documented_lines),
		cmocka_unit_test(documented_lines_on_rs485),
		cmocka_unit_test(documented_parameters),
		cmocka_unit_test(broadcast_parameter),
		cmocka_unit_test(several_parameters),
		cmocka_unit_test(all_parameters_at_once),
		cmocka_unit_test(repeated_parameter),
		cmocka_unit_test(several_spaces),
		cmocka_unit_test(half_written_fractions),
		cmocka_unit_test(speeds),
		cmocka_unit_test(positions),
		cmocka_unit_test(small_numbers),
		cmocka_unit_test(refused_by_encode),
		cmocka_unit_test(shake_ranges),
		cmocka_unit_test(shake_needs_each_word_once),
		cmocka_unit_test(parameter_ranges),
		cmocka_unit_test(malformed_lines),
		cmocka_unit_test(unknown_parameters),
		cmocka_unit_test(ids),
		cmocka_unit_test(bytes_that_end_c_strings),
		cmocka_unit_test(space_for_settings),
		cmocka_unit_test(space_for_lines),
		cmocka_unit_test(documented_text_frames),
		cmocka_unit_test(documented_parameter_text),
		cmocka_unit_test(documented_status),
		cmocka_unit_test(documented_status_misprints),
		cmocka_unit_test(status_of_wrong_length),
		cmocka_unit_test(parameter_text_frame),
		cmocka_unit_test(five_groups),
		cmocka_unit_test(checksum_example),
		cmocka_unit_test(every_damaged_byte_is_noticed),
		cmocka_unit_test(faults_behind_a_right_checksum),
		cmocka_unit_test(first_group_has_four_bits),
		cmocka_unit_test(encoders_refuse),
		cmocka_unit_test(cuts),
		cmocka_unit_test(every_split_of_a_frame),
		cmocka_unit_test(over_long_frames),
		cmocka_unit_test(walks_parameters),
		cmocka_unit_test(walks_parameters_in_capitals_and_commas),
		cmocka_unit_test(walks_parameters_of_other_habits),
		cmocka_unit_test(a_text_ends_before_its_blanks),
		cmocka_unit_test(formats_all_parameters),
		cmocka_unit_test(floats_are_short_and_plain),
		cmocka_unit_test(floats_read_back_equal),
		cmocka_unit_test(values_of_other_types),
	};

	return cmocka_run_group_tests_name("codec/vsmd_serial", tests, NULL, NULL);
}
