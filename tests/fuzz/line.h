/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives' side for fuzz targets: simulated drives of any family on a simulated line, in made-up
 * time, serial or CAN behind one face. Header only; one thread.
 */
#ifndef DRIVEBRIDGE_FUZZ_LINE_H
#define DRIVEBRIDGE_FUZZ_LINE_H

#include "codec/vsmd_can.h"
#include "codec/vsmd_serial.h"
#include "codec/xyza.h"
#include "drivebridge/driver.h"
#include "input.h"
#include "sim/can_bus.h"
#include "sim/serial_bus.h"
#include "sim/servo_can_node.h"
#include "sim/vsmd_can_node.h"
#include "transport/transport_private.h"

#include <stdlib.h>

#define LINE_DRIVES 4
#define LINE_LATENCY (1 * DB_NS_PER_MS)

/* The families, as places of line_configs. */
enum family { FAMILY_VSMD_SERIAL, FAMILY_VSMD_CAN, FAMILY_SERVO, FAMILY_XYZA, FAMILIES };

/* A bus of each family with four drives; of xyza two axes share a controller. */
static const char *const line_configs[FAMILIES] = {
	"bus l { protocol = vsmd-serial\n device = \"/dev/l\"\n cycle-ms = 50 }\n"
	"drive a { bus = l\n address = 1\n unit = 1 }\n"
	"drive b { bus = l\n address = 2\n unit = 2\n on-exit = disable }\n"
	"drive c { bus = l\n address = 3\n unit = 3\n on-exit = none }\n"
	"drive d { bus = l\n address = 4\n unit = 4\n on-client-loss = quick-stop }\n",
	"bus l { protocol = vsmd-can\n interface = \"can0\"\n cycle-ms = 50 }\n"
	"drive a { bus = l\n address = 1\n unit = 1 }\n"
	"drive b { bus = l\n address = 2\n unit = 2\n on-exit = disable }\n"
	"drive c { bus = l\n address = 3\n unit = 3\n on-exit = none }\n"
	"drive d { bus = l\n address = 4\n unit = 4\n on-client-loss = quick-stop }\n",
	"bus l { protocol = servo-can\n interface = \"can0\"\n cycle-ms = 50 }\n"
	"drive a { bus = l\n address = 1\n unit = 1 }\n"
	"drive b { bus = l\n address = 2\n unit = 2\n on-exit = disable }\n"
	"drive c { bus = l\n address = 3\n unit = 3\n on-exit = none }\n"
	"drive d { bus = l\n address = 4\n unit = 4\n on-client-loss = quick-stop }\n",
	"bus l { protocol = xyza\n device = \"/dev/l\"\n cycle-ms = 200 }\n"
	"drive a { bus = l\n address = 1\n axis = x\n unit = 1 }\n"
	"drive b { bus = l\n address = 1\n axis = y\n unit = 2\n on-exit = disable }\n"
	"drive c { bus = l\n address = 2\n axis = x\n unit = 3\n on-exit = none }\n"
	"drive d { bus = l\n address = 3\n axis = z\n unit = 4\n on-client-loss = quick-stop }\n",
};

struct line {
	enum family family;
	db_time motion_delay; /* from a motion's command to its beginning */
	const struct db_bus_config *config;
	struct sim_serial_bus *serial; /* or */
	struct sim_can_bus *can;
	struct sim_node nodes[LINE_DRIVES];
	struct sim_vsmd_can_node can_nodes[LINE_DRIVES];
	struct sim_servo_node servos[LINE_DRIVES];
};

static const struct vsmd_can_style line_style = { .extended = true, .output_base = 1 };
static const struct servo_can_layout line_layout = { .ack_base = SERVO_CAN_BASE_ACK };

static inline void line_add_vsmd(struct line *line, size_t place, unsigned address, db_time now)
{
	struct sim_node *node = &line->nodes[place];
	struct sim_vsmd_config config;
	struct sim_can_station station;

	sim_vsmd_config_init(&config, address,
	                     line->can ? line->config->bitrate : line->config->baud);
	config.can = line->can != NULL;
	config.temper.motion_delay = line->motion_delay;
	node->drive = sim_vsmd_new(&config, now);
	must(node->drive);
	if (!line->can) {
		must(sim_serial_bus_attach(line->serial, node));
		return;
	}
	sim_vsmd_can_node_init(&line->can_nodes[place], node, &line_style, LINE_LATENCY);
	station = sim_vsmd_can_node_station(&line->can_nodes[place]);
	must(sim_can_bus_attach(line->can, &station));
}

