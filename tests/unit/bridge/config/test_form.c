/* SPDX-License-Identifier: Apache-2.0 */
/* How a file may be written: the same value in all its spellings. */
#include "config/config_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define BUS "bus b { protocol = vsmd-serial device = \"/dev/ttyX\" }\n"

static struct db_config *parse_good(const char *text)
{
	struct db_config *config = NULL;
	char *messages;
	size_t size;
	FILE *errors = open_memstream(&messages, &size);

	assert_non_null(errors);
	if (db_load_text(&db_load_built_in, text, "f", errors, &config) != 0) {
		fclose(errors);
		fail_msg("%s\n%s", text, messages);
	}
	fclose(errors);
	free(messages);
	return config;
}

/* What stands behind `unit-name =`, and what it means. */
static const struct {
	const char *written;
	const char *value;
} TEXTS[] = {
	{ "mm", "mm" },
	{ "\"mm\"", "mm" },
	{ "'mm'", "mm" },
	{ "\"a b\"", "a b" },
	{ "\"a \\\"b\\\" c\"", "a \"b\" c" },
	{ "\"a\\\\b\"", "a\\b" },
	{ "'it\\'s'", "it's" },
	{ "'a\\\\b'", "a\\b" },
	{ "'a \"b\"'", "a \"b\"" },
	{ "\"it's\"", "it's" },
	{ "\"\\\\\\\\\"", "\\\\" },
	{ "\"# // /* no comment */\"", "# // /* no comment */" },
	{ "\"{a, b} = (c) + d\"", "{a, b} = (c) + d" },
	{ "\"\ta\t\"", "\ta\t" },
	{ "\" mm \"", " mm " },
	{ "\"\xC2\xB5m\"", "\xC2\xB5m" },
	{ "\xC2\xB5m", "\xC2\xB5m" },
	{ "\"\xE2\x80\x9Cmm\xE2\x80\x9D\"", "\xE2\x80\x9Cmm\xE2\x80\x9D" },
	{ "a/b", "a/b" },
	{ "/a", "/a" },
	{ "a\\b", "a\\b" },
	{ "\\n", "\\n" },
	{ "$", "$" },
	{ "$HOME", "$HOME" },
	{ "\"$HOME\"", "$HOME" },
	{ "a;b", "a;b" },
	{ "a:b.c_d-e%f^g&h|i~j?k!l@m<n>o`", "a:b.c_d-e%f^g&h|i~j?k!l@m<n>o`" },
	{ "[x]:1", "[x]:1" },
	{ "end", "end" },
	{ "drive", "drive" },
	{ "a\f", "a\f" },
	{ "mm# a comment\n", "mm" },
	{ "mm // a comment\n", "mm" },
	{ "mm /* a\n comment */", "mm" },
	{ "/* a comment */ mm", "mm" },
	{ "# a comment\n mm", "mm" },
	{ "\n\n\r\n\t mm", "mm" },
	{ "\"mm\"/* a comment */", "mm" },
};

static void texts_say_the_same_in_every_spelling(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(TEXTS) / sizeof(TEXTS[0]); i++) {
		struct db_config *config;
		char text[256];

		snprintf(text, sizeof(text), BUS "drive d{bus=b address=1 unit=1 unit-name =%s}",
		         TEXTS[i].written);
		config = parse_good(text);
		assert_string_equal(config->drives[0].unit_name, TEXTS[i].value);
		assert_int_equal(config->drives[0].unit, 1);
		db_config_free(config);
	}
}

