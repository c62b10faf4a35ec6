/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/config.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

static void expect(const char *text, const char *messages)
{
	struct db_mqtt_config config;
	char *said = NULL;
	size_t size;
	FILE *out = open_memstream(&said, &size);

	assert_non_null(out);
	assert_int_equal(
		db_settings_parse(&db_mqtt_form, text, "mqtt.conf", out, &config, "pump-house"),
		messages[0] == '\0' || strstr(messages, "warning") != NULL);
	(void)fclose(out);
	if (strcmp(said, messages) != 0)
		print_message("%s", said);
	assert_string_equal(said, messages);
	free(said);
	db_settings_free(&db_mqtt_form, &config);
}

static void test_what_holds_when_little_is_said(void **state)
{
	struct db_mqtt_config config;

	(void)state;
	assert_true(db_settings_parse(&db_mqtt_form, "broker { host = 10.0.0.2 }", "mqtt.conf",
	                              stderr, &config, "pump-house"));
	assert_string_equal(config.host, "10.0.0.2");
	assert_int_equal(config.port, 1883);
	assert_string_equal(config.gateway, "pump-house");
	assert_string_equal(config.client_id, "drivebridge-pump-house");
	assert_string_equal(config.socket, "/run/drivebridge/control");
	assert_string_equal(config.prefix, "drivebridge");
	assert_int_equal(config.tls, DB_MQTT_OFF);
	assert_int_equal(config.qos, 1);
	assert_int_equal(config.allow.word, DB_MQTT_ALLOW_NONE);
	assert_int_equal(config.time, DB_MQTT_TIME_REQUIRED);
	assert_false(db_mqtt_config_commands(&config));
	db_settings_free(&db_mqtt_form, &config);
}

static void test_lists(void **state)
{
	struct db_mqtt_config config;

	(void)state;
	assert_true(db_settings_parse(&db_mqtt_form,
	                              "broker { host = b }\n"
	                              "publish { drives = {\"lift\", \"feeder\"}\n values = all }\n"
	                              "command { allow = {} }",
	                              "mqtt.conf", stderr, &config, "gw"));
	assert_true(db_setting_list_has(&config.drives, "feeder"));
	assert_false(db_setting_list_has(&config.drives, "feed"));
	assert_int_equal(config.values.word, 1);
	assert_int_equal(config.allow.word, DB_SETTING_NAMED);
	assert_false(db_setting_list_has(&config.allow, ""));
	db_settings_free(&db_mqtt_form, &config);
}

static void test_errors_with_their_lines(void **state)
{
	(void)state;
	expect("",
	       "mqtt.conf: host must be given in section broker: Address or name of the broker; "
	       "with tls the name that its certificate has\n");
	expect("broker {\n host = b\n port = 0\n}",
	       "mqtt.conf:3: port = 0 is no whole number from 1 to 65535\n");
	expect("broker {\n host = b\n keepalive-s = 4\n}",
	       "mqtt.conf:3: keepalive-s = 4 is no whole number from 5 to 600 s\n");
	expect("broker {\n host = b\n tls = yes\n}",
	       "mqtt.conf:3: tls = yes is none of its words; one of: off on\n");
	expect("broker {\n host = {b}\n}",
	       "mqtt.conf:2: host has one value, not a list; write host = VALUE\n");
	expect("broker {\n host = b\n host = c\n}",
	       "mqtt.conf:3: host is set on line 2 already; remove one of them\n");
	expect("broker {\n host = b\n}\nbroker { }",
	       "mqtt.conf:4: there is a section broker already; write all its keys there\n");
	expect("broker x { host = b }",
	       "mqtt.conf: host must be given in section broker: Address or name of the broker; with "
	       "tls the name that its certificate has\n"
	       "mqtt.conf:1: section broker has no name, but 'x' was given; write broker {\n");
	expect("broker { host = b }\ndrive { }",
	       "mqtt.conf:2: unknown section 'drive'; there are service, broker, publish, sparkplug and command\n");
	expect("broker { host = b }\nservice { sockt = a }",
	       "mqtt.conf:2: unknown key 'sockt' in section service; there are: socket\n");
	expect("broker { host = b }\ncommand { allow = some }",
	       "mqtt.conf:2: allow = some is none of its words; one of: none stop all, or a list of "
	       "names such as {\"a\", \"b\"}\n");
	expect("broker { host = b }\npublish {\n prefix = \"a/#\"\n gateway = \"a/b\"\n}",
	       "mqtt.conf:3: prefix = a/# cannot be a part of topics: no + and #, no $ first, no empty "
	       "level\n"
	       "mqtt.conf:4: gateway = a/b cannot be a part of topics: no + and #, no $ first, no empty "
	       "level, no /\n");
	expect("broker {\n host = b\n mqtt-version = 3.1.1\n}\ncommand { allow = stop }",
	       "mqtt.conf:3: commands need mqtt-version = 5: in 3.1.1 a message does not show that it was "
	       "published as a retained one\n");
	expect("broker {\n host = b\n certificate-file = \"/c\"\n}",
	       "mqtt.conf:3: certificate-file and key-file belong together; set both or none\n"
	       "mqtt.conf:3: certificate-file is for tls = on\n");
}

