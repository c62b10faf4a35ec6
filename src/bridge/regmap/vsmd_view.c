/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/vsmd_view.h"

#include "regmap/clients.h"
#include "regmap/regmap_private.h"
#include "regmap/vsmd_layout.h"

#include <modbus.h>
#include <stdlib.h>
#include <string.h>

/* The sensor ports that the map packs into one register. */
#define PORTS 6

/* No client: an answer to it is dropped. */
static const struct db_write_token nobody = { .client = DB_CLIENT_NOBODY };

/* A command that waits for the parameters of the same write. */
struct follow_up {
	uint32_t ticket; /* ticket of the parameters; 0 = none */
	enum db_command command;
	struct db_args args;
	struct db_write_token token;
	struct db_client client;
	bool waits;     /* the writer was not answered yet */
	bool cancelled; /* a stop was sent in between */
};

struct db_vsmd_view {
	struct vsmd_kept kept;
	uint32_t last_ticket; /* ticket of the drive's latest request, of any client */
	struct follow_up follow_up;
};

struct db_vsmd_view *db_vsmd_view_new(const struct db_drive_config *config)
{
	struct db_vsmd_view *view = calloc(1, sizeof(*view));

	if (view)
		view->kept.mbs = config->vendor_high_first;
	return view;
}

/* --- the rows of a request -------------------------------------------------------------------- */

struct rows {
	const struct vsmd_row *rows;
	size_t count;
};

/* The rows that cover the addresses. Rows have no gaps, so only the ends decide. */
static uint8_t find_rows(enum db_table table, uint16_t address, uint16_t count,
                         struct rows *touched)
{
	size_t total;
	const struct vsmd_row *rows = db_vsmd_layout_rows(table, &total);
	size_t end = (size_t)address + count;
	struct db_cell last;
	size_t first = 0;

	if (!rows || count == 0)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	last = db_vsmd_layout_cell(&rows[total - 1]);
	if (end > (size_t)last.address + last.registers)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	while (first + 1 < total && rows[first + 1].row.address <= address)
		first++;
	touched->rows = &rows[first];
	touched->count = 1;
	while (first + touched->count < total && rows[first + touched->count].row.address < end)
		touched->count++;
	return 0;
}

/* False if only half of a 32-bit value would be written. */
static bool is_whole(const struct rows *touched, uint16_t address, uint16_t count)
{
	struct db_cell last = db_vsmd_layout_cell(&touched->rows[touched->count - 1]);

	return touched->rows[0].row.address == address &&
	       last.address + last.registers == address + count;
}

/* Number of the drive's parameters, from row->param on, that the row shows. */
static unsigned params_of(const struct vsmd_row *row)
{
	switch (row->content) {
	case VSMD_PARAM:
		return 1;
	case VSMD_EVENTS:
		return 2;
	case VSMD_MODES:
		return PORTS;
	default:
		return 0;
	}
}

/* --- reading ---------------------------------------------------------------------------------- */

/* True if everything was read since the drive came online, so that a missing parameter does not
 * exist. */
static bool is_known(const struct db_feedback *feedback)
{
	uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;

	return (feedback->status & wanted) == wanted;
}

/* Old data is never shown as current. */
static uint8_t check_row(const struct db_view_drive *drive, const struct vsmd_row *row,
                         const struct db_drive_image *image)
{
	bool stale_values = drive->registers->roster->modbus->stale_values;
	const struct db_feedback *feedback = &image->feedback;
	bool online = (feedback->status & DB_STATUS_ONLINE) && feedback->taken != 0;

	if (row->content == VSMD_MEASURED)
		return online || stale_values ? 0 : db_exception_unreachable(feedback);
	if (is_known(feedback))
		return 0;
	for (unsigned i = 0; i < params_of(row); i++) {
		if (!stale_values || !db_params_have(image->nameplate.plate.valid, row->param + i))
			return db_exception_unreachable(feedback);
	}
	return 0;
}

/* 0 when the drive does not have it. */
static uint32_t param_word(const struct db_nameplate *plate, unsigned param)
{
	return db_params_have(plate->valid, param) ? plate->values[param].u : 0;
}

