/* SPDX-License-Identifier: Apache-2.0 */
/* The Structured Text library: the tables' numbers as constants, put into the text of the blocks. */
#include "regmap/export.h"

#include "axis/limits.h"

#include "regmap/commands.h"
#include "regmap/index.h"

#include <ctype.h>
#include <errno.h>
#include <string.h>

/* Where a line of the template consists of this, the constants go. */
static const char placeholder[] = "@constants@\n";

/* "DiscreteMotion" and "move_absolute" become DISCRETE_MOTION and MOVE_ABSOLUTE. */
static void put_name(FILE *out, const char *prefix, const char *name)
{
	fprintf(out, "\t%s", prefix);
	for (const char *from = name; *from; from++) {
		if (from > name && isupper((unsigned char)*from))
			putc('_', out);
		putc(isalnum((unsigned char)*from) ? toupper((unsigned char)*from) : '_', out);
	}
}

static void put_uint(FILE *out, const char *prefix, const char *name, unsigned value)
{
	put_name(out, prefix, name);
	fprintf(out, " : UINT := %u;\n", value);
}

static void begin(FILE *out, const char *comment)
{
	fprintf(out, "\n(* %s *)\nVAR_GLOBAL CONSTANT\n", comment);
}

static void end(FILE *out)
{
	fputs("END_VAR\n", out);
}

/* --- codes --------------------------------------------------------------------------------------- */

static const char *state_name(unsigned code)
{
	return db_axis_state_name((enum db_axis_state)code);
}

static const char *result_name(unsigned code)
{
	return db_result_name((enum db_result)code);
}

static const char *error_name(unsigned code)
{
	return db_error_name((uint16_t)code);
}

static const char *limit_name(unsigned code)
{
	return db_limit_name((uint16_t)code);
}

#define LAST_ERROR 63 /* as the description of the register counts them */
#define STATUS_BITS 32

static const struct {
	const char *comment;
	const char *prefix;
	const char *(*name)(unsigned code);
	unsigned count;
	bool bits;
} code_lists[] = {
	{ "Values of axis_state", "DB_STATE_", state_name, DB_AXIS_STATE_COUNT, false },
	{ "Codes of command", "DB_CMD_", db_command_name, DB_CMD_LIMIT, false },
	{ "Values of result and write_result", "DB_RESULT_", result_name, DB_RESULT_COUNT, false },
	{ "Values of error", "DB_ERROR_", error_name, LAST_ERROR + 1, false },
	{ "Values of result_limit", "DB_LIMIT_", limit_name, DB_LIMIT_COUNT, false },
	{ "Bits of status", "DB_STATUS_", db_status_bit_name, DB_STATUS_BIT_COUNT, true },
	{ "Bits of capabilities", "DB_CAN_", db_capability_name, STATUS_BITS, true },
};

static void put_codes(FILE *out, size_t list)
{
	begin(out, code_lists[list].comment);
	for (unsigned code = 0; code < code_lists[list].count; code++) {
		const char *name = code_lists[list].name(code);

		if (strcmp(name, "unknown") == 0)
			continue;
		if (!code_lists[list].bits) {
			put_uint(out, code_lists[list].prefix, name, code);
			continue;
		}
		put_name(out, code_lists[list].prefix, name);
		fprintf(out, " : DWORD := 16#%08X;\n", 1u << code);
	}
	end(out);
}

/* --- registers ----------------------------------------------------------------------------------- */

static bool is_single(const struct db_row *row, enum db_view view)
{
	return row->view == view && row->table == DB_TABLE_HOLDING && row->repeat.count == 0;
}

static void put_registers(FILE *out, enum db_view view, const char *prefix)
{
	for (size_t i = 0; i < db_row_count; i++) {
		if (is_single(&db_rows[i], view))
			put_uint(out, prefix, db_rows[i].name, db_rows[i].address);
	}
}

/* Registers that are read or written together. */
static const struct {
	const char *name;
	const char *first;
	const char *last;
} spans[] = {
	{ "image", "axis_state", "capabilities" },  /* every family has all of these */
	{ "state", "axis_state", "age_ms" },        /* can be read when the drive does not answer */
	{ "results", "result_id", "capabilities" }, /* likewise */
	{ "refusal", "result_limit", "aborted_id" },   { "order", "command_id", "command" },
	{ "motion", "command_id", "target_velocity" },
};

static const struct db_row *row_of(const char *name)
{
	for (size_t i = 0; i < db_row_count; i++) {
		if (is_single(&db_rows[i], DB_VIEW_DRIVE) && strcmp(db_rows[i].name, name) == 0)
			return &db_rows[i];
	}
	return NULL;
}

