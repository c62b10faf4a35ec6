/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/vsmd_private.h"

#include "driver/vsmd/can_frames.h"

#include <math.h>
#include <string.h>

/* Number of their intervals for which reports are trusted. */
#define REPORT_PATIENCE 3

/* --- answers ---------------------------------------------------------------------------------- */

void vsmd_can_take_read(struct db_device *device, db_time now)
{
	const struct vsmd_can_answer *answer = &device->answer;
	unsigned first = answer->id.reg;
	unsigned end = first + answer->count;
	const uint32_t *position = &answer->values[VSMD_CAN_STATUS_POSITION - first];
	float speed;

	/* A command looks for its effect more often than the drive is read: what it sees gives the
	 * direction, too. */
	if (end > VSMD_CAN_STATUS_POSITION)
		vsmd_follow_way(&device->axis, (int32_t)position[0]);
	if (end > VSMD_CAN_STATUS_WORD) {
		vsmd_take_confirmation(&device->axis, (int32_t)position[0], position[1], now);
	} else if (end > VSMD_CAN_STATUS_POSITION) {
		device->axis.last.position = (int32_t)position[0];
		device->axis.status_at = now;
	}
	/* With the position alone it would be of no use. */
	if (first == VSMD_CAN_STATUS_SPEED && answer->count != 2) {
		memcpy(&speed, &answer->values[0], sizeof(speed));
		vsmd_take_speed(&device->axis, vsmd_with_sign(&device->axis, speed));
	}
}

static void take_process(struct db_device *device, const uint32_t *values, db_time now)
{
	struct vsmd_status status;

	vsmd_can_get_status(values, &status);
	vsmd_take_status(&device->axis, &status, now);
	vsmd_follow_motion(&device->axis);
}

/*
 * Takes a position with the status that belongs to it, but no speed: that comes from this position
 * and the one before. Reports are sent at even intervals, however the line delays them: `interval`
 * is that interval, 0 for a position that was requested.
 */
static void take_place(struct db_device *device, int32_t position, uint32_t word, db_time interval,
                       db_time now)
{
	struct vsmd_status status = { .position = position, .status = word };
	db_time elapsed = now - device->base_at;
	double velocity = 0.0;

	if (interval > 0)
		elapsed = (elapsed + interval / 2) / interval * interval;
	if (elapsed < interval)
		elapsed = interval;
	if (device->has_base && elapsed > 0)
		velocity = vsmd_way(device->base, position) /
		           ((double)elapsed / (double)DB_NS_PER_S);
	/* A position that was set, by a current command or by hand, is no motion. */
	device->has_base = device->axis.effect_until <= now;
	device->base = position;
	device->base_at = now;
	/* A separate status shows that it stands. */
	if ((device->report == VSMD_CAN_REPORT_POSITION || !(word & VSMD_ST_STP)) &&
	    fabs(velocity) <= 2.0 * (double)VSMD_SPEED_MAX)
		status.velocity = (float)velocity;
	vsmd_take_status(&device->axis, &status, now);
}

void vsmd_can_take_poll(struct db_device *device, db_time now)
{
	const uint32_t *values = device->answer.values;

	if (!vsmd_can_lacks_speed(device)) {
		take_process(device, values, now);
		return;
	}
	take_place(device, (int32_t)values[0], values[1], 0, now);
	vsmd_follow_motion(&device->axis);
}

/* --- reports ---------------------------------------------------------------------------------- */

/* All three registers arrive in two frames, in this order. */
static bool take_report_of_all(struct db_device *device, const struct vsmd_can_message *message,
                               db_time now)
{
	if (message->id.reg == VSMD_CAN_STATUS_SPEED && message->count == 2) {
		memcpy(device->reported, message->values, 2 * sizeof(message->values[0]));
		device->half_reported = true;
		return true;
	}
	if (message->id.reg != VSMD_CAN_STATUS_WORD || message->count != 1 ||
	    !device->half_reported)
		return false;
	device->half_reported = false;
	device->reported[VSMD_CAN_STATUS_WORD] = message->values[0];
	device->reported_at = now;
	take_process(device, device->reported, now);
	return true;
}

/* A report has the form of an answer to a read of its content. */
bool vsmd_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                          db_time now)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	if (length != sizeof(frame))
		return false;
	memcpy(&frame, bytes, sizeof(frame));
	if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK ||
	    message.id.control != VSMD_CAN_STATUS_REPLY)
		return false;
	switch (device->report) {
	case VSMD_CAN_REPORT_ALL:
		return take_report_of_all(device, &message, now);
	case VSMD_CAN_REPORT_POSITION_STATUS:
		if (message.id.reg != VSMD_CAN_STATUS_POSITION || message.count != 2)
			return false;
		device->reported_at = now;
		take_place(device, (int32_t)message.values[0], message.values[1],
		           device->report_interval, now);
		vsmd_follow_motion(&device->axis);
		return true;
	case VSMD_CAN_REPORT_POSITION:
		/* Its status is the one read last; conclusions from it wait for the next one. */
		if (message.id.reg != VSMD_CAN_STATUS_POSITION || message.count != 1)
			return false;
		if (device->axis.has_status)
			take_place(device, (int32_t)message.values[0], device->axis.last.status,
			           device->report_interval, now);
		return true;
	case VSMD_CAN_REPORT_NONE:
	default:
		return false;
	}
}

bool vsmd_can_wants_poll(const struct db_device *device, db_time now)
{
	return device->report_interval == 0 || device->reported_at == 0 ||
	       now - device->reported_at > REPORT_PATIENCE * device->report_interval;
}

void vsmd_can_forget_state(struct db_device *device)
{
	vsmd_axis_gone(device);
	device->half_reported = false;
	device->reported_at = 0;
	device->has_base = false;
	/* A different drive may come back. */
	device->forms = 0;
	device->probe = VSMD_CAN_PROBE_IDENTITY;
	device->probe_known = device->probe_sent = device->reads_long = device->reads_short =
		device->poll_open = false;
	device->lost_reads = 0;
}
