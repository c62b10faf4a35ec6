/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/servo_can_node.h"
#include "sim/servo_drive.h"

#include <string.h>

static bool enqueue(struct sim_servo_node *node, struct servo_can_message *message, db_time due)
{
	struct db_can_frame *frame;

	message->node = node->address;
	if (node->queued == SIM_SERVO_QUEUE) {
		node->lost++;
		return false;
	}
	frame = &node->queue[node->queued].frame;
	if (servo_can_encode(message, &node->layout, frame) != SERVO_CAN_OK)
		return false;
	/* The encoder leaves the rest of a frame 0. */
	if (node->lengths == SIM_SERVO_ALWAYS_EIGHT ||
	    (node->lengths == SIM_SERVO_MIXED && (node->answers + node->reports) % 2 == 1))
		frame->length = DB_CAN_DATA_MAX;
	else if (node->lengths == SIM_SERVO_TOO_SHORT)
		frame->length--;
	node->queue[node->queued++].due = due;
	return true;
}

static bool is_for(const struct sim_servo_node *node, const struct servo_can_message *message)
{
	if (message->kind == SERVO_CAN_SYNC || message->node == node->address)
		return true;
	return message->node == SERVO_CAN_BROADCAST &&
	       !node->drive->config.temper.ignores_broadcast;
}

void sim_servo_node_receive(void *self, const struct db_can_frame *frame, db_time now)
{
	struct sim_servo_node *node = self;
	struct servo_can_message replies[SIM_SERVO_REPLIES];
	struct servo_can_message message;
	char text[SIM_CAN_TEXT_MAX];
	enum servo_can_error error;
	size_t count = 0;
	db_time due;

	error = servo_can_decode(frame, &node->layout, SERVO_CAN_FROM_HOST, &message);
	if (message.kind == SERVO_CAN_FOREIGN && error == SERVO_CAN_OK)
		return;
	if (!is_for(node, &message))
		return;
	node->received++;
	/* A drive's answer to an unknown frame is not documented: none here. */
	if (error == SERVO_CAN_OK)
		count = sim_servo_execute(node->drive, &message, &node->layout, now, replies);
	else
		node->unknown++;
	if (message.kind != SERVO_CAN_READ && node->drive->powered) {
		(void)sim_can_text(frame, text);
		sim_witness_report(&node->witness, now, text, error == SERVO_CAN_OK);
	}
	due = now + node->latency + (message.kind == SERVO_CAN_READ ? 0 : node->ack_latency);
	if (node->stray_acks && count > 0 && replies[0].kind == SERVO_CAN_ACK) {
		/* An acknowledgement of something other than the real one acknowledges. */
		struct servo_can_message stray = { .kind = SERVO_CAN_ACK };

		stray.u.ack.code = replies[0].u.ack.code == SERVO_CAN_ACK_ENABLE ?
		                           SERVO_CAN_ACK_MODE :
		                           SERVO_CAN_ACK_ENABLE;
		node->answers += enqueue(node, &stray, due);
	}
	for (size_t i = 0; i < count; i++)
		node->answers += enqueue(node, &replies[i], due);
}

db_time sim_servo_node_next(void *self)
{
	const struct sim_servo_node *node = self;
	db_time next = sim_servo_next(node->drive);

	for (unsigned i = 0; i < node->queued; i++) {
		if (node->queue[i].due < next)
			next = node->queue[i].due;
	}
	return next;
}

bool sim_servo_node_send(void *self, db_time now, struct db_can_frame *frame)
{
	struct sim_servo_node *node = self;
	struct servo_can_message report;

	if (!node->drive->powered)
		node->queued = 0;
	while (sim_servo_report(node->drive, now, &report))
		node->reports += enqueue(node, &report, now);
	for (unsigned i = 0; i < node->queued; i++) {
		if (node->queue[i].due > now)
			continue;
		*frame = node->queue[i].frame;
		node->queued--;
		memmove(&node->queue[i], &node->queue[i + 1],
		        (node->queued - i) * sizeof(node->queue[0]));
		return true;
	}
	return false;
}

/* --- as a station ----------------------------------------------------------------------------- */

static bool station_wants(void *self, const struct db_can_frame *frame)
{
	const struct sim_servo_node *node = self;
	struct servo_can_message message;
	enum servo_can_error error = servo_can_decode(frame, &node->layout, SERVO_CAN_FROM_HOST,
	                                              &message);

	if (message.kind == SERVO_CAN_FOREIGN && error == SERVO_CAN_OK)
		return false;
	return is_for(node, &message);
}

struct sim_can_station sim_servo_node_station(struct sim_servo_node *node)
{
	return (struct sim_can_station){
		.self = node,
		.receive = sim_servo_node_receive,
		.next = sim_servo_node_next,
		.send = sim_servo_node_send,
		.wants = station_wants,
		.faults = &node->faults,
	};
}
