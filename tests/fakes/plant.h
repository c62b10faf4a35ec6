/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A bus in simulated time with its registers: what a PLC writes goes through the commanders, the
 * queue and the engine to the drives, and what these answer is read from the registers. One thread;
 * after wrong use it aborts.
 *
 *	struct fake_plant plant;
 *
 *	fake_plant_open(&plant, &rtu_family, 1, &rtu_ops, drive);
 *	fake_plant_pass(&plant, 500 * DB_NS_PER_MS);
 *	assert_int_equal(fake_plant_get(&plant, 1, 0, 1, &state), 0);
 *	fake_plant_close(&plant);
 */
#ifndef DRIVEBRIDGE_FAKES_PLANT_H
#define DRIVEBRIDGE_FAKES_PLANT_H

#include "drivebridge/registers.h"
#include "fakes/bus.h"

struct fake_plant {
	struct fake_bus *bus; /* its drives have the units from 1 on */
	struct db_modbus_config modbus;
	struct db_registers *registers;
	unsigned answered;     /* writes that were answered later */
	uint8_t answered_with; /* the last of these */
};

/* Drives of this family whose port is open. */
void fake_plant_open(struct fake_plant *plant, const struct db_driver *driver, size_t drives,
                     const struct db_engine_ops *ops, void *context);
void fake_plant_close(struct fake_plant *plant);
/* Time passes for all of it. */
void fake_plant_pass(struct fake_plant *plant, db_time span);

/* Holding registers: 0, an exception code, or DB_WRITE_LATER. */
int fake_plant_get(struct fake_plant *plant, uint8_t unit, uint16_t address, uint16_t count,
                   uint16_t *values);
int fake_plant_put(struct fake_plant *plant, uint8_t unit, uint16_t address, uint16_t count,
                   const uint16_t *values);
/* A write and what it was answered with, after the time that it took, at most a second. */
uint8_t fake_plant_write(struct fake_plant *plant, uint8_t unit, uint16_t address, uint16_t count,
                         const uint16_t *values);
/* One register, or two as one value; they can be read. */
uint16_t fake_plant_get1(struct fake_plant *plant, uint8_t unit, uint16_t address);
uint32_t fake_plant_get2(struct fake_plant *plant, uint8_t unit, uint16_t address);

#endif
