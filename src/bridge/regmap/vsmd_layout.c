/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/vsmd_layout.h"

#include "regmap/image.h"

#include <stdio.h>
#include <string.h>

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

/* --- registers -------------------------------------------------------------------------------- */

#define HOLDING(at) .address = (at), .flags = DB_ROW_WRITABLE
#define INPUT(at) .address = (at)

#define KEPT(at, kind, member, text, ...)                              \
	{                                                              \
		.content = VSMD_KEPT,                                  \
		.row = { HOLDING(at),                                  \
			 .name = #member,                              \
			 .type = (kind),                               \
			 .offset = offsetof(struct vsmd_kept, member), \
			 .description = (text),                        \
			 __VA_ARGS__ }                                 \
	}
#define PARAM(at, parameter)                                                        \
	{                                                                           \
		.content = VSMD_PARAM, .param = (parameter), .row = { HOLDING(at) } \
	}
#define EVENTS(at, port, falling)                                                          \
	{                                                                                  \
		.content = VSMD_EVENTS, .param = (falling),                                \
		.row = { HOLDING(at),                                                      \
			 .name = "s" port "_events",                                       \
			 .type = DB_U16,                                                   \
			 .max = 0x0909,                                                    \
			 .description = "Sensor port " port ": high byte what a falling "  \
			                "edge does as s" port "f; low byte what a rising " \
			                "edge does as s" port "r" }                        \
	}
#define RESERVED(at)                                                                         \
	{                                                                                    \
		.content = VSMD_RESERVED, .row = { HOLDING(at), .name = "", .type = DB_U16 } \
	}
#define MEASURED(at, kind, title, member, text, ...)                                 \
	{                                                                            \
		.content = VSMD_MEASURED,                                            \
		.row = { INPUT(at),                                                  \
			 .name = (title),                                            \
			 .type = (kind),                                             \
			 .offset = offsetof(struct db_drive_image, feedback.member), \
			 .description = (text),                                      \
			 __VA_ARGS__ }                                               \
	}
#define ANY_POSITION .unit = "pulses", .min = INT32_MIN, .max = INT32_MAX

static const char command_text[] =
	"Executes what is written: 0x0100 off; 0x0101 enable; 0x0200 make this position the origin "
	"(0); 0x0300 run at spd; 0x0301 go to pos; 0x0302 go the distance pos; 0x0400 stop; 0x0401 "
	"stop at once; 0x0500 save parameters; 0x0600 end homing; 0x0601 home; 0x0700..0x0C01 "
	"ports s1..s6 low (00) or high (01); 0x1000 clear encoder error; 0x1300 end shaking; "
	"0x1301 "
	"shake for cycles; 0x1302 shake for seconds; 0x1400..0x16FF duty of ports 1..3 for a "
	"resistive load; 0x1700..0x19FF for an inductive load. 0 executes nothing. Reads as the "
	"last "
	"code written";

