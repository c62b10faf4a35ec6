/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/commands.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

struct request {
	struct sim_world *world;
	struct sim_node *node; /* the drive named by the first argument, or null */
	struct sim_bus *bus;   /* the bus so named, or null */
	char *rest;            /* what follows the name, "" when nothing does */
	db_time now;
	FILE *out;
};

/* Null, or what is wrong. A handler that answers itself writes its own "ok" line and returns "". */
typedef const char *command_fn(struct request *request);

enum target {
	TARGET_NONE,
	TARGET_DRIVE,
	TARGET_VSMD,
	TARGET_SERVO,
	TARGET_XYZA,
	TARGET_MOTOR,
	TARGET_BUS,
	TARGET_ANY
};

static const char *const verb_names[VSMD_VERB_COUNT] = {
	[VSMD_DEV] = "dev",
	[VSMD_STS] = "sts",
	[VSMD_ENA] = "ena",
	[VSMD_OFF] = "off",
	[VSMD_MOV] = "mov",
	[VSMD_POS] = "pos",
	[VSMD_RMV] = "rmv",
	[VSMD_STP] = "stp",
	[VSMD_ORG] = "org",
	[VSMD_ECLR] = "eclr",
	[VSMD_SENSOR_OUT] = "output",
	[VSMD_SV] = "sv",
	[VSMD_NMOS] = "nmos",
	[VSMD_ZERO_START] = "zero_start",
	[VSMD_ZERO_STOP] = "zero_stop",
	[VSMD_SHAKE_CYCLES] = "shake_cycles",
	[VSMD_SHAKE_TIME] = "shake_time",
	[VSMD_SHAKE_STOP] = "shake_stop",
	[VSMD_CFG_READ] = "cfg_read",
	[VSMD_CFG_WRITE] = "cfg_write",
	[VSMD_SAV] = "sav",
};

static const char *do_fault(struct request *request)
{
	return sim_world_fault(request->node, request->bus, request->rest, request->now);
}

static const char *do_flash(struct request *request)
{
	if (strcmp(request->rest, "fail") != 0 && strcmp(request->rest, "ok") != 0)
		return "flash needs \"fail\" or \"ok\"";
	sim_vsmd_fail_flash(request->node->drive, request->rest[0] == 'f');
	return NULL;
}

static const char *do_stall(struct request *request)
{
	bool off = strcmp(request->rest, "off") == 0;

	if (!off && request->rest[0] != '\0' && strcmp(request->rest, "on") != 0)
		return "stall needs \"on\", \"off\" or nothing";
	sim_node_stall(request->node, !off, request->now);
	return NULL;
}

static void set_power(const struct sim_node *node, bool on, db_time now)
{
	if (node->xyza)
		sim_xyza_power(node->xyza, on, now);
	else if (node->servo)
		sim_servo_power(node->servo->drive, on, now);
	else
		sim_vsmd_power(node->drive, on, now);
}

static const char *do_power(struct request *request)
{
	bool cycle = strcmp(request->rest, "cycle") == 0;
	bool on = strcmp(request->rest, "on") == 0;

	if (!cycle && !on && strcmp(request->rest, "off") != 0)
		return "power needs \"on\", \"off\" or \"cycle\"";
	if (!on)
		set_power(request->node, false, request->now);
	if (on || cycle)
		set_power(request->node, true, request->now);
	sim_world_tell(request->world, request->node,
	               cycle ? "power cycle" :
	               on    ? "power on" :
	                       "power off",
	               request->now);
	return NULL;
}

static const char *do_identity(struct request *request)
{
	size_t length = strlen(request->rest);

	if (length == 0 || length >= SIM_VSMD_IDENTITY_MAX)
		return "identity needs a text of 1 to 63 characters";
	sim_vsmd_set_identity(request->node->drive, request->rest);
	return NULL;
}

