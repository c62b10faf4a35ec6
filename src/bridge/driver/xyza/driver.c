/* SPDX-License-Identifier: Apache-2.0 */
/*
 * XYZA stepper controllers ("5A A5") on RS485 and RS232: settings, the bus's side and the
 * descriptor. A controller has up to four axes, each a drive of its own; ports, programs and system
 * parameters are the controller's and show at all its axes. The first axis polls for all of them.
 *
 * The document has no move to a position: only jogging, and programs that are stored in the
 * controller. Position moves are refused, not imitated.
 *
 * Source: the vendor's protocol V1.00 of 2016-10-20, sections 2 to 6.
 */
#include "codec/xyza_describe.h"
#include "codec/xyza_frames.h"
#include "driver/list.h"
#include "driver/xyza/xyza_private.h"
#include "transport/serial.h"

#include <math.h>

/* Usual time before a controller answers; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (1 * DB_NS_PER_MS)

/* Of a bus, named as their keys. */
struct xyza_options {
	unsigned unlock_system;
	double reaction_ms;
	unsigned jog_speed_change; /* 1: standing */
	unsigned raw_frames;
};

static const struct db_option options[] = {
	{
		.section = "bus",
		.name = "unlock-system",
		.offset = offsetof(struct xyza_options, unlock_system),
		.words = "no yes",
		.preset = "no",
		.unit = "",
		.description = "Lets system_info, factory_reset and slave_number be written",
	},
	{
		.section = "bus",
		.name = "reaction-ms",
		.offset = offsetof(struct xyza_options, reaction_ms),
		.words = "",
		.preset = "200",
		.min = 0,
		.max = 10000,
		.whole = true,
		.unit = "ms",
		.description =
			"How long the effect of a command may take to show before it counts as "
			"failed",
	},
	{
		.section = "bus",
		.name = "jog-speed-change",
		.offset = offsetof(struct xyza_options, jog_speed_change),
		.words = "moving standing",
		.preset = "moving",
		.unit = "",
		.description =
			"Whether a jog that goes on the same way takes another speed while it "
			"moves, or is stopped before",
	},
	{
		.section = "bus",
		.name = "raw-frames",
		.offset = offsetof(struct xyza_options, raw_frames),
		.words = "off on",
		.preset = "off",
		.unit = "",
		.description =
			"Lets clients send frames of their own with raw_frame, which the bridge "
			"cannot judge",
	},
};

static const struct db_drive_bit status_bits[] = {
	{ STATUS_NEGATIVE, "negative", "The position is negative" },
	{ STATUS_STANDS, "stands", "The axis stands" },
	{ STATUS_PROGRAM, "program_state_0", "Bit 0 of program_state" },
	{ STATUS_PROGRAM + 1, "program_state_1", "Bit 1 of program_state" },
	{ STATUS_PROGRAM + 2, "program_state_2", "Bit 2 of program_state" },
	{ STATUS_PROGRAM + 3, "program_state_3", "Bit 3 of program_state" },
	{ STATUS_PROGRAM + 4, "program_state_4", "Bit 4 of program_state" },
	{ STATUS_PROGRAM + 5, "program_state_5", "Bit 5 of program_state" },
	{ STATUS_PROGRAM + 6, "program_state_6", "Bit 6 of program_state" },
	{ STATUS_PROGRAM + 7, "program_state_7", "Bit 7 of program_state" },
};

/* --- a drive ---------------------------------------------------------------------------------- */

static const struct db_nameplate *get_nameplate(const struct db_device *device)
{
	return &device->plate;
}

static void init_device(struct db_device *device, struct db_device *first,
                        const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	const struct xyza_options *given = bus->options;

	DB_NAMEPLATE_INIT(&device->plate, &device->plate_room, XYZA_SHOWN_COUNT);
	device->first = first ? first : device;
	device->front.steps = device->front_steps;
	device->stop.steps = device->stop_steps;
	device->reaction = (db_time)given->reaction_ms * DB_NS_PER_MS;
	device->stops_for_speed = given->jog_speed_change != 0;
	device->limited = !isnan(drive->min_position) || !isnan(drive->max_position);
	device->object = (uint8_t)drive->address;
	device->axis = (enum xyza_axis)drive->axis;
	device->standing = true;
	device->delayed = true;
	device->first->axes[device->axis] = device;
}

static void leave_controller(struct db_device *device)
{
	device->first->axes[device->axis] = NULL;
}