static const struct vsmd_row holding[] = {
	KEPT(0x00, DB_U16, command, command_text, .max = 0x19FF),
	KEPT(0x01, DB_I32, pos,
	     "Target or distance; writing it while command holds 0x0301 or 0x0302 starts a move",
	     ANY_POSITION),
	PARAM(0x03, VSMD_SPD),
	PARAM(0x05, VSMD_ACC),
	PARAM(0x07, VSMD_DEC),
	PARAM(0x09, VSMD_CRA),
	PARAM(0x0B, VSMD_CRN),
	PARAM(0x0D, VSMD_CRH),
	{
		.content = VSMD_MODES,
		.param = VSMD_S1,
		.row = { HOLDING(0x0F), .name = "s_modes", .type = DB_BITS16, .max = 0x3F,
	                 .description = "Direction of the sensor ports: bit 0 = s1 ... bit 5 = s6; "
	                                "0=input 1=output" },
	},
	EVENTS(0x10, "1", VSMD_S1F),
	EVENTS(0x11, "2", VSMD_S2F),
	EVENTS(0x12, "3", VSMD_S3F),
	EVENTS(0x13, "4", VSMD_S4F),
	EVENTS(0x14, "5", VSMD_S5F),
	EVENTS(0x15, "6", VSMD_S6F),
	RESERVED(0x16),
	RESERVED(0x17),
	PARAM(0x18, VSMD_ZMD),
	PARAM(0x19, VSMD_OSV),
	PARAM(0x1A, VSMD_SNR),
	PARAM(0x1B, VSMD_ZSD),
	PARAM(0x1D, VSMD_ZSP),
	PARAM(0x1F, VSMD_CID),
	PARAM(0x20, VSMD_BDR),
	PARAM(0x22, VSMD_MCS),
	PARAM(0x23, VSMD_MSR),
	PARAM(0x24, VSMD_MSV),
	PARAM(0x25, VSMD_PSR),
	PARAM(0x26, VSMD_PSV),
	PARAM(0x27, VSMD_ZAR),
	PARAM(0x28, VSMD_PAE),
	KEPT(0x29, DB_U16, mbs,
	     "Word order of 32-bit values in this view: 0=low word first 1=high word first; holds "
	     "from the next request on; vendor-word-order after a start of the bridge",
	     .max = 1),
	PARAM(0x2A, VSMD_PUD),
	PARAM(0x2B, VSMD_EMOD),
	PARAM(0x2C, VSMD_ELNS),
	PARAM(0x2D, VSMD_ESTP),
	PARAM(0x2E, VSMD_ERTY),
	PARAM(0x2F, VSMD_EDIR),
	PARAM(0x30, VSMD_EWR),
	PARAM(0x31, VSMD_EZ),
	RESERVED(0x32),
	PARAM(0x33, VSMD_ZCR),
	PARAM(0x35, VSMD_ERATIO),
	PARAM(0x37, VSMD_ESDS),
	PARAM(0x39, VSMD_RES),
	RESERVED(0x3B),
	KEPT(0x3C, DB_I32, spos, "One end of the swing", ANY_POSITION),
	KEPT(0x3E, DB_I32, epos, "The other end of the swing", ANY_POSITION),
	KEPT(0x40, DB_F32, freq, "Frequency of the swing; the range is the family's", .unit = "Hz"),
	KEPT(0x42, DB_U16, cycles, "Cycles for 0x1301 or seconds for 0x1302; 0=until stopped",
	     .max = 65535),
	PARAM(0x43, VSMD_SML),
	PARAM(0x45, VSMD_SPL),
};

static const struct vsmd_row input[] = {
	MEASURED(0, DB_F32, "speed", velocity, "Actual speed", .unit = "pulses/s"),
	MEASURED(2, DB_I32, "position", position, "Actual position", .unit = "pulses"),
	MEASURED(4, DB_BITS32, "status", drive_status,
	         "The drive's own status word as its vendor documents it", .unit = ""),
	{
		.content = VSMD_VERSION,
		.row = { INPUT(6), .name = "version", .type = DB_TEXT,
	                 .registers = VSMD_VERSION_REGISTERS,
	                 .description = "The drive's own description of itself; two characters a "
	                                "register; the first in the low byte" },
	},
};

const struct vsmd_row *db_vsmd_layout_rows(enum db_table table, size_t *count)
{
	switch (table) {
	case DB_TABLE_HOLDING:
		*count = COUNT_OF(holding);
		return holding;
	case DB_TABLE_INPUT:
		*count = COUNT_OF(input);
		return input;
	default:
		*count = 0;
		return NULL;
	}
}

struct db_cell db_vsmd_layout_cell(const struct vsmd_row *row)
{
	enum db_type type = row->content == VSMD_PARAM ? vsmd_params[row->param].type :
	                                                 row->row.type;

	return (struct db_cell){
		.address = row->row.address,
		.offset = (uint16_t)row->row.offset,
		.registers = (uint8_t)(type == DB_TEXT ? row->row.registers :
		                                         db_type_registers(type)),
		.type = (uint8_t)type,
		.flags = row->row.flags,
	};
}

/* --- command codes ---------------------------------------------------------------------------- */

#define ONE(code, what)                                            \
	{                                                          \
		.first = (code), .last = (code), .command = (what) \
	}
#define PORT(code, number)                                                         \
	{                                                                          \
		.first = (code), .last = (code) + 1, .command = DB_CMD_SET_OUTPUT, \
		.port = (number)                                                   \
	}
