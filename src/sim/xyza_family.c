/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/family.h"

#include "sim/serial_bus.h"
#include "sim/sim_private.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char axis_letters[] = "xyza";

/* --- making and freeing ----------------------------------------------------------------------- */

static bool open_controller(struct sim_node *node, void *wire, const struct sim_bus_config *bus,
                            const struct sim_drive_config *config, const char *flash, db_time now)
{
	struct sim_xyza_config xyza = config->xyza;

	(void)bus;
	xyza.flash_path = flash;
	node->xyza = sim_xyza_new(&xyza, now);
	return node->xyza && sim_serial_bus_attach(wire, node);
}

static void close_controller(struct sim_node *node)
{
	free(node->xyza);
}

/* --- state ------------------------------------------------------------------------------------ */

static bool is_busy(const struct sim_node *node)
{
	return sim_xyza_busy(node->xyza);
}

static void advance(struct sim_node *node, db_time now)
{
	sim_xyza_advance(node->xyza, now);
}

static unsigned moving_motors(const struct sim_node *node)
{
	unsigned moving = 0;

	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++)
		moving |= (unsigned)!sim_xyza_axis_state(node->xyza, (enum xyza_axis)axis).standing
		          << axis;
	return moving;
}

static void write_motion(const struct sim_node *node, db_time now, FILE *out)
{
	sim_xyza_advance(node->xyza, now);
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++)
		fprintf(out, " %c=%.0f %c_speed=%g", axis_letters[axis],
		        sim_xyza_axis_state(node->xyza, (enum xyza_axis)axis).position,
		        axis_letters[axis],
		        sim_xyza_axis_state(node->xyza, (enum xyza_axis)axis).speed);
}

static void write_state(struct sim_node *node, db_time now, FILE *out)
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

	write_motion(node, now, out);
	fprintf(out,
	        " inputs=0x%04x outputs=0x%04x program_state=%d program=%u step=%u power=%d"
	        " address=%u heard=%" PRIu32 " replies=%" PRIu32 " failed=%" PRIu32,
	        (unsigned)node->xyza->inputs, (unsigned)node->xyza->outputs, (int)node->xyza->state,
	        node->xyza->program, node->xyza->step, node->xyza->powered,
	        sim_xyza_memory_get(&node->xyza->memory, XYZA_ITEM_SLAVE_NUMBER, XYZA_X),
	        node->received, node->replies, node->xyza->failures);
	for (size_t i = 0; i < sizeof(counted) / sizeof(counted[0]); i++)
		fprintf(out, " %s=%" PRIu32, counted[i].name, node->xyza->counts[counted[i].verb]);
}

static unsigned get_address(const struct sim_node *node)
{
	return sim_xyza_memory_get(&node->xyza->memory, XYZA_ITEM_SLAVE_NUMBER, XYZA_X);
}

/* --- from outside ----------------------------------------------------------------------------- */

static void set_address(struct sim_node *node, unsigned address)
{
	node->xyza->memory.items[XYZA_X][XYZA_ITEM_SLAVE_NUMBER] = address;
}

static void power(struct sim_node *node, bool on, db_time now)
{
	sim_xyza_power(node->xyza, on, now);
}

static const char *set_input(struct sim_node *node, const char *rest, db_time now)
{
	long values[2];

	if (!sim_read_numbers(rest, values, 2, SIM_XYZA_INPUTS) || values[0] < 1 || values[1] > 1)
		return "input needs a number 1 to 16 and 0 or 1";
	sim_xyza_set_input(node->xyza, (unsigned)values[0], values[1] == 1, now);
	return NULL;
}

static const char *place_axis(struct sim_node *node, const char *rest, db_time now)
{
	const char *letter = rest[0] ? strchr(axis_letters, rest[0]) : NULL;
	char *end;
	long position;

	if (!letter || rest[1] != ' ')
		return "place needs an axis (x, y, z or a) and a position";
	position = strtol(rest + 2, &end, 10);
	if (end == rest + 2 || *end != '\0' || position < INT32_MIN || position > INT32_MAX)
		return "place needs an axis (x, y, z or a) and a position";
	sim_xyza_place(node->xyza, (enum xyza_axis)(letter - axis_letters), (int32_t)position, now);
	return NULL;
}

/* "item AXIS PARAMETER CONTENT": the content of the item that has this parameter. */
static const char *set_item(struct sim_node *node, const char *rest, db_time now)
{
	const char *letter = rest[0] ? strchr(axis_letters, rest[0]) : NULL;
	size_t length = letter && rest[1] == ' ' ? strcspn(rest + 2, " ") : 0;
	int param = xyza_param_find(rest + 2 * (length > 0), length);
	char *end = NULL;
	unsigned long content = param < 0 ? 0 : strtoul(rest + 2 + length, &end, 0);

	if (param < 0 || end == rest + 2 + length || *end != '\0' || content > UINT32_MAX)
		return "item needs an axis (x, y, z or a), a parameter and a content";
	sim_xyza_set_item(node->xyza, xyza_param_places[param].item,
	                  (enum xyza_axis)(letter - axis_letters), (uint32_t)content, now);
	return NULL;
}

static const struct sim_family_command commands[] = {
	{ "input", set_input },
	{ "item", set_item },
	{ "place", place_axis },
	{ NULL, NULL },
};

/* A controller does not sense its motors: for it they never stall. */
const struct sim_family sim_xyza_family = {
	.protocol = &sim_xyza_protocol,
	.open = open_controller,
	.close = close_controller,
	.is_busy = is_busy,
	.advance = advance,
	.moving_motors = moving_motors,
	.write_motion = write_motion,
	.write_state = write_state,
	.get_address = get_address,
	.set_address = set_address,
	.power = power,
	.commands = commands,
};
