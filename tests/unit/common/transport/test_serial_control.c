/* SPDX-License-Identifier: Apache-2.0 */
/* Drivers of serial ports as they are, and what is made of them. */
#include "transport/transport_private.h"

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
	struct serial_rs485 rs485;
	unsigned rs485_flags; /* those that the driver can keep */
} port;

static int answer(int error)
{
	errno = error;
	return error == 0 ? 0 : -1;
}

static int rs485_control(unsigned long request, struct serial_rs485 *mode)
{
	if (request == TIOCGRS485) {
		*mode = port.rs485;
		return 0;
	}
	port.sets++;
	if (port.set_error != 0)
		return answer(port.set_error);
	port.rs485 = *mode;
	port.rs485.flags &= port.rs485_flags;
	return 0;
}

static int control(int fd, unsigned long request, void *argument)
{
	assert_int_equal(fd, FD);
	if (request == TIOCSRS485 || request == TIOCGRS485)
		return rs485_control(request, argument);
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
	port.rs485_flags = UINT32_MAX;
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

/* --- the direction of an RS485 line ----------------------------------------------------------------- */

static int direct(enum db_direction direction)
{
	const struct db_bus_config bus = { .direction = direction,
		                           .rts_before_ms = 1,
		                           .rts_after_ms = 2 };

	return db_serial_set_direction(FD, &bus, control);
}

static void the_kernel_switches_rts(void **state)
{
	(void)state;
	assert_int_equal(direct(DB_DIRECTION_RTS), 0);
	assert_int_equal(port.rs485.flags, SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND);
	assert_int_equal(port.rs485.delay_rts_before_send, 1);
	assert_int_equal(port.rs485.delay_rts_after_send, 2);
	assert_int_equal(direct(DB_DIRECTION_RTS_INVERTED), 0);
	assert_int_equal(port.rs485.flags, SER_RS485_ENABLED | SER_RS485_RTS_AFTER_SEND);
}

static void adapters_are_left_alone(void **state)
{
	(void)state;
	assert_int_equal(direct(DB_DIRECTION_ADAPTER), 0);
	assert_int_equal(port.sets, 0);
}

static void a_port_that_cannot_is_not_used(void **state)
{
	(void)state;
	port.set_error = ENOTTY;
	assert_int_equal(direct(DB_DIRECTION_RTS), -ENOTTY);
	port.set_error = EINVAL;
	assert_int_equal(direct(DB_DIRECTION_RTS), -ENOTTY);
	port.set_error = EIO;
	assert_int_equal(direct(DB_DIRECTION_RTS), -EIO);
	/* It takes the mode and keeps another one: the line would be driven all the time. */
	port.set_error = 0;
	port.rs485_flags = SER_RS485_ENABLED;
	assert_int_equal(direct(DB_DIRECTION_RTS), -EINVAL);
	port.rs485_flags = 0;
	assert_int_equal(direct(DB_DIRECTION_RTS), -EINVAL);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, set_up)
	const struct CMUnitTest tests[] = {
		TEST(only_this_setting_is_changed),    TEST(what_is_set_already_is_left),
		TEST(drivers_without_it_are_no_error), TEST(users_who_may_not_are_no_error),
		TEST(what_is_taken_is_read_back),      TEST(the_kernel_switches_rts),
		TEST(adapters_are_left_alone),         TEST(a_port_that_cannot_is_not_used),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
