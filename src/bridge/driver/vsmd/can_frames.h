/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Frames to a drive, as exchanges, and what must come back. Internal to the driver; bus thread
 * only, except where nothing but arguments is looked at.
 *
 * Drives do not acknowledge: every command is sent in one burst with a read of position and status
 * after it, and every register write with a read of that register. A CAN controller keeps the
 * order, so the drive answers the read after the command.
 *
 * The read after a command asks for the registers 1 and 2, the cyclic one for 0 to 2, a probe for
 * one register of the identity or, where a drive does not answer that, for the speed alone or a
 * parameter: the answers differ in their register or length, so that a late answer or a drive's own
 * report is never mistaken for a confirmation. Where drives report position and status alone,
 * reports have the form of the first, so the two change places.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_CAN_FRAMES_H
#define DRIVEBRIDGE_DRIVER_VSMD_CAN_FRAMES_H

#include "driver/vsmd/can_device.h"

/* Maximum number of frames of a burst: seven to begin a shake, and the read. */
#define VSMD_CAN_BURST_MAX 8

/* Empties the exchange. */
void vsmd_can_start_burst(struct db_exchange *exchange, bool repeatable);
/* False when it has no room, or the command cannot be expressed. */
bool vsmd_can_add_frame(struct db_exchange *exchange, const struct db_can_frame *frame);
bool vsmd_can_add_command(const struct vsmd_can_style *style, unsigned drive,
                          const struct vsmd_can_command *command, struct db_exchange *exchange);

/* The frames of a command; none for a mere status request. */
size_t vsmd_can_frames_of(const struct vsmd_command *command, struct vsmd_can_command *frames);

/* Reads that end a burst, split where the drive answers no long read. */
enum db_step vsmd_can_add_read(struct db_conversation *talk, enum vsmd_can_code code,
                               unsigned first, unsigned count);
/* Of position and status word, and the speed before them if `speed`. */
enum db_step vsmd_can_add_status(struct db_conversation *talk, bool speed);
/* A register of the identity other than the probe's. No report begins with the speed alone. */
unsigned vsmd_can_guard_of(const struct db_device *device);
/* Of registers that the drive may not have: then only the read after it is answered. */
enum db_step vsmd_can_add_guarded(struct db_conversation *talk, enum vsmd_can_code code,
                                  unsigned first, unsigned count);

/* Whole exchanges. */
enum db_step vsmd_can_send_command(struct db_conversation *talk, const struct vsmd_command *command,
                                   bool repeatable);
enum db_step vsmd_can_read(struct db_conversation *talk, enum vsmd_read what);

/* True if it answers probes, but none for its identity. */
bool vsmd_can_lacks_identity(const struct db_device *device);

/* True if the cyclic read has no speed. */
bool vsmd_can_lacks_speed(const struct db_device *device);

/* Length of an answer of this number of registers, as wire_time() of transports counts it. */
size_t vsmd_can_answer_length(unsigned registers);

/* Prepares for the answer to this exchange: the read at its end determines it. */
bool vsmd_can_expect_answer(struct db_device *device, const struct db_exchange *exchange);
/* Takes a part of it. DONE: it is complete; MORE and IGNORE as in struct db_driver. */
enum db_step vsmd_can_collect_answer(struct db_device *device,
                                     const struct vsmd_can_message *message);

#endif
