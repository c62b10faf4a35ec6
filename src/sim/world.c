/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/world.h"

#include "sim/can_line.h"
#include "sim/family.h"
#include "sim/replay.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Moving motors catch up at this interval, so that a later request needs little calculation. */
#define TICK_NS (100 * DB_NS_PER_MS)

static void write_trace(void *context, db_time time, char direction, const uint8_t *bytes,
                        size_t length)
{
	const struct sim_bus *bus = context;

	if (!bus->trace)
		return;
	fprintf(bus->trace, "%" PRId64 " %s %c", time / DB_NS_PER_US, bus->config->name, direction);
	for (size_t i = 0; i < length; i++)
		fprintf(bus->trace, " %02x", (unsigned)bytes[i]);
	fputs(" |", bus->trace);
	for (size_t i = 0; i < length; i++)
		fputc(bytes[i] >= ' ' && bytes[i] <= '~' ? bytes[i] : '.', bus->trace);
	fputs("|\n", bus->trace);
}

/* --- observers of drives ---------------------------------------------------------------------- */

static void observe(struct sim_observer *observer, const char *text, db_time now)
{
	fprintf(observer->trace, "%" PRId64 " %s ! %s |", now / DB_NS_PER_US, observer->node->name,
	        text);
	observer->node->family->write_motion(observer->node, now, observer->trace);
	observer->moving = observer->node->family->moving_motors(observer->node);
	fprintf(observer->trace, " moving=%u\n", observer->moving);
}

static void report(void *context, db_time time, const char *request, bool obeyed)
{
	char text[SIM_LOG_LENGTH + 16];

	snprintf(text, sizeof(text), "%s %s", obeyed ? "obeyed" : "refused", request);
	observe(context, text, time);
}

void sim_world_report(struct sim_world *world, const struct sim_node *node, const char *text,
                      db_time now)
{
	struct sim_observer *observer = &world->observers[node - world->nodes];

	if (observer->trace)
		observe(observer, text, now);
}

static int open_port(struct sim_bus *bus)
{
	const struct sim_bus_config *config = bus->config;
	const char *link = config->link;
	char path[PATH_MAX];

	if (!link && config->folder && strcmp(config->device, "pty") == 0) {
		if (snprintf(path, sizeof(path), "%s/%s", config->folder, config->name) >=
		    (int)sizeof(path))
			return -ENAMETOOLONG;
		link = path;
	}
	if (!config->interface)
		return sim_port_open(&bus->port, config->device, config->serial.baud, config->group,
		                     link);
	bus->write_unit = sizeof(struct db_can_frame);
	return sim_port_open_can(&bus->port, config->interface);
}

static int open_bus(struct sim_bus *bus)
{
	const struct sim_bus_config *config = bus->config;
	const struct sim_serial_protocol *protocol = sim_families[config->kind]->protocol;
	const char *place = config->interface ? config->interface : config->device;
	const char *error;
	int result;

	if (config->flash && mkdir(config->flash, 0777) != 0 && errno != EEXIST) {
		fprintf(stderr, "bus %s: flash directory %s: %s\n", config->name, config->flash,
		        strerror(errno));
		return -1;
	}
	result = open_port(bus);
	if (result != 0) {
		fprintf(stderr, "bus %s: %s%s%s: %s\n", config->name, place,
		        config->link ? " with link " : "", config->link ? config->link : "",
		        strerror(-result));
		return -1;
	}
	/* The wire, still without drives. */
	if (config->replay) {
		bus->ops = &sim_replay_ops;
		bus->wire = sim_replay_load(config->replay, stdout, write_trace, bus);
	} else if (protocol) {
		bus->ops = &sim_serial_bus_ops;
		bus->wire = sim_serial_bus_new(protocol, &config->serial, write_trace, bus);
	} else {
		bus->ops = &sim_can_line_ops;
		bus->wire = sim_can_line_new(&config->can, write_trace, bus);
	}
	if (!bus->wire)
		return -1;
	for (size_t i = 0; i < config->fault_count; i++) {
		error = sim_world_fault(NULL, bus, config->faults[i], 0);
		if (error) {
			fprintf(stderr, "bus %s: %s\n", config->name, error);
			return -1;
		}
	}
	return 0;
}

static int open_node(struct sim_world *world, size_t place, struct sim_bus *bus,
                     const struct sim_drive_config *config, db_time now)
{
	struct sim_node *node = &world->nodes[place];
	struct sim_observer *observer = &world->observers[place];
	char path[PATH_MAX];

	*observer = (struct sim_observer){ .node = node, .trace = bus->trace };
	node->name = config->name;
	node->latency = config->latency;
	node->deaf = config->deaf;
	node->family = sim_families[bus->config->kind];
	node->witness = (struct sim_witness){ .report = bus->trace ? report : NULL,
		                              .context = observer };
	if (bus->config->flash && snprintf(path, sizeof(path), "%s/%s.flash", bus->config->flash,
	                                   node->name) >= (int)sizeof(path))
		return -1;
	if (!node->family->open(node, bus->wire, bus->config, config,
	                        bus->config->flash ? path : NULL, now)) {
		fprintf(stderr, "drive %s: no room on bus %s\n", node->name, bus->config->name);
		return -1;
	}
	for (size_t i = 0; i < config->fault_count; i++) {
		if (sim_world_fault(node, bus, config->faults[i], now))
			return -1;
	}
	return 0;
}

