/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"
#include "config/keys.h"
#include "config/names.h"
#include "config/text.h"
#include "config/times.h"
#include "drivebridge/driver.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define BUS_HEAD "bus b {\n protocol = vsmd-serial\n device = \"/dev/ttyX\"\n"
#define BUS BUS_HEAD "}\n"                      /* lines 1 to 4 */
#define FAST_BUS BUS_HEAD " baud = 115200\n}\n" /* lines 1 to 5 */
#define RS232_BUS BUS_HEAD " line = rs232\n}\n" /* lines 1 to 5 */
#define DRIVE "drive d {\n bus = b\n address = 1\n unit = 1\n}\n"
#define ENDPOINT "endpoint e {\n listen = \"0.0.0.0:503\"\n}\n"
#define DRIVE_OF_E "drive d {\n bus = b\n address = 1\n unit = 1\n endpoint = e\n}\n"
#define VENDOR_DRIVE "drive d {\n bus = b\n address = 1\n unit = 1\n vendor-unit = 9\n}\n"

struct loaded {
	char path[64];
	struct db_config *config;
	char *messages;
	int result;
};

/* Through a real file, as the service does it. To be ended by done(). */
static struct loaded load_bytes(const char *text, size_t length)
{
	struct loaded loaded = { .path = "/tmp/drivebridge-config-XXXXXX" };
	size_t size;
	FILE *errors = open_memstream(&loaded.messages, &size);
	int fd = mkstemp(loaded.path);

	assert_non_null(errors);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, text, length), length);
	close(fd);
	loaded.result = db_config_load(loaded.path, errors, &loaded.config);
	fclose(errors);
	unlink(loaded.path);
	return loaded;
}

static struct loaded load(const char *text)
{
	return load_bytes(text, strlen(text));
}

static void done(struct loaded *loaded)
{
	db_config_free(loaded->config);
	free(loaded->messages);
}

static struct loaded load_good(const char *text)
{
	struct loaded loaded = load(text);

	if (loaded.result != 0)
		print_message("%s\n%s", text, loaded.messages);
	assert_int_equal(loaded.result, 0);
	return loaded;
}

/* The line of messages that is about this line of the file, or null; *length is set. */
static const char *message_of(const struct loaded *loaded, unsigned line, const char *fragment)
{
	char head[96];

	snprintf(head, sizeof(head), "%s:%u: ", loaded->path, line);
	for (const char *at = loaded->messages; *at; at++) {
		size_t length = strcspn(at, "\n");
		const char *found;

		if (strncmp(at, head, strlen(head)) == 0) {
			found = strstr(at, fragment);
			if (found && found < at + length)
				return at;
		}
		at += length;
	}
	return NULL;
}

static size_t count_lines(const char *text)
{
	size_t count = 0;

	for (; *text; text++)
		count += *text == '\n';
	return count;
}

static void expect_message(const struct loaded *loaded, unsigned line, const char *fragment)
{
	if (!message_of(loaded, line, fragment))
		fail_msg("expected line %u with '%s', got:\n%s", line, fragment, loaded->messages);
}

/* ---- wrong files ---- */

struct wrong_case {
	const char *text;
	unsigned line;
	const char *fragment;
};