static const char *do_sensor(struct request *request)
{
	unsigned number = (unsigned)(request->rest[0] - '0');
	const char *level;

	if (number < 1 || number > SIM_VSMD_SENSORS || request->rest[1] != ' ')
		return "sensor needs a number 1 to 6 and 0, 1 or auto";
	level = request->rest + 2;
	if (strcmp(level, "0") != 0 && strcmp(level, "1") != 0 && strcmp(level, "auto") != 0)
		return "sensor needs a number 1 to 6 and 0, 1 or auto";
	sim_vsmd_force_sensor(request->node->drive, number, level[0] == 'a' ? -1 : level[0] - '0',
	                      request->now);
	return NULL;
}

/* Two drives may have the same: that is what it is for. */
static const char *do_address(struct request *request)
{
	char *end;
	unsigned long address = strtoul(request->rest, &end, 10);
	struct sim_node *node = request->node;

	if (end == request->rest || *end != '\0' || address < 1 || address > 31)
		return "address needs a number, 1 to 31";
	if (node->xyza)
		sim_xyza_set_number(node->xyza, (unsigned)address);
	else if (node->servo)
		node->servo->address = (uint8_t)address;
	else
		sim_vsmd_set_address(node->drive, (unsigned)address);
	return NULL;
}

static const char *do_bits(struct request *request)
{
	char *end;
	unsigned long mask = strtoul(request->rest, &end, 0);

	if (end == request->rest || *end != '\0' || mask > UINT32_MAX)
		return "bits needs a number, 0x40 for instance";
	if (request->node->servo)
		sim_servo_force_status(request->node->servo->drive, (uint16_t)mask);
	else
		sim_vsmd_force_status(request->node->drive, (uint32_t)mask);
	return NULL;
}

/* --- servos -------------------------------------------------------------------------------------- */

/* So many numbers and nothing else; false when it is not so. */
static bool read_numbers(const char *text, long *numbers, size_t count, long max)
{
	for (size_t i = 0; i < count; i++) {
		char *end;

		numbers[i] = strtol(text, &end, 0);
		if (end == text || numbers[i] < 0 || numbers[i] > max)
			return false;
		text = end + strspn(end, " \t");
	}
	return *text == '\0';
}

static const char *do_faults(struct request *request)
{
	long faults;

	if (!read_numbers(request->rest, &faults, 1, UINT16_MAX))
		return "faults needs the fault word, 0x40 for instance";
	sim_servo_set_faults(request->node->servo->drive, (uint16_t)faults, request->now);
	return NULL;
}

static const char *do_health(struct request *request)
{
	long raw[2];

	if (!read_numbers(request->rest, raw, 2, UINT16_MAX))
		return "health needs voltage and temperature as they are reported";
	sim_servo_set_health(request->node->servo->drive, (uint16_t)raw[0], (uint16_t)raw[1]);
	return NULL;
}

static const char *do_inputs(struct request *request)
{
	long raw[2];

	if (!read_numbers(request->rest, raw, 2, UINT16_MAX) || raw[0] > UINT8_MAX)
		return "inputs needs the levels of 8 inputs and the analogue input's value";
	sim_servo_set_inputs(request->node->servo->drive, (uint8_t)raw[0], (uint16_t)raw[1]);
	return NULL;
}

static const char *do_reports(struct request *request)
{
	const long max = 60000;
	long ms[SIM_SERVO_REPORTS];

	if (!read_numbers(request->rest, ms, SIM_SERVO_REPORTS, max))
		return "reports needs three intervals in ms, 0 = off: position, motion, health";
	for (int i = 0; i < SIM_SERVO_REPORTS; i++)
		sim_servo_set_reports(request->node->servo->drive, (enum sim_servo_report)i,
		                      ms[i] * DB_NS_PER_MS, request->now);
	return NULL;
}

