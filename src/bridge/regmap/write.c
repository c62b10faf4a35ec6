/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "regmap/clients.h"

#include <modbus.h>

/* One write to a drive, of existing registers or coils. */
struct write {
	struct db_view_drive *drive;
	const struct db_client *client;
	struct db_span span;
	uint16_t address; /* address of the first value, which may be in the middle of a cell */
	const uint16_t *values;
	struct db_write_token token;
	db_time now;
	bool low_first;
};

/* The write is refused for its form, or for this register; 0: none in particular. */
static int refuse_write(const struct write *write, enum db_result result, uint16_t address)
{
	db_commander_set_refused(write->drive->commander, write->client, result, address);
	return db_exception_of(result);
}

/* A command, or with NONE a parameter write, that could have been carried out: recorded for the
 * technician. */
static int refuse_command(const struct write *write, unsigned command, const struct db_args *args,
                          enum db_result result, uint16_t address)
{
	struct db_request request = {
		.client = *write->client,
		.command = (enum db_command)command,
		.args = args,
	};

	db_commander_refuse(write->drive->commander, &request, result, address);
	return db_exception_of(result);
}

static int execute_command(const struct write *write, enum db_command command,
                           const struct db_args *args)
{
	struct db_request request = { .client = *write->client, .command = command, .args = args };

	return db_exception_of_answer(
		db_commander_ask(write->drive->commander, &request, write->token, write->now));
}

/* --- the command block ------------------------------------------------------------------------ */

/* The command in one of the command block's registers in a write; NONE. */
static uint16_t find_command(const struct write *write, size_t offset)
{
	for (uint16_t i = 0; i < write->span.count; i++) {
		const struct db_cell *cell = &write->span.cells[i];

		if (cell->part == DB_PART_BLOCK && cell->offset == offset)
			return write->values[cell->address - write->address];
	}
	return DB_CMD_NONE;
}

/* The stop in a write; NONE. It is carried out whatever else is written. */
static enum db_command find_stop(const struct write *write)
{
	enum db_command command = (enum db_command)find_command(
		write, offsetof(struct db_drive_image, block.command));

	return db_command_is_stop(command) ? command : DB_CMD_NONE;
}

/* True if it gives one of these commands (a set of DB_COMMAND_BIT), now or to be started later. */
static bool has_command(const struct write *write, uint64_t commands)
{
	uint16_t now = find_command(write, offsetof(struct db_drive_image, block.command));
	uint16_t later = find_command(write, offsetof(struct db_drive_image, block.staged_command));

	return (now < DB_CMD_LIMIT && (commands >> now & 1)) ||
	       (later < DB_CMD_LIMIT && (commands >> later & 1));
}

/* True if it changes what a drive keeps, the watchdog, or what only a raw frame reaches. */
static bool changes_settings(const struct write *write)
{
	const struct db_cell *first = &write->span.cells[0];

	if (first->part != DB_PART_BLOCK)
		return !(first->flags & (DB_ROW_CONTROL | DB_ROW_HEARTBEAT));
	return has_command(write, DB_COMMAND_BIT(DB_CMD_SAVE_PARAMETERS) |
	                                  DB_COMMAND_BIT(DB_CMD_RAW_FRAME));
}

/* What may move other drives of the bus needs the right to command them. */
static bool is_permitted_for_bus(const struct write *write)
{
	const struct db_view_drive *drive = write->drive;
	const struct db_registers *registers = drive->registers;

	if (!has_command(write,
	                 DB_COMMAND_BIT(DB_CMD_SYNC_START) | DB_COMMAND_BIT(DB_CMD_RAW_FRAME)))
		return true;
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		const struct db_view_drive *other = registers->roster->drives[i];
		bool here = db_client_is_session(write->client->id) ||
		            other->config->endpoint == write->client->endpoint;

		if (other->bus_config != drive->bus_config ||
		    (here && db_clients_are_permitted(other, write->client, DB_MAY_COMMAND)))
			continue;
		if (here)
			db_clients_count_refusal(registers, write->client, DB_REFUSED_ROLE);
		db_record_denied(registers, drive, write->client, (uint8_t)drive->config->unit,
		                 write->address,
		                 here ? "its role does not allow it for every drive of the bus" :
		                        "the bus has drives of another endpoint");
		return false;
	}
	return true;
}