static const struct wrong_case WRONG[] = {
	/* Form. */
	{ "modbus {\n confirm-ms 40\n}\n", 2, "expected = after the key" },
	{ "modbus {\n confirm-ms =\n}\n", 3, "expected the value of 'confirm-ms'" },
	{ "modbus {\n", 2, "the file ends too early" },
	{ "modbus\n{\n}\n}\n", 4, "'}' cannot stand here" },
	{ "modbus {\n listen = \"1.2.3.4:5\n}\n", 2, "has no end" },
	{ "/* never\nclosed", 1, "close it with */" },
	{ "modbus {\n allow-read = {\"::1\" \"::2\"}\n}\n", 2, "expected a comma" },
	{ "modbus {\n listen = \"\\x41\"\n}\n", 2, "unknown escape" },
	{ "modbus {\n listen = \"${HOME}\"\n}\n", 2, "environment variables" },
	{ "modbus {\n listen = ${HOME}\n}\n", 2, "cannot stand here" },
	{ "modbus {\n allow-read += {\"::1\"}\n}\n", 2, "cannot stand here" },
	{ "bus b {\n device = /dev//x\n}\n", 2, "quotes" },
	{ "include(\"x\")\n", 1, "'(' cannot stand here" },
	{ "bus b {\n bus c {\n}\n}\n", 2, "section 'bus' of line 1 has no }" },
	/* Word processors, other languages, other countries. */
	{ "modbus {\n allow-read = [\"::1\"]\n}\n", 2, "braces, not in brackets" },
	{ "modbus {\n allow-read = [::1]\n}\n", 2, "braces, not in brackets" },
	{ "modbus {\n allow-read = \"::1\", \"::2\"\n}\n", 2, "write them in braces" },
	{ "drive d {\n counts-per-unit = 640,5\n}\n", 2, "write 640.5" },
	{ "modbus {\n\xC2\xA0listen = 1\n}\n", 2, "non-breaking space" },
	{ "modbus {\n confirm-ms\xC2\xA0= 40\n}\n", 2, "non-breaking space" },
	{ "modbus {\n listen = \xE2\x80\x9C"
	  "1.2.3.4:5\xE2\x80\x9D\n}\n",
	  2, "plain quotes" },
	{ "drive d {\n min-position = \xE2\x88\x92"
	  "5\n}\n",
	  2, "minus" },
	{ "\xEF\xBB\xBFmodbus {\n}\n", 1, "UTF-8 without byte order mark" },
	/* The end. */
	{ "modbus {\n}\nend\nbus b {\n}\n", 3, "move it to the last line" },
	{ "end {\n}\n", 1, "move it to the last line" },
	{ "end = 1\n", 1, "outside of a section" },
	/* Sections and names. */
	{ "\n\nbuss b {\n}\n", 3, "unknown section 'buss'" },
	{ "confirm-ms = 4\n", 1, "outside of a section" },
	{ "modbus x {\n}\n", 1, "write modbus {" },
	{ "modbus {\n}\nmodbus {\n}\n", 3, "on line 1 already" },
	{ "bus {\n}\n", 1, "'' is no name for a bus" },
	{ "bus \"a b\" {\n}\n", 1, "'a b' is no name for a bus" },
	{ "drive a23456789012345678901234567890z2 {\n}\n", 1, "is no name for a drive" },
	{ BUS BUS, 5, "there is a bus 'b' on line 1 already" },
	{ BUS DRIVE "drive d {\n bus = b\n address = 2\n unit = 2\n}\n", 10,
	  "there is a drive 'd' on line 5 already" },
	/* Keys. */
	{ "modbus {\n confrim-ms = 4\n}\n", 2,
	  "unknown key 'confrim-ms' in section modbus; the nearest one is 'confirm-ms'" },
	{ "modbus {\n baud = 4\n}\n", 2, "it belongs to section bus" },
	{ "modbus {\n confirm-ms = 4\n listen = \"1.1.1.1:1\"\n confirm-ms = 5\n}\n", 4,
	  "confirm-ms was set on line 2 already" },
	{ "modbus {\n confirm-ms = {4}\n}\n", 2, "takes one value" },
	/* Values. */
	{ "modbus {\n confirm-ms = fast\n}\n", 2,
	  "confirm-ms = fast is no whole number; a whole number from 1 to 10000 ms" },
	{ "modbus {\n confirm-ms = 40ms\n}\n", 2,
	  "confirm-ms = 40ms has a unit behind its number; write 40; a whole number from 1 to 10000 ms" },
	{ "modbus {\n confirm-ms = -1\n}\n", 2, "is no whole number" },
	{ "modbus {\n confirm-ms = 0x10\n}\n", 2, "is no whole number" },
	{ "modbus {\n confirm-ms = \"\"\n}\n", 2, "is no whole number" },
	{ "modbus {\n confirm-ms = 0\n}\n", 2, "out of range; a whole number from 1 to 10000 ms" },
	{ "modbus {\n confirm-ms = 4294967297\n}\n", 2, "is out of range" },
	{ "modbus {\n confirm-ms = 99999999999999999999999\n}\n", 2, "is out of range" },
	{ "modbus {\n confirm-ms =\n\n 0\n}\n", 2, "is out of range" }, /* the key's line */
	{ "modbus {\n/* a\n b */ confirm-ms = 0\n}\n", 3, "is out of range" },
	{ "modbus {\n word-order = middle\n}\n", 2, "one of: high-first low-first" },
	{ "modbus {\n listen = 502\n}\n", 2, "no address and port" },
	{ "modbus {\n listen = \"localhost:502\"\n}\n", 2, "numbers only" },
	{ "modbus {\n listen = \"1.2.3.4:65536\"\n}\n", 2, "no address and port" },
	{ "modbus {\n listen = \"::1:502\"\n}\n", 2, "no address and port" },
	{ "modbus {\n allow-read = {\"10.0.0.0/8\", \"plc\"}\n}\n", 2, "'plc' is no network" },
	{ "modbus {\n allow-write = {\"10.0.0.0/33\"}\n}\n", 2, "0 to 32 for IPv4" },
	{ "modbus {\n allow-write = {\"10.0.0.5/24\"}\n}\n", 2, "\"10.0.0.0/24\"" },
	{ "modbus {\n secure-socket = modbus\n}\n", 2, "is no whole path" },
	{ "modbus {\n require-secure = writes\n local-writers = everybody\n}\n", 2,
	  "does not go with local-writers = everybody" },
	/* Roles. */
	{ "role {\n}\n", 1, "'' is no name for a role" },
	{ "role r {\n}\nrole r {\n}\n", 3, "there is a role 'r' on line 1 already" },
	{ "role r {\n read = some\n}\n", 2, "one of: all none" },
	{ "role r {\n write = {\"lift\"}\n}\n", 2,
	  "write of role 'r' names 'lift', but there is no drive 'lift'" },
	{ "role r {\n parameters = {\"yes\"}\n}\n", 2, "takes one value" },
	/* Buses. */
	{ "bus b {\n device = \"/dev/x\"\n}\n", 1, "has no key 'protocol'" },
	{ "\nbus b {\n protocol = vsmd-serial\n}\n", 2, "has no key 'device'" },
	{ "bus b {\n protocol = vsmd\n device = \"/dev/x\"\n}\n", 2,
	  "unknown protocol 'vsmd'; known are: vsmd-serial" },
	{ "bus b {\n protocol = vsmd-serial\n device = ttyS0\n}\n", 3, "begins with /" },
	{ "bus b {\n protocol = vsmd-serial\n device = \"\"\n}\n", 3, "1 to 255 characters" },
	{ BUS_HEAD " interface = \"can0\"\n}\n", 4, "interface is for CAN families" },
	{ BUS_HEAD " transport = slcan\n}\n", 4, "transport" },
	{ BUS_HEAD " transport = usb\n}\n", 4, "one of: serial socketcan slcan" },
	{ BUS_HEAD " bitrate = 500000\n}\n", 4, "bitrate is for CAN families" },
	{ BUS_HEAD " priority = 100\n}\n", 4, "from 0 to 99" },
	{ BUS_HEAD " line = rs232\n direction = rts\n}\n", 5, "direction is for RS485" },
	{ BUS_HEAD " rts-before-ms = x\n}\n", 4, "is no whole number" },
	{ "bus b {\n protocol = vsmd\n device = \"/dev/x\"\n group-start = broadcast\n}\n", 2,
	  "unknown protocol 'vsmd'" },
	{ BUS_HEAD " direction = cts\n}\n", 4, "one of: adapter rts rts-inverted" },
	{ BUS_HEAD " cpus = 64\n}\n", 4, "cpus = 64 is no list of processors" },
	{ BUS_HEAD " cpus = \"3-1\"\n}\n", 4, "is no list of processors" },
	{ BUS_HEAD " cpus = \"1,\"\n}\n", 4, "is no list of processors" },
	{ BUS_HEAD " cpus = \"all\"\n}\n", 4, "is no list of processors" },
	{ BUS_HEAD " log = debug\n}\n", 4, "one of: error warning notice info" },
	{ BUS "bus c {\n protocol = vsmd-serial\n device = \"/dev/ttyX\"\n}\n", 7,
	  "is used by bus 'b' on line 1 already" },
	{ "bus b {\n protocol = vsmd-serial\n device = \"/dev/null\"\n}\n"
	  "bus c {\n protocol = vsmd-serial\n device = \"/dev/./null\"\n}\n",
	  7, "is used by bus 'b'" },
	/* Drives. */
	{ BUS "drive d {\n address = 1\n unit = 1\n}\n", 5, "has no key 'bus'" },
	{ BUS "drive d {\n bus = c\n address = 1\n unit = 1\n}\n", 6, "there is no bus 'c'" },
	{ BUS "drive d {\n bus = b\n address = 1\n}\n", 5, "has no key 'unit'" },
	{ BUS "drive d {\n bus = b\n unit = 1\n}\n", 5, "has no key 'address'" },
	{ BUS "drive d {\n bus = b\n address = 0\n unit = 1\n}\n", 7, "from 1 to 32" },
	{ BUS "drive d {\n bus = b\n address = 33\n unit = 1\n}\n", 7, "from 1 to 32" },
	{ BUS "drive d {\n bus = b\n address = x\n unit = 1\n}\n", 7, "is no whole number" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 248\n}\n", 8, "from 1 to 247" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 1\n axis = x\n}\n", 9,
	  "axis is for multi-axis families" },
	{ BUS DRIVE "drive e {\n bus = b\n address = 1\n unit = 2\n}\n", 12,
	  "belongs to drive 'd' on line 5 already" },
	{ BUS DRIVE "drive e {\n bus = b\n address = 2\n unit = 1\n}\n", 13,
	  "unit = 1 belongs to drive 'd' on line 5 already" },
	{ "modbus {\n gateway-unit = 1\n}\n" BUS DRIVE, 11, "gateway's own unit" },

	/* Endpoints. */
	{ "endpoint e {\n}\n", 1, "has no key 'listen'" },
	{ "endpoint e {\n listen = 503\n}\n", 2, "is no address and port" },
	{ "endpoint \"a b\" {\n listen = \"0.0.0.0:503\"\n}\n", 1, "is no name for an endpoint" },
	{ ENDPOINT ENDPOINT, 4, "there is an endpoint 'e' on line 1 already" },
	{ ENDPOINT "endpoint f {\n listen = \"0.0.0.0:503\"\n}\n", 5,
	  "listen = 0.0.0.0:503 is where e listens already" },
	{ "modbus {\n listen = \"0.0.0.0:503\"\n}\n" ENDPOINT, 5,
	  "listen = 0.0.0.0:503 is where modbus listens already" },
	{ "modbus {\n secure-socket = \"/run/x\"\n}\n"
	  "endpoint e {\n listen = \"0.0.0.0:503\"\n secure-socket = \"/run/x\"\n}\n",
	  6, "secure-socket = /run/x is that of modbus already" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 1\n endpoint = e\n}\n", 9,
	  "there is no endpoint 'e'" },
	{ "modbus-rtu p {\n device = \"/dev/ttyP\"\n endpoint = e\n}\n", 3,
	  "there is no endpoint 'e'" },
	{ ENDPOINT BUS DRIVE_OF_E
	  "drive f {\n bus = b\n address = 2\n unit = 1\n endpoint = e\n}\n",
	  17,
	  "unit = 1 belongs to drive 'd' on line 8 already; a unit of its own for each drive of "
	  "endpoint e" },
	{ "endpoint e {\n listen = \"0.0.0.0:503\"\n gateway-unit = 1\n}\n" BUS DRIVE_OF_E, 12,
	  "gateway's own unit" },
	{ "modbus {\n max-clients = 4\n reserved-writers = 4\n}\n", 3,
	  "reserved-writers = 4 leaves none of max-clients = 4" },

	/* The vendor's register map. */
	{ "modbus {\n gateway-unit = 9\n}\n" BUS VENDOR_DRIVE, 12, "gateway's own unit" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 1\n vendor-unit = 1\n}\n", 9,
	  "vendor-unit = 1 belongs to drive 'd' on line 5 already" },
	{ BUS VENDOR_DRIVE "drive e {\n bus = b\n address = 2\n unit = 9\n}\n", 9,
	  "vendor-unit = 9 belongs to drive 'e' on line 11 already" },
	{ BUS "drive e {\n bus = b\n address = 2\n unit = 9\n}\n" VENDOR_DRIVE, 14,
	  "vendor-unit = 9 belongs to drive 'e' on line 5 already" },
	{ BUS VENDOR_DRIVE "drive e {\n bus = b\n address = 2\n unit = 2\n vendor-unit = 9\n}\n",
	  15, "vendor-unit = 9 belongs to drive 'd' on line 5 already" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 1\n vendor-unit = 9\n layout = vsmd\n}\n",
	  9, "one of them" },
	{ RS232_BUS DRIVE, 8, "RS232" },
	{ RS232_BUS "drive d {\n bus = b\n unit = 1\n}\ndrive e {\n bus = b\n unit = 2\n}\n", 11,
	  "one drive per RS232 line" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 1\n counts-per-unit = 0\n}\n", 9,
	  "a number from 1e-09 to 1e+09" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 1\n counts-per-unit = nan\n}\n", 9,
	  "is no number" },
	{ BUS "drive d {\n bus = b\n address = 1\n unit = 1\n on-exit = halt\n}\n", 9,
	  "one of: none stop quick-stop disable" },
};

