/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What depends on the family and the way to the bus: with families and transports made for it, so
 * that every rule is met whatever is built in.
 */
#include "codec/can.h"
#include "config/config_private.h"
#include "config/keys.h"
#include "config/names.h"
#include "drivebridge/driver.h"
#include "drivebridge/transport.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* ---- families ---- */

struct rail_bus {
	unsigned frames; /* 1: standard */
	double host_id;
	double report_ms;
};

struct rail_drive {
	double scale;
	double base;
};

struct arm_bus {
	double host_id;
	double report_ms;
	double offset;
};

static const struct rail_bus *rail_bus(const struct db_bus_config *bus)
{
	return bus->options;
}

static const struct rail_drive *rail_drive(const struct db_drive_config *drive)
{
	return drive->options;
}

#define AT(type, member) offsetof(struct type, member)

static const struct db_option RAIL_OPTIONS[] = {
	{ "bus", "frames", AT(rail_bus, frames), "extended standard", "extended", 0, 0, false, "",
	  "Form" },
	{ "bus", "host-id", AT(rail_bus, host_id), "", "1", 0, 511, true, "", "Own id" },
	{ "bus", "report-ms", AT(rail_bus, report_ms), "", "", 1, 1000, true, "ms", "Interval" },
	{ "drive", "scale", AT(rail_drive, scale), "", "0.5", -10, 10, false, "V", "Volts of one" },
	{ "drive", "base", AT(rail_drive, base), "", "0x580", 0, 0x7FF, true, "", "First id" },
};

/* report-ms as above, host-id otherwise. */
static const struct db_option ARM_OPTIONS[] = {
	{ "bus", "host-id", AT(arm_bus, host_id), "", "2", 1, 9, true, "", "Own id" },
	{ "bus", "report-ms", AT(arm_bus, report_ms), "", "", 1, 1000, true, "ms", "Interval" },
	{ "bus", "offset", AT(arm_bus, offset), "", "-5", -100, 100, true, "", "Signed" },
};

static db_time two_ms(const struct db_bus_config *bus)
{
	(void)bus;
	return 2 * DB_NS_PER_MS;
}

/* Standard frames of one host share no id with extended ones. */
static size_t rail_filters(const struct db_bus_config *bus, struct db_can_filter *filters)
{
	bool standard = rail_bus(bus)->frames > 0;

	filters[0].id = standard ? 0x100 : DB_CAN_EXTENDED;
	filters[0].mask = DB_CAN_EXTENDED | (standard ? 0x700 : 0);
	return 1;
}

static size_t arm_filters(const struct db_bus_config *bus, struct db_can_filter *filters)
{
	(void)bus;
	filters[0].id = 0x600;
	filters[0].mask = DB_CAN_EXTENDED | 0x780;
	filters[1].id = 0x180;
	filters[1].mask = DB_CAN_EXTENDED | 0x7FF;
	return 2;
}

static uint64_t rail_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)bus;
	return rail_drive(drive)->scale < 0 ?
	               DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) | DB_COMMAND_BIT(DB_CMD_HOME) |
	                       DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) :
	               0;
}

static void rail_check_config(const struct db_bus_config *bus,
                              const struct db_drive_config *const *drives, size_t drive_count,
                              db_complain_fn *complain, void *context)
{
	if (rail_bus(bus)->host_id > 500)
		complain(context, NULL, true, "host-id = %.0f is too much; less",
		         rail_bus(bus)->host_id);
	for (size_t i = 0; i < drive_count; i++) {
		if (drives[i]->address == 30)
			complain(context, drives[i], false, "address = 30 is the sync's; %s", "29");
		if (drives[i]->address == 31)
			complain(context, drives[i], true, "no drive can be here; remove it");
	}
	if (drive_count > 4)
		complain(context, NULL, false, "many drives; fewer");
}

static const struct db_driver RAIL = {
	.name = "rail-can",
	.title = "Rail",
	.medium = DB_MEDIUM_CAN,
	.address_min = 1,
	.address_max = 110,
	.default_baud = 100000,
	.options = RAIL_OPTIONS,
	.option_count = sizeof(RAIL_OPTIONS) / sizeof(RAIL_OPTIONS[0]),
	.bus_options_size = sizeof(struct rail_bus),
	.drive_options_size = sizeof(struct rail_drive),
	.commands = DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) |
	            DB_COMMAND_BIT(DB_CMD_HOME),
	.forbidden = rail_forbidden,
	.check_config = rail_check_config,
	.poll_time = two_ms,
	.command_time = two_ms,
	.filters = rail_filters,
};

