/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/port.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

static const struct {
	unsigned baud;
	speed_t speed;
} speeds[] = {
	{ 2400, B2400 },     { 4800, B4800 },     { 9600, B9600 },     { 19200, B19200 },
	{ 38400, B38400 },   { 57600, B57600 },   { 115200, B115200 }, { 230400, B230400 },
	{ 460800, B460800 }, { 500000, B500000 }, { 576000, B576000 }, { 921600, B921600 },
};

unsigned sim_port_host_baud(const struct sim_port *port)
{
	struct termios tio;

	if (port->slave < 0 || tcgetattr(port->slave, &tio) != 0)
		return 0;
	for (size_t i = 0; i < sizeof(speeds) / sizeof(speeds[0]); i++) {
		if (speeds[i].speed == cfgetospeed(&tio))
			return speeds[i].baud;
	}
	return 0;
}

static int make_raw(int fd, unsigned baud)
{
	struct termios tio;

	if (tcgetattr(fd, &tio) != 0)
		return -errno;
	cfmakeraw(&tio);
	tio.c_cflag |= CLOCAL | CREAD;
	tio.c_cflag &= ~(tcflag_t)(CRTSCTS | CSTOPB);
	/* A pty has no rate of its own; any host setting is accepted. */
	for (size_t i = 0; baud != 0; i++) {
		if (i == sizeof(speeds) / sizeof(speeds[0]))
			return -EINVAL;
		if (speeds[i].baud != baud)
			continue;
		if (cfsetspeed(&tio, speeds[i].speed) != 0)
			return -errno;
		break;
	}
	return tcsetattr(fd, TCSANOW, &tio) != 0 ? -errno : 0;
}

static int open_pty(struct sim_port *port, const gid_t *group)
{
	port->fd = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (port->fd < 0)
		return -errno;
	if (grantpt(port->fd) != 0 || unlockpt(port->fd) != 0)
		return -errno;
	if (ptsname_r(port->fd, port->host, sizeof(port->host)) != 0)
		return -errno;
	port->slave = open(port->host, O_RDWR | O_NOCTTY | O_CLOEXEC);
	if (port->slave < 0)
		return -errno;
	if (group && (fchown(port->slave, (uid_t)-1, *group) != 0 ||
	              fchmod(port->slave, S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP) != 0))
		return -errno;
	return make_raw(port->slave, 0);
}

static int make_link(struct sim_port *port, const char *link)
{
	struct stat status;

	if (strlen(link) >= sizeof(port->link))
		return -ENAMETOOLONG;
	if (lstat(link, &status) == 0) {
		if (!S_ISLNK(status.st_mode))
			return -EEXIST;
		if (unlink(link) != 0)
			return -errno;
	}
	if (symlink(port->host, link) != 0)
		return -errno;
	strcpy(port->link, link);
	return 0;
}

int sim_port_open(struct sim_port *port, const char *device, unsigned baud, const gid_t *group,
                  const char *link)
{
	int result;

	*port = (struct sim_port){ .fd = -1, .slave = -1 };
	if (strcmp(device, "pty") == 0) {
		result = open_pty(port, group);
	} else if (strlen(device) >= sizeof(port->host)) {
		result = -ENAMETOOLONG;
	} else {
		strcpy(port->host, device);
		port->fd = open(device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
		result = port->fd < 0 ? -errno : make_raw(port->fd, baud);
	}
	if (result == 0 && link)
		result = make_link(port, link);
	if (result != 0)
		sim_port_close(port);
	return result;
}

int sim_port_open_can(struct sim_port *port, const char *interface)
{
	struct sockaddr_can address = { .can_family = AF_CAN };
	unsigned index = if_nametoindex(interface);

	*port = (struct sim_port){ .fd = -1, .slave = -1 };
	snprintf(port->host, sizeof(port->host), "%s", interface);
	if (index == 0)
		return -ENODEV;
	address.can_ifindex = (int)index;
	port->fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
	if (port->fd < 0)
		return -errno;
	if (bind(port->fd, (const struct sockaddr *)&address, sizeof(address)) != 0) {
		int error = errno;

		sim_port_close(port);
		return -error;
	}
	return 0;
}

void sim_port_close(struct sim_port *port)
{
	char target[PATH_MAX];
	ssize_t length;

	if (port->link[0] != '\0') {
		length = readlink(port->link, target, sizeof(target));
		if (length == (ssize_t)strlen(port->host) &&
		    memcmp(target, port->host, (size_t)length) == 0)
			(void)unlink(port->link);
		port->link[0] = '\0';
	}
	if (port->slave >= 0)
		(void)close(port->slave);
	if (port->fd >= 0)
		(void)close(port->fd);
	port->fd = -1;
	port->slave = -1;
}
