/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/family.h"

#include "sim/can_line.h"
#include "sim/serial_bus.h"
#include "sim/vsmd_can_node.h"
#include "sim/vsmd_mechanics.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* --- making and freeing ----------------------------------------------------------------------- */

static bool open_drive(struct sim_node *node, void *wire, const struct sim_bus_config *bus,
                       const struct sim_drive_config *config, const char *flash, db_time now)
{
	struct sim_vsmd_config vsmd = config->vsmd;
	struct sim_can_station station;

	vsmd.flash_path = flash;
	node->drive = sim_vsmd_new(&vsmd, now);
	if (!node->drive)
		return false;
	node->stalled = &node->drive->stalled;
	node->forced_status = &node->drive->forced_status;
	node->flash_fails = &node->drive->flash_fails;
	if (node->family->protocol)
		return sim_serial_bus_attach(wire, node);
	node->vsmd_can = calloc(1, sizeof(*node->vsmd_can));
	if (!node->vsmd_can)
		return false;
	sim_vsmd_can_node_init(node->vsmd_can, node, &bus->style, bus->can.latency);
	station = sim_vsmd_can_node_station(node->vsmd_can);
	return sim_can_bus_attach(((struct sim_can_line *)wire)->bus, &station);
}

static void close_drive(struct sim_node *node)
{
	free(node->drive);
	free(node->vsmd_can);
}

/* --- state ------------------------------------------------------------------------------------ */

static void advance(struct sim_node *node, db_time now)
{
	sim_vsmd_advance(node->drive, now);
}

static unsigned moving_motors(const struct sim_node *node)
{
	return node->drive->powered && sim_motion_moving(&node->drive->motion);
}

static void write_motion(const struct sim_node *node, db_time now, FILE *out)
{
	struct vsmd_status status;

	sim_vsmd_status(node->drive, now, &status);
	fprintf(out, " position=%" PRId32 " velocity=%g", status.position, (double)status.velocity);
}

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

static void write_state(struct sim_node *node, db_time now, FILE *out)
{
	struct vsmd_status status;

	sim_vsmd_status(node->drive, now, &status);
	fprintf(out,
	        " position=%" PRId32 " velocity=%g status=0x%08" PRIx32 " shaft=%.0f power=%d"
	        " address=%u heard=%" PRIu32 " replies=%" PRIu32 " refused=%" PRIu32,
	        status.position, (double)status.velocity, status.status,
	        sim_mechanics_shaft(node->drive), node->drive->powered, node->drive->address,
	        node->received, node->replies, node->drive->refusals);
	for (int verb = 0; verb < VSMD_VERB_COUNT; verb++)
		fprintf(out, " %s=%" PRIu32, verb_names[verb], node->drive->counts[verb]);
}

static unsigned get_address(const struct sim_node *node)
{
	return node->drive->address;
}

/* --- from outside ----------------------------------------------------------------------------- */

/* As by a switch on the drive, at once. */
static void set_address(struct sim_node *node, unsigned address)
{
	struct sim_vsmd *drive = node->drive;

	drive->address = address;
	drive->params[VSMD_CID].u = drive->flash[VSMD_CID].u = address;
}

static void power(struct sim_node *node, bool on, db_time now)
{
	sim_vsmd_power(node->drive, on, now);
}

static const char *set_identity(struct sim_node *node, const char *rest, db_time now)
{
	size_t length = strlen(rest);

	(void)now;
	if (length == 0 || length >= SIM_VSMD_IDENTITY_MAX)
		return "identity needs a text of 1 to 63 characters";
	strcpy(node->drive->identity, rest);
	return NULL;
}

static const char *force_sensor(struct sim_node *node, const char *rest, db_time now)
{
	unsigned number = (unsigned)(rest[0] - '0');
	const char *level;

	if (number < 1 || number > SIM_VSMD_SENSORS || rest[1] != ' ')
		return "sensor needs a number 1 to 6 and 0, 1 or auto";
	level = rest + 2;
	if (strcmp(level, "0") != 0 && strcmp(level, "1") != 0 && strcmp(level, "auto") != 0)
		return "sensor needs a number 1 to 6 and 0, 1 or auto";
	sim_vsmd_force_sensor(node->drive, number, level[0] == 'a' ? -1 : level[0] - '0', now);
	return NULL;
}

/* "param NAME=VALUE": set with the vendor's own tool, not over the bus. */
static const char *set_param(struct sim_node *node, const char *rest, db_time now)
{
	size_t length = strcspn(rest, "=");
	int param = vsmd_param_find(rest, length);
	union db_value value;
	char *end;
	double number;

	(void)now;
	if (param < 0 || rest[length] != '=')
		return "param needs NAME=VALUE";
	number = strtod(rest + length + 1, &end);
	if (end == rest + length + 1 || *end != '\0' ||
	    !db_value_from_number(vsmd_params[param].type, number, &value) ||
	    !sim_vsmd_takes(&node->drive->config, (enum vsmd_param)param, value))
		return "param: it does not take this value";
	node->drive->params[param] = value;
	return NULL;
}

static const char *show_params(struct sim_node *node, const char *rest, db_time now)
{
	(void)now;
	if (strcmp(rest, "hidden") != 0 && strcmp(rest, "shown") != 0)
		return "params needs \"hidden\" or \"shown\"";
	node->drive->hides_params = rest[0] == 'h';
	return NULL;
}

static const struct sim_family_command commands[] = {
	{ "identity", set_identity }, { "param", set_param }, { "params", show_params },
	{ "sensor", force_sensor },   { NULL, NULL },
};

/* All but the protocol, which those on CAN do not have. */
#define OPERATIONS                                                                                \
	.open = open_drive, .close = close_drive, .advance = advance,                             \
	.moving_motors = moving_motors, .write_motion = write_motion, .write_state = write_state, \
	.get_address = get_address, .set_address = set_address, .power = power,                   \
	.commands = commands

const struct sim_family sim_vsmd_serial_family = {
	.protocol = &sim_vsmd_serial_protocol,
	OPERATIONS,
};

const struct sim_family sim_vsmd_can_family = {
	OPERATIONS,
};
