/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether a command may go to the drive, or was there already: command ids, documented ranges, the
 * limits of the configuration and the latch. Nothing here hands anything to the bus. Network thread
 * only.
 */
#ifndef DRIVEBRIDGE_AXIS_ADMISSION_H
#define DRIVEBRIDGE_AXIS_ADMISSION_H

#include "axis/writers.h"
#include "drivebridge/commander.h"

/*
 * The id that a write stands for: the written one, or for a write of `command` alone the kept one,
 * unless that was used already.
 */
uint16_t db_admission_id(const struct db_writer *writer, const struct db_command_write *write);

/*
 * The execution that a write repeats: of the id that was used last, or for one of `command` alone
 * (`bare`) whose kept id was used, of what was executed last, if it asks for the same. Null: it
 * repeats nothing.
 */
const struct db_used_id *db_admission_find_repeated(const struct db_writer *writer,
                                                    const struct db_command_block *block,
                                                    uint16_t id, bool bare);

/* What may be said before the drive is asked; OK: it is to be asked. Without a writer there is no
 * id. */
enum db_result db_admission_permit(struct db_commander *commander, struct db_writer *writer,
                                   const struct db_command_block *block, uint16_t id);

/* The same of a command that is to wait, and of values for parameters. Which limit would be broken
 * is then shown. */
enum db_result db_admission_permit_staged(struct db_commander *commander, struct db_writer *writer,
                                          const struct db_command_block *block);
enum db_result db_admission_permit_settings(struct db_commander *commander,
                                            struct db_writer *writer,
                                            const struct db_setting *settings, size_t count);

/* The drive has such a command. */
bool db_admission_is_supported(const struct db_commander *commander, uint16_t command);
/* It ends the watchdog's latch, which there is. */
bool db_admission_clears_latch(const struct db_commander *commander, enum db_command command);

#endif
