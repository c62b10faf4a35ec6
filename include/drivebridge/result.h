/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The result of a write: the number in the `result` registers, and its name. The codes are part of
 * the contract with PLC programs: append, never renumber. Pure; any thread.
 */
#ifndef DRIVEBRIDGE_RESULT_H
#define DRIVEBRIDGE_RESULT_H

#include <stdbool.h>
#include <stdint.h>

enum db_result {
	DB_RESULT_NONE = 0,    /* nothing was commanded since the bridge started */
	DB_RESULT_OK = 1,      /* confirmed by the drive */
	DB_RESULT_PENDING = 2, /* queued or on the bus */
	DB_RESULT_REFUSED = 3, /* the drive itself refused it */
	DB_RESULT_OUT_OF_RANGE =
		4,             /* an argument is outside the documented range; nothing was sent */
	DB_RESULT_TIMEOUT = 5, /* no answer; known not to have been carried out, or harmless */
	DB_RESULT_INDETERMINATE = 6, /* the answer was lost and reading back could not tell */
	/* first id after the bridge started, taken as a start value only */
	DB_RESULT_RESTARTED = 7,
	DB_RESULT_CANCELLED = 8,    /* overtaken by a stop, or the bus was closed */
	DB_RESULT_LIMIT = 9,        /* outside the limits of the configuration; nothing was sent */
	DB_RESULT_LATCHED = 10,     /* the client-loss reaction is latched; clear_fault first */
	DB_RESULT_UNSUPPORTED = 11, /* this drive has no such function */
	DB_RESULT_BUSY = 12,        /* the bus's queue is full */
	DB_RESULT_BUS_DOWN = 13,    /* the port or interface is missing or down */
	DB_RESULT_OFFLINE = 14,     /* the drive is offline; nothing was sent */
	DB_RESULT_FAILED = 15,      /* the drive tried and failed (flash error, hardware fault) */
	DB_RESULT_RATE_LIMITED =
		16, /* too soon after the last one (save_parameters wears the flash) */
	DB_RESULT_NOT_IN_CONTROL = 17, /* another client has control of the drive */
	DB_RESULT_UNPROVEN = 18, /* accepted; nothing that the drive reports shows its effect */
	/* told to stop, the drive does not slow down; the stop is repeated */
	DB_RESULT_RUNS_ON = 19,
	/* it takes the line for too long while a drive of the line moves; it was not sent */
	DB_RESULT_LINE_MOVES = 20,
	DB_RESULT_COUNT
};

/* "ok", "pending", "out_of_range" ...; never null, "unknown" outside the enum. */
const char *db_result_name(enum db_result result);

/* True if the drive has accepted it: OK or UNPROVEN. */
bool db_result_is_success(enum db_result result);

/* Values of the `result_limit` register: part of the contract, append only. */
enum db_limit {
	DB_LIMIT_NONE = 0,
	DB_LIMIT_MIN_POSITION = 1,
	DB_LIMIT_MAX_POSITION = 2,
	DB_LIMIT_MAX_VELOCITY = 3,
	DB_LIMIT_MAX_ACCELERATION = 4,
};
#define DB_LIMIT_COUNT 5

/* "none", "min_position" ...; "unknown" outside the enum. Pure; any thread. */
const char *db_limit_name(uint16_t limit);

#endif
