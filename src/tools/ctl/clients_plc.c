/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/clients_text.h"
#include "ctl/ctl_private.h"
#include "ctl/session.h"

#include <math.h>
#include <string.h>

/* --- the library of Structured Text ----------------------------------------------------------- */

/* The values for DB_AXIS_REF of docs/drivebridge.st. */
struct axis {
	json_int_t unit;
	double scale; /* 0: not known */
	const char *unit_name;
	bool rpm;            /* velocities are in rpm, not in the position's unit per second */
	double max_velocity; /* in its own units; 0: no limit */
};

static struct axis axis_of(const struct db_ctl_clients *of, size_t drive)
{
	const json_t *velocity = db_ctl_drive_register(of, drive, "target_velocity");
	const json_t *described = json_array_get(of->drives, drive);

	return (struct axis){
		.unit = json_integer_value(json_object_get(described, "unit")),
		.scale = json_number_value(json_array_get(of->scales, drive)),
		.unit_name = db_words_text(described, "unit_name"),
		.rpm = strcmp(db_ctl_unit_of(velocity), "rpm") == 0,
		.max_velocity = json_number_value(json_object_get(velocity, "max")),
	};
}

/* A REAL of IEC 61131-3 needs a decimal point. */
static void put_real(FILE *out, double value)
{
	char text[40];

	snprintf(text, sizeof(text), "%.9g", value);
	fprintf(out, "%s%s", text, strpbrk(text, ".e") ? "" : ".0");
}

/* Notes on the axis, after its line. */
static void put_remark(FILE *out, const struct axis *axis)
{
	/* A unit's name is free text: it must not end the comment. */
	if (axis->unit_name[0] != '\0' && !strpbrk(axis->unit_name, "*()"))
		fprintf(out, "in %s", axis->unit_name);
	else
		fputs("in its own units", out);
	if (axis->rpm)
		fputs(", velocities in rpm", out);
	if (!(axis->scale > 0.0))
		fputs("; its CountsPerUnit is not known yet: export again when it answers", out);
	if (axis->max_velocity > 0.0 && isfinite(axis->max_velocity)) {
		fputs(", at most ", out);
		put_real(out, axis->rpm || !(axis->scale > 0.0) ? axis->max_velocity :
		                                                  axis->max_velocity / axis->scale);
		fputs(axis->rpm || !(axis->scale > 0.0) ? "" : " a second", out);
	}
}

void db_ctl_write_codesys(const struct db_ctl_clients *of, FILE *out)
{
	fprintf(out,
	        "(* Written by drivebridgectl export: the drives of %s, for the library of "
	        "drivebridge.st: a list of\n"
	        "   global variables *)\n"
	        "VAR_GLOBAL\n",
	        of->host);
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		struct axis axis = axis_of(of, drive);

		fputc('\t', out);
		db_ctl_put_identifier(out, of, drive);
		fprintf(out, " : DB_AXIS_REF := (UnitId := %lld, CountsPerUnit := ",
		        (long long)axis.unit);
		put_real(out, axis.scale > 0.0 ? axis.scale : 1.0);
		/* VelocityScale 0 would mean CountsPerUnit. */
		fprintf(out, ", VelocityScale := %s, LowWordFirst := %s); (* ",
		        axis.rpm ? "1.0" : "0.0", of->low_word_first ? "TRUE" : "FALSE");
		put_remark(out, &axis);
		fputs(" *)\n", out);
	}
	fputs("END_VAR\n", out);
}

