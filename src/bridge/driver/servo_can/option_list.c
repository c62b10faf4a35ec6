/* SPDX-License-Identifier: Apache-2.0 */
/* The family's keys of the configuration. */
#include "driver/servo_can/options.h"

#define FIXED_MAX 281474976710655.0 /* six bytes: at least two belong to a word */

/* A member of the section's options. */
#define BUS(member) .section = "bus", .offset = offsetof(struct servo_can_bus_options, member)
#define DRIVE(member) .section = "drive", .offset = offsetof(struct servo_can_drive_options, member)

#define NUMBER_OF(low, high, of) \
	.words = "", .min = (low), .max = (high), .whole = true, .unit = (of)
#define NUMBER(low, high) NUMBER_OF(low, high, "")
#define SCALE_OF(usual) .words = "", .preset = (usual), .min = -1000, .max = 1000
#define SCALE SCALE_OF("1")
#define BIT(usual) NUMBER(-1, 15), .preset = (usual)

const struct db_option servo_can_options[] = {
	{
		BUS(ack_base),
		.name = "ack-base",
		NUMBER(0, DB_CAN_STANDARD_MASK),
		.preset = "1",
		.description = "Acknowledgements have the id of this plus the node",
	},
	{
		BUS(padded),
		.name = "padded",
		.words = "no yes",
		.preset = "no",
		.unit = "",
		.description =
			"Frames to the drives have 8 data bytes, unused ones are 0; those of "
			"the drives may have more than documented in any case",
	},
	{
		BUS(command_word_base),
		.name = "command-word-base",
		NUMBER(1, DB_CAN_STANDARD_MASK),
		.preset = "",
		.description =
			"The frame with the command words, from the vendor's full manual, has "
			"the id of this plus the node; without it position moves are refused",
	},
	{
		BUS(command_word_length),
		.name = "command-word-length",
		NUMBER(2, DB_CAN_DATA_MAX),
		.preset = "",
		.description = "Data bytes of that frame",
	},
	{
		BUS(command_word_0_at),
		.name = "command-word-0-at",
		NUMBER(0, DB_CAN_DATA_MAX - 2),
		.preset = "",
		.description = "First byte of command word 0 in that frame, from 0",
	},
	{
		BUS(command_word_1_at),
		.name = "command-word-1-at",
		NUMBER(0, DB_CAN_DATA_MAX - 2),
		.preset = "",
		.description = "First byte of command word 1; not set: it is not in that frame",
	},
	{
		BUS(command_word_fixed),
		.name = "command-word-fixed",
		NUMBER(0, FIXED_MAX),
		.preset = "0",
		.description =
			"The bytes of that frame that belong to neither word, as one number, "
			"the last byte lowest; with command-word-base = 96, the ids of speed "
			"and current, byte 0 tells the frame from theirs",
	},
	{
		BUS(command_word_ack),
		.name = "command-word-ack",
		NUMBER(0, UINT8_MAX),
		.preset = "",
		.description =
			"Code that acknowledges that frame; 0: nothing does, and a read behind "
			"it shows that the drive was there",
	},
	{
		DRIVE(allow_mode_change),
		.name = "allow-mode-change",
		.words = "no yes",
		.preset = "yes",
		.unit = "",
		.description = "The bridge may select position, speed or current mode as a "
			       "command needs it, at standstill",
	},
	{
		DRIVE(mode),
		.name = "mode",
		.words = "unknown position speed current",
		.preset = "unknown",
		.unit = "",
		.description =
			"The mode that the drive is given each time it comes back, before its "
			"motor has power; with allow-mode-change = no, the mode it is in",
	},
	{
		DRIVE(torque_direction),
		.name = "torque-direction",
		.words = "counterclockwise clockwise",
		.preset = "counterclockwise",
		.unit = "",
		.description =
			"Positive torque, seen from the end of the shaft; written with every "
			"change of the mode",
	},
	{
		DRIVE(sync),
		.name = "sync",
		.words = "no yes",
		.preset = "no",
		.unit = "",
		.description = "The drive is set to sync mode: speed and current are staged until "
			       "sync_start; stop takes the power off; no position moves",
	},
	{
		DRIVE(reports),
		.name = "reports",
		.words = "use ignore",
		.preset = "use",
		.unit = "",
		.description =
			"Position, speed and current from the drive's own reports where they "
			"are as frequent as the cycle; faults always come from reports",
	},
	{
		DRIVE(enabled_bit),
		.name = "enabled-bit",
		NUMBER(0, 15),
		.preset = "0",
		.description = "Bit of the status word that tells that the motor has power: 0 "
			       "(servo started) or 1 (servo running)",
	},
	{
		DRIVE(voltage_scale),
		.name = "voltage-scale",
		SCALE,
		.unit = "V",
		.description = "What one step of the reported supply voltage is",
	},
	{
		DRIVE(temperature_scale),
		.name = "temperature-scale",
		SCALE,
		.unit = "degC",
		.description = "What one step of the reported temperature is",
	},
	{
		DRIVE(temperature_offset),
		.name = "temperature-offset",
		.words = "",
		.preset = "0",
		.min = -1000,
		.max = 1000,
		.unit = "degC",
		.description = "Added to the scaled temperature, whose raw value is signed",
	},
	{
		DRIVE(counts_per_turn),
		.name = "counts-per-turn",
		.words = "",
		.preset = "",
		.min = 1,
		.max = INT32_MAX,
		.unit = "",
		.description =
			"Counts of the position in one turn of the motor: with it velocity_units, "
			"max-velocity and max-acceleration are in user units a second",
	},
	{
		DRIVE(max_speed),
		.name = "max-speed",
		NUMBER_OF(0, UINT16_MAX, "rpm"),
		.preset = "",
		.description =
			"Speed limit that the drive is given each time it comes back, before "
			"its motor has power",
	},
	{
		DRIVE(ramp_acceleration),
		.name = "ramp-acceleration",
		NUMBER_OF(0, UINT32_MAX, "rpm/s"),
		.preset = "",
		.description =
			"Ramp that the drive is given each time it comes back; together with "
			"ramp-deceleration",
	},
	{
		DRIVE(ramp_deceleration),
		.name = "ramp-deceleration",
		NUMBER_OF(0, UINT32_MAX, "rpm/s"),
		.preset = "",
		.description = "As ramp-acceleration",
	},
	{
		DRIVE(on_fault),
		.name = "on-fault",
		.words = "none stop disable",
		.preset = "disable",
		.unit = "",
		.description =
			"What the bridge does when the drive reports a fault, beside bringing "
			"speed and current to 0: nothing, what a stop does, or taking the power "
			"off, so that nothing begins by itself when the fault is gone",
	},
	{
		DRIVE(standstill_speed),
		.name = "standstill-speed",
		NUMBER_OF(0, 1000, "rpm"),
		.preset = "1",
		.description =
			"Up to this speed the motor counts as standing when the drive's zero "
			"speed bit says so",
	},
	{
		DRIVE(reaction_ms),
		.name = "reaction-ms",
		NUMBER_OF(10, 10000, "ms"),
		.preset = "200",
		.description =
			"How long the drive may take from acknowledging a command to showing "
			"its effect; for so long it is also watched behind enable",
	},
	{
		DRIVE(error_bit),
		.name = "error-bit",
		.words = "fault alarm",
		.preset = "fault",
		.unit = "",
		.description = "What fault-bit is: a fault as long as it is set, or an "
			       "alarm, which is a fault until a report says that there is none",
	},
	{
		DRIVE(speed_sign),
		.name = "speed-sign",
		.words = "signed bits",
		.preset = "signed",
		.unit = "",
		.description =
			"Where the direction of the speed is: in its own sign, or in reverse-bit "
			"and forward-bit of the status word; those come with answers only, so "
			"reports of the speed are not used then",
	},
	{
		DRIVE(power_on_window),
		.name = "power-on-window",
		.words = "",
		.preset = "",
		.min = 0,
		.max = INT32_MAX,
		.unit = "",
		.description =
			"How far the motor may move, in user units, when enable gives it its "
			"power: beyond that the power is taken off again; not set: "
			"in-position-window, at least a hundredth of a turn and 10 counts, or "
			"100 counts without counts-per-turn",
	},
	{
		DRIVE(late_move),
		.name = "late-move",
		.words = "disable follow",
		.preset = "disable",
		.unit = "",
		.description =
			"What is done about a position move that does not show within "
			"reaction-ms: its drive's power is taken off, and it has failed; or it "
			"is indeterminate, and followed when it begins later",
	},
	{
		BUS(command_word_1_base),
		.name = "command-word-1-base",
		NUMBER(1, DB_CAN_STANDARD_MASK),
		.preset = "",
		.description =
			"Command word 1 has a frame of its own, with the id of this plus the "
			"node; command-word-1-at is its place there",
	},
	{
		BUS(command_word_1_length),
		.name = "command-word-1-length",
		NUMBER(2, DB_CAN_DATA_MAX),
		.preset = "",
		.description = "Data bytes of that frame",
	},
	{
		BUS(command_word_1_fixed),
		.name = "command-word-1-fixed",
		NUMBER(0, FIXED_MAX),
		.preset = "0",
		.description = "Its other bytes, as command-word-fixed",
	},
	{
		BUS(command_word_1_ack),
		.name = "command-word-1-ack",
		NUMBER(0, UINT8_MAX),
		.preset = "",
		.description = "Code that acknowledges it, as command-word-ack",
	},
	{
		BUS(position_slot),
		.name = "position-slot",
		NUMBER(0, SERVO_CAN_SLOT_MAX),
		.preset = "0",
		.description =
			"Internal position that moves go through, selected by pos0 to pos2 of "
			"command word 0; another than 0 needs position-slot-base and -ack",
	},
	{
		BUS(position_slot_base),
		.name = "position-slot-base",
		NUMBER(1, DB_CAN_STANDARD_MASK),
		.preset = "",
		.description =
			"The frame that sets this internal position, four bytes, has the id of "
			"this plus the node; not set: 128, which is that of internal position 0",
	},
	{
		BUS(position_slot_ack),
		.name = "position-slot-ack",
		NUMBER(0, UINT8_MAX),
		.preset = "",
		.description =
			"Code that acknowledges that frame; 0: nothing does, as command-word-ack",
	},
	{
		BUS(move_frame_base),
		.name = "move-frame-base",
		NUMBER(1, DB_CAN_STANDARD_MASK),
		.preset = "",
		.description =
			"A frame that moves the drive to a position by itself, from the vendor's "
			"full manual, has the id of this plus the node; moves need no command "
			"words then",
	},
	{
		BUS(move_frame_length),
		.name = "move-frame-length",
		NUMBER(2, DB_CAN_DATA_MAX),
		.preset = "",
		.description = "Data bytes of that frame",
	},
	{
		BUS(move_frame_at),
		.name = "move-frame-at",
		NUMBER(0, DB_CAN_DATA_MAX - 2),
		.preset = "",
		.description = "First byte of the target in that frame, from 0",
	},
	{
		BUS(move_frame_bytes),
		.name = "move-frame-bytes",
		NUMBER(2, DB_CAN_DATA_MAX),
		.preset = "4",
		.description = "Bytes of the target, a whole number with a sign",
	},
	{
		BUS(move_frame_order),
		.name = "move-frame-order",
		.words = "high-first low-first",
		.preset = "high-first",
		.unit = "",
		.description = "Which byte of the target comes first",
	},
	{
		BUS(move_frame_fixed),
		.name = "move-frame-fixed",
		NUMBER(0, FIXED_MAX),
		.preset = "0",
		.description =
			"The other bytes of that frame as one number, the last byte lowest; with "
			"the ids of another frame byte 0 tells it from that",
	},
	{
		BUS(move_frame_ack),
		.name = "move-frame-ack",
		NUMBER(0, UINT8_MAX),
		.preset = "",
		.description =
			"Code that acknowledges that frame; 0: nothing does, as command-word-ack",
	},
	{
		BUS(move_frame_target),
		.name = "move-frame-target",
		.words = "absolute relative",
		.preset = "absolute",
		.unit = "",
		.description =
			"What the target in that frame is: a position, or how far to go from "
			"where the motor stands",
	},
	{
		BUS(move_frame_scale),
		.name = "move-frame-scale",
		SCALE,
		.unit = "",
		.description =
			"How many counts of the reported position one step of the target is; "
			"negative where it counts the other way",
	},
	{
		DRIVE(fault_bit),
		.name = "fault-bit",
		BIT("10"),
		.description =
			"Bit of the status word that tells of a fault or alarm, see error-bit; "
			"-1: none",
	},
	{
		DRIVE(standstill_bit),
		.name = "standstill-bit",
		BIT("2"),
		.description =
			"Bit of the status word for zero speed; -1: none, and standstill-speed "
			"decides",
	},
	{
		DRIVE(moving_bit),
		.name = "moving-bit",
		BIT("-1"),
		.description =
			"Bit of the status word that tells that the motor moves, whatever its "
			"speed says; -1: none",
	},
	{
		DRIVE(target_bit),
		.name = "target-bit",
		BIT("-1"),
		.description =
			"Bit of the status word that a position move needs to be done, beside "
			"standing at its target; -1: none",
	},
	{
		DRIVE(homed_bit),
		.name = "homed-bit",
		BIT("8"),
		.description = "Bit of the status word that tells that homing is done; -1: none",
	},
	{
		DRIVE(warning_bit),
		.name = "warning-bit",
		BIT("6"),
		.description = "Bit of the status word for a warning; -1: none",
	},
	{
		DRIVE(overload_bit),
		.name = "overload-bit",
		BIT("9"),
		.description = "Bit of the status word for being above the overload threshold, a "
			       "warning as well; -1: none",
	},
	{
		DRIVE(limit_bit),
		.name = "limit-bit",
		BIT("-1"),
		.description =
			"Bit of the status word for a limit switch, a warning as well; -1: none",
	},
	{
		DRIVE(reverse_bit),
		.name = "reverse-bit",
		BIT("14"),
		.description =
			"Bit of the status word for turning in reverse, for speed-sign = bits; "
			"-1: none",
	},
	{
		DRIVE(forward_bit),
		.name = "forward-bit",
		BIT("15"),
		.description = "Bit of the status word for turning forward, likewise; -1: none",
	},
	{
		DRIVE(status_inverted),
		.name = "status-inverted",
		NUMBER(0, UINT16_MAX),
		.preset = "0x0",
		.description =
			"Bits of the status word that mean what they say when they are 0, as one "
			"number: 0x1 is bit 0; drive_status shows what the drive sends",
	},
	{
		DRIVE(position_sign),
		.name = "position-sign",
		.words = "normal reversed",
		.preset = "normal",
		.unit = "",
		.description = "Whether position is what the drive reports, or that with the other "
			       "sign; what is told to it follows",
	},
	{
		DRIVE(position_command_scale),
		.name = "position-command-scale",
		SCALE,
		.unit = "",
		.description = "How many counts of the reported position one step of the internal "
			       "position is; negative where it counts the other way",
	},
	{
		DRIVE(speed_scale),
		.name = "speed-scale",
		SCALE,
		.unit = "rpm",
		.description =
			"What one step of the reported speed is; negative where it has the other "
			"sign than the way of the position",
	},
	{
		DRIVE(speed_command_scale),
		.name = "speed-command-scale",
		SCALE_OF(""),
		.unit = "rpm",
		.description =
			"What one step of the speed that is commanded is; not set: speed-scale",
	},
	{
		DRIVE(current_scale),
		.name = "current-scale",
		SCALE_OF("0.1"),
		.unit = "A",
		.description = "What one step of the reported current is",
	},
	{
		DRIVE(current_command_scale),
		.name = "current-command-scale",
		SCALE_OF(""),
		.unit = "A",
		.description = "What one step of the current that is commanded is; not set: "
			       "current-scale",
	},
};
