/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Servo drives on CAN. Velocity is in rpm, position in the drive's counts, current in A.
 *
 * Pages of the vendor's document are missing, so what is not written is refused:
 * - The mode cannot be read back. It is known once the drive acknowledged it, and forgotten when
 *   the drive goes offline. It is changed only at standstill.
 * - There is no stop frame. Stopping is speed 0 in speed mode and current 0 in current mode (the
 *   motor then coasts). Anything else, a position move above all, is only stopped by switching the
 *   power off, and so is a drive in sync mode: a sync frame would start what is staged on others.
 * - A position move is one rise of CTRG, which is dropped when the move has ended. What a second
 *   rise does before that is not documented: a move on top of another is refused as busy.
 * - Setting the position feedback of a motor that is held in position would make it jump: it is
 *   refused unless the motor is without power, or stands in speed or current mode.
 * - What a drive does with an old speed, current or position when its motor gets power again, or
 *   when a fault ends, is not documented: before enabling, the mode is selected, speed and current
 *   are set to 0 and the internal position to where the motor stands, each time, since nothing
 *   reports a short reset of the drive; then the motor is watched. On a fault, which the status
 *   shows before any report does, the power is switched off, or speed and current are set to 0.
 * - How late a drive may begin a motion is not documented: a motion is made impossible before it is
 *   reported as failed.
 * - Faults cannot be reset. clear_fault only resets what the bridge itself has latched.
 *
 * Acknowledgements contain the node and a code, and with speed and current what is measured (not
 * what was commanded). The scheduler has one exchange with a node in progress at a time.
 */
#include "codec/servo_can_describe.h"
#include "driver/list.h"
#include "driver/servo_can/frames.h"
#include "driver/servo_can/options.h"
#include "driver/servo_can/servo_can_private.h"

#include <string.h>

/* Usual time before a drive answers; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (300 * DB_NS_PER_US)

#define ANSWER_DATA 4 /* data bytes of the longest answer */

/* --- a drive ---------------------------------------------------------------------------------- */

static const struct db_nameplate *get_nameplate(const struct db_device *device)
{
	return &device->plate;
}

/* --- the bus's side --------------------------------------------------------------------------- */

/* Ids come in blocks of 32, one for each base; those of acknowledgements may lie across two. */
#define BLOCK 0x20u
#define BLOCK_MASK (DB_CAN_EXTENDED | DB_CAN_REMOTE | (DB_CAN_STANDARD_MASK & ~(BLOCK - 1)))

static size_t list_filters(const struct db_bus_config *bus, struct db_can_filter *filters)
{
	uint32_t ack_base = servo_can_read_layout(bus).ack_base;
	uint32_t first = (ack_base + 1) & ~(BLOCK - 1);
	uint32_t last = (ack_base + SERVO_CAN_NODE_MAX) & ~(BLOCK - 1);
	size_t count = 0;

	filters[count++] = (struct db_can_filter){ first, BLOCK_MASK };
	if (last != first)
		filters[count++] = (struct db_can_filter){ last, BLOCK_MASK };
	for (uint32_t id = SERVO_CAN_BASE_ANSWER_POSITION; id <= SERVO_CAN_BASE_ANSWER_ANALOGUE;
	     id += BLOCK)
		filters[count++] = (struct db_can_filter){ id, BLOCK_MASK };
	return count;
}

static enum db_frame accept_frame(const struct db_bus_config *bus, const uint8_t *bytes,
                                  size_t length, int *address)
{
	struct servo_can_layout layout = servo_can_read_layout(bus);
	struct servo_can_message message;
	struct db_can_frame frame;
	enum servo_can_error error;

	if (length != sizeof(frame))
		return DB_FRAME_BAD;
	memcpy(&frame, bytes, sizeof(frame));
	error = servo_can_decode(&frame, &layout, SERVO_CAN_FROM_DRIVE, &message);
	if (message.kind == SERVO_CAN_FOREIGN)
		return DB_FRAME_FOREIGN;
	*address = message.node;
	/* An undocumented code also acknowledges a frame, but not the one that was sent. */
	return error == SERVO_CAN_OK ||
	                       (error == SERVO_CAN_ERR_RANGE && message.kind == SERVO_CAN_ACK) ?
	               DB_FRAME_GOOD :
	               DB_FRAME_BAD;
}