static void test_wrong_files(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(WRONG) / sizeof(WRONG[0]); i++) {
		struct loaded loaded = load(WRONG[i].text);

		if (loaded.result != -1 || loaded.config)
			fail_msg("accepted:\n%s", WRONG[i].text);
		expect_message(&loaded, WRONG[i].line, WRONG[i].fragment);
		if (count_lines(loaded.messages) != 1)
			fail_msg("one mistake, several messages:\n%s", loaded.messages);
		assert_non_null(strstr(loaded.messages, "; "));
		done(&loaded);
	}
}

static void test_all_errors_in_order(void **state)
{
	struct loaded loaded = load(
		"modbus {\n confrim-ms = 4\n max-clients = 0\n}\n"
		"drive d {\n bus = c\n unit = 300\n}\n"
		"bus b {\n protocol = x\n baud = 1\n colour = {red, green}\n}\n");
	static const unsigned LINES[] = { 2, 3, 6, 7, 9, 10, 11, 12 };
	const char *before = loaded.messages;

	(void)state;
	assert_int_equal(loaded.result, -1);
	for (size_t i = 0; i < sizeof(LINES) / sizeof(LINES[0]); i++) {
		const char *message = message_of(&loaded, LINES[i], ";");

		if (!message || message < before)
			fail_msg("line %u is missing or not in order:\n%s", LINES[i],
			         loaded.messages);
		before = message;
	}
	assert_int_equal(count_lines(loaded.messages), sizeof(LINES) / sizeof(LINES[0]));
	done(&loaded);
}

static void test_messages_are_printable(void **state)
{
	struct loaded loaded = load("modbus {\n listen = \"\033[2J\"\n}\n");

	(void)state;
	assert_int_equal(loaded.result, -1);
	assert_null(strchr(loaded.messages, '\033'));
	done(&loaded);
}

static void test_unreadable_files(void **state)
{
	static const char ZERO[] = "modbus {\0}\n";
	struct loaded loaded = load_bytes(ZERO, sizeof(ZERO) - 1);
	char *big = malloc((1u << 20) + 2);
	struct db_config *config = NULL;
	FILE *errors;

	(void)state;
	assert_int_equal(loaded.result, -1);
	assert_non_null(strstr(loaded.messages, "zero byte"));
	done(&loaded);

	assert_non_null(big);
	memset(big, '\n', (1u << 20) + 1);
	loaded = load_bytes(big, (1u << 20) + 1);
	assert_int_equal(loaded.result, -1);
	assert_non_null(strstr(loaded.messages, "longer than"));
	done(&loaded);
	loaded = load_bytes(big, 1u << 20);
	assert_int_equal(loaded.result, 0);
	done(&loaded);
	free(big);

	errors = fmemopen(NULL, 1024, "w+");
	assert_non_null(errors);
	assert_int_equal(db_config_load("/nonexistent/file", errors, &config), -1);
	assert_int_equal(db_config_load("/", errors, &config), -1);
	fclose(errors);
	assert_null(config);
}

/* ---- right files ---- */

static void test_defaults_of_modbus(void **state)
{
	struct loaded loaded = load_good("");
	const struct db_modbus_config *modbus = &loaded.config->modbus;
	char text[DB_NETWORK_TEXT_MAX];

	(void)state;
	assert_string_equal(loaded.messages, "");
	assert_int_equal(loaded.config->bus_count, 0);
	assert_int_equal(loaded.config->drive_count, 0);
	assert_string_equal(modbus->listen, "127.0.0.1:502");
	assert_int_equal(modbus->allow_read_count, 2);
	assert_int_equal(modbus->allow_write_count, 2);
	db_text_of_network(&modbus->allow_read[0], text);
	assert_string_equal(text, "0.0.0.0/0");
	db_text_of_network(&modbus->allow_read[1], text);
	assert_string_equal(text, "::/0");
	db_text_of_network(&modbus->allow_write[0], text);
	assert_string_equal(text, "127.0.0.0/8");
	db_text_of_network(&modbus->allow_write[1], text);
	assert_string_equal(text, "::1/128");
	assert_false(modbus->low_word_first);
	assert_int_equal(modbus->confirm_ms, 40);
	assert_false(modbus->accept_writes);
	assert_false(modbus->stale_values);
	assert_int_equal(modbus->gateway_unit, 0);
	assert_int_equal(modbus->max_clients, 64);
	assert_int_equal(modbus->max_pipelined, 16);
	assert_int_equal(modbus->frame_timeout_ms, 1000);
	assert_int_equal(modbus->idle_timeout_s, 0);
	assert_int_equal(modbus->reserved_writers, 4);
	assert_int_equal(modbus->max_clients_per_address, 0);
	assert_int_equal(modbus->max_requests_per_second, 0);
	assert_int_equal(modbus->control, DB_CONTROL_OFF);
	assert_int_equal(modbus->control_timeout_ms, 5000);
	done(&loaded);
}

