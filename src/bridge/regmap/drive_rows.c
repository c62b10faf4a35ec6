/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of a drive's unit. */
#include "drivebridge/command_table.h"
#include "drivebridge/result.h"
#include "drivebridge/trouble.h"
#include "regmap/image.h"
#include "regmap/regmap_private.h"
#include "regmap/rows.h"

/* --- codes for descriptions ------------------------------------------------------------------- */

static const char *state_name(unsigned code)
{
	return db_axis_state_name((enum db_axis_state)code);
}

static const char *error_name(unsigned code)
{
	return db_error_name(NULL, (uint16_t)code);
}

static const char *limit_name(unsigned code)
{
	return db_limit_name((uint16_t)code);
}

static const char *result_name(unsigned code)
{
	return db_result_name((enum db_result)code);
}

static const char *quality_name(unsigned code)
{
	switch (code) {
	case DB_QUALITY_BAD:
		return "bad";
	case DB_QUALITY_UNCERTAIN:
		return "uncertain";
	case DB_QUALITY_GOOD:
		return "good";
	default:
		return "unknown";
	}
}

/* Code 0 stands for a parameter write here. */
static const char *taken_command_name(unsigned code)
{
	return code == DB_CMD_NONE ? "unknown" : db_command_name(code);
}

static const struct db_codes stand_causes = { db_stand_cause_name, DB_STAND_COUNT, .bits = false };
static const struct db_codes troubles = { db_trouble_name, DB_TROUBLE_COUNT, .bits = false };
static const struct db_codes axis_states = { state_name, DB_AXIS_STATE_COUNT, .bits = false };
static const struct db_codes errors = { error_name, DB_ERROR_DRIVE_FAULT, .faults = true };
static const struct db_codes limits = { limit_name, DB_LIMIT_COUNT, .bits = false };
static const struct db_codes results = { result_name, DB_RESULT_COUNT, .bits = false };
static const struct db_codes command_codes = { db_command_name, DB_CMD_LIMIT, .bits = false };
static const struct db_codes status_bits = { db_status_bit_name, DB_STATUS_BIT_COUNT,
	                                     .bits = true };
static const struct db_codes capability_bits = { db_capability_name, DB_CAPABILITY_COUNT,
	                                         .bits = true };
static const struct db_codes qualities = { quality_name, DB_QUALITY_GOOD + 1, .told = true };
static const struct db_codes taken_commands = { taken_command_name, DB_CMD_LIMIT, .told = true };

/* --- what is there several times -------------------------------------------------------------- */

static const struct db_repeat each_status_bit = {
	.count = DB_STATUS_BIT_COUNT,
	.addresses = 1,
	.name = db_status_bit_name,
};
static const struct db_repeat each_input = { .count = 16, .addresses = 1 };
static const struct db_repeat each_drive_bit = {
	.of = DB_REPEAT_STATUS_BITS,
	.count = 32,
	.addresses = 1,
};
static const struct db_repeat each_output = {
	.of = DB_REPEAT_OUTPUTS,
	.count = 16,
	.addresses = 1,
};
static const struct db_repeat each_raw_answer_word = {
	.count = DB_RAW_ANSWER_WORDS,
	.addresses = 1,
	.bytes = sizeof(uint16_t),
};
static const struct db_repeat each_raw_request_word = {
	.count = DB_RAW_REQUEST_WORDS,
	.addresses = 1,
	.bytes = sizeof(uint16_t),
};
static const struct db_repeat each_history = {
	.count = DB_HISTORY_MAX,
	.addresses = 24,
	.bytes = sizeof(struct db_drive_history),
};
static const struct db_repeat each_history_text = {
	.count = DB_HISTORY_MAX,
	.addresses = DB_CLIENT_ADDRESS_REGISTERS,
	.bytes = sizeof(struct db_drive_history),
};

static const struct db_repeat each_history_user = {
	.count = DB_HISTORY_MAX,
	.addresses = DB_CLIENT_USER_REGISTERS,
	.bytes = sizeof(struct db_drive_history),
};

/* --- long descriptions ------------------------------------------------------------------------ */

static const char about_result_id[] =
	"command_id of the latest command; 0=it had none. With command-id-scope = client in the "
	"configuration this and the other result registers and the status bits done and aborted "
	"are about the latest command of the client address that reads; who has not commanded "
	"this drive sees the latest of all";

