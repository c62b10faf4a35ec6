/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Most machines that run unit tests have no CAN in their kernel. So the calls that need one are
 * answered here while `fake.active`: a CAN socket is one end of a socket pair whose other end is the
 * bus. Whatever a real one can do differently is tested over vcan by the end-to-end tests; the last
 * test here uses it where there is one.
 */
/* Fortified headers define read() themselves, where this test has its own. */
#undef _FORTIFY_SOURCE

#include "codec/can.h"
#include "drivebridge/transport.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cmocka.h>

#define EXT DB_CAN_EXTENDED

/* Up and not CAN on every machine: what is asked about it is answered by the real kernel. */
#define INTERFACE "lo"

static struct {
	bool active;
	int port_fd; /* of the transport, -1 = none was made */
	int bus_fd;
	int bound_index;
	struct db_can_filter filters[8];
	size_t filter_count;
	can_err_mask_t errors;
	int read_error;  /* once, after what is waiting */
	int write_error; /* every time, once writes_left is used up */
	int writes_left;
} fake;

int socket(int domain, int type, int protocol)
{
	int pair[2];

	if (!fake.active || domain != PF_CAN)
		return (int)syscall(SYS_socket, domain, type, protocol);
	assert_int_equal(type, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC);
	assert_int_equal(protocol, CAN_RAW);
	assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair), 0);
	fake.port_fd = pair[0];
	fake.bus_fd = pair[1];
	return pair[0];
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t length)
{
	if (!fake.active || level != SOL_CAN_RAW)
		return (int)syscall(SYS_setsockopt, fd, level, name, value, length);
	assert_int_equal(fake.bound_index, 0);
	if (name == CAN_RAW_FILTER) {
		assert_true(length <= sizeof fake.filters);
		memcpy(fake.filters, value, length);
		fake.filter_count = length / sizeof fake.filters[0];
	} else {
		assert_int_equal(name, CAN_RAW_ERR_FILTER);
		assert_int_equal(length, sizeof fake.errors);
		memcpy(&fake.errors, value, length);
	}
	return 0;
}

int bind(int fd, __CONST_SOCKADDR_ARG address, socklen_t length)
{
	struct sockaddr_can can;

	if (!fake.active || fd != fake.port_fd)
		return (int)syscall(SYS_bind, fd, address.__sockaddr__, length);
	assert_int_equal(length, sizeof can);
	memcpy(&can, address.__sockaddr__, sizeof can);
	assert_int_equal(can.can_family, AF_CAN);
	fake.bound_index = can.can_ifindex;
	return 0;
}

ssize_t read(int fd, void *bytes, size_t size)
{
	ssize_t got = (ssize_t)syscall(SYS_read, fd, bytes, size);

	if (got < 0 && fake.active && fd == fake.port_fd && fake.read_error != 0) {
		errno = fake.read_error;
		fake.read_error = 0;
	}
	return got;
}

ssize_t write(int fd, const void *bytes, size_t length)
{
	if (fake.active && fd == fake.port_fd && fake.write_error != 0) {
		if (fake.writes_left == 0) {
			errno = fake.write_error;
			return -1;
		}
		fake.writes_left--;
	}
	return (ssize_t)syscall(SYS_write, fd, bytes, length);
}

/* --- the tests' own --------------------------------------------------------------------------------- */

static const struct db_transport *const can = &db_transport_socketcan;

static struct db_port *open_fake(void)
{
	const struct db_bus_config bus = { .interface = (char *)INTERFACE, .bitrate = 500000 };
	struct db_port *port = NULL;

	memset(&fake, 0, sizeof fake);
	fake.active = true;
	assert_int_equal(can->open(&bus, NULL, 0, 0, &port), 0);
	assert_non_null(port);
	return port;
}

static void close_fake(struct db_port *port)
{
	can->close(port);
	close(fake.bus_fd);
	fake.active = false;
}

static void from_bus(uint32_t id, uint8_t length, const uint8_t *data)
{
	struct can_frame frame = { .can_id = id, .len = length, .len8_dlc = 0xF };

	memcpy(frame.data, data, length);
	assert_int_equal(write(fake.bus_fd, &frame, sizeof frame), sizeof frame);
}

/* An error frame of these classes; `detail` is its second byte. */
static const struct db_port_health *error_from_bus(struct db_port *port, uint32_t classes,
                                                   uint8_t detail)
{
	const uint8_t data[8] = { 0, detail };
	struct db_can_frame got;

	from_bus(CAN_ERR_FLAG | classes, 8, data);
	assert_int_equal(can->read(port, &got, sizeof got, 0), 0);
	return can->health(port);
}

/* --- opening ---------------------------------------------------------------------------------------- */

