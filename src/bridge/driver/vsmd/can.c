/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD steppers on CAN: their settings, the bus's side and the descriptor.
 *
 * Source: VSMD CAN 2.0 protocol, sections 1.2, 2, 3 and 4.
 */
#include "codec/vsmd_describe.h"
#include "driver/list.h"
#include "driver/vsmd/can_frames.h"
#include "driver/vsmd/commands.h"
#include "driver/vsmd/vsmd_private.h"

#include <string.h>

/* Usual time before a drive answers; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (500 * DB_NS_PER_US)

static const struct db_option options[] = {
	{
		.section = "bus",
		.name = "frames",
		.offset = offsetof(struct vsmd_can_options, frames),
		.words = "extended standard",
		.preset = "extended",
		.unit = "",
		.description =
			"Kind of CAN frames; standard ones reach the drives 1 to 15 and the "
			"first 32 registers, and how drives answer in them is not documented",
	},
	{
		.section = "bus",
		.name = "host-id",
		.offset = offsetof(struct vsmd_can_options, host_id),
		.words = "",
		.preset = "1",
		.min = 0,
		.max = VSMD_CAN_SOURCE_MAX,
		.whole = true,
		.unit = "",
		.description = "The bridge's own id in extended frames; drives answer to it",
	},
	{
		.section = "bus",
		.name = "output-base",
		.offset = offsetof(struct vsmd_can_options, output_base),
		.words = "",
		.preset = "1",
		.min = 0,
		.max = 1,
		.whole = true,
		.unit = "",
		.description =
			"What drives call their first output port: 1, or 0 on older firmware",
	},
	{
		.section = "bus",
		.name = "report-ms",
		.offset = offsetof(struct vsmd_can_options, report_ms),
		.words = "",
		.preset = "0",
		.min = 0,
		.max = 60000,
		.whole = true,
		.unit = "ms",
		.description = "Lets drives report their status by themselves at this interval "
			       "instead of asking them; 0 asks. Drives whose reports do not come "
			       "are asked",
	},
	{
		.section = "bus",
		.name = "report",
		.offset = offsetof(struct vsmd_can_options, report),
		.words = "all position-status position",
		.preset = "all",
		.unit = "",
		.description =
			"With report-ms, what drives report. Without the speed, velocity is "
			"computed from successive positions; without the status, it is still "
			"asked for every cycle",
	},
	VSMD_DRIVE_OPTIONS,
};

/* In the order of the option's words. */
static const enum vsmd_can_report reports[] = {
	VSMD_CAN_REPORT_ALL,
	VSMD_CAN_REPORT_POSITION_STATUS,
	VSMD_CAN_REPORT_POSITION,
};

static enum db_result check_command(const struct db_bus_config *bus,
                                    const struct db_drive_config *drive, enum db_command command,
                                    const struct db_args *args)
{
	(void)bus;
	(void)drive;
	return vsmd_check_command(&vsmd_can_link, command, args);
}

static enum db_result check_param(const struct db_bus_config *bus, size_t param,
                                  union db_value value)
{
	if (param >= VSMD_PARAM_COUNT ||
	    !vsmd_can_reg_reachable(vsmd_can_fields[param].reg, vsmd_can_style_of(bus).extended))
		return DB_RESULT_UNSUPPORTED;
	return vsmd_can_param_in_range((enum vsmd_param)param, value) ? DB_RESULT_OK :
	                                                                DB_RESULT_OUT_OF_RANGE;
}

/* --- state ------------------------------------------------------------------------------------ */

static void init_device(struct db_device *device, struct db_device *first,
                        const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	const struct vsmd_can_options *given = bus->options;

	(void)first; /* one drive per address */
	vsmd_axis_init(&device->axis, &vsmd_can_link, bus, drive);
	device->style = vsmd_can_style_of(bus);
	device->drive = drive->address;
	device->report_interval = (db_time)given->report_ms * DB_NS_PER_MS;
	if (device->report_interval > 0)
		device->report = reports[given->report];
	device->axis.computes_speed = device->report != VSMD_CAN_REPORT_NONE &&
	                              device->report != VSMD_CAN_REPORT_ALL;
}

/* --- the bus's side --------------------------------------------------------------------------- */

/* Over SLCAN this program receives every frame in any case; with SocketCAN the kernel filters
 * foreign frames, at no cost. */