static inline void line_add_servo(struct line *line, size_t place, unsigned address, db_time now)
{
	struct sim_servo_node *servo = &line->servos[place];
	struct sim_servo_config config;
	struct sim_can_station station;
	struct sim_servo *drive;

	sim_servo_config_init(&config);
	config.temper.motion_delay = line->motion_delay;
	drive = sim_servo_new(&config, now);
	must(drive);
	*servo = (struct sim_servo_node){ .drive = drive,
		                          .address = (uint8_t)address,
		                          .layout = line_layout,
		                          .latency = LINE_LATENCY };
	station = sim_servo_node_station(servo);
	station.faults = &line->nodes[place].faults;
	must(sim_can_bus_attach(line->can, &station));
}

static inline void line_add_xyza(struct line *line, size_t place, unsigned number, db_time now)
{
	struct sim_xyza_config config;

	if (place >= 3)
		return;
	sim_xyza_config_init(&config, number);
	config.temper.motion_delay = line->motion_delay;
	line->nodes[place].xyza = sim_xyza_new(&config, now);
	must(line->nodes[place].xyza);
	must(sim_serial_bus_attach(line->serial, &line->nodes[place]));
}

/* With so many of the drives, which begin a motion so late. */
static inline void line_open(struct line *line, enum family family,
                             const struct db_bus_config *config, size_t drives,
                             db_time motion_delay, db_time now)
{
	const struct sim_serial_config serial = {
		.baud = config->baud, .rs485 = true, .paced = true, .latency = LINE_LATENCY
	};

	*line = (struct line){ .family = family, .config = config, .motion_delay = motion_delay };
	if (config->driver->medium == DB_MEDIUM_CAN)
		line->can = sim_can_bus_new(config->bitrate, NULL, NULL);
	else
		line->serial = sim_serial_bus_new(family == FAMILY_XYZA ? &sim_xyza_protocol :
		                                                          &sim_vsmd_serial_protocol,
		                                  &serial, NULL, NULL);
	must(line->can || line->serial);
	for (unsigned i = 0; i < drives; i++) {
		line->nodes[i].name = "drive";
		if (family == FAMILY_XYZA)
			line_add_xyza(line, i, i + 1, now);
		else if (family == FAMILY_SERVO)
			line_add_servo(line, i, i + 1, now);
		else
			line_add_vsmd(line, i, i + 1, now);
	}
}

static inline void line_close(struct line *line)
{
	free(line->serial);
	free(line->can);
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		free(line->nodes[i].drive);
		free(line->servos[i].drive);
		free(line->nodes[i].xyza);
	}
}

/* The host says something. */
static inline void line_hear(struct line *line, const uint8_t *bytes, size_t length, db_time now)
{
	if (line->serial) {
		sim_serial_bus_receive(line->serial, bytes, length, now);
		return;
	}
	must(length % sizeof(struct db_can_frame) == 0);
	for (size_t at = 0; at < length; at += sizeof(struct db_can_frame)) {
		const struct db_can_frame frame = db_can_frame_at(bytes, at);

		sim_can_bus_put(line->can, &frame, now);
	}
}

/* What has reached the host by now; call again until 0. */
static inline size_t line_say(struct line *line, db_time now, uint8_t *bytes, size_t size)
{
	struct db_can_frame frame;

	if (line->serial)
		return sim_serial_bus_run(line->serial, now, bytes, size);
	if (!sim_can_bus_run(line->can, now, &frame))
		return 0;
	memcpy(bytes, &frame, sizeof frame);
	return sizeof frame;
}

static inline db_time line_next(struct line *line)
{
	return line->serial ? sim_serial_bus_next(line->serial) : sim_can_bus_next(line->can);
}

static inline struct sim_faults *line_faults(struct line *line)
{
	return line->serial ? sim_serial_bus_faults(line->serial) : &line->can->faults;
}

