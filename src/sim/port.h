/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host's end of a simulated bus: a pseudo terminal, a real serial port, or a CAN network
 * interface. Raw and non-blocking.
 */
#ifndef DRIVEBRIDGE_SIM_PORT_H
#define DRIVEBRIDGE_SIM_PORT_H

#include <limits.h>
#include <stdbool.h>
#include <sys/types.h>

struct sim_port {
	int fd; /* to read, write and poll */
	/* pty: kept open so that the host may open and close its end; else -1 */
	int slave;
	char host[PATH_MAX]; /* the device that the host opens */
	char link[PATH_MAX]; /* symbolic link to it, "": none */
};

/* The speed that the host has set at its end of a pty; 0: no known one. */
unsigned sim_port_host_baud(const struct sim_port *port);

/*
 * Opens a device ("pty" or a path). A pty may be opened by the members of `group` (mode 0660, like
 * serial ports); if that is null, with the system's default rights. Makes the symbolic link when
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
