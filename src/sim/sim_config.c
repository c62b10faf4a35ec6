/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_config.h"

#include "codec/slcan.h"
#include "codec/vsmd_serial.h"

#include <confuse.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BAUD_MIN 2400
#define BAUD_MAX 921600
#define TIME_MAX_US 10000000
#define CAN_RATE_MIN 10000
#define CAN_RATE_MAX 1000000
#define SIM_REPORT_MAX_MS 60000

/* What would be right, for messages of libconfuse that only say what is wrong. */
static const struct {
	const char *begin;
	const char *right;
} advice[] = {
	{ "invalid integer", "a whole number is right" },
	{ "invalid floating", "a number is right" },
	{ "invalid boolean", "true or false is right" },
	{ "found duplicate title", "every bus and drive needs a name of its own" },
	{ "missing equal sign", "KEY = VALUE is right" },
	{ "missing opening brace", "SECTION NAME { ... } is right" },
	{ "missing title", "SECTION NAME { ... } is right" },
};

__attribute__((format(printf, 2, 0))) static void report(cfg_t *cfg, const char *format,
                                                         va_list arguments)
{
	char message[256];

	(void)vsnprintf(message, sizeof(message), format, arguments);
	(void)fprintf(stderr, "%s:%d: %s", cfg->filename ? cfg->filename : "configuration",
	              cfg->line, message);
	if (strncmp(message, "no such option", 14) == 0) {
		(void)fputs("; known here:", stderr);
		for (cfg_opt_t *opt = cfg->opts; opt->name; opt++)
			(void)fprintf(stderr, " %s", opt->name);
	}
	for (size_t i = 0; i < sizeof(advice) / sizeof(advice[0]); i++) {
		if (strncmp(message, advice[i].begin, strlen(advice[i].begin)) == 0)
			(void)fprintf(stderr, "; %s", advice[i].right);
	}
	(void)fputc('\n', stderr);
}

/* Remembers the line of a value for checks after parsing: libconfuse keeps lines of sections only,
 * and only of their ends, but has a comment for each option that parsing leaves unused. */
static int note_line(cfg_t *cfg, cfg_opt_t *opt)
{
	char line[16];

	(void)snprintf(line, sizeof(line), "%d", cfg->line);
	return cfg_opt_setcomment(opt, line) == CFG_SUCCESS ? 0 : -1;
}

/* Reports something about option `name`; returns -1. */
__attribute__((format(printf, 3, 4))) static int wrong(cfg_t *cfg, const char *name,
                                                       const char *format, ...)
{
	cfg_opt_t *opt = name ? cfg_getopt(cfg, name) : NULL;
	const char *line = opt ? cfg_opt_getcomment(opt) : NULL;
	va_list arguments;

	(void)fprintf(stderr, "%s:%d: ", cfg->filename, line ? atoi(line) : cfg->line);
	va_start(arguments, format);
	(void)vfprintf(stderr, format, arguments);
	va_end(arguments);
	(void)fputc('\n', stderr);
	return -1;
}

static int check_int(cfg_t *cfg, const char *name, long min, long max)
{
	long value = cfg_getint(cfg, name);

	if (value >= min && value <= max)
		return 0;
	return wrong(cfg, name, "%s = %ld is out of range; %ld to %ld is right", name, value, min,
	             max);
}

/* A word of a list; its index, or -1 after a report. */
static int check_word(cfg_t *cfg, const char *name, const char *const *words)
{
	const char *value = cfg_getstr(cfg, name);
	char known[128] = "";

	for (int i = 0; words[i]; i++) {
		if (strcmp(value, words[i]) == 0)
			return i;
		(void)snprintf(known + strlen(known), sizeof(known) - strlen(known), "%s%s",
		               i ? ", " : "", words[i]);
	}
	return wrong(cfg, name, "%s = \"%s\" is unknown; one of these is right: %s", name, value,
	             known);
}

static int load_faults(cfg_t *cfg, const char **faults, size_t *count)
{
	unsigned size = cfg_size(cfg, "fault");

	if (size > SIM_FAULT_TEXTS_MAX)
		return wrong(cfg, "fault", "more than %d faults", SIM_FAULT_TEXTS_MAX);
	for (unsigned i = 0; i < size; i++) {
		struct sim_faults scratch = { .delay_ms = 0 };
		const char *text = cfg_getnstr(cfg, "fault", i);
		const char *error = sim_faults_set(&scratch, text);

		if (error)
			return wrong(cfg, "fault", "fault \"%s\": %s", text, error);
		faults[(*count)++] = text;
	}
	return 0;
}

