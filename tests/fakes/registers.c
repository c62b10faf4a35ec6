/* SPDX-License-Identifier: Apache-2.0 */
#include "fakes/registers.h"

#include "fakes/must.h"

#include <math.h>
#include <stdarg.h>
#include <string.h>

const struct db_client fake_client = { .id = 1, .may_write = true };

/* --- what surrounds the registers
 * -------------------------------------------------------------- */

static db_time now_of(void *context)
{
	return ((const struct fake_registers *)context)->now;
}

static uint64_t wall_of(void *context)
{
	return 1700000000000000u + (uint64_t)now_of(context) / 1000;
}

/* Buses are identified by their configurations. */
static size_t place_of(const struct fake_registers *fake, const struct db_bus *bus)
{
	return (size_t)((const struct db_bus_config *)(const void *)bus - fake->buses);
}

static struct db_request *keep_request(void *context, struct db_bus *bus,
                                       const struct db_request *request)
{
	struct fake_registers *fake = context;
	size_t place = fake->submitted++ % FAKE_REQUESTS;
	struct db_request *kept = fake_place_fill(fake->places, FAKE_PLACES, request);

	must(kept);
	fake->submitted_to = place_of(fake, bus);
	fake->gathered += fake->gathers[place_of(fake, bus)];
	fake->requests[place] = *request;
	fake->args[place] = (struct db_args){ 0 };
	if (request->setting_count == 0 && request->args)
		fake->args[place] = *request->args;
	for (size_t i = 0; i < request->setting_count; i++)
		fake->settings[place][i] = request->settings[i];
	fake->requests[place].args = &fake->args[place];
	if (request->setting_count > 0)
		fake->requests[place].settings = fake->settings[place];
	return kept;
}

static void release_request(void *context, struct db_request *request)
{
	fake_place_release(((struct fake_registers *)context)->places, FAKE_PLACES, request);
}

static void gather_requests(void *context, struct db_bus *bus, bool gathers)
{
	struct fake_registers *fake = context;

	must(fake->gathers[place_of(fake, bus)] != gathers);
	fake->gathers[place_of(fake, bus)] = gathers;
}

static void keep_answer(void *context, struct db_write_token token, uint8_t exception)
{
	struct fake_registers *fake = context;

	must(token.sequence == FAKE_TOKEN.sequence);
	fake->answered++;
	fake->answered_to = token;
	fake->answered_with = exception;
}

static void keep_session_answer(void *context, struct db_write_token token, enum db_result result)
{
	struct fake_registers *fake = context;

	fake->answered++;
	fake->answered_to = token;
	fake->session_answered_with = result;
}

static void tell_bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	const struct fake_registers *fake = context;

	*stats = fake->bus_stats[place_of(fake, bus)];
}

static void tell_server_stats(void *context, struct db_server_stats *stats)
{
	*stats = ((const struct fake_registers *)context)->server_stats;
}

static size_t tell_clients(void *context, struct db_server_client *clients, size_t max)
{
	must(max == FAKE_CLIENTS_SHOWN);
	memcpy(clients, ((const struct fake_registers *)context)->clients,
	       FAKE_CLIENTS * sizeof *clients);
	return FAKE_CLIENTS;
}

static struct db_configuration_report tell_configuration(void *context)
{
	return ((struct fake_registers *)context)->configuration;
}

static void count_refusal(void *context, const struct db_client *client, enum db_refusal kind)
{
	struct fake_registers *fake = context;

	if (kind == DB_REFUSED_ROLE) {
		fake->refused_by_role++;
		return;
	}
	must(kind == DB_REFUSED_CONTROL && client->id <= FAKE_CLIENTS);
	fake->refused[client->id]++;
}

static void count_trip(void *context, const struct db_bus_config *bus,
                       const struct db_drive_config *drive, const struct db_client *last)
{
	struct fake_registers *fake = context;

	must(bus == &fake->buses[drive->bus]);
	fake->tripped++;
	fake->tripped_last = *last;
}

static void count_lost_hold(void *context, const struct db_bus_config *bus,
                            const struct db_drive_config *drive, const struct db_client *holder,
                            bool gone)
{
	struct fake_registers *fake = context;

	(void)holder;
	(void)gone;
	must(bus == &fake->buses[drive->bus]);
	fake->holds_lost++;
}

static uint32_t keep_record(void *context, const struct db_client *client,
                            const struct db_audit_entry *entry)
{
	struct fake_registers *fake = context;

	must(entry->value_count <= DB_SETTINGS_MAX);
	fake->record = *entry;
	for (size_t i = 0; i < entry->value_count; i++)
		fake->record_values[i] = entry->values[i];
	fake->record.values = fake->record_values;
	fake->record_client = client ? client->id : DB_CLIENT_NOBODY;
	return ++fake->recorded;
}

static void keep_record_end(void *context, uint32_t record, const char *drive,
                            enum db_result result, db_time took)
{
	struct fake_registers *fake = context;

	(void)drive;
	(void)took;
	fake->record_ends++;
	fake->ended_record = record;
	fake->ended_with = result;
}

static void count_client(void *context, const struct db_client *client, bool connected)
{
	(void)client;
	((struct fake_registers *)context)->connected += connected;
}

static const struct db_registers_ops ops = {
	.wall_us = wall_of,
	.now = now_of,
	.submit = keep_request,
	.release = release_request,
	.gather = gather_requests,
	.answer = keep_answer,
	.answer_session = keep_session_answer,
	.bus_stats = tell_bus_stats,
	.server_stats = tell_server_stats,
	.server_clients = tell_clients,
	.configuration = tell_configuration,
	.refused = count_refusal,
	.client = count_client,
	.tripped = count_trip,
	.hold_lost = count_lost_hold,
	.audit = keep_record,
	.audit_end = keep_record_end,
};

