/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/servo_dialect.h"

#include <math.h>
#include <string.h>

static const char digits[] = "0123456789abcdef";

uint16_t sim_servo_dialect_status(const struct sim_servo_dialect *dialect, unsigned bits,
                                  bool moving)
{
	unsigned word = 0;

	for (unsigned bit = 0; bit < SIM_SERVO_PLACES; bit++) {
		const char *digit = strchr(digits, dialect->places[bit]);

		if ((bits >> bit & 1) != 0 && digit)
			word |= 1u << (digit - digits);
	}
	if (moving && dialect->moving_bit >= 0)
		word |= 1u << dialect->moving_bit;
	return (uint16_t)(word ^ dialect->inverted);
}

double sim_servo_dialect_turn(const struct sim_servo_dialect *dialect, double counts)
{
	return dialect->mirrored ? -counts : counts;
}

int16_t sim_servo_dialect_steps(double value, double step)
{
	double steps = value / step;

	return (int16_t)lrint(steps > INT16_MAX  ? INT16_MAX :
	                      steps < -INT16_MAX ? -INT16_MAX :
	                                           steps);
}
