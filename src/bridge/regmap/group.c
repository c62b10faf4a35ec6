/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/group.h"

#include "regmap/clients.h"
#include "regmap/regmap_private.h"

#include <modbus.h>
#include <string.h>

static void answer_writer(struct db_registers *registers, uint8_t exception)
{
	struct db_group *group = &registers->group;

	if (!group->waits)
		return;
	group->waits = false;
	if (db_client_is_session(group->writer.client))
		registers->ops->answer_session(registers->context, group->writer,
		                               db_exception_result(exception));
	else
		registers->ops->answer(registers->context, group->writer, exception);
}

/* A new group command begins; the writer that waits for an older one is answered that nothing
 * watches it any more. */
static void begin_command(struct db_registers *registers, struct db_write_token token)
{
	struct db_group *group = &registers->group;

	answer_writer(registers, MODBUS_EXCEPTION_ACKNOWLEDGE);
	group->writer = token;
	if (++group->generation == 0)
		group->generation = 1;
	group->pending = 0;
	group->worst = 0;
	group->drives = 0;
	group->skew_us = 0;
	group->first_out = group->last_out = 0;
}

static struct db_write_token part_token(const struct db_registers *registers)
{
	/* The sequence distinguishes the parts of one group command from those of another. */
	return (struct db_write_token){ .client = DB_CLIENT_GROUP,
		                        .sequence = registers->group.generation };
}

static void add_part(struct db_registers *registers, struct db_view_drive *drive,
                     struct db_write_answer answer)
{
	struct db_group *group = &registers->group;
	uint8_t exception = db_exception_of(answer.result);

	group->drives++;
	drive->group_ticket = db_commander_newest(drive->commander);
	if (answer.later)
		group->pending++;
	else if (exception > group->worst)
		group->worst = exception;
}

/* All parts were submitted; the writer waits if a drive has to confirm. */
static int finish_handover(struct db_registers *registers)
{
	struct db_group *group = &registers->group;

	group->result = group->worst;
	if (group->pending == 0)
		return group->worst;
	group->waits = true;
	return DB_WRITE_LATER;
}

void db_group_gather(struct db_registers *registers, bool gathers)
{
	for (size_t i = 0; registers->ops->gather && i < registers->roster->bus_count; i++)
		registers->ops->gather(registers->context, registers->roster->buses[i], gathers);
}

static void stop_part(struct db_registers *registers, struct db_view_drive *drive,
                      const struct db_client *client, enum db_command stop)
{
	struct db_request request = { .client = *client, .command = stop };
	db_time now = registers->ops->now(registers->context);

	add_part(registers, drive,
	         db_commander_ask(drive->commander, &request, part_token(registers), now));
}

int db_group_stop(struct db_registers *registers, const struct db_client *client,
                  enum db_command stop, struct db_write_token token)
{
	begin_command(registers, token);
	db_group_gather(registers, true);
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		if (!registers->roster->drives[i]->leaving)
			stop_part(registers, registers->roster->drives[i], client, stop);
	}
	db_group_gather(registers, false);
	return finish_handover(registers);
}

/* Removes a unit from a set. True if it was in it. */
static bool take_unit(uint16_t units[DB_GROUP_WORDS], unsigned unit)
{
	unsigned word = (unit - 1) / 16;
	unsigned bit = 1u << (unit - 1) % 16;
	bool was = units[word] & bit;

	units[word] = (uint16_t)(units[word] & ~bit);
	return was;
}

static bool is_empty(const uint16_t units[DB_GROUP_WORDS])
{
	for (size_t i = 0; i < DB_GROUP_WORDS; i++) {
		if (units[i] != 0)
			return false;
	}
	return true;
}

int db_group_stop_listed(struct db_registers *registers, const struct db_client *client,
                         enum db_command stop, struct db_write_token token)
{
	uint16_t left[DB_GROUP_WORDS];

	if (is_empty(registers->group.units))
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	memcpy(left, registers->group.units, sizeof(left));
	begin_command(registers, token);
	db_group_gather(registers, true);
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		struct db_view_drive *drive = registers->roster->drives[i];

		bool named = take_unit(left, drive->config->unit);

		if (drive->config->vendor_unit != 0 && take_unit(left, drive->config->vendor_unit))
			named = true;
		if (!drive->leaving && named)
			stop_part(registers, drive, client, stop);
	}
	db_group_gather(registers, false);
	/* A stop is not refused because of a wrong unit, but its writer must learn of it. */
	if (!is_empty(left) && registers->group.worst < MODBUS_EXCEPTION_GATEWAY_PATH)
		registers->group.worst = MODBUS_EXCEPTION_GATEWAY_PATH;
	return finish_handover(registers);
}

static bool is_staged(const struct db_view_drive *drive)
{
	return !drive->leaving && db_commander_staged(drive->commander) != DB_CMD_NONE;
}

/* The group number with which a bus may begin with one frame, which reaches all its drives. 0: it
 * may not. */
static uint32_t common_start(const struct db_registers *registers, const struct db_bus_config *bus)
{
	if (!bus->starts_by_broadcast)
		return 0;
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		const struct db_view_drive *drive = registers->roster->drives[i];

		if (drive->bus_config == bus && !is_staged(drive))
			return 0;
	}
	return registers->group.generation;
}

int db_group_start(struct db_registers *registers, const struct db_client *client,
                   struct db_write_token token)
{
	db_time now = registers->ops->now(registers->context);
	bool any = false;

	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		struct db_view_drive *drive = registers->roster->drives[i];

		if (!is_staged(drive))
			continue;
		any = true;
		if (!db_clients_are_permitted(drive, client, DB_MAY_COMMAND)) {
			db_clients_count_role_refusal(registers, client);
			return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
		}
		if (!db_clients_may_write(drive, client, false))
			return MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY;
	}
	if (!any)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	begin_command(registers, token);
	/* Before the first of them is submitted and no longer staged. */
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		struct db_view_drive *drive = registers->roster->drives[i];

		drive->group_start = is_staged(drive) ? common_start(registers, drive->bus_config) :
		                                        0;
	}
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		struct db_view_drive *drive = registers->roster->drives[i];

		if (is_staged(drive))
			add_part(registers, drive,
			         db_commander_start_staged(drive->commander, client,
			                                   drive->group_start,
			                                   part_token(registers), now));
	}
	return finish_handover(registers);
}

bool db_group_take_answer(struct db_registers *registers, struct db_write_token token,
                          enum db_result result)
{
	struct db_group *group = &registers->group;
	uint8_t exception = db_exception_of(result);

	if (token.client != DB_CLIENT_GROUP)
		return false;
	if (token.sequence != group->generation || group->pending == 0)
		return true;
	if (exception > group->worst)
		group->worst = exception;
	group->result = group->worst;
	if (--group->pending == 0)
		answer_writer(registers, group->worst);
	return true;
}

void db_group_note_sent(struct db_registers *registers, struct db_view_drive *drive,
                        uint32_t ticket, db_time sent)
{
	struct db_group *group = &registers->group;

	if (ticket == 0 || ticket != drive->group_ticket || sent == 0)
		return;
	drive->group_ticket = 0;
	if (group->first_out == 0 || sent < group->first_out)
		group->first_out = sent;
	if (sent > group->last_out)
		group->last_out = sent;
	group->skew_us = (uint32_t)((group->last_out - group->first_out) / DB_NS_PER_US);
}
