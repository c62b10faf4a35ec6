/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/vsmd_view.h"

#include "regmap/clients.h"
#include "regmap/exception.h"
#include "regmap/state.h"
#include "regmap/vsmd_layout.h"
#include "regmap/words.h"

#include <modbus.h>
#include <stdlib.h>
#include <string.h>

/* The sensor ports that the map packs into one register. */
#define PORTS 6

/* Names no client: what is answered to it is dropped. */
static const struct db_write_token nobody = { .client = DB_CLIENT_NOBODY };

/* A command that waits for the parameters of the same write. */
struct chain {
	uint32_t ticket; /* of the parameters; 0 = there is none */
	enum db_command command;
	struct db_args args;
	struct db_write_token token;
	struct db_client client;
	bool waits; /* the writer was not answered yet */
	bool dead;  /* a stop came in between */
};

struct db_vsmd_view {
	struct vsmd_kept kept;
	uint32_t last_ticket; /* of the drive's latest request, whoever made it */
	struct chain chain;
};

struct db_vsmd_view *db_vsmd_view_new(const struct db_drive_config *config)
{
	struct db_vsmd_view *view = calloc(1, sizeof *view);

	if (view)
		view->kept.mbs = config->vendor_high_first;
	return view;
}

void db_vsmd_view_free(struct db_vsmd_view *view)
{
	free(view);
}

/* --- the rows of a request --------------------------------------------------------------------------- */

struct span {
	const struct vsmd_row *rows;
	size_t count;
};

/* The rows that cover the addresses. Rows have no holes, so only the ends decide. */
static uint8_t find_span(enum db_table table, uint16_t address, uint16_t count, struct span *span)
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
	span->rows = &rows[first];
	span->count = 1;
	while (first + span->count < total && rows[first + span->count].row.address < end)
		span->count++;
	return 0;
}

/* Half of a 32-bit value cannot be written. */
static bool is_whole(const struct span *span, uint16_t address, uint16_t count)
{
	struct db_cell last = db_vsmd_layout_cell(&span->rows[span->count - 1]);

	return span->rows[0].row.address == address &&
	       last.address + last.registers == address + count;
}

/* How many of the drive's parameters, from row->param on, the row shows. */
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

/* --- reading ------------------------------------------------------------------------------------------- */

static bool has_param(const struct db_nameplate *plate, unsigned param)
{
	return plate->valid >> param & 1;
}

/* Everything was read since the drive came, so what is missing does not exist. */
static bool is_known(const struct db_feedback *feedback)
{
	uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;

	return (feedback->status & wanted) == wanted;
}

/* Old data is never shown as fresh. */
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
		if (!stale_values || !has_param(&image->plate, row->param + i))
			return db_exception_unreachable(feedback);
	}
	return 0;
}

/* 0 when the drive does not have it. */
static uint32_t param_word(const struct db_nameplate *plate, unsigned param)
{
	return has_param(plate, param) ? plate->values[param].u : 0;
}

/* The first character in the low byte. */
static void encode_version(const struct db_nameplate *plate, uint16_t *words)
{
	bool ended = false;

	for (size_t i = 0; i < 2 * VSMD_VERSION_REGISTERS; i++) {
		unsigned character = ended ? 0 : (unsigned char)plate->identity[i];

		ended = character == 0;
		if (i % 2 == 0)
			words[i / 2] = (uint16_t)character;
		else
			words[i / 2] = (uint16_t)(words[i / 2] | character << 8);
	}
}

static void encode_row(const struct db_vsmd_view *view, const struct vsmd_row *row,
                       const struct db_drive_image *image, uint16_t *words)
{
	struct db_cell cell = db_vsmd_layout_cell(row);
	bool low_first = view->kept.mbs == 0;
	const struct db_nameplate *plate = &image->plate;
	union db_value value;
	unsigned bits = 0;

	switch (row->content) {
	case VSMD_KEPT:
		db_words_encode(&cell, &view->kept, low_first, words);
		break;
	case VSMD_MEASURED:
		db_words_encode(&cell, image, low_first, words);
		break;
	case VSMD_PARAM:
		value.u = param_word(plate, row->param);
		cell.flags = DB_ROW_PARAM; /* 32 bits wide whatever the type */
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
		encode_version(plate, words);
		break;
	case VSMD_RESERVED:
		words[0] = 0;
		break;
	}
}

static unsigned parts_of(const struct span *span)
{
	unsigned parts = DB_PART_PROCESS;

	for (size_t i = 0; i < span->count; i++) {
		if (params_of(&span->rows[i]) > 0 || span->rows[i].content == VSMD_VERSION)
			parts |= DB_PART_PLATE;
	}
	return parts;
}