static int load_can(cfg_t *cfg, struct sim_bus_config *bus)
{
	static const char *const transports[] = { "slcan", "socketcan", NULL };
	static const char *const kinds[] = { "extended", "standard", NULL };
	int transport = check_word(cfg, "transport", transports);
	int frames = check_word(cfg, "frames", kinds);

	if (transport < 0 || frames < 0 ||
	    check_int(cfg, "bitrate", CAN_RATE_MIN, CAN_RATE_MAX) != 0 ||
	    check_int(cfg, "output-base", 0, 1) != 0)
		return -1;
	if (transport == 0 && slcan_bitrate_digit((uint32_t)cfg_getint(cfg, "bitrate")) < 0)
		return wrong(cfg, "bitrate",
		             "bitrate = %ld cannot be set on a serial adapter; one of these is "
		             "right: 10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, "
		             "1000000",
		             cfg_getint(cfg, "bitrate"));
	if (bus->kind == SIM_BUS_VSMD_CAN &&
	    vsmd_can_rate_code((uint32_t)cfg_getint(cfg, "bitrate")) == 0)
		return wrong(cfg, "bitrate",
		             "bitrate = %ld is none these drives have; 100000, 125000, 250000, "
		             "500000 and 1000000, for instance, are right",
		             cfg_getint(cfg, "bitrate"));
	bus->interface = cfg_getstr(cfg, "interface");
	if (transport == 1 && !bus->interface)
		return wrong(cfg, "transport",
		             "transport = socketcan needs interface = NAME, such as vcan0");
	if (transport == 0)
		bus->interface = NULL;
	bus->can = (struct sim_can_config){
		.bitrate = (unsigned)cfg_getint(cfg, "bitrate"),
		.adapter = transport == 0,
		.latency = bus->serial.latency,
	};
	bus->style = (struct vsmd_can_style){
		.extended = frames == 0,
		.output_base = (uint8_t)cfg_getint(cfg, "output-base"),
	};
	return 0;
}

/* What the servos' document leaves open. */
static int load_layout(cfg_t *cfg, struct sim_bus_config *bus)
{
	struct servo_can_words_layout *words = &bus->layout.words;
	const char *reason;

	if (check_int(cfg, "ack-base", 0, DB_CAN_STANDARD_MASK) != 0 ||
	    check_int(cfg, "command-word-base", 0, DB_CAN_STANDARD_MASK) != 0 ||
	    check_int(cfg, "command-word-length", 2, DB_CAN_DATA_MAX) != 0 ||
	    check_int(cfg, "command-word-0-at", 0, DB_CAN_DATA_MAX - 2) != 0 ||
	    check_int(cfg, "command-word-1-at", -1, DB_CAN_DATA_MAX - 2) != 0 ||
	    check_int(cfg, "command-word-ack", 0, UINT8_MAX) != 0)
		return -1;
	bus->layout.ack_base = (uint16_t)cfg_getint(cfg, "ack-base");
	bus->layout.padded = cfg_getbool(cfg, "padded");
	words->set = cfg_getint(cfg, "command-word-base") > 0;
	words->base = (uint16_t)cfg_getint(cfg, "command-word-base");
	words->length = (uint8_t)cfg_getint(cfg, "command-word-length");
	words->word0 = (uint8_t)cfg_getint(cfg, "command-word-0-at");
	/* -1 becomes SERVO_CAN_NO_WORD. */
	words->word1 = (uint8_t)cfg_getint(cfg, "command-word-1-at");
	words->ack = (uint8_t)cfg_getint(cfg, "command-word-ack");
	servo_can_put_fixed(words, (uint64_t)cfg_getint(cfg, "command-word-fixed"));
	if (servo_can_layout_check(&bus->layout, &reason) != SERVO_CAN_OK)
		return wrong(cfg, "command-word-base", "frames cannot be so: %s", reason);
	return 0;
}

static int load_bus(cfg_t *cfg, struct sim_bus_config *bus)
{
	static const char *const protocols[] = {
		[SIM_BUS_VSMD_SERIAL] = "vsmd-serial",
		[SIM_BUS_VSMD_CAN] = "vsmd-can",
		[SIM_BUS_SERVO_CAN] = "servo-can",
		[SIM_BUS_XYZA] = "xyza",
		NULL,
	};
	static const char *const lines[] = { "rs485", "rs232", NULL };
	int line = check_word(cfg, "line", lines);
	int protocol = check_word(cfg, "protocol", protocols);

	if (line < 0 || protocol < 0 || check_int(cfg, "baud", BAUD_MIN, BAUD_MAX) != 0 ||
	    check_int(cfg, "latency-us", 0, TIME_MAX_US) != 0 ||
	    check_int(cfg, "turnaround-us", 0, TIME_MAX_US) != 0 ||
	    check_int(cfg, "reply-id", 0, VSMD_SERIAL_ID_MAX) != 0)
		return -1;
	bus->name = cfg_title(cfg);
	bus->kind = (enum sim_bus_kind)protocol;
	bus->device = cfg_getstr(cfg, "device");
	bus->link = cfg_getstr(cfg, "link");
	bus->flash = cfg_getstr(cfg, "flash");
	bus->serial = (struct sim_serial_config){
		.baud = (unsigned)cfg_getint(cfg, "baud"),
		.rs485 = line == 0,
		/* A real line takes its own time, a pty (whoever made it) takes none. */
		.paced = strcmp(bus->device, "pty") == 0 ||
		         strncmp(bus->device, "/dev/pts/", 9) == 0,
		.reply_id = (uint8_t)cfg_getint(cfg, "reply-id"),
		.latency = cfg_getint(cfg, "latency-us") * DB_NS_PER_US,
		.turnaround = cfg_getint(cfg, "turnaround-us") * DB_NS_PER_US,
	};
	if (bus->kind != SIM_BUS_VSMD_SERIAL && bus->kind != SIM_BUS_XYZA &&
	    load_can(cfg, bus) != 0)
		return -1;
	if (bus->kind == SIM_BUS_SERVO_CAN && load_layout(cfg, bus) != 0)
		return -1;
	return load_faults(cfg, bus->faults, &bus->fault_count);
}

