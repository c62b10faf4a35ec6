/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Where a simulated bus meets its host: a pseudo terminal, a real serial port, or a CAN network
 * interface. Raw and non-blocking.
 */
#ifndef DRIVEBRIDGE_SIM_PORT_H
#define DRIVEBRIDGE_SIM_PORT_H

#include <limits.h>
#include <stdbool.h>
#include <sys/types.h>

struct sim_port {
	int fd;              /* to read and write, and to wait on */
	int slave;           /* pty: kept open so that the host may come and go; else -1 */
	char host[PATH_MAX]; /* the device the host opens */
	char link[PATH_MAX]; /* symbolic link to it, "" = none */
};

/* Whether a device name means "make a pty". */
bool sim_port_is_pty(const char *device);

/* The speed that the host has set at its end of a pty; 0: none that is known. */
unsigned sim_port_host_baud(const struct sim_port *port);

/*
 * Opens device ("pty" or a path). A pty may be opened by the members of `group` (mode 0660, as
 * serial ports have it), or by whom the system lets when that is null. Makes the symbolic link when
 * link is not null; an old symbolic link is replaced, any other file is not (-EEXIST). 0 or a
 * negative errno (-EINVAL: no such baud rate, -EPERM: this process is no member of the group); on
 * error nothing is left open.
 */
int sim_port_open(struct sim_port *port, const char *device, unsigned baud, const gid_t *group,
                  const char *link);

/* Opens a raw socket on a CAN interface; each read or write is one frame. 0 or a negative errno. */
int sim_port_open_can(struct sim_port *port, const char *interface);

/* Removes the link if it is still ours. */
void sim_port_close(struct sim_port *port);

#endif