uint8_t db_vsmd_view_read(const struct db_view_drive *drive, enum db_table table, uint16_t address,
                          uint16_t count, uint16_t *values)
{
	struct db_drive_image image;
	struct span span;
	uint8_t exception = find_span(table, address, count, &span);
	uint16_t words[DB_CELL_REGISTERS_MAX] = { 0 };

	if (exception)
		return exception;
	db_image_fill_drive(&image, drive, NULL, parts_of(&span), 0, 0);
	for (size_t i = 0; i < span.count; i++) {
		exception = check_row(drive, &span.rows[i], &image);
		if (exception)
			return exception;
	}
	for (size_t i = 0; i < span.count; i++) {
		struct db_cell cell = db_vsmd_layout_cell(&span.rows[i]);

		encode_row(drive->vsmd_view, &span.rows[i], &image, words);
		for (unsigned j = 0; j < cell.registers; j++) {
			unsigned at = cell.address + j;

			if (at >= address && at < (unsigned)address + count)
				values[at - address] = words[j];
		}
	}
	return 0;
}

/* --- what a write asks for ------------------------------------------------------------------------------ */

struct plan {
	const struct db_client *client;
	struct vsmd_kept kept; /* with the written registers put over it */
	uint16_t refused;      /* the register that was planned last */
	bool has_command;      /* these were among them */
	bool has_pos;
	enum db_command command; /* NONE: nothing is to be executed */
	struct db_args args;
	size_t setting_count;
	struct db_setting settings[DB_SETTINGS_MAX];
};

/* What the drive is known to have. */
struct possible {
	struct db_nameplate plate;
	bool known;
};

static void find_possible(const struct db_view_drive *drive, struct possible *possible)
{
	struct db_snapshot snapshot;

	db_axis_read(drive->axis, &snapshot);
	db_axis_read_nameplate(drive->axis, &possible->plate);
	possible->known = is_known(&snapshot.feedback);
}

static enum db_result add_setting(const struct db_view_drive *drive,
                                  const struct possible *possible, unsigned param,
                                  union db_value value, struct plan *plan)
{
	enum db_result checked;

	if (possible->known && !has_param(&possible->plate, param))
		return value.u == 0 ? DB_RESULT_OK : DB_RESULT_UNSUPPORTED;
	checked = drive->driver->check_param(drive->bus_config, param, value);
	if (checked == DB_RESULT_OK)
		plan->settings[plan->setting_count++] = (struct db_setting){
			.param = (uint16_t)param,
			.value = value,
		};
	return checked;
}

static enum db_result plan_kept(const struct vsmd_row *row, union db_value value, struct plan *plan)
{
	struct db_cell cell = db_vsmd_layout_cell(row);

	if (cell.offset == offsetof(struct vsmd_kept, command))
		plan->has_command = true;
	if (cell.offset == offsetof(struct vsmd_kept, pos))
		plan->has_pos = true;
	db_words_store(&cell, value, &plan->kept);
	return plan->kept.mbs <= 1 ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

static enum db_result plan_modes(const struct db_view_drive *drive, const struct possible *possible,
                                 const struct vsmd_row *row, uint32_t bits, struct plan *plan)
{
	enum db_result result = bits >> PORTS ? DB_RESULT_OUT_OF_RANGE : DB_RESULT_OK;

	for (unsigned i = 0; i < PORTS && result == DB_RESULT_OK; i++)
		result = add_setting(drive, possible, row->param + i,
		                     (union db_value){ .u = bits >> i & 1 }, plan);
	return result;
}

static enum db_result plan_events(const struct db_view_drive *drive,
                                  const struct possible *possible, const struct vsmd_row *row,
                                  uint32_t word, struct plan *plan)
{
	enum db_result result = add_setting(drive, possible, row->param,
	                                    (union db_value){ .u = word >> 8 }, plan);

	if (result != DB_RESULT_OK)
		return result;
	return add_setting(drive, possible, row->param + 1u, (union db_value){ .u = word & 0xFF },
	                   plan);
}

static enum db_result plan_row(const struct db_view_drive *drive, const struct possible *possible,
                               const struct vsmd_row *row, const uint16_t *words, struct plan *plan)
{
	struct db_cell cell = db_vsmd_layout_cell(row);
	union db_value value;

	if (!db_words_decode(&cell, words, drive->vsmd_view->kept.mbs == 0, &value))
		return DB_RESULT_OUT_OF_RANGE;
	switch (row->content) {
	case VSMD_KEPT:
		return plan_kept(row, value, plan);
	case VSMD_PARAM:
		return add_setting(drive, possible, row->param, value, plan);
	case VSMD_MODES:
		return plan_modes(drive, possible, row, value.u, plan);
	case VSMD_EVENTS:
		return plan_events(drive, possible, row, value.u, plan);
	default:
		return value.u == 0 ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
	}
}

static bool is_position_mode(uint16_t code)
{
	const struct vsmd_code *entry = db_vsmd_layout_code(code);

	return entry &&
	       (entry->command == DB_CMD_MOVE_ABSOLUTE || entry->command == DB_CMD_MOVE_RELATIVE);
}

static enum db_result plan_command(const struct db_view_drive *drive, struct plan *plan)
{
	bool moves = plan->has_pos && is_position_mode(plan->kept.command);
	const struct vsmd_code *entry;