static uint32_t part_of(const struct db_bus_config *bus, const uint8_t *bytes, size_t length)
{
	struct db_can_frame frame;
	uint32_t base;

	(void)bus;
	memcpy(&frame, bytes, length);
	/* A good frame: its id alone shows its content. No layout may use these ids for
	 * acknowledgements. */
	base = frame.id & ~(BLOCK - 1);
	return base == SERVO_CAN_BASE_ANSWER_POSITION || base == SERVO_CAN_BASE_ANSWER_MOTION ||
	                       base == SERVO_CAN_BASE_ANSWER_STATUS ?
	               base :
	               0;
}

static void describe_frame(const struct db_bus_config *bus, bool sent, const uint8_t *bytes,
                           size_t length, struct db_description *description)
{
	struct servo_can_layout layout = servo_can_read_layout(bus);
	struct db_can_frame frame = { .id = 0 };

	memcpy(&frame, bytes, length < sizeof(frame) ? length : sizeof(frame));
	servo_can_describe(&frame, &layout, sent ? SERVO_CAN_FROM_HOST : SERVO_CAN_FROM_DRIVE,
	                   description);
}

static db_time wire_time(const struct db_bus_config *bus, unsigned frames, unsigned data)
{
	unsigned bytes = servo_can_read_layout(bus).padded ? DB_CAN_DATA_MAX : data;
	unsigned bits = frames * db_can_frame_bits_max(false, bytes);

	return (db_time)bits * DB_NS_PER_S / (db_time)bus->bitrate;
}

static db_time poll_time(const struct db_bus_config *bus)
{
	return wire_time(bus, 1, 1) +
	       wire_time(bus, servo_can_count_bits(SERVO_CAN_ALL_PARTS), ANSWER_DATA) +
	       TYPICAL_LATENCY;
}

/* A position move: a read, then the mode, both edges of CTRG and the target, each acknowledged. */
static db_time command_time(const struct db_bus_config *bus)
{
	const unsigned frames = 4;

	return poll_time(bus) + wire_time(bus, frames, DB_CAN_DATA_MAX) +
	       wire_time(bus, frames, 1) + frames * TYPICAL_LATENCY;
}

/* Speed 0 is not among them: all drives would have to be in the same known mode. */
static bool write_broadcast(enum db_command command, const struct db_bus_config *bus,
                            struct db_exchange *exchange)
{
	struct servo_can_layout layout = servo_can_read_layout(bus);
	struct servo_can_message message = { .kind = SERVO_CAN_ENABLE,
		                             .node = SERVO_CAN_BROADCAST };
	struct db_can_frame frame;

	if (command != DB_CMD_DISABLE && command != DB_CMD_ENABLE)
		return false;
	message.u.enable = command == DB_CMD_ENABLE;
	if (servo_can_encode(&message, &layout, &frame) != SERVO_CAN_OK ||
	    exchange->request_size < sizeof(frame))
		return false;
	memcpy(exchange->request, &frame, sizeof(frame));
	exchange->request_length = sizeof(frame);
	exchange->answer_length = 0;
	return true;
}

static bool begin_all(const struct db_device *device, const struct db_exchange *prepared,
                      struct db_exchange *all)
{
	struct servo_can_message message;
	struct db_can_frame frame;

	memcpy(&frame, prepared->request, sizeof(frame));
	if (servo_can_decode(&frame, &device->layout, SERVO_CAN_FROM_HOST, &message) !=
	    SERVO_CAN_OK)
		return false;
	message.node = SERVO_CAN_BROADCAST;
	if (servo_can_encode(&message, &device->layout, &frame) != SERVO_CAN_OK ||
	    all->request_size < sizeof(frame))
		return false;
	memcpy(all->request, &frame, sizeof(frame));
	all->request_length = sizeof(frame);
	all->answer_length = 0;
	return true;
}

/* --- inquiries -------------------------------------------------------------------------------- */

/* The analogue input: a cycle reads other parts. Nodes are numbered, and speeds set, with the
 * vendor's tool, not over CAN. */
