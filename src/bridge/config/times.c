/* SPDX-License-Identifier: Apache-2.0 */
#include "config/times.h"

#include "drivebridge/driver.h"
#include "transport/serial.h"

#include <stdio.h>

#define SPEED_TEXT_MAX 32
#define LINE_FRAME_MAX 256

size_t db_times_drives_on(const struct db_config *config, size_t bus)
{
	size_t count = 0;

	for (size_t i = 0; i < config->drive_count; i++)
		count += config->drives[i].bus == bus;
	return count;
}

int64_t db_times_of_line(const struct db_rtu_config *line)
{
	struct db_bus_config port = db_serial_port_of_line(line);

	/* Each side is silent for 3.5 characters before it sends. */
	return db_serial_wire_time(&port, LINE_FRAME_MAX + 8);
}

double db_times_in_ms(db_time time)
{
	return (double)time / (double)DB_NS_PER_MS;
}

size_t db_times_nodes_on(const struct db_config *config, size_t bus)
{
	size_t count = 0;

	for (size_t i = 0; i < config->drive_count; i++) {
		bool polled = false;

		/* An earlier drive of the list at the same address polls for both. */
		for (size_t k = 0; k < i; k++)
			polled = polled || (config->drives[k].bus == bus &&
			                    config->drives[k].address == config->drives[i].address);
		count += config->drives[i].bus == bus && !polled;
	}
	return count;
}

int64_t db_times_confirm(const struct db_bus_config *bus)
{
	db_time own = bus->driver->command_time(bus);
	db_time poll = bus->driver->poll_time(bus);

	return own + (poll > own ? poll : own);
}

/* The speed of the wire, for people: "9600 baud", "500000 bit/s". */
static void put_speed(const struct db_bus_config *bus, char text[SPEED_TEXT_MAX])
{
	bool can = bus->driver->medium == DB_MEDIUM_CAN;

	snprintf(text, SPEED_TEXT_MAX, "%u %s", can ? bus->bitrate : bus->baud,
	         can ? "bit/s" : "baud");
}

static unsigned whole_milliseconds(db_time time)
{
	return (unsigned)((time + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
}

static const char *speed_up(const struct db_bus_config *bus)
{
	return bus->driver->medium == DB_MEDIUM_CAN ? "raise the bit rate" : "raise the baud rate";
}

/* All drives are to be read in each cycle, or at least one that moves. */
static void warn_cycle(struct db_load *load, size_t index)
{
	const struct db_bus_config *bus = &load->config->buses[index];
	size_t all_nodes = db_times_nodes_on(load->config, index);
	size_t nodes = bus->polls_evenly || all_nodes == 0 ? all_nodes : 1;
	size_t drives = db_times_drives_on(load->config, index) * nodes /
	                (all_nodes > 0 ? all_nodes : 1);
	db_time all = db_driver_round_time(bus, nodes, drives);
	db_time one = nodes > 0 ? all / (db_time)nodes : 0;
	char speed[SPEED_TEXT_MAX];

	if (all <= (db_time)bus->cycle_ms * DB_NS_PER_MS)
		return;
	put_speed(bus, speed);
	db_messages_add_warning(
		&load->messages,
		db_section_find_line(load, "bus", bus->name, bus->source_line, "cycle-ms"),
		"cycle of %u ms cannot fit %zu %s%s: one status exchange takes %.2f ms at %s, all "
		"of them %.2f ms; set cycle-ms = %u or %s",
		bus->cycle_ms, nodes, bus->driver->axes > 0 ? "controller" : "drive",
		nodes == 1 ? "" : "s", db_times_in_ms(one), speed, db_times_in_ms(all),
		whole_milliseconds(all), speed_up(bus));
}

static void warn_confirm(struct db_load *load, size_t index)
{
	const struct db_bus_config *bus = &load->config->buses[index];
	unsigned confirm_ms = load->config->modbus.confirm_ms;
	db_time needed = db_times_confirm(bus);
	char speed[SPEED_TEXT_MAX];

	/* The default is what PLCs wait for, and 05 is then the right answer: this is no error. */
	if (db_section_find_line(load, "modbus", "", 0, "confirm-ms") == 0)
		return;
	if (load->config->modbus.accept_writes || db_times_drives_on(load->config, index) == 0 ||
	    needed <= (db_time)confirm_ms * DB_NS_PER_MS)
		return;
	put_speed(bus, speed);
	db_messages_add_warning(
		&load->messages,
		db_section_find_line(load, "modbus", "", bus->source_line, "confirm-ms"),
		"confirm-ms = %u cannot be met on bus '%s': at %s a command takes %.2f ms, and "
		"%.2f ms when it has to wait for the exchange on the wire; set confirm-ms = %u in "
		"section modbus or %s",
		confirm_ms, bus->name, speed, db_times_in_ms(bus->driver->command_time(bus)),
		db_times_in_ms(needed), whole_milliseconds(needed), speed_up(bus));
}

void db_times_fill(struct db_load *load)
{
	/* At least one drive's status; not more, or a drive that is added would change its whole
	 * bus. */
	static const unsigned steps[] = { 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000 };

	for (size_t i = 0; i < load->config->bus_count; i++) {
		struct db_bus_config *bus = &load->config->buses[i];
		unsigned needed = whole_milliseconds(bus->driver->poll_time(bus));
		size_t step = 0;

		while (step + 1 < sizeof(steps) / sizeof(steps[0]) && needed > steps[step])
			step++;
		if (bus->cycle_ms == 0)
			bus->cycle_ms = steps[step];
	}
}

void db_times_check(struct db_load *load)
{
	for (size_t i = 0; i < load->config->bus_count; i++) {
		warn_cycle(load, i);
		warn_confirm(load, i);
	}
}