int sim_world_open(struct sim_world *world, const struct sim_config *config, FILE *trace,
                   db_time now)
{
	*world = (struct sim_world){ .bus_count = config->bus_count };
	world->buses = calloc(config->bus_count, sizeof(*world->buses));
	world->nodes = calloc(config->drive_count, sizeof(*world->nodes));
	world->observers = calloc(config->drive_count, sizeof(*world->observers));
	if (!world->buses || !world->nodes || !world->observers) {
		world->bus_count = 0;
		return -1;
	}
	for (size_t i = 0; i < config->bus_count; i++) {
		world->buses[i].port = (struct sim_port){ .fd = -1, .slave = -1 };
		world->buses[i].config = &config->buses[i];
		world->buses[i].trace = trace;
	}
	for (size_t i = 0; i < config->bus_count; i++) {
		if (open_bus(&world->buses[i]) != 0)
			return -1;
	}
	while (world->node_count < config->drive_count) {
		size_t i = world->node_count++;
		const struct sim_drive_config *drive = &config->drives[i];

		if (open_node(world, i, &world->buses[drive->bus], drive, now) != 0)
			return -1;
	}
	return 0;
}

void sim_world_close(struct sim_world *world)
{
	for (size_t i = 0; i < world->bus_count; i++) {
		sim_port_close(&world->buses[i].port);
		if (world->buses[i].wire)
			world->buses[i].ops->free(world->buses[i].wire);
	}
	for (size_t i = 0; i < world->node_count; i++)
		world->nodes[i].family->close(&world->nodes[i]);
	free(world->buses);
	free(world->nodes);
	free(world->observers);
	*world = (struct sim_world){ .buses = NULL };
}

int sim_bus_read(struct sim_bus *bus, db_time now)
{
	struct sim_serial_bus *line = bus->wire;
	uint8_t bytes[4096];
	ssize_t count = read(bus->port.fd, bytes, sizeof(bytes));

	if (count < 0)
		/* An interface that is down may come up again. */
		return errno == EAGAIN || errno == EINTR || errno == ENETDOWN ? 0 : -errno;
	if (count == 0)
		return -EPIPE;
	if (bus->config->follows_host && sim_port_host_baud(&bus->port) != 0)
		line->config.baud = sim_port_host_baud(&bus->port);
	bus->ops->receive(bus->wire, bytes, (size_t)count, now);
	return 0;
}

static bool is_busy(const struct sim_node *node)
{
	return node->family->is_busy ? node->family->is_busy(node) :
	                               node->family->moving_motors(node) != 0;
}

void sim_world_run(struct sim_world *world, db_time now)
{
	uint8_t bytes[4096];

	for (size_t i = 0; i < world->bus_count; i++) {
		struct sim_bus *bus = &world->buses[i];
		size_t count;

		while ((count = bus->ops->run(bus->wire, now, bytes, sizeof(bytes))) > 0) {
			/* Bytes that a host does not read are lost, as on a line without a
			 * receiver. */
			size_t unit = bus->write_unit > 0 ? bus->write_unit : count;

			for (size_t done = 0; done + unit <= count; done += unit) {
				if (write(bus->port.fd, bytes + done, unit) < 0 &&
				    errno != EAGAIN && errno != ENOBUFS && errno != ENETDOWN)
					fprintf(stderr, "bus %s: %s\n", bus->config->name,
					        strerror(errno));
			}
		}
	}
	for (size_t i = 0; i < world->node_count; i++) {
		struct sim_node *node = &world->nodes[i];
		unsigned moving;

		if (is_busy(node))
			node->family->advance(node, now);
		/* Reports motors that have stopped since the last check. */
		if (world->observers[i].trace) {
			moving = world->observers[i].node->family->moving_motors(
				world->observers[i].node);
			if ((world->observers[i].moving & ~moving) != 0)
				observe(&world->observers[i], "stands", now);
			world->observers[i].moving = moving;
		}
	}
}

db_time sim_world_next(const struct sim_world *world, db_time now)
{
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i < world->bus_count; i++) {
		db_time due = world->buses[i].ops->next(world->buses[i].wire);

		if (due < next)
			next = due;
	}
	for (size_t i = 0; i < world->node_count; i++) {
		const struct sim_node *node = &world->nodes[i];

		if (is_busy(node) && now + TICK_NS < next)
			next = now + TICK_NS;
	}
	return next;
}

const char *sim_world_fault(struct sim_node *node, struct sim_bus *bus, const char *text,
                            db_time now)
{
	bool stalls = strcmp(text, "stall") == 0 || strcmp(text, "stall on") == 0;

	if (!node)
		return sim_faults_set(bus->ops->faults(bus->wire), text);
	if (strncmp(text, "echo", 4) == 0 || strncmp(text, "bus-off", 7) == 0)
		return "that is a fault of a bus, not of a drive";
	if (node->stalled && (stalls || strcmp(text, "stall off") == 0)) {
		node->family->advance(node, now);
		*node->stalled = stalls;
		return NULL;
	}
	if (node->flash_fails &&
	    (strcmp(text, "flash fail") == 0 || strcmp(text, "flash ok") == 0)) {
		*node->flash_fails = text[6] == 'f';
		return NULL;
	}
	return sim_faults_set(&node->faults, text);
}