/* Applies the write to the kept block. False when a float is not a number, or hold_ms not one of
 * its values; the others are in the block all the same. */
static bool decode_block(const struct write *write, struct db_command_write *to)
{
	const uint16_t *words = write->values;
	bool right = true;

	*to = (struct db_command_write){
		.block = db_commander_kept(write->drive->commander, write->client),
	};
	for (uint16_t i = 0; i < write->span.count; i++) {
		struct db_cell cell = write->span.cells[i];
		union db_value value;
		bool decoded = db_words_decode(&cell, words, write->low_first, &value);

		words += cell.registers;
		/* A wrong value is not stored either, next to a stop. */
		if (decoded && cell.offset == offsetof(struct db_drive_image, block.hold_ms))
			decoded = value.u == 0 ||
			          (value.u >= DB_HOLD_MIN_MS && value.u <= DB_HOLD_MAX_MS);
		if (!decoded) {
			right = false;
			continue;
		}
		if (cell.offset == offsetof(struct db_drive_image, block.command))
			to->has_command = true;
		if (cell.offset == offsetof(struct db_drive_image, block.command_id))
			to->has_id = true;
		if (cell.offset == offsetof(struct db_drive_image, block.staged_command))
			to->has_staged = true;
		if (cell.offset == offsetof(struct db_drive_image, block.hold_beat))
			to->has_beat = true;
		/* The rows have the places of the block's members in an image; here it is a
		 * separate struct. */
		cell.offset = (uint16_t)(cell.offset - offsetof(struct db_drive_image, block));
		db_words_store(&cell, value, &to->block);
	}
	return right;
}

static int write_block(const struct write *write)
{
	struct db_command_write to;
	bool right = decode_block(write, &to);
	bool stop = to.has_command && db_command_is_stop((enum db_command)to.block.command);

	/* A stop needs no arguments: wrong ones do not prevent it. */
	if (!right && !stop)
		return refuse_write(write, DB_RESULT_OUT_OF_RANGE, 0);
	if (db_clients_may_write(write->drive, write->client, stop))
		return db_exception_of_answer(db_commander_write(
			write->drive->commander, write->client, &to, write->token, write->now));
	/* Do not store id or arguments of a client that has no control. */
	if (stop)
		return execute_command(write, (enum db_command)to.block.command, NULL);
	if (to.has_command && to.block.command != DB_CMD_NONE)
		return refuse_command(write, to.block.command, &to.block.args,
		                      DB_RESULT_NOT_IN_CONTROL, 0);
	return refuse_write(write, DB_RESULT_NOT_IN_CONTROL, 0);
}

/* --- parameters ------------------------------------------------------------------------------- */

/* True if everything was read since the drive came online, but not this parameter: the model does
 * not have it. */
static bool is_lacking(const struct db_view_drive *drive, unsigned param)
{
	const uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;
	struct db_nameplate_copy copy;
	struct db_snapshot snapshot;

	db_axis_read(drive->axis, &snapshot);
	db_axis_read_nameplate(drive->axis, &copy);
	return (snapshot.feedback.status & wanted) == wanted &&
	       !db_params_have(copy.plate.valid, param);
}

static int refuse_setting(const struct write *write, enum db_result result, uint16_t address)
{
	(void)refuse_write(write, result, address);
	/* The family has this register, but this drive has no such function. */
	return result == DB_RESULT_UNSUPPORTED ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS :
	                                         MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
}

/* Registers that read as 0 in a block accept 0: registers between parameters, and parameters that
 * the model lacks. */