/* --- the bus's side --------------------------------------------------------------------------- */

static void cut_frame(const struct db_received *received, size_t *skip, size_t *length)
{
	xyza_cut(received->bytes, received->available, skip, length);
}

static enum db_frame accept_frame(const struct db_bus_config *bus, const uint8_t *frame,
                                  size_t length, int *address)
{
	const struct xyza_options *given = bus->options;
	struct xyza_reply reply;

	switch (xyza_decode_reply(frame, length, &reply)) {
	case XYZA_OK:
		*address = reply.object;
		return DB_FRAME_GOOD;
	case XYZA_ERR_SIDE: /* our own request, echoed; or a controller that answers as a host */
		*address = reply.object;
		return DB_FRAME_FOREIGN;
	default:
		break;
	}
	/* The answer to a raw frame may be undocumented. */
	if (given->raw_frames == 0 || xyza_sender(frame, length) == 0)
		return DB_FRAME_BAD;
	*address = xyza_sender(frame, length);
	return DB_FRAME_GOOD;
}

static uint32_t part_of(const struct db_bus_config *bus, const uint8_t *frame, size_t length)
{
	(void)bus;
	return xyza_part(frame, length);
}

static void describe_frame(const struct db_bus_config *bus, bool sent, const uint8_t *frame,
                           size_t length, struct db_description *description)
{
	(void)bus;
	xyza_describe(frame, length, sent, description);
}

static db_time exchange_time(const struct db_bus_config *bus, unsigned reads)
{
	return (db_time)reads * (db_serial_wire_time(bus, XYZA_COMMAND_FRAME + XYZA_DATA_FRAME) +
	                         TYPICAL_LATENCY + (db_time)bus->turnaround_us * DB_NS_PER_US);
}

/* For a controller with one axis: standing, sign, magnitude, sign again, ports and program. */
#define POLL_EXCHANGES 6

static db_time poll_time(const struct db_bus_config *bus)
{
	return exchange_time(bus, POLL_EXCHANGES);
}

/* Time to read its standing, sign, magnitude and sign again. */
static db_time axis_time(const struct db_bus_config *bus)
{
	return exchange_time(bus, 4);
}

/* Time of a move at another speed: the speed is read, written and read back, then the jog and its
 * effect. */
static db_time command_time(const struct db_bus_config *bus)
{
	return exchange_time(bus, 5);
}

#define COMMANDS                                                                          \
	(DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) |                 \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |                \
	 DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | DB_COMMAND_BIT(DB_CMD_JOG_POSITIVE) |     \
	 DB_COMMAND_BIT(DB_CMD_JOG_NEGATIVE) | DB_COMMAND_BIT(DB_CMD_SET_POSITION) |      \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) |     \
	 DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS) | DB_COMMAND_BIT(DB_CMD_START_PROGRAM) |      \
	 DB_COMMAND_BIT(DB_CMD_PAUSE_PROGRAM) | DB_COMMAND_BIT(DB_CMD_CONTINUE_PROGRAM) | \
	 DB_COMMAND_BIT(DB_CMD_END_PROGRAM) | DB_COMMAND_BIT(DB_CMD_SINGLE_STEP) |        \
	 DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) | DB_COMMAND_BIT(DB_CMD_RAW_FRAME))

static uint64_t forbidden_commands(const struct db_bus_config *bus,
                                   const struct db_drive_config *drive)
{
	const struct xyza_options *given = bus->options;

	(void)drive;
	return given->raw_frames != 0 ? 0 : DB_COMMAND_BIT(DB_CMD_RAW_FRAME);
}

static void check_config(const struct db_bus_config *bus,
                         const struct db_drive_config *const *drives, size_t drive_count,
                         db_complain_fn *complain, void *context)
{
	const struct xyza_options *given = bus->options;

	(void)drives;
	(void)drive_count;
	if (given->raw_frames != 0)
		complain(context, NULL, false,
		         "raw-frames is on: who may write may send frames that the bridge cannot "
		         "judge, past limits, locks and unlock-system; turn it off when it is "
		         "not needed");
}