static void encode_row(const struct db_vsmd_view *view, const struct vsmd_row *row,
                       const struct db_drive_image *image, uint16_t *words)
{
	struct db_cell cell = db_vsmd_layout_cell(row);
	bool low_first = view->kept.mbs == 0;
	const struct db_nameplate *plate = &image->nameplate.plate;
	union db_value value;
	unsigned bits = 0;
	bool ended = false;

	switch (row->content) {
	case VSMD_KEPT:
		db_words_encode(&cell, &view->kept, low_first, words);
		break;
	case VSMD_MEASURED:
		db_words_encode(&cell, image, low_first, words);
		break;
	case VSMD_PARAM:
		value.u = param_word(plate, row->param);
		cell.flags = DB_ROW_PARAM; /* 32 bits wide for all types */
		db_words_encode(&cell, &value, low_first, words);
		break;
	case VSMD_MODES:
		for (unsigned i = 0; i < PORTS; i++)
			bits |= (param_word(plate, row->param + i) & 1) << i;
		words[0] = (uint16_t)bits;
		break;
	case VSMD_EVENTS:
		words[0] = (uint16_t)(param_word(plate, row->param) << 8 |
		                      param_word(plate, row->param + 1u));
		break;
	case VSMD_VERSION:
		/* The first character in the low byte. */
		for (size_t i = 0; i < 2 * VSMD_VERSION_REGISTERS; i++) {
			unsigned character = ended ? 0 : (unsigned char)plate->identity[i];

			ended = character == 0;
			if (i % 2 == 0)
				words[i / 2] = (uint16_t)character;
			else
				words[i / 2] = (uint16_t)(words[i / 2] | character << 8);
		}
		break;
	case VSMD_RESERVED:
		words[0] = 0;
		break;
	}
}

uint8_t db_vsmd_view_read(const struct db_view_drive *drive, enum db_table table, uint16_t address,
                          uint16_t count, uint16_t *values)
{
	struct db_drive_image image;
	struct rows touched;
	uint8_t exception = find_rows(table, address, count, &touched);
	uint16_t words[DB_CELL_REGISTERS_MAX] = { 0 };
	unsigned parts = DB_PART_PROCESS;

	if (exception)
		return exception;
	for (size_t i = 0; i < touched.count; i++) {
		if (params_of(&touched.rows[i]) > 0 || touched.rows[i].content == VSMD_VERSION)
			parts |= DB_PART_PLATE;
	}
	db_image_fill_drive(&image, drive, NULL, parts, 0, 0);
	for (size_t i = 0; i < touched.count; i++) {
		exception = check_row(drive, &touched.rows[i], &image);
		if (exception)
			return exception;
	}
	for (size_t i = 0; i < touched.count; i++) {
		struct db_cell cell = db_vsmd_layout_cell(&touched.rows[i]);

		encode_row(drive->vsmd_view, &touched.rows[i], &image, words);
		for (unsigned j = 0; j < cell.registers; j++) {
			unsigned at = cell.address + j;

			if (at >= address && at < (unsigned)address + count)
				values[at - address] = words[j];
		}
	}
	return 0;
}

/* --- what a write asks for -------------------------------------------------------------------- */

struct plan {
	const struct db_view_drive *drive;
	const struct db_client *client;
	struct db_nameplate_copy nameplate; /* the drive's parameters, ... */
	bool plate_is_known;                /* ... and whether they are known */
	struct vsmd_kept kept;              /* with the written registers applied */
	uint16_t refused;                   /* the register processed last */
	bool has_command;                   /* these registers were written */
	bool has_pos;
	enum db_command command; /* NONE: nothing is to be executed */
	struct db_args args;
	size_t setting_count;
	struct db_setting settings[DB_SETTINGS_MAX];
};

static enum db_result plan_setting(struct plan *plan, unsigned param, union db_value value)
{
	const struct db_view_drive *drive = plan->drive;
	enum db_result checked;

	if (plan->plate_is_known && !db_params_have(plan->nameplate.plate.valid, param))
		return value.u == 0 ? DB_RESULT_OK : DB_RESULT_UNSUPPORTED;
	checked = db_driver_check_param(drive->bus_config, param, value);
	if (checked == DB_RESULT_OK)
		plan->settings[plan->setting_count++] = (struct db_setting){
			.param = (uint16_t)param,
			.value = value,
		};
	return checked;
}

