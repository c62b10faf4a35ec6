/* SPDX-License-Identifier: Apache-2.0 */
/* Drivers of serial ports as they are, and what is made of them. */
#include "transport/serial_latency.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/ioctl.h>

#include <linux/serial.h>

#include <cmocka.h>

#define FD 42
#define LOW ((int)ASYNC_LOW_LATENCY)
#define CUSTOM ((int)ASYNC_SPD_CUST)

static struct {
	struct serial_struct settings;
	int get_error; /* an errno */
	int set_error;
	bool forgets; /* takes the flag and does not keep it */
	unsigned sets;
} port;

static int answer(int error)
{
	errno = error;
	return error == 0 ? 0 : -1;
}

static int control(int fd, unsigned long request, void *argument)
{
	assert_int_equal(fd, FD);
	if (request == TIOCGSERIAL) {
		if (port.get_error == 0)
			memcpy(argument, &port.settings, sizeof port.settings);
		return answer(port.get_error);
	}
	assert_int_equal(request, TIOCSSERIAL);
	port.sets++;
	if (port.set_error == 0)
		memcpy(&port.settings, argument, sizeof port.settings);
	if (port.forgets)
		port.settings.flags &= ~LOW;
	return answer(port.set_error);
}

static int set_up(void **state)
{
	(void)state;
	memset(&port, 0, sizeof port);
	port.settings.baud_base = 24000000;
	port.settings.flags = CUSTOM;
	return 0;
}

static void only_this_setting_is_changed(void **state)
{
	(void)state;
	assert_int_equal(db_serial_lower_latency(FD, control), DB_PORT_LATENCY_LOW);
	assert_int_equal(port.settings.flags, CUSTOM | LOW);
	assert_int_equal(port.settings.baud_base, 24000000);
}

static void what_is_set_already_is_left(void **state)
{
	(void)state;
	port.settings.flags |= LOW;
	assert_int_equal(db_serial_lower_latency(FD, control), DB_PORT_LATENCY_LOW);
	assert_int_equal(port.sets, 0);
}

static void drivers_without_it_are_no_error(void **state)
{
	(void)state;
	port.get_error = ENOTTY;
	assert_int_equal(db_serial_lower_latency(FD, control), DB_PORT_LATENCY_REFUSED);
	assert_int_equal(port.sets, 0);
}

static void users_who_may_not_are_no_error(void **state)
{
	(void)state;
	port.set_error = EPERM;
	assert_int_equal(db_serial_lower_latency(FD, control), DB_PORT_LATENCY_REFUSED);
}

static void what_is_taken_is_read_back(void **state)
{
	(void)state;
	port.forgets = true;
	assert_int_equal(db_serial_lower_latency(FD, control), DB_PORT_LATENCY_REFUSED);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, set_up)
	const struct CMUnitTest tests[] = {
		TEST(only_this_setting_is_changed),    TEST(what_is_set_already_is_left),
		TEST(drivers_without_it_are_no_error), TEST(users_who_may_not_are_no_error),
		TEST(what_is_taken_is_read_back),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
