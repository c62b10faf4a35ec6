/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A value of a register or a vendor parameter: its type, and 32 bits of content.
 */
#ifndef DRIVEBRIDGE_VALUE_H
#define DRIVEBRIDGE_VALUE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The types of docs/register-map.csv, in its spelling (db_type_name). */
enum db_type {
	DB_U16,
	DB_I16,
	DB_U32,
	DB_I32,
	DB_U64,
	DB_F32,
	DB_BITS16,
	DB_BITS32,
	DB_TEXT,
};

/* 16-bit types use the low half of u or i. U64 and TEXT do not fit and never travel this way. */
union db_value {
	uint32_t u;
	int32_t i;
	float f;
};

/* "u16", "f32" ... */
const char *db_type_name(enum db_type type);

/* Modbus registers a value of this type takes; 0 for TEXT, whose length is its row's. */
unsigned db_type_registers(enum db_type type);

/* The value as a number; every type that fits a db_value fits a double exactly. */
double db_value_number(enum db_type type, union db_value value);

/*
 * The value of this type nearest to a number. False when the number does not fit the type (out of
 * its range, not finite, or not whole for an integer type); *value is then untouched.
 */
bool db_value_from_number(enum db_type type, double number, union db_value *value);

/* What matters to a client that reads or writes all parameters of a drive. */
enum db_param_trait {
	DB_PARAM_HAS_PRESET = 1u << 0, /* `preset` is the value as delivered by the vendor */
	/* determines how the drive is reached: its address, its bit rate */
	DB_PARAM_ADDRESS = 1u << 1,
	DB_PARAM_DERIVED = 1u << 2,  /* the drive does not store it: it follows from others */
	DB_PARAM_ACTION = 1u << 3,   /* no value: writing it triggers an action of the drive */
	DB_PARAM_SECRET = 1u << 4,   /* must not be read, in the history either */
	DB_PARAM_FIRST = 1u << 5,    /* others depend on it: written first in a set */
	DB_PARAM_LAST = 1u << 6,     /* makes others effective: written last in a set */
	DB_PARAM_TOGETHER = 1u << 7, /* written in a set together with its neighbours */
	/* the drive's present state, such as power: not restored by a set */
	DB_PARAM_STATE = 1u << 8,
	DB_PARAM_WRITE_ONLY = 1u << 9, /* the drive never tells its value */
};
#define DB_PARAM_TRAIT_COUNT 10
const char *db_param_trait_name(unsigned bit); /* 1 = "address" ... */

/*
 * A parameter of a drive as its vendor documents it. min <= value <= max, both inclusive, in
 * `unit`. Tables of these are const and live as long as the program.
 */
struct db_param {
	const char *name;  /* the vendor's name */
	enum db_type type; /* U16, I16, U32, I32 or F32 */
	const char *unit;  /* "" when it has none */
	double min;
	double max;
	bool max_is_model; /* the document leaves the upper bound to the model; max is the widest */
	const char *description; /* one line, English, vendor term in brackets where it helps */
	unsigned traits;         /* enum db_param_trait */
	double preset;           /* with DB_PARAM_HAS_PRESET */
};

/* A bit of a drive's own status word that its vendor documents. */
struct db_drive_bit {
	uint8_t bit;      /* 0..31 */
	const char *name; /* the vendor's; the discrete input is called drive_NAME */
	const char *description;
};

/* The lowest `error` of a fault that a family has for itself. */
#define DB_FAMILY_FAULT 32

/*
 * A fault that only drives of this family report. `error` is the value of the register `error`, from
 * DB_FAMILY_FAULT on: the vendor's fault code where it is one of these, else what the driver
 * makes of a code or of a bit. It means this fault in this family, and another one elsewhere.
 */
struct db_drive_fault {
	uint16_t error;
	const char *name;
	const char *check; /* what a person should look at */
};

#endif