static enum db_result plan_row(struct plan *plan, const struct vsmd_row *row, const uint16_t *words)
{
	struct db_cell cell = db_vsmd_layout_cell(row);
	enum db_result result = DB_RESULT_OK;
	union db_value value;

	if (!db_words_decode(&cell, words, plan->drive->vsmd_view->kept.mbs == 0, &value))
		return DB_RESULT_OUT_OF_RANGE;
	switch (row->content) {
	case VSMD_KEPT:
		if (cell.offset == offsetof(struct vsmd_kept, command))
			plan->has_command = true;
		if (cell.offset == offsetof(struct vsmd_kept, pos))
			plan->has_pos = true;
		db_words_store(&cell, value, &plan->kept);
		return plan->kept.mbs <= 1 ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
	case VSMD_PARAM:
		return plan_setting(plan, row->param, value);
	case VSMD_MODES:
		if (value.u >> PORTS)
			return DB_RESULT_OUT_OF_RANGE;
		for (unsigned i = 0; i < PORTS && result == DB_RESULT_OK; i++)
			result = plan_setting(plan, row->param + i,
			                      (union db_value){ .u = value.u >> i & 1 });
		return result;
	case VSMD_EVENTS:
		result = plan_setting(plan, row->param, (union db_value){ .u = value.u >> 8 });
		if (result != DB_RESULT_OK)
			return result;
		return plan_setting(plan, row->param + 1u, (union db_value){ .u = value.u & 0xFF });
	default:
		return value.u == 0 ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
	}
}

static enum db_result plan_command(struct plan *plan)
{
	const struct db_view_drive *drive = plan->drive;
	const struct vsmd_code *entry = db_vsmd_layout_code(plan->kept.command);
	/* In position mode the position alone starts a move. */
	bool moves = plan->has_pos && entry &&
	             (entry->command == DB_CMD_MOVE_ABSOLUTE ||
	              entry->command == DB_CMD_MOVE_RELATIVE);

	plan->command = DB_CMD_NONE;
	/* The register holds 0 before the first command: switches position mode off. */
	if (!(plan->has_command || moves) || plan->kept.command == 0)
		return DB_RESULT_OK;
	if (!entry)
		return DB_RESULT_OUT_OF_RANGE;
	plan->command = entry->command;
	plan->args = db_vsmd_layout_args(entry, &plan->kept);
	/* The commander checks it too, but the parameters would be written by then. */
	if (!drive->driver->check)
		return DB_RESULT_OK;
	return drive->driver->check(drive->bus_config, drive->config, plan->command, &plan->args);
}

static enum db_result plan_registers(struct plan *plan, const struct rows *touched,
                                     const uint16_t *values)
{
	const struct db_view_drive *drive = plan->drive;
	struct db_snapshot snapshot;

	db_axis_read(drive->axis, &snapshot);
	db_axis_read_nameplate(drive->axis, &plan->nameplate);
	plan->plate_is_known = is_known(&snapshot.feedback);
	plan->kept = drive->vsmd_view->kept;
	plan->has_command = false;
	plan->has_pos = false;
	plan->setting_count = 0;
	for (size_t i = 0; i < touched->count; i++) {
		enum db_result result = plan_row(plan, &touched->rows[i], values);

		plan->refused = touched->rows[i].row.address;
		if (result != DB_RESULT_OK)
			return result;
		values += db_vsmd_layout_cell(&touched->rows[i]).registers;
	}
	return DB_RESULT_OK;
}

/* The stop in a write; NONE. It is carried out whatever else is written. */
static enum db_command find_stop(const struct rows *touched, uint16_t address,
                                 const uint16_t *values)
{
	for (size_t i = 0; i < touched->count; i++) {
		const struct vsmd_row *row = &touched->rows[i];
		const struct vsmd_code *entry;

		if (row->content != VSMD_KEPT ||
		    row->row.offset != offsetof(struct vsmd_kept, command))
			continue;
		entry = db_vsmd_layout_code(values[row->row.address - address]);
		return entry && db_command_is_stop(entry->command) ? entry->command : DB_CMD_NONE;
	}
	return DB_CMD_NONE;
}

