/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/vsmd_can_node.h"
#include "sim/vsmd_mechanics.h"

#include <stdio.h>
#include <string.h>

/* A bit of the drive's field in the id: inverted, it names another drive. */
#define SENDER_BIT_EXTENDED (1u << 10)
#define SENDER_BIT_STANDARD (1u << 8)

/* The target's bits in an extended id. */
#define TARGET_BITS (0x1FFu << 19)
#define BROADCAST_BIT (1u << 18)
/* the part for which a standard id has room */
#define SENDER_AND_CONTROL_BITS (0xFu << 9 | 3u << 7)

void sim_vsmd_can_node_init(struct sim_vsmd_can_node *node, struct sim_node *sim,
                            const struct vsmd_can_style *style, db_time latency)
{
	memset(node, 0, sizeof(*node));
	node->node = sim;
	node->style = *style;
	node->latency = latency;
	node->interval = (db_time)VSMD_CAN_INTERVAL_DEFAULT * DB_NS_PER_MS;
	node->shake_frequency = VSMD_SHAKE_FREQ_MIN_CAN;
	node->starts = sim->drive->starts;
}

/* Messages from before a power loss are dropped: reports have to be requested again. */
static void follow_power(struct sim_vsmd_can_node *node)
{
	const struct vsmd_can_style style = node->style;

	if (node->starts != node->node->drive->starts)
		sim_vsmd_can_node_init(node, node->node, &style, node->latency);
}

/* --- answers ---------------------------------------------------------------------------------- */

static void queue_frame(struct sim_vsmd_can_node *node, const struct db_can_frame *frame,
                        db_time due)
{
	size_t place = (node->first + node->count) % SIM_VSMD_CAN_QUEUE;
	uint32_t id = frame->id;

	if (node->count == SIM_VSMD_CAN_QUEUE)
		return;
	/* The id of an answer in this drive's form, in extended frames. */
	switch (node->node->drive->config.temper.replies) {
	case SIM_REPLIES_HOST_0:
		id &= ~TARGET_BITS;
		break;
	case SIM_REPLIES_BROADCAST:
		id |= BROADCAST_BIT;
		break;
	case SIM_REPLIES_STANDARD:
		id = (id & SENDER_AND_CONTROL_BITS) >> 2 | (id & VSMD_CAN_STD_REG_MAX);
		break;
	case SIM_REPLIES_HOST:
	default:
		break;
	}
	node->count++;
	node->queue[place].due = due;
	node->queue[place].frame = *frame;
	node->queue[place].frame.id = id;
}

static void queue_answer(struct sim_vsmd_can_node *node, enum vsmd_can_control control,
                         uint16_t host, unsigned first, const uint32_t *values, unsigned count,
                         db_time due)
{
	enum sim_answers answers = node->node->drive->config.temper.answers;
	struct vsmd_can_style style = node->style;
	struct db_can_frame frames[VSMD_CAN_READ_MAX / VSMD_CAN_FRAME_REGS];
	int frame_count;

	style.host = host;
	if (due < node->busy_until)
		due = node->busy_until;
	node->busy_until = due;
	frame_count = vsmd_can_encode_answer(&style, node->node->drive->address, control, first,
	                                     values, count, frames,
	                                     sizeof(frames) / sizeof(frames[0]));
	/* In this drive's form. */
	for (int i = 0; i < frame_count; i++) {
		struct db_can_frame frame = frames[i];

		if (answers == SIM_ANSWERS_PADDED)
			frame.length = DB_CAN_DATA_MAX;
		if (answers == SIM_ANSWERS_SINGLES && frames[i].length == DB_CAN_DATA_MAX) {
			frame.length = DB_CAN_DATA_MAX / 2;
			queue_frame(node, &frame, due);
			frame.id++;
			memcpy(frame.data, frames[i].data + frame.length, frame.length);
		}
		queue_frame(node, &frame, due);
	}
	node->node->replies++;
}