static int write_params(const struct write *write)
{
	struct db_view_drive *drive = write->drive;
	const uint16_t *words = write->values;
	struct db_setting settings[DB_SETTINGS_MAX];
	struct db_request request;
	bool gaps = true;
	size_t count = 0;

	for (uint16_t i = 0; i < write->span.count; i++) {
		const struct db_cell *cell = &write->span.cells[i];
		bool gap = cell->flags & DB_CELL_GAP;
		enum db_result result = DB_RESULT_OK;
		union db_value value;

		if (!db_words_decode(cell, words, write->low_first, &value)) {
			result = DB_RESULT_OUT_OF_RANGE;
		} else if (gap) {
			result = value.u == 0 ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
		} else if (value.u != 0 || write->span.count == 1 ||
		           !is_lacking(drive, cell->param)) {
			/* The drive judges other values: some can only be written, or were not
			 * read. */
			result = db_driver_check_param(drive->bus_config, cell->param, value);
			settings[count++] = (struct db_setting){ cell->param, value };
		}
		if (result != DB_RESULT_OK)
			return refuse_setting(write, result, cell->address);
		gaps = gaps && gap;
		words += cell->registers;
	}
	if (count == 0 && gaps)
		return 0;
	if (count == 0)
		return refuse_setting(write, DB_RESULT_UNSUPPORTED, write->span.cells[0].address);
	if (!db_clients_may_write(drive, write->client, false))
		return refuse_command(write, DB_CMD_NONE, NULL, DB_RESULT_NOT_IN_CONTROL, 0);
	request = (struct db_request){
		.client = *write->client,
		.settings = settings,
		.setting_count = (uint8_t)count,
	};
	return db_exception_of_answer(
		db_commander_ask(drive->commander, &request, write->token, write->now));
}

/* --- the bridge's own settings ---------------------------------------------------------------- */

static int write_watchdog(const struct write *write)
{
	struct db_view_drive *drive = write->drive;
	struct db_command_state state;
	union db_value value;

	if (write->span.count != 1 ||
	    !db_words_decode(&write->span.cells[0], write->values, write->low_first, &value) ||
	    value.u > DB_WATCHDOG_MAX_MS)
		return refuse_write(write, DB_RESULT_OUT_OF_RANGE, 0);
	if (!db_clients_may_write(drive, write->client, false))
		return refuse_write(write, DB_RESULT_NOT_IN_CONTROL, 0);
	/* Without on-client-loss it would trip and stop nothing. */
	if (value.u != 0 && drive->config->on_client_loss == DB_ON_LOSS_NONE)
		return refuse_write(write, DB_RESULT_UNSUPPORTED, 0);
	db_commander_state(drive->commander, write->client, &state, write->now);
	db_record_watchdog(drive, write->client, state.watchdog_ms, value.u);
	db_commander_set_watchdog(drive->commander, value.u,
	                          db_client_arrived(write->client, write->now));
	db_clients_feed(drive, write->client, DB_FEED_WRITES);
	return 0;
}

static int write_heartbeat(const struct write *write)
{
	struct db_view_drive *drive = write->drive;

	if (!db_clients_may_write(drive, write->client, false))
		return refuse_write(write, DB_RESULT_NOT_IN_CONTROL, 0);
	db_clients_feed(
		drive, write->client,
		db_heartbeat_write(&drive->heartbeat, write->client->address, write->values[0]) ?
			DB_FEED_HEARTBEAT :
			DB_FEED_WRITES);
	return 0;
}

static int write_control(const struct write *write)
{
	struct db_control *control = &write->drive->control;
	bool holds = db_control_holds(control, write->client, write->now);

	if (write->values[0] > 1)
		return refuse_write(write, DB_RESULT_OUT_OF_RANGE, 0);
	if (write->values[0] == 0) {
		if (control->holder.id == write->client->id)
			db_record_control(write->drive, write->client, false);
		db_control_release(control, write->client);
		return 0;
	}
	if (!db_clients_permit(write->drive, write->client, DB_MAY_CLAIM, write->address))
		return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	/* `control = off`: refuse claims, since they would not be enforced. */
	if (!control->enabled)
		return refuse_write(write, DB_RESULT_UNSUPPORTED, 0);
	if (db_control_request(control, write->client, write->now)) {
		if (!holds)
			db_record_control(write->drive, write->client, true);
		db_clients_feed(write->drive, write->client, DB_FEED_WRITES);
		return 0;
	}
	db_clients_count_refusal(write->drive->registers, write->client, DB_REFUSED_CONTROL);
	return refuse_write(write, DB_RESULT_NOT_IN_CONTROL, 0);
}

