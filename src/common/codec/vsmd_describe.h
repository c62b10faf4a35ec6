/* SPDX-License-Identifier: Apache-2.0 */
/* Lines and frames of VSMD drives in words, from either side, on both kinds of bus. Pure; any
 * thread. */
#ifndef DRIVEBRIDGE_CODEC_VSMD_DESCRIBE_H
#define DRIVEBRIDGE_CODEC_VSMD_DESCRIBE_H

#include "codec/description.h"
#include "codec/vsmd_can.h"

/* A host's line, with its line end and, if it was preceded by a separating line end, with that. */
void vsmd_serial_describe_line(const uint8_t *line, size_t length, bool rs485,
                               struct db_description *description);

/* A drive's frame on a serial line. */
void vsmd_serial_describe_reply(const uint8_t *frame, size_t length,
                                struct db_description *description);

void vsmd_can_describe(const struct vsmd_can_style *style, const struct db_can_frame *frame,
                       struct db_description *description);

#endif