static void read_status(struct sim_vsmd_can_node *node, uint16_t host, unsigned first,
                        unsigned count, db_time now)
{
	uint32_t values[VSMD_CAN_REG_MAX + 1] = { 0 };
	struct sim_vsmd *drive = node->node->drive;
	const struct sim_vsmd_temper *temper = &drive->config.temper;
	struct vsmd_status status;
	char identity[VSMD_CAN_IDENTITY_MAX + 1];

	sim_vsmd_note_request(drive, first >= VSMD_CAN_IDENTITY, now);
	sim_vsmd_report_status(drive, true, now, &status);
	vsmd_can_put_status(&status, values);
	snprintf(identity, sizeof(identity), "%.*s", VSMD_CAN_IDENTITY_MAX, drive->identity);
	(void)vsmd_can_put_identity(identity, &values[VSMD_CAN_IDENTITY]);
	if (first + count > VSMD_CAN_REG_MAX + 1 ||
	    (temper->read_max != 0 && count > temper->read_max) ||
	    (temper->hides_identity && first + count > VSMD_CAN_IDENTITY))
		return;
	queue_answer(node, VSMD_CAN_STATUS_REPLY, host, first, &values[first], count,
	             now + node->latency);
}

static void read_data(struct sim_vsmd_can_node *node, uint16_t host, unsigned first, unsigned count,
                      db_time now)
{
	uint32_t values[VSMD_CAN_READ_MAX] = { 0 };
	const struct sim_vsmd_temper *temper = &node->node->drive->config.temper;

	if (first > VSMD_CAN_DATA_LAST || count > VSMD_CAN_READ_MAX ||
	    !sim_vsmd_has_registers(temper, first, count) ||
	    sim_vsmd_hides_params(node->node->drive) ||
	    (temper->read_max != 0 && count > temper->read_max))
		return;
	for (unsigned i = 0; i < count; i++) {
		enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
		size_t fields = vsmd_can_params_of(first + i, params);

		for (size_t k = 0; k < fields; k++)
			(void)vsmd_can_insert(params[k], node->node->drive->params[params[k]],
			                      &values[i]);
	}
	queue_answer(node, VSMD_CAN_DATA_REPLY, host, first, values, count, now + node->latency);
}

/* --- the host's messages ---------------------------------------------------------------------- */

/* Writes those parameters of a register that differ from their former values. */
static void write_register(struct sim_vsmd_can_node *node, unsigned reg, uint32_t raw, db_time now)
{
	struct sim_vsmd *drive = node->node->drive;
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
	struct vsmd_setting settings[VSMD_CAN_FIELDS_MAX];
	struct vsmd_command command = { .verb = VSMD_CFG_WRITE, .settings = settings };
	size_t count = vsmd_can_params_of(reg, params);
	bool right = count > 0;

	if (!sim_vsmd_has_registers(&drive->config.temper, reg, 1))
		return;
	for (size_t i = 0; i < count; i++) {
		union db_value value;

		if (vsmd_can_extract(params[i], raw, &value) != VSMD_OK) {
			right = false;
		} else if (value.u != drive->params[params[i]].u) {
			settings[command.setting_count].param = params[i];
			settings[command.setting_count++].value = value;
		}
	}
	if (!right)
		sim_vsmd_refuse(drive, now);
	else if (command.setting_count > 0)
		(void)sim_vsmd_execute(drive, &command, now);
	sim_vsmd_settle(drive, true);
}