#define DUTY(code, what, number)                                                            \
	{                                                                                   \
		.first = (code), .last = (code) + 0xFF, .command = (what), .port = (number) \
	}

static const struct vsmd_code codes[] = {
	ONE(0x0100, DB_CMD_DISABLE),
	ONE(0x0101, DB_CMD_ENABLE),
	ONE(0x0200, DB_CMD_SET_POSITION),
	ONE(0x0300, DB_CMD_MOVE_PRESET),
	ONE(0x0301, DB_CMD_MOVE_ABSOLUTE),
	ONE(0x0302, DB_CMD_MOVE_RELATIVE),
	ONE(0x0400, DB_CMD_STOP),
	ONE(0x0401, DB_CMD_QUICK_STOP),
	ONE(0x0500, DB_CMD_SAVE_PARAMETERS),
	ONE(0x0600, DB_CMD_HOME_STOP),
	ONE(0x0601, DB_CMD_HOME),
	PORT(0x0700, 1),
	PORT(0x0800, 2),
	PORT(0x0900, 3),
	PORT(0x0A00, 4),
	PORT(0x0B00, 5),
	PORT(0x0C00, 6),
	ONE(0x1000, DB_CMD_CLEAR_FAULT),
	ONE(0x1300, DB_CMD_SHAKE_STOP),
	ONE(0x1301, DB_CMD_SHAKE_START),
	ONE(0x1302, DB_CMD_SHAKE_START_TIME),
	DUTY(0x1400, DB_CMD_SET_NMOS, 1),
	DUTY(0x1500, DB_CMD_SET_NMOS, 2),
	DUTY(0x1600, DB_CMD_SET_NMOS, 3),
	DUTY(0x1700, DB_CMD_SET_SV, 1),
	DUTY(0x1800, DB_CMD_SET_SV, 2),
	DUTY(0x1900, DB_CMD_SET_SV, 3),
};

const struct vsmd_code *db_vsmd_layout_code(uint16_t code)
{
	for (size_t i = 0; i < COUNT_OF(codes); i++) {
		if (code >= codes[i].first && code <= codes[i].last)
			return &codes[i];
	}
	return NULL;
}

struct db_args db_vsmd_layout_args(const struct vsmd_code *entry, const struct vsmd_kept *kept)
{
	struct db_args args = {
		/* Velocity 0: moves run at spd, which is the drive's own preset parameter, as on
		 * the vendor's models. */
		.target_velocity = 0.0f,
		.target_position = kept->pos,
		.output_number = entry->port,
		.output_value = (uint16_t)(kept->command - entry->first),
		.shake_start_position = kept->spos,
		.shake_end_position = kept->epos,
		.shake_frequency = kept->freq,
		.shake_cycles = kept->cycles,
		.shake_time = kept->cycles,
	};

	/* The vendor's org without an argument means 0. Not pos, which after a move holds its
	 * target, so that org would do nothing, and which cannot be changed while command holds
	 * 0x0301 without starting a move. */
	if (entry->command == DB_CMD_SET_POSITION)
		args.target_position = 0;
	return args;
}

/* --- for the documents ------------------------------------------------------------------------ */

static void visit_rows(const struct db_driver *driver, enum db_table table, db_visit_fn *visit,
                       void *context)
{
	size_t count;
	const struct vsmd_row *rows = db_vsmd_layout_rows(table, &count);

	for (size_t i = 0; i < count; i++) {
		bool is_param = rows[i].content == VSMD_PARAM;
		struct db_entry entry = {
			.cell = db_vsmd_layout_cell(&rows[i]),
			.row = is_param ? NULL : &rows[i].row,
			.param = is_param ? &driver->params[rows[i].param] : NULL,
			.table = table,
		};

		snprintf(entry.name, sizeof(entry.name), "%s",
		         is_param ? entry.param->name : rows[i].row.name);
		visit(context, &entry);
	}
}

void db_vsmd_layout_visit(const struct db_driver *driver, db_visit_fn *visit, void *context)
{
	visit_rows(driver, DB_TABLE_HOLDING, visit, context);
	visit_rows(driver, DB_TABLE_INPUT, visit, context);
}
