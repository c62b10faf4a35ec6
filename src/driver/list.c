/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/list.h"

#include <string.h>

const struct db_driver *const db_drivers[] = {
	&db_driver_vsmd_serial, &db_driver_vsmd_can, &db_driver_xyza, &db_driver_servo_can, NULL,
};

const struct db_driver *db_driver_find(const char *name)
{
	for (size_t i = 0; db_drivers[i]; i++) {
		if (strcmp(db_drivers[i]->name, name) == 0)
			return db_drivers[i];
	}
	return NULL;
}

const struct db_drive_fault *db_driver_fault(uint16_t error)
{
	for (size_t i = 0; db_drivers[i] && error >= DB_ERROR_DRIVE_FAULT; i++) {
		if ((size_t)(error - DB_ERROR_DRIVE_FAULT) < db_drivers[i]->fault_count)
			return &db_drivers[i]->faults[error - DB_ERROR_DRIVE_FAULT];
	}
	return NULL;
}

uint64_t db_driver_commands(const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	const struct db_driver *driver = bus->driver;

	return driver->commands & ~(driver->forbidden ? driver->forbidden(bus, drive) : 0);
}

double db_driver_velocity_counts(const struct db_driver *driver,
                                 const struct db_drive_config *drive)
{
	double counts = driver->velocity_counts ? driver->velocity_counts(drive) : 1.0;

	return counts > 0.0 ? counts : 1.0;
}

db_time db_driver_round_time(const struct db_bus_config *bus, size_t addresses, size_t drives)
{
	const struct db_driver *driver = bus->driver;
	db_time further = driver->axis_time ? driver->axis_time(bus) : 0;

	return (db_time)addresses * driver->poll_time(bus) +
	       (db_time)(drives - addresses) * further;
}
