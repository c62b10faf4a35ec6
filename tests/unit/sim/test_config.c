/* SPDX-License-Identifier: Apache-2.0 */
/* The simulator's configuration: how it may be written, what holds when nothing is said, what is
 * refused. */
#include "sim/sim_config.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define LINE "bus b { }\ndrive d { bus = b }\n"

/* Loads a text as configuration file; what was reported goes to `errors`. */
static int load(const char *text, struct sim_config *config, char *errors, size_t size)
{
	char path[] = "/tmp/sim-config-XXXXXX";
	int fd = mkstemp(path);
	FILE *sink = tmpfile();
	int saved = dup(STDERR_FILENO);
	size_t length;
	int result;

	assert_true(fd >= 0 && saved >= 0 && sink);
	assert_int_equal(write(fd, text, strlen(text)), strlen(text));
	fflush(stderr);
	assert_true(dup2(fileno(sink), STDERR_FILENO) >= 0);
	result = sim_config_load(path, config);
	fflush(stderr);
	assert_true(dup2(saved, STDERR_FILENO) >= 0);
	rewind(sink);
	length = fread(errors, 1, size - 1, sink);
	errors[length] = '\0';
	fclose(sink);
	close(saved);
	close(fd);
	unlink(path);
	return result;
}

static void load_good(const char *text, struct sim_config *config)
{
	char errors[1024];

	if (load(text, config, errors, sizeof(errors)) != 0)
		fail_msg("%s\n%s", text, errors);
	assert_string_equal(errors, "");
}

static void expect_refused(const char *text, const char *message)
{
	struct sim_config config;
	char errors[2048];

	if (load(text, &config, errors, sizeof(errors)) == 0)
		fail_msg("accepted: %s", text);
	if (!strstr(errors, message))
		fail_msg("\"%s\" lacks \"%s\"", errors, message);
}

/* What stands behind `link =`, and what it means. */
static const struct {
	const char *written;
	const char *value;
} TEXTS[] = {
	{ "x", "x" },
	{ "\"/a b\"", "/a b" },
	{ "'/a b'", "/a b" },
	{ "/tmp/x", "/tmp/x" },
	{ "\"\"", "" },
	{ "\"a \\\"b\\\"\"", "a \"b\"" },
	{ "\"a\\\\b\"", "a\\b" },
	{ "'it\\'s'", "it's" },
	{ "'a\\\\b'", "a\\b" },
	{ "'a\\nb'", "a\\nb" },
	{ "'a\\\"b'", "a\\\"b" },
	{ "\"\\n\\t\\r\\a\\b\\f\\v\\e\"", "\n\t\r\a\b\f\v\033" },
	{ "\"\\x41\\x6a\\xa\"", "Aj\n" },
	{ "\"\\101\\7\\12x\"", "A\a\nx" },
	{ "\"a\\qb\\'\\$\"", "aqb'$" },
	{ "\"a\nb\"", "a\nb" },
	{ "'a\nb'", "a\nb" },
	{ "\"a\\\nb\"", "ab" },
	{ "'a\\\nb'", "ab" },
	{ "${SIM_TEST}", "a value" },
	{ "\"${SIM_TEST}\"", "a value" },
	{ "\"<${SIM_TEST}|${SIM_TEST}>\"", "<a value|a value>" },
	{ "'${SIM_TEST}'", "${SIM_TEST}" },
	{ "\"${SIM_NONE}\"", "" },
	{ "\"${SIM_NONE:-else}\"", "else" },
	{ "\"${SIM_TEST:-else}\"", "a value" },
	{ "${SIM_NONE:-else}", "else" },
	{ "\"$SIM_TEST\"", "$SIM_TEST" },
	{ "$SIM_TEST", "$SIM_TEST" },
	{ "\"\\${SIM_TEST}\"", "${SIM_TEST}" },
	{ "a\\b", "a\\b" },
	{ "\\x41", "\\x41" },
	{ "\"#//*\"", "#//*" },
	{ "x # a comment\n", "x" },
	{ "x // a comment\n", "x" },
	{ "x /* a\n comment */", "x" },
	{ "a/b", "a/b" },
	{ "/tmp//x", "/tmp//x" },
	{ "x/ ", "x/" },
	{ "[x]", "[x]" },
	{ "a\xE2\x80\x93z", "a\xE2\x80\x93z" },
	{ "x /**/", "x" },
	{ "x /***/", "x" },
	{ "\n\r\n x", "x" },
};

