/* SPDX-License-Identifier: Apache-2.0 */
/* The Structured Text library: the tables' numbers as constants, put into the text of the
 * blocks. */
#include "registers/export_st.h"

#include "drivebridge/command_table.h"
#include "regmap/index.h"

#include <ctype.h>
#include <errno.h>
#include <string.h>

/* Where a line of the template consists of this, the constants go. */
static const char placeholder[] = "@constants@\n";

/* "DiscreteMotion" and "move_absolute" become DISCRETE_MOTION and MOVE_ABSOLUTE. */
static void put_word(FILE *out, const char *before, const char *prefix, const char *name)
{
	fprintf(out, "%s%s", before, prefix);
	for (const char *from = name; *from; from++) {
		if (from > name && isupper((unsigned char)*from))
			putc('_', out);
		putc(isalnum((unsigned char)*from) ? toupper((unsigned char)*from) : '_', out);
	}
}

static void put_name(FILE *out, const char *prefix, const char *name)
{
	put_word(out, "\t", prefix, name);
}

static void put_uint(FILE *out, const char *prefix, const char *name, unsigned value)
{
	put_name(out, prefix, name);
	fprintf(out, " : UINT := %u;\n", value);
}

static void begin_constants(FILE *out, const char *comment)
{
	fprintf(out, "\n(* %s *)\nVAR_GLOBAL CONSTANT\n", comment);
}

static void end_constants(FILE *out)
{
	fputs("END_VAR\n", out);
}

/* --- the table's rows ---------------------------------------------------------------------------- */

/* The holding registers of a view. */
static const struct db_row_set *registers_of(enum db_view view)
{
	size_t i = 0;

	while (db_row_sets[i]->view != view || db_row_sets[i]->table != DB_TABLE_HOLDING)
		i++;
	return db_row_sets[i];
}

/* A drive's register that is there once; null: there is none of this name. */
static const struct db_row *row_of(const char *name)
{
	const struct db_row_set *set = registers_of(DB_VIEW_DRIVE);

	for (size_t i = 0; i < set->count; i++) {
		if (!set->rows[i].repeat && strcmp(set->rows[i].name, name) == 0)
			return &set->rows[i];
	}
	return NULL;
}

/* --- codes --------------------------------------------------------------------------------------- */

/* The registers whose codes the library needs. */
static const struct {
	const char *name;
	const char *prefix;
} coded[] = {
	{ "axis_state", "DB_STATE_" }, { "command", "DB_CMD_" },   { "result", "DB_RESULT_" },
	{ "error", "DB_ERROR_" },      { "status", "DB_STATUS_" }, { "result_limit", "DB_LIMIT_" },
	{ "capabilities", "DB_CAN_" },
};

static void put_codes(FILE *out, const struct db_codes *codes, const char *prefix)
{
	for (unsigned code = 0; code < codes->count; code++) {
		const char *name = codes->name(code);

		if (strcmp(name, "unknown") == 0)
			continue;
		if (!codes->bits) {
			put_uint(out, prefix, name, code);
			continue;
		}
		put_name(out, prefix, name);
		fprintf(out, " : DWORD := 16#%08X;\n", 1u << code);
	}
}

/* The first word of the family's name in capital letters, between `before` and `after`. */
static void write_prefix(char prefix[DB_ROW_NAME_MAX], const char *before,
                         const struct db_driver *driver, const char *after)
{
	(void)snprintf(prefix, DB_ROW_NAME_MAX, "%s%.*s%s", before, (int)strcspn(driver->name, "-"),
	               driver->name, after);
	for (char *at = prefix; *at; at++)
		*at = (char)toupper((unsigned char)*at);
}

/* The faults of each family. Constants of the first one that has some do without its name, which
 * programs rely on. */
static void put_faults(FILE *out, const char *plain)
{
	bool first = true;
	char own[DB_ROW_NAME_MAX];

	for (unsigned i = 0; db_drivers[i]; i++) {
		write_prefix(own, plain, db_drivers[i], "_");
		for (size_t j = 0; j < db_drivers[i]->fault_count; j++)
			put_uint(out, first ? plain : own, db_drivers[i]->faults[j].name,
			         db_drivers[i]->faults[j].error);
		first = first && db_drivers[i]->fault_count == 0;
	}
}

static int put_coded(FILE *out, size_t which)
{
	const struct db_row *row = row_of(coded[which].name);
	char comment[80];

	if (!row || !row->codes)
		return -ENOENT;
	snprintf(comment, sizeof comment, "%s of %s", row->codes->bits ? "Bits" : "Values",
	         row->name);
	begin_constants(out, comment);
	put_codes(out, row->codes, coded[which].prefix);
	if (row->codes->faults)
		put_faults(out, coded[which].prefix);
	end_constants(out);
	return 0;
}

/* --- registers ----------------------------------------------------------------------------------- */

