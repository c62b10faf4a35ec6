/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/serial.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cmocka.h>

static int open_master(char *path, size_t size)
{
	int master = posix_openpt(O_RDWR | O_NOCTTY);

	assert_true(master >= 0);
	assert_int_equal(grantpt(master), 0);
	assert_int_equal(unlockpt(master), 0);
	assert_int_equal(ptsname_r(master, path, size), 0);
	return master;
}

static void wait_readable(int fd)
{
	struct pollfd one = { .fd = fd, .events = POLLIN };

	assert_int_equal(poll(&one, 1, 5000), 1);
}

static void bytes_pass_unchanged_both_ways(void **state)
{
	static const uint8_t frame[] = { 0xFF, 0x01, 0x0A, 0x0D, 0x03, 0x11, 0x13, 0x7F, 0xFE };
	char path[64];
	uint8_t got[32];
	struct db_serial *serial = NULL;
	int master = open_master(path, sizeof path);
	struct db_bus_config config = { .device = path, .baud = 9600, .stop_bits = 1 };

	(void)state;
	assert_int_equal(db_serial_open(&config, &serial), 0);
	assert_int_equal(db_serial_read(serial, got, sizeof got), 0);
	assert_int_equal(write(master, frame, sizeof frame), sizeof frame);
	wait_readable(db_serial_fd(serial));
	assert_int_equal(db_serial_read(serial, got, sizeof got), sizeof frame);
	assert_memory_equal(got, frame, sizeof frame);
	assert_int_equal(db_serial_write(serial, frame, sizeof frame), sizeof frame);
	wait_readable(master);
	assert_int_equal(read(master, got, sizeof got), sizeof frame);
	assert_memory_equal(got, frame, sizeof frame);
	close(master);
	wait_readable(db_serial_fd(serial));
	assert_true(db_serial_read(serial, got, sizeof got) <= 0);
	db_serial_close(serial);
}

static void what_cannot_be_opened_says_why(void **state)
{
	struct db_serial *serial = NULL;
	struct db_bus_config config = { .device = (char *)"/dev/drivebridge-no-such-port",
		                        .baud = 9600,
		                        .stop_bits = 1 };

	(void)state;
	assert_int_equal(db_serial_open(&config, &serial), -ENOENT);
	assert_null(serial);
	config.device = (char *)"/dev/null";
	assert_true(db_serial_open(&config, &serial) < 0);
	assert_null(serial);
}

/* Whether poll() tells of something at once, after the master's bytes have arrived. */
static bool is_told(int fd)
{
	struct pollfd one = { .fd = fd, .events = POLLIN };

	return poll(&one, 1, 0) == 1;
}

static void wait_for_bytes(int fd, int count)
{
	int waiting = 0;

	while (waiting < count)
		assert_int_equal(ioctl(fd, FIONREAD, &waiting), 0);
}

static void a_port_tells_of_bytes_when_enough_are_there(void **state)
{
	const struct db_transport *serial = &db_transport_serial;
	char path[64];
	uint8_t got[32];
	struct db_port *port = NULL;
	int master = open_master(path, sizeof path);
	struct db_bus_config config = { .device = path, .baud = 9600, .stop_bits = 1 };

	(void)state;
	assert_int_equal(serial->open(&config, NULL, 0, 0, &port), 0);
	assert_true(serial->gather(port, 5));
	assert_int_equal(write(master, "abcd", 4), 4);
	wait_for_bytes(serial->fd(port), 4);
	assert_false(is_told(serial->fd(port)));
	assert_int_equal(write(master, "e", 1), 1);
	wait_readable(serial->fd(port));
	assert_int_equal(serial->read(port, got, sizeof got, 0), 5);
	assert_int_equal(serial->read(port, got, sizeof got, 0), 0);
	/* Who reads gets fewer all the same. */
	assert_int_equal(write(master, "fg", 2), 2);
	wait_for_bytes(serial->fd(port), 2);
	assert_int_equal(serial->read(port, got, sizeof got, 0), 2);
	/* What waits is kept, and told when each byte is to be. */
	assert_int_equal(write(master, "hi", 2), 2);
	wait_for_bytes(serial->fd(port), 2);
	assert_false(is_told(serial->fd(port)));
	assert_true(serial->gather(port, 0));
	wait_readable(serial->fd(port));
	assert_int_equal(serial->read(port, got, sizeof got, 0), 2);
	assert_false(serial->gather(port, 1000));
	serial->close(port);
	close(master);
}

static void wire_time_counts_every_bit(void **state)
{
	struct db_bus_config config = { .baud = 9600, .stop_bits = 1 };

	(void)state;
	assert_int_equal(db_serial_wire_time(&config, 21), INT64_C(21875000)); /* 210 bits */
	config.parity = DB_PARITY_EVEN;
	config.stop_bits = 2;
	assert_int_equal(db_serial_wire_time(&config, 24), INT64_C(30000000)); /* 288 bits */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(bytes_pass_unchanged_both_ways),
		cmocka_unit_test(what_cannot_be_opened_says_why),
		cmocka_unit_test(a_port_tells_of_bytes_when_enough_are_there),
		cmocka_unit_test(wire_time_counts_every_bit),
	};

	return cmocka_run_group_tests_name("serial", tests, NULL, NULL);
}