static void test_reserved_writers(void **state)
{
	struct loaded loaded = load_good("modbus { max-clients = 3 }\n");

	(void)state;
	assert_int_equal(loaded.config->modbus.reserved_writers, 2);
	done(&loaded);
	loaded = load_good("modbus { max-clients = 1 }\n");
	assert_int_equal(loaded.config->modbus.reserved_writers, 0);
	done(&loaded);
	loaded = load_good("modbus { max-clients = 3 reserved-writers = 1 control = drive }\n");
	assert_int_equal(loaded.config->modbus.reserved_writers, 1);
	assert_int_equal(loaded.config->modbus.control, DB_CONTROL_DRIVE);
	done(&loaded);
}

static void test_defaults_of_bus_and_drive(void **state)
{
	struct loaded loaded = load_good("\n" BUS DRIVE);
	const struct db_bus_config *bus = &loaded.config->buses[0];
	const struct db_drive_config *drive = &loaded.config->drives[0];

	(void)state;
	assert_int_equal(loaded.config->bus_count, 1);
	assert_int_equal(loaded.config->drive_count, 1);
	assert_string_equal(bus->name, "b");
	assert_string_equal(bus->source_file, loaded.path);
	assert_int_equal(bus->source_line, 2);
	assert_ptr_equal(bus->driver, db_driver_find("vsmd-serial"));
	assert_ptr_equal(bus->transport, &db_transport_serial);
	assert_string_equal(bus->device, "/dev/ttyX");
	assert_null(bus->interface);
	assert_int_equal(bus->bitrate, 0);
	assert_int_equal(bus->baud, bus->driver->default_baud);
	assert_int_equal(bus->parity, DB_PARITY_NONE);
	assert_int_equal(bus->stop_bits, 1);
	assert_int_equal(bus->line, DB_LINE_RS485);
	assert_int_equal(bus->cycle_ms, 50);
	assert_int_equal(bus->drive_latency_ms, 30);
	assert_int_equal(bus->retries, 2);
	assert_int_equal(bus->queue, 32);
	assert_int_equal(bus->save_interval_s, 10);
	assert_int_equal(bus->priority, 1);
	assert_true(bus->cpus == 0);
	assert_int_equal(bus->log, DB_LOG_INFO);
	assert_string_equal(drive->name, "d");
	assert_string_equal(drive->source_file, loaded.path);
	assert_int_equal(drive->source_line, 6);
	assert_int_equal(drive->bus, 0);
	assert_int_equal(drive->address, 1);
	assert_int_equal(drive->axis, 0);
	assert_int_equal(drive->unit, 1);
	assert_true(drive->counts_per_unit == 1.0);
	assert_string_equal(drive->unit_name, "counts");
	assert_int_equal(drive->on_client_loss, DB_ON_LOSS_STOP);
	assert_int_equal(drive->on_exit, DB_ON_LOSS_STOP);
	assert_int_equal(drive->watchdog_ms, 3000);
	assert_int_equal(drive->watchdog_feed, DB_FEED_COMMANDERS);
	done(&loaded);
}

/* Drives before their bus, comments in every place, words with and without quotes. */
static void test_everything_set(void **state)
{
	struct loaded loaded = load_good(
		"#\n/**/ drive d { // a\n bus = \"p\" /* b\n c */ address = 32\n unit = 247\n"
		" counts-per-unit = 17.5\n unit-name = \"\\\"deg\\\"\"\n on-client-loss = 'disable'\n"
		" watchdog-ms = 0 watchdog-feed = heartbeat\n}\n"
		"drive e { bus = p address = 2 unit = 2 watchdog-feed = writes on-client-loss=none on-exit = quick-stop }\n"
		"modbus { listen = \"[::]:0\" allow-read = {} allow-write = { # the PLC\n"
		" 10.1.2.3, // and\n \"fd00::/8\" }\n word-order = low-first write-confirm = accepted\n"
		" stale = value gateway-unit = 254 }\n"
		"bus q { protocol = vsmd-serial device = /dev/ttyA }\r\n"
		"bus p { protocol = vsmd-serial device = /dev/ttyB parity = odd stop-bits = 2\n"
		" baud = 19200 line = rs485 cycle-ms = 1000 priority = 99 cpus = 0 log = warning }");
	const struct db_config *config = loaded.config;
	char text[DB_NETWORK_TEXT_MAX];

	(void)state;
	assert_string_equal(loaded.messages, "");
	assert_int_equal(config->drives[0].bus, 1);
	assert_int_equal(config->drives[0].address, 32);
	assert_int_equal(config->drives[0].unit, 247);
	assert_true(config->drives[0].counts_per_unit == 17.5);
	assert_string_equal(config->drives[0].unit_name, "\"deg\"");
	assert_int_equal(config->drives[0].on_client_loss, DB_ON_LOSS_DISABLE);
	assert_int_equal(config->drives[0].on_exit, DB_ON_LOSS_DISABLE);
	assert_int_equal(config->drives[0].watchdog_ms, 0);
	assert_int_equal(config->drives[0].watchdog_feed, DB_FEED_HEARTBEAT);
	assert_int_equal(config->drives[1].watchdog_feed, DB_FEED_WRITES);
	assert_int_equal(config->drives[1].on_client_loss, DB_ON_LOSS_NONE);
	assert_int_equal(config->drives[1].on_exit, DB_ON_LOSS_QUICK_STOP);
	assert_string_equal(config->modbus.listen, "[::]:0");
	assert_int_equal(config->modbus.allow_read_count, 1); /* nobody */
	db_text_of_network(&config->modbus.allow_read[0], text);
	assert_string_equal(text, "::/128");
	assert_int_equal(config->modbus.allow_write_count, 2);
	db_text_of_network(&config->modbus.allow_write[0], text);
	assert_string_equal(text, "10.1.2.3/32");
	db_text_of_network(&config->modbus.allow_write[1], text);
	assert_string_equal(text, "fd00::/8");
	assert_true(config->modbus.low_word_first);
	assert_true(config->modbus.accept_writes);
	assert_true(config->modbus.stale_values);
	assert_int_equal(config->modbus.gateway_unit, 254);
	assert_string_equal(config->buses[1].name, "p");
	assert_string_equal(config->buses[1].device, "/dev/ttyB");
	assert_int_equal(config->buses[1].parity, DB_PARITY_ODD);
	assert_int_equal(config->buses[1].stop_bits, 2);
	assert_int_equal(config->buses[1].baud, 19200);
	assert_int_equal(config->buses[1].priority, 99);
	assert_true(config->buses[1].cpus == 1);
	assert_int_equal(config->buses[1].log, DB_LOG_WARNING);
	done(&loaded);
}

static void test_rs232_without_address(void **state)
{
	struct loaded loaded = load_good(RS232_BUS
	                                 "drive d {\n bus = b\n unit = 1\n address = 0\n}\n");

	(void)state;
	assert_int_equal(loaded.config->drives[0].address, 0);
	done(&loaded);
	loaded = load_good(RS232_BUS "drive d {\n bus = b\n unit = 1\n}\n");
	assert_int_equal(loaded.config->drives[0].address, 0);
	done(&loaded);
}

/* ---- the table of keys ---- */