/* What stands behind `allow-write =`, how many networks that are, and the last byte of the last. */
static const struct {
	const char *written;
	size_t count;
	unsigned last;
} LISTS[] = {
	{ "{1.2.3.4}", 1, 4 },
	{ "{\"1.2.3.4\"}", 1, 4 },
	{ "{'1.2.3.4',}", 1, 4 },
	{ "1.2.3.4", 1, 4 },
	{ "\"1.2.3.4\"", 1, 4 },
	{ "{\"1.2.3.4\", 5.6.7.8}", 2, 8 },
	{ "{\"1.2.3.4\",5.6.7.8,}", 2, 8 },
	{ "{ \"1.2.3.4\" ,\n\t5.6.7.8\n}", 2, 8 },
	{ "{ # a comment\n 1.2.3.4, // another\n 5.6.7.8 /* a\n third */ }", 2, 8 },
	{ "{\"::1\"}", 1, 1 },
	{ "{::1}", 1, 1 },
	{ "{10.0.0.0/8}", 1, 0 },
	/* Nobody. */
	{ "{}", 1, 0 },
	{ "{\n}", 1, 0 },
};

static void lists_say_the_same_in_every_spelling(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(LISTS) / sizeof(LISTS[0]); i++) {
		const struct db_modbus_config *modbus;
		struct db_config *config;
		char text[256];

		snprintf(text, sizeof(text), "modbus{allow-write =%s confirm-ms=7}",
		         LISTS[i].written);
		config = parse_good(text);
		modbus = &config->modbus;
		assert_int_equal(modbus->allow_write_count, LISTS[i].count);
		assert_int_equal(modbus->allow_write[LISTS[i].count - 1].address[15],
		                 LISTS[i].last);
		assert_int_equal(modbus->confirm_ms, 7);
		db_config_free(config);
	}
}

/* Whole files that mean just one bus with one drive. */
static const char *const FILES[] = {
	"modbus { confirm-ms = 7 }" BUS "drive d { bus = b address = 1 unit = 1 }",
	/* In any order. */
	"drive d { unit = 1 address = 1 bus = b }" BUS "modbus { confirm-ms = 7 }\nend",
	/* Quoted names. */
	"modbus { confirm-ms = '7' }bus \"b\" { protocol = \"vsmd-serial\" device = '/dev/ttyX' }"
	"drive 'd' { bus = 'b' address = \"1\" unit = \"1\" }",
	/* Lines as Windows ends them, and nothing between tokens that need nothing. */
	"modbus\r\n{\r\nconfirm-ms\r\n=\r\n7\r\n}\r\n" BUS
	"drive d{bus=b address=1 unit=\"1\"}end\r\n",
	"modbus{confirm-ms=\"7\"}bus b{protocol=vsmd-serial device='/dev/ttyX'}"
	"drive\"d\"{bus=\"b\"address='1'unit=1}end# the end",
	/* Comments everywhere. */
	"/**/modbus /* { */{confirm-ms //=\n=#\n7 /*8*/}#}\n" BUS "// x\n"
	"drive /* e */ d { bus = b address = /*2*/1 unit = 1 } end /* of it */",
};

static void files_say_the_same_in_every_spelling(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(FILES) / sizeof(FILES[0]); i++) {
		struct db_config *config = parse_good(FILES[i]);

		assert_int_equal(config->modbus.confirm_ms, 7);
		assert_int_equal(config->bus_count, 1);
		assert_string_equal(config->buses[0].name, "b");
		assert_string_equal(config->buses[0].device, "/dev/ttyX");
		assert_int_equal(config->drive_count, 1);
		assert_string_equal(config->drives[0].name, "d");
		assert_int_equal(config->drives[0].address, 1);
		assert_int_equal(config->drives[0].unit, 1);
		db_config_free(config);
	}
}

static void an_empty_file_has_the_presets(void **state)
{
	static const char *const EMPTY[] = { "", "\n", " ", "# x", "/* x */", "end", "modbus {}" };

	(void)state;
	for (size_t i = 0; i < sizeof(EMPTY) / sizeof(EMPTY[0]); i++) {
		struct db_config *config = parse_good(EMPTY[i]);

		assert_int_equal(config->modbus.confirm_ms, 40);
		assert_int_equal(config->bus_count, 0);
		db_config_free(config);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(texts_say_the_same_in_every_spelling),
		cmocka_unit_test(lists_say_the_same_in_every_spelling),
		cmocka_unit_test(files_say_the_same_in_every_spelling),
		cmocka_unit_test(an_empty_file_has_the_presets),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
