/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include <errno.h>

/* Null: there is no such bus, or it is about to end. */
static struct db_bus *find_bus(const struct service *service, const char *name)
{
	const struct plant_bus *bus = plant_bus_named(service->plant, name);

	return bus && !bus->leaving ? bus->bus : NULL;
}

int scans_begin(void *context, const char *bus, const struct db_scan_plan *plan, uint32_t *number)
{
	struct db_bus *found = find_bus(context, bus);

	return found ? db_bus_scan(found, plan, number) : -ENODEV;
}

bool scans_read(void *context, const char *bus, uint32_t number, struct db_scan_progress *progress)
{
	const struct db_bus *found = find_bus(context, bus);

	return found && db_bus_scan_read(found, number, progress);
}

const struct db_scan_find *scans_find(void *context, const char *bus, size_t index)
{
	return db_bus_scan_find(find_bus(context, bus), index);
}

const struct db_scan_foreign *scans_foreign(void *context, const char *bus, size_t index)
{
	return db_bus_scan_foreign(find_bus(context, bus), index);
}

void scans_cancel(void *context, const char *bus, uint32_t number)
{
	struct db_bus *found = find_bus(context, bus);

	if (found)
		db_bus_scan_cancel(found, number);
}
