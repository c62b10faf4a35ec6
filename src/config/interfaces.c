/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Several buses on one CAN interface: good when no frame can be meant for both, because then each
 * of them sees only its own. Else one would take the other's frames for answers.
 */
#include "codec/can.h"
#include "config/load.h"
#include "drivebridge/driver.h"

#include <string.h>

struct filter_list {
	struct db_can_filter filters[DB_FILTERS_MAX];
	size_t count;
};

static struct filter_list filters_of(const struct db_bus_config *bus)
{
	struct filter_list list = { .count = 0 };

	if (bus->driver->filters)
		list.count = bus->driver->filters(bus, list.filters);
	return list;
}

/* There is an id that both let pass. */
static bool overlap(const struct db_can_filter *a, const struct db_can_filter *b)
{
	return ((a->id ^ b->id) & a->mask & b->mask) == 0;
}

/* A bus without filters sees every frame. */
static bool collide(const struct filter_list *a, const struct filter_list *b)
{
	if (a->count == 0 || b->count == 0)
		return true;
	for (size_t i = 0; i < a->count; i++) {
		for (size_t j = 0; j < b->count; j++) {
			if (overlap(&a->filters[i], &b->filters[j]))
				return true;
		}
	}
	return false;
}

static void check_pair(struct db_load *load, const struct db_bus_config *bus,
                       const struct db_bus_config *other)
{
	struct filter_list filters = filters_of(bus), others = filters_of(other);

	if (collide(&filters, &others))
		db_report_error(
			&load->report,
			db_load_line(load, "bus", bus->name, bus->source_line, "interface"),
			"buses '%s' (%s) and '%s' (%s, %s) use the same ids on interface %s, so that one could take the other's frames for its own; another interface for one of them%s",
			bus->name, bus->driver->name, other->name, other->driver->name,
			db_report_place(&load->report, other->source_line).text, bus->interface,
			bus->driver == other->driver ? ", or one bus for all their drives" : "");
	else if (bus->bitrate != other->bitrate)
		db_report_error(
			&load->report,
			db_load_line(load, "bus", bus->name, bus->source_line, "bitrate"),
			"bus '%s' has %u bit/s, but bus '%s' on %s has %u bit/s on the same interface %s; the same bitrate for both",
			bus->name, bus->bitrate, other->name,
			db_report_place(&load->report, other->source_line).text, other->bitrate,
			bus->interface);
}

void db_load_check_interfaces(struct db_load *load)
{
	const struct db_config *config = load->config;

	for (size_t i = 0; i < config->bus_count; i++) {
		const struct db_bus_config *bus = &config->buses[i];

		for (size_t j = 0; j < i && bus->interface; j++) {
			const struct db_bus_config *other = &config->buses[j];

			if (other->interface && strcmp(bus->interface, other->interface) == 0)
				check_pair(load, bus, other);
		}
	}
}
