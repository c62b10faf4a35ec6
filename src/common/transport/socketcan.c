/* SPDX-License-Identifier: Apache-2.0 */
/* A CAN interface of the kernel, by name. Its bit rate and restarts are set at the interface. */
#include "codec/can.h"
#include "drivebridge/transport.h"
#include "transport/transport_private.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define FRAME_SIZE sizeof(struct db_can_frame)

_Static_assert(sizeof(struct db_can_frame) == sizeof(struct can_frame) &&
                       offsetof(struct db_can_frame, id) == offsetof(struct can_frame, can_id) &&
                       offsetof(struct db_can_frame, length) == offsetof(struct can_frame, len) &&
                       offsetof(struct db_can_frame, data) == offsetof(struct can_frame, data),
               "frames go to the socket as they are");
_Static_assert(sizeof(struct db_can_filter) == sizeof(struct can_filter) &&
                       offsetof(struct db_can_filter, id) == offsetof(struct can_filter, can_id) &&
                       offsetof(struct db_can_filter, mask) ==
                               offsetof(struct can_filter, can_mask),
               "filters go to the socket as they are");
_Static_assert(DB_CAN_EXTENDED == CAN_EFF_FLAG && DB_CAN_REMOTE == CAN_RTR_FLAG &&
                       DB_CAN_ERROR == CAN_ERR_FLAG,
               "flags are the kernel's");

/* A socket can always be written while the interface's queue after it is full, so poll() does not
 * show when there is room. Half a millisecond is four frames at 1 Mbit/s; the queue has ten. */
#define WRITE_RETRY (500 * DB_NS_PER_US)

/* Interval of checks while bus off: a restart that was not reported (the report itself was lost) is
 * found by this. */
#define STATE_INTERVAL DB_NS_PER_S

#define CAN_FILTERS_MAX 16

struct db_port {
	int fd;
	unsigned index; /* index of the interface */
	struct db_can_filter filters[CAN_FILTERS_MAX];
	size_t filter_count;
	int lost; /* negative errno, reported after everything received before it */
	db_time ask_state_at;
	struct db_port_health health;
};

/* --- health ----------------------------------------------------------------------------------- */

static void set_passive(struct db_port_health *health, bool passive)
{
	if (passive && !health->error_passive)
		health->error_passives++;
	health->error_passive = passive;
}

static void go_bus_off(struct db_port *port, db_time now)
{
	port->health.up = false;
	port->health.error = ENETRESET;
	port->health.bus_offs++;
	port->ask_state_at = now + STATE_INTERVAL;
}

static void come_back(struct db_port_health *health)
{
	health->up = true;
	health->error = 0;
	health->error_warning = false;
	health->error_passive = false;
}

/* Takes an error frame; it may contain several reports. */
static void note_error(struct db_port *port, const struct db_can_frame *frame, db_time now)
{
	struct db_port_health *health = &port->health;

	if (frame->id & CAN_ERR_LOSTARB)
		health->arbitration_lost++;
	if (frame->id & (CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSERROR))
		health->line_errors++;
	if (frame->id & CAN_ERR_CRTL) {
		/* The controller's error counters passed a limit, or it lost a frame. */
		if (frame->data[1] & (CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW))
			health->overflows++;
		if (frame->data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) {
			set_passive(health, true);
			health->error_warning = true;
		} else if (frame->data[1] & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) {
			set_passive(health, false);
			health->error_warning = true;
		} else if (frame->data[1] & CAN_ERR_CRTL_ACTIVE) {
			set_passive(health, false);
			health->error_warning = false;
		}
	}
	if (frame->id & CAN_ERR_RESTARTED)
		come_back(health);
	if (frame->id & CAN_ERR_BUSOFF && health->up)
		go_bus_off(port, now);
}

/* Takes the state before the port was opened. */
static void note_link(struct db_port *port, db_time now)
{
	struct db_can_link link;

	if (!db_can_link_read(port->index, &link))
		return;
	port->health.bitrate = link.bitrate;
	if (!link.has_state)
		return;
	port->health.error_warning = link.state == CAN_STATE_ERROR_WARNING ||
	                             link.state == CAN_STATE_ERROR_PASSIVE;
	set_passive(&port->health, link.state == CAN_STATE_ERROR_PASSIVE);
	if (link.state == CAN_STATE_BUS_OFF)
		go_bus_off(port, now);
}

/* --- opening ---------------------------------------------------------------------------------- */

static void port_pass(struct db_port *port, bool everything)
{
	const struct db_can_filter all = { 0, 0 };

	/* If it is refused, some frames are not received, or some more are. */
	if (everything || port->filter_count == 0)
		(void)setsockopt(port->fd, SOL_CAN_RAW, CAN_RAW_FILTER, &all, sizeof(all));
	else
		(void)setsockopt(port->fd, SOL_CAN_RAW, CAN_RAW_FILTER, port->filters,
		                 (socklen_t)(port->filter_count * sizeof(port->filters[0])));
}