static void get_servo(struct request *request)
{
	static const struct {
		enum servo_can_kind kind;
		const char *name;
	} counted[] = {
		{ SERVO_CAN_SYNC, "sync" },
		{ SERVO_CAN_ENABLE, "enable" },
		{ SERVO_CAN_MODE, "mode_frames" },
		{ SERVO_CAN_SPEED, "speed_frames" },
		{ SERVO_CAN_CURRENT, "current_frames" },
		{ SERVO_CAN_POSITION, "position_frames" },
		{ SERVO_CAN_SET_FEEDBACK, "set_feedback" },
		{ SERVO_CAN_RAMPS, "ramps" },
		{ SERVO_CAN_READ, "read" },
		{ SERVO_CAN_WORDS, "words" },
	};
	const struct sim_servo_node *node = request->node->servo;
	const struct sim_servo *drive = node->drive;

	sim_servo_advance(node->drive, request->now);
	(void)fprintf(request->out,
	              "ok position=%.0f velocity=%g current=%g mode=%s enabled=%d power=%d"
	              " address=%u heard=%" PRIu32 " unknown=%" PRIu32 " moves=%" PRIu32
	              " setpoint_us=%" PRId64,
	              sim_servo_position(drive), sim_servo_speed(drive), sim_servo_current(drive),
	              servo_can_mode_name((unsigned)sim_servo_mode(drive)),
	              sim_servo_enabled(drive), sim_servo_powered(drive), node->address,
	              node->heard, node->unknown, sim_servo_moves(drive),
	              sim_servo_setpoint_at(drive) / DB_NS_PER_US);
	for (size_t i = 0; i < sizeof(counted) / sizeof(counted[0]); i++)
		(void)fprintf(request->out, " %s=%" PRIu32, counted[i].name,
		              sim_servo_count(drive, counted[i].kind));
	(void)fputc('\n', request->out);
}

/* --- XYZA controllers ----------------------------------------------------------------------------- */

static const char axis_letters[] = "xyza";

static const char *do_input(struct request *request)
{
	long values[2];

	if (!read_numbers(request->rest, values, 2, SIM_XYZA_INPUTS) || values[0] < 1 ||
	    values[1] > 1)
		return "input needs a number 1 to 16 and 0 or 1";
	sim_xyza_set_input(request->node->xyza, (unsigned)values[0], values[1] == 1, request->now);
	return NULL;
}

static const char *do_place(struct request *request)
{
	const char *letter = request->rest[0] ? strchr(axis_letters, request->rest[0]) : NULL;
	char *end;
	long position;

	if (!letter || request->rest[1] != ' ')
		return "place needs an axis (x, y, z or a) and a position";
	position = strtol(request->rest + 2, &end, 10);
	if (end == request->rest + 2 || *end != '\0' || position < INT32_MIN ||
	    position > INT32_MAX)
		return "place needs an axis (x, y, z or a) and a position";
	sim_xyza_place(request->node->xyza, (enum xyza_axis)(letter - axis_letters),
	               (int32_t)position, request->now);
	return NULL;
}