static void what_cannot_be_opened_says_why(void **state)
{
	struct db_bus_config bus = { .interface = (char *)"db-no-such-can", .bitrate = 500000 };
	struct db_port *port = NULL;

	(void)state;
	assert_int_equal(can->open(&bus, NULL, 0, 0, &port), -ENODEV);
	bus.interface = (char *)"a-name-longer-than-any-interface-has";
	assert_int_equal(can->open(&bus, NULL, 0, 0, &port), -ENODEV);
	assert_null(port);
	can->close(NULL);
}

/* Without CAN in the kernel there is no such socket, with it this interface is none of its. */
static void an_interface_that_is_not_can_is_refused(void **state)
{
	const struct db_bus_config bus = { .interface = (char *)INTERFACE, .bitrate = 500000 };
	struct db_port *port = NULL;
	int error;

	(void)state;
	error = can->open(&bus, NULL, 0, 0, &port);
	assert_true(error == -EAFNOSUPPORT || error == -ENODEV);
	assert_null(port);
}

static void filters_and_error_reports_are_set_before_binding(void **state)
{
	static const struct db_can_filter filters[] = {
		{ .id = 0x123, .mask = EXT | 0x7FF },
		{ .id = EXT | 0x00FF0000, .mask = EXT | 0x00FF0000 },
	};
	const struct db_bus_config bus = { .interface = (char *)INTERFACE, .bitrate = 500000 };
	struct db_port *port = NULL;

	(void)state;
	memset(&fake, 0, sizeof fake);
	fake.active = true;
	assert_int_equal(can->open(&bus, filters, 2, 0, &port), 0);
	assert_int_equal(can->fd(port), fake.port_fd);
	assert_int_equal(fake.bound_index, if_nametoindex(INTERFACE));
	assert_int_equal(fake.filter_count, 2);
	assert_memory_equal(fake.filters, filters, sizeof filters);
	assert_int_equal(fake.errors, CAN_ERR_LOSTARB | CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_ACK |
	                                      CAN_ERR_BUSOFF | CAN_ERR_BUSERROR |
	                                      CAN_ERR_RESTARTED);
	assert_true(can->health(port)->up);
	assert_int_equal(can->health(port)->bitrate, 0);
	close_fake(port);
}

/* --- frames ----------------------------------------------------------------------------------------- */

static void frames_are_read_until_none_waits(void **state)
{
	static const uint8_t data[8] = { 1, 2, 3, 4, 5, 6, 7, 8 };
	struct db_port *port = open_fake();
	struct db_can_frame got[4];

	(void)state;
	assert_int_equal(can->read(port, got, sizeof got, 0), 0);
	from_bus(0x123, 2, data);
	from_bus(CAN_ERR_FLAG | CAN_ERR_LOSTARB, 8, data);
	from_bus(EXT | 0x1ABCDEF, 8, data);
	memset(got, 0xAA, sizeof got);
	assert_int_equal(can->read(port, got, sizeof got, 0), 32);
	assert_int_equal(got[0].id, 0x123);
	assert_int_equal(got[0].length, 2);
	assert_memory_equal(got[0].reserved, "\0\0\0", 3);
	assert_memory_equal(got[0].data, data, 2);
	assert_int_equal(got[1].id, EXT | 0x1ABCDEF);
	assert_memory_equal(got[1].data, data, 8);
	close_fake(port);
}

static void a_buffer_takes_whole_frames_only(void **state)
{
	struct db_port *port = open_fake();
	uint8_t got[40];

	(void)state;
	for (unsigned i = 0; i < 3; i++)
		from_bus(0x100 + i, 0, got);
	assert_int_equal(can->read(port, got, sizeof got, 0), 32);
	assert_int_equal(can->read(port, got, sizeof got, 0), 16);
	close_fake(port);
}

static void frames_are_written_as_they_are(void **state)
{
	static const struct db_can_frame frames[] = {
		{ .id = EXT | 0x0C0101, .length = 2, .data = { 0x12, 0x34 } },
		{ .id = DB_CAN_REMOTE | 0x7FF },
	};
	struct db_port *port = open_fake();
	struct can_frame seen;

	(void)state;
	assert_int_equal(can->write(port, frames, sizeof frames, 0), sizeof frames);
	assert_int_equal(read(fake.bus_fd, &seen, sizeof seen), 16);
	assert_int_equal(seen.can_id, CAN_EFF_FLAG | 0x0C0101);
	assert_int_equal(seen.len, 2);
	assert_memory_equal(seen.data, "\x12\x34", 2);
	assert_int_equal(read(fake.bus_fd, &seen, sizeof seen), 16);
	assert_int_equal(seen.can_id, CAN_RTR_FLAG | 0x7FF);
	close_fake(port);
}

