/* SPDX-License-Identifier: Apache-2.0 */
/* Records of the audit trail in words, and in the Common Event Format. */
#include "capture/audit_text.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static json_t *record_of(const char *text)
{
	json_t *record = json_loads(text, 0, NULL);

	assert_non_null(record);
	return record;
}

static void test_words(void **state)
{
	static const struct {
		const char *record;
		const char *words;
		bool refused;
	} rows[] = {
		{ "{\"kind\": \"command\", \"what\": \"move_absolute\", \"arguments\": "
		  "{\"target_position\": 640}, \"result\": \"pending\"}",
		  "move_absolute target_position=640", false },
		{ "{\"kind\": \"write\", \"values\": {\"acc\": [null, 2.5]}, \"result\": \"limit\"}",
		  "write acc null -> 2.5", true },
		{ "{\"kind\": \"end\", \"what\": \"enable\", \"of\": 7, \"result\": \"ok\"}",
		  "end: enable (of 7)", false },
		{ "{\"kind\": \"denied\", \"what\": \"write\", \"register\": 9, \"unit\": 2, "
		  "\"text\": \"a\\u001bb\"}",
		  "denied: write register 9 unit 2, a?b", true },
		{ "{\"kind\": \"repeated\", \"count\": 47}", "repeated 47 times", false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		json_t *record = record_of(rows[i].record);
		char *words = db_capture_audit_describe(record);

		assert_string_equal(words, rows[i].words);
		assert_int_equal(db_capture_audit_is_refused(record), rows[i].refused);
		free(words);
		json_decref(record);
	}
}

static void test_ways(void **state)
{
	static const struct {
		const char *who;
		const char *way;
	} rows[] = {
		{ "control, user drivebridge-web for anna, page, 10.0.0.5", "page" },
		{ "control, user drivebridge-web, page, 10.0.0.5", "page" },
		{ "control, user drivebridge-opcua for otto, OPC UA, 10.0.0.5", "OPC UA" },
		{ "control, user drivebridge-mqtt for otto, MQTT", "MQTT" },
		{ "control, user drivebridge-mqtt for otto, page, MQTT", "MQTT" },
		{ "control, user page", "control socket" },
		{ "192.168.10.5 port 51234", "Modbus" },
		{ "127.0.0.1, user root", "Modbus" },
		{ "192.168.10.5, certificate press-7, role operator", "Modbus over TLS" },
		{ "rtu press-plc", "Modbus RTU" },
		{ "drivebridged", "service" },
		{ "", "service" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		json_t *record = json_pack("{s:s}", "who", rows[i].who);

		assert_string_equal(db_capture_audit_way(record), rows[i].way);
		json_decref(record);
	}
}

static void test_cef(void **state)
{
	json_t *record = record_of("{\"number\": 7, \"time_us\": 1700000000000000, \"kind\": "
	                           "\"command\", \"what\": \"a|b\", \"who\": \"x=y\", \"drive\": "
	                           "\"lift\", \"address\": \"10.0.0.5\", \"port\": 502, "
	                           "\"result\": \"limit\"}");
	char *line = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&line, &size);

	(void)state;
	assert_non_null(out);
	db_capture_audit_write_cef(record, out);
	assert_int_equal(fclose(out), 0);
	assert_non_null(strstr(line, "|command|a\\|b|6|rt=1700000000000 externalId=7 src=10.0.0.5 "
	                             "spt=502 outcome=limit cs1Label=drive cs1=lift cs2Label=who "
	                             "cs2=x\\=y msg=a|b\n"));
	free(line);
	json_decref(record);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_words),
		cmocka_unit_test(test_ways),
		cmocka_unit_test(test_cef),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
