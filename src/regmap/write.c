/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/write.h"

#include "regmap/clients.h"
#include "regmap/exception.h"
#include "regmap/span.h"
#include "regmap/state.h"
#include "regmap/words.h"

#include <modbus.h>

static db_time now_of(const struct db_view_drive *drive)
{
	return drive->registers->ops->now(drive->registers->context);
}

static int refuse(struct db_view_drive *drive, const struct db_client *client,
                  enum db_result result)
{
	db_commander_set_refused(drive->commander, client, result, 0);
	return db_exception_of(result);
}

/* Somebody else has control: who tried what is kept for the technician. NONE: parameters. */
static int refuse_command(struct db_view_drive *drive, const struct db_client *client,
                          unsigned code, const struct db_args *args)
{
	struct db_command_block block = { .command = (uint16_t)code, .args = *args };

	db_commander_refuse(drive->commander, client, &block, DB_RESULT_NOT_IN_CONTROL, 0);
	return db_exception_of(DB_RESULT_NOT_IN_CONTROL);
}

/* --- the command block ----------------------------------------------------------------------------- */

/* False when a float is not a number; the others are in the block all the same. */
static bool block_from(const struct db_view_drive *drive, const struct db_client *client,
                       const struct db_span *span, const uint16_t *values,
                       struct db_command_write *write)
{
	bool low_first = drive->registers->roster->modbus->low_word_first;
	bool right = true;

	*write = (struct db_command_write){ .block = db_commander_kept(drive->commander, client) };
	for (uint16_t i = 0; i < span->count; i++) {
		struct db_cell cell = span->cells[i];
		union db_value value;
		bool decoded = db_words_decode(&cell, values, low_first, &value);

		values += cell.registers;
		if (!decoded) {
			right = false;
			continue;
		}
		if (cell.offset == offsetof(struct db_drive_image, block.command))
			write->has_command = true;
		if (cell.offset == offsetof(struct db_drive_image, block.command_id))
			write->has_id = true;
		if (cell.offset == offsetof(struct db_drive_image, block.staged_command))
			write->has_staged = true;
		/* The rows know where the block's members are in an image; here it stands alone. */
		cell.offset = (uint16_t)(cell.offset - offsetof(struct db_drive_image, block));
		db_words_store(&cell, value, &write->block);
	}
	return right;
}

/* The stop among what is written, if there is one: it is carried out whatever stands beside it. */
static enum db_command stop_among(const struct db_span *span, uint16_t address,
                                  const uint16_t *values)
{
	for (uint16_t i = 0; i < span->count; i++) {
		const struct db_cell *cell = &span->cells[i];
		enum db_command code;

		if (cell->part != DB_PART_BLOCK ||
		    cell->offset != offsetof(struct db_drive_image, block.command))
			continue;
		code = (enum db_command)values[cell->address - address];
		return db_command_is_stop(code) ? code : DB_CMD_NONE;
	}
	return DB_CMD_NONE;
}

/* Neither the id nor the arguments of its write count. */
static int stop_only(struct db_view_drive *drive, const struct db_client *client,
                     enum db_command stop, struct db_write_token token)
{
	const struct db_args none = { 0 };

	return db_exception_of_answer(
		db_commander_execute(drive->commander, client, stop, &none, token, now_of(drive)));
}

static int write_block(struct db_view_drive *drive, const struct db_client *client,
                       const struct db_span *span, const uint16_t *values,
                       struct db_write_token token)
{
	struct db_command_write write;
	bool right = block_from(drive, client, span, values, &write);
	bool stop = write.has_command && db_command_is_stop((enum db_command)write.block.command);

	/* A stop needs no arguments: wrong ones do not keep it from the drive. */
	if (!right && !stop) {
		db_commander_set_refused(drive->commander, client, DB_RESULT_OUT_OF_RANGE, 0);
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	}
	if (db_clients_may_write(drive, client, stop))
		return db_exception_of_answer(
			db_commander_write(drive->commander, client, &write, token, now_of(drive)));
	if (!stop && write.has_command && write.block.command != DB_CMD_NONE)
		return refuse_command(drive, client, write.block.command, &write.block.args);
	if (!stop)
		return refuse(drive, client, DB_RESULT_NOT_IN_CONTROL);
	/* Neither the id nor the arguments are for the one in control to find. */
	return stop_only(drive, client, (enum db_command)write.block.command, token);
}

/* --- parameters -------------------------------------------------------------------------------------- */

