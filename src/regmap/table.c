/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/table.h"

#include "drivebridge/command_table.h"
#include "drivebridge/limit.h"
#include "regmap/image.h"

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

/* --- what drives can do --------------------------------------------------------------------------- */

/* A capability is there when the family has one of the commands or measures. Append, never renumber. */
static const struct {
	const char *name;
	uint64_t commands;
	unsigned measures;
} capabilities[] = {
	{ "move_velocity", DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY), 0 },
	{ "move_absolute", DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE), 0 },
	{ "move_relative", DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE), 0 },
	{ "home", DB_COMMAND_BIT(DB_CMD_HOME), 0 },
	{ "set_position", DB_COMMAND_BIT(DB_CMD_SET_POSITION), 0 },
	{ "clear_fault", DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT), 0 },
	{ "read_parameters", DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS), 0 },
	{ "save_parameters", DB_COMMAND_BIT(DB_CMD_SAVE_PARAMETERS), 0 },
	{ "inputs", 0, DB_MEASURE_INPUTS },
	{ "outputs", DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) | DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS), 0 },
	{ "pwm", DB_COMMAND_BIT(DB_CMD_SET_SV) | DB_COMMAND_BIT(DB_CMD_SET_NMOS), 0 },
	{ "shake", DB_COMMAND_BIT(DB_CMD_SHAKE_START) | DB_COMMAND_BIT(DB_CMD_SHAKE_START_TIME),
	  0 },
	{ "move_preset", DB_COMMAND_BIT(DB_CMD_MOVE_PRESET), 0 },
	{ "programs", 0, DB_MEASURE_PROGRAM },
	{ "measures_current", 0, DB_MEASURE_CURRENT },
	{ "move_current", DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT), 0 },
	{ "sync_start", DB_COMMAND_BIT(DB_CMD_SYNC_START), 0 },
	{ "raw_frame", DB_COMMAND_BIT(DB_CMD_RAW_FRAME), 0 },
};

uint32_t db_capabilities(uint64_t commands, unsigned measures)
{
	uint32_t bits = 0;

	for (size_t i = 0; i < COUNT_OF(capabilities); i++) {
		if ((commands & capabilities[i].commands) || (measures & capabilities[i].measures))
			bits |= UINT32_C(1) << i;
	}
	return bits;
}

const char *db_capability_name(unsigned bit)
{
	return bit < COUNT_OF(capabilities) ? capabilities[bit].name : "unknown";
}

/* --- codes for descriptions -------------------------------------------------------------------------- */

static const char *state_name(unsigned code)
{
	return db_axis_state_name((enum db_axis_state)code);
}

static const char *error_name(unsigned code)
{
	return db_error_name((uint16_t)code);
}

static const char *limit_name(unsigned code)
{
	return db_limit_name((uint16_t)code);
}

static const char *result_name(unsigned code)
{
	return db_result_name((enum db_result)code);
}

static const struct db_codes axis_states = { state_name, DB_AXIS_STATE_COUNT, false };
static const struct db_codes errors = { error_name, 64, false };
static const struct db_codes limits = { limit_name, DB_LIMIT_COUNT, false };
static const struct db_codes results = { result_name, DB_RESULT_COUNT, false };
static const struct db_codes command_codes = { db_command_name, DB_CMD_LIMIT, false };
static const struct db_codes status_bits = { db_status_bit_name, DB_STATUS_BIT_COUNT, true };
static const struct db_codes capability_bits = { db_capability_name, COUNT_OF(capabilities), true };

/* --- the table ----------------------------------------------------------------------------------------- */

#define DRIVE(needs, member)                                               \
	.view = DB_VIEW_DRIVE, .table = DB_TABLE_HOLDING, .part = (needs), \
	.offset = offsetof(struct db_drive_image, member)
#define PROCESS(member) DRIVE(DB_PART_PROCESS, member)
#define BLOCK(member) DRIVE(DB_PART_BLOCK, block.member)
#define PARAMETER DRIVE(DB_PART_PLATE, plate.values)
#define HISTORY(member) DRIVE(DB_PART_HISTORY, history[0].member)
#define GATEWAY_PART(needs, member)                                          \
	.view = DB_VIEW_GATEWAY, .table = DB_TABLE_HOLDING, .part = (needs), \
	.offset = offsetof(struct db_gateway_image, member)
#define GATEWAY(member) GATEWAY_PART(DB_PART_SERVER, member)
#define GATEWAY_GROUP(member) GATEWAY_PART(DB_PART_GROUP, member)
#define GATEWAY_BUS(member) GATEWAY_PART(DB_PART_BUSES, buses[0].member)
#define GATEWAY_WINDOW(member) GATEWAY_PART(DB_PART_WINDOWS, windows[0].member)
#define GATEWAY_DRIVE(member) GATEWAY_PART(DB_PART_DRIVES, drives[0].member)
#define GATEWAY_CLIENT(member) GATEWAY_PART(DB_PART_CLIENTS, connected[0].member)
#define EACH_BUS                                                                                   \
	{                                                                                          \
		.count = DB_GATEWAY_BUSES, .addresses = 40, .bytes = sizeof(struct db_gateway_bus) \
	}
#define EACH_LINE                                                                                  \
	{                                                                                          \
		.count = DB_GATEWAY_BUSES, .addresses = 16, .bytes = sizeof(struct db_gateway_bus) \
	}
#define EACH_WINDOW                                           \
	{                                                     \
		.count = DB_GATEWAY_WINDOWS, .addresses = 24, \
		.bytes = sizeof(struct db_gateway_window)     \
	}
#define EACH_DRIVE                                           \
	{                                                    \
		.count = DB_GATEWAY_DRIVES, .addresses = 16, \
		.bytes = sizeof(struct db_gateway_drive)     \
	}

#define EACH_HISTORY                                                                               \
	{                                                                                          \
		.count = DB_HISTORY_MAX, .addresses = 24, .bytes = sizeof(struct db_drive_history) \
	}
#define EACH_HISTORY_TEXT                                                          \
	{                                                                          \
		.count = DB_HISTORY_MAX, .addresses = DB_CLIENT_ADDRESS_REGISTERS, \
		.bytes = sizeof(struct db_drive_history)                           \
	}
#define EACH_CLIENT                                           \
	{                                                     \
		.count = DB_GATEWAY_CLIENTS, .addresses = 12, \
		.bytes = sizeof(struct db_gateway_client)     \
	}
#define EACH_CLIENT_TEXT                                                               \
	{                                                                              \
		.count = DB_GATEWAY_CLIENTS, .addresses = DB_CLIENT_ADDRESS_REGISTERS, \
		.bytes = sizeof(struct db_gateway_client)                              \
	}