static size_t list_filters(const struct db_bus_config *bus, struct db_can_filter *filters)
{
	struct vsmd_can_style style = vsmd_can_style_of(bus);

	if (bus->transport == &db_transport_slcan)
		return vsmd_can_any_answer_filters(filters);
	filters[0] = vsmd_can_answer_filter(&style);
	return 1;
}

static enum db_frame accept_frame(const struct db_bus_config *bus, const uint8_t *bytes,
                                  size_t length, int *address)
{
	struct vsmd_can_style style = vsmd_can_style_of(bus);
	struct vsmd_can_message message;
	struct db_can_frame frame;
	const struct vsmd_can_id *id = &message.id;
	enum vsmd_error error;

	if (length != sizeof(frame))
		return DB_FRAME_BAD;
	memcpy(&frame, bytes, sizeof(frame));
	error = vsmd_can_decode(&style, &frame, &message);
	*address = vsmd_can_suspect(&frame);
	/* An invalid id has the source 0, which no drive has. */
	if (id->source == 0 || id->extended != style.extended ||
	    (id->control != VSMD_CAN_STATUS_REPLY && id->control != VSMD_CAN_DATA_REPLY) ||
	    (id->extended && id->target != style.host))
		return DB_FRAME_FOREIGN;
	if (error != VSMD_OK)
		return DB_FRAME_BAD;
	*address = id->source;
	return DB_FRAME_GOOD;
}

static unsigned not_measured(const struct db_bus_config *bus)
{
	const struct vsmd_can_options *given = bus->options;

	return given->report_ms > 0.0 && reports[given->report] != VSMD_CAN_REPORT_ALL ?
	               DB_MEASURE_VELOCITY :
	               0;
}

static uint32_t part_of(const struct db_bus_config *bus, const uint8_t *bytes, size_t length)
{
	const struct vsmd_can_options *given = bus->options;
	struct db_can_frame frame;
	struct vsmd_can_id id;

	memcpy(&frame, bytes, length);
	/* A report looks like an answer. */
	if (given->report_ms > 0.0 || vsmd_can_unpack_id(frame.id, &id) != VSMD_OK)
		return 0;
	return id.control == VSMD_CAN_STATUS_REPLY ? 1u + id.reg : 0;
}

static void describe_frame(const struct db_bus_config *bus, bool sent, const uint8_t *bytes,
                           size_t length, struct db_description *description)
{
	struct vsmd_can_style style = vsmd_can_style_of(bus);
	struct db_can_frame frame = { .id = 0 };

	(void)sent; /* the frame shows its sender */
	memcpy(&frame, bytes, length < sizeof(frame) ? length : sizeof(frame));
	vsmd_can_describe(&style, &frame, description);
}

static db_time exchange_time(const struct db_bus_config *bus,
                             const struct vsmd_can_command *command, unsigned registers)
{
	struct vsmd_can_style style = vsmd_can_style_of(bus);
	struct db_can_frame frame;

	if (vsmd_can_encode_command(&style, 1, command, &frame) != VSMD_OK)
		return 0;
	return bus->transport->wire_time(bus, (const uint8_t *)&frame, sizeof(frame),
	                                 registers > 0 ? vsmd_can_answer_length(registers) : 0);
}

/* Drives respond in parallel, so a poll costs only its time on the wire. */
static db_time poll_time(const struct db_bus_config *bus)
{
	const struct vsmd_can_command read = { .code = VSMD_CAN_READ_STATUS,
		                               .first = 0,
		                               .count = 3 };

	return exchange_time(bus, &read, VSMD_CAN_STATUS_REGS);
}

static db_time command_time(const struct db_bus_config *bus)
{
	const struct vsmd_can_command move = { .code = VSMD_CAN_POS, .has_velocity = true };
	const struct vsmd_can_command read = { .code = VSMD_CAN_READ_STATUS,
		                               .first = 1,
		                               .count = 2 };

	return exchange_time(bus, &move, 0) + exchange_time(bus, &read, 2) + TYPICAL_LATENCY;
}

static bool write_one_frame(const struct vsmd_can_style *style, unsigned drive,
                            enum db_command command, struct db_exchange *exchange)
{
	const struct db_args none = { 0 };
	struct vsmd_command sent = vsmd_command_of(command, &none);
	struct vsmd_can_command frames[VSMD_CAN_BURST_MAX - 1];

	if (!(db_command_is_stop(command) || command == DB_CMD_ENABLE) ||
	    vsmd_can_frames_of(&sent, frames) != 1)
		return false;
	vsmd_can_start_burst(exchange, false);
	return vsmd_can_add_command(style, drive, &frames[0], exchange);
}

