/* SPDX-License-Identifier: Apache-2.0 */
#include "registers/export.h"

#include "drivebridge/command_table.h"
#include "drivebridge/log.h"
#include "regmap/image.h"
#include "regmap/index.h"
#include "regmap/vsmd_layout.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* --- collecting ------------------------------------------------------------------------------------ */

/* A register of the map, and the families that have it (bits by place in db_drivers). */
struct listed {
	struct db_entry entry;
	enum db_view view;
	uint32_t families;
	bool conditional; /* some families may lack it */
};

struct list {
	struct listed *items;
	size_t count;
	size_t room;
	enum db_view view; /* of what is being added */
	unsigned family;
	bool failed;
};

/* Of a parameter of the vendor's, what the map tells may differ from family to family. */
static bool same_parameter(const struct db_entry *a, const struct db_entry *b)
{
	if (a->row || b->row || a->param == b->param)
		return true;
	return a->param->min == b->param->min && a->param->max == b->param->max &&
	       strcmp(a->param->unit, b->param->unit) == 0 &&
	       strcmp(a->param->description, b->param->description) == 0;
}

static bool is_listed(const struct listed *listed, enum db_view view, const struct db_entry *entry)
{
	return listed->view == view && listed->entry.table == entry->table &&
	       listed->entry.cell.address == entry->cell.address &&
	       strcmp(listed->entry.name, entry->name) == 0 &&
	       same_parameter(&listed->entry, entry);
}

static bool make_room(struct list *list)
{
	struct listed *items;

	if (list->count < list->room)
		return true;
	items = realloc(list->items, (list->room + 256) * sizeof items[0]);
	if (!items) {
		list->failed = true;
		return false;
	}
	list->items = items;
	list->room += 256;
	return true;
}

/* How many there are is the family's. */
static bool is_of_family(const struct db_row *row)
{
	return row->repeat &&
	       (row->repeat->of == DB_REPEAT_OUTPUTS || row->repeat->of == DB_REPEAT_STATUS_BITS);
}

static void add_entry(void *context, const struct db_entry *entry)
{
	struct list *list = context;
	const struct db_row *row = entry->row;

	if (entry->name[0] == '\0')
		return;
	for (size_t i = 0; i < list->count; i++) {
		if (is_listed(&list->items[i], list->view, entry)) {
			list->items[i].families |= UINT32_C(1) << list->family;
			return;
		}
	}
	if (!make_room(list))
		return;
	list->items[list->count++] = (struct listed){
		.entry = *entry,
		.view = list->view,
		.families = UINT32_C(1) << list->family,
		.conditional = !row || row->measure || row->alias || is_of_family(row) ||
		               list->view == DB_VIEW_VSMD,
	};
}

static int compare_places(const void *a, const void *b)
{
	static const int order[] = {
		[DB_TABLE_HOLDING] = 0,
		[DB_TABLE_INPUT] = 1,
		[DB_TABLE_DISCRETE] = 2,
		[DB_TABLE_COILS] = 3,
	};
	const struct listed *left = a;
	const struct listed *right = b;

	if (left->view != right->view)
		return left->view < right->view ? -1 : 1;
	if (left->entry.table != right->entry.table)
		return order[left->entry.table] - order[right->entry.table];
	if (left->entry.cell.address != right->entry.cell.address)
		return left->entry.cell.address < right->entry.cell.address ? -1 : 1;
	if (strcmp(left->entry.name, right->entry.name) != 0)
		return strcmp(left->entry.name, right->entry.name);
	return left->families < right->families ? -1 : 1;
}

static int collect_registers(struct list *list)
{
	struct db_scope scope = { .view = DB_VIEW_DRIVE };

	*list = (struct list){ .view = DB_VIEW_DRIVE };
	for (unsigned i = 0; db_drivers[i]; i++) {
		scope.driver = db_drivers[i];
		list->family = i;
		db_table_visit(&scope, add_entry, list);
	}
	scope = (struct db_scope){
		.view = DB_VIEW_GATEWAY,
		.buses = DB_GATEWAY_BUSES,
		.drives = DB_GATEWAY_WINDOWS,
	};
	list->view = DB_VIEW_GATEWAY;
	db_table_visit(&scope, add_entry, list);
	list->view = DB_VIEW_VSMD;
	for (unsigned i = 0; db_drivers[i]; i++) {
		list->family = i;
		if (db_drivers[i]->vendor_layout)
			db_vsmd_layout_visit(db_drivers[i], add_entry, list);
	}
	if (list->failed) {
		free(list->items);
		return -ENOMEM;
	}
	qsort(list->items, list->count, sizeof list->items[0], compare_places);
	return 0;
}

