/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_describe.h"

#include "codec/vsmd.h"

void vsmd_describe_position(struct db_description *description, int32_t position)
{
	db_description_add(description, "position %ld pulses", (long)position);
}

void vsmd_describe_velocity(struct db_description *description, float velocity)
{
	db_description_add(description, "velocity ");
	db_description_add_float(description, velocity, "pulses/s");
}

void vsmd_describe_status(struct db_description *description, uint32_t status)
{
	db_description_add(description, "status ");
	db_description_add_bits(description, vsmd_status_bits, VSMD_STATUS_BITS, status);
}
