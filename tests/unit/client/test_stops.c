/* SPDX-License-Identifier: Apache-2.0 */
/* What tools take for a stop is what the service takes for one. */
#include "client/stops.h"

#include "drivebridge/command_table.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void tools_know_the_stops_of_the_table(void **state)
{
	size_t stops = 0;
	size_t listed = 0;

	(void)state;
	for (size_t i = 0; i < db_command_row_count; i++) {
		const struct db_command_row *row = &db_command_rows[i];

		assert_int_equal(db_client_is_stop(row->name), db_command_is_stop(row->code));
		stops += db_command_is_stop(row->code);
	}
	while (db_client_stops[listed])
		listed++;
	assert_int_equal(listed, stops);
	assert_false(db_client_is_stop(""));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(tools_know_the_stops_of_the_table),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