static int put_spans(FILE *out)
{
	for (size_t i = 0; i < sizeof spans / sizeof spans[0]; i++) {
		const struct db_row *first = row_of(spans[i].first);
		const struct db_row *last = row_of(spans[i].last);

		if (!first || !last)
			return -ENOENT;
		put_uint(out, "DB_COUNT_", spans[i].name,
		         last->address + db_type_registers(last->type) - first->address);
	}
	return 0;
}

/* --- parameters ----------------------------------------------------------------------------------- */

/* The type stands above the address, so that one number is enough to read and write. */
static void put_parameter(FILE *out, const char *prefix, const char *name, enum db_type type,
                          uint16_t address)
{
	put_name(out, prefix, name);
	fprintf(out, " : UDINT := 16#%X%04X;\n", (unsigned)type + 1, (unsigned)address);
}

static void put_types(FILE *out)
{
	for (unsigned type = DB_U16; type < DB_TEXT; type++) {
		if (type != DB_U64)
			put_uint(out, "DB_TYPE_", db_type_name((enum db_type)type), type + 1);
	}
}

struct parameters {
	FILE *out;
	const struct db_driver *driver;
};

static void put_vendor_parameter(void *context, const struct db_entry *entry)
{
	const struct parameters *parameters = context;
	char prefix[DB_ROW_NAME_MAX];

	if (entry->row || !entry->param)
		return;
	snprintf(prefix, sizeof prefix, "DB_PAR_%.*s_", (int)strcspn(parameters->driver->name, "-"),
	         parameters->driver->name);
	for (char *at = prefix; *at; at++)
		*at = (char)toupper((unsigned char)*at);
	put_parameter(parameters->out, prefix, entry->name, (enum db_type)entry->cell.type,
	              entry->cell.address);
}

/* Families that share their parameters share their name's first word. */
static bool has_shown(unsigned driver)
{
	for (unsigned i = 0; i < driver; i++) {
		if (db_drivers[i]->params == db_drivers[driver]->params)
			return true;
	}
	return false;
}

static void put_vendor_parameters(FILE *out)
{
	for (unsigned i = 0; db_drivers[i]; i++) {
		struct parameters parameters = { out, db_drivers[i] };
		struct db_scope scope = { .view = DB_VIEW_DRIVE, .driver = db_drivers[i] };

		if (db_drivers[i]->param_count > 0 && !has_shown(i))
			db_table_each(&scope, put_vendor_parameter, &parameters);
	}
}

static void put_own_parameters(FILE *out)
{
	for (size_t i = 0; i < db_row_count; i++) {
		const struct db_row *row = &db_rows[i];

		if (is_single(row, DB_VIEW_DRIVE) && row->type != DB_U64 && row->type != DB_TEXT)
			put_parameter(out, "DB_PAR_", row->name, row->type, row->address);
	}
}

/* --- the whole ------------------------------------------------------------------------------------- */

/* Asked of the bridge itself, so that a command of tomorrow is not forgotten. */
static void put_ends_motion(FILE *out)
{
	const char *before = "\n\t";

	fputs("\n(* The drive's motion is ended by this command. *)\n"
	      "FUNCTION DB_EndsMotion : BOOL\n"
	      "VAR_INPUT\n\tCode : UINT;\nEND_VAR\n"
	      "DB_EndsMotion :=",
	      out);
	for (size_t i = 0; i < db_command_row_count; i++) {
		if (!db_command_ends_motion(db_command_rows[i].code))
			continue;
		fputs(before, out);
		put_name(out, "(Code = DB_CMD_", db_command_rows[i].name);
		fputs(")", out);
		before = " OR\n\t";
	}
	fputs(";\nEND_FUNCTION\n", out);
}

static int put_constants(FILE *out)
{
	int error;

	begin(out, "Holding registers of a drive's unit: addresses on the wire, from 0");
	put_registers(out, DB_VIEW_DRIVE, "DB_REG_");
	end(out);
	begin(out, "Holding registers of the gateway's unit that are there once");
	put_registers(out, DB_VIEW_GATEWAY, "DB_GATEWAY_");
	end(out);
	begin(out, "Lengths of what is read or written in one request");
	error = put_spans(out);
	end(out);
	for (size_t i = 0; i < sizeof code_lists / sizeof code_lists[0]; i++)
		put_codes(out, i);
	begin(out, "Types of registers, as they stand above 16#FFFF in ParameterNumber");
	put_types(out);
	end(out);
	begin(out,
	      "ParameterNumber of MC_ReadParameter and MC_WriteParameter: what all drives have");
	put_own_parameters(out);
	end(out);
	begin(out, "The vendors' parameters by family");
	put_vendor_parameters(out);
	end(out);
	put_ends_motion(out);
	return error;
}

int db_export_st(FILE *out, FILE *blocks)
{
	char line[256];
	int error = -ENOENT;

	while (fgets(line, sizeof line, blocks)) {
		if (strcmp(line, placeholder) == 0)
			error = put_constants(out);
		else
			fputs(line, out);
	}
	return ferror(blocks) ? -EIO : error;
}