static const struct db_driver ARM = {
	.name = "arm-can",
	.title = "Arm",
	.medium = DB_MEDIUM_CAN,
	.address_min = 1,
	.address_max = 31,
	.default_baud = 1000000,
	.options = ARM_OPTIONS,
	.option_count = sizeof(ARM_OPTIONS) / sizeof(ARM_OPTIONS[0]),
	.bus_options_size = sizeof(struct arm_bus),
	.poll_time = two_ms,
	.command_time = two_ms,
	.filters = arm_filters,
};

/* Sees everything. */
static const struct db_driver MUTE = {
	.name = "mute-can",
	.title = "Mute",
	.medium = DB_MEDIUM_CAN,
	.address_min = 1,
	.address_max = 9,
	.default_baud = 1000000,
	.poll_time = two_ms,
	.command_time = two_ms,
};

static const struct db_driver AXES = {
	.name = "three-axes",
	.title = "Axes",
	.medium = DB_MEDIUM_SERIAL,
	.address_min = 1,
	.address_max = 9,
	.default_baud = 9600,
	.axes = 3,
	.poll_time = two_ms,
	.command_time = two_ms,
};

static const struct db_transport SOCKETCAN = {
	.name = "socketcan",
	.medium = DB_MEDIUM_CAN,
	.uses_interface = true,
};
static const struct db_transport SLCAN = { .name = "slcan", .medium = DB_MEDIUM_CAN };
static const struct db_transport SERIAL = { .name = "serial", .medium = DB_MEDIUM_SERIAL };

static const struct db_driver *const DRIVERS[] = { &RAIL, &ARM, &MUTE, &AXES, NULL };
static const struct db_transport *const TRANSPORTS[] = { &SERIAL, &SOCKETCAN, &SLCAN, NULL };
static const struct db_transport *const SERIAL_ONLY[] = { &SERIAL, NULL };

/* ---- reading texts ---- */

struct loaded {
	struct db_config *config;
	char *messages;
	int result;
};

static struct loaded load_with(const struct db_transport *const *transports, const char *text)
{
	struct db_built_in built_in = { DRIVERS, transports };
	struct loaded loaded = { 0 };
	size_t size;
	FILE *errors = open_memstream(&loaded.messages, &size);

	assert_non_null(errors);
	loaded.result = db_load_text(&built_in, text, "f", errors, &loaded.config);
	fclose(errors);
	return loaded;
}

static struct loaded load_good(const char *text)
{
	struct loaded loaded = load_with(TRANSPORTS, text);

	if (loaded.result != 0)
		fail_msg("%s\n%s", text, loaded.messages);
	return loaded;
}

static void done(struct loaded *loaded)
{
	db_config_free(loaded->config);
	free(loaded->messages);
}

/* The only message is about this line and has this in it. */
static void expect_one(const struct loaded *loaded, const char *text, unsigned line,
                       const char *fragment)
{
	char head[32];
	const char *end = strchr(loaded->messages, '\n');

	snprintf(head, sizeof(head), "f:%u: ", line);
	if (strncmp(loaded->messages, head, strlen(head)) != 0 ||
	    !strstr(loaded->messages, fragment) || !end || end[1] != '\0')
		fail_msg("expected line %u with '%s' alone, for\n%s\ngot:\n%s", line, fragment,
		         text, loaded->messages);
	assert_non_null(strstr(loaded->messages, "; "));
}

struct wrong_case {
	const char *text;
	unsigned line;
	const char *fragment;
};

static void expect_wrong(const struct db_transport *const *transports,
                         const struct wrong_case *cases, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		struct loaded loaded = load_with(transports, cases[i].text);

		if (loaded.result == 0)
			fail_msg("accepted:\n%s", cases[i].text);
		expect_one(&loaded, cases[i].text, cases[i].line, cases[i].fragment);
		done(&loaded);
	}
}

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* Lines 1 to 3. */
#define RAIL_BUS "bus r {\n protocol = rail-can\n interface = can0\n"
#define SLCAN_BUS "bus r {\n protocol = rail-can transport = slcan\n device = \"/dev/ttyA\"\n"
#define AXES_BUS "bus x {\n protocol = three-axes\n device = \"/dev/ttyX\"\n"

