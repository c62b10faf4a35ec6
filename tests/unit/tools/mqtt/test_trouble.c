/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/trouble.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdlib.h>
#include <cmocka.h>

static void assert_written(const char *record, const char *wanted)
{
	json_t *given = record ? json_loads(record, 0, NULL) : NULL;
	json_t *expected = json_loads(wanted, 0, NULL);
	json_t *written = db_mqtt_trouble_write(given);

	assert_true(expected && (given || !record));
	assert_true(json_equal(written, expected));
	json_decref(written);
	json_decref(expected);
	json_decref(given);
}

static void records_have_their_times_as_texts(void **state)
{
	(void)state;
	assert_written(
		"{\"drive\": \"a\", \"cause\": \"late\", \"need\": \"act\", \"detail\": \"\", \"advice\": \"do\","
		"\"since_us\": 1772366504000000, \"event\": {\"number\": 7, \"time_us\": 1772366504500000,"
		"\"name\": \"drive-late\", \"text\": \"late\"}}",
		"{\"cause\": \"late\", \"need\": \"act\", \"detail\": \"\", \"advice\": \"do\","
		"\"since\": \"2026-03-01T12:01:44.000000Z\", \"event\": {\"name\": \"drive-late\","
		"\"text\": \"late\", \"time\": \"2026-03-01T12:01:44.500000Z\"}}");
	assert_written(
		"{\"cause\": \"none\", \"need\": \"nothing\", \"advice\": \"\", \"errors\": [\"x\"], \"since_us\": 0,"
		"\"event\": null}",
		"{\"cause\": \"none\", \"need\": \"nothing\", \"advice\": \"\", \"errors\": [\"x\"],"
		"\"since\": null, \"event\": null}");
}

static void what_is_not_known_is_null(void **state)
{
	(void)state;
	assert_written(
		NULL,
		"{\"cause\": null, \"need\": null, \"detail\": null, \"advice\": null, \"since\": null,"
		"\"event\": null}");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(records_have_their_times_as_texts),
		cmocka_unit_test(what_is_not_known_is_null),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