static bool read_position(const char *text, double *position, const char **end)
{
	char *stop;

	*position = strtod(text, &stop);
	*end = stop;
	return stop != text && isfinite(*position);
}

/* "2:above:50000", "1:between:-10:10" */
static bool parse_sensor(const char *text, struct sim_sensor *sensors)
{
	struct sim_sensor sensor = { .kind = SIM_SENSOR_NONE };
	unsigned number = (unsigned)(text[0] - '0');
	const char *rest;

	if (number < 1 || number > SIM_VSMD_SENSORS || text[1] != ':')
		return false;
	rest = text + 2;
	if (strncmp(rest, "below:", 6) == 0)
		sensor.kind = SIM_SENSOR_BELOW;
	else if (strncmp(rest, "above:", 6) == 0)
		sensor.kind = SIM_SENSOR_ABOVE;
	else if (strncmp(rest, "between:", 8) == 0)
		sensor.kind = SIM_SENSOR_BETWEEN;
	else
		return false;
	rest = strchr(rest, ':') + 1;
	if (!read_position(rest, &sensor.low, &rest))
		return false;
	if (sensor.kind == SIM_SENSOR_BETWEEN &&
	    (*rest != ':' || !read_position(rest + 1, &sensor.high, &rest) ||
	     sensor.high < sensor.low))
		return false;
	sensors[number - 1] = sensor;
	return *rest == '\0';
}

static int load_sensors(cfg_t *cfg, struct sim_vsmd_config *vsmd)
{
	for (unsigned i = 0; i < cfg_size(cfg, "sensor"); i++) {
		const char *text = cfg_getnstr(cfg, "sensor", i);

		if (!parse_sensor(text, vsmd->sensors))
			return wrong(cfg, "sensor",
			             "sensor \"%s\" cannot be read; right is N:below:POS, "
			             "N:above:POS or N:between:FROM:TO with N 1 to 6",
			             text);
	}
	return 0;
}

static int load_settings(cfg_t *cfg, struct sim_vsmd_config *vsmd)
{
	for (unsigned i = 0; i < cfg_size(cfg, "set"); i++) {
		const char *text = cfg_getnstr(cfg, "set", i);
		struct vsmd_setting setting;
		size_t cursor = 0;

		if (vsmd_serial_next_param(text, strlen(text), &cursor, &setting) != 1)
			return wrong(cfg, "set",
			             "set \"%s\" cannot be read; right is NAME=VALUE with the "
			             "vendor's name of a parameter",
			             text);
		if (setting.param == VSMD_CID || setting.param == VSMD_BDR)
			return wrong(cfg, "set",
			             "set \"%s\": use address of the drive and baud of its bus",
			             text);
		if (!sim_vsmd_takes(vsmd, setting.param, setting.value)) {
			const struct db_param *param = &vsmd_params[setting.param];

			return wrong(cfg, "set",
			             "set \"%s\" is out of range or not for this model; "
			             "%g to %g is documented",
			             text, param->min, param->max);
		}
		vsmd->defaults[setting.param] = setting.value;
	}
	return 0;
}

static double clamp_current(float value, double max)
{
	return (double)value > max ? max : (double)value;
}

static int load_lacks(cfg_t *cfg, struct sim_vsmd_temper *temper)
{
	unsigned size = cfg_size(cfg, "lacks");

	if (size > SIM_VSMD_LACKS_MAX)
		return wrong(cfg, "lacks", "more than %d ranges", SIM_VSMD_LACKS_MAX);
	for (unsigned i = 0; i < size; i++) {
		if (!sim_registers_parse(cfg_getnstr(cfg, "lacks", i), &temper->lacks[i]))
			return wrong(cfg, "lacks",
			             "lacks \"%s\" cannot be read; right is a register or a range "
			             "in hexadecimal, \"0b\" or \"1c-2b\"",
			             cfg_getnstr(cfg, "lacks", i));
	}
	temper->lacks_count = size;
	return 0;
}