static void a_full_queue_takes_a_part_and_the_rest_once(void **state)
{
	static const int full[] = { ENOBUFS, EAGAIN, EINTR };
	static const struct db_can_frame frames[] = { { .id = 1 }, { .id = 2 }, { .id = 3 } };
	struct can_frame seen;

	(void)state;
	assert_true(can->write_retry > 0);
	for (size_t i = 0; i < sizeof full / sizeof full[0]; i++) {
		struct db_port *port = open_fake();

		fake.write_error = full[i];
		fake.writes_left = 2;
		assert_int_equal(can->write(port, frames, sizeof frames, 0), 32);
		assert_int_equal(can->write(port, frames + 2, 16, 0), 0);
		fake.write_error = 0;
		assert_int_equal(can->write(port, frames + 2, 16, 0), 16);
		for (unsigned id = 1; id <= 3; id++) {
			assert_int_equal(read(fake.bus_fd, &seen, sizeof seen), 16);
			assert_int_equal(seen.can_id, id);
		}
		assert_int_equal(read(fake.bus_fd, &seen, sizeof seen), -1);
		close_fake(port);
	}
}

/* --- losing it -------------------------------------------------------------------------------------- */

static void a_lost_interface_is_told_by_read(void **state)
{
	static const int lost[] = { ENETDOWN, ENODEV, ENXIO };
	struct db_can_frame got;
	int error = 0;

	(void)state;
	for (size_t i = 0; i < sizeof lost / sizeof lost[0]; i++) {
		struct db_port *port = open_fake();

		fake.read_error = lost[i];
		assert_int_equal(can->read(port, &got, sizeof got, 0), -lost[i]);
		can->run(port, 0, &error);
		assert_int_equal(error, -lost[i]);
		close_fake(port);
	}
}

/* The kernel tells it once: what was read before must not make it forgotten. */
static void frames_before_the_loss_are_not_the_end_of_it(void **state)
{
	struct db_port *port = open_fake();
	struct db_can_frame got[2];
	int error = 0;

	(void)state;
	can->run(port, 0, &error);
	assert_int_equal(error, 0);
	from_bus(0x123, 0, (const uint8_t *)"");
	fake.read_error = ENETDOWN;
	assert_int_equal(can->read(port, got, sizeof got, 0), 16);
	can->run(port, 0, &error);
	assert_int_equal(error, -ENETDOWN);
	assert_int_equal(can->read(port, got, sizeof got, 0), -ENETDOWN);
	assert_int_equal(can->write(port, got, 16, 0), -ENETDOWN);
	close_fake(port);
}

static void a_lost_interface_is_told_by_write(void **state)
{
	static const struct db_can_frame frames[2] = { { .id = 1 }, { .id = 2 } };
	struct db_port *port = open_fake();

	(void)state;
	fake.write_error = ENXIO;
	fake.writes_left = 1;
	assert_int_equal(can->write(port, frames, sizeof frames, 0), 16);
	assert_int_equal(can->write(port, frames + 1, 16, 0), -ENXIO);
	close_fake(port);
}

/* --- health ----------------------------------------------------------------------------------------- */

static void error_frames_are_counted_by_kind(void **state)
{
	struct db_port *port = open_fake();
	const struct db_port_health *health = can->health(port);

	(void)state;
	error_from_bus(port, CAN_ERR_LOSTARB, 3);
	error_from_bus(port, CAN_ERR_LOSTARB | CAN_ERR_ACK, 0);
	assert_int_equal(health->arbitration_lost, 2);
	assert_int_equal(health->line_errors, 1);
	error_from_bus(port, CAN_ERR_PROT | CAN_ERR_BUSERROR, 0);
	assert_int_equal(health->line_errors, 2);
	error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW);
	error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_OVERFLOW);
	assert_int_equal(health->overflows, 2);
	assert_true(health->up);
	assert_false(health->error_warning);
	assert_int_equal(health->error_passives, 0);
	close_fake(port);
}

static void error_passive_comes_and_goes(void **state)
{
	struct db_port *port = open_fake();
	const struct db_port_health *health;

	(void)state;
	health = error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING);
	assert_true(health->error_warning);
	assert_false(health->error_passive);
	health = error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE);
	health = error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE);
	assert_true(health->error_passive);
	assert_int_equal(health->error_passives, 1);
	health = error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING);
	assert_false(health->error_passive);
	assert_true(health->error_warning);
	health = error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE);
	assert_int_equal(health->error_passives, 2);
	health = error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE);
	assert_false(health->error_passive);
	assert_false(health->error_warning);
	assert_true(health->up);
	close_fake(port);
}