/* --- columns ----------------------------------------------------------------------------------------- */

#define TEXT_MAX 4096

/* A column's text while it is put together. What does not fit is cut off. */
struct text {
	char bytes[TEXT_MAX];
	size_t length;
};

__attribute__((format(printf, 2, 3))) static void append_text(struct text *text, const char *format,
                                                              ...)
{
	size_t room = TEXT_MAX - text->length;
	va_list arguments;
	int length;

	va_start(arguments, format);
	length = vsnprintf(text->bytes + text->length, room, format, arguments);
	va_end(arguments);
	if (length > 0)
		text->length += (size_t)length < room ? (size_t)length : room - 1;
}

static const char *view_name(enum db_view view)
{
	static const char *const names[] = {
		[DB_VIEW_DRIVE] = "drive",
		[DB_VIEW_GATEWAY] = "gateway",
		[DB_VIEW_VSMD] = "vsmd",
	};

	return names[view];
}

static const struct {
	const char *name;
	const char *title;
	unsigned reference;
} tables[] = {
	[DB_TABLE_COILS] = { "coil", "coils", 1 },
	[DB_TABLE_DISCRETE] = { "discrete", "discrete inputs", 10001 },
	[DB_TABLE_HOLDING] = { "holding", "holding registers", 40001 },
	[DB_TABLE_INPUT] = { "input", "input registers", 30001 },
};

static const char *type_of(const struct listed *listed)
{
	if (listed->entry.table == DB_TABLE_HOLDING || listed->entry.table == DB_TABLE_INPUT)
		return db_type_name((enum db_type)listed->entry.cell.type);
	return "u16";
}

static const char *access_of(const struct listed *listed)
{
	const struct db_param *param = listed->entry.param;

	if (param && (param->traits & DB_PARAM_WRITE_ONLY))
		return "w";
	return listed->entry.cell.flags & DB_ROW_WRITABLE ? "rw" : "r";
}

static const char *unit_of(const struct listed *listed)
{
	const struct db_entry *entry = &listed->entry;

	if (entry->param)
		return entry->param->unit;
	return entry->row->unit ? entry->row->unit : "";
}

/* A parameter under a neutral name is not the same one in every family. */
static const struct db_param *param_in(const struct listed *listed, unsigned family)
{
	int param = db_row_param(listed->entry.row, db_drivers[family]);

	return param < 0 ? NULL : &db_drivers[family]->params[param];
}

static bool is_other(const struct db_param *param, const struct db_param *than)
{
	return param && than && strcmp(param->name, than->name) != 0;
}

static bool has_others(const struct listed *listed)
{
	if (!listed->entry.row || !listed->entry.row->alias)
		return false;
	for (unsigned i = 0; db_drivers[i]; i++) {
		if (is_other(param_in(listed, i), listed->entry.param))
			return true;
	}
	return false;
}

static void add_others(const struct listed *listed, struct text *text)
{
	for (unsigned i = 0; db_drivers[i]; i++) {
		const struct db_param *param = param_in(listed, i);

		if (is_other(param, listed->entry.param))
			append_text(text, "; %s in %s on %s", param->name, param->unit,
			            db_drivers[i]->name);
	}
}

static void add_limits(const struct listed *listed, struct text *min, struct text *max)
{
	const struct db_entry *entry = &listed->entry;
	double low = entry->param ? entry->param->min : entry->row->min;
	double high = entry->param ? entry->param->max : entry->row->max;

	if ((low == 0 && high == 0) || has_others(listed))
		return;
	append_text(min, "%.10g", low);
	append_text(max, "%.10g", high);
}

static void add_families(uint32_t families, bool conditional, struct text *text)
{
	uint32_t all = 0;

	for (unsigned i = 0; db_drivers[i]; i++)
		all |= UINT32_C(1) << i;
	if (!conditional) {
		append_text(text, "all");
		return;
	}
	for (unsigned i = 0; db_drivers[i]; i++) {
		if (families & all & (UINT32_C(1) << i))
			append_text(text, "%s%s", text->length ? " " : "", db_drivers[i]->name);
	}
}

static bool is_offered(unsigned code)
{
	for (unsigned i = 0; db_drivers[i]; i++) {
		if (db_drivers[i]->commands & DB_COMMAND_BIT(code))
			return true;
	}
	return false;
}