/* ---- the way to the bus ---- */

static const struct wrong_case WRONG_PLACE[] = {
	{ "bus r {\n protocol = rail-can\n}\n", 1, "neither 'interface' nor 'device'" },
	{ "bus r {\n protocol = rail-can\n}\n", 1, "add interface = \"can0\"" },
	{ "bus r {\n protocol = rail-can\n transport = socketcan\n}\n", 1, "or transport = slcan" },
	{ "bus r {\n protocol = rail-can\n transport = slcan\n}\n", 1, "add device = " },
	{ "bus x {\n protocol = three-axes\n}\n", 1, "has no key 'device'" },
	{ "bus r {\n protocol = rail-can\n device = \"/dev/ttyA\"\n}\n", 3,
	  "set transport = slcan if a CAN adapter is on this port, else remove it and give" },
	{ RAIL_BUS " device = \"/dev/ttyA\"\n}\n", 4, "device = /dev/ttyA is for serial ports" },
	{ SLCAN_BUS " interface = can0\n}\n", 4, "interface = can0 is for transport = socketcan" },
	{ "bus r {\n protocol = rail-can\n transport = slcan interface = can0\n}\n", 3,
	  "set transport = socketcan, or remove it and give device" },
	{ RAIL_BUS " transport = serial\n}\n", 4,
	  "transport = serial does not fit rail-can, which runs on CAN; one of: socketcan, slcan" },
	{ AXES_BUS " transport = slcan\n}\n", 4, "which runs on a serial line; one of: serial" },
	{ RAIL_BUS " transport = can\n}\n", 4, "one of: serial socketcan slcan" },
	{ "bus r {\n protocol = rail-can\n interface = \"\"\n}\n", 3, "1 to 15 characters" },
	{ "bus r {\n protocol = rail-can\n interface = a234567890123456\n}\n", 3,
	  "1 to 15 characters" },
	{ "bus r {\n protocol = rail-can\n interface = \"can 0\"\n}\n", 3, "no name of a network" },
	{ "bus r {\n protocol = rail-can\n interface = \"a/b\"\n}\n", 3, "no name of a network" },
	{ "bus r {\n protocol = rail-can\n interface = \"can0:1\"\n}\n", 3,
	  "no name of a network" },
	{ "bus r {\n protocol = rail-can\n interface = ..\n}\n", 3, "no name of a network" },
	{ "bus r {\n protocol = rail-can transport = slcan\n device = ttyA\n}\n", 3,
	  "begins with /" },
	/* Keys of the other medium. */
	{ RAIL_BUS " parity = even\n}\n", 4, "parity is for serial families, but rail-can" },
	{ RAIL_BUS " stop-bits = 1\n}\n", 4, "stop-bits is for serial families" },
	{ SLCAN_BUS " line = rs485\n}\n", 4, "line is for serial families" },
	{ AXES_BUS " interface = can0\n}\n", 4, "name the port with device" },
	{ "bus x {\n protocol = three-axes\n interface = can0\n}\n", 3, "name the port with dev" },
	{ AXES_BUS " bitrate = 100000\n}\n", 4, "set the speed with baud" },
	{ RAIL_BUS " baud = 9600\n}\n", 4, "baud is for serial ports" },
	/* Bit rates. */
	{ RAIL_BUS " bitrate = 9999\n}\n", 4, "from 10000 to 1000000 bit/s" },
	{ RAIL_BUS " bitrate = 1000001\n}\n", 4, "from 10000 to 1000000 bit/s" },
	{ SLCAN_BUS " bitrate = 400000\n}\n", 4,
	  "one of: 10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000" },
	/* One port, one bus; CAN adapters too. */
	{ SLCAN_BUS "}\nbus x {\n protocol = three-axes\n device = \"/dev/ttyA\"\n}\n", 7,
	  "is used by bus 'r' on line 1 already" },
};

static void test_wrong_places(void **state)
{
	static const struct wrong_case MISSING[] = {
		{ RAIL_BUS "}\n", 1,
		  "transport socketcan is not built in; of those that fit rail-can" },
		{ SLCAN_BUS "}\n", 2, "transport slcan is not built in" },
	};

	(void)state;
	expect_wrong(TRANSPORTS, WRONG_PLACE, COUNT(WRONG_PLACE));
	expect_wrong(SERIAL_ONLY, MISSING, COUNT(MISSING));
}

