/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An invented family of servo drives on Modbus RTU, and its drives: with hundreds of parameters,
 * fault codes instead of bits, frames that end by silence where nothing else tells their length.
 * It leaves out each handler that may be null. For tests of what a family may be; the drives' side
 * works with fakes/plant.h:
 *
 *	struct rtu_drives drives = { .count = 2 };
 *
 *	rtu_open(&drives, 2);
 *	drives.drives[0].alarm = RTU_OVERHEAT;
 *	fake_plant_pass(&drives.plant, 100 * DB_NS_PER_MS);
 *	rtu_close(&drives);
 */
#ifndef DRIVEBRIDGE_FAKES_RTU_H
#define DRIVEBRIDGE_FAKES_RTU_H

#include "fakes/plant.h"

#define RTU_DRIVES 4
#define RTU_PARAMS 300
#define RTU_PARAM_PAGE 4
#define RTU_FIRST_PARAM 6000 /* its register; each has two */
#define RTU_FAULTS 24
#define RTU_KINDS 2 /* of broadcasts */
#define RTU_SILENCE (2 * DB_NS_PER_MS)
#define RTU_ANSWER_TIME (1 * DB_NS_PER_MS) /* from a request to its answer */

/* Alarms: those of the vendor's codes that are no valid `error` come after an offset of it. */
enum {
	RTU_UNDERVOLTAGE = 0x3220,
	RTU_OVERHEAT = 0x4310,
	RTU_UNNAMED = 0x7777,
	RTU_LOW_ALARM = 40, /* in servo-can this is phase_loss */
};

/* One drive, as a test sees and changes it. */
struct rtu_drive {
	bool gone;
	uint16_t alarm;
	int32_t position;
	int16_t speed;
	bool powered;
	int32_t params[RTU_PARAMS];
	bool lacks_last;   /* the model has no parameters from 240 on */
	unsigned writes;   /* of parameters */
	uint16_t command;  /* written last */
	bool long_answers; /* it answers status reads with more than was asked for */
};

struct rtu_drives {
	struct fake_plant plant;
	struct rtu_drive drives[RTU_DRIVES];
	unsigned broadcasts[RTU_KINDS]; /* received, by the first byte after the address */
	uint32_t last_number;           /* of the latest */
};

extern const struct db_driver rtu_family;

/* A message of the bus, for a family that has some. */
void rtu_write_broadcast(struct db_exchange *exchange, uint8_t kind, uint32_t number);

void rtu_open(struct rtu_drives *drives, const struct db_driver *driver, size_t count);
void rtu_close(struct rtu_drives *drives);

#endif
