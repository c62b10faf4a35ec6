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
		cmocka_unit_test(wire_time_counts_every_bit),
	};

	return cmocka_run_group_tests_name("serial", tests, NULL, NULL);
}
