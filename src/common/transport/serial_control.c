/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/transport_private.h"

#include <errno.h>
#include <linux/serial.h>
#include <sys/ioctl.h>

enum db_port_latency db_serial_lower_latency(int fd, db_serial_control_fn *control)
{
	struct serial_struct settings = { 0 };
	const int low = (int)ASYNC_LOW_LATENCY;

	if (control(fd, TIOCGSERIAL, &settings) != 0)
		return DB_PORT_LATENCY_REFUSED;
	if (!(settings.flags & low)) {
		/* The only setting here that is open to every user. */
		settings.flags |= low;
		if (control(fd, TIOCSSERIAL, &settings) != 0 ||
		    control(fd, TIOCGSERIAL, &settings) != 0)
			return DB_PORT_LATENCY_REFUSED;
	}
	return settings.flags & low ? DB_PORT_LATENCY_LOW : DB_PORT_LATENCY_REFUSED;
}

/* The flags that select the level of RTS while the port sends, and enable the mode. */
#define RS485_MODE (SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND | SER_RS485_RTS_AFTER_SEND)

int db_serial_set_direction(int fd, const struct db_bus_config *config,
                            db_serial_control_fn *control)
{
	bool inverted = config->direction == DB_DIRECTION_RTS_INVERTED;
	struct serial_rs485 wanted = {
		.flags = SER_RS485_ENABLED |
		         (inverted ? SER_RS485_RTS_AFTER_SEND : SER_RS485_RTS_ON_SEND),
		.delay_rts_before_send = config->rts_before_ms,
		.delay_rts_after_send = config->rts_after_ms,
	};
	struct serial_rs485 kept = { 0 };

	if (config->direction == DB_DIRECTION_ADAPTER)
		return 0;
	if (control(fd, TIOCSRS485, &wanted) != 0 || control(fd, TIOCGRS485, &kept) != 0)
		return errno == EINVAL || errno == EOPNOTSUPP ? -ENOTTY : -errno;
	/* Drivers clear flags that they do not support. A wrong level would drive the line all the
	 * time. */
	if ((kept.flags & RS485_MODE) != (wanted.flags & RS485_MODE) ||
	    kept.delay_rts_before_send < wanted.delay_rts_before_send ||
	    kept.delay_rts_after_send < wanted.delay_rts_after_send)
		return -EINVAL;
	return 0;
}