static void get_xyza(struct request *request)
{
	static const struct {
		enum xyza_verb verb;
		const char *name;
	} counted[] = {
		{ XYZA_VERB_ONLINE, "online" },
		{ XYZA_READ_MAGNITUDE, "read_magnitude" },
		{ XYZA_READ_SIGN, "read_sign" },
		{ XYZA_READ_STANDING, "read_standing" },
		{ XYZA_READ_PORTS, "read_ports" },
		{ XYZA_READ_ITEM, "read_item" },
		{ XYZA_WRITE_MAGNITUDE, "write_magnitude" },
		{ XYZA_WRITE_SIGN, "write_sign" },
		{ XYZA_WRITE_OUTPUT, "write_output" },
		{ XYZA_WRITE_OUTPUTS, "write_outputs" },
		{ XYZA_WRITE_ITEM, "write_item" },
		{ XYZA_MANUAL_QUICK_STOP, "manual_quick_stop" },
		{ XYZA_MANUAL_STOP, "manual_stop" },
		{ XYZA_MANUAL_JOG, "jog" },
		{ XYZA_MANUAL_CLEAR, "manual_clear" },
		{ XYZA_PROGRAM_QUICK_STOP, "program_quick_stop" },
		{ XYZA_PROGRAM_STOP, "program_stop" },
		{ XYZA_PROGRAM_START, "program_start" },
		{ XYZA_PROGRAM_CLEAR, "program_clear" },
		{ XYZA_PROGRAM_DELAY, "program_delay" },
		{ XYZA_PROGRAM_CONTINUE, "program_continue" },
		{ XYZA_PROGRAM_END, "program_end" },
		{ XYZA_PROGRAM_STEP_ON, "step_on" },
		{ XYZA_PROGRAM_STEP_OFF, "step_off" },
		{ XYZA_PROGRAM_STATE, "read_program" },
	};
	const struct sim_node *node = request->node;
	FILE *out = request->out;

	sim_xyza_advance(node->xyza, request->now);
	(void)fputs("ok", out);
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++)
		(void)fprintf(out, " %c=%.0f %c_speed=%g", axis_letters[axis],
		              sim_xyza_position(node->xyza, (enum xyza_axis)axis),
		              axis_letters[axis], sim_xyza_speed(node->xyza, (enum xyza_axis)axis));
	(void)fprintf(out,
	              " inputs=0x%04x outputs=0x%04x program_state=%d program=%u step=%u power=%d"
	              " address=%u heard=%" PRIu32 " replies=%" PRIu32 " failed=%" PRIu32,
	              (unsigned)sim_xyza_inputs(node->xyza), (unsigned)sim_xyza_outputs(node->xyza),
	              (int)sim_xyza_program_state(node->xyza), sim_xyza_program(node->xyza),
	              sim_xyza_step(node->xyza), sim_xyza_powered(node->xyza),
	              sim_xyza_number(node->xyza), node->heard, node->replies,
	              sim_xyza_failures(node->xyza));
	for (size_t i = 0; i < sizeof(counted) / sizeof(counted[0]); i++)
		(void)fprintf(out, " %s=%" PRIu32, counted[i].name,
		              sim_xyza_count(node->xyza, counted[i].verb));
	(void)fputc('\n', out);
}

static const char *do_baud(struct request *request)
{
	char *end;
	unsigned long baud = strtoul(request->rest, &end, 10);

	if (request->bus->config->kind != SIM_BUS_VSMD_SERIAL &&
	    request->bus->config->kind != SIM_BUS_XYZA)
		return "baud is for serial lines";
	if (end == request->rest || *end != '\0' || baud < 2400 || baud > 921600)
		return "baud needs a rate of 2400 to 921600";
	sim_serial_bus_set_baud(request->bus->wire, (unsigned)baud);
	return NULL;
}

static void get_bus(struct request *request)
{
	char text[256];

	request->bus->ops->describe(request->bus->wire, text, sizeof(text));
	(void)fprintf(request->out, "ok device=%s %s\n", request->bus->port.host, text);
}

static const char *do_get(struct request *request)
{
	struct sim_node *node = request->node;
	struct vsmd_status status;

	if (!node) {
		get_bus(request);
		return "";
	}
	if (node->servo) {
		get_servo(request);
		return "";
	}
	if (node->xyza) {
		get_xyza(request);
		return "";
	}
	sim_vsmd_status(node->drive, request->now, &status);
	(void)fprintf(request->out,
	              "ok position=%" PRId32 " velocity=%g status=0x%08" PRIx32
	              " shaft=%.0f power=%d"
	              " address=%u heard=%" PRIu32 " replies=%" PRIu32 " refused=%" PRIu32,
	              status.position, (double)status.velocity, status.status,
	              sim_vsmd_shaft(node->drive), sim_vsmd_powered(node->drive),
	              sim_vsmd_address(node->drive), node->heard, node->replies,
	              sim_vsmd_refusals(node->drive));
	for (int verb = 0; verb < VSMD_VERB_COUNT; verb++)
		(void)fprintf(request->out, " %s=%" PRIu32, verb_names[verb],
		              sim_vsmd_count(node->drive, (enum vsmd_verb)verb));
	(void)fputc('\n', request->out);
	return "";
}