static void texts_say_the_same_in_every_spelling(void **state)
{
	(void)state;
	assert_int_equal(setenv("SIM_TEST", "a value", 1), 0);
	assert_int_equal(unsetenv("SIM_NONE"), 0);
	for (size_t i = 0; i < sizeof(TEXTS) / sizeof(TEXTS[0]); i++) {
		struct sim_config config;
		char text[256];

		snprintf(text, sizeof(text), "bus b { link =%s baud = 9600 }\ndrive d { bus = b }",
		         TEXTS[i].written);
		load_good(text, &config);
		if (strcmp(config.buses[0].link, TEXTS[i].value) != 0)
			fail_msg("%s: %s", TEXTS[i].written, config.buses[0].link);
		assert_int_equal(config.buses[0].serial.baud, 9600);
		sim_config_free(&config);
	}
}

/* What stands in a bus, and how many faults that is, the last of them "corrupt 1". */
static const struct {
	const char *written;
	size_t count;
} LISTS[] = {
	{ "fault = {\"corrupt 1\"}", 1 },
	{ "fault = {\"drop 1\", 'corrupt 1'}", 2 },
	{ "fault = {\"drop 1\", 'corrupt 1',}", 2 },
	{ "fault = \"corrupt 1\"", 1 },
	{ "fault = {\n\"drop 1\"\n,\n\"corrupt 1\"\n}", 2 },
	{ "fault = {\"drop 1\"} fault += {\"corrupt 1\"}", 2 },
	{ "fault += {\"drop 1\", \"corrupt 1\"}", 2 },
	{ "fault += \"corrupt 1\"", 1 },
	{ "fault = \"drop 1\" fault += \"corrupt 1\"", 2 },
	/* The last one counts. */
	{ "fault = {\"drop 1\", \"drop 2\"} fault = {\"corrupt 1\"}", 1 },
	{ "fault = {}", 0 },
	{ "fault = {\"drop 1\"} fault = {}", 0 },
	{ "", 0 },
};

static void lists_say_the_same_in_every_spelling(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(LISTS) / sizeof(LISTS[0]); i++) {
		const struct sim_bus_config *bus;
		struct sim_config config;
		char text[256];

		snprintf(text, sizeof(text), "bus b { %s }\ndrive d { bus = b }", LISTS[i].written);
		load_good(text, &config);
		bus = &config.buses[0];
		if (bus->fault_count != LISTS[i].count)
			fail_msg("%s: %zu faults", LISTS[i].written, bus->fault_count);
		if (bus->fault_count > 0)
			assert_string_equal(bus->faults[bus->fault_count - 1], "corrupt 1");
		sim_config_free(&config);
	}
}

static const struct {
	const char *written;
	unsigned value;
} NUMBERS[] = {
	{ "9600", 9600 },      { "\"9600\"", 9600 }, { "'9600'", 9600 },
	{ "0x2580", 9600 },    { "022600", 9600 },   { "\" 9600\"", 9600 },
	{ "\"+9600\"", 9600 }, { "0X2580", 9600 },   { "${SIM_BAUD}", 9600 },
};

static void numbers_say_the_same_in_every_spelling(void **state)
{
	(void)state;
	assert_int_equal(setenv("SIM_BAUD", "9600", 1), 0);
	for (size_t i = 0; i < sizeof(NUMBERS) / sizeof(NUMBERS[0]); i++) {
		struct sim_config config;
		char text[256];

		/* The last one counts. */
		snprintf(text, sizeof(text), "bus b { baud = 4800 baud = %s }\ndrive d { bus = b }",
		         NUMBERS[i].written);
		load_good(text, &config);
		assert_int_equal(config.buses[0].serial.baud, NUMBERS[i].value);
		sim_config_free(&config);
	}
}

static const struct {
	const char *written;
	bool value;
} BOOLEANS[] = {
	{ "true", true },    { "yes", true },    { "on", true },  { "TRUE", true },
	{ "\"Yes\"", true }, { "false", false }, { "no", false }, { "off", false },
	{ "False", false },  { "OFF", false },
};

static void booleans_and_reals_are_read(void **state)
{
	static const char *const reals[] = { "2.5",      "\"2.5\"", "25e-1",
		                             "\"+2.5\"", "0x2.8",   "\" 2.5\"" };

	(void)state;
	for (size_t i = 0; i < sizeof(BOOLEANS) / sizeof(BOOLEANS[0]); i++) {
		struct sim_config config;
		char text[256];

		snprintf(text, sizeof(text), "bus b { }\ndrive d { bus = b closed-loop = %s }",
		         BOOLEANS[i].written);
		load_good(text, &config);
		assert_int_equal(config.drives[0].vsmd.closed_loop, BOOLEANS[i].value);
		sim_config_free(&config);
	}
	for (size_t i = 0; i < sizeof(reals) / sizeof(reals[0]); i++) {
		struct sim_config config;
		char text[256];

		snprintf(text, sizeof(text), "bus b { }\ndrive d { bus = b max-current = %s }",
		         reals[i]);
		load_good(text, &config);
		assert_true(config.drives[0].vsmd.max_current >= 2.5 &&
		            config.drives[0].vsmd.max_current <= 2.5);
		sim_config_free(&config);
	}
}