static const char about_watchdog_ms[] =
	"Longest silence of the clients before the drive is stopped; 0=off; armed by the first "
	"motion command or when the drive moves as it is first seen; fed as watchdog-feed in the "
	"configuration says: by commands that are admitted and other writes of who has commanded "
	"the "
	"drive and by reads over connections that have commanded it since it was armed "
	"(commanders) or "
	"also by reads of any client that may write (requests) or by no reads (writes) or only by "
	"writes of a new value to heartbeat (heartbeat); never by what is refused";

static const char about_control_request[] =
	"Control of the drive (control = drive in the configuration): write 1 to take it and 0 "
	"to let it go; reads 1 when the connection that reads has it. Any other write but a stop "
	"takes it too when nobody has it; while somebody has it others can only stop the drive "
	"(06; not_in_control). Lost with the connection or by silence; 1 from another connection "
	"of the same address takes it over";

static const char about_control_remaining_ms[] =
	"Time left before silence of the client that has control ends it; each of its requests "
	"to this unit begins it again and so does a heartbeat of the gateway unit that feeds "
	"this drive; 0=nobody";

static const char about_heartbeat[] =
	"Sign of life of the PLC's program (watchdog-feed = heartbeat in the configuration): a "
	"new value feeds the watchdog when the same address had written another one before; the "
	"same value again does not; so one client only is to write it; reads the value written "
	"last; see also heartbeat of the gateway unit";

static const char about_write_result_register[] =
	"Address of the first register that the write of write_result was refused for; of coils "
	"the port's number (the coil's address plus 1); 0=it was not refused or not for one "
	"register or the drive did not say which";

static const char about_command_id[] =
	"Number of a command: 0=executes each time it is written; other=executes when it differs "
	"from the drive's last one while the same again is answered with the stored result; "
	"after the bridge starts the first one is only remembered (restarted); with "
	"command-id-scope = client in the configuration all this is for each client address by "
	"itself (the last 8 that commanded); stop and disable always execute; an id is used up "
	"by every outcome except busy";

static const char about_command[] =
	"Writing a code other than 0 executes it with the kept arguments. Written without "
	"command_id it uses the kept id if that is unused; the same command and arguments under "
	"a used id are the same request again; anything else executes as if the id were 0";

static const char about_hold_ms[] =
	"For a push button: not 0 (100 to 1000) makes the motion that a write of command (or "
	"group_start) begins a held one; its writer keeps it going by writing another value into "
	"hold_beat more often than that. Without a new value for hold_ms and when the "
	"connection of the writer ends the drive is stopped at once whatever the watchdog says "
	"(by on-client-loss where that is a stop; else by stop); nothing is latched. Any stop ends "
	"the "
	"hold; a command written again keeps it but is no beat. Kept like an argument: writing "
	"it alone executes nothing and changes no motion that goes on; 0=motions go on by "
	"themselves";

static const char about_hold_beat[] =
	"Sign of life of who holds a motion (see hold_ms): a value other than before from the "
	"connection that began the motion. After a hold that was lost the next one needs a value "
	"other "
	"than the one it was lost with (out_of_range); nothing that is only repeated "
	"moves the drive again; writing it alone executes nothing";

/* --- the registers ---------------------------------------------------------------------------- */

// clang-format off
#define FROM(needs, member) \
	.part = DB_PART_##needs, .offset = offsetof(struct db_drive_image, member)
#define PROCESS(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(PROCESS, member), more.description = (text) }
#define RESULT(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(PROCESS, state.results.member), more.description = (text) }
#define BLOCK(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(BLOCK, block.member), more.description = (text) }
#define HOLDER(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(HOLDER, member), more.description = (text) }
#define PLATE(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(PLATE, nameplate.member), more.description = (text) }
#define STATIC(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(STATIC, member), more.description = (text) }
#define HISTORY(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(HISTORY, history[0].member), \
	  EACH(history) more.description = (text) }
#define HISTORY_USER(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(HISTORY, history[0].member), \
	  EACH(history_user) more.description = (text) }
#define HISTORY_TEXT(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(HISTORY, history[0].member), \
	  EACH(history_text) more.description = (text) }