/* The faults of each family; those after the first one that has some are listed with its name. */
static void add_faults(struct text *text)
{
	bool first = true;

	for (unsigned i = 0; db_drivers[i]; i++) {
		if (db_drivers[i]->fault_count > 0 && !first)
			append_text(text, "; on %s:", db_drivers[i]->name);
		for (size_t j = 0; j < db_drivers[i]->fault_count; j++)
			append_text(text, " %u=%s", (unsigned)db_drivers[i]->faults[j].error,
			            db_drivers[i]->faults[j].name);
		first = first && db_drivers[i]->fault_count == 0;
	}
}

static void add_codes(const struct db_codes *codes, struct text *text)
{
	const char *before = codes->bits ? "; bits:" : ":";

	for (unsigned code = 0; code < codes->count; code++) {
		const char *name = codes->name(code);

		if (strcmp(name, "unknown") == 0)
			continue;
		if (codes->name == db_command_name && code != 0 && !is_offered(code))
			continue;
		append_text(text, "%s %u=%s", before, code, name);
		before = "";
	}
	if (codes->faults)
		add_faults(text);
}

static void add_description(const struct listed *listed, struct text *text)
{
	const struct db_entry *entry = &listed->entry;
	const char *from;

	if (!entry->row) {
		append_text(text, "%s", entry->param->description);
		return;
	}
	if (entry->bit) {
		append_text(text, "%s: bit %u of drive_status", entry->bit->description,
		            (unsigned)entry->bit->bit);
		return;
	}
	for (from = entry->row->description; *from; from++) {
		if (*from == '#')
			append_text(text, "%u", entry->number);
		else
			append_text(text, "%c", *from);
	}
	if (entry->row->codes && !entry->row->codes->told)
		add_codes(entry->row->codes, text);
	if (entry->param)
		append_text(text, " (%s)", entry->param->name);
	if (has_others(listed))
		add_others(listed, text);
	if (entry->cell.type == DB_TEXT)
		append_text(text, "; %u registers", (unsigned)entry->cell.registers);
}

/* --- CSV ---------------------------------------------------------------------------------------------- */

/* RFC 4180 */
static void put_field(FILE *out, const char *field)
{
	if (!strpbrk(field, ",\"\r\n")) {
		fputs(field, out);
		return;
	}
	putc('"', out);
	for (; *field; field++) {
		if (*field == '"')
			putc('"', out);
		putc(*field, out);
	}
	putc('"', out);
}

static void put_csv(FILE *out, const struct listed *listed)
{
	struct text min = { .length = 0 };
	struct text max = { .length = 0 };
	struct text families = { .length = 0 };
	struct text description = { .length = 0 };
	unsigned address = listed->entry.cell.address;

	add_limits(listed, &min, &max);
	add_families(listed->families, listed->conditional, &families);
	add_description(listed, &description);
	fprintf(out, "%s,%s,%u,%05u,%s,%s,%s,", view_name(listed->view),
	        tables[listed->entry.table].name, address,
	        tables[listed->entry.table].reference + address, listed->entry.name,
	        type_of(listed), access_of(listed));
	put_field(out, unit_of(listed));
	fprintf(out, ",%s,%s,%s,", min.bytes, max.bytes, families.bytes);
	put_field(out, description.bytes);
	putc('\n', out);
}

int db_export_csv(FILE *out)
{
	struct list list;

	if (collect_registers(&list) != 0)
		return -ENOMEM;
	fputs("view,table,address,reference,name,type,access,unit,min,max,families,description\n",
	      out);
	for (size_t i = 0; i < list.count; i++)
		put_csv(out, &list.items[i]);
	free(list.items);
	return 0;
}

static uint32_t families_with(unsigned code, bool *all)
{
	uint32_t families = 0;

	*all = true;
	for (unsigned i = 0; db_drivers[i]; i++) {
		if (db_drivers[i]->commands & DB_COMMAND_BIT(code))
			families |= UINT32_C(1) << i;
		else
			*all = false;
	}
	return families;
}

static void put_command(FILE *out, const struct db_command_row *row, struct list *list)
{
	struct text families = { .length = 0 };
	bool all;
	uint32_t with = families_with((unsigned)row->code, &all);
	const char *before = "";

	if (with == 0)
		return;
	fprintf(out, "%u,%s,", (unsigned)row->code, row->name);
	for (size_t i = 0; i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		size_t offset = offsetof(struct db_drive_image, block.args) +
		                db_arg_rows[row->args[i]].offset;

		for (size_t j = 0; j < list->count; j++) {
			const struct listed *listed = &list->items[j];

			if (listed->view != DB_VIEW_DRIVE ||
			    listed->entry.cell.part != DB_PART_BLOCK ||
			    listed->entry.cell.offset < offset ||
			    listed->entry.cell.offset >= offset + db_arg_rows[row->args[i]].bytes)
				continue;
			fprintf(out, "%s%s", before, listed->entry.name);
			before = " ";
		}
	}
	add_families(with, !all || row->own, &families);
	fprintf(out, ",%s,", families.bytes);
	put_field(out, row->description);
	putc('\n', out);
}