static void bus_off_lasts_until_the_restart(void **state)
{
	static const struct db_can_frame frame = { .id = 1 };
	struct db_port *port = open_fake();
	const struct db_port_health *health;
	struct can_frame seen;
	int error = 0;

	(void)state;
	error_from_bus(port, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE);
	health = error_from_bus(port, CAN_ERR_BUSOFF, 0);
	assert_false(health->up);
	assert_int_equal(health->error, ENETRESET);
	assert_int_equal(health->bus_offs, 1);
	/* Nothing is taken that would be sent at some later time. */
	assert_int_equal(can->write(port, &frame, sizeof frame, 0), 0);
	assert_int_equal(read(fake.bus_fd, &seen, sizeof seen), -1);
	health = error_from_bus(port, CAN_ERR_BUSOFF, 0);
	assert_int_equal(health->bus_offs, 1);
	/* It is asked about from time to time; this interface has no state to tell. */
	assert_int_equal(can->run(port, 0, &error), DB_NS_PER_S);
	assert_int_equal(can->run(port, DB_NS_PER_S, &error), 2 * DB_NS_PER_S);
	assert_int_equal(error, 0);
	assert_false(health->up);
	health = error_from_bus(port, CAN_ERR_RESTARTED, 0);
	assert_true(health->up);
	assert_int_equal(health->error, 0);
	assert_false(health->error_passive);
	assert_int_equal(can->run(port, 0, &error), DB_TIME_NEVER);
	assert_int_equal(can->write(port, &frame, sizeof frame, 0), 16);
	health = error_from_bus(port, CAN_ERR_BUSOFF, 0);
	assert_int_equal(health->bus_offs, 2);
	close_fake(port);
}

/* --- the wire --------------------------------------------------------------------------------------- */

static void wire_time_is_the_shortest(void **state)
{
	static const struct db_can_frame extended = { .id = EXT, .length = 8 };
	static const struct db_can_frame standard[2] = { { .id = 0x7FF }, { .id = 0x7FF } };
	const struct db_bus_config bus = { .bitrate = 500000 };
	uint8_t shifted[33];

	(void)state;
	/* 150 bits, and an answer of one empty frame of 67 */
	memcpy(shifted + 1, &extended, 16);
	assert_int_equal(can->wire_time(&bus, shifted + 1, 16, 8), (150 + 67) * 2000);
	/* a full and a half answer frame: 131 + 99 */
	assert_int_equal(can->wire_time(&bus, shifted + 1, 16, 28), (150 + 131 + 99) * 2000);
	/* 50 bits each; standard answers, one full: 111 */
	memcpy(shifted + 1, standard, 32);
	assert_int_equal(can->wire_time(&bus, shifted + 1, 32, 16), (100 + 111) * 2000);
	assert_int_equal(can->wire_time(&bus, shifted + 1, 32, 0), 100 * 2000);
}

/* --- a real interface, where there is one ----------------------------------------------------------- */

static void frames_pass_over_vcan(void **state)
{
	static const struct db_can_filter filter = { .id = 0x120, .mask = EXT | 0x7F0 };
	static const struct db_can_frame frames[2] = { { .id = 0x200 }, { .id = 0x12A } };
	const struct db_bus_config bus = { .interface = (char *)"vcan0", .bitrate = 500000 };
	struct db_port *listener = NULL;
	struct db_port *sender = NULL;
	struct db_can_frame got[2];
	struct pollfd one = { .events = POLLIN };

	(void)state;
	if (can->open(&bus, &filter, 1, 0, &listener) != 0)
		skip();
	assert_int_equal(can->open(&bus, NULL, 0, 0, &sender), 0);
	assert_int_equal(can->write(sender, frames, sizeof frames, 0), 32);
	one.fd = can->fd(listener);
	assert_int_equal(poll(&one, 1, 5000), 1);
	assert_int_equal(can->read(listener, got, sizeof got, 0), 16);
	assert_int_equal(got[0].id, 0x12A);
	/* What one sends itself does not come back. */
	assert_int_equal(can->read(sender, got, sizeof got, 0), 0);
	can->close(sender);
	can->close(listener);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_cannot_be_opened_says_why),
		cmocka_unit_test(an_interface_that_is_not_can_is_refused),
		cmocka_unit_test(filters_and_error_reports_are_set_before_binding),
		cmocka_unit_test(frames_are_read_until_none_waits),
		cmocka_unit_test(a_buffer_takes_whole_frames_only),
		cmocka_unit_test(frames_are_written_as_they_are),
		cmocka_unit_test(a_full_queue_takes_a_part_and_the_rest_once),
		cmocka_unit_test(a_lost_interface_is_told_by_read),
		cmocka_unit_test(frames_before_the_loss_are_not_the_end_of_it),
		cmocka_unit_test(a_lost_interface_is_told_by_write),
		cmocka_unit_test(error_frames_are_counted_by_kind),
		cmocka_unit_test(error_passive_comes_and_goes),
		cmocka_unit_test(bus_off_lasts_until_the_restart),
		cmocka_unit_test(wire_time_is_the_shortest),
		cmocka_unit_test(frames_pass_over_vcan),
	};

	return cmocka_run_group_tests_name("socketcan", tests, NULL, NULL);
}