static void test_secrets(void **state)
{
	char path[] = "/tmp/drivebridge-password-XXXXXX";
	char text[256], said[512];
	int fd = mkstemp(path);

	(void)state;
	assert_true(fd >= 0);
	(void)snprintf(text, sizeof(text),
	               "broker {\n host = b\n user = u\n password-file = \"%s\"\n}", path);
	(void)snprintf(
		said, sizeof(said),
		"mqtt.conf:4: password-file = %s has nothing in its first line\n"
		"mqtt.conf:4: warning: without tls the password goes over the network as it is\n",
		path);
	/* A warning alone is no error. */
	assert_int_equal(write(fd, "secret\n", 7), 7);
	(void)fchmod(fd, 0640);
	expect(text, strchr(said, '\n') + 1);
	(void)fchmod(fd, 0644);
	(void)snprintf(
		said, sizeof(said),
		"mqtt.conf:4: password-file = %s can be read or written by everybody: chmod 0640 "
		"%s, and chgrp it to the group drivebridge-mqtt\n",
		path, path);
	{
		struct db_mqtt_config config;
		char *told = NULL;
		size_t size;
		FILE *out = open_memstream(&told, &size);

		assert_non_null(out);
		assert_false(
			db_settings_parse(&db_mqtt_form, text, "mqtt.conf", out, &config, "gw"));
		(void)fclose(out);
		assert_non_null(strstr(told, said));
		assert_null(strstr(told, "secret"));
		free(told);
		db_settings_free(&db_mqtt_form, &config);
	}
	(void)unlink(path);
	(void)close(fd);
	assert_false(db_settings_load(&db_mqtt_form, "/nonexistent/mqtt.conf", stderr,
	                              &(struct db_mqtt_config){ .socket = NULL }, "gw"));
}

/* What is damaged is not taken for a shorter file. */
static void test_a_file_with_a_zero_byte(void **state)
{
	static const char text[] = "broker {\n host = a\n}\n\0command {\n allow = all\n}\n";
	char path[] = "/tmp/drivebridge-mqtt-XXXXXX";
	int fd = mkstemp(path);
	struct db_mqtt_config config;
	char *told = NULL;
	size_t size;
	FILE *out = open_memstream(&told, &size);

	(void)state;
	assert_true(fd >= 0);
	assert_int_equal(write(fd, text, sizeof(text) - 1), sizeof(text) - 1);
	assert_false(db_settings_load(&db_mqtt_form, path, out, &config, "gw"));
	(void)fclose(out);
	assert_non_null(strstr(told, ":4: there is a zero byte"));
	free(told);
	db_settings_free(&db_mqtt_form, &config);
	(void)unlink(path);
	(void)close(fd);
}