int db_export_commands(FILE *out)
{
	struct list list;

	if (collect_registers(&list) != 0)
		return -ENOMEM;
	fputs("code,name,arguments,families,description\n", out);
	for (size_t i = 0; i < db_command_row_count; i++)
		put_command(out, &db_command_rows[i], &list);
	free(list.items);
	return 0;
}

/* --- Markdown ----------------------------------------------------------------------------------------- */

static const char introduction[] =
	"# Register map\n"
	"\n"
	"Generated from the register table by `regmap-export md`; do not edit. The same as\n"
	"[register-map.csv](register-map.csv), which has every one of the blocks that repeat; the\n"
	"commands are in [commands.csv](commands.csv).\n"
	"\n"
	"- Addresses are those on the wire, from 0. The reference is the number printed in many\n"
	"  PLC manuals: 40001 is holding register 0.\n"
	"- Holding registers are read with FC 3 and written with FC 6, 16, 22 and 23. Those with\n"
	"  access `r` are also input registers (FC 4) at the same address. The value of those with\n"
	"  access `w` cannot be read: 02 alone, 0 in a block. So it is with a parameter of which no\n"
	"  value is known: of CAN servos what was not written yet, of others what the model lacks.\n"
	"- 32-bit values take two registers and 64-bit values four, high word first unless\n"
	"  `word-order = low-first`. Text holds two characters in a register, the first in the high\n"
	"  byte, in both word orders. Half of a 32-bit value can be read but not written (03).\n"
	"- Vendor parameters stand in the vendor's order. Where a 32-bit one would begin at an odd\n"
	"  address a register without a name is left free: it reads as 0 and takes only 0.\n"
	"- No drive has two registers of one name, but families may use the same one at different\n"
	"  addresses (`max_speed`, `ramp_acceleration`, `ramp_deceleration`): who takes an address from\n"
	"  this map by its name looks at the family, too.\n"
	"- All values of one read are from one moment of the drive.\n"
	"- Reads may go in blocks: inside an area (see below) registers that this drive does not have\n"
	"  read as 0 where the read touches any that it has; `capabilities` tells what a drive can\n"
	"  do. A read of nothing but registers that do not exist, or beyond the areas, is answered\n"
	"  with 02, and so is a write to any of them.\n"
	"- The reads of FC 23 are made before its write: they do not show its effect.\n"
	"- A command or parameter write is answered when the drive has confirmed it. 01: the drive\n"
	"  has no such function; 02: no such register, or it cannot be written; 03: value out of\n"
	"  range; 04: refused, failed, or the first `command_id` after a start; 05: not confirmed\n"
	"  yet, `result` tells the end; 06: busy; 0A: unknown unit, or the bus is down; 0B: the\n"
	"  drive does not answer. A write answered with an exception at once stores nothing.\n"
	"- When a drive does not answer, reading its measured registers (positions, speeds,\n"
	"  `drive_status`, `timestamp_us`, inputs and the like) or its parameters is answered with\n"
	"  0B, or 0A when the bus is down; `stale = value` gives the last values instead. The\n"
	"  state, quality, age and result registers can always be read.\n";

static const char vendor_introduction[] =
	"\n"
	"The register map of the VSMD models that speak Modbus themselves, so that programs written\n"
	"for those run unchanged. What is said above holds here, too, except that\n"
	"\n"
	"- holding and input registers are different registers, and there are no bits;\n"
	"- the word order of 32-bit values is that of `mbs`, and text has its first character in the\n"
	"  low byte;\n"
	"- commands have no `command_id`: each write of `command` executes;\n"
	"- **while `command` holds 0x0301 or 0x0302, writing `pos` starts a move**; a write of both\n"
	"  executes once;\n"
	"- a write of parameters and a command together writes the parameters first, and the command\n"
	"  follows when the drive has confirmed them; only a stop goes first;\n"
	"- registers between the listed ones, and parameters that a model does not have, read as 0\n"
	"  and take only 0.\n"
	"\n"
	"Watchdog and latch are the drive's: after the watchdog has stopped it, 0x1000 (clear encoder\n"
	"error) allows motion again.\n";

