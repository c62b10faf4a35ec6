/* SPDX-License-Identifier: Apache-2.0 */
/* Lines and frames of VSMD on serial lines in words. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_VSMD_SERIAL_DESCRIBE_H
#define DRIVEBRIDGE_CODEC_VSMD_SERIAL_DESCRIBE_H

#include "codec/description.h"

/* A host's line, with its line end and, if it was preceded by a separating line end, with that. */
void vsmd_serial_describe_line(const uint8_t *line, size_t length, bool rs485,
                               struct db_description *description);

/* A drive's frame. */
void vsmd_serial_describe_reply(const uint8_t *frame, size_t length,
                                struct db_description *description);

#endif
