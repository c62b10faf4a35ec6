/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/serial.h"

#include "transport/transport_private.h"

#include <errno.h>
#include <fcntl.h>
#include <libserialport.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

struct db_serial {
	int fd;
	int guard;            /* carries the lock of a port that libserialport opens; -1 */
	struct sp_port *port; /* null for a pty, whose descriptor is ours to close */
	enum db_port_latency latency;
};

/*
 * Two masters on one bus would receive each other's answers. TIOCEXCL excludes all programs except
 * those of root; the lock excludes every program that uses it, as this one and most terminal
 * programs do. It is taken before anything is set: that would disturb the bus of the program that
 * has the port.
 */
static int lock_port(int fd)
{
	if (flock(fd, LOCK_EX | LOCK_NB) == 0)
		return 0;
	return errno == EWOULDBLOCK ? -EBUSY : -errno;
}

static int open_pty(const char *path, const struct db_bus_config *config, struct db_serial *serial)
{
	struct termios settings;
	int error;

	serial->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (serial->fd < 0)
		return -errno;
	error = lock_port(serial->fd);
	if (error != 0)
		return error;
	if (tcgetattr(serial->fd, &settings) != 0)
		return -errno;
	cfmakeraw(&settings);
	settings.c_cc[VMIN] = 0;
	settings.c_cc[VTIME] = 0;
	/* Its other end may read it. An unknown speed leaves it unchanged. */
	(void)cfsetspeed(&settings, config->baud);
	if (tcsetattr(serial->fd, TCSANOW, &settings) != 0)
		return -errno;
	tcflush(serial->fd, TCIOFLUSH);
	return 0;
}

/* libserialport reports the cause of SP_ERR_FAIL in errno, of the others in its own code. */
static int sp_errno(enum sp_return code)
{
	switch (code) {
	case SP_OK:
		return 0;
	case SP_ERR_ARG:
		return -EINVAL;
	case SP_ERR_MEM:
		return -ENOMEM;
	case SP_ERR_SUPP:
		return -EOPNOTSUPP;
	default:
		return errno != 0 ? -errno : -EIO;
	}
}

static int control(int fd, unsigned long request, void *argument)
{
	return ioctl(fd, request, argument);
}

static int open_port(const char *path, const struct db_bus_config *config, struct db_serial *serial)
{
	enum sp_parity parity = config->parity == DB_PARITY_EVEN ? SP_PARITY_EVEN :
	                        config->parity == DB_PARITY_ODD  ? SP_PARITY_ODD :
	                                                           SP_PARITY_NONE;
	enum sp_return code;
	int error;

	serial->guard = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (serial->guard < 0)
		return -errno;
	error = lock_port(serial->guard);
	if (error != 0)
		return error;
	errno = 0;
	code = sp_get_port_by_name(path, &serial->port);
	if (code == SP_OK)
		code = sp_open(serial->port, SP_MODE_READ_WRITE);
	if (code == SP_OK)
		code = sp_set_baudrate(serial->port, (int)config->baud);
	if (code == SP_OK)
		code = sp_set_bits(serial->port, 8);
	if (code == SP_OK)
		code = sp_set_parity(serial->port, parity);
	if (code == SP_OK)
		code = sp_set_stopbits(serial->port, (int)config->stop_bits);
	if (code == SP_OK)
		code = sp_set_flowcontrol(serial->port, SP_FLOWCONTROL_NONE);
	if (code == SP_OK)
		code = sp_get_port_handle(serial->port, &serial->fd);
	if (code != SP_OK)
		return sp_errno(code);
	if (ioctl(serial->fd, TIOCEXCL) != 0)
		return -errno;
	error = db_serial_set_direction(serial->fd, config, control);
	if (error != 0)
		return error;
	serial->latency = db_serial_lower_latency(serial->fd, control);
	sp_flush(serial->port, SP_BUF_BOTH);
	return 0;
}

int db_serial_open(const struct db_bus_config *config, struct db_serial **serial)
{
	struct db_serial *made;
	char path[PATH_MAX];
	int error;

	/* Names under /dev/serial/by-id are links, which libserialport does not follow. */
	if (!realpath(config->device, path))
		return -errno;
	made = calloc(1, sizeof(*made));
	if (!made)
		return -ENOMEM;
	made->fd = -1;
	made->guard = -1;
	if (strncmp(path, "/dev/pts/", 9) == 0)
		error = open_pty(path, config, made);
	else
		error = open_port(path, config, made);
	if (error != 0) {
		db_serial_close(made);
		return error;
	}
	*serial = made;
	return 0;
}