/* The file that is installed shows every key with what holds without it. */
static void test_the_installed_file_shows_all(void **state)
{
	FILE *file = fopen(DRIVEBRIDGE_SOURCE_DIR "/conf/mqtt.conf", "re");
	char text[8192] = "", name[64];
	const char *line;

	(void)state;
	assert_non_null(file);
	assert_true(fread(text, 1, sizeof(text) - 1, file) > 0);
	(void)fclose(file);
	for (const struct db_setting *key = db_mqtt_keys; key->name; key++) {
		size_t length = strlen(key->preset ? key->preset : "");

		(void)snprintf(name, sizeof(name), "\n#\t%s ", key->name);
		line = strstr(text, name);
		/* The second section with a key of that name. */
		if (line && strcmp(key->section, "command") == 0)
			line = strstr(strstr(text, "\ncommand {"), name);
		if (!line)
			print_message("%s is not there\n", key->name);
		assert_non_null(line);
		line = strchr(line, '=') + 2;
		line += line[0] == '"';
		if (length > 0)
			assert_memory_equal(line, key->preset, length);
	}
}

static void test_several_brokers(void **state)
{
	static const struct {
		const char *host;
		unsigned port;
	} expected[] = { { "10.0.0.2", 1884 }, { "10.0.0.3", 1884 }, { "b.example", 1885 },
		         { "fe80::1", 1884 },  { "fe80::2", 1886 },  { "fe80::3", 1884 } };
	struct db_mqtt_config config;

	(void)state;
	assert_true(db_settings_parse(
		&db_mqtt_form,
		"broker { host = 10.0.0.2 port = 1884 others = {\"10.0.0.3\", "
		"\"b.example:1885\", \"fe80::1\", \"[fe80::2]:1886\", \"[fe80::3]\"} }",
		"mqtt.conf", stderr, &config, "pump-house"));
	assert_int_equal(config.address_count, sizeof(expected) / sizeof(expected[0]));
	for (size_t i = 0; i < config.address_count; i++) {
		assert_string_equal(config.addresses[i].host, expected[i].host);
		assert_int_equal(config.addresses[i].port, expected[i].port);
	}
	db_settings_free(&db_mqtt_form, &config);
}

static void test_what_is_no_broker(void **state)
{
	static const char *const wrong[] = { ":1883", "b:",       "b:0",     "b:65536", "b:1x",
		                             "b:-1",  "[fe80::1", "[]:1883", "[::1]x",  "b:+1" };
	char text[160], messages[160];

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		(void)snprintf(text, sizeof(text), "broker { host = a\nothers = {\"%s\"} }",
		               wrong[i]);
		(void)snprintf(messages, sizeof(messages),
		               "mqtt.conf:2: others: '%s' is no HOST or HOST:PORT\n", wrong[i]);
		expect(text, messages);
	}
}

static void test_what_goes_with_sparkplug(void **state)
{
	(void)state;
	expect("broker { host = a }\nsparkplug {\ngroup = x\n}",
	       "mqtt.conf:3: group is for payload = sparkplug\n");
	expect("broker { host = a }\npublish {\npayload = sparkplug\ndiscovery = homeassistant\n}\n"
	       "command {\ntime = optional\nsenders = topic\n}\nsparkplug { group = \"a/b\"\n"
	       "primary-host = \"#\" }",
	       "mqtt.conf:4: discovery announces texts; payload = sparkplug has none\n"
	       "mqtt.conf:7: time = optional does not go with payload = sparkplug: a command without "
	       "its time could not be told from one that comes twice\n"
	       "mqtt.conf:8: senders = topic does not go with payload = sparkplug, whose topics have no "
	       "place for a user\n"
	       "mqtt.conf:10: group = a/b cannot be a part of topics: no + and #, no $ first, no empty "
	       "level, no /\n"
	       "mqtt.conf:11: primary-host = # cannot be a part of topics: no + and #, no $ first, no "
	       "empty level, no /\n");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_holds_when_little_is_said),
		cmocka_unit_test(test_several_brokers),
		cmocka_unit_test(test_what_is_no_broker),
		cmocka_unit_test(test_what_goes_with_sparkplug),
		cmocka_unit_test(test_lists),
		cmocka_unit_test(test_errors_with_their_lines),
		cmocka_unit_test(test_secrets),
		cmocka_unit_test(test_a_file_with_a_zero_byte),
		cmocka_unit_test(test_the_installed_file_shows_all),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
