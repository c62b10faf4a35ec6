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

/* "00080381#01", as other tools print it. */
static void write_log(struct sim_node *node, const struct db_can_frame *frame, db_time now)
{
	struct sim_log_entry *entry = &node->log[node->received++ % SIM_LOG_LINES];
	bool extended = frame->id & DB_CAN_EXTENDED;
	int length = snprintf(entry->line, sizeof(entry->line), extended ? "%08X#" : "%03X#",
	                      frame->id & DB_CAN_ID_MASK);

	entry->time = now;
	for (unsigned i = 0; i < frame->length; i++)
		length += snprintf(entry->line + length, sizeof(entry->line) - (size_t)length,
		                   "%02X", frame->data[i]);
}

/* --- answers ---------------------------------------------------------------------------------- */

/* The id of an answer in this drive's form, in extended frames. */
static uint32_t dress_id(const struct sim_vsmd_can_node *node, uint32_t id)
{
	switch (node->node->drive->config.temper.replies) {
	case SIM_REPLIES_HOST_0:
		return id & ~TARGET_BITS;
	case SIM_REPLIES_BROADCAST:
		return id | BROADCAST_BIT;
	case SIM_REPLIES_STANDARD:
		return (id & SENDER_AND_CONTROL_BITS) >> 2 | (id & VSMD_CAN_STD_REG_MAX);
	case SIM_REPLIES_HOST:
	default:
		return id;
	}
}

static void queue_frame(struct sim_vsmd_can_node *node, const struct db_can_frame *frame,
                        db_time due)
{
	size_t place = (node->first + node->count) % SIM_VSMD_CAN_QUEUE;

	if (node->count == SIM_VSMD_CAN_QUEUE)
		return;
	node->count++;
	node->queue[place].due = due;
	node->queue[place].frame = *frame;
	node->queue[place].frame.id = dress_id(node, frame->id);
}

/* Queues a frame in this drive's form. */
static void queue_dressed(struct sim_vsmd_can_node *node, const struct db_can_frame *frame,
                          db_time due)
{
	enum sim_answers answers = node->node->drive->config.temper.answers;
	struct db_can_frame dressed = *frame;

	if (answers == SIM_ANSWERS_PADDED)
		dressed.length = DB_CAN_DATA_MAX;
	if (answers != SIM_ANSWERS_SINGLES || frame->length != DB_CAN_DATA_MAX) {
		queue_frame(node, &dressed, due);
		return;
	}
	dressed.length = DB_CAN_DATA_MAX / 2;
	queue_frame(node, &dressed, due);
	dressed.id++;
	memcpy(dressed.data, frame->data + dressed.length, dressed.length);
	queue_frame(node, &dressed, due);
}

static void queue_answer(struct sim_vsmd_can_node *node, enum vsmd_can_control control,
                         uint16_t host, unsigned first, const uint32_t *values, unsigned count,
                         db_time due)
{
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
	for (int i = 0; i < frame_count; i++)
		queue_dressed(node, &frames[i], due);
	node->node->replies++;
}

static bool answers_read(const struct sim_vsmd_temper *temper, unsigned count)
{
	return temper->read_max == 0 || count <= temper->read_max;
}

static void read_status(struct sim_vsmd_can_node *node, uint16_t host, unsigned first,
                        unsigned count, db_time now)
{
	uint32_t values[VSMD_CAN_REG_MAX + 1] = { 0 };
	struct sim_vsmd *drive = node->node->drive;
	struct vsmd_status status;
	char identity[VSMD_CAN_IDENTITY_MAX + 1];

	sim_vsmd_note_request(drive, first >= VSMD_CAN_IDENTITY, now);
	sim_vsmd_report_status(drive, true, now, &status);
	vsmd_can_put_status(&status, values);
	snprintf(identity, sizeof(identity), "%.*s", VSMD_CAN_IDENTITY_MAX, drive->identity);
	(void)vsmd_can_put_identity(identity, &values[VSMD_CAN_IDENTITY]);
	if (first + count > VSMD_CAN_REG_MAX + 1 || !answers_read(&drive->config.temper, count) ||
	    (drive->config.temper.hides_identity && first + count > VSMD_CAN_IDENTITY))
		return;
	queue_answer(node, VSMD_CAN_STATUS_REPLY, host, first, &values[first], count,
	             now + node->latency);
}