static void put_heading(FILE *out, const struct listed *listed)
{
	static const char *const headings[] = {
		[DB_VIEW_DRIVE] = "Drive units",
		[DB_VIEW_GATEWAY] = "The gateway's units (0, 255 and `gateway-unit`)",
		[DB_VIEW_VSMD] = "The vendor's own layout (`layout = vsmd` and `vendor-unit`)",
	};

	fprintf(out, "\n## %s\n", headings[listed->view]);
	if (listed->view == DB_VIEW_VSMD)
		fputs(vendor_introduction, out);
}

/* What may be read across in a table. */
static void put_areas(FILE *out, const struct listed *listed)
{
	const char *before = "\nAreas: ";
	struct db_area own;

	for (size_t i = 0; i < db_area_count; i++) {
		const struct db_area *area = &db_areas[i];

		if (area->view != listed->view || area->table != listed->entry.table)
			continue;
		fprintf(out, "%s%s %u to %u", before, area->name, (unsigned)area->first,
		        (unsigned)area->last);
		before = ", ";
	}
	for (size_t i = 0; db_drivers[i]; i++) {
		if (listed->view != DB_VIEW_DRIVE || listed->entry.table != DB_TABLE_HOLDING ||
		    !db_param_area(db_drivers[i], &own))
			continue;
		fprintf(out, ", %s of %s %u to %u", own.name, db_drivers[i]->name,
		        (unsigned)own.first, (unsigned)own.last);
	}
	if (*before == ',')
		fputs(".\n", out);
}

static void put_table_heading(FILE *out, const struct listed *listed)
{
	fprintf(out, "\n### %s: %s\n", view_name(listed->view), tables[listed->entry.table].title);
	put_areas(out, listed);
	fputs("\n| address | reference | name | type | access | unit | range | families | description |\n"
	      "|---|---|---|---|---|---|---|---|---|\n",
	      out);
}

/* Pipes would end a table's cell. */
static void put_cell(FILE *out, const char *text)
{
	for (; *text; text++) {
		if (*text == '|')
			putc('\\', out);
		putc(*text, out);
	}
}

/* Blocks of registers that repeat: the first is shown, with where the others are. */
static bool is_repeated(const struct listed *listed)
{
	const struct db_row *row = listed->entry.row;

	return row && listed->entry.table == DB_TABLE_HOLDING && row->repeat;
}

static void add_repetition(const struct listed *listed, struct text *text)
{
	const struct db_repeat *repeat = listed->entry.row->repeat;

	append_text(text, "; likewise 2 to %u, each %u register%s further", repeat->count,
	            repeat->addresses, repeat->addresses == 1 ? "" : "s");
}

static void put_markdown(FILE *out, const struct listed *listed)
{
	struct text min = { .length = 0 };
	struct text max = { .length = 0 };
	struct text families = { .length = 0 };
	struct text description = { .length = 0 };
	unsigned address = listed->entry.cell.address;

	add_limits(listed, &min, &max);
	add_families(listed->families, listed->conditional, &families);
	add_description(listed, &description);
	if (is_repeated(listed))
		add_repetition(listed, &description);
	fprintf(out, "| %u | %05u | `%s` | %s | %s | %s | %s%s%s | %s | ", address,
	        tables[listed->entry.table].reference + address, listed->entry.name,
	        type_of(listed), access_of(listed), unit_of(listed), min.bytes,
	        min.length ? " .. " : "", max.bytes, families.bytes);
	put_cell(out, description.bytes);
	fputs(" |\n", out);
}

int db_export_markdown(FILE *out)
{
	struct list list;

	if (collect_registers(&list) != 0)
		return -ENOMEM;
	fputs(introduction, out);
	for (size_t i = 0; i < list.count; i++) {
		const struct listed *listed = &list.items[i];
		const struct listed *before = i > 0 ? listed - 1 : NULL;

		if (!before || before->view != listed->view)
			put_heading(out, listed);
		if (!before || before->view != listed->view ||
		    before->entry.table != listed->entry.table)
			put_table_heading(out, listed);
		if (!is_repeated(listed) || listed->entry.number == 1)
			put_markdown(out, listed);
	}
	free(list.items);
	return 0;
}

int db_export_events(FILE *out)
{
	static const char *const levels[] = {
		[DB_LOG_ERROR] = "error",
		[DB_LOG_WARNING] = "warning",
		[DB_LOG_NOTICE] = "notice",
		[DB_LOG_INFO] = "info",
	};

	fputs("name,level\n", out);
	for (int i = 0; i < DB_EVENT_COUNT; i++)
		fprintf(out, "%s,%s\n", db_event_name((enum db_event)i),
		        levels[db_event_level((enum db_event)i)]);
	return 0;
}