/* Address, name, type, member of the image, access and other properties, description. */
static const struct db_row registers[] = {
	/* Process data. */
	PROCESS( 0, "axis_state",        U16,    feedback.state,          READ
	        UPTO(DB_AXIS_STATE_COUNT - 1) CODES(axis_states),
	        "State of the axis after PLCopen"),
	PROCESS( 1, "error",             U16,    feedback.error,          READ CODES(errors),
	        "Why the axis is in ErrorStop or Offline; below 16 the bridge's own causes; from "
	        "16 the drive's"),
	PROCESS( 2, "status",            BITS32, status,                  READ CODES(status_bits),
	        "State in bits"),
	PROCESS( 4, "quality",           U16,    quality,                 READ UPTO(192)
	        CODES(qualities),
	        "Quality of the process data as in OPC: 0=bad 64=uncertain 192=good; good means "
	        "online and not older than three times poll_interval_ms or 100 ms"),
	PROCESS( 5, "active_command",    U16,    state.active_command,    READ
	        CODES(taken_commands),
	        "Oldest command that is not confirmed yet; 0=none; codes as in command"),
	PROCESS( 6, "age_ms",            U32,    age_ms,                  READ UNIT("ms"),
	        "Age of the process data; 4294967295=never read"),
	PROCESS( 8, "timestamp_us",      U64,    feedback.taken_wall_us,  MEASURED UNIT("us"),
	        "Moment of the process data since 1970-01-01 UTC"),
	PROCESS(12, "position",          I32,    feedback.position,       MEASURED UNIT("counts"),
	        "Actual position in the drive's own units"),
	PROCESS(14, "velocity",          F32,    feedback.velocity,       MEASURED UNIT(db_velocity_unit),
	        "Actual velocity in the drive's own units; rpm on servo-can"),
	PROCESS(16, "position_units",    F32,    position_units,          MEASURED
	        UNIT("user units"),
	        "Position divided by counts_per_unit; see unit_name"),
	PROCESS(18, "velocity_units",    F32,    velocity_units,          MEASURED
	        UNIT("user units/s"),
	        "Velocity divided by counts_per_unit; see unit_name; without meaning on "
	        "servo-can where velocity is in rpm"),
	PROCESS(20, "drive_status",      BITS32, feedback.drive_status,   MEASURED,
	        "The drive's own status word as its vendor documents it; its bits are the "
	        "discrete inputs drive_ from 64 on"),
	RESULT( 22, "result_id",         U16,    result_id,               READ,
	        about_result_id),
	RESULT( 23, "result",            U16,    result,                  READ
	        UPTO(DB_RESULT_COUNT - 1) CODES(results),
	        "How the latest command ended; of a motion: ok when the drive has begun it and "
	        "until it ends badly (see status bit done)"),
	RESULT( 24, "write_result",      U16,    write_result,            READ
	        UPTO(DB_RESULT_COUNT - 1),
	        "How the latest command or parameter write ended; codes as in result"),
	RESULT( 25, "result_command",    U16,    result_command,          READ,
	        "The latest command; codes as in command"),
	RESULT( 26, "result_time_us",    U32,    result_time_us,          READ UNIT("us"),
	        "Time from the arrival of the last ended command to its end"),
	PROCESS(28, "capabilities",      BITS32, capabilities,            READ
	        CODES(capability_bits),
	        "What this drive can do"),
	PROCESS(30, "inputs",            BITS16, feedback.inputs,         MEASURED IF(INPUTS),
	        "Levels of the inputs; bit 0 = input 1"),
	PROCESS(31, "outputs",           BITS16, feedback.outputs,        MEASURED IF(OUTPUTS),
	        "Levels of the outputs; bit 0 = output 1"),
	PLATE(  32, "acceleration",      F32,    room.values,             PARAM ALIAS(ACCELERATION),
	        "Acceleration: the parameter of the drive under a neutral name"),
	PLATE(  34, "deceleration",      F32,    room.values,             PARAM ALIAS(DECELERATION),
	        "Deceleration: the parameter of the drive under a neutral name"),
	PROCESS(36, "fault_bits",        BITS32, feedback.fault_bits,     MEASURED IF(FAULT_BITS),
	        "The drive's own fault word as its vendor documents it"),
	PROCESS(38, "current",           F32,    feedback.current,        MEASURED UNIT("A")
	        IF(CURRENT),
	        "Motor current"),
	PROCESS(40, "supply_voltage",    F32,    feedback.supply_voltage, MEASURED UNIT("V")
	        IF(SUPPLY_VOLTAGE),
	        "Supply voltage"),
	PROCESS(42, "temperature",       F32,    feedback.temperature,    MEASURED UNIT("degC")
	        IF(TEMPERATURE),
	        "Temperature of the drive"),
	PROCESS(44, "program",           U16,    feedback.program,        MEASURED IF(PROGRAM),
	        "Program that is running; 0=none"),
	PROCESS(45, "program_state",     U16,    feedback.program_state,  MEASURED IF(PROGRAM),
	        "State of the program in the vendor's code"),
	PROCESS(46, "watchdog_ms",       U32,    state.watchdog_ms,       WATCHDOG UNIT("ms")
	        UPTO(DB_WATCHDOG_MAX_MS),
	        about_watchdog_ms),
	PROCESS(48, "watchdog_remaining_ms", U32, state.watchdog_remaining_ms, READ UNIT("ms"),
	        "Time left before the watchdog stops the drive; 0=not armed"),
	PROCESS(50, "watchdog_trips",    U32,    state.watchdog_trips,    READ,
	        "How often the watchdog stopped the drive"),
	PROCESS(52, "analogue_1",        U16,    feedback.analogue_1,     MEASURED IF(ANALOGUE),
	        "Analogue input 1 as the drive gives it"),
	PROCESS(53, "supply_voltage_raw", U16,   feedback.supply_voltage_raw, MEASURED
	        IF(RAW_HEALTH),
	        "Supply voltage as the drive gives it; see supply_voltage"),
	PROCESS(54, "temperature_raw",   U16,    feedback.temperature_raw, MEASURED IF(RAW_HEALTH),
	        "Temperature of the drive as it gives it; see temperature"),
	PROCESS(55, "program_step",      U16,    feedback.program_step,   MEASURED IF(PROGRAM),
	        "Instruction of the program that is carried out"),
	PROCESS(56, "control_request",   U16,    control_request,         CONTROL UPTO(1),
	        about_control_request),
	PROCESS(57, "control_port",      U16,    control_port,            READ ANY_U16,
	        "TCP port of the client that has control; 0=nobody; of a session of the control socket "
	        "its number"),
	PROCESS(58, "control_holder",    U32,    control_holder,          READ,
	        "IPv4 address of the client that has control; its first byte highest; 0=nobody "
	        "4294967295=an IPv6 address or a session of the control socket: see "
	        "control_address"),
	PROCESS(60, "control_remaining_ms", U32, control_remaining_ms,    READ UNIT("ms"),
	        about_control_remaining_ms),
	RESULT( 62, "result_limit",      U16,    result_limit,            READ
	        UPTO(DB_LIMIT_COUNT - 1) CODES(limits),
	        "Which limit of the configuration a command would have broken when result is "
	        "limit"),
	RESULT( 63, "aborted_id",        U16,    aborted_id,              READ ANY_U16,
	        "command_id of the motion that was aborted when the status bit aborted is set; "
	        "with command-id-scope = client a motion of the client that reads; whoever "
	        "aborted it"),
	RESULT( 64, "motion_id",         U16,    motion_id,               READ ANY_U16,
	        "command_id of the motion that the drive has begun last; with command-id-scope = "
	        "client of the client that reads; a motion that is refused leaves it as it is"),
	RESULT( 65, "motion_result",     U16,    motion_result,           READ
	        UPTO(DB_RESULT_COUNT - 1) CODES(results),
	        "What became of the motion of motion_id: pending while it goes on and ok when it "
	        "came to its end; cancelled when another command ended it; failed when it stands "
	        "unasked"),
	PROCESS(66, "heartbeat",         U16,    heartbeat,               HEARTBEAT ANY_U16,
	        about_heartbeat),
	RESULT( 67, "write_result_register", U16, write_register,         READ ANY_U16,
	        about_write_result_register),
	PLATE(  68, "raw_answer_length", U16,    plate.raw_length,        READ
	        UPTO(2 * DB_RAW_ANSWER_WORDS) IF(RAW_ANSWER),
	        "Bytes of the frame that answered the last raw_frame; 0=none came"),
	PLATE(  69, "raw_answer#",       U16,    plate.raw_answer,        READ ANY_U16
	        IF(RAW_ANSWER) EACH(raw_answer_word),
	        "Word # of that frame as it came; two bytes each with the first in the high byte"),
	PROCESS(79, "must_stand_cause",  U16,    must_stand_cause,        READ
	        UPTO(DB_STAND_COUNT - 1) CODES(stand_causes),
	        "Why the drive must stand: the latest cause since it was free; while it must stand stops "
	        "are sent again until a later reading shows that it stands"),
	PROCESS(80, "must_stand_ms",     U32,    must_stand_ms,           READ UNIT("ms"),
	        "How long the drive has had to stand without being seen to stand; 0=it need not"),
	PROCESS(82, "must_stand_count",  U32,    must_stand.count,        READ,
	        "Stops that were sent since then"),
	PROCESS(84, "poll_interval_ms",  U32,    poll_interval_ms,        READ UNIT("ms"),
	        "At which interval the drive is read: the bus's cycle while it moves and the line has "
	        "room and longer where drives have to take turns; quality is good while the data are "
	        "at most three of these old"),
	PROCESS(86, "learnt_gap_us",     U16,    learnt.gap_us,           READ UNIT("us") ANY_U16,
	        "Silence that is left after the drive's answers as it was learnt (adapt = on in the "
	        "configuration); 0=as turnaround-us has it"),
	PROCESS(87, "learnt_latency_ms", U16,    learnt.latency_ms,       READ UNIT("ms") ANY_U16,
	        "For how long the drive's answers are waited for as it was learnt; 0=as "
	        "drive-latency-ms has it"),
	PROCESS(92, "trouble",           U16,    trouble.cause,           READ
	        UPTO(DB_TROUBLE_COUNT - 1) CODES(troubles),
	        "The worst of what is wrong with the drive: what drivebridgectl status and the page "
	        "say of it; 0=nothing"),
	PROCESS(94, "trouble_ms",        U32,    trouble_ms,              READ UNIT("ms"),
	        "For how long that has been so; 0=nothing is wrong"),
	PROCESS(96, "doubled_answers",   U32,    stats.doubled_answers,   READ,
	        "Second answers to one question with another content: two drives have the address of "
	        "this one; quality is uncertain for 10 s after each"),

	/* The command block, at most 100 registers. */
	BLOCK(100, "command_id",        U16,    command_id,              WRITE ANY_U16,
	      about_command_id),
	BLOCK(101, "command",           U16,    command,                 WRITE
	      UPTO(DB_CMD_LIMIT - 1) CODES(command_codes),
	      about_command),
	BLOCK(102, "target_position",   I32,    args.target_position,    WRITE UNIT("counts")
	      ANY_I32,
	      "Target or distance in the drive's own units"),
	BLOCK(104, "target_velocity",   F32,    args.target_velocity,    WRITE UNIT(db_velocity_unit),
	      "Velocity in the drive's own units; rpm on servo-can; 0 in a position move = the "
	      "drive's preset speed"),
	BLOCK(106, "output_number",     U16,    args.output_number,      WRITE ANY_U16,
	      "Output port from 1"),
	BLOCK(107, "output_value",      U16,    args.output_value,       WRITE ANY_U16,
	      "Level 0 or 1; or the duty of a PWM port 0..255"),
	BLOCK(108, "output_mask",       BITS16, args.output_mask,        WRITE,
	      "Ports that set_outputs changes; bit 0 = port 1"),
	BLOCK(109, "output_levels",     BITS16, args.output_levels,      WRITE,
	      "Their levels; bit 0 = port 1"),
	BLOCK(110, "shake_start_position", I32, args.shake_start_position, WRITE UNIT("counts")
	      ANY_I32,
	      "One end of the swing"),
	BLOCK(112, "shake_end_position", I32,   args.shake_end_position, WRITE UNIT("counts")
	      ANY_I32,
	      "The other end of the swing"),
	BLOCK(114, "shake_frequency",   F32,    args.shake_frequency,    WRITE UNIT("Hz"),
	      "Frequency of the swing; the range is the family's"),
	BLOCK(116, "shake_cycles",      U32,    args.shake_cycles,       WRITE UPTO(INT32_MAX),
	      "Number of cycles; 0=until stopped"),
	BLOCK(118, "shake_time",        U32,    args.shake_time,         WRITE UNIT("s")
	      UPTO(INT32_MAX),
	      "Duration; 0=until stopped"),
	BLOCK(120, "target_current",    F32,    args.target_current,     WRITE UNIT("A"),
	      "Motor current; its sign is the direction of the torque"),
	BLOCK(122, "program_number",    U16,    args.program_number,     WRITE ANY_U16,
	      "Program of start_program"),
	BLOCK(123, "program_delay",     U16,    args.program_delay,      WRITE UNIT("s") ANY_U16,
	      "From start_program to the program's begin"),
	BLOCK(124, "staged_command",    U16,    staged_command,          WRITE
	      UPTO(DB_CMD_LIMIT - 1) CODES(command_codes),
	      "A command that waits for group_start of the gateway and takes the arguments of "
	      "then; writing it executes nothing; 0=none"),
	BLOCK(125, "raw_length",        U16,    args.raw_length,         WRITE
	      UPTO(2 * DB_RAW_REQUEST_WORDS),
	      "Bytes of a frame for raw_frame"),
	BLOCK(126, "raw_request#",      U16,    args.raw_request,        WRITE ANY_U16
	      EACH(raw_request_word),
	      "Word # of that frame; two bytes each with the first in the high byte; what of it "
	      "the bridge adds is the family's"),
	BLOCK(134, "hold_ms",           U16,    hold_ms,                 WRITE UNIT("ms")
	      UPTO(DB_HOLD_MAX_MS),
	      about_hold_ms),
	BLOCK(135, "hold_beat",         U16,    hold_beat,               WRITE ANY_U16,
	      about_hold_beat),

	/* Diagnostics. */
	PLATE(  1000, "identity",          TEXT,   plate.identity,          READ
	        LENGTH(DB_IDENTITY_REGISTERS),
	        "The drive's own description of itself; two characters a register; zeros after "
	        "its end; all zero = not read yet"),
	STATIC( 1020, "bus",               U16,    bus,                     READ,
	        "Number of the drive's bus from 1 in the order of the configuration"),
	STATIC( 1021, "address",           U16,    address,                 READ,
	        "The drive's address on its bus; 0 on RS232"),
	STATIC( 1022, "unit_name",         TEXT,   unit_name,               READ
	        LENGTH(DB_UNIT_NAME_REGISTERS),
	        "Name of the user units"),
	STATIC( 1030, "counts_per_unit",   F32,    counts_per_unit,         READ UNIT("counts"),
	        "The drive's own units per user unit"),
	PROCESS(1032, "requests",          U32,    stats.requests,          READ,
	        "Requests sent to the drive"),
	PROCESS(1034, "answers",           U32,    stats.answers,           READ,
	        "Answers received from it"),
	PROCESS(1036, "timeouts",          U32,    stats.timeouts,          READ,
	        "Answers that did not come in time"),
	PROCESS(1038, "retries",           U32,    stats.retries,           READ,
	        "Requests repeated"),
	PROCESS(1040, "bad_frames",        U32,    stats.bad_frames,        READ,
	        "Answers with a wrong checksum or form"),
	PROCESS(1042, "refusals",          U32,    stats.refusals,          READ,
	        "Commands that the drive refused"),
	PROCESS(1044, "came_online",       U32,    stats.came_online,       READ,
	        "How often it came online"),
	PROCESS(1046, "round_trip_us",     U32,    stats.round_trip_us,     READ UNIT("us"),
	        "Last round trip: first byte out to last byte in"),
	PROCESS(1048, "round_trip_min_us", U32,    stats.round_trip_min_us, READ UNIT("us"),
	        "Shortest round trip"),
	PROCESS(1050, "round_trip_max_us", U32,    stats.round_trip_max_us, READ UNIT("us"),
	        "Longest round trip"),
	PROCESS(1052, "round_trip_mean_us", U32,   stats.round_trip_mean_us, READ UNIT("us"),
	        "Mean round trip since the bridge started"),
	PLATE(  1054, "parameters_generation", U32, plate.generation,       READ,
	        "Grows whenever identity or a parameter changes"),
	HOLDER( 1056, "control_address",   TEXT,   control_address,         READ
	        LENGTH(DB_CLIENT_ADDRESS_REGISTERS),
	        "Address of the client that has control or 'control' and the user of a session of the "
	        "control socket; empty=nobody"),
	HOLDER( 1076, "control_user",      TEXT,   control_user,            READ
	        LENGTH(DB_CLIENT_USER_REGISTERS),
	        "User for whom the session that has control said it acts (UTF-8); empty=nobody named"),

	/* The last commands. */
	HISTORY(     3000, "history#_timestamp_us", U64, entry.timestamp_us, READ,
	             "Command # (1 is the newest): when it arrived; us since 1970-01-01 UTC; "
	             "0=there is none"),
	HISTORY(     3004, "history#_sequence", U32,    entry.sequence,     READ,
	             "Command #: its number since the bridge started"),
	HISTORY(     3006, "history#_ipv4",     U32,    ipv4,               READ,
	             "Command #: IPv4 address of the client with its first byte highest; 0=the "
	             "bridge itself 4294967295=see history#_address"),
	HISTORY(     3008, "history#_port",     U16,    entry.port,         READ ANY_U16,
	             "Command #: TCP port of the client; of a session of the control socket its number"),
	HISTORY(     3009, "history#_command_id", U16,  entry.command_id,   READ ANY_U16,
	             "Command #: as command_id"),
	HISTORY(     3010, "history#_command",  U16,    entry.command,      READ
	             CODES(taken_commands),
	             "Command #: as command; 0=a parameter write"),
	HISTORY(     3011, "history#_result",   U16,    entry.result,       READ,
	             "Command #: as result; of a motion that ended: cancelled when another "
	             "command ended it"),
	HISTORY(     3012, "history#_duration_us", U32, entry.duration_us,  READ UNIT("us"),
	             "Command #: time from its arrival to its result; of a motion with an end to "
	             "that"),
	HISTORY(     3014, "history#_position", I32,    entry.position,     READ UNIT("counts"),
	             "Command #: its target_position or shake_start_position"),
	HISTORY(     3016, "history#_position_2", I32,  entry.position_2,   READ UNIT("counts"),
	             "Command #: its shake_end_position"),
	HISTORY(     3018, "history#_real",     F32,    entry.real,         READ,
	             "Command #: its target_velocity or target_current or shake_frequency"),
	HISTORY(     3020, "history#_number",   U16,    entry.number,       READ,
	             "Command #: its output_number or output_mask or program_number; of a "
	             "parameter write the first parameter's register"),
	HISTORY(     3021, "history#_repeats",  U16,    entry.repeats,      READ,
	             "Command #: how often the same came again: a refused one from the same "
	             "client or a stop that was under way"),
	HISTORY(     3022, "history#_value",    U32,    entry.value,        READ,
	             "Command #: its output_value or output_levels or shake_cycles or shake_time "
	             "or program_delay; of a parameter write the first value in bits"),
	HISTORY_TEXT(4000, "history#_address",  TEXT,   address,            READ
	             LENGTH(DB_CLIENT_ADDRESS_REGISTERS),
	             "Command #: address of the client or 'control' and the user of a session of the "
	             "control socket; empty=the bridge itself"),
	HISTORY_USER(5000, "history#_user",     TEXT,   user,               READ
	             LENGTH(DB_CLIENT_USER_REGISTERS),
	             "Command #: user for whom that session said it acts (UTF-8; that of the page or "
	             "of OPC UA); empty=nobody named ?=not known any more"),
};

static const struct db_row bits[] = {
	PROCESS( 0, "status_#", U32, status,                READ UPTO(1) EACH(status_bit),
	        "Bit of the status register"),
	PROCESS(32, "input_#",  U16, feedback.inputs,       MEASURED UPTO(1) IF(INPUTS) EACH(input),
	        "Level of input #"),
	PROCESS(64, "drive_#",  U32, feedback.drive_status, MEASURED UPTO(1) EACH(drive_bit),
	        "Bit of drive_status"),
};

static const struct db_row coils[] = {
	PROCESS( 0, "output_#", U16, feedback.outputs,      SWITCHED UPTO(1) EACH(output),
	        "Level of output #; writing several at once is one set_outputs without id"),
};
// clang-format on

const struct db_row_set db_drive_registers = {
	DB_VIEW_DRIVE,
	DB_TABLE_HOLDING,
	registers,
	COUNT_OF(registers),
};
const struct db_row_set db_drive_bits = {
	DB_VIEW_DRIVE,
	DB_TABLE_DISCRETE,
	bits,
	COUNT_OF(bits),
};
const struct db_row_set db_drive_coils = {
	DB_VIEW_DRIVE,
	DB_TABLE_COILS,
	coils,
	COUNT_OF(coils),
};
