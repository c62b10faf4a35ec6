/* SPDX-License-Identifier: Apache-2.0 */
/* What VSMD drives say of themselves on either kind of bus, in words. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_VSMD_DESCRIBE_H
#define DRIVEBRIDGE_CODEC_VSMD_DESCRIBE_H

#include "codec/description.h"

void vsmd_describe_position(struct db_description *description, int32_t position);
void vsmd_describe_velocity(struct db_description *description, float velocity);
void vsmd_describe_status(struct db_description *description, uint32_t status);

#endif