static void test_socketcan(void **state)
{
	struct loaded loaded = load_good(RAIL_BUS
	                                 "}\n"
	                                 "bus s { protocol = arm-can transport = socketcan\n"
	                                 " interface = a23456789012345 bitrate = 400000 }\n");
	const struct db_bus_config *bus = loaded.config->buses;

	(void)state;
	assert_string_equal(loaded.messages, "");
	assert_ptr_equal(bus[0].driver, &RAIL);
	assert_ptr_equal(bus[0].transport, &SOCKETCAN);
	assert_string_equal(bus[0].interface, "can0");
	assert_null(bus[0].device);
	assert_int_equal(bus[0].bitrate, 100000);
	assert_int_equal(bus[0].baud, 0);
	assert_string_equal(bus[1].interface, "a23456789012345");
	assert_int_equal(bus[1].bitrate, 400000);
	done(&loaded);
}

static void test_slcan(void **state)
{
	struct loaded loaded = load_good(SLCAN_BUS
	                                 "}\n"
	                                 "bus s { protocol = arm-can transport = slcan\n"
	                                 " device = /dev/ttyB bitrate = 10000 baud = 3000000 }\n");
	const struct db_bus_config *bus = loaded.config->buses;

	(void)state;
	assert_string_equal(loaded.messages, "");
	assert_ptr_equal(bus[0].transport, &SLCAN);
	assert_string_equal(bus[0].device, "/dev/ttyA");
	assert_null(bus[0].interface);
	assert_int_equal(bus[0].bitrate, 100000);
	assert_int_equal(bus[0].baud, 115200);
	assert_int_equal(bus[1].bitrate, 10000);
	assert_int_equal(bus[1].baud, 3000000);
	done(&loaded);
}

/* ---- several buses on one interface ---- */

#define ON_CAN0(name, protocol, keys) \
	"bus " name " {\n protocol = " protocol "\n interface = can0\n " keys "\n}\n"

static void test_shared_interface(void **state)
{
	static const struct wrong_case CASES[] = {
		/* The same family twice; it filters the same ids. */
		{ ON_CAN0("a", "rail-can", "") ON_CAN0("b", "rail-can", ""), 8,
		  "buses 'b' (rail-can) and 'a' (rail-can, line 1) use the same ids on interface can0" },
		{ ON_CAN0("a", "rail-can", "") ON_CAN0("b", "rail-can", ""), 8,
		  "or one bus for all their drives" },
		/* 0x100 to 0x1FF has the 0x180 of the other. */
		{ ON_CAN0("a", "rail-can", "frames = standard bitrate = 1000000")
		          ON_CAN0("b", "arm-can", ""),
		  8, "use the same ids" },
		/* One that sees everything, on either side. */
		{ ON_CAN0("a", "mute-can", "") ON_CAN0("b", "arm-can", ""), 8, "use the same ids" },
		{ ON_CAN0("a", "arm-can", "") ON_CAN0("b", "mute-can", ""), 8, "use the same ids" },
		{ ON_CAN0("a", "rail-can", "bitrate = 500000")
		          ON_CAN0("b", "arm-can", "bitrate = 250000"),
		  9, "bus 'b' has 250000 bit/s, but bus 'a' on line 1 has 500000 bit/s" },
	};
	struct loaded loaded;

	(void)state;
	expect_wrong(TRANSPORTS, CASES, COUNT(CASES));
	loaded = load_good(ON_CAN0("a", "rail-can", "bitrate = 1000000")
	                           ON_CAN0("b", "arm-can", ""));
	assert_string_equal(loaded.messages, "");
	done(&loaded);
	loaded = load_good(ON_CAN0("a", "rail-can", "frames = extended bitrate = 1000000")
	                           ON_CAN0("b", "rail-can", "frames = standard bitrate = 1000000"));
	assert_string_equal(loaded.messages, "");
	done(&loaded);
	loaded = load_good(
		ON_CAN0("a", "mute-can", "") "bus b { protocol = mute-can interface = can1 }\n");
	assert_string_equal(loaded.messages, "");
	done(&loaded);
}

/* ---- axes ---- */

#define AXIS(name, unit, more) \
	"drive " name " {\n bus = x address = 1\n unit = " unit "\n " more "\n}\n"

