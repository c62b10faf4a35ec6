/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/host.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static char none[] = "", scada[] = "scada";

static void tell(struct db_mqtt_host *host, const char *text)
{
	db_mqtt_host_take(host, text, strlen(text), host->since, 0);
}

static void test_without_one_nobody_waits(void **state)
{
	struct db_mqtt_config config = { .primary_host = none, .address_count = 2 };
	struct db_mqtt_host host;
	db_time due = DB_TIME_NEVER;

	(void)state;
	db_mqtt_host_connect(&host, &config, 0);
	assert_true(db_mqtt_host_allows(&host, host.since));
	assert_null(db_mqtt_host_complain(&host, DB_TIME_NEVER / 2, &due));
	assert_true(due == DB_TIME_NEVER);
}

static void test_only_its_newest_state_counts(void **state)
{
	static const char *const nothing[] = { "",
		                               "ONLINE",
		                               "null",
		                               "[]",
		                               "{\"online\":true}",
		                               "{\"timestamp\":9}",
		                               "{\"online\":1,\"timestamp\":9}",
		                               "{\"online\":true,\"timestamp\":\"9\"}",
		                               "{\"online\":true,\"timestamp\":9",
		                               "{\"online\":true,\"online\":true,\"timestamp\":9}",
		                               "{\"online\":true,\"timestamp\":-9}" };
	struct db_mqtt_config config = { .primary_host = scada, .address_count = 1 };
	struct db_mqtt_host host;
	db_time due = DB_TIME_NEVER;

	(void)state;
	db_mqtt_host_connect(&host, &config, 0);
	assert_string_equal(host.topic.text, "spBv1.0/STATE/scada");
	for (size_t i = 0; i < sizeof(nothing) / sizeof(nothing[0]); i++) {
		tell(&host, nothing[i]);
		assert_false(db_mqtt_host_allows(&host, host.since));
	}
	tell(&host, "{\"online\":false,\"timestamp\":100}");
	tell(&host, "{\"online\":true,\"timestamp\":99}");
	assert_false(db_mqtt_host_allows(&host, host.since));
	/* It was never there: with one broker there is nothing to leave. */
	assert_null(db_mqtt_host_complain(&host, DB_TIME_NEVER / 2, &due));
	tell(&host, "{\"online\":true,\"timestamp\":100}");
	assert_true(db_mqtt_host_allows(&host, host.since));
	tell(&host, "{\"online\":false,\"timestamp\":99}");
	assert_true(db_mqtt_host_allows(&host, host.since));
	tell(&host, "{\"online\":false,\"timestamp\":101}");
	assert_false(db_mqtt_host_allows(&host, host.since));
	assert_string_equal(db_mqtt_host_complain(&host, 0, &due),
	                    "the primary host scada is not there");
	/* Back at once: this session ends all the same. */
	tell(&host, "{\"online\":true,\"timestamp\":102}");
	assert_false(db_mqtt_host_allows(&host, host.since));
	/* In the next one an older state counts: it may be another broker. */
	db_mqtt_host_connect(&host, &config, 0);
	tell(&host, "{\"online\":true,\"timestamp\":50}");
	assert_true(db_mqtt_host_allows(&host, host.since));
}

static void test_another_broker_is_tried(void **state)
{
	struct db_mqtt_config config = { .primary_host = scada, .address_count = 2 };
	struct db_mqtt_host host;
	db_time due = DB_TIME_NEVER;

	(void)state;
	db_mqtt_host_connect(&host, &config, 100);
	assert_null(db_mqtt_host_complain(&host, 100, &due));
	assert_true(due == 100 + 5 * DB_NS_PER_S);
	assert_null(db_mqtt_host_complain(&host, due - 1, &due));
	assert_non_null(db_mqtt_host_complain(&host, due, &due));
	tell(&host, "{\"online\":true,\"timestamp\":100}");
	assert_null(db_mqtt_host_complain(&host, due, &due));
}

static void test_births_are_spread(void **state)
{
	static const char online[] = "{\"online\":true,\"timestamp\":9}";
	struct db_mqtt_config config = { .primary_host = scada,
		                         .address_count = 1,
		                         .spread_s = 10 };
	struct db_mqtt_host host;
	db_time due = DB_TIME_NEVER;
	db_time now = 100 * DB_NS_PER_S;

	(void)state;
	/* It was there already: the retained STATE comes at once. */
	db_mqtt_host_connect(&host, &config, now);
	db_mqtt_host_take(&host, online, strlen(online), now + 1, 500);
	assert_true(db_mqtt_host_allows(&host, now + 1));
	/* It comes while everybody waits. */
	db_mqtt_host_connect(&host, &config, 0);
	db_mqtt_host_take(&host, online, strlen(online), now, 1500);
	assert_false(db_mqtt_host_allows(&host, now));
	assert_null(db_mqtt_host_complain(&host, now, &due));
	assert_true(due == now + 5 * DB_NS_PER_S);
	assert_false(db_mqtt_host_allows(&host, due - 1));
	assert_true(db_mqtt_host_allows(&host, due));
	/* Said once more, the moment stays. */
	db_mqtt_host_take(&host, online, strlen(online), now + 1, 999);
	assert_true(db_mqtt_host_allows(&host, due));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_without_one_nobody_waits),
		cmocka_unit_test(test_only_its_newest_state_counts),
		cmocka_unit_test(test_another_broker_is_tried),
		cmocka_unit_test(test_births_are_spread),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