static const char *const FILES[] = {
	"bus b { }\ndrive d { bus = b }\n",
	"drive d { bus = b }\nbus b { }\n",
	"bus \"b\" { device = pty }\ndrive 'd' { bus = \"b\" }\n",
	"bus b{}drive d{bus=b}",
	"\"bus\" b { 'device' = pty }\ndrive d { \"bus\" = b }\n",
	"bus \"\\x62\" { }\ndrive d { bus = b }\n",
	"bus b\r\n{\r\n}\r\ndrive d {\r\nbus = b\r\n}\r\n",
	"# a comment\nbus b { } // another\ndrive d { /* a third */ bus = b }\n",
	"bus\nb\n{\n}\ndrive\nd\n{\nbus\n=\nb\n}\n",
};

static void files_say_the_same_in_every_spelling(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(FILES) / sizeof(FILES[0]); i++) {
		struct sim_config config;

		load_good(FILES[i], &config);
		assert_int_equal(config.bus_count, 1);
		assert_string_equal(config.buses[0].name, "b");
		assert_string_equal(config.buses[0].device, "pty");
		assert_int_equal(config.drive_count, 1);
		assert_string_equal(config.drives[0].name, "d");
		assert_int_equal(config.drives[0].bus, 0);
		sim_config_free(&config);
	}
}

static void what_is_not_said_has_its_preset(void **state)
{
	struct sim_config config;
	const struct sim_vsmd_config *vsmd;

	(void)state;
	load_good(LINE, &config);
	assert_int_equal(config.buses[0].kind, SIM_BUS_VSMD_SERIAL);
	assert_null(config.buses[0].link);
	assert_null(config.buses[0].flash);
	assert_int_equal(config.buses[0].serial.baud, 115200);
	assert_true(config.buses[0].serial.rs485);
	assert_true(config.buses[0].serial.paced);
	assert_int_equal(config.buses[0].serial.reply_id, 1);
	assert_int_equal(config.buses[0].serial.latency, 800 * DB_NS_PER_US);
	assert_int_equal(config.buses[0].serial.turnaround, 0);
	vsmd = &config.drives[0].vsmd;
	assert_string_equal(vsmd->identity, "VSMD113_025T-1.0.008.170428");
	assert_false(vsmd->closed_loop);
	assert_true(vsmd->max_current >= 2.5 && vsmd->max_current <= 2.5);
	assert_true(vsmd->travel_min <= -1e9 && vsmd->travel_max >= 1e9);
	sim_config_free(&config);
	load_good("bus b { protocol = xyza }\ndrive d { bus = b }\n", &config);
	assert_int_equal(config.drives[0].xyza.axes, XYZA_AXIS_COUNT);
	assert_int_equal(config.drives[0].xyza.step_time, 500 * DB_NS_PER_MS);
	assert_false(config.drives[0].xyza.temper.no_negative_zero);
	sim_config_free(&config);
	load_good("bus b { protocol = servo-can }\ndrive d { bus = b }\n", &config);
	assert_true(config.buses[0].can.adapter);
	assert_int_equal(config.buses[0].can.bitrate, 100000);
	assert_int_equal(config.buses[0].layout.ack_base, 1);
	assert_false(config.buses[0].layout.words.set);
	assert_int_equal(config.drives[0].servo.reports[SIM_SERVO_REPORT_HEALTH], DB_NS_PER_S);
	sim_config_free(&config);
}

