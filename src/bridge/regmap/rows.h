/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Macros for the rows of the register table. Constant data.
 */
#ifndef DRIVEBRIDGE_REGMAP_ROWS_H
#define DRIVEBRIDGE_REGMAP_ROWS_H

#include "regmap/table.h"

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

/* The beginning of a row, followed by any of the macros below. */
#define ROW(at, title, kind) .address = (at), .name = (title), .type = DB_##kind

#define READ .flags = 0,
#define MEASURED .flags = DB_ROW_MEASURED,
#define WRITE .flags = DB_ROW_WRITABLE,
#define SWITCHED .flags = DB_ROW_WRITABLE | DB_ROW_MEASURED,
#define PARAM .flags = DB_ROW_WRITABLE | DB_ROW_PARAM,
#define WATCHDOG .flags = DB_ROW_WRITABLE | DB_ROW_WATCHDOG,
#define CONTROL .flags = DB_ROW_WRITABLE | DB_ROW_CONTROL,
#define HEARTBEAT .flags = DB_ROW_WRITABLE | DB_ROW_HEARTBEAT,
#define LIST .flags = DB_ROW_WRITABLE | DB_ROW_LIST,

#define UNIT(text) .unit = (text),
#define UPTO(limit) .max = (limit),
#define ANY_U16 .max = UINT16_MAX,
#define ANY_I32 .min = INT32_MIN, .max = INT32_MAX,
#define CODES(codes_of) .codes = &(codes_of),
#define LENGTH(count) .registers = (count),
/* Only in families that measure it. */
#define IF(what) .measure = DB_MEASURE_##what,
/* A vendor's parameter with a neutral name. */
#define ALIAS(which) .alias = DB_ALIAS_##which,
/* A repeated row, as struct db_repeat each_WHAT describes. */
#define EACH(what) .repeat = &each_##what,

extern const struct db_row_set db_drive_registers;
extern const struct db_row_set db_drive_bits;
extern const struct db_row_set db_drive_coils;
extern const struct db_row_set db_gateway_registers;

#endif
