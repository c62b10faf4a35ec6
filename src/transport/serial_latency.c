/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/serial_latency.h"

#include <linux/serial.h>
#include <sys/ioctl.h>

enum db_port_latency db_serial_lower_latency(int fd, db_serial_control_fn *control)
{
	struct serial_struct settings = { 0 };
	const int low = (int)ASYNC_LOW_LATENCY;

	if (control(fd, TIOCGSERIAL, &settings) != 0)
		return DB_PORT_LATENCY_REFUSED;
	if (!(settings.flags & low)) {
		/* Of what may be set here this is free for every user. */
		settings.flags |= low;
		if (control(fd, TIOCSSERIAL, &settings) != 0 ||
		    control(fd, TIOCGSERIAL, &settings) != 0)
			return DB_PORT_LATENCY_REFUSED;
	}
	return settings.flags & low ? DB_PORT_LATENCY_LOW : DB_PORT_LATENCY_REFUSED;
}