static void shake(struct sim_vsmd_can_node *node, const struct vsmd_can_command *command,
                  db_time now)
{
	struct vsmd_command start = {
		.shake_start = node->shake_start,
		.shake_end = node->shake_end,
		.shake_frequency = node->shake_frequency,
		.shake_count = command->shake_count,
	};

	switch (command->shake) {
	case VSMD_CAN_SHAKE_START_AT:
		node->shake_start = command->position;
		return;
	case VSMD_CAN_SHAKE_END_AT:
		node->shake_end = command->position;
		return;
	case VSMD_CAN_SHAKE_FREQUENCY:
		node->shake_frequency = command->shake_frequency;
		return;
	case VSMD_CAN_SHAKE_CYCLES:
		start.verb = VSMD_SHAKE_CYCLES;
		break;
	case VSMD_CAN_SHAKE_TIME:
		start.verb = VSMD_SHAKE_TIME;
		break;
	case VSMD_CAN_SHAKE_STOP:
	default:
		start.verb = VSMD_SHAKE_STOP;
		break;
	}
	(void)sim_vsmd_execute(node->node->drive, &start, now);
}

static void act(struct sim_vsmd_can_node *node, const struct vsmd_can_command *command, db_time now)
{
	static const enum vsmd_verb verbs[] = {
		[VSMD_CAN_ENA] = VSMD_ENA,
		[VSMD_CAN_OFF] = VSMD_OFF,
		[VSMD_CAN_ORG] = VSMD_ORG,
		[VSMD_CAN_STP] = VSMD_STP,
		[VSMD_CAN_MOV] = VSMD_MOV,
		[VSMD_CAN_POS] = VSMD_POS,
		[VSMD_CAN_RMV] = VSMD_RMV,
		[VSMD_CAN_SAV] = VSMD_SAV,
		[VSMD_CAN_OUTPUT] = VSMD_SENSOR_OUT,
		[VSMD_CAN_ZERO_START] = VSMD_ZERO_START,
		[VSMD_CAN_ZERO_STOP] = VSMD_ZERO_STOP,
		[VSMD_CAN_SV] = VSMD_SV,
		[VSMD_CAN_NMOS] = VSMD_NMOS,
		[VSMD_CAN_ENCODER] = VSMD_ECLR,
	};
	struct vsmd_command order = {
		.verb = verbs[command->code],
		.has_value = command->code == VSMD_CAN_STP || command->has_position,
		.has_velocity = command->has_velocity,
		.position = command->position,
		.velocity = command->velocity,
		.port = command->port,
		.value = command->value,
	};

	if (order.verb == VSMD_STP && sim_faults_take(&node->node->faults, SIM_FAULT_RUNAWAY))
		return;
	(void)sim_vsmd_execute(node->node->drive, &order, now);
}

static void obey(struct sim_vsmd_can_node *node, const struct vsmd_can_message *message,
                 db_time now)
{
	const struct vsmd_can_command *command = &message->command;
	uint16_t host = message->id.source;

	switch (command->code) {
	case VSMD_CAN_READ_STATUS:
		read_status(node, host, command->first, command->count, now);
		break;
	case VSMD_CAN_READ_DATA:
		read_data(node, host, command->first, command->count, now);
		break;
	case VSMD_CAN_AUTO_RES_STS:
		node->report = command->report;
		node->reporting_to = host;
		if (command->has_interval)
			node->interval = (db_time)(command->interval > 0 ? command->interval : 1) *
			                 DB_NS_PER_MS; /* the meaning of 0 is not documented */
		node->report_at = now + node->interval;
		break;
	case VSMD_CAN_SHAKE:
		shake(node, command, now);
		break;
	default:
		act(node, command, now);
		break;
	}
}

static bool is_for(const struct sim_vsmd_can_node *node, const struct vsmd_can_id *id)
{
	if (id->control != VSMD_CAN_COMMAND && id->control != VSMD_CAN_DATA_WRITE)
		return false;
	return id->extended == node->style.extended &&
	       ((id->broadcast && !node->node->drive->config.temper.ignores_broadcast) ||
	        id->target == node->node->drive->address);
}

static bool wants(void *self, const struct db_can_frame *frame)
{
	struct vsmd_can_id id;

	return vsmd_can_unpack_id(frame->id, &id) == VSMD_OK && is_for(self, &id);
}