/* A file with just this key set, in a section that is right otherwise. */
static struct loaded load_key(const struct db_config_key *key, const char *value)
{
	const char *bus = "protocol = vsmd-serial device = /dev/ttyX\n";
	const char *address = strcmp(key->name, "address") == 0 ? "" : "address = 1";
	const char *unit = strcmp(key->name, "unit") == 0 ? "" : "unit = 1";
	char text[1024];

	if (strcmp(key->name, "reserved-writers") == 0)
		snprintf(text, sizeof(text), "modbus { max-clients = 1024 %s = %s }\n", key->name,
		         value);
	else if (strcmp(key->section, "modbus") == 0 || strcmp(key->section, "control") == 0)
		snprintf(text, sizeof(text), "%s { %s = %s }\n", key->section, key->name, value);
	else if (strcmp(key->section, "modbus-rtu") == 0)
		snprintf(text, sizeof(text), "modbus-rtu p { %s %s = %s } role x {}\n",
		         strcmp(key->name, "device") == 0 ? "" : "device = /dev/ttyP", key->name,
		         value);
	else if (strcmp(key->section, "endpoint") == 0)
		snprintf(text, sizeof(text), "endpoint e { %s %s = %s }\n",
		         strcmp(key->name, "listen") == 0 ? "" : "listen = \"0.0.0.0:503\"",
		         key->name, value);
	else if (strcmp(key->section, "role") == 0)
		snprintf(text, sizeof(text), "role r { %s = %s }\n", key->name, value);
	else if (strcmp(key->section, "bus") == 0)
		snprintf(text, sizeof(text), "bus b { %s %s = %s }\n", bus, key->name, value);
	else
		snprintf(text, sizeof(text), "bus b { %s } drive d { bus = b %s %s %s = %s }\n",
		         bus, address, unit, key->name, value);
	return load(text);
}

static void expect_key(const struct db_config_key *key, const char *value, bool good)
{
	struct loaded loaded = load_key(key, value);

	if ((loaded.result == 0) != good)
		fail_msg("%s: %s = %s was %s\n%s", key->section, key->name, value,
		         good ? "refused" : "accepted", loaded.messages);
	done(&loaded);
}

static void expect_range(const struct db_config_key *key)
{
	const struct db_driver *driver = db_driver_find("vsmd-serial");
	double min = key->min, max = key->max;
	bool real = key->kind == DB_KEY_REAL;
	char text[64];

	/* The address has the family's range inside the table's. */
	if (strcmp(key->name, "address") == 0) {
		min = driver->address_min;
		max = driver->address_max;
	}
	snprintf(text, sizeof(text), "%.17g", min);
	expect_key(key, text, true);
	snprintf(text, sizeof(text), "%.17g", max);
	expect_key(key, text, true);
	snprintf(text, sizeof(text), "%.17g", real ? max * 1.001 : max + 1);
	expect_key(key, text, false);
	snprintf(text, sizeof(text), "%.17g",
	         real && fabs(min) > 0 ? min - 0.001 * fabs(min) : min - 1);
	expect_key(key, text, false);
	expect_key(key, "one", false);
	expect_key(key, "\"\"", false);
}

static void expect_words(const struct db_config_key *key)
{
	const char *words = key->words;

	while (*words) {
		size_t length = strcspn(words, " ");
		char word[32];

		snprintf(word, sizeof(word), "%.*s", (int)length, words);
		expect_key(key, word, true);
		words += length;
		words += *words == ' ';
	}
	expect_key(key, "other", false);
	expect_key(key, "\"\"", false);
	expect_key(key, "0", false);
}

static void test_every_key(void **state)
{
	const struct db_driver *driver = db_driver_find("vsmd-serial");
	size_t count, ranges = 0, words = 0;
	const struct db_config_key *keys = db_keys_all(&count);

	(void)state;
	for (size_t i = 0; i < count; i++) {
		assert_ptr_equal(db_keys_find(keys[i].section, keys[i].name), &keys[i]);
		assert_string_equal(
			db_names_find_nearest(db_drivers, keys[i].section, keys[i].name),
			keys[i].name);
		assert_true(strlen(keys[i].description) > 0);
		assert_non_null(keys[i].unit);
		assert_non_null(keys[i].words);
		if (!db_keys_fit(&keys[i], driver) || keys[i].kind == DB_KEY_TRANSPORT)
			continue; /* see test_families.c */
		if (keys[i].kind == DB_KEY_NUMBER || keys[i].kind == DB_KEY_REAL) {
			expect_range(&keys[i]);
			ranges++;
		} else if (keys[i].kind == DB_KEY_WORD) {
			expect_words(&keys[i]);
			words++;
		}
		/* A preset written out is as good as one left out. */
		if (keys[i].kind != DB_KEY_NETWORKS && keys[i].kind != DB_KEY_LISTEN &&
		    keys[i].preset && keys[i].preset[0])
			expect_key(&keys[i], keys[i].preset, true);
	}
	assert_true(ranges >= 15 && words >= 7);
	assert_null(db_keys_find("modbus", "baud"));
	assert_null(db_names_find_nearest(db_drivers, "nothing", "baud"));
}

/* ---- times ---- */

/* `drives` drives on one bus with these keys, and this modbus section in front (one line). */
static struct loaded load_drives(const char *modbus, const char *keys, unsigned drives)
{
	char text[8192];
	size_t used = (size_t)snprintf(text, sizeof(text), "%s\n" BUS_HEAD "%s\n}\n", modbus, keys);

	for (unsigned i = 1; i <= drives; i++)
		used += (size_t)snprintf(text + used, sizeof(text) - used,
		                         "drive d%u { bus = b address = %u unit = %u }\n", i, i, i);
	assert_true(used < sizeof(text));
	return load_good(text);
}

/* A file of an earlier version is taken, whatever value it has there. */
static void test_keys_that_do_nothing_any_more(void **state)
{
	struct loaded loaded = load("modbus {\n max-pipelined = 3\n frame-timeout-ms = 5\n"
	                            " keepalive-s = 0\n}\n" BUS_HEAD " queue = 999\n}\n");

	(void)state;
	assert_non_null(loaded.config);
	assert_int_equal(loaded.config->modbus.max_pipelined, 16);
	assert_int_equal(loaded.config->modbus.frame_timeout_ms, 1000);
	assert_int_equal(loaded.config->buses[0].queue, 32);
	expect_message(&loaded, 2, "warning: max-pipelined does nothing any more");
	expect_message(&loaded, 3, "warning: frame-timeout-ms does nothing any more");
	expect_message(&loaded, 4, "warning: keepalive-s does nothing any more");
	assert_non_null(strstr(loaded.messages, "warning: queue does nothing any more"));
	done(&loaded);
}

/* It may be a misprint, and a drive may have it. */
static void test_unusual_baud(void **state)
{
	struct loaded loaded = load(BUS_HEAD " baud = 115201\n}\n");

	(void)state;
	assert_non_null(loaded.config);
	expect_message(&loaded, 4, "warning: baud = 115201 is not one of the usual speeds");
	done(&loaded);
	loaded = load(FAST_BUS);
	assert_int_equal(strlen(loaded.messages), 0);
	done(&loaded);
}