static const char *do_log(struct request *request)
{
	const struct sim_node *node = request->node;
	uint32_t first = node->heard > SIM_LOG_LINES ? node->heard - SIM_LOG_LINES : 0;

	for (uint32_t i = first; i < node->heard; i++) {
		const struct sim_log_entry *entry = &node->log[i % SIM_LOG_LINES];

		(void)fprintf(request->out, "%" PRId64 " %s\n", entry->time / DB_NS_PER_US,
		              entry->line);
	}
	return NULL;
}

static unsigned address_of(const struct sim_node *node)
{
	if (node->xyza)
		return sim_xyza_number(node->xyza);
	return node->servo ? node->servo->address : sim_vsmd_address(node->drive);
}

static const char *do_list(struct request *request)
{
	const struct sim_world *world = request->world;

	for (size_t i = 0; i < world->bus_count; i++)
		(void)fprintf(request->out, "bus %s %s\n", world->buses[i].config->name,
		              world->buses[i].port.host);
	for (size_t i = 0; i < world->node_count; i++) {
		const struct sim_node *node = &world->nodes[i];

		(void)fprintf(request->out, "drive %s %u\n", node->name, address_of(node));
	}
	return NULL;
}

static const struct {
	const char *name;
	enum target target;
	command_fn *run;
} commands[] = {
	{ "fault", TARGET_ANY, do_fault },       { "power", TARGET_DRIVE, do_power },
	{ "address", TARGET_DRIVE, do_address }, { "identity", TARGET_VSMD, do_identity },
	{ "flash", TARGET_VSMD, do_flash },      { "stall", TARGET_MOTOR, do_stall },
	{ "sensor", TARGET_VSMD, do_sensor },    { "bits", TARGET_MOTOR, do_bits },
	{ "faults", TARGET_SERVO, do_faults },   { "health", TARGET_SERVO, do_health },
	{ "inputs", TARGET_SERVO, do_inputs },   { "reports", TARGET_SERVO, do_reports },
	{ "input", TARGET_XYZA, do_input },      { "place", TARGET_XYZA, do_place },
	{ "baud", TARGET_BUS, do_baud },         { "get", TARGET_ANY, do_get },
	{ "log", TARGET_DRIVE, do_log },         { "list", TARGET_NONE, do_list },
};

#define COMMAND_COUNT (sizeof(commands) / sizeof(commands[0]))

/* Cuts the first word off a text; *rest is what follows it. */
static char *cut_word(char *text, char **rest)
{
	char *word = text + strspn(text, " \t");
	char *end = word + strcspn(word, " \t");

	*rest = end + strspn(end, " \t");
	*end = '\0';
	return word;
}

static const char *find_target(struct request *request, enum target target)
{
	const char *name;

	if (target == TARGET_NONE)
		return NULL;
	name = cut_word(request->rest, &request->rest);
	if (target != TARGET_BUS)
		request->node = sim_world_node(request->world, name);
	if (target == TARGET_BUS || target == TARGET_ANY)
		request->bus = sim_world_bus(request->world, name);
	if (!request->node && !request->bus)
		return target == TARGET_BUS ? "no such bus" :
		       target == TARGET_ANY ? "no such drive or bus" :
		                              "no such drive";
	if ((target == TARGET_VSMD && !request->node->drive) ||
	    (target == TARGET_SERVO && !request->node->servo) ||
	    (target == TARGET_XYZA && !request->node->xyza) ||
	    (target == TARGET_MOTOR && request->node->xyza))
		return "this family has none";
	return NULL;
}

void sim_command(struct sim_world *world, char *line, db_time now, FILE *out)
{
	struct request request = { .world = world, .now = now, .out = out };
	const char *error =
		"no such command; there are fault, power, address, identity, flash, stall, sensor, "
		"bits, faults, health, inputs, reports, input, place, baud, get, log, list";
	const char *name = cut_word(line, &request.rest);

	for (size_t i = 0; i < COMMAND_COUNT; i++) {
		if (strcmp(name, commands[i].name) != 0)
			continue;
		error = find_target(&request, commands[i].target);
		if (!error)
			error = commands[i].run(&request);
		break;
	}
	if (!error)
		(void)fputs("ok\n", out);
	else if (error[0] != '\0')
		(void)fprintf(out, "error %s\n", error);
}
