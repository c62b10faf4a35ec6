/* SPDX-License-Identifier: Apache-2.0 */
#include "fakes/plant.h"

#include "fakes/must.h"
#include "fakes/registers.h"

#define UNITS_NAME "counts"

static db_time now_of(void *context)
{
	return ((const struct fake_plant *)context)->bus->now;
}

static uint64_t wall_of(void *context)
{
	return 1700000000000000u + (uint64_t)now_of(context) / 1000;
}

static struct db_request *submit(void *context, struct db_bus *bus,
                                 const struct db_request *request)
{
	struct fake_plant *plant = context;

	(void)bus;
	return db_queue_post(plant->bus->queue, request);
}

static void release(void *context, struct db_request *request)
{
	(void)context;
	db_queue_release(request);
}

static void keep_answer(void *context, struct db_write_token token, uint8_t exception)
{
	struct fake_plant *plant = context;

	(void)token;
	plant->answered++;
	plant->answered_with = exception;
}

static void tell_bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	(void)bus;
	*stats = fake_stats(((const struct fake_plant *)context)->bus);
}

static void tell_server_stats(void *context, struct db_server_stats *stats)
{
	(void)context;
	*stats = (struct db_server_stats){ .clients = 1 };
}

static const struct db_registers_ops ops = {
	.now = now_of,
	.wall_us = wall_of,
	.submit = submit,
	.release = release,
	.answer = keep_answer,
	.bus_stats = tell_bus_stats,
	.server_stats = tell_server_stats,
};

void fake_plant_open(struct fake_plant *plant, const struct db_driver *driver, size_t drives,
                     const struct db_engine_ops *engine_ops, void *context)
{
	struct db_roster_drive listed[FAKE_DRIVES];
	struct db_roster_bus bus;
	struct db_roster roster;

	*plant = (struct fake_plant){ .bus = fake_bus_new(driver, drives),
		                      .modbus = { .confirm_ms = 40 } };
	plant->bus->context = context;
	for (size_t i = 0; i < drives; i++) {
		struct db_drive_config *drive = &plant->bus->drives[i];

		drive->unit = (unsigned)i + 1;
		drive->unit_name = (char *)UNITS_NAME;
		listed[i] = (struct db_roster_drive){ (uint16_t)i, 0, drive,
			                              plant->bus->list[i].axis };
	}
	fake_bus_open(plant->bus, drives, engine_ops);
	bus = (struct db_roster_bus){ &plant->bus->config, NULL };
	roster = (struct db_roster){ &plant->modbus, &bus, 1, listed, drives };
	must(db_registers_new(&roster, &ops, plant, &plant->registers) == 0);
	fake_port(plant->bus, 0);
}

void fake_plant_close(struct fake_plant *plant)
{
	db_registers_free(plant->registers);
	fake_bus_free(plant->bus);
}

void fake_plant_pass(struct fake_plant *plant, db_time span)
{
	db_time end = plant->bus->now + span;
	struct db_request *ended;

	while (plant->bus->now < end) {
		db_time left = end - plant->bus->now;

		fake_pass(plant->bus, left < DB_NS_PER_MS ? left : DB_NS_PER_MS);
		while ((ended = db_queue_collect(plant->bus->queue)) != NULL)
			db_registers_complete(plant->registers, ended, plant->bus->now);
		db_registers_expire(plant->registers, plant->bus->now);
	}
}

int fake_plant_get(struct fake_plant *plant, uint8_t unit, uint16_t address, uint16_t count,
                   uint16_t *values)
{
	return db_registers_backend.read(plant->registers, &fake_client, unit, DB_TABLE_HOLDING,
	                                 address, count, values);
}

int fake_plant_put(struct fake_plant *plant, uint8_t unit, uint16_t address, uint16_t count,
                   const uint16_t *values)
{
	return db_registers_backend.write(plant->registers, &fake_client, unit, DB_TABLE_HOLDING,
	                                  address, count, values, FAKE_TOKEN);
}

uint8_t fake_plant_write(struct fake_plant *plant, uint8_t unit, uint16_t address, uint16_t count,
                         const uint16_t *values)
{
	unsigned answered = plant->answered;
	int exception = fake_plant_put(plant, unit, address, count, values);

	for (unsigned ms = 0; exception == DB_WRITE_LATER && ms < 1000; ms++) {
		fake_plant_pass(plant, DB_NS_PER_MS);
		if (plant->answered != answered)
			return plant->answered_with;
	}
	must(exception != DB_WRITE_LATER);
	return (uint8_t)exception;
}

uint16_t fake_plant_get1(struct fake_plant *plant, uint8_t unit, uint16_t address)
{
	uint16_t value = 0;

	must(fake_plant_get(plant, unit, address, 1, &value) == 0);
	return value;
}

uint32_t fake_plant_get2(struct fake_plant *plant, uint8_t unit, uint16_t address)
{
	uint16_t values[2] = { 0 };

	must(fake_plant_get(plant, unit, address, 2, values) == 0);
	return (uint32_t)values[0] << 16 | values[1];
}