static void put_registers(FILE *out, enum db_view view, const char *prefix)
{
	const struct db_row_set *set = registers_of(view);

	for (size_t i = 0; i < set->count; i++) {
		if (!set->rows[i].repeat)
			put_uint(out, prefix, set->rows[i].name, set->rows[i].address);
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
	{ "refusal", "result_limit", "motion_result" },
	{ "order", "command_id", "command" },
	{ "motion", "command_id", "target_velocity" },
};

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
	unsigned driver;
};

/* Families that share a page of registers share their name's first word. */
static bool has_shown(unsigned driver, size_t param)
{
	for (unsigned i = 0; i < driver; i++) {
		if (db_drivers[i]->param_page == db_drivers[driver]->param_page &&
		    param < db_drivers[i]->param_count)
			return true;
	}
	return false;
}

static void put_vendor_parameter(void *context, const struct db_entry *entry)
{
	const struct parameters *parameters = context;
	char prefix[DB_ROW_NAME_MAX];

	if (entry->row || !entry->param || has_shown(parameters->driver, entry->cell.param))
		return;
	write_prefix(prefix, "DB_PAR_", db_drivers[parameters->driver], "_");
	put_parameter(parameters->out, prefix, entry->name, (enum db_type)entry->cell.type,
	              entry->cell.address);
}

static void put_vendor_parameters(FILE *out)
{
	for (unsigned i = 0; db_drivers[i]; i++) {
		struct parameters parameters = { out, i };
		struct db_scope scope = { .view = DB_VIEW_DRIVE, .driver = db_drivers[i] };

		db_table_visit(&scope, put_vendor_parameter, &parameters);
	}
}

static void put_own_parameters(FILE *out)
{
	const struct db_row_set *set = registers_of(DB_VIEW_DRIVE);

	for (size_t i = 0; i < set->count; i++) {
		const struct db_row *row = &set->rows[i];

		if (!row->repeat && row->type != DB_U64 && row->type != DB_TEXT)
			put_parameter(out, "DB_PAR_", row->name, row->type, row->address);
	}
}

/* --- the whole ------------------------------------------------------------------------------------- */

static bool ends_motion(unsigned code)
{
	return db_command_ends_motion((enum db_command)code);
}

static bool is_stop(unsigned code)
{
	return db_command_is_stop((enum db_command)code);
}

static const char *kind_name(unsigned kind)
{
	return db_type_name((enum db_type)(kind - 1));
}

static bool is_wide(unsigned kind)
{
	return kind > 0 && db_type_registers((enum db_type)(kind - 1)) == 2;
}

/* Asked of the bridge itself, so that a command of tomorrow is not forgotten. */
static const struct {
	const char *comment;
	const char *function;
	const char *input;
	const char *prefix;
	const char *(*name)(unsigned code);
	bool (*holds)(unsigned code);
	unsigned count;
} questions[] = {
	{ "The drive's motion is ended by this command", "DB_EndsMotion", "Code", "DB_CMD_",
	  db_command_name, ends_motion, DB_CMD_LIMIT },
	{ "This command always executes, and overtakes others", "DB_IsStop", "Code", "DB_CMD_",
	  db_command_name, is_stop, DB_CMD_LIMIT },
	{ "This type takes two registers", "DB_IsWide", "Kind", "DB_TYPE_", kind_name, is_wide,
	  DB_TEXT + 1 },
};

static void put_question(FILE *out, size_t question)
{
	const char *before = "\n\t";

	fprintf(out, "\n(* %s. *)\nFUNCTION %s : BOOL\nVAR_INPUT\n\t%s : UINT;\nEND_VAR\n%s :=",
	        questions[question].comment, questions[question].function,
	        questions[question].input, questions[question].function);
	for (unsigned code = 0; code < questions[question].count; code++) {
		if (!questions[question].holds(code))
			continue;
		fprintf(out, "%s(%s =", before, questions[question].input);
		put_word(out, " ", questions[question].prefix, questions[question].name(code));
		fputs(")", out);
		before = " OR\n\t";
	}
	fputs(";\nEND_FUNCTION\n", out);
}

static int put_constants(FILE *out)
{
	int error;

	begin_constants(out, "Holding registers of a drive's unit: addresses on the wire, from 0");
	put_registers(out, DB_VIEW_DRIVE, "DB_REG_");
	end_constants(out);
	begin_constants(out, "Holding registers of the gateway's unit that are there once");
	put_registers(out, DB_VIEW_GATEWAY, "DB_GATEWAY_");
	end_constants(out);
	begin_constants(out, "Lengths of what is read or written in one request");
	error = put_spans(out);
	end_constants(out);
	for (size_t i = 0; error == 0 && i < sizeof coded / sizeof coded[0]; i++)
		error = put_coded(out, i);
	begin_constants(out, "Types of registers, as they stand above 16#FFFF in ParameterNumber");
	put_types(out);
	end_constants(out);
	begin_constants(
		out,
		"ParameterNumber of MC_ReadParameter and MC_WriteParameter: the bridge's registers");
	put_own_parameters(out);
	end_constants(out);
	begin_constants(out, "The vendors' parameters by family");
	put_vendor_parameters(out);
	end_constants(out);
	for (size_t i = 0; i < sizeof questions / sizeof questions[0]; i++)
		put_question(out, i);
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