/* What the documents of VSMD drives leave open. */
static int load_temper(cfg_t *cfg, struct sim_vsmd_temper *temper)
{
	static const char *const handshakes[] = { "", "dev", "any", NULL };
	static const char *const refusals[] = { "", "kept", "once", "cleared", NULL };
	static const char *const texts[] = { "plain", "nul", "crlf", "quoted", NULL };
	static const char *const numbers[] = { "plain", "exponent", "quoted", NULL };
	int handshake = check_word(cfg, "handshake", handshakes);
	int refusal = check_word(cfg, "refusal", refusals);
	int text = check_word(cfg, "text", texts);
	int number = check_word(cfg, "numbers", numbers);

	if (handshake < 0 || refusal < 0 || text < 0 || number < 0 ||
	    check_int(cfg, "handshake-lapses-ms", 0, SIM_REPORT_MAX_MS) != 0 ||
	    check_int(cfg, "power-delay-ms", 0, SIM_REPORT_MAX_MS) != 0 ||
	    check_int(cfg, "standing-delay-ms", 0, SIM_REPORT_MAX_MS) != 0 ||
	    check_int(cfg, "motion-delay-ms", 0, SIM_REPORT_MAX_MS) != 0 ||
	    check_int(cfg, "rests-off", -1000, 1000) != 0)
		return -1;
	*temper = (struct sim_vsmd_temper){
		.handshake = (enum sim_handshake)handshake,
		.keeps_handshake = cfg_getbool(cfg, "handshake-kept"),
		.handshake_lapses = cfg_getint(cfg, "handshake-lapses-ms") * DB_NS_PER_MS,
		.power_delay = cfg_getint(cfg, "power-delay-ms") * DB_NS_PER_MS,
		.standing_delay = cfg_getint(cfg, "standing-delay-ms") * DB_NS_PER_MS,
		.motion_delay = cfg_getint(cfg, "motion-delay-ms") * DB_NS_PER_MS,
		.refusal = (enum sim_refusal)refusal,
		.clamps = cfg_getbool(cfg, "clamps"),
		.rests_off = (int32_t)cfg_getint(cfg, "rests-off"),
		.hides_outputs = cfg_getbool(cfg, "hides-outputs"),
		.ignores_broadcast = cfg_getbool(cfg, "ignores-broadcast"),
		.text = (enum sim_text_ends)text,
		.numbers = (enum sim_numbers)number,
	};
	return load_lacks(cfg, temper);
}

static int load_vsmd(cfg_t *cfg, const struct sim_bus_config *bus, struct sim_vsmd_config *vsmd)
{
	static const char *const models[] = { "010T", "025T", "045T", "080T", NULL };
	static const unsigned model_numbers[] = { 10, 25, 45, 80 };
	static const enum vsmd_param currents[] = { VSMD_CRA, VSMD_CRN, VSMD_CRH, VSMD_ZCR };
	int model = check_word(cfg, "model", models);

	bool can = bus->kind == SIM_BUS_VSMD_CAN;
	long last = VSMD_SERIAL_ID_MAX;

	if (can)
		last = bus->style.extended ? VSMD_CAN_DRIVE_MAX : VSMD_CAN_STD_DRIVE_MAX;
	if (model < 0 || check_int(cfg, "address", 1, last) != 0)
		return -1;
	sim_vsmd_config_init(vsmd, (unsigned)cfg_getint(cfg, "address"),
	                     can ? bus->can.bitrate : bus->serial.baud);
	vsmd->can = can;
	vsmd->model = model_numbers[model];
	vsmd->identity = cfg_getstr(cfg, "identity");
	vsmd->closed_loop = cfg_getbool(cfg, "closed-loop");
	vsmd->external = cfg_getbool(cfg, "external");
	vsmd->max_current = cfg_getfloat(cfg, "max-current");
	vsmd->travel_min = cfg_getfloat(cfg, "travel-min");
	vsmd->travel_max = cfg_getfloat(cfg, "travel-max");
	vsmd->start = cfg_getfloat(cfg, "start");
	vsmd->defaults[VSMD_EMOD].u = vsmd->closed_loop;
	if (load_temper(cfg, &vsmd->temper) != 0)
		return -1;
	if (strlen(vsmd->identity) >= SIM_VSMD_IDENTITY_MAX)
		return wrong(cfg, "identity", "identity is longer than %d characters",
		             SIM_VSMD_IDENTITY_MAX - 1);
	if (!(vsmd->max_current > 0.0))
		return wrong(cfg, "max-current", "max-current must be above 0 (in A)");
	if (!(vsmd->travel_min <= vsmd->start && vsmd->start <= vsmd->travel_max))
		return wrong(cfg, "start", "start must lie between travel-min and travel-max");
	for (size_t i = 0; i < sizeof(currents) / sizeof(currents[0]); i++)
		vsmd->defaults[currents[i]].f = (float)clamp_current(vsmd->defaults[currents[i]].f,
		                                                     vsmd->max_current);
	return load_sensors(cfg, vsmd) != 0 || load_settings(cfg, vsmd) != 0 ? -1 : 0;
}