static enum db_result check_command(const struct db_bus_config *bus,
                                    const struct db_drive_config *drive, enum db_command command,
                                    const struct db_args *args)
{
	uint8_t frame[XYZA_FRAME_MAX];
	bool right = true;

	if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
	    !(COMMANDS & ~forbidden_commands(bus, drive) & DB_COMMAND_BIT(command)))
		return DB_RESULT_UNSUPPORTED;
	switch (command) {
	case DB_CMD_MOVE_VELOCITY: /* whole Hz on the wire */
		right = is_within(fabs((double)args->target_velocity), 0.5, 4294967040.0) ||
		        is_within((double)args->target_velocity, 0.0, 0.0);
		break;
	case DB_CMD_SET_POSITION:
		right = args->target_position != INT32_MIN;
		break;
	case DB_CMD_SET_OUTPUT:
		right = is_within(args->output_number, 1, XYZA_OUTPUTS) && args->output_value <= 1;
		break;
	case DB_CMD_SET_OUTPUTS:
		right = args->output_mask != 0 && args->output_mask < 1u << XYZA_OUTPUTS;
		break;
	case DB_CMD_START_PROGRAM:
		right = args->program_number <= UINT8_MAX && args->program_delay <= UINT8_MAX;
		break;
	case DB_CMD_SINGLE_STEP:
		right = args->output_value <= 1;
		break;
	case DB_CMD_RAW_FRAME:
		right = xyza_write_raw(args, (uint8_t)drive->address, frame, sizeof(frame)) > 0;
		break;
	default:
		break;
	}
	return right ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

static enum db_result check_param(const struct db_bus_config *bus, size_t param,
                                  union db_value value)
{
	const struct xyza_options *given = bus->options;
	bool unlocked = given->unlock_system != 0;
	unsigned access;

	if (param >= XYZA_SHOWN_COUNT)
		return DB_RESULT_UNSUPPORTED;
	/* It shows when the controller's speeds were read whether it can be sent this. */
	if (param >= XYZA_PARAM_COUNT)
		return value.f > 0.0f && isfinite(value.f) ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
	access = xyza_param_places[param].access;
	if (!(access & XYZA_CAN_WRITE) || ((access & XYZA_NEEDS_UNLOCK) && !unlocked))
		return DB_RESULT_UNSUPPORTED;
	return xyza_param_in_range((enum xyza_param)param, value) ? DB_RESULT_OK :
	                                                            DB_RESULT_OUT_OF_RANGE;
}

/* The document lists none: the usual ones. */
static const unsigned speeds[] = { 9600, 115200, 19200, 38400, 57600, 4800, 2400, 0 };

const struct db_driver db_driver_xyza = {
	.name = "xyza",
	.title = "XYZA stepper controller (5A A5) on RS485 or RS232",
	.medium = DB_MEDIUM_SERIAL,
	.address_min = 1,
	.address_max = XYZA_OBJECT_MAX,
	.default_baud = 9600,
	.axes = XYZA_AXIS_COUNT,
	.options = options,
	.option_count = sizeof(options) / sizeof(options[0]),
	.bus_options_size = sizeof(struct xyza_options),
	.acknowledges = true,
	.commands = COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS | DB_MEASURE_PROGRAM |
	            DB_MEASURE_RAW_ANSWER,
	.output_count = XYZA_OUTPUTS,
	.params = xyza_params,
	.param_count = XYZA_SHOWN_COUNT,
	.status_bits = status_bits,
	.status_bit_count = sizeof(status_bits) / sizeof(status_bits[0]),
	.param_page = 1,
	.acceleration_param = XYZA_RAMP_ACCELERATION,
	.deceleration_param = XYZA_RAMP_DECELERATION,
	.scale_unit = "mm",
	.preset_velocity_param = XYZA_MANUAL_SPEED,
	.check = check_command,
	.check_param = check_param,
	.forbidden = forbidden_commands,
	.check_config = check_config,
	.poll_time = poll_time,
	.axis_time = axis_time,
	.poll_exchanges = POLL_EXCHANGES,
	.command_time = command_time,
	.device_size = sizeof(struct db_device),
	.init = init_device,
	.leave = leave_controller,
	.inquire = xyza_inquire,
	.recognise = xyza_recognise,
	.speeds = speeds,
	.address_effect = DB_TAKES_EFFECT_AT_ONCE,
	.set_up_elsewhere =
		"the document of these controllers has no baud rate that could be set; their "
		"switches or the vendor's tool may",
	.cut = cut_frame,
	.accept = accept_frame,
	.part = part_of,
	.describe = describe_frame,
	.begin = xyza_begin,
	.answer = xyza_answer,
	.lost = xyza_lose_answer,
	.gone = xyza_gone,
	.feedback = xyza_write_feedback,
	.nameplate = get_nameplate,
};
