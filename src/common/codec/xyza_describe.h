/* SPDX-License-Identifier: Apache-2.0 */
/* Frames of XYZA controllers in words. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_XYZA_DESCRIBE_H
#define DRIVEBRIDGE_CODEC_XYZA_DESCRIBE_H

#include "codec/description.h"

/* A whole frame of the host (`sent`) or of a controller. */
void xyza_describe(const uint8_t *frame, size_t length, bool sent,
                   struct db_description *description);

#endif
