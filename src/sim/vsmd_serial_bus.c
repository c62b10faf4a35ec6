/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/serial_bus.h"

#include "codec/vsmd_serial_frames.h"
#include "sim/vsmd_drive.h"
#include "sim/vsmd_mechanics.h"

#include <string.h>

#define LINE_END '\n'
#define FRAME_START 0xff

static bool ends_request(uint8_t *bytes, size_t *length, uint8_t newest)
{
	(void)bytes;
	(void)length;
	return newest == LINE_END;
}

/* The reply put on the wire, or null. */
static struct sim_burst *reply(struct sim_serial_bus *bus, struct sim_node *node,
                               enum vsmd_reply_code code, db_time now)
{
	struct sim_burst *burst = sim_serial_bus_begin(bus, node);
	struct sim_vsmd *drive = node->drive;
	unsigned id = bus->config.rs485 ? drive->address : bus->config.reply_id;
	char params[VSMD_SERIAL_FRAME_MAX];
	char dressed[VSMD_SERIAL_FRAME_MAX];
	const char *text = params;
	struct vsmd_status status;
	int length;

	if (!burst)
		return NULL;
	if (sim_serial_bus_take(bus, node, SIM_FAULT_WRONG_ID))
		id = id % VSMD_SERIAL_ID_MAX + 1;
	if (code == VSMD_REPLY_STATUS) {
		sim_vsmd_report_status(drive, false, now, &status);
		length = vsmd_serial_encode_status((uint8_t)id, &status, burst->bytes,
		                                   SIM_SERIAL_REPLY_MAX);
	} else {
		if (code == VSMD_REPLY_IDENTITY) {
			text = drive->identity;
			length = (int)strlen(text);
		} else {
			length = vsmd_serial_format_params(drive->params, params, sizeof(params));
		}
		if (length >= 0)
			length = sim_vsmd_dress_text(&drive->config.temper, text, (size_t)length,
			                             dressed, sizeof(dressed));
		if (length >= 0)
			length = vsmd_serial_encode_text((uint8_t)id, code, dressed, (size_t)length,
			                                 burst->bytes, SIM_SERIAL_REPLY_MAX);
	}
	if (length < 0)
		return NULL;
	sim_serial_bus_send(bus, node, burst, (size_t)length, now);
	return burst;
}

/* Lets one drive process the request. */
static struct sim_burst *serve_drive(struct sim_serial_bus *bus, struct sim_node *node,
                                     const struct sim_serial_request *request,
                                     const struct vsmd_command *command, enum vsmd_error error)
{
	bool broadcast = bus->config.rs485 && command->id == VSMD_SERIAL_BROADCAST;
	enum vsmd_reply_code code = VSMD_REPLY_STATUS;
	uint32_t refusals = node->drive->refusals;
	struct sim_burst *burst;

	/* A drive that is not on the bus, or off, or at another speed, receives nothing. */
	if (!(node->drive->powered && node->drive->baud == bus->config.baud &&
	      sim_serial_bus_connects(bus, node)) ||
	    sim_serial_bus_take(bus, node, SIM_FAULT_LOSE_REQUEST)) {
		bus->stats.missed++;
		return NULL;
	}
	sim_serial_bus_log(node, request, (const char *)request->bytes, request->length - 1);
	if (error == VSMD_OK && command->verb == VSMD_STP &&
	    sim_serial_bus_take(bus, node, SIM_FAULT_RUNAWAY))
		return broadcast ? NULL : reply(bus, node, code, request->end);
	if (error == VSMD_OK)
		code = sim_vsmd_execute(node->drive, command, request->end);
	else
		sim_vsmd_refuse(node->drive, request->end);
	if (error != VSMD_OK || (command->verb != VSMD_DEV && command->verb != VSMD_STS &&
	                         command->verb != VSMD_CFG_READ))
		sim_serial_bus_testify(node, node->drive->refusals == refusals);
	sim_vsmd_settle(node->drive, false);
	burst = broadcast || (error == VSMD_OK && command->verb == VSMD_CFG_READ &&
	                      node->drive->config.temper.parameters == SIM_PARAMETERS_SILENT) ?
	                NULL :
	                reply(bus, node, code, request->end);
	sim_vsmd_settle(node->drive, true);
	return burst;
}

static bool is_for(const struct sim_node *node, const struct vsmd_command *command, bool rs485)
{
	if (!rs485)
		return true;
	if (command->id == VSMD_SERIAL_BROADCAST)
		return !node->drive->config.temper.ignores_broadcast;
	return command->id >= 0 && command->id <= VSMD_SERIAL_ID_MAX &&
	       command->id == (int)node->drive->address;
}

/* A line as received by a drive. */
struct request_line {
	struct sim_serial_request request;
	struct vsmd_command command;
	enum vsmd_error error;
	struct vsmd_setting settings[VSMD_PARAM_COUNT * 2];
};

static void decode_line(struct request_line *received, bool rs485,
                        struct sim_serial_request request)
{
	received->request = request;
	received->command = (struct vsmd_command){ .id = -2 };
	received->error = vsmd_serial_decode_command((const char *)request.bytes,
	                                             request.length - 1, rs485, &received->command,
	                                             received->settings, VSMD_PARAM_COUNT * 2);
}

static void process(struct sim_serial_bus *bus, const struct sim_serial_request *request)
{
	bool rs485 = bus->config.rs485;
	struct sim_burst *answer = NULL;
	struct request_line whole;
	struct request_line rest;
	bool known = false;

	decode_line(&whole, rs485, *request);
	for (size_t i = 0; i < bus->node_count; i++) {
		struct sim_node *node = bus->nodes[i];
		const struct request_line *received = &whole;
		size_t missed = sim_serial_bus_missed(bus, node, request);
		bool meant = is_for(node, &whole.command, rs485);

		known |= meant;
		bus->stats.missed += meant && missed > 0;
		if (missed == request->length)
			continue;
		if (missed > 0) {
			decode_line(&rest, rs485,
			            (struct sim_serial_request){ request->bytes + missed,
			                                         request->length - missed,
			                                         request->start, request->end });
			received = &rest;
		}
		if (!is_for(node, &received->command, rs485))
			continue;
		answer = sim_serial_bus_overlap(bus, answer,
		                                serve_drive(bus, node, &received->request,
		                                            &received->command, received->error));
	}
	bus->stats.foreign += !known;
}

const struct sim_serial_protocol sim_vsmd_serial_protocol = {
	.ends = ends_request,
	.untraced = 1,
	.garbage = FRAME_START,
	.process = process,
};