/* What the servos' document leaves open of one drive. */
static int load_servo_temper(cfg_t *cfg, struct sim_drive_config *drive)
{
	static const char *const powers[] = { "off", "kept", NULL };
	static const char *const demands[] = { "position", "kept", NULL };
	static const char *const reached[] = { "position", "profile", NULL };
	static const char *const triggers[] = { "works", "ignored", NULL };
	static const char *const setpoints[] = { "always", "in-mode", NULL };
	static const char *const lengths[] = { "documented", "eight", "mixed", "short", NULL };
	int power = check_word(cfg, "fault-power", powers);
	int demand = check_word(cfg, "demand", demands);
	int bit = check_word(cfg, "reached-bit", reached);
	int trigger = check_word(cfg, "trigger", triggers);
	int setpoint = check_word(cfg, "setpoints", setpoints);
	int length = check_word(cfg, "answer-length", lengths);

	if (power < 0 || demand < 0 || bit < 0 || trigger < 0 || setpoint < 0 || length < 0 ||
	    check_int(cfg, "ack-latency-us", 0, TIME_MAX_US) != 0 ||
	    check_int(cfg, "motion-delay-ms", 0, SIM_REPORT_MAX_MS) != 0 ||
	    check_int(cfg, "power-ms", 0, SIM_REPORT_MAX_MS) != 0)
		return -1;
	drive->servo.temper = (struct sim_servo_temper){
		.fault_keeps_power = power == 1,
		.keeps_demand = demand == 1,
		.reached_by_profile = bit == 1,
		.ignores_trigger = trigger == 1,
		.ignores_broadcast = cfg_getbool(cfg, "ignores-broadcast"),
		.deaf_to_setpoints = setpoint == 1,
		.zero_speed = cfg_getfloat(cfg, "zero-speed-rpm"),
		.dither = cfg_getfloat(cfg, "dither"),
		.motion_delay = cfg_getint(cfg, "motion-delay-ms") * DB_NS_PER_MS,
	};
	drive->servo.power_time = cfg_getint(cfg, "power-ms") * DB_NS_PER_MS;
	drive->servo_lengths = (enum sim_servo_lengths)length;
	drive->servo_ack_latency = cfg_getint(cfg, "ack-latency-us") * DB_NS_PER_US;
	return 0;
}

static int load_servo(cfg_t *cfg, struct sim_drive_config *drive)
{
	struct sim_servo_config *servo = &drive->servo;
	static const char *const modes[] = { "position", "speed", "current", NULL };
	static const char *const intervals[SIM_SERVO_REPORTS] = {
		[SIM_SERVO_REPORT_POSITION] = "report-position-ms",
		[SIM_SERVO_REPORT_MOTION] = "report-motion-ms",
		[SIM_SERVO_REPORT_HEALTH] = "report-health-ms",
	};
	int mode = check_word(cfg, "mode", modes);

	if (mode < 0 || check_int(cfg, "address", 1, SERVO_CAN_NODE_MAX) != 0)
		return -1;
	sim_servo_config_init(servo);
	for (size_t i = 0; i < SIM_SERVO_REPORTS; i++) {
		if (check_int(cfg, intervals[i], 0, SIM_REPORT_MAX_MS) != 0)
			return -1;
		servo->reports[i] = cfg_getint(cfg, intervals[i]) * DB_NS_PER_MS;
	}
	servo->mode = (enum servo_can_mode)mode;
	servo->synchronous = cfg_getbool(cfg, "sync");
	servo->start = cfg_getfloat(cfg, "start");
	servo->load = cfg_getfloat(cfg, "load");
	servo->inertia = cfg_getfloat(cfg, "inertia");
	if (!(servo->inertia > 0.0))
		return wrong(cfg, "inertia", "inertia must be above 0 (in kg m^2)");
	return load_servo_temper(cfg, drive);
}

/* "lead.y=2000" for one axis, "lead=2000" for all, "sound=1" for what they share. */
static bool parse_xyza_setting(const char *text, struct sim_xyza_config *xyza)
{
	static const char letters[] = "xyza";
	size_t length = strcspn(text, ".=");
	int param = xyza_param_find(text, length);
	const char *letter = NULL;
	union db_value value;
	char *end;
	double number;

	if (param < 0 || param == XYZA_FACTORY_RESET || param == XYZA_SLAVE_NUMBER)
		return false;
	text += length;
	if (*text == '.') {
		letter = text[1] ? strchr(letters, text[1]) : NULL;
		if (!letter || !xyza_item_of_axis(xyza_param_item((enum xyza_param)param)))
			return false;
		text += 2;
	}
	if (*text != '=')
		return false;
	number = strtod(text + 1, &end);
	if (end == text + 1 || *end != '\0' ||
	    !db_value_from_number(xyza_params[param].type, number, &value) ||
	    !xyza_param_in_range((enum xyza_param)param, value))
		return false;
	for (size_t axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		uint32_t *content = &xyza->defaults[axis][xyza_param_item((enum xyza_param)param)];

		if (!letter || letters[axis] == *letter)
			*content = xyza_param_put((enum xyza_param)param, value, *content);
	}
	return true;
}

static int load_xyza_lists(cfg_t *cfg, struct sim_xyza_temper *temper)
{
	for (unsigned i = 0; i < cfg_size(cfg, "lacks"); i++) {
		const char *text = cfg_getnstr(cfg, "lacks", i);
		int param = xyza_param_find(text, strlen(text));

		if (param < 0)
			return wrong(cfg, "lacks", "lacks \"%s\" is no parameter", text);
		temper->lacks |= 1u << xyza_param_item((enum xyza_param)param);
	}
	for (unsigned i = 0; i < cfg_size(cfg, "ignores"); i++) {
		const char *text = cfg_getnstr(cfg, "ignores", i);
		unsigned kind = 0;

		while (sim_xyza_kinds[kind] && strcmp(text, sim_xyza_kinds[kind]) != 0)
			kind++;
		if (!sim_xyza_kinds[kind])
			return wrong(cfg, "ignores",
			             "ignores \"%s\" is unknown; one of these is right: position, "
			             "sign, item, output, jog, program",
			             text);
		temper->ignores |= 1u << kind;
	}
	return 0;
}

