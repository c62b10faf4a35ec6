/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/group.h"

#include "regmap/clients.h"
#include "regmap/regmap_private.h"

#include <modbus.h>
#include <string.h>

static void answer_writer(const struct db_registers *registers, struct db_group *group,
                          uint8_t exception)
{
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
static void begin_command(struct db_registers *registers, struct db_group *group,
                          struct db_write_token token)
{
	answer_writer(registers, group, MODBUS_EXCEPTION_ACKNOWLEDGE);
	group->writer = token;
	/* One count for the groups of all endpoints: an answer finds its own by it. */
	if (++registers->group_generation == 0)
		registers->group_generation = 1;
	group->generation = registers->group_generation;
	group->pending = 0;
	group->worst = 0;
	group->drives = 0;
	group->skew_us = 0;
	group->first_out = group->last_out = 0;
}

static struct db_write_token part_token(const struct db_group *group)
{
	/* The sequence distinguishes the parts of one group command from those of another. */
	return (struct db_write_token){ .client = DB_CLIENT_GROUP, .sequence = group->generation };
}

static void add_part(struct db_group *group, struct db_view_drive *drive,
                     struct db_write_answer answer)
{
	uint8_t exception = db_exception_of(answer.result);

	group->drives++;
	drive->group_ticket = db_commander_newest(drive->commander);
	drive->group = group;
	if (answer.later)
		group->pending++;
	else if (exception > group->worst)
		group->worst = exception;
}

/* All parts were submitted; the writer waits if a drive has to confirm. */
static int finish_handover(struct db_group *group)
{
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

static void stop_part(const struct db_registers *registers, struct db_group *group,
                      struct db_view_drive *drive, const struct db_client *client,
                      enum db_command stop)
{
	struct db_request request = { .client = *client, .command = stop };
	db_time now = registers->ops->now(registers->context);

	add_part(group, drive,
	         db_commander_ask(drive->commander, &request, part_token(group), now));
}

int db_group_stop(struct db_registers *registers, const struct db_view_space *space,
                  const struct db_client *client, enum db_command stop, struct db_write_token token)
{
	struct db_group *group = &space->own->group;

	begin_command(registers, group, token);
	db_group_gather(registers, true);
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		if (!registers->roster->drives[i]->leaving)
			stop_part(registers, group, registers->roster->drives[i], client, stop);
	}
	db_group_gather(registers, false);
	return finish_handover(group);
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

int db_group_stop_listed(struct db_registers *registers, const struct db_view_space *space,
                         const struct db_client *client, enum db_command stop,
                         struct db_write_token token)
{
	struct db_group *group = &space->own->group;
	uint16_t left[DB_GROUP_WORDS];

	if (is_empty(group->units))
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	memcpy(left, group->units, sizeof(left));
	begin_command(registers, group, token);
	db_group_gather(registers, true);
	for (size_t i = 0; i < space->drive_count; i++) {
		struct db_view_drive *drive = space->drives[i];

		bool named = take_unit(left, drive->config->unit);

		if (drive->config->vendor_unit != 0 && take_unit(left, drive->config->vendor_unit))
			named = true;
		if (!drive->leaving && named)
			stop_part(registers, group, drive, client, stop);
	}
	db_group_gather(registers, false);
	/* A stop is not refused because of a wrong unit, but its writer must learn of it. */
	if (!is_empty(left) && group->worst < MODBUS_EXCEPTION_GATEWAY_PATH)
		group->worst = MODBUS_EXCEPTION_GATEWAY_PATH;
	return finish_handover(group);
}

static bool is_staged(const struct db_view_drive *drive)
{
	return !drive->leaving && db_commander_staged(drive->commander) != DB_CMD_NONE;
}

static bool is_in(const struct db_view_space *space, const struct db_view_drive *drive)
{
	for (size_t i = 0; i < space->drive_count; i++) {
		if (space->drives[i] == drive)
			return true;
	}
	return false;
}

/* The group number with which a bus may begin with one frame, which reaches all its drives, also
 * those of other endpoints. 0: it may not. */
static uint32_t common_start(const struct db_registers *registers,
                             const struct db_view_space *space, const struct db_bus_config *bus)
{
	if (!bus->starts_by_broadcast)
		return 0;
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		const struct db_view_drive *drive = registers->roster->drives[i];

		if (drive->bus_config == bus && !(is_staged(drive) && is_in(space, drive)))
			return 0;
	}
	return space->own->group.generation;
}

int db_group_start(struct db_registers *registers, const struct db_view_space *space,
                   const struct db_client *client, struct db_write_token token)
{
	struct db_group *group = &space->own->group;
	db_time now = registers->ops->now(registers->context);
	bool any = false;

	for (size_t i = 0; i < space->drive_count; i++) {
		struct db_view_drive *drive = space->drives[i];

		if (!is_staged(drive))
			continue;
		any = true;
		if (!db_clients_are_permitted(drive, client, DB_MAY_COMMAND)) {
			db_clients_count_refusal(registers, client, DB_REFUSED_ROLE);
			return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
		}
		if (!db_clients_may_write(drive, client, false))
			return MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY;
	}
	if (!any)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	begin_command(registers, group, token);
	/* Before the first of them is submitted and no longer staged. */
	for (size_t i = 0; i < space->drive_count; i++) {
		struct db_view_drive *drive = space->drives[i];

		drive->group_start = is_staged(drive) ?
		                             common_start(registers, space, drive->bus_config) :
		                             0;
	}
	for (size_t i = 0; i < space->drive_count; i++) {
		struct db_view_drive *drive = space->drives[i];

		if (is_staged(drive))
			add_part(group, drive,
			         db_commander_start_staged(drive->commander, client,
			                                   drive->group_start, part_token(group),
			                                   now));
	}
	return finish_handover(group);
}

bool db_group_take_answer(struct db_registers *registers, struct db_write_token token,
                          enum db_result result)
{
	struct db_gateway_unit *unit = registers->units;
	uint8_t exception = db_exception_of(result);
	struct db_group *group;

	if (token.client != DB_CLIENT_GROUP)
		return false;
	while (unit && unit->group.generation != token.sequence)
		unit = unit->next;
	if (!unit || unit->group.pending == 0)
		return true;
	group = &unit->group;
	if (exception > group->worst)
		group->worst = exception;
	group->result = group->worst;
	if (--group->pending == 0)
		answer_writer(registers, group, group->worst);
	return true;
}

void db_group_note_sent(struct db_view_drive *drive, uint32_t ticket, db_time sent)
{
	struct db_group *group = drive->group;

	if (ticket == 0 || ticket != drive->group_ticket || sent == 0)
		return;
	drive->group_ticket = 0;
	if (group->first_out == 0 || sent < group->first_out)
		group->first_out = sent;
	if (sent > group->last_out)
		group->last_out = sent;
	group->skew_us = (uint32_t)((group->last_out - group->first_out) / DB_NS_PER_US);
}