const struct db_row db_rows[] = {
	/* Drive view: process data. */
	{
		.name = "axis_state",
		.address = 0,
		.type = DB_U16,
		PROCESS(feedback.state),
		.max = DB_AXIS_STATE_COUNT - 1,
		.codes = &axis_states,
		.description = "State of the axis after PLCopen",
	},
	{
		.name = "error",
		.address = 1,
		.type = DB_U16,
		PROCESS(feedback.error),
		.codes = &errors,
		.description = "Why the axis is in ErrorStop or Offline; below 16 the bridge's "
			       "own causes; from 16 the drive's",
	},
	{
		.name = "status",
		.address = 2,
		.type = DB_BITS32,
		PROCESS(status),
		.codes = &status_bits,
		.description = "State in bits",
	},
	{
		.name = "quality",
		.address = 4,
		.type = DB_U16,
		PROCESS(quality),
		.max = 192,
		.description = "Quality of the process data as in OPC: 0=bad 64=uncertain "
			       "192=good; good means online and not older than three cycles or "
			       "100 ms",
	},
	{
		.name = "active_command",
		.address = 5,
		.type = DB_U16,
		PROCESS(state.active_command),
		.description = "Oldest command that is not confirmed yet; 0=none; codes as in "
			       "command",
	},
	{
		.name = "age_ms",
		.address = 6,
		.type = DB_U32,
		PROCESS(age_ms),
		.unit = "ms",
		.description = "Age of the process data; 4294967295=never read",
	},
	{
		.name = "timestamp_us",
		.address = 8,
		.type = DB_U64,
		PROCESS(feedback.taken_wall_us),
		.flags = DB_ROW_MEASURED,
		.unit = "us",
		.description = "Moment of the process data since 1970-01-01 UTC",
	},
	{
		.name = "position",
		.address = 12,
		.type = DB_I32,
		PROCESS(feedback.position),
		.flags = DB_ROW_MEASURED,
		.unit = "counts",
		.description = "Actual position in the drive's own units",
	},
	{
		.name = "velocity",
		.address = 14,
		.type = DB_F32,
		PROCESS(feedback.velocity),
		.flags = DB_ROW_MEASURED,
		.unit = "counts/s",
		.description = "Actual velocity in the drive's own units; rpm on servo-can",
	},
	{
		.name = "position_units",
		.address = 16,
		.type = DB_F32,
		PROCESS(position_units),
		.flags = DB_ROW_MEASURED,
		.unit = "user units",
		.description = "Position divided by counts_per_unit; see unit_name",
	},
	{
		.name = "velocity_units",
		.address = 18,
		.type = DB_F32,
		PROCESS(velocity_units),
		.flags = DB_ROW_MEASURED,
		.unit = "user units/s",
		.description = "Velocity divided by counts_per_unit; see unit_name; without "
			       "meaning on servo-can where velocity is in rpm",
	},
	{
		.name = "drive_status",
		.address = 20,
		.type = DB_BITS32,
		PROCESS(feedback.drive_status),
		.flags = DB_ROW_MEASURED,
		.description = "The drive's own status word as its vendor documents it; its bits "
			       "are the discrete inputs drive_ from 64 on",
	},
	{
		.name = "result_id",
		.address = 22,
		.type = DB_U16,
		PROCESS(state.result_id),
		.description = "command_id of the latest command; 0=it had none. With "
			       "command-id-scope = client in the configuration this and the other "
			       "result registers and the status bits done and aborted are about "
			       "the latest command of the client address that reads; who has not "
			       "commanded this drive sees the latest of all",
	},
	{
		.name = "result",
		.address = 23,
		.type = DB_U16,
		PROCESS(state.result),
		.max = DB_RESULT_COUNT - 1,
		.codes = &results,
		.description = "How the latest command ended; of a motion: ok when the drive has "
			       "begun it and until it ends badly (see status bit done)",
	},
	{
		.name = "write_result",
		.address = 24,
		.type = DB_U16,
		PROCESS(state.write_result),
		.max = DB_RESULT_COUNT - 1,
		.description = "How the latest command or parameter write ended; codes as in "
			       "result",
	},
	{
		.name = "result_command",
		.address = 25,
		.type = DB_U16,
		PROCESS(state.result_command),
		.description = "The latest command; codes as in command",
	},
	{
		.name = "result_time_us",
		.address = 26,
		.type = DB_U32,
		PROCESS(state.result_time_us),
		.unit = "us",
		.description = "Time from the arrival of the last ended command to its end",
	},
	{
		.name = "capabilities",
		.address = 28,
		.type = DB_BITS32,
		PROCESS(capabilities),
		.codes = &capability_bits,
		.description = "What this drive can do",
	},
	{
		.name = "inputs",
		.address = 30,
		.type = DB_BITS16,
		PROCESS(feedback.inputs),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_INPUTS,
		.description = "Levels of the inputs; bit 0 = input 1",
	},
	{
		.name = "outputs",
		.address = 31,
		.type = DB_BITS16,
		PROCESS(feedback.outputs),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_OUTPUTS,
		.description = "Levels of the outputs; bit 0 = output 1",
	},
	{
		.name = "acceleration",
		.address = 32,
		.type = DB_F32,
		PARAMETER,
		.flags = DB_ROW_WRITABLE | DB_ROW_PARAM,
		.param_alias = offsetof(struct db_driver, acceleration_param) + 1,
		.description = "Acceleration: the parameter of the drive under a neutral name",
	},
	{
		.name = "deceleration",
		.address = 34,
		.type = DB_F32,
		PARAMETER,
		.flags = DB_ROW_WRITABLE | DB_ROW_PARAM,
		.param_alias = offsetof(struct db_driver, deceleration_param) + 1,
		.description = "Deceleration: the parameter of the drive under a neutral name",
	},
	{
		.name = "fault_bits",
		.address = 36,
		.type = DB_BITS32,
		PROCESS(feedback.fault_bits),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_FAULT_BITS,
		.description = "The drive's own fault word as its vendor documents it",
	},
	{
		.name = "current",
		.address = 38,
		.type = DB_F32,
		PROCESS(feedback.current),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_CURRENT,
		.unit = "A",
		.description = "Motor current",
	},
	{
		.name = "supply_voltage",
		.address = 40,
		.type = DB_F32,
		PROCESS(feedback.supply_voltage),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_SUPPLY_VOLTAGE,
		.unit = "V",
		.description = "Supply voltage",
	},
	{
		.name = "temperature",
		.address = 42,
		.type = DB_F32,
		PROCESS(feedback.temperature),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_TEMPERATURE,
		.unit = "degC",
		.description = "Temperature of the drive",
	},
	{
		.name = "program",
		.address = 44,
		.type = DB_U16,
		PROCESS(feedback.program),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_PROGRAM,
		.description = "Program that is running; 0=none",
	},
	{
		.name = "program_state",
		.address = 45,
		.type = DB_U16,
		PROCESS(feedback.program_state),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_PROGRAM,
		.description = "State of the program in the vendor's code",
	},
	{
		.name = "watchdog_ms",
		.address = 46,
		.type = DB_U32,
		PROCESS(state.watchdog_ms),
		.flags = DB_ROW_WRITABLE | DB_ROW_WATCHDOG,
		.unit = "ms",
		.max = DB_WATCHDOG_MAX_MS,
		.description = "Longest silence of the clients before the drive is stopped; "
			       "0=off; armed by the first motion command or when the drive "
			       "moves as it is first seen; fed as watchdog-feed in the "
			       "configuration says: by writes to this unit and by reads over "
			       "connections that have commanded the drive since it was armed "
			       "(commanders) or by each request of a client that may write "
			       "(requests) or only by writes (writes) or only by writes of a new "
			       "value to heartbeat (heartbeat)",
	},
	{
		.name = "watchdog_remaining_ms",
		.address = 48,
		.type = DB_U32,
		PROCESS(state.watchdog_remaining_ms),
		.unit = "ms",
		.description = "Time left before the watchdog stops the drive; 0=not armed",
	},
	{
		.name = "watchdog_trips",
		.address = 50,
		.type = DB_U32,
		PROCESS(state.watchdog_trips),
		.description = "How often the watchdog stopped the drive",
	},
	{
		.name = "analogue_1",
		.address = 52,
		.type = DB_U16,
		PROCESS(feedback.analogue_1),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_ANALOGUE,
		.description = "Analogue input 1 as the drive gives it",
	},
	{
		.name = "supply_voltage_raw",
		.address = 53,
		.type = DB_U16,
		PROCESS(feedback.supply_voltage_raw),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_RAW_HEALTH,
		.description = "Supply voltage as the drive gives it; see supply_voltage",
	},
	{
		.name = "temperature_raw",
		.address = 54,
		.type = DB_U16,
		PROCESS(feedback.temperature_raw),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_RAW_HEALTH,
		.description = "Temperature of the drive as it gives it; see temperature",
	},
	{
		.name = "program_step",
		.address = 55,
		.type = DB_U16,
		PROCESS(feedback.program_step),
		.flags = DB_ROW_MEASURED,
		.measure = DB_MEASURE_PROGRAM,
		.description = "Instruction of the program that is carried out",
	},
	{
		.name = "control_request",
		.address = 56,
		.type = DB_U16,
		PROCESS(control_request),
		.flags = DB_ROW_WRITABLE | DB_ROW_CONTROL,
		.max = 1,
		.description =
			"Control of the drive (control = drive in the configuration): "
			"write 1 to take it and 0 to let it go; reads 1 when the "
			"connection that reads has it. Any other write but a stop takes it "
			"too when nobody has it; while somebody has it others can only stop "
			"the drive (06; not_in_control). Lost with the connection or by "
			"silence; 1 from another connection of the same address takes it over",
	},
	{
		.name = "control_port",
		.address = 57,
		.type = DB_U16,
		PROCESS(control_port),
		.max = 65535,
		.description = "TCP port of the client that has control; 0=nobody",
	},
	{
		.name = "control_holder",
		.address = 58,
		.type = DB_U32,
		PROCESS(control_holder),
		.description = "IPv4 address of the client that has control; its first byte "
			       "highest; 0=nobody 4294967295=an IPv6 address: see the clients in "
			       "the gateway unit",
	},
	{
		.name = "control_remaining_ms",
		.address = 60,
		.type = DB_U32,
		PROCESS(control_remaining_ms),
		.unit = "ms",
		.description = "Time left before silence of the client that has control ends it; "
			       "each of its requests to this unit begins it again and so does a "
			       "heartbeat of the gateway unit that feeds this drive; 0=nobody",
	},
	{
		.name = "result_limit",
		.address = 62,
		.type = DB_U16,
		PROCESS(state.result_limit),
		.max = DB_LIMIT_COUNT - 1,
		.codes = &limits,
		.description = "Which limit of the configuration a command would have broken when "
			       "result is limit",
	},
	{
		.name = "aborted_id",
		.address = 63,
		.type = DB_U16,
		PROCESS(state.aborted_id),
		.max = 65535,
		.description = "command_id of the motion that was aborted when the status bit "
			       "aborted is set; with command-id-scope = client a motion of the "
			       "client that reads; whoever aborted it",
	},
	{
		.name = "motion_id",
		.address = 64,
		.type = DB_U16,
		PROCESS(state.motion_id),
		.max = 65535,
		.description = "command_id of the motion that the drive has begun last; with "
			       "command-id-scope = client of the client that reads; a motion that "
			       "is refused leaves it as it is",
	},
	{
		.name = "motion_result",
		.address = 65,
		.type = DB_U16,
		PROCESS(state.motion_result),
		.max = DB_RESULT_COUNT - 1,
		.codes = &results,
		.description = "What became of the motion of motion_id: pending while it goes on "
			       "and ok when it came to its end; cancelled when another command "
			       "ended it",
	},
	{
		.name = "heartbeat",
		.address = 66,
		.type = DB_U16,
		PROCESS(heartbeat),
		.flags = DB_ROW_WRITABLE | DB_ROW_HEARTBEAT,
		.max = 65535,
		.description = "Sign of life of the PLC's program (watchdog-feed = heartbeat in "
			       "the configuration): a new value feeds the watchdog when the same "
			       "address had written another one before; the same value again does "
			       "not; so one client only is to write it; reads the value written "
			       "last; see also heartbeat of the gateway unit",
	},
	{
		.name = "write_result_register",
		.address = 67,
		.type = DB_U16,
		PROCESS(state.write_register),
		.max = 65535,
		.description =
			"Address of the first register that the write of write_result was "
			"refused for; of coils the port's number (the coil's address plus 1); 0=it "
			"was not refused or not for one register or the drive did not say "
			"which",
	},
	{
		.name = "raw_answer_length",
		.address = 68,
		.type = DB_U16,
		DRIVE(DB_PART_PLATE, plate.raw_length),
		.measure = DB_MEASURE_RAW_ANSWER,
		.max = 2 * DB_RAW_ANSWER_WORDS,
		.description = "Bytes of the frame that answered the last raw_frame; 0=none came",
	},
	{
		.name = "raw_answer#",
		.address = 69,
		.type = DB_U16,
		DRIVE(DB_PART_PLATE, plate.raw_answer),
		.measure = DB_MEASURE_RAW_ANSWER,
		.repeat = { .count = DB_RAW_ANSWER_WORDS,
	                    .addresses = 1,
	                    .bytes = sizeof(uint16_t) },
		.max = 65535,
		.description = "Word # of that frame as it came; two bytes each with the first in "
			       "the high byte",
	},

	/* Drive view: the command block, at most 100 registers. */
	{
		.name = "command_id",
		.address = 100,
		.type = DB_U16,
		BLOCK(command_id),
		.flags = DB_ROW_WRITABLE,
		.max = 65535,
		.description = "Number of a command: 0=executes each time it is written; "
			       "other=executes when it differs from the drive's last one while "
			       "the same again is answered with the stored result; after the "
			       "bridge starts the first one is only remembered (restarted); with "
			       "command-id-scope = client in the configuration all this is for "
			       "each client address by itself (the last 8 that commanded); stop "
			       "and disable always execute; an id is used up by every outcome "
			       "except busy",
	},
	{
		.name = "command",
		.address = 101,
		.type = DB_U16,
		BLOCK(command),
		.flags = DB_ROW_WRITABLE,
		.max = DB_CMD_LIMIT - 1,
		.codes = &command_codes,
		.description = "Writing a code other than 0 executes it with the kept arguments. "
			       "Written without command_id it uses the kept id if that is unused; "
			       "the same command and arguments under a used id are the same "
			       "request again; anything else executes as if the id were 0",
	},
	{
		.name = "target_position",
		.address = 102,
		.type = DB_I32,
		BLOCK(args.target_position),
		.flags = DB_ROW_WRITABLE,
		.unit = "counts",
		.min = INT32_MIN,
		.max = INT32_MAX,
		.description = "Target or distance in the drive's own units",
	},
	{
		.name = "target_velocity",
		.address = 104,
		.type = DB_F32,
		BLOCK(args.target_velocity),
		.flags = DB_ROW_WRITABLE,
		.unit = "counts/s",
		.description = "Velocity in the drive's own units; rpm on servo-can; 0 in a "
			       "position move = the drive's preset speed",
	},
	{
		.name = "output_number",
		.address = 106,
		.type = DB_U16,
		BLOCK(args.output_number),
		.flags = DB_ROW_WRITABLE,
		.max = 65535,
		.description = "Output port from 1",
	},
	{
		.name = "output_value",
		.address = 107,
		.type = DB_U16,
		BLOCK(args.output_value),
		.flags = DB_ROW_WRITABLE,
		.max = 65535,
		.description = "Level 0 or 1; or the duty of a PWM port 0..255",
	},
	{
		.name = "output_mask",
		.address = 108,
		.type = DB_BITS16,
		BLOCK(args.output_mask),
		.flags = DB_ROW_WRITABLE,
		.description = "Ports that set_outputs changes; bit 0 = port 1",
	},
	{
		.name = "output_levels",
		.address = 109,
		.type = DB_BITS16,
		BLOCK(args.output_levels),
		.flags = DB_ROW_WRITABLE,
		.description = "Their levels; bit 0 = port 1",
	},
	{
		.name = "shake_start_position",
		.address = 110,
		.type = DB_I32,
		BLOCK(args.shake_start_position),
		.flags = DB_ROW_WRITABLE,
		.unit = "counts",
		.min = INT32_MIN,
		.max = INT32_MAX,
		.description = "One end of the swing",
	},
	{
		.name = "shake_end_position",
		.address = 112,
		.type = DB_I32,
		BLOCK(args.shake_end_position),
		.flags = DB_ROW_WRITABLE,
		.unit = "counts",
		.min = INT32_MIN,
		.max = INT32_MAX,
		.description = "The other end of the swing",
	},
	{
		.name = "shake_frequency",
		.address = 114,
		.type = DB_F32,
		BLOCK(args.shake_frequency),
		.flags = DB_ROW_WRITABLE,
		.unit = "Hz",
		.description = "Frequency of the swing; the range is the family's",
	},
	{
		.name = "shake_cycles",
		.address = 116,
		.type = DB_U32,
		BLOCK(args.shake_cycles),
		.flags = DB_ROW_WRITABLE,
		.max = INT32_MAX,
		.description = "Number of cycles; 0=until stopped",
	},
	{
		.name = "shake_time",
		.address = 118,
		.type = DB_U32,
		BLOCK(args.shake_time),
		.flags = DB_ROW_WRITABLE,
		.unit = "s",
		.max = INT32_MAX,
		.description = "Duration; 0=until stopped",
	},
	{
		.name = "target_current",
		.address = 120,
		.type = DB_F32,
		BLOCK(args.target_current),
		.flags = DB_ROW_WRITABLE,
		.unit = "A",
		.description = "Motor current; its sign is the direction of the torque",
	},
	{
		.name = "program_number",
		.address = 122,
		.type = DB_U16,
		BLOCK(args.program_number),
		.flags = DB_ROW_WRITABLE,
		.max = 65535,
		.description = "Program of start_program",
	},
	{
		.name = "program_delay",
		.address = 123,
		.type = DB_U16,
		BLOCK(args.program_delay),
		.flags = DB_ROW_WRITABLE,
		.unit = "s",
		.max = 65535,
		.description = "From start_program to the program's begin",
	},
	{
		.name = "staged_command",
		.address = 124,
		.type = DB_U16,
		BLOCK(staged_command),
		.flags = DB_ROW_WRITABLE,
		.max = DB_CMD_LIMIT - 1,
		.codes = &command_codes,
		.description = "A command that waits for group_start of the gateway and takes the "
			       "arguments of then; writing it executes nothing; 0=none",
	},
	{
		.name = "raw_length",
		.address = 125,
		.type = DB_U16,
		BLOCK(args.raw_length),
		.flags = DB_ROW_WRITABLE,
		.max = 2 * DB_RAW_REQUEST_WORDS,
		.description = "Bytes of a frame for raw_frame",
	},
	{
		.name = "raw_request#",
		.address = 126,
		.type = DB_U16,
		BLOCK(args.raw_request),
		.flags = DB_ROW_WRITABLE,
		.repeat = { .count = DB_RAW_REQUEST_WORDS,
	                    .addresses = 1,
	                    .bytes = sizeof(uint16_t) },
		.max = 65535,
		.description = "Word # of that frame; two bytes each with the first in the high "
			       "byte; what of it the bridge adds is the family's",
	},

	/* Drive view: diagnostics. */
	{
		.name = "identity",
		.address = 1000,
		.type = DB_TEXT,
		DRIVE(DB_PART_PLATE, plate.identity),
		.registers = DB_IDENTITY_REGISTERS,
		.description = "The drive's own description of itself; two characters a register; "
			       "zeros after its end; all zero = not read yet",
	},
	{
		.name = "bus",
		.address = 1020,
		.type = DB_U16,
		DRIVE(DB_PART_STATIC, bus),
		.description = "Number of the drive's bus from 1 in the order of the "
			       "configuration",
	},
	{
		.name = "address",
		.address = 1021,
		.type = DB_U16,
		DRIVE(DB_PART_STATIC, address),
		.description = "The drive's address on its bus; 0 on RS232",
	},
	{
		.name = "unit_name",
		.address = 1022,
		.type = DB_TEXT,
		DRIVE(DB_PART_STATIC, unit_name),
		.registers = DB_UNIT_NAME_REGISTERS,
		.description = "Name of the user units",
	},
	{
		.name = "counts_per_unit",
		.address = 1030,
		.type = DB_F32,
		DRIVE(DB_PART_STATIC, counts_per_unit),
		.unit = "counts",
		.description = "The drive's own units per user unit",
	},
	{
		.name = "requests",
		.address = 1032,
		.type = DB_U32,
		PROCESS(stats.requests),
		.description = "Requests sent to the drive",
	},
	{
		.name = "answers",
		.address = 1034,
		.type = DB_U32,
		PROCESS(stats.answers),
		.description = "Answers received from it",
	},
	{
		.name = "timeouts",
		.address = 1036,
		.type = DB_U32,
		PROCESS(stats.timeouts),
		.description = "Answers that did not come in time",
	},
	{
		.name = "retries",
		.address = 1038,
		.type = DB_U32,
		PROCESS(stats.retries),
		.description = "Requests repeated",
	},
	{
		.name = "bad_frames",
		.address = 1040,
		.type = DB_U32,
		PROCESS(stats.bad_frames),
		.description = "Answers with a wrong checksum or form",
	},
	{
		.name = "refusals",
		.address = 1042,
		.type = DB_U32,
		PROCESS(stats.refusals),
		.description = "Commands that the drive refused",
	},
	{
		.name = "came_online",
		.address = 1044,
		.type = DB_U32,
		PROCESS(stats.came_online),
		.description = "How often it came online",
	},
	{
		.name = "round_trip_us",
		.address = 1046,
		.type = DB_U32,
		PROCESS(stats.round_trip_us),
		.unit = "us",
		.description = "Last round trip: first byte out to last byte in",
	},
	{
		.name = "round_trip_min_us",
		.address = 1048,
		.type = DB_U32,
		PROCESS(stats.round_trip_min_us),
		.unit = "us",
		.description = "Shortest round trip",
	},
	{
		.name = "round_trip_max_us",
		.address = 1050,
		.type = DB_U32,
		PROCESS(stats.round_trip_max_us),
		.unit = "us",
		.description = "Longest round trip",
	},
	{
		.name = "round_trip_mean_us",
		.address = 1052,
		.type = DB_U32,
		PROCESS(stats.round_trip_mean_us),
		.unit = "us",
		.description = "Mean round trip since the bridge started",
	},
	{
		.name = "parameters_generation",
		.address = 1054,
		.type = DB_U32,
		DRIVE(DB_PART_PLATE, plate.generation),
		.description = "Grows whenever identity or a parameter changes",
	},

	/* Drive view: the last commands. */
	{
		.name = "history#_timestamp_us",
		.address = 3000,
		.type = DB_U64,
		HISTORY(entry.timestamp_us),
		.repeat = EACH_HISTORY,
		.description = "Command # (1 is the newest): when it arrived; us since "
			       "1970-01-01 UTC; 0=there is none",
	},
	{
		.name = "history#_sequence",
		.address = 3004,
		.type = DB_U32,
		HISTORY(entry.sequence),
		.repeat = EACH_HISTORY,
		.description = "Command #: its number since the bridge started",
	},
	{
		.name = "history#_ipv4",
		.address = 3006,
		.type = DB_U32,
		HISTORY(ipv4),
		.repeat = EACH_HISTORY,
		.description = "Command #: IPv4 address of the client with its first byte "
			       "highest; 0=the bridge itself 4294967295=see history#_address",
	},
	{
		.name = "history#_port",
		.address = 3008,
		.type = DB_U16,
		HISTORY(entry.port),
		.repeat = EACH_HISTORY,
		.max = 65535,
		.description = "Command #: TCP port of the client",
	},
	{
		.name = "history#_command_id",
		.address = 3009,
		.type = DB_U16,
		HISTORY(entry.command_id),
		.repeat = EACH_HISTORY,
		.max = 65535,
		.description = "Command #: as command_id",
	},
	{
		.name = "history#_command",
		.address = 3010,
		.type = DB_U16,
		HISTORY(entry.command),
		.repeat = EACH_HISTORY,
		.description = "Command #: as command; 0=a parameter write",
	},
	{
		.name = "history#_result",
		.address = 3011,
		.type = DB_U16,
		HISTORY(entry.result),
		.repeat = EACH_HISTORY,
		.description = "Command #: as result; of a motion that ended: cancelled when "
			       "another command ended it",
	},
	{
		.name = "history#_duration_us",
		.address = 3012,
		.type = DB_U32,
		HISTORY(entry.duration_us),
		.repeat = EACH_HISTORY,
		.unit = "us",
		.description = "Command #: time from its arrival to its result; of a motion "
			       "with an end to that",
	},
	{
		.name = "history#_position",
		.address = 3014,
		.type = DB_I32,
		HISTORY(entry.position),
		.repeat = EACH_HISTORY,
		.unit = "counts",
		.description = "Command #: its target_position or shake_start_position",
	},
	{
		.name = "history#_position_2",
		.address = 3016,
		.type = DB_I32,
		HISTORY(entry.position_2),
		.repeat = EACH_HISTORY,
		.unit = "counts",
		.description = "Command #: its shake_end_position",
	},
	{
		.name = "history#_real",
		.address = 3018,
		.type = DB_F32,
		HISTORY(entry.real),
		.repeat = EACH_HISTORY,
		.description = "Command #: its target_velocity or target_current or "
			       "shake_frequency",
	},
	{
		.name = "history#_number",
		.address = 3020,
		.type = DB_U16,
		HISTORY(entry.number),
		.repeat = EACH_HISTORY,
		.description = "Command #: its output_number or output_mask or program_number; "
			       "of a parameter write the first parameter's register",
	},
	{
		.name = "history#_repeats",
		.address = 3021,
		.type = DB_U16,
		HISTORY(entry.repeats),
		.repeat = EACH_HISTORY,
		.description = "Command #: how often the same came again: a refused one from "
			       "the same client or a stop that was under way",
	},
	{
		.name = "history#_value",
		.address = 3022,
		.type = DB_U32,
		HISTORY(entry.value),
		.repeat = EACH_HISTORY,
		.description = "Command #: its output_value or output_levels or shake_cycles or "
			       "shake_time or program_delay; of a parameter write the first "
			       "value in bits",
	},
	{
		.name = "history#_address",
		.address = 4000,
		.type = DB_TEXT,
		.registers = DB_CLIENT_ADDRESS_REGISTERS,
		HISTORY(address),
		.repeat = EACH_HISTORY_TEXT,
		.description = "Command #: address of the client; empty=the bridge itself",
	},

	/* Drive view: bits. */
	{
		.name = "status_#",
		.view = DB_VIEW_DRIVE,
		.table = DB_TABLE_DISCRETE,
		.address = 0,
		.type = DB_U32,
		.part = DB_PART_PROCESS,
		.offset = offsetof(struct db_drive_image, status),
		.repeat = { .count = DB_STATUS_BIT_COUNT,
	                    .addresses = 1,
	                    .name = db_status_bit_name },
		.max = 1,
		.description = "Bit of the status register",
	},
	{
		.name = "input_#",
		.view = DB_VIEW_DRIVE,
		.table = DB_TABLE_DISCRETE,
		.address = 32,
		.type = DB_U16,
		.flags = DB_ROW_MEASURED,
		.part = DB_PART_PROCESS,
		.measure = DB_MEASURE_INPUTS,
		.offset = offsetof(struct db_drive_image, feedback.inputs),
		.repeat = { .count = 16, .addresses = 1 },
		.max = 1,
		.description = "Level of input #",
	},
	{
		.name = "drive_#",
		.view = DB_VIEW_DRIVE,
		.table = DB_TABLE_DISCRETE,
		.address = 64,
		.type = DB_U32,
		.flags = DB_ROW_MEASURED,
		.part = DB_PART_PROCESS,
		.named_bits = true,
		.offset = offsetof(struct db_drive_image, feedback.drive_status),
		.repeat = { .count = 32, .addresses = 1 },
		.max = 1,
		.description = "Bit of drive_status",
	},
	{
		.name = "output_#",
		.view = DB_VIEW_DRIVE,
		.table = DB_TABLE_COILS,
		.address = 0,
		.type = DB_U16,
		.flags = DB_ROW_MEASURED | DB_ROW_WRITABLE,
		.part = DB_PART_PROCESS,
		.outputs = true,
		.offset = offsetof(struct db_drive_image, feedback.outputs),
		.repeat = { .count = 16, .addresses = 1 },
		.max = 1,
		.description =
			"Level of output #; writing several at once is one set_outputs without id",
	},

	/* Gateway view. */
	{
		.name = "version_major",
		.address = 0,
		.type = DB_U16,
		GATEWAY(version_major),
		.description = "Version of drivebridge: first number",
	},
	{
		.name = "version_minor",
		.address = 1,
		.type = DB_U16,
		GATEWAY(version_minor),
		.description = "Version of drivebridge: second number",
	},
	{
		.name = "version_patch",
		.address = 2,
		.type = DB_U16,
		GATEWAY(version_patch),
		.description = "Version of drivebridge: third number",
	},
	{
		.name = "bus_count",
		.address = 3,
		.type = DB_U16,
		GATEWAY(bus_count),
		.description = "Buses in the configuration",
	},
	{
		.name = "drive_count",
		.address = 4,
		.type = DB_U16,
		GATEWAY(drive_count),
		.description = "Drives in the configuration",
	},
	{
		.name = "drives_online",
		.address = 5,
		.type = DB_U16,
		GATEWAY(drives_online),
		.description = "Drives online",
	},
	{
		.name = "uptime_s",
		.address = 6,
		.type = DB_U32,
		GATEWAY(uptime_s),
		.unit = "s",
		.description = "Time since the bridge started",
	},
	{
		.name = "clients",
		.address = 8,
		.type = DB_U32,
		GATEWAY(clients),
		.description = "Modbus TCP clients connected",
	},
	{
		.name = "clients_peak",
		.address = 10,
		.type = DB_U32,
		GATEWAY(clients_peak),
		.description = "The most there were at once",
	},
	{
		.name = "accepted",
		.address = 12,
		.type = DB_U32,
		GATEWAY(accepted),
		.description = "Connections accepted",
	},
	{
		.name = "refused_full",
		.address = 14,
		.type = DB_U32,
		GATEWAY(refused_full),
		.description = "Connections refused because max-clients was reached",
	},
	{
		.name = "refused_address",
		.address = 16,
		.type = DB_U32,
		GATEWAY(refused_address),
		.description = "Connections refused because of the address",
	},
	{
		.name = "refused_writes",
		.address = 18,
		.type = DB_U32,
		GATEWAY(refused_writes),
		.description = "Writes refused because the client may only read",
	},
	{
		.name = "requests",
		.address = 20,
		.type = DB_U32,
		GATEWAY(requests),
		.description = "Requests received",
	},
	{
		.name = "exceptions",
		.address = 22,
		.type = DB_U32,
		GATEWAY(exceptions),
		.description = "Exceptions answered",
	},
	{
		.name = "bad_frames",
		.address = 24,
		.type = DB_U32,
		GATEWAY(bad_frames),
		.description = "Connections closed for what cannot be Modbus",
	},
	{
		.name = "timeouts",
		.address = 26,
		.type = DB_U32,
		GATEWAY(timeouts),
		.description = "Connections closed for an unfinished frame or idling",
	},
	{
		.name = "refused_reserved",
		.address = 28,
		.type = DB_U32,
		GATEWAY(refused_reserved),
		.description = "Connections refused because the client may only read and the "
			       "places left are reserved-writers",
	},
	{
		.name = "refused_per_address",
		.address = 30,
		.type = DB_U32,
		GATEWAY(refused_per_address),
		.description = "Connections refused because max-clients-per-address was reached",
	},
	{
		.name = "refused_control",
		.address = 32,
		.type = DB_U32,
		GATEWAY(refused_control),
		.description = "Writes refused because another client has control of the drive",
	},
	{
		.name = "held_back",
		.address = 34,
		.type = DB_U32,
		GATEWAY(held_back),
		.description = "Requests that were answered later because of "
			       "max-requests-per-second",
	},

	/* Gateway view: commands to many drives in one write. */
	{
		.name = "group_stop",
		.address = 60,
		.type = DB_U16,
		GATEWAY_GROUP(group_stop),
		.flags = DB_ROW_WRITABLE,
		.max = 3,
		.description = "Written 1=stop 2=quick_stop 3=disable: every drive of every bus; "
			       "answered when all have confirmed; reads 0",
	},
	{
		.name = "group_start",
		.address = 61,
		.type = DB_U16,
		GATEWAY_GROUP(group_start),
		.flags = DB_ROW_WRITABLE,
		.max = 1,
		.description = "Written 1: starts every drive's staged_command; answered when all "
			       "have confirmed; reads 0",
	},
	{
		.name = "group_staged",
		.address = 62,
		.type = DB_U16,
		GATEWAY_GROUP(group_staged),
		.description = "Drives with a staged_command",
	},
	{
		.name = "group_drives",
		.address = 63,
		.type = DB_U16,
		GATEWAY_GROUP(group_drives),
		.description = "Drives of the latest group command",
	},
	{
		.name = "group_result",
		.address = 64,
		.type = DB_U16,
		GATEWAY_GROUP(group_result),
		.description = "Highest exception code of its drives so far; 0=none; each drive's "
			       "own result tells more",
	},
	{
		.name = "group_busy",
		.address = 65,
		.type = DB_U16,
		GATEWAY_GROUP(group_busy),
		.description = "1=some drive has not ended its part yet",
	},
	{
		.name = "group_skew_us",
		.address = 66,
		.type = DB_U32,
		GATEWAY_GROUP(group_skew_us),
		.unit = "us",
		.description = "From the first to the last drive's command on the wire",
	},
	{
		.name = "heartbeat",
		.address = 68,
		.type = DB_U16,
		GATEWAY_GROUP(heartbeat),
		.flags = DB_ROW_WRITABLE | DB_ROW_HEARTBEAT,
		.max = 65535,
		.description = "For PLCs with one unit id only: a new value is like one in the "
			       "heartbeat of every drive with watchdog-feed = heartbeat; with "
			       "control = drive of those that the client controls; reads the "
			       "value written last",
	},

	{
		.name = "group_units#",
		.address = 70,
		.type = DB_BITS16,
		GATEWAY_GROUP(group_units),
		.flags = DB_ROW_WRITABLE | DB_ROW_LIST,
		.repeat = { .count = DB_GROUP_WORDS, .addresses = 1, .bytes = sizeof(uint16_t) },
		.description =
			"Units that group_stop_units is for: bit 0 of group_units1 is unit 1 "
			"and bit 15 of group_units16 would be unit 256; kept until they are "
			"written again",
	},
	{
		.name = "group_stop_units",
		.address = 86,
		.type = DB_U16,
		GATEWAY_GROUP(group_stop_units),
		.flags = DB_ROW_WRITABLE | DB_ROW_LIST,
		.max = 3,
		.description = "As group_stop for the units of group_units; best written with them "
			       "in one request; 0A when some of them have no drive but the others "
			       "are stopped all the same; reads 0",
	},

	/* Gateway view: a block for each bus. */
	{
		.name = "bus#_up",
		.address = 100,
		.type = DB_U16,
		GATEWAY_BUS(up),
		.repeat = EACH_BUS,
		.description = "Port of bus #: 0=closed 1=open; only the first 8 buses have "
			       "registers",
	},
	{
		.name = "bus#_last_error",
		.address = 101,
		.type = DB_U16,
		GATEWAY_BUS(last_error),
		.repeat = EACH_BUS,
		.description = "Bus #: errno of the last failed open or lost port; 0=none",
	},
	{
		.name = "bus#_period_us",
		.address = 102,
		.type = DB_U32,
		GATEWAY_BUS(period_us),
		.unit = "us",
		.repeat = EACH_BUS,
		.description = "Bus #: configured cycle",
	},
	{
		.name = "bus#_cycle_us",
		.address = 104,
		.type = DB_U32,
		GATEWAY_BUS(cycle_us),
		.unit = "us",
		.repeat = EACH_BUS,
		.description = "Bus #: time the last cycle took",
	},
	{
		.name = "bus#_cycle_max_us",
		.address = 106,
		.type = DB_U32,
		GATEWAY_BUS(cycle_max_us),
		.unit = "us",
		.repeat = EACH_BUS,
		.description = "Bus #: longest cycle",
	},
	{
		.name = "bus#_jitter_us",
		.address = 108,
		.type = DB_U32,
		GATEWAY_BUS(jitter_us),
		.unit = "us",
		.repeat = EACH_BUS,
		.description = "Bus #: lateness of the last cycle's start",
	},
	{
		.name = "bus#_jitter_max_us",
		.address = 110,
		.type = DB_U32,
		GATEWAY_BUS(jitter_max_us),
		.unit = "us",
		.repeat = EACH_BUS,
		.description = "Bus #: largest lateness",
	},
	{
		.name = "bus#_utilisation",
		.address = 112,
		.type = DB_U32,
		GATEWAY_BUS(utilisation),
		.unit = "permille",
		.repeat = EACH_BUS,
		.description = "Bus #: part of the last second in which the wire was busy or "
			       "waited for",
	},
	{
		.name = "bus#_cycles",
		.address = 114,
		.type = DB_U32,
		GATEWAY_BUS(cycles),
		.repeat = EACH_BUS,
		.description = "Bus #: cycles run",
	},
	{
		.name = "bus#_overruns",
		.address = 116,
		.type = DB_U32,
		GATEWAY_BUS(overruns),
		.repeat = EACH_BUS,
		.description = "Bus #: cycles that had not ended when the next was due",
	},
	{
		.name = "bus#_transactions",
		.address = 118,
		.type = DB_U32,
		GATEWAY_BUS(transactions),
		.repeat = EACH_BUS,
		.description = "Bus #: exchanges on the wire",
	},
	{
		.name = "bus#_retries",
		.address = 120,
		.type = DB_U32,
		GATEWAY_BUS(retries),
		.repeat = EACH_BUS,
		.description = "Bus #: exchanges repeated",
	},
	{
		.name = "bus#_timeouts",
		.address = 122,
		.type = DB_U32,
		GATEWAY_BUS(timeouts),
		.repeat = EACH_BUS,
		.description = "Bus #: answers that did not come in time",
	},
	{
		.name = "bus#_bad_frames",
		.address = 124,
		.type = DB_U32,
		GATEWAY_BUS(bad_frames),
		.repeat = EACH_BUS,
		.description = "Bus #: frames with a wrong checksum or form",
	},
	{
		.name = "bus#_stray_frames",
		.address = 126,
		.type = DB_U32,
		GATEWAY_BUS(stray_frames),
		.repeat = EACH_BUS,
		.description = "Bus #: good frames that nobody had asked for",
	},
	{
		.name = "bus#_garbage_bytes",
		.address = 128,
		.type = DB_U32,
		GATEWAY_BUS(garbage_bytes),
		.repeat = EACH_BUS,
		.description = "Bus #: bytes outside of frames",
	},
	{
		.name = "bus#_opens",
		.address = 130,
		.type = DB_U32,
		GATEWAY_BUS(opens),
		.repeat = EACH_BUS,
		.description = "Bus #: how often the port was opened",
	},
	{
		.name = "bus#_queued",
		.address = 132,
		.type = DB_U32,
		GATEWAY_BUS(queued),
		.repeat = EACH_BUS,
		.description = "Bus #: commands waiting now",
	},
	{
		.name = "bus#_online",
		.address = 134,
		.type = DB_U32,
		GATEWAY_BUS(online),
		.repeat = EACH_BUS,
		.description = "Bus #: drives online now",
	},

	{
		.name = "bus#_reports",
		.address = 136,
		.type = DB_U32,
		GATEWAY_BUS(reports),
		.repeat = EACH_BUS,
		.description = "Bus #: frames that drives sent by themselves and that were used",
	},

	/* Gateway view: what adapters and controllers tell of each bus's line. */
	{
		.name = "line#_state",
		.address = 440,
		.type = DB_BITS16,
		GATEWAY_BUS(line_state),
		.repeat = EACH_LINE,
		.description = "Line of bus #: bit 0 carries frames; 1 bus off; 2 error passive; "
			       "3 error warning",
	},
	{
		.name = "line#_error",
		.address = 441,
		.type = DB_U16,
		GATEWAY_BUS(line_error),
		.repeat = EACH_LINE,
		.description = "Line of bus #: errno of what keeps an open port from carrying "
			       "frames; 0=none",
	},
	{
		.name = "line#_bus_offs",
		.address = 442,
		.type = DB_U32,
		GATEWAY_BUS(bus_offs),
		.repeat = EACH_LINE,
		.description = "Line of bus #: times the CAN controller went bus off",
	},
	{
		.name = "line#_error_passives",
		.address = 444,
		.type = DB_U32,
		GATEWAY_BUS(error_passives),
		.repeat = EACH_LINE,
		.description = "Line of bus #: times the CAN controller became error passive",
	},
	{
		.name = "line#_arbitration_lost",
		.address = 446,
		.type = DB_U32,
		GATEWAY_BUS(arbitration_lost),
		.repeat = EACH_LINE,
		.description =
			"Line of bus #: frames that lost arbitration as far as the controller reports it",
	},
	{
		.name = "line#_line_errors",
		.address = 448,
		.type = DB_U32,
		GATEWAY_BUS(line_errors),
		.repeat = EACH_LINE,
		.description = "Line of bus #: stuff form CRC and acknowledge errors on the wire",
	},
	{
		.name = "line#_overflows",
		.address = 450,
		.type = DB_U32,
		GATEWAY_BUS(overflows),
		.repeat = EACH_LINE,
		.description = "Line of bus #: frames lost in the controller or adapter",
	},
	{
		.name = "line#_refused",
		.address = 452,
		.type = DB_U32,
		GATEWAY_BUS(refused),
		.repeat = EACH_LINE,
		.description = "Line of bus #: frames or settings that the adapter refused",
	},
	{
		.name = "line#_bitrate",
		.address = 454,
		.type = DB_U32,
		GATEWAY_BUS(bitrate),
		.unit = "bit/s",
		.repeat = EACH_LINE,
		.description = "Line of bus #: bit rate that the interface is set to; 0=not known",
	},

	/* Gateway view: who is connected. */
	{
		.name = "client#_ipv4",
		.address = 700,
		.type = DB_U32,
		GATEWAY_CLIENT(ipv4),
		.repeat = EACH_CLIENT,
		.description = "IPv4 address of client # with its first byte highest; 0=none "
			       "4294967295=see client#_address; the 16 clients that are connected "
			       "longest have registers",
	},
	{
		.name = "client#_port",
		.address = 702,
		.type = DB_U16,
		GATEWAY_CLIENT(port),
		.max = 65535,
		.repeat = EACH_CLIENT,
		.description = "Client #: its TCP port",
	},
	{
		.name = "client#_may_write",
		.address = 703,
		.type = DB_U16,
		GATEWAY_CLIENT(may_write),
		.max = 1,
		.repeat = EACH_CLIENT,
		.description = "Client #: 1=it may write",
	},
	{
		.name = "client#_requests",
		.address = 704,
		.type = DB_U32,
		GATEWAY_CLIENT(requests),
		.repeat = EACH_CLIENT,
		.description = "Client #: requests received",
	},
	{
		.name = "client#_idle_s",
		.address = 706,
		.type = DB_U32,
		GATEWAY_CLIENT(idle_s),
		.unit = "s",
		.repeat = EACH_CLIENT,
		.description = "Client #: time since the last byte in either direction",
	},
	{
		.name = "client#_connected_s",
		.address = 708,
		.type = DB_U32,
		GATEWAY_CLIENT(connected_s),
		.unit = "s",
		.repeat = EACH_CLIENT,
		.description = "Client #: time since it connected",
	},
	{
		.name = "client#_controls",
		.address = 710,
		.type = DB_BITS32,
		GATEWAY_CLIENT(controls),
		.repeat = EACH_CLIENT,
		.description = "Client #: drives that it has control of; bit 0 = the first drive "
			       "of the configuration",
	},

	/* Gateway view: a block for each drive. */
	{
		.name = "drive#_unit",
		.address = 1000,
		.type = DB_U16,
		GATEWAY_DRIVE(unit),
		.repeat = EACH_DRIVE,
		.description = "Modbus unit of drive #; only the first 32 drives have registers "
			       "here",
	},
	{
		.name = "drive#_online",
		.address = 1001,
		.type = DB_U16,
		GATEWAY_DRIVE(online),
		.repeat = EACH_DRIVE,
		.description = "Drive #: 1=online",
	},
	{
		.name = "drive#_axis_state",
		.address = 1002,
		.type = DB_U16,
		GATEWAY_DRIVE(axis_state),
		.repeat = EACH_DRIVE,
		.description = "Drive #: as axis_state",
	},
	{
		.name = "drive#_error",
		.address = 1003,
		.type = DB_U16,
		GATEWAY_DRIVE(error),
		.repeat = EACH_DRIVE,
		.description = "Drive #: as error",
	},
	{
		.name = "drive#_age_ms",
		.address = 1004,
		.type = DB_U32,
		GATEWAY_DRIVE(age_ms),
		.unit = "ms",
		.repeat = EACH_DRIVE,
		.description = "Drive #: age of its process data",
	},
	{
		.name = "drive#_round_trip_us",
		.address = 1006,
		.type = DB_U32,
		GATEWAY_DRIVE(stats.round_trip_us),
		.unit = "us",
		.repeat = EACH_DRIVE,
		.description = "Drive #: last round trip",
	},
	{
		.name = "drive#_round_trip_max_us",
		.address = 1008,
		.type = DB_U32,
		GATEWAY_DRIVE(stats.round_trip_max_us),
		.unit = "us",
		.repeat = EACH_DRIVE,
		.description = "Drive #: longest round trip",
	},
	{
		.name = "drive#_requests",
		.address = 1010,
		.type = DB_U32,
		GATEWAY_DRIVE(stats.requests),
		.repeat = EACH_DRIVE,
		.description = "Drive #: requests sent",
	},
	{
		.name = "drive#_retries",
		.address = 1012,
		.type = DB_U32,
		GATEWAY_DRIVE(stats.retries),
		.repeat = EACH_DRIVE,
		.description = "Drive #: requests repeated",
	},
	{
		.name = "drive#_timeouts",
		.address = 1014,
		.type = DB_U32,
		GATEWAY_DRIVE(stats.timeouts),
		.repeat = EACH_DRIVE,
		.description = "Drive #: answers that did not come in time",
	},
	/* Gateway view: the clients' addresses as text. */
	{
		.name = "client#_address",
		.address = 1520,
		.type = DB_TEXT,
		.registers = DB_CLIENT_ADDRESS_REGISTERS,
		GATEWAY_CLIENT(address),
		.repeat = EACH_CLIENT_TEXT,
		.description = "Client #: its address; empty=none",
	},

	/* Gateway view: the flat window, a block of process data for each drive. */
	{
		.name = "window#_unit",
		.address = 2000,
		.type = DB_U16,
		GATEWAY_WINDOW(unit),
		.repeat = EACH_WINDOW,
		.description = "Modbus unit of drive #; every drive has a window",
	},
	{
		.name = "window#_online",
		.address = 2001,
		.type = DB_U16,
		GATEWAY_WINDOW(online),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: 1=online",
	},
	{
		.name = "window#_axis_state",
		.address = 2002,
		.type = DB_U16,
		GATEWAY_WINDOW(axis_state),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as axis_state; Offline while it is not online",
	},
	{
		.name = "window#_error",
		.address = 2003,
		.type = DB_U16,
		GATEWAY_WINDOW(error),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as error",
	},
	{
		.name = "window#_status",
		.address = 2004,
		.type = DB_BITS32,
		GATEWAY_WINDOW(status),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as status",
	},
	{
		.name = "window#_quality",
		.address = 2006,
		.type = DB_U16,
		GATEWAY_WINDOW(quality),
		.repeat = EACH_WINDOW,
		.description =
			"Window of drive #: as quality; 0=bad: position and velocity are the last known",
	},
	{
		.name = "window#_active_command",
		.address = 2007,
		.type = DB_U16,
		GATEWAY_WINDOW(active_command),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as active_command",
	},
	{
		.name = "window#_age_ms",
		.address = 2008,
		.type = DB_U32,
		GATEWAY_WINDOW(age_ms),
		.unit = "ms",
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: age of its process data",
	},
	{
		.name = "window#_position",
		.address = 2010,
		.type = DB_I32,
		GATEWAY_WINDOW(position),
		.unit = "counts",
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as position",
	},
	{
		.name = "window#_velocity",
		.address = 2012,
		.type = DB_F32,
		GATEWAY_WINDOW(velocity),
		.unit = "counts/s",
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as velocity",
	},
	{
		.name = "window#_position_units",
		.address = 2014,
		.type = DB_F32,
		GATEWAY_WINDOW(position_units),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as position_units",
	},
	{
		.name = "window#_velocity_units",
		.address = 2016,
		.type = DB_F32,
		GATEWAY_WINDOW(velocity_units),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as velocity_units",
	},
	{
		.name = "window#_drive_status",
		.address = 2018,
		.type = DB_BITS32,
		GATEWAY_WINDOW(drive_status),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as drive_status",
	},
	{
		.name = "window#_result_id",
		.address = 2020,
		.type = DB_U16,
		GATEWAY_WINDOW(result_id),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as result_id",
	},
	{
		.name = "window#_result",
		.address = 2021,
		.type = DB_U16,
		GATEWAY_WINDOW(result),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as result",
	},
	{
		.name = "window#_inputs",
		.address = 2022,
		.type = DB_BITS16,
		GATEWAY_WINDOW(inputs),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as inputs",
	},
	{
		.name = "window#_outputs",
		.address = 2023,
		.type = DB_BITS16,
		GATEWAY_WINDOW(outputs),
		.repeat = EACH_WINDOW,
		.description = "Window of drive #: as outputs",
	},
};

