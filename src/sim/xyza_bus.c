/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/serial_bus.h"

#include "codec/xyza_frames.h"
#include "sim/xyza_controller.h"

#include <stdio.h>
#include <string.h>

#define FRAME_START 0x5a
/* An incomplete request is dropped after a silence that no host makes within one. */
#define PATIENCE (100 * DB_NS_PER_MS)
#define HEX_DIGITS 3 /* characters per byte in the log */

static bool ends_request(uint8_t *bytes, size_t *length, uint8_t newest)
{
	size_t skip;
	size_t frame;

	(void)newest;
	xyza_cut(bytes, *length, &skip, &frame);
	memmove(bytes, bytes + skip, *length - skip);
	*length -= skip;
	return frame > 0;
}

#define LEVEL_AT 4 /* index in a frame */

/* Lets one controller process the request. Its reply put on the wire, or null. */
static struct sim_burst *serve_controller(struct sim_serial_bus *bus, struct sim_node *node,
                                          const struct sim_serial_request *request,
                                          const struct xyza_request *decoded, enum xyza_error error)
{
	struct xyza_reply reply;
	char text[XYZA_FRAME_MAX * HEX_DIGITS + 1];
	struct sim_burst *burst;
	int length;

	if (!node->xyza->powered || !sim_serial_bus_connects(bus, node) ||
	    sim_serial_bus_take(bus, node, SIM_FAULT_LOSE_REQUEST)) {
		bus->stats.missed++;
		return NULL;
	}
	/* Without its beginning it is no request. */
	if (sim_serial_bus_missed(bus, node, request) > 0) {
		bus->stats.missed++;
		return NULL;
	}
	for (size_t i = 0; i < request->length; i++)
		snprintf(text + HEX_DIGITS * i, HEX_DIGITS + 1, "%02X ",
		         (unsigned)request->bytes[i]);
	sim_serial_bus_log(node, request, text, HEX_DIGITS * request->length - 1);
	if (!sim_xyza_execute(node->xyza, decoded, error, request->end, &reply))
		return NULL;
	if (node->xyza->config.temper.settles == SIM_SETTLES_AT_ONCE)
		reply.object = (uint8_t)sim_xyza_memory_get(&node->xyza->memory,
		                                            XYZA_ITEM_SLAVE_NUMBER, XYZA_X);
	if (error != XYZA_OK ||
	    (decoded->verb > XYZA_READ_ITEM && decoded->verb != XYZA_PROGRAM_STATE))
		sim_serial_bus_testify(node, reply.kind != XYZA_REPLY_FAILED);
	/* The answer, with its faults. */
	burst = sim_serial_bus_begin(bus, node);
	if (!burst)
		return NULL;
	if (sim_serial_bus_take(bus, node, SIM_FAULT_WRONG_ID))
		reply.object = (uint8_t)(reply.object % XYZA_OBJECT_MAX + 1);
	length = xyza_encode_reply(&reply, &node->xyza->config.style, burst->bytes, XYZA_FRAME_MAX);
	if (length < 0)
		return NULL;
	if (node->xyza->config.temper.answers_as_host) {
		burst->bytes[LEVEL_AT]++;
		burst->bytes[length - 1]++; /* the checksum */
	}
	sim_serial_bus_send(bus, node, burst, (size_t)length, request->end);
	return burst;
}

static void process(struct sim_serial_bus *bus, const struct sim_serial_request *request)
{
	struct xyza_request decoded;
	enum xyza_error error = xyza_decode_request(request->bytes, request->length, &decoded);
	struct sim_burst *burst = NULL;
	bool known = false;

	/* Another controller's answer is not a request. */
	for (size_t i = 0; error != XYZA_ERR_SIDE && i < bus->node_count; i++) {
		struct sim_node *node = bus->nodes[i];

		if (!node->xyza ||
		    decoded.object != sim_xyza_memory_get(&node->xyza->memory,
		                                          XYZA_ITEM_SLAVE_NUMBER, XYZA_X))
			continue;
		known = true;
		burst = sim_serial_bus_overlap(
			bus, burst, serve_controller(bus, node, request, &decoded, error));
	}
	bus->stats.foreign += !known;
}

const struct sim_serial_protocol sim_xyza_protocol = {
	.ends = ends_request,
	.garbage = FRAME_START,
	.patience = PATIENCE,
	.process = process,
};