static void receive(void *self, const struct db_can_frame *frame, db_time now)
{
	struct sim_vsmd_can_node *node = self;
	struct sim_vsmd *drive = node->node->drive;
	struct vsmd_can_message message;
	struct vsmd_can_id id;
	struct sim_log_entry *entry;
	enum vsmd_error error;
	uint32_t refusals;

	follow_power(node);
	if (!drive->powered || vsmd_can_unpack_id(frame->id, &id) != VSMD_OK || !is_for(node, &id))
		return;
	entry = &node->node->log[node->node->received++ % SIM_LOG_LINES];
	entry->time = now;
	(void)sim_can_text(frame, entry->line);
	sim_vsmd_note_request(drive, false, now);
	refusals = drive->refusals;
	error = vsmd_can_decode(&node->style, frame, &message);
	if (error != VSMD_OK)
		sim_vsmd_refuse(drive, now);
	else if (id.control == VSMD_CAN_COMMAND)
		obey(node, &message, now);
	else {
		for (unsigned i = 0; i < message.count; i++)
			write_register(node, id.reg + i, message.values[i], now);
	}
	if (error != VSMD_OK ||
	    !(id.control == VSMD_CAN_COMMAND && (message.command.code == VSMD_CAN_READ_STATUS ||
	                                         message.command.code == VSMD_CAN_READ_DATA)))
		sim_witness_report(&node->node->witness, now, entry->line,
		                   drive->refusals == refusals);
}

/* --- sending ---------------------------------------------------------------------------------- */

static db_time next(void *self)
{
	struct sim_vsmd_can_node *node = self;
	db_time due;

	follow_power(node);
	if (!node->node->drive->powered) {
		node->count = 0;
		return DB_TIME_NEVER;
	}
	due = node->report == VSMD_CAN_REPORT_NONE ? DB_TIME_NEVER : node->report_at;
	if (node->count > 0 && node->queue[node->first].due < due)
		due = node->queue[node->first].due;
	return due;
}

static bool send(void *self, db_time now, struct db_can_frame *frame)
{
	static const struct {
		uint8_t first;
		uint8_t count;
	} parts[] = {
		[VSMD_CAN_REPORT_NONE] = { 0, 0 },
		[VSMD_CAN_REPORT_ALL] = { VSMD_CAN_STATUS_SPEED, 3 },
		[VSMD_CAN_REPORT_POSITION_STATUS] = { VSMD_CAN_STATUS_POSITION, 2 },
		[VSMD_CAN_REPORT_POSITION] = { VSMD_CAN_STATUS_POSITION, 1 },
	};
	struct sim_vsmd_can_node *node = self;

	follow_power(node);
	if (node->report != VSMD_CAN_REPORT_NONE && node->node->drive->powered &&
	    node->report_at <= now) {
		uint32_t values[VSMD_CAN_STATUS_REGS];
		struct vsmd_status status;
		unsigned first = parts[node->report].first;

		sim_vsmd_report_status(node->node->drive, false, node->report_at, &status);
		vsmd_can_put_status(&status, values);
		queue_answer(node, VSMD_CAN_STATUS_REPLY, node->reporting_to, first, &values[first],
		             parts[node->report].count, node->report_at);
		node->report_at += node->interval;
	}
	if (node->count == 0 || node->queue[node->first].due > now)
		return false;
	*frame = node->queue[node->first].frame;
	node->first = (node->first + 1) % SIM_VSMD_CAN_QUEUE;
	node->count--;
	return true;
}

struct sim_can_station sim_vsmd_can_node_station(struct sim_vsmd_can_node *node)
{
	return (struct sim_can_station){
		.self = node,
		.receive = receive,
		.next = next,
		.send = send,
		.wants = wants,
		.sender_bit = node->style.extended ? SENDER_BIT_EXTENDED : SENDER_BIT_STANDARD,
		.faults = &node->node->faults,
	};
}