/* --- coils ------------------------------------------------------------------------------------ */

static int write_coils(const struct write *write)
{
	unsigned inputs = db_commander_input_ports(write->drive->commander);
	const struct db_cell *input = NULL;
	struct db_args args = { 0 };

	for (uint16_t i = 0; i < write->span.count; i++) {
		const struct db_cell *coil = &write->span.cells[i];
		unsigned bit = 1u << coil->bit;

		args.output_mask = (uint16_t)(args.output_mask | bit);
		if (write->values[i])
			args.output_levels = (uint16_t)(args.output_levels | bit);
		if (!input && (inputs & bit))
			input = coil;
	}
	if (!db_clients_may_write(write->drive, write->client, false))
		return refuse_command(write, DB_CMD_SET_OUTPUTS, &args, DB_RESULT_NOT_IN_CONTROL,
		                      0);
	/* Nothing is switched when one of them is an input of the drive; the first one is
	 * reported. */
	if (input)
		return refuse_command(write, DB_CMD_SET_OUTPUTS, &args, DB_RESULT_REFUSED,
		                      (uint16_t)(input->bit + 1));
	return execute_command(write, DB_CMD_SET_OUTPUTS, &args);
}

/* --- which of them ---------------------------------------------------------------------------- */

int db_write_drive(struct db_view_drive *drive, const struct db_client *client, enum db_table table,
                   uint16_t address, uint16_t count, const uint16_t *values,
                   struct db_write_token token)
{
	const struct db_registers *registers = drive->registers;
	const struct db_cell *first;
	struct write write = {
		.drive = drive,
		.client = client,
		.address = address,
		.values = values,
		.token = token,
		.now = registers->ops->now(registers->context),
		.low_first = registers->roster->modbus->low_word_first,
	};
	uint8_t exception = db_span_find(table == DB_TABLE_COILS ? &drive->map->coils :
	                                                           &drive->map->holding,
	                                 address, count, &write.span);

	if (exception) {
		db_record_denied(registers, drive, client, 0, address, "no such register");
		return exception;
	}
	if (table == DB_TABLE_COILS)
		return write_coils(&write);
	first = &write.span.cells[0];
	if (!db_span_is_whole(&write.span, address, count)) {
		enum db_command stop = find_stop(&write);

		return stop != DB_CMD_NONE ? execute_command(&write, stop, NULL) :
		                             refuse_write(&write, DB_RESULT_OUT_OF_RANGE, 0);
	}
	if ((changes_settings(&write) &&
	     !db_clients_permit(drive, client, DB_MAY_SET_PARAMETERS, address)) ||
	    !is_permitted_for_bus(&write)) {
		enum db_command stop = find_stop(&write);

		return stop != DB_CMD_NONE ? execute_command(&write, stop, NULL) :
		                             MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	}
	if (first->flags & DB_ROW_WATCHDOG)
		return write_watchdog(&write);
	if (first->flags & DB_ROW_CONTROL)
		return write_control(&write);
	if (first->flags & DB_ROW_HEARTBEAT)
		return write_heartbeat(&write);
	return first->part == DB_PART_BLOCK ? write_block(&write) : write_params(&write);
}

enum db_command db_write_find_stop(const struct db_view_drive *drive, uint16_t address,
                                   uint16_t count, const uint16_t *values)
{
	struct write write = { .address = address, .values = values };

	return db_span_find(&drive->map->holding, address, count, &write.span) == 0 ?
	               find_stop(&write) :
	               DB_CMD_NONE;
}

int db_write_drive_same(struct db_view_drive *drive, const struct db_client *client,
                        uint16_t address, uint16_t value, struct db_write_token token)
{
	struct write write = { .address = address, .values = &value };
	uint8_t exception = db_span_find_single(&drive->map->holding, address, &write.span);

	if (exception)
		return exception;
	if (find_stop(&write) == DB_CMD_NONE)
		return 0;
	return db_write_drive(drive, client, DB_TABLE_HOLDING, address, 1, &value, token);
}