static int load_xyza_temper(cfg_t *cfg, struct sim_xyza_temper *temper)
{
	static const char *const times[] = { "motion-delay-ms", "standing-delay-ms",
		                             "power-delay-ms", "braking-ms" };

	for (size_t i = 0; i < sizeof(times) / sizeof(times[0]); i++) {
		if (check_int(cfg, times[i], 0, SIM_REPORT_MAX_MS) != 0)
			return -1;
	}
	*temper = (struct sim_xyza_temper){
		.no_negative_zero = !cfg_getbool(cfg, "negative-zero"),
		.amount_clears_sign = cfg_getbool(cfg, "amount-clears-sign"),
		.acknowledges_all = cfg_getbool(cfg, "acknowledges-all"),
		.clamps = cfg_getbool(cfg, "clamps"),
		.jogs_from_stand = cfg_getbool(cfg, "jogs-from-stand"),
		.second_stop_ends = cfg_getbool(cfg, "second-stop-ends"),
		.motion_delay = cfg_getint(cfg, "motion-delay-ms") * DB_NS_PER_MS,
		.standing_delay = cfg_getint(cfg, "standing-delay-ms") * DB_NS_PER_MS,
		.item_delay = cfg_getint(cfg, "power-delay-ms") * DB_NS_PER_MS,
		.braking = cfg_getint(cfg, "braking-ms") * DB_NS_PER_MS,
	};
	return load_xyza_lists(cfg, temper);
}

static int load_xyza(cfg_t *cfg, struct sim_xyza_config *xyza)
{
	static const char *const marks[] = { "0c", "0a", NULL };
	static const char *const failures[] = { "ab", "bb", NULL };
	int mark = check_word(cfg, "answer-mark", marks);
	int failure = check_word(cfg, "failure-code", failures);

	if (mark < 0 || failure < 0 || check_int(cfg, "address", 1, XYZA_OBJECT_MAX) != 0 ||
	    check_int(cfg, "axes", 1, XYZA_AXIS_COUNT) != 0 ||
	    check_int(cfg, "programs", 1, UINT8_MAX) != 0 ||
	    check_int(cfg, "program-steps", 1, XYZA_PROGRAM_STEP_MAX) != 0 ||
	    check_int(cfg, "step-ms", 1, SIM_REPORT_MAX_MS) != 0)
		return -1;
	sim_xyza_config_init(xyza, (unsigned)cfg_getint(cfg, "address"));
	xyza->style.answer_mark_0a = mark == 1;
	xyza->style.failure_bb = failure == 1;
	xyza->style.echo_a4 = cfg_getbool(cfg, "echo-a4");
	xyza->axes = (unsigned)cfg_getint(cfg, "axes");
	xyza->programs = (unsigned)cfg_getint(cfg, "programs");
	xyza->steps = (unsigned)cfg_getint(cfg, "program-steps");
	xyza->step_time = cfg_getint(cfg, "step-ms") * DB_NS_PER_MS;
	for (unsigned i = 0; i < cfg_size(cfg, "set"); i++) {
		if (!parse_xyza_setting(cfg_getnstr(cfg, "set", i), xyza))
			return wrong(cfg, "set",
			             "set \"%s\" cannot be read or is out of range; right is "
			             "NAME=VALUE, or NAME.x=VALUE for one axis",
			             cfg_getnstr(cfg, "set", i));
	}
	return load_xyza_temper(cfg, &xyza->temper);
}

static int find_bus(const struct sim_config *config, const char *name, size_t *index)
{
	for (size_t i = 0; name && i < config->bus_count; i++) {
		if (config->buses[i].name && strcmp(config->buses[i].name, name) == 0) {
			*index = i;
			return 0;
		}
	}
	return -1;
}

static int check_neighbours(cfg_t *cfg, const struct sim_config *config, size_t index)
{
	const struct sim_drive_config *drive = &config->drives[index];

	for (size_t i = 0; i < index; i++) {
		const struct sim_drive_config *other = &config->drives[i];

		if (other->bus != drive->bus)
			continue;
		if (config->buses[drive->bus].kind == SIM_BUS_VSMD_SERIAL &&
		    !config->buses[drive->bus].serial.rs485)
			return wrong(cfg, "bus",
			             "drives %s and %s share the rs232 line %s; it can have only "
			             "one",
			             other->name, drive->name, config->buses[drive->bus].name);
		if (other->address == drive->address)
			return wrong(cfg, "address",
			             "address %u is taken by drive %s on the same bus",
			             drive->address, other->name);
	}
	return 0;
}

static int load_model(cfg_t *cfg, const struct sim_bus_config *bus, struct sim_drive_config *drive)
{
	if (bus->kind == SIM_BUS_XYZA)
		return load_xyza(cfg, &drive->xyza);
	return bus->kind == SIM_BUS_SERVO_CAN ? load_servo(cfg, drive) :
	                                        load_vsmd(cfg, bus, &drive->vsmd);
}

