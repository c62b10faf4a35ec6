/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The register table: the only place that knows addresses. Rows are constant data; the registers of
 * a certain drive are found by expanding them (index.h). Any thread.
 */
#ifndef DRIVEBRIDGE_REGMAP_TABLE_H
#define DRIVEBRIDGE_REGMAP_TABLE_H

#include "drivebridge/driver.h"
#include "drivebridge/server.h"
#include "drivebridge/value.h"

enum db_view { DB_VIEW_DRIVE, DB_VIEW_GATEWAY, DB_VIEW_VSMD };

enum db_row_flag {
	DB_ROW_WRITABLE = 1u << 0,
	DB_ROW_MEASURED = 1u << 1, /* becomes old when the drive does not answer */
	DB_ROW_PARAM = 1u << 2,    /* a vendor parameter: read and written by its index */
	DB_ROW_WATCHDOG = 1u << 3, /* a setting of the bridge: the watchdog time */
	DB_ROW_CONTROL = 1u << 4,  /* requests control of the drive, or releases it */
	DB_ROW_HEARTBEAT = 1u << 5,
	DB_ROW_LIST = 1u << 6, /* part of a list of units with its stop: written together */
};

/* Names of a register's values or bits, for its description. */
struct db_codes {
	const char *(*name)(unsigned code); /* "unknown" where there is none */
	unsigned count;
	bool bits;
	bool told;   /* the row's description lists them, or where to find them */
	bool faults; /* the faults of the drive's family follow */
};

/* What determines the number of repeats; at most `count`. */
enum db_repeat_of {
	DB_REPEAT_FIXED,       /* always `count` */
	DB_REPEAT_OUTPUTS,     /* ports of the family */
	DB_REPEAT_STATUS_BITS, /* bits of its status word that the family names */
	DB_REPEAT_BUSES,
	DB_REPEAT_DRIVES,
};

/* A row that stands for several: '#' in name and description becomes 1, 2 ... */
struct db_repeat {
	enum db_repeat_of of;
	unsigned count;
	unsigned addresses;                  /* distance from one to the next */
	size_t bytes;                        /* distance of their members */
	const char *(*name)(unsigned index); /* instead of the row's name; may be null */
};

/* Parameters of a drive that also have a neutral name; the driver says which of the vendor's. */
enum db_alias { DB_ALIAS_NONE, DB_ALIAS_ACCELERATION, DB_ALIAS_DECELERATION };

struct db_row {
	uint16_t address;
	uint16_t registers; /* TEXT only */
	const char *name;
	enum db_type type;
	uint16_t part;    /* enum db_part that it needs */
	uint8_t flags;    /* enum db_row_flag */
	size_t offset;    /* offset of the member in its image; for bit tables that of the word */
	unsigned measure; /* exists only when the family measures this */
	enum db_alias alias;
	const struct db_repeat *repeat; /* null: not repeated */
	const char *unit;
	double min; /* both 0: not limited here */
	double max;
	const struct db_codes *codes;
	const char *description;
};

/* The rows of one view and table. HOLDING is also INPUT where a row cannot be written. */
struct db_row_set {
	enum db_view view;
	enum db_table table;
	const struct db_row *rows;
	size_t count;
};

/* All row sets, null-terminated. */
extern const struct db_row_set *const db_row_sets[];

/* The unit of the rows with a velocity in the drive's own units, which depends on the family (see
 * velocity_unit in drivebridge/driver.h). */
extern const char db_velocity_unit[];

/*
 * Registers that are read together. A read may include registers that a drive lacks, and gets 0
 * there, when it touches any that the drive has. Ascending in each view and table.
 */
struct db_area {
	const char *name;
	enum db_view view;
	enum db_table table; /* HOLDING (and INPUT with it) or DISCRETE */
	uint16_t first;
	uint16_t last;
};

extern const struct db_area db_areas[];
extern const size_t db_area_count;

/* As in the configuration. */
#define DB_WATCHDOG_MAX_MS 60000

/*
 * The vendor's parameters of a family, in the order of its table, begin at the first register of
 * its page (param_page in driver.h). Pages below DB_PARAM_LARGE are for families with up to 100
 * parameters of 32 bits, those from there on for up to DB_PARAMS_MAX of them.
 */
#define DB_PARAM_BASE 200
#define DB_PARAM_PAGE 200
#define DB_PARAM_LARGE 4
#define DB_PARAM_LARGE_BASE 6000
#define DB_PARAM_LARGE_PAGE 2000

unsigned db_param_first(const struct db_driver *driver);
/* The registers of the family's parameters, which are read together; false: `db_areas` has them, or
 * it has no parameters. */
bool db_param_area(const struct db_driver *driver, struct db_area *area);

/* Distance from one drive of the flat window to the next. */
#define DB_WINDOW_REGISTERS 24

/* All addresses are below this. */
#define DB_ADDRESS_LIMIT 16384

#endif