static bool write_broadcast(enum db_command command, const struct db_bus_config *bus,
                            struct db_exchange *exchange)
{
	struct vsmd_can_style style = vsmd_can_style_of(bus);

	return write_one_frame(&style, VSMD_CAN_BROADCAST, command, exchange);
}

/* Without the read that normally follows: its answer would be mistaken for the one that the drive
 * still owes. */
static bool write_interrupt(struct db_device *device, enum db_command command,
                            struct db_exchange *exchange)
{
	if (!write_one_frame(&device->style, device->drive, command, exchange))
		return false;
	/* What is read from now on may show it already; it is no restart then. */
	if (command == DB_CMD_DISABLE) {
		device->has_base = false;
		vsmd_expect_change(&device->axis);
	}
	return true;
}

/* The same frame, to all drives, without the read after it. */
static bool begin_all(const struct db_device *device, const struct db_exchange *prepared,
                      struct db_exchange *all)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	if (prepared->request_length != 2 * sizeof(frame))
		return false;
	memcpy(&frame, prepared->request, sizeof(frame));
	if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK)
		return false;
	vsmd_can_start_burst(all, false);
	return vsmd_can_add_command(&device->style, VSMD_CAN_BROADCAST, &message.command, all);
}

static void check_config(const struct db_bus_config *bus,
                         const struct db_drive_config *const *drives, size_t drive_count,
                         db_complain_fn *complain, void *context)
{
	if (vsmd_can_style_of(bus).extended)
		return;
	for (size_t i = 0; i < drive_count; i++) {
		if (drives[i]->address > VSMD_CAN_STD_DRIVE_MAX)
			complain(context, drives[i], true,
			         "address = %u cannot be said in standard frames; one from 1 to "
			         "%d, or frames = extended on bus '%s'",
			         drives[i]->address, VSMD_CAN_STD_DRIVE_MAX, bus->name);
	}
}

static const unsigned speeds[] = {
	100000, 125000, 250000, 500000, 1000000, 50000,  20000,  25000,
	30000,  40000,  60000,  75000,  80000,   90000,  150000, 200000,
	300000, 400000, 600000, 700000, 800000,  900000, 0,
};

const struct db_driver db_driver_vsmd_can = {
	.name = "vsmd-can",
	.title = "VSMD stepper on CAN",
	.medium = DB_MEDIUM_CAN,
	.address_min = 1,
	.address_max = VSMD_CAN_DRIVE_MAX,
	.default_baud = 100000,
	.vendor_layout = true,
	.options = options,
	.option_count = sizeof(options) / sizeof(options[0]),
	.bus_options_size = sizeof(struct vsmd_can_options),
	.drive_options_size = sizeof(struct vsmd_drive_options),
	.commands = VSMD_COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS | DB_MEASURE_VELOCITY,
	.output_count = 6,
	.params = vsmd_can_params,
	.param_count = VSMD_PARAM_COUNT,
	.status_bits = vsmd_status_bits,
	.status_bit_count = VSMD_STATUS_BITS,
	.param_page = 0,
	.acceleration_param = VSMD_ACC,
	.deceleration_param = VSMD_DEC,
	.preset_velocity_param = VSMD_SPD,
	.check = check_command,
	.check_param = check_param,
	.input_ports = vsmd_input_ports,
	.check_config = check_config,
	.poll_time = poll_time,
	.command_time = command_time,
	.refresh_pause = 1 * DB_NS_PER_S,
	.device_size = sizeof(struct db_device),
	.init = init_device,
	.inquire = vsmd_can_inquire,
	.recognise = vsmd_can_recognise,
	.speeds = speeds,
	.address_effect = DB_TAKES_EFFECT_POWER_UP,
	.speed_effect = DB_TAKES_EFFECT_POWER_UP,
	.filters = list_filters,
	.accept = accept_frame,
	.part = part_of,
	.not_measured = not_measured,
	.describe = describe_frame,
	.begin = vsmd_can_begin,
	.answer = vsmd_can_answer,
	.lost = vsmd_can_lose_answer,
	.report = vsmd_can_take_report,
	.wants_poll = vsmd_can_wants_poll,
	.gone = vsmd_can_forget_state,
	.feedback = vsmd_write_feedback,
	.nameplate = vsmd_get_nameplate,
	.broadcast = write_broadcast,
	.interrupt = write_interrupt,
	.begin_all = begin_all,
	.begun_by_all = vsmd_begun_by_all,
};
