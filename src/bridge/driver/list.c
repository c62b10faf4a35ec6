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

const struct db_drive_fault *db_driver_fault(const struct db_driver *driver, uint16_t error)
{
	for (size_t i = 0; i < driver->fault_count; i++) {
		if (driver->faults[i].error == error)
			return &driver->faults[i];
	}
	return NULL;
}

uint64_t db_driver_commands(const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	const struct db_driver *driver = bus->driver;

	return driver->commands & ~(driver->forbidden ? driver->forbidden(bus, drive) : 0);
}

enum db_result db_driver_check_param(const struct db_bus_config *bus, size_t param,
                                     union db_value value)
{
	const struct db_driver *driver = bus->driver;
	double number;

	if (param >= driver->param_count)
		return DB_RESULT_UNSUPPORTED;
	if (driver->check_param)
		return driver->check_param(bus, param, value);
	number = db_value_number(driver->params[param].type, value);
	return number >= driver->params[param].min && number <= driver->params[param].max ?
	               DB_RESULT_OK :
	               DB_RESULT_OUT_OF_RANGE;
}

double db_option_value(const struct db_option *option, const void *options)
{
	const unsigned char *member = (const unsigned char *)options + option->offset;
	unsigned word;
	double number;

	if (option->words[0] != '\0') {
		memcpy(&word, member, sizeof(word));
		return word;
	}
	memcpy(&number, member, sizeof(number));
	return number;
}

void db_option_set(const struct db_option *option, void *options, double value)
{
	unsigned char *member = (unsigned char *)options + option->offset;
	unsigned word = value >= 0.0 ? (unsigned)value : 0;

	if (option->words[0] != '\0')
		memcpy(member, &word, sizeof(word));
	else
		memcpy(member, &value, sizeof(value));
}

double db_driver_velocity_counts(const struct db_driver *driver,
                                 const struct db_drive_config *drive)
{
	double counts = driver->velocity_counts ? driver->velocity_counts(drive) : 1.0;

	return counts > 0.0 ? counts : 1.0;
}

/* What the first one of a kind takes of the wire; they are of the same length. */
static db_time message_time(const struct db_bus_config *bus, const struct db_bus_message *message)
{
	uint8_t request[DB_SHORT_REQUEST];
	struct db_exchange exchange = { .request = request, .request_size = sizeof(request) };

	message->write(bus, 0, &exchange);
	return bus->transport->wire_time(bus, request, exchange.request_length, 0);
}

#define OWN_PART_MAX 0.9

double db_driver_own_part(const struct db_bus_config *bus)
{
	double part = 0.0;

	for (size_t i = 0; i < bus->driver->message_count; i++) {
		const struct db_bus_message *message = &bus->driver->messages[i];
		db_time period = message->period(bus);

		if (period > 0 && period < DB_TIME_NEVER)
			part += (double)message_time(bus, message) / (double)period;
	}
	return part < OWN_PART_MAX ? part : OWN_PART_MAX;
}

db_time db_driver_own_time(const struct db_bus_config *bus)
{
	db_time longest = 0;

	for (size_t i = 0; i < bus->driver->message_count; i++) {
		const struct db_bus_message *message = &bus->driver->messages[i];
		db_time time = message->period(bus) > 0 ? message_time(bus, message) : 0;

		longest = time > longest ? time : longest;
	}
	return longest;
}

db_time db_driver_round_time(const struct db_bus_config *bus, size_t addresses, size_t drives)
{
	const struct db_driver *driver = bus->driver;
	db_time further = driver->axis_time ? driver->axis_time(bus) : 0;

	db_time round = (db_time)addresses * driver->poll_time(bus) +
	                (db_time)(drives - addresses) * further;

	return driver->message_count == 0 ?
	               round :
	               (db_time)((double)round / (1.0 - db_driver_own_part(bus)));
}

db_time db_driver_brief_time(const struct db_bus_config *bus)
{
	unsigned exchanges = bus->driver->poll_exchanges > 1 ? bus->driver->poll_exchanges : 1;

	return 2 * bus->driver->poll_time(bus) / (db_time)exchanges;
}
