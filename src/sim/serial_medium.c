/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_bus.h"
#include "sim/sim_config.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>

#define BAUD_MIN 2400
#define BAUD_MAX 921600
#define TIME_MAX_US 10000000
#define REPLY_ID_MAX 32

static const cfg_opt_t bus_options[] = {
	CFG_INT("baud", 115200, CFGF_NONE),     CFG_STR("line", "rs485", CFGF_NONE),
	CFG_INT("latency-us", 800, CFGF_NONE),  CFG_INT("turnaround-us", 0, CFGF_NONE),
	CFG_INT("reply-id", 1, CFGF_NONE),      CFG_END()
};

static int load_bus(cfg_t *cfg, struct sim_bus_config *bus)
{
	static const char *const lines[] = { "rs485", "rs232", NULL };
	int line = sim_config_check_word(cfg, "line", lines);

	if (line < 0 || sim_config_check_int(cfg, "baud", BAUD_MIN, BAUD_MAX) != 0 ||
	    sim_config_check_int(cfg, "latency-us", 0, TIME_MAX_US) != 0 ||
	    sim_config_check_int(cfg, "turnaround-us", 0, TIME_MAX_US) != 0 ||
	    sim_config_check_int(cfg, "reply-id", 0, REPLY_ID_MAX) != 0)
		return -1;
	bus->one_drive = line == 1;
	bus->serial = (struct sim_serial_config){
		.baud = (unsigned)cfg_getint(cfg, "baud"),
		.rs485 = line == 0,
		/* A real line takes its own time, a pty (whoever made it) takes none. */
		.paced = strcmp(bus->device, "pty") == 0 ||
		         strncmp(bus->device, "/dev/pts/", 9) == 0,
		.reply_id = (uint8_t)cfg_getint(cfg, "reply-id"),
		.latency = cfg_getint(cfg, "latency-us") * DB_NS_PER_US,
		.turnaround = cfg_getint(cfg, "turnaround-us") * DB_NS_PER_US,
	};
	return 0;
}

static int open_bus(struct sim_bus *bus, sim_trace_fn *trace)
{
	const struct sim_bus_config *config = bus->config;
	int result =
		sim_port_open(&bus->port, config->device, config->serial.baud, config->link);

	if (result != 0)
		return result;
	bus->wire = sim_serial_bus_new(config->kind->framing, &config->serial, trace, bus);
	return bus->wire ? 0 : -ENOMEM;
}

static void close_bus(struct sim_bus *bus)
{
	sim_port_close(&bus->port);
	sim_serial_bus_free(bus->wire);
}

static bool attach(void *wire, struct sim_node *node)
{
	return sim_serial_bus_attach(wire, node);
}

static void receive(void *wire, const uint8_t *bytes, size_t length, db_time now)
{
	sim_serial_bus_receive(wire, bytes, length, now);
}

static size_t run(void *wire, db_time now, uint8_t *out, size_t size)
{
	return sim_serial_bus_run(wire, now, out, size);
}

static db_time next(void *wire)
{
	return sim_serial_bus_next(wire);
}

static struct sim_faults *faults(void *wire)
{
	return sim_serial_bus_faults(wire);
}

static void set_rate(void *wire, unsigned rate)
{
	sim_serial_bus_set_baud(wire, rate);
}

static void write_stats(void *wire, FILE *out)
{
	const struct sim_serial_stats *stats = sim_serial_bus_stats(wire);

	(void)fprintf(out,
	              "requests=%" PRIu32 " replies=%" PRIu32 " collisions=%" PRIu32
	              " unheard=%" PRIu32 " foreign=%" PRIu32,
	              stats->requests, stats->replies, stats->collisions, stats->unheard,
	              stats->foreign);
}

const struct sim_medium sim_serial_medium = {
	.bus_options = bus_options,
	.load_bus = load_bus,
	.open = open_bus,
	.close = close_bus,
	.attach = attach,
	.receive = receive,
	.run = run,
	.next = next,
	.faults = faults,
	.set_rate = set_rate,
	.write_stats = write_stats,
};