static int load_drive(cfg_t *cfg, struct sim_config *config, size_t index)
{
	struct sim_drive_config *drive = &config->drives[index];
	const char *bus = cfg_getstr(cfg, "bus");

	drive->name = cfg_title(cfg);
	if (find_bus(config, bus, &drive->bus) != 0)
		return wrong(cfg, "bus",
		             "drive %s: bus \"%s\" does not exist; name a bus section of this "
		             "file",
		             drive->name, bus ? bus : "");
	for (size_t i = 0; i < config->bus_count; i++) {
		if (strcmp(config->buses[i].name, drive->name) == 0)
			return wrong(cfg, NULL, "drive %s has the name of a bus; names must differ",
			             drive->name);
	}
	drive->address = (unsigned)cfg_getint(cfg, "address");
	if (load_model(cfg, &config->buses[drive->bus], drive) != 0 ||
	    load_faults(cfg, drive->faults, &drive->fault_count) != 0)
		return -1;
	return check_neighbours(cfg, config, index);
}

static int load_sections(cfg_t *cfg, struct sim_config *config)
{
	unsigned buses = cfg_size(cfg, "bus");
	unsigned drives = cfg_size(cfg, "drive");
	int result = 0;

	if (buses == 0 || drives == 0)
		return wrong(cfg, NULL, "there must be at least one bus and one drive section");
	config->buses = calloc(buses, sizeof(*config->buses));
	config->drives = calloc(drives, sizeof(*config->drives));
	if (!config->buses || !config->drives)
		return wrong(cfg, NULL, "out of memory");
	for (; config->bus_count < buses; config->bus_count++)
		result |= load_bus(cfg_getnsec(cfg, "bus", (unsigned)config->bus_count),
		                   &config->buses[config->bus_count]);
	if (result != 0)
		return -1;
	for (; config->drive_count < drives; config->drive_count++)
		result |= load_drive(cfg_getnsec(cfg, "drive", (unsigned)config->drive_count),
		                     config, config->drive_count);
	return result;
}

static void note_lines(cfg_t *cfg, const char *section, const cfg_opt_t *opts)
{
	char path[64];

	for (; opts->name; opts++) {
		(void)snprintf(path, sizeof(path), "%s|%s", section, opts->name);
		(void)cfg_set_validate_func(cfg, path, note_line);
	}
}

/* Keys of drives of all families. */
static const cfg_opt_t drive_options[] = { CFG_STR("bus", NULL, CFGF_NODEFAULT),
	                                   CFG_INT("address", 1, CFGF_NONE),
	                                   CFG_STR("identity", "VSMD113_025T-1.0.008.170428",
	                                           CFGF_NONE),
	                                   CFG_STR("model", "025T", CFGF_NONE),
	                                   CFG_BOOL("closed-loop", cfg_false, CFGF_NONE),
	                                   CFG_BOOL("external", cfg_false, CFGF_NONE),
	                                   CFG_FLOAT("max-current", 2.5, CFGF_NONE),
	                                   CFG_FLOAT("travel-min", -1e9, CFGF_NONE),
	                                   CFG_FLOAT("travel-max", 1e9, CFGF_NONE),
	                                   CFG_FLOAT("start", 0.0, CFGF_NONE),
	                                   CFG_STR("handshake", "", CFGF_NONE),
	                                   CFG_BOOL("handshake-kept", cfg_false, CFGF_NONE),
	                                   CFG_INT("handshake-lapses-ms", 0, CFGF_NONE),
	                                   CFG_INT("power-delay-ms", 0, CFGF_NONE),
	                                   CFG_INT("standing-delay-ms", 0, CFGF_NONE),
	                                   CFG_INT("motion-delay-ms", 0, CFGF_NONE),
	                                   CFG_STR("refusal", "", CFGF_NONE),
	                                   CFG_BOOL("clamps", cfg_false, CFGF_NONE),
	                                   CFG_INT("rests-off", 0, CFGF_NONE),
	                                   CFG_BOOL("hides-outputs", cfg_false, CFGF_NONE),
	                                   CFG_BOOL("ignores-broadcast", cfg_false, CFGF_NONE),
	                                   CFG_STR("text", "plain", CFGF_NONE),
	                                   CFG_STR("numbers", "plain", CFGF_NONE),
	                                   CFG_STR_LIST("lacks", NULL, CFGF_NODEFAULT),
	                                   CFG_STR("mode", "position", CFGF_NONE),
	                                   CFG_BOOL("sync", cfg_false, CFGF_NONE),
	                                   CFG_INT("report-position-ms", 100, CFGF_NONE),
	                                   CFG_INT("report-motion-ms", 100, CFGF_NONE),
	                                   CFG_INT("report-health-ms", 1000, CFGF_NONE),
	                                   CFG_FLOAT("load", 0.0, CFGF_NONE),
	                                   CFG_FLOAT("inertia", 1e-4, CFGF_NONE),
	                                   CFG_STR("fault-power", "off", CFGF_NONE),
	                                   CFG_STR("demand", "position", CFGF_NONE),
	                                   CFG_STR("reached-bit", "position", CFGF_NONE),
	                                   CFG_STR("trigger", "works", CFGF_NONE),
	                                   CFG_STR("setpoints", "always", CFGF_NONE),
	                                   CFG_STR("answer-length", "documented", CFGF_NONE),
	                                   CFG_FLOAT("zero-speed-rpm", 1.0, CFGF_NONE),
	                                   CFG_FLOAT("dither", 0.0, CFGF_NONE),
	                                   CFG_INT("ack-latency-us", 0, CFGF_NONE),
	                                   CFG_INT("power-ms", 5, CFGF_NONE),
	                                   CFG_INT("axes", XYZA_AXIS_COUNT, CFGF_NONE),
	                                   CFG_INT("programs", 8, CFGF_NONE),
	                                   CFG_INT("program-steps", 300, CFGF_NONE),
	                                   CFG_INT("step-ms", 500, CFGF_NONE),
	                                   CFG_STR("answer-mark", "0c", CFGF_NONE),
	                                   CFG_STR("failure-code", "ab", CFGF_NONE),
	                                   CFG_BOOL("echo-a4", cfg_false, CFGF_NONE),
	                                   CFG_BOOL("negative-zero", cfg_true, CFGF_NONE),
	                                   CFG_BOOL("amount-clears-sign", cfg_false, CFGF_NONE),
	                                   CFG_BOOL("acknowledges-all", cfg_false, CFGF_NONE),
	                                   CFG_BOOL("jogs-from-stand", cfg_false, CFGF_NONE),
	                                   CFG_BOOL("second-stop-ends", cfg_false, CFGF_NONE),
	                                   CFG_INT("braking-ms", 0, CFGF_NONE),
	                                   CFG_STR_LIST("ignores", NULL, CFGF_NODEFAULT),
	                                   CFG_STR_LIST("sensor", NULL, CFGF_NODEFAULT),
	                                   CFG_STR_LIST("set", NULL, CFGF_NODEFAULT),
	                                   CFG_STR_LIST("fault", NULL, CFGF_NODEFAULT),
	                                   CFG_END() };

