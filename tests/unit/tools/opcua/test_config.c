/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/config.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void expect(const char *text, const char *messages)
{
	struct db_opcua_config config;
	char *said = NULL;
	size_t size;
	FILE *out = open_memstream(&said, &size);

	assert_non_null(out);
	assert_int_equal(
		db_settings_parse(&db_opcua_form, text, "opcua.conf", out, &config, "pump-house"),
		messages[0] == '\0' || strstr(messages, "warning") != NULL);
	(void)fclose(out);
	assert_string_equal(said, messages);
	free(said);
	db_settings_free(&db_opcua_form, &config);
}

static void test_what_holds_when_nothing_is_said(void **state)
{
	struct db_opcua_config config;

	(void)state;
	assert_true(
		db_settings_parse(&db_opcua_form, "", "opcua.conf", stderr, &config, "pump-house"));
	assert_string_equal(config.socket, "/run/drivebridge/control");
	assert_string_equal(config.gateway, "pump-house");
	assert_int_equal(config.port, 4840);
	assert_int_equal(config.none, DB_OPCUA_OFF);
	assert_int_equal(config.anonymous, DB_OPCUA_OFF);
	assert_int_equal(config.confirm_ms, 250);
	assert_true(db_opcua_config_shows(&config, DB_OPCUA_HISTORY));
	db_settings_free(&db_opcua_form, &config);
}

static void test_clients_that_are_connected_to(void **state)
{
	static const char *const wrong[] = {
		"10.0.0.7:4844",
		"opc.tcp://scada:4844",
		"opc.tcp://10.0.0.7",
		"opc.tcp://10.0.0.7:",
		"opc.tcp://10.0.0.7:0",
		"opc.tcp://10.0.0.7:65536",
		"opc.tcp://10.0.0.7:4844/",
		"opc.tcp://10.0.0.7: 4844",
		"opc.tcp://[fd00::7:4844",
		"opc.tcp://[10.0.0.7]:4844",
		"opc.tcp://0123456789012345678901234567890123456789012345678901234567890:1",
	};
	struct db_opcua_config config;

	(void)state;
	assert_true(db_settings_parse(&db_opcua_form,
	                              "server {\n reverse-connect = {\"opc.tcp://10.0.0.7:4844\", "
	                              "\"opc.tcp://[fd00::7]:65535\"}\n}",
	                              "opcua.conf", stderr, &config, "pump-house"));
	assert_string_equal(config.reverse_connect.names, "opc.tcp://10.0.0.7:4844");
	db_settings_free(&db_opcua_form, &config);
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		char text[160];
		char said[240];

		(void)snprintf(text, sizeof(text), "server {\n reverse-connect = {\"%s\"}\n}",
		               wrong[i]);
		(void)snprintf(said, sizeof(said),
		               "opcua.conf:2: reverse-connect has '%s'; write an address as "
		               "numbers with its port, as in opc.tcp://10.0.0.7:4844\n",
		               wrong[i]);
		expect(text, said);
	}
}

static void test_what_is_shown_is_chosen(void **state)
{
	struct db_opcua_config config;

	(void)state;
	assert_true(db_settings_parse(&db_opcua_form, "server {\n show = {\"Parameters\"}\n}",
	                              "opcua.conf", stderr, &config, "pump-house"));
	assert_true(db_opcua_config_shows(&config, DB_OPCUA_PROCESS));
	assert_true(db_opcua_config_shows(&config, DB_OPCUA_PARAMETERS));
	assert_false(db_opcua_config_shows(&config, DB_OPCUA_BITS));
	db_settings_free(&db_opcua_form, &config);
	expect("server {\n show = {\"Bits\", \"Bytes\"}\n}",
	       "opcua.conf:2: show has 'Bytes'; there are CommandBlock, Parameters, Service, "
	       "Bits and History\n");
}

static void test_slips_are_said(void **state)
{
	(void)state;
	expect("server {\n gateway = \"pump,house\"\n}",
	       "opcua.conf:2: gateway = pump,house cannot be a part of a certificate: letters, "
	       "digits, - . and _ only\n");
	expect("security {\n anonymous = read\n}",
	       "opcua.conf:2: warning: with anonymous = read everybody who reaches the port reads\n");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_holds_when_nothing_is_said),
		cmocka_unit_test(test_clients_that_are_connected_to),
		cmocka_unit_test(test_what_is_shown_is_chosen),
		cmocka_unit_test(test_slips_are_said),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