/* --- making and freeing
 * ------------------------------------------------------------------------ */

void fake_registers_init(struct fake_registers *fake, size_t buses, size_t drives)
{
	must(buses <= FAKE_PLANT_BUSES && drives <= FAKE_PLANT_DRIVES);
	memset(fake, 0, sizeof *fake);
	fake->now = 5 * DB_NS_PER_S;
	fake->configuration = (struct db_configuration_report){ .messages = "", .replaced = "" };
	for (size_t i = 0; i < buses; i++) {
		fake->buses[i] = (struct db_bus_config){
			.driver = db_driver_find("vsmd-serial"),
			.transport = &db_transport_serial,
			.baud = 115200,
			.stop_bits = 1,
			.cycle_ms = 20,
			.queue = 32,
		};
		fake->bus_stats[i].up = true;
	}
	for (unsigned i = 0; i < drives; i++) {
		fake->drives[i] = (struct db_drive_config){
			.name = (char *)"feeder",
			.bus = i == 0 ? 0 : buses - 1,
			.address = i + 5,
			.unit = i + 1,
			.counts_per_unit = 1.0,
			.on_client_loss = DB_ON_LOSS_STOP,
			.unit_name = (char *)"counts",
			.min_position = (double)NAN,
			.max_position = (double)NAN,
			.max_velocity = (double)NAN,
			.max_acceleration = (double)NAN,
		};
		fake->axes[i] = db_axis_new(DB_PARAMS_MAX);
		must(fake->axes[i]);
	}
	fake->config = (struct db_config){
		.modbus = { .confirm_ms = 40 },
		.buses = fake->buses,
		.bus_count = buses,
		.drives = fake->drives,
		.drive_count = drives,
	};
}

void fake_write_sheet(struct fake_registers *fake, struct fake_sheet *sheet)
{
	for (size_t i = 0; i < fake->config.bus_count; i++)
		sheet->buses[i] = (struct db_roster_bus){ &fake->buses[i],
			                                  (void *)&fake->buses[i] };
	for (size_t i = 0; i < fake->config.drive_count; i++)
		sheet->drives[i] = (struct db_roster_drive){ (uint16_t)i, fake->drives[i].bus,
			                                     &fake->drives[i], fake->axes[i] };
	sheet->roster = (struct db_roster){ &fake->config.modbus, sheet->buses,
		                            fake->config.bus_count, sheet->drives,
		                            fake->config.drive_count };
}

void fake_registers_open(struct fake_registers *fake)
{
	struct fake_sheet sheet;

	db_registers_free(fake->registers);
	fake_write_sheet(fake, &sheet);
	must(db_registers_new(&sheet.roster, &ops, fake, &fake->registers) == 0);
}

void fake_registers_close(struct fake_registers *fake)
{
	db_registers_free(fake->registers);
	for (size_t i = 0; i < FAKE_PLANT_DRIVES; i++)
		db_axis_free(fake->axes[i]);
}

/* --- reads, writes and their results
 * ----------------------------------------------------------- */

int fake_get(struct fake_registers *fake, uint8_t unit, enum db_table table, uint16_t address,
             uint16_t count, uint16_t *values)
{
	return db_registers_backend.read(fake->registers, &fake_client, unit, table, address, count,
	                                 values);
}

uint16_t fake_get1(struct fake_registers *fake, uint8_t unit, uint16_t address)
{
	uint16_t value = 0xDEAD;

	must(fake_get(fake, unit, DB_TABLE_HOLDING, address, 1, &value) == 0);
	return value;
}

uint32_t fake_get2(struct fake_registers *fake, uint8_t unit, uint16_t address)
{
	uint16_t values[2] = { 0xDEAD, 0xDEAD };

	must(fake_get(fake, unit, DB_TABLE_HOLDING, address, 2, values) == 0);
	return (uint32_t)values[0] << 16 | values[1];
}

int fake_put_values(struct fake_registers *fake, uint8_t unit, enum db_table table,
                    uint16_t address, uint16_t count, const uint16_t *values)
{
	return db_registers_backend.write(fake->registers, &fake_client, unit, table, address,
	                                  count, values, FAKE_TOKEN);
}

int fake_put(struct fake_registers *fake, uint8_t unit, uint16_t address, unsigned count, ...)
{
	uint16_t values[128];
	va_list words;

	must(count <= sizeof values / sizeof values[0]);
	va_start(words, count);
	for (unsigned i = 0; i < count; i++)
		values[i] = (uint16_t)va_arg(words, int);
	va_end(words);
	return fake_put_values(fake, unit, DB_TABLE_HOLDING, address, (uint16_t)count, values);
}

const struct db_request *fake_last_request(const struct fake_registers *fake)
{
	must(fake->submitted > 0);
	return &fake->requests[(fake->submitted - 1) % FAKE_REQUESTS];
}

void fake_complete(struct fake_registers *fake, unsigned number, enum db_result result)
{
	/* One that has ended before is nowhere. */
	struct db_request late = fake->requests[number % FAKE_REQUESTS];
	struct db_request *kept = fake_place_find(fake->places, FAKE_PLACES, late.ticket);

	must(number < fake->submitted);
	db_registers_complete(fake->registers,
	                      fake_place_end(kept ? kept : &late, result, fake->now), fake->now);
}