/* --- carrying it out -------------------------------------------------------------------------- */

static struct db_write_answer write_params(struct db_view_drive *drive, const struct plan *plan,
                                           struct db_write_token token, db_time now)
{
	struct db_request request = {
		.client = *plan->client,
		.settings = plan->settings,
		.setting_count = (uint8_t)plan->setting_count,
	};

	return db_commander_ask(drive->commander, &request, token, now);
}

/* `address`: the register for which it is refused; 0: the command, or none in particular. */
static int refuse_write(struct db_view_drive *drive, const struct db_client *client,
                        enum db_result result, uint16_t address)
{
	db_commander_set_refused(drive->commander, client, result, address);
	return db_exception_of(result);
}

static struct db_request request_of(const struct plan *plan)
{
	return (struct db_request){
		.client = *plan->client,
		.command = plan->command,
		.args = &plan->args,
	};
}

/* Recorded for a technician: a plan that could have been carried out. */
static struct db_write_answer refuse_plan(struct db_view_drive *drive, const struct plan *plan,
                                          enum db_result result)
{
	struct db_request request = request_of(plan);

	db_commander_refuse(drive->commander, &request, result, 0);
	return (struct db_write_answer){ .result = result };
}

static struct db_write_answer carry_out(struct db_view_drive *drive, const struct plan *plan,
                                        struct db_write_token token)
{
	db_time now = drive->registers->ops->now(drive->registers->context);
	struct db_request request = request_of(plan);
	struct db_write_answer answer;

	if (db_command_is_stop(plan->command)) {
		answer = db_commander_ask(drive->commander, &request,
		                          plan->setting_count > 0 ? nobody : token, now);
		/* A stop is repeated until it works: the answer to the parameters covers both. */
		return plan->setting_count > 0 && db_write_is_taken(answer) ?
		               write_params(drive, plan, token, now) :
		               answer;
	}
	if (plan->command == DB_CMD_NONE && plan->setting_count == 0)
		return (struct db_write_answer){ .result = DB_RESULT_OK };
	if (drive->vsmd_view->follow_up.ticket != 0)
		return refuse_plan(drive, plan, DB_RESULT_BUSY);
	if (plan->command == DB_CMD_NONE)
		return write_params(drive, plan, token, now);
	if (plan->setting_count == 0)
		return db_commander_ask(drive->commander, &request, token, now);
	/* Both are in one write: the parameters first, because the command must use them. */
	answer = write_params(drive, plan, token, now);
	if (db_write_is_taken(answer))
		drive->vsmd_view->follow_up = (struct follow_up){
			.ticket = drive->vsmd_view->last_ticket,
			.command = plan->command,
			.args = plan->args,
			.token = token,
			.client = *plan->client,
			.waits = answer.later,
		};
	return answer;
}

/* Only the stop of the write is carried out, nothing else or stored: the rest is wrong, or the
 * client is not in control. */
static int stop_only(struct db_view_drive *drive, const struct db_client *client,
                     enum db_command stop, struct db_write_token token)
{
	struct db_request request = { .client = *client, .command = stop };
	db_time now = drive->registers->ops->now(drive->registers->context);

	return db_exception_of_answer(db_commander_ask(drive->commander, &request, token, now));
}