static const struct {
	const char *text;
	const char *message;
} WRONG[] = {
	{ "bus b { baud = fast }\ndrive d { bus = b }", ":1: " },
	{ "bus b {\n baud = fast }\ndrive d { bus = b }", ":2: " },
	{ "bus b {\n baud = fast }\ndrive d { bus = b }", "a whole number is right" },
	{ "bus b { baud = 9600x }\ndrive d { bus = b }", "a whole number is right" },
	{ "bus b { baud = 9600.5 }\ndrive d { bus = b }", "a whole number is right" },
	{ "bus b { baud = 99999999999999999999 }\ndrive d { bus = b }", ":1: " },
	{ "bus b { }\ndrive d { bus = b start = here }", "a number is right" },
	{ "bus b { }\ndrive d { bus = b start = 1,5 }", ":2: " },
	{ "bus b { }\ndrive d { bus = b external = maybe }", "true or false is right" },
	{ "bus b { }\ndrive d { bus = b\n axes = four }", ":3: " },
	{ "bus b { baud 9600 }\ndrive d { bus = b }", ":1: " },
	{ "bus b { baud = }\ndrive d { bus = b }", ":1: " },
	{ "bus b { baud = {9600} }\ndrive d { bus = b }", ":1: " },
	{ "bus b { fault = {\"drop 1\" \"drop 2\"} }\ndrive d { bus = b }", ":1: " },
	{ "bus b { fault = {,} }\ndrive d { bus = b }", ":1: " },
	{ "bus { }\ndrive d { bus = b }", ":1: " },
	{ "bus b baud = 9600\ndrive d { bus = b }", ":1: " },
	{ "bus b { ", ": " },
	{ "bus b { }}\ndrive d { bus = b }", ":1: " },
	{ "bus b { link = \"x }\ndrive d { bus = b }", ": " },
	{ "bus b { link = \"\\9\" }\ndrive d { bus = b }", ": " },
	{ "bus b { }\nbus b { }\ndrive d { bus = b }", ":2: " },
	{ "bus b { }\nbus b { }\ndrive d { bus = b }", "a name of its own" },
	{ "bus b { }\ndrive d { bus = b }\ndrive d { bus = b address = 2 }", ":3: " },
	{ "bus b { }\ndrive b { bus = b }", "name of a bus" },
	{ "modbus { }\n" LINE, ":1: no such option 'modbus'" },
	{ "baud = 9600\n" LINE, ":1: no such option 'baud'" },
	{ "bus b { colour = red }\ndrive d { bus = b }", "known here: protocol device link baud" },
	{ "bus b { }\ndrive d { bus = b colour = red }", "latches-speed takes-any idle-state" },
	{ "bus b { }\ndrive d { bus = b colour = red }", " sensor set fault" },
	{ "bus b { protocol = abc }\ndrive d { bus = b }",
	  "protocol = \"abc\" is unknown; one of these is right: vsmd-serial, vsmd-can, servo-can, xyza" },
	{ "bus b {\n\n baud = 1 }\ndrive d { bus = b }",
	  ":3: baud = 1 is out of range; 2400 to 921600 is right" },
	{ "bus b { protocol = vsmd-can transport = socketcan }\ndrive d { bus = b }",
	  "transport = socketcan needs interface = NAME" },
	{ "bus b { protocol = servo-can command-word-base = 1 }\ndrive d { bus = b }",
	  "frames cannot be so" },
	{ "bus b { fault = {\"drop\", \"x\"} }\ndrive d { bus = b }", "fault \"x\": " },
	{ "bus b { }\ndrive d { bus = b max-current = 0 }", "max-current must be above 0" },
	{ "bus b { }\ndrive d { bus = b start = 5 travel-max = 4 }", "start must lie between" },
	{ "bus b { }\ndrive d { bus = b lacks = {\"zz\"} }", "lacks \"zz\" cannot be read" },
	{ "", "at least one bus" },
};

static void wrong_files_are_refused(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(WRONG) / sizeof(WRONG[0]); i++)
		expect_refused(WRONG[i].text, WRONG[i].message);
}

static void unreadable_files_are_refused(void **state)
{
	struct sim_config config;

	(void)state;
	assert_int_equal(sim_config_load("/nonexistent/file", &config), -1);
	assert_int_equal(sim_config_load("/", &config), -1);
}

static void every_drive_is_looked_at(void **state)
{
	struct sim_config config;
	char errors[2048];

	(void)state;
	assert_int_equal(load("bus b { }\ndrive d { bus = b address = 0 }\n"
	                      "drive e { bus = b address = 99 }\n",
	                      &config, errors, sizeof(errors)),
	                 -1);
	assert_non_null(strstr(errors, ":2: address = 0"));
	assert_non_null(strstr(errors, ":3: address = 99"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(texts_say_the_same_in_every_spelling),
		cmocka_unit_test(lists_say_the_same_in_every_spelling),
		cmocka_unit_test(numbers_say_the_same_in_every_spelling),
		cmocka_unit_test(booleans_and_reals_are_read),
		cmocka_unit_test(files_say_the_same_in_every_spelling),
		cmocka_unit_test(what_is_not_said_has_its_preset),
		cmocka_unit_test(wrong_files_are_refused),
		cmocka_unit_test(unreadable_files_are_refused),
		cmocka_unit_test(every_drive_is_looked_at),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
