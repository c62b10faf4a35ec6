/* SPDX-License-Identifier: Apache-2.0 */
/* The line that `systemctl status` shows. */
#include "service/status.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void expect_line(const struct status_figures *figures, const char *line)
{
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	status_write(figures, out);
	fclose(out);
	assert_string_equal(text, line);
	free(text);
}

static void add_bus(struct status_figures *figures, const char *name, size_t drives,
                    uint32_t online, uint32_t utilisation)
{
	struct db_bus_stats stats = {
		.up = true, .port.up = true, .online = online, .utilisation = utilisation
	};

	status_add_bus(figures, name, drives, &stats);
}

static void add_lost_bus(struct status_figures *figures, const char *name, bool port_is_open,
                         uint32_t error)
{
	struct db_bus_stats stats = { .up = port_is_open, .last_error = error };

	status_add_bus(figures, name, 1, &stats);
}

static void nothing_configured(void **state)
{
	struct status_figures figures = { 0 };

	(void)state;
	expect_line(&figures, "0 of 0 drives online, 0 clients");
}

static void all_is_well(void **state)
{
	struct status_figures figures = { .clients = 1 };

	(void)state;
	add_bus(&figures, "a", 2, 2, 509);
	add_bus(&figures, "b", 3, 3, 720);
	add_bus(&figures, "c", 1, 1, 10);
	expect_line(&figures, "6 of 6 drives online, 1 client; worst bus b: 72 % busy");
}

static void a_silent_drive_is_worse_than_a_busy_bus(void **state)
{
	struct status_figures figures = { .clients = 2 };

	(void)state;
	add_bus(&figures, "a", 2, 2, 990);
	add_bus(&figures, "b", 3, 2, 10);
	expect_line(&figures, "4 of 5 drives online, 2 clients; worst bus b: 1 drive silent");
	add_bus(&figures, "c", 4, 1, 0);
	expect_line(&figures, "5 of 9 drives online, 2 clients; worst bus c: 3 drives silent");
}

/* A drive that left between two looks may still be counted as online. */
static void more_online_than_there_are_is_not_silent(void **state)
{
	struct status_figures figures = { 0 };

	(void)state;
	add_bus(&figures, "a", 1, 2, 0);
	expect_line(&figures, "2 of 1 drives online, 0 clients; worst bus a: 0 % busy");
}

static void a_bus_that_is_down_is_the_worst(void **state)
{
	struct status_figures figures = { .configuration = DB_CONFIGURATION_REFUSED };

	(void)state;
	add_lost_bus(&figures, "a", false, ENOENT);
	add_bus(&figures, "b", 9, 0, 0);
	expect_line(&figures,
	            "0 of 10 drives online, 0 clients; worst bus a: down (No such file or "
	            "directory); the configuration on disk was refused, see the log");
}

static void an_upgrade_is_told(void **state)
{
	struct status_figures figures = { .replaced = true };

	(void)state;
	expect_line(&figures, "0 of 0 drives online, 0 clients; an upgrade needs a restart");
}

/* The port is open, but a CAN controller is bus off, say. */
static void an_open_port_may_be_down_too(void **state)
{
	struct status_figures figures = { 0 };

	(void)state;
	add_bus(&figures, "a", 1, 0, 0);
	add_lost_bus(&figures, "b", true, 0);
	expect_line(&figures, "0 of 2 drives online, 0 clients; worst bus b: down");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(nothing_configured),
		cmocka_unit_test(all_is_well),
		cmocka_unit_test(a_silent_drive_is_worse_than_a_busy_bus),
		cmocka_unit_test(more_online_than_there_are_is_not_silent),
		cmocka_unit_test(a_bus_that_is_down_is_the_worst),
		cmocka_unit_test(an_upgrade_is_told),
		cmocka_unit_test(an_open_port_may_be_down_too),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