int db_vsmd_view_write(struct db_view_drive *drive, const struct db_client *client,
                       enum db_table table, uint16_t address, uint16_t count,
                       const uint16_t *values, struct db_write_token token)
{
	struct plan plan;
	struct rows touched;
	enum db_command stop;
	enum db_result result;
	struct db_write_answer answer;

	if (table != DB_TABLE_HOLDING || find_rows(table, address, count, &touched) != 0) {
		db_record_denied(drive->registers, drive, client, 0, address, "no such register");
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	}
	stop = find_stop(&touched, address, values);
	if (!is_whole(&touched, address, count))
		return stop != DB_CMD_NONE ? stop_only(drive, client, stop, token) :
		                             refuse_write(drive, client, DB_RESULT_OUT_OF_RANGE, 0);
	plan.drive = drive;
	plan.client = client;
	result = plan_registers(&plan, &touched, values);
	if (result != DB_RESULT_OK && stop != DB_CMD_NONE)
		return stop_only(drive, client, stop, token);
	if (result != DB_RESULT_OK) {
		int exception = refuse_write(drive, client, result, plan.refused);

		/* The vendor's models have this register, but this drive has no such function. */
		return result == DB_RESULT_UNSUPPORTED ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS :
		                                         exception;
	}
	result = plan_command(&plan);
	if (result != DB_RESULT_OK)
		return refuse_write(drive, client, result, 0);
	if ((plan.setting_count > 0 || plan.command == DB_CMD_SAVE_PARAMETERS) &&
	    !db_clients_permit(drive, client, DB_MAY_SET_PARAMETERS, address))
		return stop != DB_CMD_NONE ? stop_only(drive, client, stop, token) :
		                             MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	if (!db_clients_may_write(drive, client, db_command_is_stop(plan.command)))
		return db_command_is_stop(plan.command) ?
		               stop_only(drive, client, plan.command, token) :
		               db_exception_of_answer(
				       refuse_plan(drive, &plan, DB_RESULT_NOT_IN_CONTROL));
	answer = carry_out(drive, &plan, token);
	if (db_write_is_taken(answer))
		drive->vsmd_view->kept = plan.kept;
	return db_exception_of_answer(answer);
}

int db_vsmd_view_write_same(struct db_view_drive *drive, const struct db_client *client,
                            uint16_t address, uint16_t value, struct db_write_token token)
{
	struct rows touched;

	if (find_rows(DB_TABLE_HOLDING, address, 1, &touched) != 0)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	if (!is_whole(&touched, address, 1))
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	if (find_stop(&touched, address, &value) == DB_CMD_NONE)
		return 0;
	return db_vsmd_view_write(drive, client, DB_TABLE_HOLDING, address, 1, &value, token);
}

/* --- the command after the parameters -------------------------------------------------------- */

void db_vsmd_view_note_request(struct db_vsmd_view *view, const struct db_request *request)
{
	if (!view)
		return;
	view->last_ticket = request->ticket;
	if (db_command_is_stop(request->command))
		view->follow_up.cancelled = true;
}

static bool same_token(struct db_write_token a, struct db_write_token b)
{
	return a.client == b.client && a.sequence == b.sequence;
}

bool db_vsmd_view_take_answer(struct db_vsmd_view *view, struct db_write_token token,
                              enum db_result *result)
{
	struct follow_up *follow_up = view ? &view->follow_up : NULL;

	if (same_token(token, nobody))
		return false;
	if (!follow_up || follow_up->ticket == 0 || !follow_up->waits ||
	    !same_token(token, follow_up->token))
		return true;
	if (db_result_is_success(*result) && !follow_up->cancelled)
		return false; /* completed() continues */
	follow_up->waits = false;
	if (db_result_is_success(*result))
		*result = DB_RESULT_CANCELLED;
	/* A writer that was answered with a failure must not see its command executed later. */
	if (*result != DB_RESULT_PENDING)
		follow_up->cancelled = true;
	return true;
}

void db_vsmd_view_send_command(struct db_view_drive *drive, uint32_t ticket, enum db_result result,
                               db_time now)
{
	struct db_vsmd_view *view = drive->vsmd_view;
	struct db_registers *registers = drive->registers;
	struct db_write_answer answer;
	struct follow_up follow_up;
	struct db_request request;

	if (!view || view->follow_up.ticket == 0 || view->follow_up.ticket != ticket)
		return;
	follow_up = view->follow_up;
	view->follow_up.ticket = 0;
	if (!db_result_is_success(result) || follow_up.cancelled)
		return;
	request = (struct db_request){
		.client = follow_up.client,
		.command = follow_up.command,
		.args = &follow_up.args,
	};
	answer = db_commander_ask(drive->commander, &request,
	                          follow_up.waits ? follow_up.token : nobody, now);
	if (follow_up.waits && !answer.later)
		registers->ops->answer(registers->context, follow_up.token,
		                       db_exception_of(answer.result));
}