const size_t db_row_count = COUNT_OF(db_rows);

/* --- areas ------------------------------------------------------------------------------------------- */

#define AREA(of, in, from, to, title)                                                       \
	{                                                                                   \
		.name = (title), .view = (of), .table = (in), .first = (from), .last = (to) \
	}
#define HOLDING_AREA(of, from, to, title) AREA(of, DB_TABLE_HOLDING, from, to, title)
#define PARAM_AREA(page)                                                    \
	HOLDING_AREA(DB_VIEW_DRIVE, DB_PARAM_BASE + DB_PARAM_PAGE * (page), \
	             DB_PARAM_BASE + DB_PARAM_PAGE * ((page) + 1) - 1, "parameters")

const struct db_area db_areas[] = {
	HOLDING_AREA(DB_VIEW_DRIVE, 0, 99, "process data"),
	HOLDING_AREA(DB_VIEW_DRIVE, 100, 199, "command block"),
	PARAM_AREA(0),
	PARAM_AREA(1),
	PARAM_AREA(2),
	HOLDING_AREA(DB_VIEW_DRIVE, 3000, 3767, "history"),
	HOLDING_AREA(DB_VIEW_DRIVE, 4000, 4639, "addresses of the history"),
	AREA(DB_VIEW_DRIVE, DB_TABLE_DISCRETE, 0, 95, "status bits"),
	HOLDING_AREA(DB_VIEW_GATEWAY, 60, 86, "groups"),
	HOLDING_AREA(DB_VIEW_GATEWAY, 2000, 2000 + 24 * DB_GATEWAY_WINDOWS - 1, "window"),
};

const size_t db_area_count = COUNT_OF(db_areas);