static bool write_inquiry(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                          struct db_exchange *exchange)
{
	struct servo_can_layout layout = servo_can_read_layout(bus);
	struct servo_can_message message = { .kind = SERVO_CAN_READ,
		                             .node = (uint8_t)inquiry->address };
	struct db_can_frame frame;

	if (inquiry->kind != DB_INQUIRY_THERE || inquiry->address < 1 ||
	    inquiry->address > SERVO_CAN_NODE_MAX)
		return false;
	message.u.selector = (uint8_t)servo_can_selector(SERVO_CAN_GIVES_ANALOGUE);
	if (servo_can_encode(&message, &layout, &frame) != SERVO_CAN_OK ||
	    exchange->request_size < sizeof(frame))
		return false;
	memcpy(exchange->request, &frame, sizeof(frame));
	exchange->request_length = sizeof(frame);
	exchange->answer_length = 8 + ANSWER_DATA;
	exchange->extra_time = 0;
	return true;
}

static enum db_recognised recognise_frame(const struct db_bus_config *bus,
                                          const struct db_inquiry *inquiry, const uint8_t *bytes,
                                          size_t length, struct db_inquired *sent)
{
	struct servo_can_layout layout = servo_can_read_layout(bus);
	struct servo_can_message message;
	struct db_can_frame frame;

	if (length != sizeof(frame))
		return DB_RECOGNISED_NOTHING;
	memcpy(&frame, bytes, sizeof(frame));
	if (servo_can_decode(&frame, &layout, SERVO_CAN_FROM_DRIVE, &message) != SERVO_CAN_OK ||
	    message.kind != SERVO_CAN_ANSWER_ANALOGUE || message.node != inquiry->address)
		return DB_RECOGNISED_NOTHING;
	if (sent->parts > 0)
		return DB_RECOGNISED_AGAIN;
	sent->parts = 1;
	return DB_RECOGNISED_ANSWER;
}

static const unsigned speeds[] = { 1000000, 500000, 250000, 125000, 100000, 800000, 50000, 0 };

const struct db_driver db_driver_servo_can = {
	.name = "servo-can",
	.title = "servo drive on CAN; velocity in rpm",
	.medium = DB_MEDIUM_CAN,
	.address_min = 1,
	.address_max = SERVO_CAN_NODE_MAX,
	.default_baud = 1000000,
	.options = servo_can_options,
	.option_count = SERVO_CAN_OPTION_COUNT,
	.bus_options_size = sizeof(struct servo_can_bus_options),
	.drive_options_size = sizeof(struct servo_can_drive_options),
	.acknowledges = true,
	.commands = SERVO_CAN_COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS | DB_MEASURE_VELOCITY |
	            DB_MEASURE_CURRENT | DB_MEASURE_FAULT_BITS | DB_MEASURE_SUPPLY_VOLTAGE |
	            DB_MEASURE_TEMPERATURE | DB_MEASURE_ANALOGUE | DB_MEASURE_RAW_HEALTH,
	.params = servo_can_params,
	.param_count = SERVO_CAN_PARAM_COUNT,
	.status_bits = servo_can_status_bits,
	.status_bit_count = SERVO_CAN_STATUS_BITS,
	.faults = servo_can_faults,
	.fault_count = SERVO_CAN_FAULTS,
	.param_page = 2,
	.acceleration_param = PARAM_ACCELERATION,
	.deceleration_param = PARAM_DECELERATION,
	.velocity_unit = "rpm",
	.preset_velocity_param = PARAM_MAX_SPEED,
	.velocity_counts = servo_can_velocity_counts,
	.check = servo_can_check_command,
	.check_param = servo_can_check_param,
	.forbidden = servo_can_forbidden,
	.check_config = servo_can_check_config,
	.poll_time = poll_time,
	.command_time = command_time,
	.device_size = sizeof(struct db_device),
	.init = servo_can_configure,
	.inquire = write_inquiry,
	.recognise = recognise_frame,
	.speeds = speeds,
	.set_up_elsewhere =
		"node number and bit rate of these servos are set with the vendor's tool, "
		"not over CAN",
	.filters = list_filters,
	.accept = accept_frame,
	.part = part_of,
	.describe = describe_frame,
	.begin = servo_can_begin,
	.answer = servo_can_answer,
	.lost = servo_can_lose_answer,
	.report = servo_can_take_report,
	.wants_poll = servo_can_wants_poll,
	.gone = servo_can_forget_state,
	.feedback = servo_can_write_feedback,
	.nameplate = get_nameplate,
	.broadcast = write_broadcast,
	.interrupt = servo_can_write_interrupt,
	.begin_all = begin_all,
	.begun_by_all = servo_can_begun_by_all,
};
