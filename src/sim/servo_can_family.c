/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/family.h"

#include "sim/can_line.h"
#include "sim/servo_drive.h"
#include "sim/sim_private.h"

#include <inttypes.h>
#include <stdlib.h>

/* --- making and freeing ----------------------------------------------------------------------- */

static bool open_drive(struct sim_node *node, void *wire, const struct sim_bus_config *bus,
                       const struct sim_drive_config *config, const char *flash, db_time now)
{
	struct sim_servo *drive = sim_servo_new(&config->servo, now);
	struct sim_can_station station;

	(void)flash; /* it has none */
	node->servo = calloc(1, sizeof(*node->servo));
	if (!drive || !node->servo) {
		free(drive);
		return false;
	}
	*node->servo = (struct sim_servo_node){
		.drive = drive,
		.address = (uint8_t)config->address,
		.layout = bus->layout,
		.latency = bus->can.latency,
		.ack_latency = config->servo_ack_latency,
		.stray_acks = config->servo_stray_acks,
		.lengths = config->servo_lengths,
		.witness = node->witness,
	};
	node->stalled = &drive->blocked;
	node->forced_status = &drive->forced;
	station = sim_servo_node_station(node->servo);
	station.faults = &node->faults;
	return sim_can_bus_attach(((struct sim_can_line *)wire)->bus, &station);
}

static void close_drive(struct sim_node *node)
{
	if (!node->servo)
		return;
	free(node->servo->drive);
	free(node->servo);
}

/* --- state ------------------------------------------------------------------------------------ */

static void advance(struct sim_node *node, db_time now)
{
	sim_servo_advance(node->servo->drive, now);
}

static unsigned moving_motors(const struct sim_node *node)
{
	return !sim_servo_settled(node->servo->drive);
}

static void write_motion(const struct sim_node *node, db_time now, FILE *out)
{
	sim_servo_advance(node->servo->drive, now);
	fprintf(out, " position=%.0f velocity=%g enabled=%d", node->servo->drive->position,
	        node->servo->drive->rpm, node->servo->drive->enabled);
}

static void write_state(struct sim_node *node, db_time now, FILE *out)
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
		{ SERVO_CAN_WORD_1, "word_1_frames" },
		{ SERVO_CAN_MOVE, "move_frames" },
	};
	const struct sim_servo_node *servo = node->servo;
	const struct sim_servo *drive = servo->drive;

	sim_servo_advance(servo->drive, now);
	fprintf(out,
	        " position=%.0f velocity=%g current=%g mode=%s enabled=%d power=%d"
	        " address=%u heard=%" PRIu32 " unknown=%" PRIu32 " moves=%" PRIu32
	        " setpoint_us=%" PRId64,
	        drive->position, drive->rpm, drive->amperes,
	        servo_can_mode_name((unsigned)drive->mode), drive->enabled, drive->powered,
	        servo->address, servo->received, servo->unknown, drive->moves,
	        drive->setpoint_at / DB_NS_PER_US);
	for (size_t i = 0; i < sizeof(counted) / sizeof(counted[0]); i++)
		fprintf(out, " %s=%" PRIu32, counted[i].name, drive->counts[counted[i].kind]);
}

static unsigned get_address(const struct sim_node *node)
{
	return node->servo->address;
}

/* --- from outside ----------------------------------------------------------------------------- */

static void set_address(struct sim_node *node, unsigned address)
{
	node->servo->address = (uint8_t)address;
}

static void power(struct sim_node *node, bool on, db_time now)
{
	sim_servo_power(node->servo->drive, on, now);
}

static const char *set_faults(struct sim_node *node, const char *rest, db_time now)
{
	long faults;

	if (!sim_read_numbers(rest, &faults, 1, UINT16_MAX))
		return "faults needs the fault word, 0x40 for instance";
	sim_servo_set_faults(node->servo->drive, (uint16_t)faults, now);
	return NULL;
}

static const char *set_health(struct sim_node *node, const char *rest, db_time now)
{
	long raw[2];

	(void)now;
	if (!sim_read_numbers(rest, raw, 2, UINT16_MAX))
		return "health needs voltage and temperature as they are reported";
	node->servo->drive->voltage = (uint16_t)raw[0];
	node->servo->drive->temperature = (uint16_t)raw[1];
	return NULL;
}

static const char *set_inputs(struct sim_node *node, const char *rest, db_time now)
{
	long raw[2];

	(void)now;
	if (!sim_read_numbers(rest, raw, 2, UINT16_MAX) || raw[0] > UINT8_MAX)
		return "inputs needs the levels of 8 inputs and the analogue input's value";
	node->servo->drive->inputs = (uint8_t)raw[0];
	node->servo->drive->analogue = (uint16_t)raw[1];
	return NULL;
}

static const char *set_reports(struct sim_node *node, const char *rest, db_time now)
{
	const long max = 60000;
	long ms[SIM_SERVO_REPORTS];

	if (!sim_read_numbers(rest, ms, SIM_SERVO_REPORTS, max))
		return "reports needs three intervals in ms, 0 = off: position, motion, health";
	for (int i = 0; i < SIM_SERVO_REPORTS; i++)
		sim_servo_set_reports(node->servo->drive, (enum sim_servo_report)i,
		                      ms[i] * DB_NS_PER_MS, now);
	return NULL;
}

static const struct sim_family_command commands[] = {
	{ "faults", set_faults },   { "health", set_health }, { "inputs", set_inputs },
	{ "reports", set_reports }, { NULL, NULL },
};

const struct sim_family sim_servo_can_family = {
	.open = open_drive,
	.close = close_drive,
	.advance = advance,
	.moving_motors = moving_motors,
	.write_motion = write_motion,
	.write_state = write_state,
	.get_address = get_address,
	.set_address = set_address,
	.power = power,
	.commands = commands,
};
