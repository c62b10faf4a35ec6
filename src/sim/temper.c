/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/temper.h"

bool sim_late_bit_follow(struct sim_late_bit *bit, bool real, db_time delay, db_time now)
{
	if (real != bit->real) {
		bit->real = real;
		bit->since = now;
	}
	if (now - bit->since >= delay)
		bit->shown = real;
	return bit->shown;
}
