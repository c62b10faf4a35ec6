/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

static const char text[] = "# not /dev/ttyUSB9\n"
			   "bus a { device = \"/dev/a\" }\n"
			   "bus b { device = /dev/b, baud = 9600 } # \"/dev/c\n"
			   "bus c { device = \"/dev/a b#c\"}bus d{device=\"/dev/a\"}\n";

static void test_ports_are_found_once_and_not_in_comments(void **state)
{
	json_t *ports = json_array();
	json_t *right = json_pack("[s,s,s]", "/dev/a", "/dev/b", "/dev/a b#c");

	(void)state;
	db_ctl_ports_find(text, ports);
	assert_true(json_equal(ports, right));
	json_decref(right);
	json_decref(ports);
}

static void test_only_whole_names_are_replaced(void **state)
{
	json_t *others = json_pack("{s:s, s:s}", "/dev/a", "/dev/x", "/dev/ttyUSB9", "/dev/y");
	char *replaced = db_ctl_ports_replace(text, others);

	(void)state;
	assert_string_equal(replaced, "# not /dev/ttyUSB9\n"
	                              "bus a { device = \"/dev/x\" }\n"
	                              "bus b { device = /dev/b, baud = 9600 } # \"/dev/c\n"
	                              "bus c { device = \"/dev/a b#c\"}bus d{device=\"/dev/x\"}\n");
	free(replaced);
	json_decref(others);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_ports_are_found_once_and_not_in_comments),
		cmocka_unit_test(test_only_whole_names_are_replaced),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