static void test_wrong_axes(void **state)
{
	static const struct wrong_case CASES[] = {
		{ AXES_BUS "}\n" AXIS("a", "1", "axis = a"), 8,
		  "axis = a is not there; three-axes controllers have the axes x y z\n" },
		{ AXES_BUS "}\n" AXIS("a", "1", "axis = b"), 8, "one of: x y z a" },
		{ AXES_BUS "}\n" AXIS("a", "1", "axis = x") AXIS("b", "2", "axis = x"), 13,
		  "this axis of address 1 belongs to drive 'a' on line 5 already" },
		{ AXES_BUS "}\n" AXIS("a", "1", "axis = x") AXIS("b", "2", ""), 10,
		  "drive 'b' has no key 'axis'" },
		{ AXES_BUS "}\n" AXIS("a", "1", "") AXIS("b", "2", "axis = x"), 5,
		  "drive 'a' has no key 'axis'" },
		{ AXES_BUS
		  " line = rs232\n}\n" AXIS("a", "1", "axis = x") "drive b {\n"
		                                                  " bus = x\n address = 2\n"
		                                                  " unit = 2\n}\n",
		  12, "one controller per RS232 line" },
		{ AXES_BUS " line = rs232\n}\ndrive b {\n bus = x\n unit = 2\n}\n", 6,
		  "has no key 'address'" },
		{ RAIL_BUS "}\ndrive d {\n bus = r address = 1 unit = 1\n axis = x\n}\n", 7,
		  "axis is for multi-axis families, but rail-can" },
		{ RAIL_BUS "}\ndrive d {\n bus = r address = 1 unit = 1\n layout = vsmd\n}\n", 7,
		  "layout is for VSMD families, whose vendor has a register map of its own, but "
		  "drive 'd' is of family rail-can; remove it" },
		{ RAIL_BUS "}\ndrive d {\n bus = r address = 1 unit = 1\n vendor-unit = 9\n}\n", 7,
		  "vendor-unit is for VSMD families" },
		/* Without axes an address is one drive. */
		{ RAIL_BUS "}\ndrive d { bus = r address = 1 unit = 1 }\n"
		           "drive e { bus = r address = 1 unit = 2 }\n",
		  6, "address = 1 on bus 'r' belongs to drive 'd'" },
	};

	(void)state;
	expect_wrong(TRANSPORTS, CASES, COUNT(CASES));
}

static void test_axes(void **state)
{
	struct loaded loaded = load_good(AXES_BUS " line = rs232\n}\n" AXIS("a", "1", "axis = z")
	                                         AXIS("b", "2", "axis = y"));

	(void)state;
	assert_int_equal(loaded.config->drives[0].axis, 2);
	assert_int_equal(loaded.config->drives[1].axis, 1);
	assert_int_equal(loaded.config->drives[1].address, 1);
	done(&loaded);
	/* Alone, the first axis; another controller has the same ones. */
	loaded = load_good(AXES_BUS
	                   "}\n" AXIS("a", "1", "") "drive b { bus = x address = 2 unit = 2 }\n");
	assert_int_equal(loaded.config->drives[0].axis, 0);
	assert_int_equal(loaded.config->drives[1].axis, 0);
	done(&loaded);
}

/* A controller is polled once for all its axes: 2 ms each. */
static void test_cycle_of_controllers(void **state)
{
	static const char *const TEXT = "drive a { bus = x address = 1 unit = 1 axis = x }\n"
					"drive b { bus = x address = 1 unit = 2 axis = y }\n"
					"drive c { bus = x address = 2 unit = 3 }\n";
	char text[512];
	struct loaded loaded;

	(void)state;
	snprintf(text, sizeof(text), AXES_BUS " cycle-ms = 4 poll = even\n}\n%s", TEXT);
	loaded = load_good(text);
	assert_string_equal(loaded.messages, "");
	done(&loaded);
	snprintf(text, sizeof(text), AXES_BUS " cycle-ms = 3 poll = even\n}\n%s", TEXT);
	loaded = load_good(text);
	expect_one(&loaded, text, 4, "cannot fit 2 controllers: one status exchange takes 2.00 ms");
	done(&loaded);
}

