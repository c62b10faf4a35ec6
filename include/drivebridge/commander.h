/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The door of one drive: every write of a PLC passes here. It keeps the arguments, remembers the
 * command ids, checks ranges, hands requests to the bus and answers the client when the bus is done
 * or the client's patience ends. Network thread only; time is passed in.
 *
 * command_id: 0 executes each time. Another executes when it differs from the drive's last one; the
 * same again is not executed and gets the stored answer. The first one after the start is only taken
 * as the baseline (04, result restarted). An id is used up by every outcome but busy (06): that one
 * may be sent again. stop, quick_stop and disable always execute.
 *
 * A write of `command` that does not cover `command_id` (a single-register write) uses the id kept
 * from an earlier write if it is still unused. If the kept id is the last one used, the write is
 * taken for a repetition when command and arguments are the same as that id's, and else executes
 * like id 0.
 */
#ifndef DRIVEBRIDGE_COMMANDER_H
#define DRIVEBRIDGE_COMMANDER_H

#include "drivebridge/command.h"
#include "drivebridge/config.h"
#include "drivebridge/driver.h"
#include "drivebridge/server.h"

struct db_commander;

struct db_commander_ops {
	/* False: the bus's queue is full. */
	bool (*submit)(void *context, const struct db_request *request);
	/* Ends a write that db_commander_...() answered with DB_WRITE_LATER. */
	void (*answer)(void *context, struct db_write_token token, uint8_t exception);
};

/* The command block of the register table. */
struct db_command_block {
	uint16_t command_id;
	uint16_t command;
	struct db_args args;
};

/* What the result registers show. */
struct db_command_result {
	uint16_t id;             /* of the latest command */
	uint16_t command;        /* the latest command */
	enum db_result result;   /* how it ended, or PENDING */
	enum db_result write_result; /* of the latest write of any kind */
	uint32_t duration_us;    /* of the latest command, from the write to its end */
	uint16_t active_command; /* of the oldest one that has not ended, 0 = none */
	unsigned pending;        /* how many have not ended */
};

/*
 * `axis_index` is the drive's place among its bus's drives, `number` its place in the configuration.
 * Everything passed in must outlive the commander. Null when out of memory.
 */
struct db_commander *db_commander_new(const struct db_modbus_config *config,
                                      const struct db_driver *driver, uint16_t axis_index,
                                      uint16_t number, const struct db_commander_ops *ops,
                                      void *context);
void db_commander_free(struct db_commander *commander);

/* Which drive (its `number`) a completion's ticket belongs to. */
uint16_t db_commander_number(uint32_t ticket);

const struct db_command_block *db_commander_block(const struct db_commander *commander);
void db_commander_result(const struct db_commander *commander, struct db_command_result *result);

/*
 * A write into the command block. `block` is the whole block as it would be after the write;
 * `with_id` and `with_command` tell whether the write covered those registers. `status` is the
 * drive's status word. Returns 0, an exception, or DB_WRITE_LATER.
 */
int db_commander_write(struct db_commander *commander, const struct db_command_block *block,
                       bool with_id, bool with_command, uint32_t status,
                       struct db_write_token token, db_time now);

/* A command beside the block, with arguments of its own and without id (coils). */
int db_commander_command(struct db_commander *commander, enum db_command command,
                         const struct db_args *args, uint32_t status, struct db_write_token token,
                         db_time now);

/* Parameter writes, at most DB_SETTINGS_MAX of them, values of the right type; all or none is sent. */
int db_commander_settings(struct db_commander *commander, const struct db_setting *settings,
                          size_t count, uint32_t status, struct db_write_token token, db_time now);

/* The bus is done with a request. */
void db_commander_complete(struct db_commander *commander, const struct db_completion *completion);

/* When db_commander_expire() wants to be called; DB_TIME_NEVER when nobody waits. */
db_time db_commander_deadline(const struct db_commander *commander);
void db_commander_expire(struct db_commander *commander, db_time now);

#endif
