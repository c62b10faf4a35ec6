/* SPDX-License-Identifier: Apache-2.0 */
/* Descriptions of the contents of VSMD drives' answers on both kinds of bus. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_VSMD_DESCRIBE_H
#define DRIVEBRIDGE_CODEC_VSMD_DESCRIBE_H

#include "codec/description.h"

void vsmd_describe_position(struct db_description *description, int32_t position);
void vsmd_describe_velocity(struct db_description *description, float velocity);
void vsmd_describe_status(struct db_description *description, uint32_t status);

#endif
