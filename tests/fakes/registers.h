/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The registers of a small plant, and what surrounds them: buses that accept every request and
 * keep it, a server with the test's figures, writers that wait for their answers. One thread; after
 * wrong use it aborts.
 *
 *	struct fake_registers fake;
 *
 *	fake_registers_init(&fake, 1, 1);
 *	fake.drives[0].unit = 7;
 *	fake_registers_open(&fake);
 *	assert_int_equal(fake_put(&fake, 7, 100, 2, 0, DB_CMD_STOP), DB_WRITE_LATER);
 *	fake_complete(&fake, 0, DB_RESULT_OK);
 *	assert_int_equal(fake.answered, 1);
 *	fake_registers_close(&fake);
 */
#ifndef DRIVEBRIDGE_FAKES_REGISTERS_H
#define DRIVEBRIDGE_FAKES_REGISTERS_H

#include "drivebridge/audit.h"
#include "drivebridge/driver.h"
#include "drivebridge/registers.h"
#include "fakes/places.h"

#define FAKE_PLANT_BUSES 2
#define FAKE_PLANT_DRIVES 3
#define FAKE_CLIENTS 2
#define FAKE_CLIENTS_SHOWN 16 /* the number for which the gateway has registers */
#define FAKE_REQUESTS 64      /* the latest requests are kept */
#define FAKE_PLACES 128       /* at the buses */

/* The client of reads and writes, which gets their answers. */
extern const struct db_client fake_client;
#define FAKE_TOKEN ((struct db_write_token){ 1, 42 })

/* A roster with room for its numbers, and for one drive more than at first. */
struct fake_sheet {
	struct db_roster_bus buses[FAKE_PLANT_BUSES];
	struct db_roster_drive drives[FAKE_PLANT_DRIVES + 1];
	struct db_roster roster;
};

struct fake_registers {
	/* To be changed before fake_registers_open(). */
	struct db_config config;
	struct db_bus_config buses[FAKE_PLANT_BUSES];
	struct db_drive_config drives[FAKE_PLANT_DRIVES];

	struct db_axis *axes[FAKE_PLANT_DRIVES];
	struct db_registers *registers;
	db_time now;

	/* The figures that they report. */
	struct db_bus_stats bus_stats[FAKE_PLANT_BUSES];
	struct db_server_stats server_stats;
	struct db_server_client clients[FAKE_CLIENTS];
	struct db_configuration_report configuration;

	/* What they sent out; a test may reset it to 0. */
	struct db_request requests[FAKE_REQUESTS]; /* number i at i % FAKE_REQUESTS */
	struct db_args args[FAKE_REQUESTS];
	struct db_setting settings[FAKE_REQUESTS][DB_SETTINGS_MAX];
	struct fake_place places[FAKE_PLACES];
	unsigned submitted;
	size_t submitted_to; /* the bus of the latest request */
	unsigned gathered;   /* requests that their bus has to send at once */
	bool gathers[FAKE_PLANT_BUSES];
	unsigned answered;
	struct db_write_token answered_to;
	uint8_t answered_with;
	enum db_result session_answered_with; /* where the writer was a session */
	unsigned connected;
	unsigned refused[FAKE_CLIENTS + 1]; /* without control, by the id of the client */
	unsigned refused_by_role;
	unsigned tripped; /* watchdogs that stopped a drive */
	struct db_client tripped_last;
	unsigned holds_lost;

	/* The audit trail: its latest record. */
	unsigned recorded;
	struct db_audit_entry record;
	struct db_audit_value record_values[DB_SETTINGS_MAX];
	uint32_t record_client; /* DB_CLIENT_NOBODY: the bridge's own */
	unsigned record_ends;
	uint32_t ended_record;
	enum db_result ended_with;
};

/* VSMD drives at addresses from 5 on with units from 1 on, the first on the first bus and the
 * others on the last one. */
void fake_registers_init(struct fake_registers *fake, size_t buses, size_t drives);
/* Registers for the present configuration, in place of the former ones. */
void fake_registers_open(struct fake_registers *fake);
void fake_registers_close(struct fake_registers *fake);

/* The present configuration, its drives with their indexes. */
void fake_write_sheet(struct fake_registers *fake, struct fake_sheet *sheet);

/* As db_backend's read and write, for fake_client. */
int fake_get(struct fake_registers *fake, uint8_t unit, enum db_table table, uint16_t address,
             uint16_t count, uint16_t *values);
int fake_put_values(struct fake_registers *fake, uint8_t unit, enum db_table table,
                    uint16_t address, uint16_t count, const uint16_t *values);
/* `count` holding registers, each an int; at most 128. */
int fake_put(struct fake_registers *fake, uint8_t unit, uint16_t address, unsigned count, ...);
/* A holding register that can be read, or two as one value, the first the high word. */
uint16_t fake_get1(struct fake_registers *fake, uint8_t unit, uint16_t address);
uint32_t fake_get2(struct fake_registers *fake, uint8_t unit, uint16_t address);

/* The latest request. */
const struct db_request *fake_last_request(const struct fake_registers *fake);
/* The bus completes its request of this number, from 0. */
void fake_complete(struct fake_registers *fake, unsigned number, enum db_result result);

#endif