static void test_cycle_warning(void **state)
{
	struct loaded loaded = load_drives("", "baud = 115200\npoll = even\ncycle-ms = 20", 32);
	const struct db_bus_config *bus = &loaded.config->buses[0];
	db_time all = 32 * bus->driver->poll_time(bus);
	unsigned enough = (unsigned)((all + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
	char keys[64], advice[64];

	(void)state;
	assert_true(all > 20 * DB_NS_PER_MS);
	expect_message(&loaded, 7,
	               "warning: cycle of 20 ms cannot fit 32 drives: one status exchange takes ");
	expect_message(&loaded, 7, " ms at 115200 baud, all of them ");
	snprintf(advice, sizeof(advice), "set cycle-ms = %u or raise the baud rate", enough);
	expect_message(&loaded, 7, advice);
	done(&loaded);

	/* The advice is good, and one less is not. */
	snprintf(keys, sizeof(keys), "baud = 115200\npoll = even\ncycle-ms = %u", enough);
	loaded = load_drives("", keys, 32);
	assert_null(strstr(loaded.messages, "cycle of"));
	done(&loaded);
	snprintf(keys, sizeof(keys), "baud = 115200\npoll = even\ncycle-ms = %u", enough - 1);
	loaded = load_drives("", keys, 32);
	expect_message(&loaded, 7, "warning: cycle of");
	done(&loaded);

	/* The preset cannot fit: the line of the bus. */
	loaded = load_drives("", "baud = 115200\npoll = even", 32);
	expect_message(&loaded, 2, "warning: cycle of 20 ms");
	done(&loaded);

	/* Where those that move come first, one of them is enough. */
	loaded = load_drives("", "baud = 115200\ncycle-ms = 5", 32);
	assert_null(strstr(loaded.messages, "cycle of"));
	done(&loaded);
	loaded = load_drives("", "baud = 115200\ncycle-ms = 4", 32);
	expect_message(&loaded, 6, "warning: cycle of 4 ms cannot fit 1 drive: ");
	done(&loaded);
}

static void test_confirm_warning(void **state)
{
	struct loaded loaded = load_drives("modbus { confirm-ms = 5 }",
	                                   "baud = 9600\ncycle-ms = 1000", 1);
	int64_t needed = db_times_confirm(&loaded.config->buses[0]);
	unsigned enough = (unsigned)((needed + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
	char modbus[64], advice[64];

	(void)state;
	expect_message(&loaded, 1,
	               "warning: confirm-ms = 5 cannot be met on bus 'b': at 9600 baud");
	snprintf(advice, sizeof(advice), "set confirm-ms = %u", enough);
	expect_message(&loaded, 1, advice);
	done(&loaded);

	snprintf(modbus, sizeof(modbus), "modbus { confirm-ms = %u }", enough);
	loaded = load_drives(modbus, "baud = 9600\ncycle-ms = 1000", 1);
	assert_string_equal(loaded.messages, "");
	done(&loaded);
	snprintf(modbus, sizeof(modbus), "modbus { confirm-ms = %u }", enough - 1);
	loaded = load_drives(modbus, "baud = 9600\ncycle-ms = 1000", 1);
	assert_int_equal(count_lines(loaded.messages), 1);
	done(&loaded);

	/* Nothing to meet: writes are answered at once, or nobody to write to. */
	loaded = load_drives("modbus { confirm-ms = 5 write-confirm = accepted }",
	                     "baud = 9600\ncycle-ms = 1000", 1);
	assert_string_equal(loaded.messages, "");
	done(&loaded);
	loaded = load_drives("modbus { confirm-ms = 5 }", "baud = 9600\ncycle-ms = 1000", 0);
	assert_string_equal(loaded.messages, "");
	done(&loaded);
}

static char *described(const struct db_config *config)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	db_config_describe(config, out);
	fclose(out);
	return text;
}

static void test_vendor_view(void **state)
{
	struct loaded loaded = load_good(
		BUS DRIVE
		"drive e { bus = b address = 2 unit = 2 vendor-unit = 9 }\n"
		"drive f { bus = b address = 3 unit = 3 layout = vsmd vendor-word-order = high-first }");
	const struct db_drive_config *drives = loaded.config->drives;
	char *text = described(loaded.config);

	(void)state;
	assert_false(drives[0].vendor_layout);
	assert_int_equal(drives[0].vendor_unit, 0);
	assert_false(drives[1].vendor_layout);
	assert_int_equal(drives[1].vendor_unit, 9);
	assert_false(drives[1].vendor_high_first);
	assert_true(drives[2].vendor_layout);
	assert_int_equal(drives[2].vendor_unit, 0);
	assert_true(drives[2].vendor_high_first);
	assert_non_null(strstr(text, "drive d: unit 1, address 1, 1 counts"));
	assert_non_null(strstr(text, "address 2, vendor-unit 9 with layout vsmd, low-first, 1"));
	assert_non_null(strstr(text, "address 3, layout vsmd, high-first, 1 counts"));
	free(text);
	done(&loaded);
}

static void test_describe(void **state)
{
	static const char *const EXPECTED[] = {
		"127.0.0.1:502",
		"allow-read    nobody\n",
		"0, 255, 9\n",
		"low-first",
		"after 60 ms",
		"64 clients (4 of them only writers), 16 requests of each at once\n",
		"any number of clients, 500 requests per second\n",
		"command_id    one memory per client\n",
		"control       drive, lost after 5000 ms of silence\n",
		"idle never\n",
		"bus b\n",
		"vsmd-serial",
		"/dev/ttyX, serial, rs485, 115200 baud",
		"20 ms; one status exchange ",
		"2 drives",
		"watchdog off, fed by commanders, reaction-ms 250 ms, ",
		"watchdog 3000 ms, fed by heartbeat, reaction-ms 250 ms, ",
		"drive d2: unit 2, address 2, 640 counts per mm, on-client-loss quick-stop, on-exit disable",
	};
	struct loaded loaded = load_good(
		"modbus { gateway-unit = 9 word-order = low-first confirm-ms = 60 allow-read = {}\n"
		" max-requests-per-second = 500 control = drive command-id-scope = client }\n" FAST_BUS
		"drive d1 { bus = b address = 1 unit = 1 watchdog-ms = 0 }\n"
		"drive d2 { bus = b address = 2 unit = 2 counts-per-unit = 640.0 unit-name = mm\n"
		" on-client-loss = quick-stop on-exit = disable watchdog-feed = heartbeat }\n");
	char *text = described(loaded.config);

	(void)state;
	for (size_t i = 0; i < sizeof(EXPECTED) / sizeof(EXPECTED[0]); i++) {
		if (!strstr(text, EXPECTED[i]))
			fail_msg("no '%s' in:\n%s", EXPECTED[i], text);
	}
	free(text);
	done(&loaded);
	loaded = load_good("");
	text = described(loaded.config);
	assert_non_null(strstr(text, "no drives\n"));
	free(text);
	done(&loaded);
}

/* ---- the files of conf/ ---- */

/*
 * From this file's own place in the source tree, so that tests run from any directory. `warning` is
 * what the file is warned about; null: nothing.
 */
static struct db_config *load_shipped_with(const char *name, const char *warning)
{
	char path[4096], *messages = NULL;
	struct db_config *config = NULL;
	size_t size;
	FILE *errors = open_memstream(&messages, &size);

	assert_non_null(errors);
	snprintf(path, sizeof(path), DRIVEBRIDGE_SOURCE_DIR "/conf/%s", name);
	if (db_config_load(path, errors, &config) != 0)
		config = NULL;
	fclose(errors);
	if (!config || (warning ? !strstr(messages, warning) : size != 0))
		fail_msg("%s", messages);
	free(messages);
	return config;
}

static struct db_config *load_shipped(const char *name)
{
	return load_shipped_with(name, NULL);
}

static void test_shipped_files(void **state)
{
	struct db_config *config = load_shipped("drivebridge.conf");

	(void)state;
	assert_string_equal(config->modbus.listen, "127.0.0.1:502");
	assert_int_equal(config->bus_count, 0);
	assert_int_equal(config->drive_count, 0);
	db_config_free(config);

	config = load_shipped("examples/vsmd-rs485.conf");
	assert_int_equal(config->drive_count, 2);
	db_config_free(config);

	config = load_shipped("examples/vsmd-rs232.conf");
	assert_int_equal(config->buses[0].line, DB_LINE_RS232);
	db_config_free(config);

	config = load_shipped("demo.conf");
	assert_string_equal(config->modbus.listen, "127.0.0.1:1502");
	assert_string_equal(config->buses[0].name, "line");
	assert_string_equal(config->buses[1].name, "can");
	assert_int_equal(config->drive_count, 5);
	for (unsigned i = 0; i < 5; i++) {
		assert_int_equal(config->drives[i].unit, i + 1);
		assert_int_equal(config->drives[i].address, i < 3 ? i + 1 : i - 2);
	}
	db_config_free(config);

	config = load_shipped("examples/vsmd-can.conf");
	assert_int_equal(config->bus_count, 2);
	assert_string_equal(config->buses[0].interface, "can0");
	db_config_free(config);

	config = load_shipped("examples/xyza.conf");
	assert_int_equal(config->drive_count, 4);
	assert_int_equal(config->drives[2].axis, 2);
	db_config_free(config);

	config = load_shipped_with("examples/servo-can.conf", "position moves are refused");
	assert_int_equal(config->drive_count, 2);
	assert_int_equal(config->drives[1].address, 2);
	db_config_free(config);
}

static char *read_shipped(const char *name)
{
	char path[4096];
	char *text = calloc(1, 65536);
	FILE *file;

	snprintf(path, sizeof(path), DRIVEBRIDGE_SOURCE_DIR "/conf/%s", name);
	file = fopen(path, "r");
	assert_non_null(text);
	assert_non_null(file);
	assert_true(fread(text, 1, 65535, file) > 0);
	fclose(file);
	return text;
}

/* Takes the '#' off the lines that are keys and sections in a comment. */
static void uncomment(char *text)
{
	static const char LETTERS[] = "abcdefghijklmnopqrstuvwxyz-";

	for (char *line = text; *line; line += *line == '\n') {
		char *hash = line + (line[0] == '\t');
		char *word = hash[0] == '#' ? hash + 2 : hash;
		char *after = word + strspn(word, LETTERS);

		after += strspn(after, " ");
		if (strncmp(line, "#\t", 2) == 0 || strncmp(line, "# bus press {", 13) == 0 ||
		    strncmp(line, "# role Operator {", 17) == 0 ||
		    strncmp(line, "# modbus-rtu press-plc {", 24) == 0 ||
		    strncmp(line, "# endpoint hall2 {", 18) == 0 ||
		    strncmp(line, "# drive feeder {", 16) == 0 || strncmp(line, "# }", 3) == 0 ||
		    (hash > line && hash[0] == '#' && *after == '='))
			*hash = ' ';
		line += strcspn(line, "\n");
	}
}

/* Every key of every family is in it as "key = ", be it in a comment. */
static void expect_shown(void *context, const struct db_config_key *key, const char *families)
{
	size_t length = strlen(key->name);

	for (const char *at = context; (at = strstr(at, key->name)) != NULL; at += length) {
		const char *after = at + length + strspn(at + length, " ");

		if (*after == '=' && (at[-1] == ' ' || at[-1] == '\t'))
			return;
	}
	fail_msg("drivebridge.conf does not show %s of %s", key->name, families);
}

static void expect_all_keys(char *text)
{
	const struct db_driver *driver = db_driver_find("vsmd-serial"); /* the example's */
	size_t count;
	const struct db_config_key *keys = db_keys_all(&count);
	static const struct db_reader_rules rules = { .sections = "" };
	struct db_source *source = db_sources_of_text("f", text);
	struct db_messages messages = { .sources = source, .source_count = 1 };
	struct db_reader reader;

	db_names_each_key(db_drivers, expect_shown, text);
	for (size_t i = 0; i < count; i++) {
		char shown[96];

		if (keys[i].kind != DB_KEY_NUMBER && keys[i].kind != DB_KEY_WORD)
			continue;
		snprintf(shown, sizeof(shown), "%s = %s", keys[i].name,
		         keys[i].preset ? keys[i].preset : "");
		if (db_keys_fit(&keys[i], driver) && !strstr(text, shown))
			fail_msg("drivebridge.conf does not show %s", shown);
	}
	assert_non_null(source);
	assert_true(db_reader_read(&reader, &rules, &messages));
	db_names_check(db_drivers, &reader, &messages);
	for (size_t i = 0; i < count; i++) {
		size_t section = db_reader_find_section(
			&reader, keys[i].section,
			strcmp(keys[i].section, "bus") == 0        ? "press" :
			strcmp(keys[i].section, "drive") == 0      ? "feeder" :
			strcmp(keys[i].section, "role") == 0       ? "Operator" :
			strcmp(keys[i].section, "modbus-rtu") == 0 ? "press-plc" :
			strcmp(keys[i].section, "endpoint") == 0   ? "hall2" :
								     "");

		/* A profile would be a second file. */
		if (keys[i].kind != DB_KEY_PROFILE && db_keys_fit(&keys[i], driver) &&
		    !db_reader_find_key(&reader, section, keys[i].name))
			fail_msg("drivebridge.conf does not show %s", keys[i].name);
	}
	db_reader_clear(&reader);
	db_messages_clear(&messages);
	db_sources_free(source, 1);
}

/* The default file shows every key, and what it shows is right and the same as saying nothing. */
static void test_default_file_is_complete(void **state)
{
	char *text = read_shipped("drivebridge.conf");
	char *shown, *unsaid;
	struct loaded with, without;

	(void)state;
	uncomment(text);
	with = load_good(text);
	without = load_good(
		"role Operator { }\n"
		"endpoint hall2 { listen = \"0.0.0.0:503\" }\n"
		"modbus-rtu press-plc { device = \"/dev/ttyS1\" role = Operator endpoint = hall2 }\n"
		"bus press { protocol = vsmd-serial device = \"/dev/serial/by-id/...\" }\n"
		"drive feeder { bus = press address = 1 unit = 1 endpoint = hall2 }\n");
	shown = described(with.config);
	unsaid = described(without.config);
	assert_string_equal(shown, unsaid);
	free(shown);
	free(unsaid);
	done(&with);
	done(&without);
	expect_all_keys(text);
	free(text);
}

/* ---- defaults, and all values as a file ---- */

static void defaults_fit_the_usual_speed_of_every_family(void **state)
{
	(void)state;
	for (size_t i = 0; db_drivers[i]; i++) {
		bool can = db_drivers[i]->medium == DB_MEDIUM_CAN;
		struct loaded loaded;
		char text[256];

		snprintf(text, sizeof(text),
		         "bus b {\n protocol = %s\n %s\n}\n"
		         "drive d {\n bus = b\n address = 1\n unit = 1\n}\n",
		         db_drivers[i]->name, can ? "interface = can0" : "device = /dev/ttyX");
		loaded = load_good(text);
		if (strstr(loaded.messages, "cycle") || strstr(loaded.messages, "confirm-ms"))
			fail_msg("%s: %s", db_drivers[i]->name, loaded.messages);
		assert_in_range(loaded.config->buses[0].cycle_ms, 20, 500);
		assert_int_equal(loaded.config->modbus.confirm_ms, 40);
		done(&loaded);
	}
}

static void expect_same(const struct db_config *a, const struct db_config *b)
{
	assert_true(db_config_same_modbus(a, b));
	assert_int_equal(a->bus_count, b->bus_count);
	assert_int_equal(a->drive_count, b->drive_count);
	for (size_t i = 0; i < a->bus_count; i++)
		assert_true(db_config_same_bus(&a->buses[i], &b->buses[i]));
	for (size_t i = 0; i < a->drive_count; i++)
		assert_true(db_config_same_drive(a, &a->drives[i], b, &b->drives[i]));
}

static void what_is_written_reads_the_same(void **state)
{
	static const char *const FILES[] = { "drivebridge.conf", "demo.conf",
		                             "examples/vsmd-can.conf", "examples/xyza.conf",
		                             "examples/servo-can.conf" };

	(void)state;
	for (size_t i = 0; i < sizeof(FILES) / sizeof(FILES[0]); i++) {
		char *text = read_shipped(FILES[i]), *again = NULL;
		struct loaded first, second;
		size_t size;
		FILE *out = open_memstream(&again, &size);

		assert_non_null(out);
		if (i == 0)
			uncomment(text);
		first = load_good(text);
		db_config_write(first.config, out);
		fclose(out);
		second = load_good(again);
		expect_same(first.config, second.config);
		assert_true(second.config->sources[0].ended);
		if (i == 0)
			assert_non_null(strstr(again, "max-velocity = 50\n"));
		free(text);
		free(again);
		done(&first);
		done(&second);
	}
}

static void many_mistakes_are_counted(void **state)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);
	struct loaded loaded;

	(void)state;
	assert_non_null(out);
	fputs(BUS, out);
	for (unsigned i = 0; i < 400; i++)
		fprintf(out, "drive d%u {\n bus = b\n address = 99\n unit = 1\n}\n", i);
	fclose(out);
	loaded = load(text);
	assert_int_equal(loaded.result, -1);
	assert_int_equal(count_lines(loaded.messages), 21);
	assert_non_null(strstr(loaded.messages, " more errors; mend these first\n"));
	free(text);
	done(&loaded);
}

/* ---- values ---- */

static void test_cpus(void **state)
{
	static const struct {
		const char *text;
		uint64_t cpus;
		const char *back;
	} CASES[] = {
		{ "0", 1, "0" },
		{ "63", UINT64_C(1) << 63, "63" },
		{ "2-3,5", 0x2C, "2-3,5" },
		{ "5,3,2", 0x2C, "2-3,5" },
		{ "1-1", 2, "1" },
		{ "0-63", UINT64_MAX, "0-63" },
		{ "any", 0, "" },
	};
	static const char *const REFUSED[] = { "",
		                               ",",
		                               "1,",
		                               "-1",
		                               "1-",
		                               "3-1",
		                               "64",
		                               "0-64",
		                               "1 2",
		                               "0x1",
		                               "all",
		                               "1-2-3",
		                               "00000000000000000" };
	char text[DB_CPUS_TEXT_MAX];
	uint64_t cpus;

	(void)state;
	for (size_t i = 0; i < sizeof(CASES) / sizeof(CASES[0]); i++) {
		assert_true(db_text_cpus(CASES[i].text, &cpus));
		assert_true(cpus == CASES[i].cpus);
		db_text_of_cpus(cpus, text);
		assert_string_equal(text, CASES[i].back);
	}
	for (size_t i = 0; i < sizeof(REFUSED) / sizeof(REFUSED[0]); i++)
		assert_false(db_text_cpus(REFUSED[i], &cpus));
	/* As much text as there can be. */
	db_text_of_cpus(UINT64_C(0x5555555555555555), text);
	assert_int_equal(strlen(text), 5 * 2 + 27 * 3 - 1);
}

static void test_networks(void **state)
{
	static const struct {
		const char *text;
		enum db_network_error error;
		const char *back;
	} CASES[] = {
		{ "10.0.0.0/8", DB_NETWORK_OK, "10.0.0.0/8" },
		{ "10.1.2.3", DB_NETWORK_OK, "10.1.2.3/32" },
		{ "0.0.0.0/0", DB_NETWORK_OK, "0.0.0.0/0" },
		{ "::1", DB_NETWORK_OK, "::1/128" },
		{ "fe80::/10", DB_NETWORK_OK, "fe80::/10" },
		{ "::ffff:10.0.0.0/104", DB_NETWORK_OK, "10.0.0.0/8" },
		{ "10.1.2.3/8", DB_NETWORK_HOST_BITS, "10.0.0.0/8" },
		{ "fe81::1/8", DB_NETWORK_HOST_BITS, "fe00::/8" },
		{ "10.0.0.0/33", DB_NETWORK_PREFIX, NULL },
		{ "10.0.0.0/", DB_NETWORK_PREFIX, NULL },
		{ "10.0.0.0/-1", DB_NETWORK_PREFIX, NULL },
		{ "::/129", DB_NETWORK_PREFIX, NULL },
		{ "", DB_NETWORK_NO_ADDRESS, NULL },
		{ "/8", DB_NETWORK_NO_ADDRESS, NULL },
		{ "10.0.0", DB_NETWORK_NO_ADDRESS, NULL },
		{ "localhost", DB_NETWORK_NO_ADDRESS, NULL },
		{ "1111:2222:3333:4444:5555:6666:7777:8888:9999:1111:2222", DB_NETWORK_NO_ADDRESS,
		  NULL },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(CASES) / sizeof(CASES[0]); i++) {
		struct db_network network;
		char text[DB_NETWORK_TEXT_MAX];

		if (db_text_network(CASES[i].text, &network) != CASES[i].error)
			fail_msg("%s", CASES[i].text);
		if (!CASES[i].back)
			continue;
		db_text_of_network(&network, text);
		assert_string_equal(text, CASES[i].back);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_wrong_files),
		cmocka_unit_test(test_all_errors_in_order),
		cmocka_unit_test(test_messages_are_printable),
		cmocka_unit_test(test_unreadable_files),
		cmocka_unit_test(test_defaults_of_modbus),
		cmocka_unit_test(test_reserved_writers),
		cmocka_unit_test(test_defaults_of_bus_and_drive),
		cmocka_unit_test(test_everything_set),
		cmocka_unit_test(test_rs232_without_address),
		cmocka_unit_test(test_every_key),
		cmocka_unit_test(test_keys_that_do_nothing_any_more),
		cmocka_unit_test(test_unusual_baud),
		cmocka_unit_test(test_cycle_warning),
		cmocka_unit_test(test_confirm_warning),
		cmocka_unit_test(test_vendor_view),
		cmocka_unit_test(test_describe),
		cmocka_unit_test(test_shipped_files),
		cmocka_unit_test(test_default_file_is_complete),
		cmocka_unit_test(defaults_fit_the_usual_speed_of_every_family),
		cmocka_unit_test(what_is_written_reads_the_same),
		cmocka_unit_test(many_mistakes_are_counted),
		cmocka_unit_test(test_cpus),
		cmocka_unit_test(test_networks),
	};

	return cmocka_run_group_tests_name("config", tests, NULL, NULL);
}