static inline void line_power(struct line *line, size_t place, bool on, db_time now)
{
	if (line->nodes[place].drive)
		sim_vsmd_power(line->nodes[place].drive, on, now);
	if (line->nodes[place].xyza)
		sim_xyza_power(line->nodes[place].xyza, on, now);
	if (line->servos[place].drive)
		sim_servo_power(line->servos[place].drive, on, now);
}

/* No faults, and everything has power. */
static inline void line_mend(struct line *line, db_time now)
{
	*line_faults(line) = (struct sim_faults){ .delay_ms = 0 };
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		line->nodes[i].faults = (struct sim_faults){ .delay_ms = 0 };
		line_power(line, i, true, now);
	}
}

/* --- what the host says ---------------------------------------------------------------------------- */

/* A frame of the host: whom it is for, and whether it may end a motion. */
struct said {
	unsigned address; /* LINE_ALL: everybody */
	bool stop;
};
#define LINE_ALL UINT32_MAX

static inline struct said read_vsmd_serial(const uint8_t *bytes, size_t length)
{
	struct vsmd_setting settings[DB_SETTINGS_MAX];
	struct vsmd_command command;

	/* A bare line end goes ahead where half a line may have been lost. */
	for (; length > 1 && bytes[0] == '\n'; length--)
		bytes++;
	must(vsmd_serial_decode_command((const char *)bytes, length - 1, true, &command, settings,
	                                DB_SETTINGS_MAX) == VSMD_OK);
	return (struct said){
		.address = command.id == VSMD_SERIAL_BROADCAST ? LINE_ALL : (unsigned)command.id,
		.stop = command.verb == VSMD_STP || command.verb == VSMD_OFF,
	};
}

static inline struct said read_vsmd_can(const struct db_can_frame *frame)
{
	struct vsmd_can_message message;

	must(vsmd_can_decode(&line_style, frame, &message) == VSMD_OK);
	return (struct said){
		.address = message.id.broadcast ? LINE_ALL : message.id.target,
		.stop = message.id.control == VSMD_CAN_COMMAND &&
		        (message.command.code == VSMD_CAN_STP ||
		         message.command.code == VSMD_CAN_OFF),
	};
}

static inline struct said read_servo(const struct db_can_frame *frame)
{
	struct servo_can_message message;

	must(servo_can_decode(frame, &line_layout, SERVO_CAN_FROM_HOST, &message) == SERVO_CAN_OK);
	must(message.kind != SERVO_CAN_FOREIGN);
	return (struct said){
		.address = message.kind == SERVO_CAN_SYNC || message.node == 0 ? LINE_ALL :
		                                                                 message.node,
		.stop = (message.kind == SERVO_CAN_SPEED && message.u.speed == 0) ||
		        (message.kind == SERVO_CAN_CURRENT && message.u.current == 0) ||
		        (message.kind == SERVO_CAN_ENABLE && !message.u.enable),
	};
}

static inline struct said read_xyza(const uint8_t *bytes, size_t length)
{
	struct xyza_request request;

	must(xyza_decode_request(bytes, length, &request) == XYZA_OK);
	return (struct said){
		.address = request.object,
		.stop = request.verb == XYZA_MANUAL_STOP ||
		        request.verb == XYZA_MANUAL_QUICK_STOP ||
		        request.verb == XYZA_PROGRAM_STOP ||
		        request.verb == XYZA_PROGRAM_QUICK_STOP ||
		        (request.verb == XYZA_WRITE_ITEM && request.item == XYZA_ITEM_ENABLE),
	};
}

/* One request, or one frame of it; it must be one that a drive understands. */
static inline struct said line_read(const struct line *line, const uint8_t *bytes, size_t length)
{
	struct db_can_frame frame;

	if (line->family == FAMILY_VSMD_SERIAL)
		return read_vsmd_serial(bytes, length);
	if (line->family == FAMILY_XYZA)
		return read_xyza(bytes, length);
	must(length == sizeof frame);
	memcpy(&frame, bytes, sizeof frame);
	return line->family == FAMILY_SERVO ? read_servo(&frame) : read_vsmd_can(&frame);
}

#endif
