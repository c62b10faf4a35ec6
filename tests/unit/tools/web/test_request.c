/* SPDX-License-Identifier: Apache-2.0 */
/* What a browser is told of errors. */
#include "client/lanes.h"
#include "web/request.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void check(const char *name, const char *told, unsigned right)
{
	struct db_client_error error = { .parameters = NULL };
	unsigned status = 0;
	json_t *answer;

	db_client_error_set(&error, name, "why");
	answer = db_web_error_describe(&error, &status);
	assert_string_equal(json_string_value(json_object_get(answer, "error")), told);
	assert_string_equal(json_string_value(json_object_get(answer, "text")), "why");
	assert_int_equal(status, right);
	json_decref(answer);
	db_client_error_clear(&error);
}

/* A page tries a Busy again later; what it does not know, it reports as a broken service. */
static void what_is_full_is_busy(void **state)
{
	(void)state;
	check(DB_LANES_FULL, "Busy", MHD_HTTP_SERVICE_UNAVAILABLE);
	check(DB_CLIENT_SERVICE "Busy", "Busy", MHD_HTTP_SERVICE_UNAVAILABLE);
	check(DB_CLIENT_LOST, "ServiceUnreachable", MHD_HTTP_BAD_GATEWAY);
	check(DB_CLIENT_SERVICE "Unheard", "Unheard", MHD_HTTP_BAD_GATEWAY);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_is_full_is_busy),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