	plan->command = DB_CMD_NONE;
	/* 0 is what the register holds before the first command: takes position mode off. */
	if (!(plan->has_command || moves) || plan->kept.command == 0)
		return DB_RESULT_OK;
	entry = db_vsmd_layout_code(plan->kept.command);
	if (!entry)
		return DB_RESULT_OUT_OF_RANGE;
	plan->command = entry->command;
	plan->args = db_vsmd_layout_args(entry, &plan->kept);
	/* The commander checks it too, but parameters would be written by then. */
	return drive->driver->check(drive->bus_config, drive->config, plan->command, &plan->args);
}

static enum db_result plan_registers(const struct db_view_drive *drive, const struct span *span,
                                     const uint16_t *values, struct plan *plan)
{
	struct possible possible;

	find_possible(drive, &possible);
	plan->kept = drive->vsmd_view->kept;
	plan->has_command = false;
	plan->has_pos = false;
	plan->setting_count = 0;
	for (size_t i = 0; i < span->count; i++) {
		enum db_result result = plan_row(drive, &possible, &span->rows[i], values, plan);

		plan->refused = span->rows[i].row.address;
		if (result != DB_RESULT_OK)
			return result;
		values += db_vsmd_layout_cell(&span->rows[i]).registers;
	}
	return DB_RESULT_OK;
}

/* The stop among what is written, if there is one: it is carried out whatever stands beside it. */
static enum db_command stop_among(const struct span *span, uint16_t address, const uint16_t *values)
{
	for (size_t i = 0; i < span->count; i++) {
		const struct vsmd_row *row = &span->rows[i];
		const struct vsmd_code *entry;

		if (row->content != VSMD_KEPT ||
		    row->row.offset != offsetof(struct vsmd_kept, command))
			continue;
		entry = db_vsmd_layout_code(values[row->row.address - address]);
		return entry && db_command_is_stop(entry->command) ? entry->command : DB_CMD_NONE;
	}
	return DB_CMD_NONE;
}

/* --- carrying it out -------------------------------------------------------------------------------------- */

static struct db_write_answer set(struct db_view_drive *drive, const struct plan *plan,
                                  struct db_write_token token, db_time now)
{
	return db_commander_set(drive->commander, plan->client, plan->settings, plan->setting_count,
	                        token, now);
}

/* Both in one write: the parameters first, because the command is to run with them. */
static struct db_write_answer begin_chain(struct db_view_drive *drive, const struct plan *plan,
                                          struct db_write_token token, db_time now)
{
	struct db_vsmd_view *view = drive->vsmd_view;
	struct db_write_answer answer = set(drive, plan, token, now);

	if (db_write_is_taken(answer))
		view->chain = (struct chain){
			.ticket = view->last_ticket,
			.command = plan->command,
			.args = plan->args,
			.token = token,
			.client = *plan->client,
			.waits = answer.later,
		};
	return answer;
}

/* `address`: of the register that it is refused for; 0: of the command, or of none in particular. */
static int refuse(struct db_view_drive *drive, const struct db_client *client,
                  enum db_result result, uint16_t address)
{
	db_commander_set_refused(drive->commander, client, result, address);
	return db_exception_of(result);
}

/* What a technician may look for later: a plan that could have been carried out. */
static struct db_write_answer refuse_plan(struct db_view_drive *drive, const struct plan *plan,
                                          enum db_result result)
{
	struct db_command_block block = { .command = (uint16_t)plan->command, .args = plan->args };

	db_commander_refuse(drive->commander, plan->client, &block, result, 0);
	return (struct db_write_answer){ .result = result };
}

static struct db_write_answer carry_out(struct db_view_drive *drive, const struct plan *plan,
                                        struct db_write_token token)
{
	db_time now = drive->registers->ops->now(drive->registers->context);
	struct db_write_answer answer;

