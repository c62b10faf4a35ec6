/* SPDX-License-Identifier: Apache-2.0 */
/* One entry of a drive's history, as the registers show it. */
#ifndef DRIVEBRIDGE_HISTORY_H
#define DRIVEBRIDGE_HISTORY_H

#include "drivebridge/command.h"
#include "drivebridge/result.h"

/* So many are kept for each drive. */
#define DB_HISTORY_MAX 32

/* As the number of a parameter: it was not looked at. */
#define DB_HISTORY_UNKNOWN UINT16_MAX

struct db_history_entry {
	uint64_t timestamp_us; /* when it arrived, since 1970-01-01 UTC */
	uint32_t sequence;     /* from 1; 0: no entry */
	uint8_t address[16];   /* the client's, IPv4 v4-mapped; all 0: the bridge itself */
	uint16_t port;         /* the client's, 0: the bridge itself */
	uint16_t command_id;
	uint16_t command;     /* 0: a parameter write */
	uint16_t result;      /* enum db_result */
	uint32_t duration_us; /* from its arrival to that result */
	uint16_t repeats;     /* how often the same came again */
	/* Arguments, those that the command has. */
	uint16_t number;    /* output_number, output_mask, program_number; or the first parameter */
	int32_t position;   /* target_position, shake_start_position */
	int32_t position_2; /* shake_end_position */
	float real;         /* target_velocity, target_current, shake_frequency */
	uint32_t value;     /* output_value, output_levels, shake_cycles, shake_time, program_delay;
	                     * or the bits of the first parameter's new value */
};

#endif