void db_ctl_write_tia(const struct db_ctl_clients *of, FILE *out)
{
	fprintf(out,
	        "// Written by drivebridgectl export: the drives of %s, as an external source "
	        "file,\r\n"
	        "// for the library of drivebridge.st\r\n"
	        "DATA_BLOCK \"Drives\"\r\n"
	        "{ S7_Optimized_Access := 'FALSE' }\r\n"
	        "VERSION : 0.1\r\n"
	        "NON_RETAIN\r\n"
	        "   STRUCT\r\n",
	        of->host);
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		struct axis axis = axis_of(of, drive);

		fputs("      ", out);
		db_ctl_put_identifier(out, of, drive);
		fputs(" : \"DB_AXIS_REF\";   // ", out);
		put_remark(out, &axis);
		fputs("\r\n", out);
	}
	fputs("   END_STRUCT;\r\n\r\nBEGIN\r\n", out);
	for (size_t drive = 0; drive < json_array_size(of->drives); drive++) {
		struct axis axis = axis_of(of, drive);

		fputs("   ", out);
		db_ctl_put_identifier(out, of, drive);
		fprintf(out, ".UnitId := %lld;\r\n   ", (long long)axis.unit);
		db_ctl_put_identifier(out, of, drive);
		fputs(".CountsPerUnit := ", out);
		put_real(out, axis.scale > 0.0 ? axis.scale : 1.0);
		fputs(";\r\n   ", out);
		db_ctl_put_identifier(out, of, drive);
		fprintf(out, ".VelocityScale := %s;\r\n   ", axis.rpm ? "1.0" : "0.0");
		db_ctl_put_identifier(out, of, drive);
		fprintf(out, ".LowWordFirst := %s;\r\n", of->low_word_first ? "TRUE" : "FALSE");
	}
	fputs("END_DATA_BLOCK\r\n", out);
}

/* --- notation --------------------------------------------------------------------------------- */

/* The blocks that a PLC reads and writes: the first address, and the one after the last
 * register. */
static const struct block {
	const char *title;
	const char *array;
	json_int_t first;
	json_int_t end;
} blocks[] = {
	{ "Read: process data", "rx", 0, 100 },
	{ "Write: a command and its arguments", "tx", 100, 200 },
};

static void put_row(FILE *out, const struct block *block, const json_t *reg)
{
	const struct db_ctl_client_type *type = db_ctl_client_type(reg);
	json_int_t address = json_integer_value(json_object_get(reg, "address"));
	long long at = (long long)(address - block->first);
	char elements[64];

	if (type->registers == 1)
		snprintf(elements, sizeof(elements), "%s[%lld]", block->array, at);
	else
		snprintf(elements, sizeof(elements), "%s[%lld..%lld]", block->array, at,
		         at + type->registers - 1);
	fprintf(out, "| `%s` | %lld | 4%04lld | %s | DBB %lld, %s | %s, %s | %s, %s |\n",
	        db_words_text(reg, "name"), (long long)address, (long long)address + 1, type->type,
	        2 * at, type->tia, elements, type->logix, elements, type->sysmac);
}

void db_ctl_write_notation(const struct db_ctl_clients *of, FILE *out)
{
	size_t drive = of->chosen < json_array_size(of->drives) ? of->chosen : 0;
	size_t i;
	const json_t *reg;

	fprintf(out,
	        "# Registers in the notation of controllers\n\n"
	        "<!-- Written by drivebridgectl export -->\n\n"
	        "The blocks that a PLC reads and writes, for one drive (here `%s`, unit %lld). "
	        "`rx` is what it\n"
	        "reads from register 0 on, `tx` what it writes from register 100 on. Byte offsets "
	        "are those of a\n"
	        "data block without optimized access whose first element is the first register of "
	        "the block.\n\n"
	        "- TIA Portal: high word first.\n"
	        "- Logix 5000 and Omron NJ/NX have the low word first in memory: set `word-order = "
	        "low-first`, or\n"
	        "  swap the two words before they become a DINT or REAL. An INT of Logix has a "
	        "sign: 65535 reads\n"
	        "  as -1.\n"
	        "- This gateway has the %s word first.\n",
	        db_ctl_drive_name(of, drive),
	        json_integer_value(json_object_get(json_array_get(of->drives, drive), "unit")),
	        of->low_word_first ? "low" : "high");
	for (size_t at = 0; at < sizeof(blocks) / sizeof(blocks[0]); at++) {
		fprintf(out,
		        "\n## %s\n\n| Register | Address | Reference | Type | TIA Portal | "
		        "Rockwell Logix | Omron Sysmac |\n|---|---|---|---|---|---|---|\n",
		        blocks[at].title);
		json_array_foreach(json_array_get(of->registers, drive), i, reg)
		{
			json_int_t address = json_integer_value(json_object_get(reg, "address"));

			if (db_ctl_client_type(reg) && address >= blocks[at].first &&
			    address < blocks[at].end)
				put_row(out, &blocks[at], reg);
		}
	}
}
