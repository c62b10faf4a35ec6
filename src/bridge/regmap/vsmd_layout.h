/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The register map of the vendor's own Modbus models (VSMD1X4, VSMD1X5) as a table, so that
 * programs written for them also work with other models on the bridge. This is the only place that
 * knows its addresses and command codes; reads and writes are in vsmd_view.h. Pure data.
 */
#ifndef DRIVEBRIDGE_REGMAP_VSMD_LAYOUT_H
#define DRIVEBRIDGE_REGMAP_VSMD_LAYOUT_H

#include "codec/vsmd.h"
#include "drivebridge/command.h"
#include "regmap/index.h"

/* Registers of the version text in the map. */
#define VSMD_VERSION_REGISTERS 14

/* Registers that the bridge stores itself: those models hold them in their memory, too. */
struct vsmd_kept {
	uint16_t command; /* the last code written; 0 = none yet */
	int32_t pos;
	int32_t spos; /* for shaking, also the following */
	int32_t epos;
	float freq;
	uint16_t cycles; /* cycles or seconds */
	uint16_t mbs;    /* 32-bit values: 0 = low word first, 1 = high word first */
};

enum vsmd_content {
	VSMD_RESERVED, /* between the others: reads as 0 and accepts only 0 */
	VSMD_KEPT,     /* member of struct vsmd_kept at row.offset */
	VSMD_PARAM,    /* parameter `param` of the drive */
	VSMD_MODES,    /* one bit for each of the six parameters from `param` on */
	VSMD_EVENTS,   /* parameter `param` in the high byte, the next one in the low byte */
	VSMD_MEASURED, /* member of struct db_drive_image at row.offset */
	VSMD_VERSION,  /* the drive's identity */
};

struct vsmd_row {
	struct db_row row; /* name and type of a parameter are the parameter's own */
	enum vsmd_content content;
	enum vsmd_param param;
};

/* HOLDING and INPUT: ascending and without holes. Other tables have none. */
const struct vsmd_row *db_vsmd_layout_rows(enum db_table table, size_t *count);

/* The row's place, size and type. 16-bit members are as wide as their type. */
struct db_cell db_vsmd_layout_cell(const struct vsmd_row *row);

/* Codes of the command register: first..last are the same command with different values. */
struct vsmd_code {
	uint16_t first;
	uint16_t last;
	enum db_command command;
	uint16_t port; /* port of an output; else 0 */
};

/* Null when there is no such code. */
const struct vsmd_code *db_vsmd_layout_code(uint16_t code);

/* The arguments of a code's command, from the registers and the code itself. */
struct db_args db_vsmd_layout_args(const struct vsmd_code *entry, const struct vsmd_kept *kept);

/* For the documents, of a family with vendor_layout: as db_table_visit(). */
void db_vsmd_layout_visit(const struct db_driver *driver, db_visit_fn *visit, void *context);

#endif