/* Everything was read since the drive came, and this was not among it: the model has no such parameter. */
static bool is_lacking(const struct db_view_drive *drive, unsigned param)
{
	const uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;
	struct db_nameplate plate;
	struct db_snapshot snapshot;

	db_axis_read(drive->axis, &snapshot);
	db_axis_read_nameplate(drive->axis, &plate);
	return (snapshot.feedback.status & wanted) == wanted && !(plate.valid >> param & 1);
}

/* One register of a write, perhaps beside others. What reads as 0 in a block takes 0 back there: registers
 * between parameters, and parameters that the model lacks. */
static enum db_result take_setting(const struct db_view_drive *drive, const struct db_cell *cell,
                                   bool beside, const uint16_t *words, struct db_setting *settings,
                                   size_t *count)
{
	bool low_first = drive->registers->roster->modbus->low_word_first;
	union db_value value;
	enum db_result checked;

	if (!db_words_decode(cell, words, low_first, &value))
		return DB_RESULT_OUT_OF_RANGE;
	if (cell->flags & DB_CELL_GAP)
		return value.u == 0 ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
	/* Other values are for the drive to judge: some can only be written, or were not read. */
	if (value.u == 0 && beside && is_lacking(drive, cell->param))
		return DB_RESULT_OK;
	checked = drive->driver->check_param(drive->bus_config, cell->param, value);
	if (checked != DB_RESULT_OK)
		return checked;
	settings[*count].param = cell->param;
	settings[*count].value = value;
	(*count)++;
	return DB_RESULT_OK;
}

static int refuse_setting(struct db_view_drive *drive, const struct db_client *client,
                          enum db_result result, uint16_t address)
{
	db_commander_set_refused(drive->commander, client, result, address);
	/* The family has this register, but the drive has nothing behind it. */
	return result == DB_RESULT_UNSUPPORTED ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS :
	                                         MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
}

static int write_params(struct db_view_drive *drive, const struct db_client *client,
                        const struct db_span *span, const uint16_t *values,
                        struct db_write_token token)
{
	struct db_setting settings[DB_SETTINGS_MAX];
	bool gaps = true;
	size_t count = 0;

	for (uint16_t i = 0; i < span->count; i++) {
		const struct db_cell *cell = &span->cells[i];
		enum db_result result = take_setting(drive, cell, span->count > 1, values, settings,
		                                     &count);

		if (result != DB_RESULT_OK)
			return refuse_setting(drive, client, result, cell->address);
		gaps = gaps && (cell->flags & DB_CELL_GAP);
		values += cell->registers;
	}
	if (count == 0)
		return gaps ? 0 :
		              refuse_setting(drive, client, DB_RESULT_UNSUPPORTED,
		                             span->cells[0].address);
	if (!db_clients_may_write(drive, client, false))
		return refuse_command(drive, client, DB_CMD_NONE, &(struct db_args){ 0 });
	return db_exception_of_answer(
		db_commander_set(drive->commander, client, settings, count, token, now_of(drive)));
}

/* --- the watchdog ------------------------------------------------------------------------------------ */

static int write_watchdog(struct db_view_drive *drive, const struct db_client *client,
                          const struct db_span *span, const uint16_t *values)
{
	union db_value value;

	if (span->count != 1 ||
	    !db_words_decode(&span->cells[0], values,
	                     drive->registers->roster->modbus->low_word_first, &value) ||
	    value.u > DB_WATCHDOG_MAX_MS) {
		db_commander_set_refused(drive->commander, client, DB_RESULT_OUT_OF_RANGE, 0);
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	}
	if (!db_clients_may_write(drive, client, false))
		return refuse(drive, client, DB_RESULT_NOT_IN_CONTROL);
	/* Without on-client-loss it would trip and stop nothing. */
	if (value.u != 0 && drive->config->on_client_loss == DB_ON_LOSS_NONE)
		return refuse(drive, client, DB_RESULT_UNSUPPORTED);
	db_commander_set_watchdog(drive->commander, value.u,
	                          db_client_arrived(client, now_of(drive)));
	return 0;
}

static int write_heartbeat(struct db_view_drive *drive, const struct db_client *client,
                           uint16_t value)
{
	if (!db_clients_may_write(drive, client, false))
		return refuse(drive, client, DB_RESULT_NOT_IN_CONTROL);
	if (db_heartbeat_write(&drive->heartbeat, client->address, value))
		db_clients_feed(drive, client, DB_FEED_HEARTBEAT);
	return 0;
}

/* --- control ----------------------------------------------------------------------------------------- */

