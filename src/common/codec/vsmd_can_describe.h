/* SPDX-License-Identifier: Apache-2.0 */
/* Frames of VSMD on CAN in words, from either side. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_VSMD_CAN_DESCRIBE_H
#define DRIVEBRIDGE_CODEC_VSMD_CAN_DESCRIBE_H

#include "codec/description.h"
#include "codec/vsmd_can.h"

void vsmd_can_describe(const struct vsmd_can_style *style, const struct db_can_frame *frame,
                       struct db_description *description);

#endif
