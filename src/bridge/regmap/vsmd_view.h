/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive seen through the register map of the vendor's own Modbus models (vsmd_layout.h). Commands
 * go to the drive's commander like those of the neutral view, so watchdog, latch, limits and result
 * registers are the same; they carry no id, so each write executes. Internal to src/bridge/regmap.
 *
 * - While the command register holds 0301 or 0302, a write of pos starts that move; a write of both
 *   executes once.
 * - spd, acc and the like are the drive's own parameters; moves run at its spd.
 * - A write of parameters and a command together first writes the parameters; the command follows
 *   when the drive has confirmed them, and never after a stop that came in between. A stop goes
 *   first instead. Until the command has followed, other writes to the drive are answered 06.
 * - A parameter that this model of the drive does not have reads as 0 and takes 0, like a reserved
 *   register, so that blocks can be read and written whole.
 * - A write answered with an exception at once stores nothing, nor does a stop of a client that is
 *   not in control.
 */
#ifndef DRIVEBRIDGE_REGMAP_VSMD_VIEW_H
#define DRIVEBRIDGE_REGMAP_VSMD_VIEW_H

#include "drivebridge/command.h"
#include "drivebridge/server.h"

struct db_view_drive;
struct db_vsmd_view;

/* Values that the bridge stores for one drive. To be freed with free(). Null when out of memory. */
struct db_vsmd_view *db_vsmd_view_new(const struct db_drive_config *config);

/* As db_backend's read and write, for a drive that has a vsmd_view. */
uint8_t db_vsmd_view_read(const struct db_view_drive *drive, enum db_table table, uint16_t address,
                          uint16_t count, uint16_t *values);
int db_vsmd_view_write(struct db_view_drive *drive, const struct db_client *client,
                       enum db_table table, uint16_t address, uint16_t count,
                       const uint16_t *values, struct db_write_token token);

/* As db_backend's write_same. */
int db_vsmd_view_write_same(struct db_view_drive *drive, const struct db_client *client,
                            uint16_t address, uint16_t value, struct db_write_token token);

/*
 * Called by the drive's commander and for the bus: a request was submitted to the bus; a write is
 * to be answered with *result (false: not now); the bus ended a request, and the commander was
 * notified, so that a command which waited for it is sent. `view` may be null.
 */
void db_vsmd_view_note_request(struct db_vsmd_view *view, const struct db_request *request);
bool db_vsmd_view_take_answer(struct db_vsmd_view *view, struct db_write_token token,
                              enum db_result *result);
void db_vsmd_view_send_command(struct db_view_drive *drive, uint32_t ticket, enum db_result result,
                               db_time now);

#endif