	if (db_command_is_stop(plan->command)) {
		answer = db_commander_execute(drive->commander, plan->client, plan->command,
		                              &plan->args, plan->setting_count > 0 ? nobody : token,
		                              now);
		/* It is repeated until it works: the parameters' answer tells of both. */
		return plan->setting_count > 0 && db_write_is_taken(answer) ?
		               set(drive, plan, token, now) :
		               answer;
	}
	if (plan->command == DB_CMD_NONE && plan->setting_count == 0)
		return (struct db_write_answer){ .result = DB_RESULT_OK };
	if (drive->vsmd_view->chain.ticket != 0)
		return refuse_plan(drive, plan, DB_RESULT_BUSY);
	if (plan->command == DB_CMD_NONE)
		return set(drive, plan, token, now);
	if (plan->setting_count > 0)
		return begin_chain(drive, plan, token, now);
	return db_commander_execute(drive->commander, plan->client, plan->command, &plan->args,
	                            token, now);
}

/* Nothing else of the write is carried out or kept: it is wrong, or the client is not in control. */
static int stop_only(struct db_view_drive *drive, const struct db_client *client,
                     enum db_command stop, struct db_write_token token)
{
	const struct db_args none = { 0 };
	db_time now = drive->registers->ops->now(drive->registers->context);

	return db_exception_of_answer(
		db_commander_execute(drive->commander, client, stop, &none, token, now));
}

int db_vsmd_view_write(struct db_view_drive *drive, const struct db_client *client,
                       enum db_table table, uint16_t address, uint16_t count,
                       const uint16_t *values, struct db_write_token token)
{
	struct plan plan;
	struct span span;
	enum db_command stop;
	enum db_result result;
	struct db_write_answer answer;

	if (table != DB_TABLE_HOLDING || find_span(table, address, count, &span) != 0)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	stop = stop_among(&span, address, values);
	if (!is_whole(&span, address, count))
		return stop != DB_CMD_NONE ? stop_only(drive, client, stop, token) :
		                             refuse(drive, client, DB_RESULT_OUT_OF_RANGE, 0);
	result = plan_registers(drive, &span, values, &plan);
	plan.client = client;
	if (result != DB_RESULT_OK && stop != DB_CMD_NONE)
		return stop_only(drive, client, stop, token);
	if (result != DB_RESULT_OK) {
		int exception = refuse(drive, client, result, plan.refused);

		/* The vendor's models have this register, but the drive has nothing behind it. */
		return result == DB_RESULT_UNSUPPORTED ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS :
		                                         exception;
	}
	result = plan_command(drive, &plan);
	if (result != DB_RESULT_OK)
		return refuse(drive, client, result, 0);
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
	struct span span;

	if (find_span(DB_TABLE_HOLDING, address, 1, &span) != 0)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	if (!is_whole(&span, address, 1))
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	if (stop_among(&span, address, &value) == DB_CMD_NONE)
		return 0;
	return db_vsmd_view_write(drive, client, DB_TABLE_HOLDING, address, 1, &value, token);
}

/* --- the second half of a chain ---------------------------------------------------------------------------- */

void db_vsmd_view_submitted(struct db_vsmd_view *view, const struct db_request *request)
{
	if (!view)
		return;
	view->last_ticket = request->ticket;
	if (db_command_is_stop(request->command))
		view->chain.dead = true;
}

static bool same_token(struct db_write_token a, struct db_write_token b)
{
	return a.client == b.client && a.sequence == b.sequence;
}

bool db_vsmd_view_answered(struct db_vsmd_view *view, struct db_write_token token,
                           enum db_result *result)
{
	struct chain *chain = view ? &view->chain : NULL;

	if (same_token(token, nobody))
		return false;
	if (!chain || chain->ticket == 0 || !chain->waits || !same_token(token, chain->token))
		return true;
	if (db_result_is_success(*result) && !chain->dead)
		return false; /* completed() goes on */
	chain->waits = false;
	if (db_result_is_success(*result))
		*result = DB_RESULT_CANCELLED;
	/* A writer that was told of a failure must not see its command executed later. */
	if (*result != DB_RESULT_PENDING)
		chain->dead = true;
	return true;
}

void db_vsmd_view_completed(struct db_view_drive *drive, const struct db_completion *completion,
                            db_time now)
{
	struct db_vsmd_view *view = drive->vsmd_view;
	struct db_registers *registers = drive->registers;
	struct db_write_answer answer;
	struct chain chain;

	if (!view || view->chain.ticket == 0 || view->chain.ticket != completion->ticket)
		return;
	chain = view->chain;
	view->chain.ticket = 0;
	if (!db_result_is_success(completion->result) || chain.dead)
		return;
	answer = db_commander_execute(drive->commander, &chain.client, chain.command, &chain.args,
	                              chain.waits ? chain.token : nobody, now);
	if (chain.waits && !answer.later)
		registers->ops->answer(registers->context, chain.token,
		                       db_exception_of(answer.result));
}