static void test_speed_on_can(void **state)
{
	struct loaded loaded = load_good("modbus { confirm-ms = 3 }\n" RAIL_BUS
	                                 " bitrate = 250000 cycle-ms = 1\n}\n"
	                                 "drive d { bus = r address = 1 unit = 1 }\n");

	(void)state;
	assert_non_null(
		strstr(loaded.messages, "f:5: warning: cycle of 1 ms cannot fit 1 drive: "));
	assert_non_null(strstr(loaded.messages, "2.00 ms at 250000 bit/s"));
	assert_non_null(strstr(loaded.messages, "cycle-ms = 2 or raise the bit rate"));
	assert_non_null(strstr(loaded.messages, "on bus 'r': at 250000 bit/s a command"));
	assert_null(strstr(loaded.messages, "baud"));
	done(&loaded);
}

/* ---- options of families ---- */

#define RAIL_DRIVE "drive d {\n bus = r address = 1\n unit = 1\n"

static void test_wrong_options(void **state)
{
	static const struct wrong_case CASES[] = {
		{ RAIL_BUS " frames = long\n}\n", 4, "one of: extended standard" },
		{ RAIL_BUS " host-id = 512\n}\n", 4,
		  "host-id = 512 is out of range; a whole number from 0 to 511" },
		{ RAIL_BUS " host-id = -1\n}\n", 4, "is out of range" },
		{ RAIL_BUS " host-id = 1.5\n}\n", 4, "host-id = 1.5 is no whole number" },
		{ RAIL_BUS " host-id = 0x\n}\n", 4, "is no whole number" },
		{ RAIL_BUS " host-id = 0xg\n}\n", 4, "is no whole number" },
		{ RAIL_BUS " host-id = -0x1\n}\n", 4, "is no whole number" },
		{ RAIL_BUS " host-id = \"\"\n}\n", 4, "is no whole number" },
		{ RAIL_BUS " host-id = 0x1FFFFFFFF\n}\n", 4, "is no whole number" },
		{ RAIL_BUS " host-id = {1}\n}\n", 4, "takes one value" },
		{ RAIL_BUS " report-ms = 0\n}\n", 4, "a whole number from 1 to 1000 ms" },
		{ RAIL_BUS "}\n" RAIL_DRIVE " scale = 10.01\n}\n", 8, "a number from -10 to 10 V" },
		{ RAIL_BUS "}\n" RAIL_DRIVE " scale = much\n}\n", 8, "scale = much is no number" },
		{ RAIL_BUS "}\n" RAIL_DRIVE " base = 0x800\n}\n", 8, "from 0x0 to 0x7FF" },
		/* The range is the family's. */
		{ "bus a {\n protocol = arm-can interface = can0\n host-id = 10\n}\n", 3,
		  "from 1 to 9" },
		{ "bus a {\n protocol = arm-can interface = can0\n offset = -101\n}\n", 3,
		  "from -100 to 100" },
		/* In the wrong place, or of nobody. */
		{ RAIL_BUS " offset = 1\n}\n", 4,
		  "offset is a key of arm-can, but bus 'r' is of family rail-can; remove it" },
		{ AXES_BUS " report-ms = 1\n}\n", 4,
		  "report-ms is a key of rail-can arm-can, but bus 'x' is of family three-axes" },
		{ "bus a { protocol = arm-can interface = can0 }\ndrive d {\n bus = a address = 1\n"
		  " unit = 1 base = 1\n}\n",
		  4, "base is a key of rail-can, but drive 'd' is of family arm-can" },
		{ RAIL_BUS " scale = 1\n}\n", 4, "it belongs to section drive" },
		{ RAIL_BUS " reprot-ms = 1\n}\n", 4, "the nearest one is 'report-ms'" },
		{ RAIL_BUS "}\n" RAIL_DRIVE " bas = 1\n}\n", 8, "the nearest one is 'bus'" },
		{ RAIL_BUS "}\n" RAIL_DRIVE " scael = 1\n}\n", 8, "the nearest one is 'scale'" },
	};

	(void)state;
	expect_wrong(TRANSPORTS, CASES, COUNT(CASES));
}

