/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

#include <math.h>

/* As XYZA_SPEED_SHARE, in pulses per cycle. */
#define SPEED_PULSES 4.0f

uint32_t xyza_content(const struct xyza_reply *reply)
{
	if (reply->kind == XYZA_REPLY_PROGRAM_STATE)
		return reply->state | (uint32_t)reply->program << 8 | (uint32_t)reply->step << 16;
	return reply->value;
}

bool xyza_was_seen_elsewhere(const struct db_device *device, struct xyza_plan *plan)
{
	if (plan->entered == 0 || device->taken <= plan->entered)
		return false;
	if (!plan->from_known) {
		plan->from_known = true;
		plan->from = device->position;
	}
	return device->position != plan->from;
}

bool xyza_can_distinguish_speeds(const struct db_device *device, const struct xyza_plan *plan)
{
	float faster = fmaxf(fabsf(plan->speed), fabsf(plan->speed_before));
	float pulses = SPEED_PULSES * (float)DB_NS_PER_S / (float)device->span;

	return device->span > 0 &&
	       fabsf(plan->speed - plan->speed_before) > fmaxf(XYZA_SPEED_SHARE * faster, pulses);
}

bool xyza_has_ended(uint32_t content)
{
	return (content & UINT8_MAX) == XYZA_PROGRAM_IDLE;
}

bool xyza_has_stopped(uint32_t content)
{
	uint32_t state = content & UINT8_MAX;

	return state == XYZA_PROGRAM_WAITING || state == XYZA_PROGRAM_INTERRUPTED;
}

bool xyza_shows_effect(const struct xyza_plan *plan, const struct db_request *request,
                       uint32_t content)
{
	switch (request->command) {
	case DB_CMD_START_PROGRAM:
		return !xyza_has_ended(content) && content != plan->before &&
		       (content >> 8 & UINT8_MAX) == request->args->program_number;
	case DB_CMD_PAUSE_PROGRAM:
		return xyza_has_stopped(content) ||
		       (xyza_has_ended(content) && xyza_has_ended(plan->before));
	case DB_CMD_CONTINUE_PROGRAM:
		return content != plan->before;
	default:
		return xyza_has_ended(content);
	}
}