void db_serial_close(struct db_serial *serial)
{
	if (!serial)
		return;
	/* Does not wait for bytes that a stuck port did not take: that can last half a minute. */
	if (serial->fd >= 0)
		tcflush(serial->fd, TCOFLUSH);
	if (serial->port) {
		sp_close(serial->port);
		sp_free_port(serial->port);
	} else if (serial->fd >= 0) {
		close(serial->fd);
	}
	if (serial->guard >= 0)
		close(serial->guard);
	free(serial);
}

enum db_port_latency db_serial_latency(const struct db_serial *serial)
{
	/* gcc's analyzer: no error is a port; it does not see where db_serial_open() gives it. */
	return serial->latency;
}

int db_serial_fd(const struct db_serial *serial)
{
	return serial->fd;
}

static ssize_t moved(ssize_t count)
{
	if (count >= 0)
		return count;
	if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)
		return 0;
	return -errno;
}

ssize_t db_serial_read(struct db_serial *serial, void *bytes, size_t size)
{
	return moved(read(serial->fd, bytes, size));
}

ssize_t db_serial_write(struct db_serial *serial, const void *bytes, size_t length)
{
	return moved(write(serial->fd, bytes, length));
}

db_time db_serial_wire_time(const struct db_bus_config *config, size_t bytes)
{
	unsigned bits = 9 + config->stop_bits + (config->parity != DB_PARITY_NONE ? 1 : 0);

	return (db_time)bytes * (db_time)bits * DB_NS_PER_S / (db_time)config->baud;
}

struct db_bus_config db_serial_port_of_line(const struct db_rtu_config *line)
{
	return (struct db_bus_config){
		.name = line->name,
		.device = line->device,
		.baud = line->baud,
		.parity = line->parity,
		.stop_bits = line->stop_bits,
		.line = DB_LINE_RS485,
		.direction = line->direction,
		.rts_before_ms = line->rts_before_ms,
		.rts_after_ms = line->rts_after_ms,
		.source_file = line->source_file,
		.source_line = line->source_line,
	};
}

/* --- as a transport --------------------------------------------------------------------------- */

struct db_port {
	struct db_serial *serial;
	struct db_port_health health;
};

static int port_open(const struct db_bus_config *bus, const struct db_can_filter *filters,
                     size_t filter_count, db_time now, struct db_port **port)
{
	struct db_port *made = calloc(1, sizeof(*made));
	int error;

	(void)filters;
	(void)filter_count;
	(void)now;
	if (!made)
		return -ENOMEM;
	error = db_serial_open(bus, &made->serial);
	if (error != 0) {
		free(made);
		return error;
	}
	made->health.up = true;
	made->health.latency = db_serial_latency(made->serial);
	*port = made;
	return 0;
}

static void port_close(struct db_port *port)
{
	if (!port)
		return;
	db_serial_close(port->serial);
	free(port);
}

static int port_fd(const struct db_port *port)
{
	return db_serial_fd(port->serial);
}

/* By VMIN, which poll() uses where VTIME is 0; for a non-blocking descriptor read() ignores it. */
static bool port_gather(struct db_port *port, size_t bytes)
{
	int fd = db_serial_fd(port->serial);
	struct termios settings;

	if (bytes > (cc_t)-1 || tcgetattr(fd, &settings) != 0)
		return false;
	settings.c_cc[VMIN] = (cc_t)bytes;
	settings.c_cc[VTIME] = 0;
	return tcsetattr(fd, TCSANOW, &settings) == 0;
}

static const struct db_port_health *port_health(const struct db_port *port)
{
	return &port->health;
}

static ssize_t port_read(struct db_port *port, void *bytes, size_t size, db_time now)
{
	(void)now;
	return db_serial_read(port->serial, bytes, size);
}

static ssize_t port_write(struct db_port *port, const void *bytes, size_t length, db_time now)
{
	(void)now;
	return db_serial_write(port->serial, bytes, length);
}

static db_time port_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                              size_t request_length, size_t answer_length)
{
	(void)request;
	return db_serial_wire_time(bus, request_length + answer_length);
}

const struct db_transport db_transport_serial = {
	.name = "serial",
	.medium = DB_MEDIUM_SERIAL,
	.open = port_open,
	.close = port_close,
	.holder = db_port_holder,
	.fd = port_fd,
	.read = port_read,
	.write = port_write,
	.gather = port_gather,
	.health = port_health,
	.wire_time = port_wire_time,
};