static void test_options(void **state)
{
	struct loaded loaded = load_good(RAIL_BUS "}\n" RAIL_DRIVE "}\n");
	const struct db_bus_config *bus = loaded.config->buses;
	const struct db_drive_config *drive = loaded.config->drives;

	(void)state;
	assert_int_equal(rail_bus(bus)->frames, 0);
	assert_true(rail_bus(bus)->host_id == 1);
	assert_true(isnan(rail_bus(bus)->report_ms));
	assert_true(rail_drive(drive)->scale == 0.5);
	assert_true(rail_drive(drive)->base == 0x580);
	done(&loaded);

	loaded = load_good(
		"bus r { protocol = rail-can interface = can0 frames = standard\n"
		" host-id = 0x1f4 report-ms = 50 }\n"
		"bus a { protocol = arm-can interface = can1 offset = -100 }\n" RAIL_DRIVE
		" scale = -2.5e-1 base = 0x7ff\n}\n");
	bus = loaded.config->buses;
	drive = loaded.config->drives;
	assert_int_equal(rail_bus(&bus[0])->frames, 1);
	assert_true(rail_bus(&bus[0])->host_id == 0x1F4);
	assert_true(rail_bus(&bus[0])->report_ms == 50);
	assert_true(((const struct arm_bus *)bus[1].options)->host_id == 2);
	assert_true(((const struct arm_bus *)bus[1].options)->offset == -100);
	assert_true(rail_drive(drive)->scale == -0.25);
	assert_true(rail_drive(drive)->base == 0x7FF);
	done(&loaded);
}

static void test_complaints(void **state)
{
	static const struct wrong_case CASES[] = {
		{ RAIL_BUS "}\ndrive d {\n bus = r\n address = 31 unit = 1\n}\n", 5,
		  "no drive can be here" },
		{ RAIL_BUS "\n host-id = 501\n}\n", 5, "host-id = 501 is too much" },
	};
	static const char *const WARNED = "\n" RAIL_BUS
					  "}\ndrive d {\n bus = r\n address = 30 unit = 1\n}\n";
	struct loaded loaded = load_good(WARNED);

	(void)state;
	expect_wrong(TRANSPORTS, CASES, COUNT(CASES));
	expect_one(&loaded, WARNED, 8, "warning: address = 30 is the sync's; 29");
	done(&loaded);
	/* Only the drives of the bus are shown to its family. */
	loaded = load_good("bus a { protocol = arm-can interface = can1 }\n" RAIL_BUS "}\n"
	                   "drive d { bus = a address = 31 unit = 1 }\n");
	assert_string_equal(loaded.messages, "");
	done(&loaded);
}

static void test_describe(void **state)
{
	static const char *const EXPECTED[] = {
		"  interface     can0, socketcan, 100000 bit/s\n",
		"  options       frames standard, host-id 1, report-ms not set\n",
		"watchdog 3000 ms, fed by commanders, scale -2 V, base 0x580\n    refused with these settings: move_absolute, home\n",
		"  drive e: unit 2, address 2, 1 counts per counts",
		"scale 0.5 V, base 0x10\nbus s",
		"  device        /dev/ttyB, slcan, 1000000 bit/s, adapter at 115200 baud\n",
		"  options       host-id 2, report-ms 7 ms, offset -5\n",
		"address 1, axis z, 1 counts",
		", 1 controller 2.00 ms",
	};
	struct loaded loaded = load_good(
		RAIL_BUS " frames = standard\n}\n" RAIL_DRIVE " scale = -2\n}\n"
			 "drive e { bus = r address = 2 unit = 2 base = 16 }\n"
			 "bus s { protocol = arm-can transport = slcan device = /dev/ttyB\n"
			 " report-ms = 7 }\n" AXES_BUS "}\n" AXIS("z", "3", "axis = z")
				 AXIS("y", "4", "axis = y"));
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	(void)state;
	assert_non_null(out);
	db_config_describe(loaded.config, out);
	fclose(out);
	for (size_t i = 0; i < COUNT(EXPECTED); i++) {
		if (!strstr(text, EXPECTED[i]))
			fail_msg("no '%s' in:\n%s", EXPECTED[i], text);
	}
	free(text);
	done(&loaded);
}

/* ---- the walk over all keys ---- */

static void note_key(void *context, const struct db_config_key *key, const char *families)
{
	FILE *out = context;

	fprintf(out, "%s %s [%s] %d %s|%s|%s|%g..%g\n", key->section, key->name, families,
	        (int)key->kind, key->preset ? key->preset : "-", key->unit, key->words, key->min,
	        key->max);
}

/* Line number of a text in another, 0 when it is not there just once. */
static unsigned line_of(const char *text, const char *wanted)
{
	const char *found = strstr(text, wanted);
	unsigned line = 1;

	if (!found || strstr(found + 1, wanted))
		return 0;
	for (; text < found; text++)
		line += *text == '\n';
	return line;
}