int sim_config_load(const char *path, struct sim_config *config)
{
	cfg_opt_t bus[] = { CFG_STR("protocol", "vsmd-serial", CFGF_NONE),
		            CFG_STR("device", "pty", CFGF_NONE),
		            CFG_STR("link", NULL, CFGF_NODEFAULT),
		            CFG_INT("baud", 115200, CFGF_NONE),
		            CFG_STR("line", "rs485", CFGF_NONE),
		            CFG_INT("latency-us", 800, CFGF_NONE),
		            CFG_INT("turnaround-us", 0, CFGF_NONE),
		            CFG_INT("reply-id", 1, CFGF_NONE),
		            CFG_STR("transport", "slcan", CFGF_NONE),
		            CFG_STR("interface", NULL, CFGF_NODEFAULT),
		            CFG_INT("bitrate", 100000, CFGF_NONE),
		            CFG_STR("frames", "extended", CFGF_NONE),
		            CFG_INT("output-base", 1, CFGF_NONE),
		            CFG_INT("ack-base", 1, CFGF_NONE),
		            CFG_BOOL("padded", cfg_false, CFGF_NONE),
		            CFG_INT("command-word-base", 0, CFGF_NONE),
		            CFG_INT("command-word-length", 4, CFGF_NONE),
		            CFG_INT("command-word-0-at", 0, CFGF_NONE),
		            CFG_INT("command-word-1-at", -1, CFGF_NONE),
		            CFG_INT("command-word-ack", 7, CFGF_NONE),
		            CFG_INT("command-word-fixed", 0, CFGF_NONE),
		            CFG_STR("flash", NULL, CFGF_NODEFAULT),
		            CFG_STR_LIST("fault", NULL, CFGF_NODEFAULT),
		            CFG_END() };
	cfg_opt_t drive[sizeof(drive_options) / sizeof(drive_options[0])];
	cfg_opt_t opts[] = { CFG_SEC("bus", bus, CFGF_MULTI | CFGF_TITLE | CFGF_NO_TITLE_DUPES),
		             CFG_SEC("drive", drive, CFGF_MULTI | CFGF_TITLE | CFGF_NO_TITLE_DUPES),
		             CFG_END() };
	cfg_t *cfg;
	int parsed;

	memcpy(drive, drive_options, sizeof(drive));
	cfg = cfg_init(opts, CFGF_NONE);
	*config = (struct sim_config){ .source = cfg };
	if (!cfg)
		return -1;
	(void)cfg_set_error_function(cfg, report);
	note_lines(cfg, "bus", bus);
	note_lines(cfg, "drive", drive);
	parsed = cfg_parse(cfg, path);
	if (parsed == CFG_FILE_ERROR)
		(void)fprintf(stderr, "%s: %s\n", path, strerror(errno));
	if (parsed == CFG_SUCCESS && load_sections(cfg, config) == 0)
		return 0;
	sim_config_free(config);
	return -1;
}

void sim_config_free(struct sim_config *config)
{
	free(config->buses);
	free(config->drives);
	if (config->source)
		(void)cfg_free(config->source);
	*config = (struct sim_config){ .source = NULL };
}