static void read_data(struct sim_vsmd_can_node *node, uint16_t host, unsigned first, unsigned count,
                      db_time now)
{
	uint32_t values[VSMD_CAN_READ_MAX] = { 0 };

	if (first > VSMD_CAN_DATA_LAST || count > VSMD_CAN_READ_MAX ||
	    !sim_vsmd_has_registers(&node->node->drive->config.temper, first, count) ||
	    sim_vsmd_hides_params(node->node->drive) ||
	    !answers_read(&node->node->drive->config.temper, count))
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

static enum vsmd_verb verb_of(enum vsmd_can_code code)
{
	switch (code) {
	case VSMD_CAN_ENA:
		return VSMD_ENA;
	case VSMD_CAN_OFF:
		return VSMD_OFF;
	case VSMD_CAN_ORG:
		return VSMD_ORG;
	case VSMD_CAN_STP:
		return VSMD_STP;
	case VSMD_CAN_MOV:
		return VSMD_MOV;
	case VSMD_CAN_POS:
		return VSMD_POS;
	case VSMD_CAN_RMV:
		return VSMD_RMV;
	case VSMD_CAN_SAV:
		return VSMD_SAV;
	case VSMD_CAN_OUTPUT:
		return VSMD_SENSOR_OUT;
	case VSMD_CAN_ZERO_START:
		return VSMD_ZERO_START;
	case VSMD_CAN_ZERO_STOP:
		return VSMD_ZERO_STOP;
	case VSMD_CAN_SV:
		return VSMD_SV;
	case VSMD_CAN_NMOS:
		return VSMD_NMOS;
	default: /* VSMD_CAN_ENCODER */
		return VSMD_ECLR;
	}
}

static void act(struct sim_vsmd_can_node *node, const struct vsmd_can_command *command, db_time now)
{
	struct vsmd_command order = {
		.verb = verb_of(command->code),
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
	enum vsmd_error error;
	uint32_t refusals;

	follow_power(node);
	if (!drive->powered || vsmd_can_unpack_id(frame->id, &id) != VSMD_OK || !is_for(node, &id))
		return;
	write_log(node->node, frame, now);
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
	                                         message.command.code == VSMD_CAN_READ_DATA))) {
		const struct sim_node *sim = node->node;

		sim_witness_report(&sim->witness, now,
		                   sim->log[(sim->received - 1) % SIM_LOG_LINES].line,
		                   sim->drive->refusals == refusals);
	}
}

/* --- sending ---------------------------------------------------------------------------------- */

static bool is_reporting(const struct sim_vsmd_can_node *node)
{
	return node->report != VSMD_CAN_REPORT_NONE && node->node->drive->powered;
}

static db_time next(void *self)
{
	struct sim_vsmd_can_node *node = self;
	db_time due;

	follow_power(node);
	due = is_reporting(node) ? node->report_at : DB_TIME_NEVER;
	if (!node->node->drive->powered)
		node->count = 0;
	if (node->count > 0 && node->queue[node->first].due < due)
		due = node->queue[node->first].due;
	return due;
}

static void queue_report(struct sim_vsmd_can_node *node)
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
	uint32_t values[VSMD_CAN_STATUS_REGS];
	struct vsmd_status status;
	unsigned first = parts[node->report].first;

	sim_vsmd_report_status(node->node->drive, false, node->report_at, &status);
	vsmd_can_put_status(&status, values);
	queue_answer(node, VSMD_CAN_STATUS_REPLY, node->reporting_to, first, &values[first],
	             parts[node->report].count, node->report_at);
	node->report_at += node->interval;
}

static bool send(void *self, db_time now, struct db_can_frame *frame)
{
	struct sim_vsmd_can_node *node = self;

	follow_power(node);
	if (is_reporting(node) && node->report_at <= now)
		queue_report(node);
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