static void test_each_key(void **state)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);
	unsigned last, line;

	(void)state;
	assert_non_null(out);
	db_names_each_key(DRIVERS, note_key, out);
	fclose(out);
	assert_true(line_of(text, "modbus listen [all]") == 1);
	assert_true(line_of(text, "bus parity [three-axes]") > 0);
	assert_true(line_of(text, "bus bitrate [rail-can arm-can mute-can]") > 0);
	assert_true(line_of(text, "drive axis [three-axes]") > 0);
	/* Alike once, different ones each; behind the section's common keys. */
	last = line_of(text, "bus priority [all]");
	line = line_of(text, "bus report-ms [rail-can arm-can]");
	assert_true(last > 0 && line > last);
	assert_true(line_of(text, "bus host-id [rail-can]") > last);
	assert_true(line_of(text, "bus host-id [arm-can]") > last);
	assert_true(line_of(text, "drive bus [all]") > line);
	assert_true(line_of(text, "bus frames [rail-can] 3 extended||extended standard|") > 0);
	assert_true(line_of(text, "drive scale [rail-can] 2 0.5|V||-10..10\n") > 0);
	free(text);
}

/* ---- the families of this program ---- */

/* As it would be in a file that leaves everything to the defaults. */
static void expect_option(const struct db_driver *driver, const struct db_option *option)
{
	bool bus = strcmp(option->section, "bus") == 0;

	if (!bus && strcmp(option->section, "drive") != 0)
		fail_msg("%s: %s is in no section", driver->name, option->name);
	if (db_keys_find(option->section, option->name))
		fail_msg("%s: %s is everybody's key", driver->name, option->name);
	if (db_keys_find_option(driver, option->section, option->name) != option)
		fail_msg("%s: %s is there twice", driver->name, option->name);
	if (option->words[0] == '\0' && !(option->min <= option->max))
		fail_msg("%s: %s has no range", driver->name, option->name);
	assert_non_null(option->unit);
	assert_true(strlen(option->description) > 0);
}

/* A file with one drive of the family and this key in one of its sections. */
static char *text_with(const struct db_driver *driver, const struct db_option *option)
{
	bool can = driver->medium == DB_MEDIUM_CAN;
	bool bus = strcmp(option->section, "bus") == 0;
	char key[256], *text;
	int length;

	snprintf(key, sizeof(key), "%s = \"%s\"", option->name, option->preset);
	length = asprintf(&text,
	                  "bus b { protocol = %s %s %s }\n"
	                  "drive d { bus = b address = %u unit = 1 %s }\n",
	                  driver->name, can ? "interface = can0" : "device = /dev/ttyX",
	                  bus ? key : "", driver->address_min, bus ? "" : key);
	assert_true(length > 0);
	return text;
}

/* The presets of the families are right, and the same as saying nothing. */
static void test_built_in_options(void **state)
{
	struct db_built_in built_in = { db_drivers, db_transports };

	(void)state;
	for (size_t i = 0; db_drivers[i]; i++) {
		const struct db_driver *driver = db_drivers[i];

		for (size_t j = 0; j < driver->option_count; j++) {
			const struct db_option *option = &driver->options[j];
			struct db_config *config = NULL;
			char *text;

			expect_option(driver, option);
			if (option->preset[0] == '\0')
				continue;
			text = text_with(driver, option);
			if (db_load_text(&built_in, text, "f", stderr, &config) != 0)
				fail_msg("refused:\n%s", text);
			db_config_free(config);
			free(text);
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_wrong_places),
		cmocka_unit_test(test_socketcan),
		cmocka_unit_test(test_slcan),
		cmocka_unit_test(test_shared_interface),
		cmocka_unit_test(test_wrong_axes),
		cmocka_unit_test(test_axes),
		cmocka_unit_test(test_cycle_of_controllers),
		cmocka_unit_test(test_speed_on_can),
		cmocka_unit_test(test_wrong_options),
		cmocka_unit_test(test_options),
		cmocka_unit_test(test_complaints),
		cmocka_unit_test(test_describe),
		cmocka_unit_test(test_each_key),
		cmocka_unit_test(test_built_in_options),
	};

	return cmocka_run_group_tests_name("config-families", tests, NULL, NULL);
}