static int write_control(struct db_view_drive *drive, const struct db_client *client,
                         uint16_t value)
{
	const struct db_registers *registers = drive->registers;

	if (value > 1)
		return refuse(drive, client, DB_RESULT_OUT_OF_RANGE);
	if (value == 0) {
		db_control_release(&drive->control, client);
		return 0;
	}
	/* Without it everybody may command: nobody is to believe otherwise. */
	if (!drive->control.enabled)
		return refuse(drive, client, DB_RESULT_UNSUPPORTED);
	if (db_control_request(&drive->control, client, now_of(drive)))
		return 0;
	if (registers->ops->refused)
		registers->ops->refused(registers->context, client, DB_REFUSED_CONTROL);
	return refuse(drive, client, DB_RESULT_NOT_IN_CONTROL);
}

/* --- coils ------------------------------------------------------------------------------------------- */

/* The first coil that is an input of the drive, if there is one: nothing is switched then. */
static const struct db_cell *input_among(const struct db_view_drive *drive,
                                         const struct db_span *span)
{
	unsigned inputs = db_commander_input_ports(drive->commander);

	for (uint16_t i = 0; i < span->count; i++) {
		if (inputs >> span->cells[i].bit & 1)
			return &span->cells[i];
	}
	return NULL;
}

static int refuse_input(struct db_view_drive *drive, const struct db_client *client,
                        const struct db_args *args, const struct db_cell *input)
{
	struct db_command_block block = { .command = DB_CMD_SET_OUTPUTS, .args = *args };

	db_commander_refuse(drive->commander, client, &block, DB_RESULT_REFUSED,
	                    (uint16_t)(input->bit + 1));
	return db_exception_of(DB_RESULT_REFUSED);
}

static int write_coils(struct db_view_drive *drive, const struct db_client *client,
                       const struct db_span *span, const uint16_t *values,
                       struct db_write_token token)
{
	const struct db_cell *input = input_among(drive, span);
	struct db_args args = { 0 };

	for (uint16_t i = 0; i < span->count; i++) {
		unsigned bit = 1u << span->cells[i].bit;

		args.output_mask = (uint16_t)(args.output_mask | bit);
		if (values[i])
			args.output_levels = (uint16_t)(args.output_levels | bit);
	}
	if (!db_clients_may_write(drive, client, false))
		return refuse_command(drive, client, DB_CMD_SET_OUTPUTS, &args);
	if (input)
		return refuse_input(drive, client, &args, input);
	return db_exception_of_answer(db_commander_execute(
		drive->commander, client, DB_CMD_SET_OUTPUTS, &args, token, now_of(drive)));
}

int db_write_drive(struct db_view_drive *drive, const struct db_client *client, enum db_table table,
                   uint16_t address, uint16_t count, const uint16_t *values,
                   struct db_write_token token)
{
	const struct db_index *index = table == DB_TABLE_COILS ? &drive->map->coils :
	                                                         &drive->map->holding;
	struct db_span span;
	uint8_t exception = db_span_find(index, address, count, &span);

	if (exception)
		return exception;
	if (table == DB_TABLE_COILS)
		return write_coils(drive, client, &span, values, token);
	if (!db_span_is_whole(&span, address, count)) {
		enum db_command stop = stop_among(&span, address, values);

		if (stop != DB_CMD_NONE)
			return stop_only(drive, client, stop, token);
		db_commander_set_refused(drive->commander, client, DB_RESULT_OUT_OF_RANGE, 0);
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	}
	if (span.cells[0].flags & DB_ROW_WATCHDOG)
		return write_watchdog(drive, client, &span, values);
	if (span.cells[0].flags & DB_ROW_CONTROL)
		return write_control(drive, client, values[0]);
	if (span.cells[0].flags & DB_ROW_HEARTBEAT)
		return write_heartbeat(drive, client, values[0]);
	if (span.cells[0].part == DB_PART_BLOCK)
		return write_block(drive, client, &span, values, token);
	return write_params(drive, client, &span, values, token);
}

int db_write_drive_same(struct db_view_drive *drive, const struct db_client *client,
                        uint16_t address, uint16_t value, struct db_write_token token)
{
	struct db_span span;
	uint8_t exception = db_span_find_single(&drive->map->holding, address, &span);

	if (exception)
		return exception;
	if (stop_among(&span, address, &value) == DB_CMD_NONE)
		return 0;
	return db_write_drive(drive, client, DB_TABLE_HOLDING, address, 1, &value, token);
}