static int open_socket(struct db_port *port, const char *interface,
                       const struct db_can_filter *filters, size_t filter_count)
{
	const can_err_mask_t errors = CAN_ERR_LOSTARB | CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_ACK |
	                              CAN_ERR_BUSOFF | CAN_ERR_BUSERROR | CAN_ERR_RESTARTED;
	struct sockaddr_can address = { .can_family = AF_CAN };
	struct ifreq request = { 0 };

	port->index = if_nametoindex(interface);
	if (port->index == 0)
		return -errno;
	port->fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
	if (port->fd < 0)
		return -errno;
	strncpy(request.ifr_name, interface, sizeof(request.ifr_name) - 1);
	if (ioctl(port->fd, SIOCGIFFLAGS, &request) != 0)
		return -errno;
	if (!(request.ifr_flags & IFF_UP))
		return -ENETDOWN;
	if (filter_count > CAN_FILTERS_MAX)
		return -EINVAL;
	/* Before bind(), so that nothing unwanted ever waits in the socket. */
	if (filter_count > 0 && setsockopt(port->fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters,
	                                   (socklen_t)(filter_count * sizeof(*filters))) != 0)
		return -errno;
	if (setsockopt(port->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof(errors)) != 0)
		return -errno;
	if (filter_count > 0)
		memcpy(port->filters, filters, filter_count * sizeof(*filters));
	port->filter_count = filter_count;
	address.can_ifindex = (int)port->index;
	return bind(port->fd, (const struct sockaddr *)&address, sizeof(address)) == 0 ? 0 : -errno;
}

static void port_close(struct db_port *port)
{
	if (!port)
		return;
	if (port->fd >= 0)
		close(port->fd);
	free(port);
}

static int port_open(const struct db_bus_config *bus, const struct db_can_filter *filters,
                     size_t filter_count, db_time now, struct db_port **port)
{
	struct db_port *made = calloc(1, sizeof(*made));
	int error;

	if (!made)
		return -ENOMEM;
	made->fd = -1;
	made->health.up = true;
	made->ask_state_at = DB_TIME_NEVER;
	error = open_socket(made, bus->interface, filters, filter_count);
	if (error != 0) {
		port_close(made);
		return error;
	}
	note_link(made, now);
	*port = made;
	return 0;
}

/* --- using ------------------------------------------------------------------------------------ */

static int port_fd(const struct db_port *port)
{
	return port->fd;
}

/* The socket reports an error only once: it is kept until the frames before it are returned. */
static ssize_t moved(struct db_port *port, size_t done, int error)
{
	if (error == EAGAIN || error == EWOULDBLOCK || error == EINTR || error == ENOBUFS)
		return (ssize_t)done;
	port->lost = -error;
	return done > 0 ? (ssize_t)done : port->lost;
}

static ssize_t port_read(struct db_port *port, void *bytes, size_t size, db_time now)
{
	size_t done = 0;

	if (port->lost != 0)
		return port->lost;
	while (done + FRAME_SIZE <= size) {
		struct db_can_frame frame;
		ssize_t got = read(port->fd, &frame, sizeof(frame));

		/* Every frame has this length; a socket at its end never reports that. */
		if (got != (ssize_t)FRAME_SIZE)
			return moved(port, done, got < 0 ? errno : EIO);
		if (frame.id & DB_CAN_ERROR) {
			note_error(port, &frame, now);
			continue;
		}
		memset(frame.reserved, 0, sizeof(frame.reserved));
		memcpy((uint8_t *)bytes + done, &frame, FRAME_SIZE);
		done += FRAME_SIZE;
	}
	return (ssize_t)done;
}

static ssize_t port_write(struct db_port *port, const void *bytes, size_t length, db_time now)
{
	size_t done = 0;

	(void)now;
	if (port->lost != 0)
		return port->lost;
	/* Frames accepted by the kernel while bus off would be sent after the restart, whenever
	 * that is. */
	if (!port->health.up)
		return 0;
	while (done + FRAME_SIZE <= length) {
		if (write(port->fd, (const uint8_t *)bytes + done, FRAME_SIZE) !=
		    (ssize_t)FRAME_SIZE)
			return moved(port, done, errno);
		done += FRAME_SIZE;
	}
	return (ssize_t)done;
}

static db_time port_run(struct db_port *port, db_time now, int *error)
{
	struct db_can_link link;

	*error = port->lost;
	if (port->health.up)
		return DB_TIME_NEVER;
	if (now < port->ask_state_at)
		return port->ask_state_at;
	port->ask_state_at = now + STATE_INTERVAL;
	if (db_can_link_read(port->index, &link) && link.has_state &&
	    link.state < CAN_STATE_BUS_OFF)
		come_back(&port->health);
	return port->ask_state_at;
}

static const struct db_port_health *port_health(const struct db_port *port)
{
	return &port->health;
}

static db_time port_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                              size_t request_length, size_t answer_length)
{
	uint64_t bits = db_can_wire_bits(request, request_length, answer_length);

	return (db_time)bits * DB_NS_PER_S / (db_time)bus->bitrate;
}

const struct db_transport db_transport_socketcan = {
	.name = "socketcan",
	.medium = DB_MEDIUM_CAN,
	.uses_interface = true,
	.open = port_open,
	.pass = port_pass,
	.close = port_close,
	.fd = port_fd,
	.read = port_read,
	.write = port_write,
	.write_retry = WRITE_RETRY,
	.run = port_run,
	.health = port_health,
	.wire_time = port_wire_time,
};
