/* SPDX-License-Identifier: Apache-2.0 */
#include "config/keys.h"

#include "drivebridge/driver.h"

#include <string.h>

/* The members of a row; keys for some families only have their scope after them. */
#define NUMBER(s, n, p, low, high, u, d)                                                      \
	.section = s, .name = n, .kind = DB_KEY_NUMBER, .preset = p, .min = low, .max = high, \
	.unit = u, .words = "", .description = d
#define WORD(s, n, p, w, d)                                                                \
	.section = s, .name = n, .kind = DB_KEY_WORD, .preset = p, .unit = "", .words = w, \
	.description = d
#define OTHER(k, s, n, p, low, high, d)                                                       \
	.section = s, .name = n, .kind = k, .preset = p, .min = low, .max = high, .unit = "", \
	.words = "", .description = d

#define LIMIT(n, low, d)                                                                           \
	.section = "drive", .name = n, .kind = DB_KEY_REAL, .preset = "", .min = low, .max = 1e12, \
	.unit = "", .words = "", .description = d

#define LOG_LEVELS "error warning notice info"

/* The place of the value. */
#define AT(s, member)                                       \
	.offset = offsetof(struct db_##s##_config, member), \
	.size = sizeof(((const struct db_##s##_config *)NULL)->member)

/* clang-format off */
static const struct db_config_key KEYS[] = {
	{ OTHER(DB_KEY_LISTEN, "modbus", "listen", "127.0.0.1:502", 0, 0,
	        "Address and port to listen on, [ADDRESS]:PORT for IPv6; port 0 takes any free one"),
	  AT(modbus, listen) },
	{ OTHER(DB_KEY_NETWORKS, "modbus", "allow-read", "0.0.0.0/0 ::/0", 0, 0,
	        "Networks whose clients may connect and read; an empty list means nobody"),
	  AT(modbus, allow_read) },
	{ OTHER(DB_KEY_NETWORKS, "modbus", "allow-write", "127.0.0.0/8 ::1/128", 0, 0,
	        "Networks whose clients may read and write; an empty list means nobody"),
	  AT(modbus, allow_write) },
	{ WORD("modbus", "local-writers", "command-group", "command-group everybody",
	       "Whose programs on this machine may write, where allow-write has their address: root's, the "
	       "service's own user's and those of act-group's members; or everybody's"),
	  AT(modbus, everybody_writes_here) },
	{ OTHER(DB_KEY_TEXT, "modbus", "secure-socket", "off", 1, 107,
	        "Path of the Unix socket at which drivebridge-tls hands over clients with certificates, "
	        "/run/drivebridge/modbus for instance; off: there is none"),
	  AT(modbus, secure_socket) },
	{ WORD("modbus", "require-secure", "no", "no writes all",
	       "For what a client of the network needs a certificate, and has to come over drivebridge-tls: "
	       "nothing; writes; or all, so that port 502 is closed to it. Programs on this machine are "
	       "known by their users and need none"),
	  AT(modbus, require_secure) },
	{ WORD("modbus", "word-order", "high-first", "high-first low-first",
	       "Which 16-bit register of a 32-bit value comes first"),
	  AT(modbus, low_word_first) },
	{ NUMBER("modbus", "confirm-ms", "40", 1, 10000, "ms",
	         "Longest wait for a drive's confirmation before a write is answered with exception 05; "
	         "a parameter write that the drive has acknowledged is a success after 7/8 of it"),
	  AT(modbus, confirm_ms) },
	{ WORD("modbus", "write-confirm", "confirmed", "confirmed accepted",
	       "Answer a write when the drive has confirmed it, or as soon as it is queued"),
	  AT(modbus, accept_writes) },
	{ WORD("modbus", "stale", "exception", "exception value",
	       "How process data of a drive that does not answer are read: exception 0B, or the last values"),
	  AT(modbus, stale_values) },
	{ NUMBER("modbus", "gateway-unit", "0", 0, 254, "",
	         "Unit id of the gateway's own registers beside 0 and 255; 0 means no further one"),
	  AT(modbus, gateway_unit) },
	{ NUMBER("modbus", "max-clients", "64", 1, 1024, "",
	         "Connections served at the same time"),
	  AT(modbus, max_clients) },
	{ NUMBER("modbus", "reserved-writers", "4", 0, 1023, "",
	         "How many of them only clients that may write can take, so that readers never lock "
	         "them out; fewer than max-clients, and when not given as many as that allows"),
	  AT(modbus, reserved_writers) },
	{ NUMBER("modbus", "max-clients-per-address", "0", 0, 1024, "",
	         "Connections of one address at the same time; 0 means no limit of its own"),
	  AT(modbus, max_clients_per_address) },
	{ NUMBER("modbus", "max-requests-per-second", "0", 0, 100000, "",
	         "Requests of one address, all its connections together, a tenth of them at once; "
	         "more wait their turn and are answered later; 0 means no limit"),
	  AT(modbus, max_requests_per_second) },
	{ NUMBER("modbus", "idle-timeout-s", "0", 0, 86400, "s",
	         "Longest silence before a connection is closed; 0 means never"),
	  AT(modbus, idle_timeout_s) },
	{ WORD("modbus", "command-id-scope", "drive", "drive client",
	       "Whether a drive has one memory of command_id and results for all clients, or one for "
	       "each client address"),
	  AT(modbus, command_id_scope) },
	{ WORD("modbus", "control", "off", "off drive",
	       "Whether one client at a time has the right to command a drive, while others can only "
	       "read and stop it; see the register control_request"),
	  AT(modbus, control) },
	{ NUMBER("modbus", "control-timeout-ms", "5000", 100, 600000, "ms",
	         "Longest silence towards a drive before the client that has control of it loses it"),
	  AT(modbus, control_timeout_ms) },
	{ WORD("modbus", "log", "info", LOG_LEVELS,
	       "What the log tells of clients and the network: that and all that is graver"),
	  .first = DB_LOG_ERROR, AT(modbus, log) },

	{ OTHER(DB_KEY_TEXT, "control", "socket", "/run/drivebridge/control", 1, 107,
	        "Path of the Unix socket for tools on this machine, drivebridgectl first of all; off: there "
	        "is none"),
	  AT(control, socket) },
	{ OTHER(DB_KEY_TEXT, "control", "read-group", "everybody", 1, 31,
	        "Group whose members may read over it, in addition to those who may act; everybody: whoever is on this "
	        "machine"),
	  AT(control, read_group) },
	{ OTHER(DB_KEY_TEXT, "control", "act-group", "drivebridge", 1, 31,
	        "Group whose members may command drives and change their parameters over it and, from this machine, "
	        "over Modbus, in addition to root and the service's own user"),
	  AT(control, act_group) },
	{ WORD("control", "audit", "on", "on off",
	       "The audit trail: who had which drive do what, and what was refused to whom; in the journal, and in files "
	       "that drivebridgectl audit shows"),
	  AT(control, audit_off) },
	{ NUMBER("control", "audit-mib", "32", 1, 4096, "MiB",
	         "What these files take at most: then the oldest records go"),
	  AT(control, audit_mib) },
	{ WORD("control", "edit", "off", "off on",
	       "Whether engineers may change buses and drives over it, which is over the page as well: in the file "
	       "edited/edited.conf next to this one"),
	  AT(control, edit) },
	{ WORD("control", "health", "on", "on off",
	       "Round trips, retries, losses and temperatures of the drives for a week, and the alarms, in files of 1 MiB and 140 KiB "
	       "at most; drivebridgectl health and drivebridgectl alarms show them"),
	  AT(control, health_off) },

	{ OTHER(DB_KEY_LISTEN, "endpoint", "listen", NULL, 0, 0,
	        "Address and port of this endpoint, which has units of its own, such as \"0.0.0.0:503\"; port 0 takes "
	        "any free one"),
	  AT(endpoint, listen) },
	{ OTHER(DB_KEY_NETWORKS, "endpoint", "allow-read", "", 0, 0,
	        "As of modbus, for clients of this endpoint; those of modbus when not given"),
	  AT(endpoint, allow_read) },
	{ OTHER(DB_KEY_NETWORKS, "endpoint", "allow-write", "", 0, 0,
	        "As of modbus, for clients of this endpoint, whose group_stop reaches the drives of all endpoints; "
	        "those of modbus when not given"),
	  AT(endpoint, allow_write) },
	{ OTHER(DB_KEY_TEXT, "endpoint", "secure-socket", "off", 1, 107,
	        "Path of a Unix socket for a drivebridge-tls of its own, whose clients have the units of this endpoint; off: "
	        "there is none"),
	  AT(endpoint, secure_socket) },
	{ NUMBER("endpoint", "gateway-unit", "0", 0, 254, "",
	         "Unit id of the gateway's own registers on this endpoint beside 0 and 255; 0 means no further one"),
	  AT(endpoint, gateway_unit) },
	{ NUMBER("endpoint", "max-clients", "", 1, 1024, "",
	         "Connections served at the same time on this endpoint, which clients of other endpoints do not take; as "
	         "many as max-clients of modbus when not given"),
	  AT(endpoint, max_clients) },

	{ .section = "role", .name = "read", .kind = DB_KEY_DRIVES, .preset = "all", .unit = "",
	  .words = "all none",
	  .description =
	       "Drives that clients with this role in their certificates may read, beside those that they may "
	       "write; others answer exception 01",
	  AT(role, read) },
	{ .section = "role", .name = "write", .kind = DB_KEY_DRIVES, .preset = "none", .unit = "",
	  .words = "all none",
	  .description = "Drives that they may command, where allow-write has their address",
	  AT(role, write) },
	{ WORD("role", "parameters", "no", "no yes",
	       "Whether they may change parameters of those drives: their registers, watchdog_ms, the commands "
	       "save_parameters and raw"),
	  AT(role, parameters) },
	{ WORD("role", "control", "no", "no yes",
	       "Whether they may claim control of those drives, and write the gateway's own registers, whose "
	       "group_stop reaches every drive"),
	  AT(role, control) },

	{ OTHER(DB_KEY_TEXT, "modbus-rtu", "device", NULL, 1, 255,
	        "Path of the serial port at which the PLC is the master"),
	  AT(rtu, device) },
	{ NUMBER("modbus-rtu", "baud", "19200", 300, 4000000, "baud",
	         "Speed of the serial port"),
	  AT(rtu, baud) },
	{ WORD("modbus-rtu", "parity", "even", "none even odd",
	       "Parity bit"),
	  AT(rtu, parity) },
	{ NUMBER("modbus-rtu", "stop-bits", "1", 1, 2, "",
	         "Number of stop bits; many PLCs have two without parity"),
	  AT(rtu, stop_bits) },
	{ WORD("modbus-rtu", "direction", "adapter", "adapter rts rts-inverted",
	       "What switches the line between sending and receiving, as for a bus"),
	  AT(rtu, direction) },
	{ NUMBER("modbus-rtu", "rts-before-ms", "0", 0, 100, "ms",
	         "With direction = rts: from switching RTS to the first byte"),
	  AT(rtu, rts_before_ms) },
	{ NUMBER("modbus-rtu", "rts-after-ms", "0", 0, 100, "ms",
	         "With direction = rts: from the last byte to switching RTS back"),
	  AT(rtu, rts_after_ms) },
	{ OTHER(DB_KEY_TEXT, "modbus-rtu", "endpoint", "", 1, 31,
	        "Name of the section endpoint whose units are meant on this line; those of modbus when not given"),
	  AT(rtu, endpoint_name) },
	{ .section = "modbus-rtu", .name = "units", .kind = DB_KEY_UNITS, .preset = "all", .unit = "",
	  .words = "all",
	  .description =
	       "Unit ids that are answered on this line, such as {\"1\", \"10-19\"}; all: those of every drive, "
	       "and gateway-unit. Requests to others are for other devices of the line and get no answer",
	  AT(rtu, units) },
	{ WORD("modbus-rtu", "allow", "read", "read write",
	       "Whether the PLC at this line may only read, or write too"),
	  AT(rtu, may_write) },
	{ OTHER(DB_KEY_TEXT, "modbus-rtu", "role", "", 1, 31,
	        "Name of the section role whose drives and rights limit what it may; no limit when not given"),
	  AT(rtu, role_name) },
	{ NUMBER("modbus-rtu", "answer-timeout-ms", "1000", 20, 10000, "ms",
	         "How long the PLC waits for an answer: a later one is not sent, because it could meet the "
	         "next request"),
	  AT(rtu, answer_timeout_ms) },
	{ WORD("modbus-rtu", "log", "info", LOG_LEVELS,
	       "What the log tells of this line: that and all that is graver"),
	  .first = DB_LOG_ERROR, AT(rtu, log) },

	{ OTHER(DB_KEY_PROTOCOL, "bus", "protocol", NULL, 0, 0,
	        "Family of the drives on this bus"),
	  AT(bus, driver) },
	{ OTHER(DB_KEY_PROFILE, "bus", "profile", "", 1, 255,
	        "File with what is the same for all drives of a kind: its section bus holds for this bus, and its section drive for the drives of the bus that name no profile of their own; a key that a section has itself wins; a relative path begins in the configuration's folder") },
	{ .section = "bus", .name = "transport", .kind = DB_KEY_TRANSPORT, .preset = "", .unit = "",
	  .words = "serial socketcan slcan",
	  .description =
	       "Serial port, CAN interface of the machine, or CAN adapter on a serial port; "
	       "serial for families on serial lines, else socketcan when not given",
	  AT(bus, transport) },
	{ OTHER(DB_KEY_TEXT, "bus", "device", "", 1, 255,
	        "Path of the serial port; must be given with transport serial and slcan"),
	  AT(bus, device) },
	{ OTHER(DB_KEY_TEXT, "bus", "interface", "", 1, 15,
	        "Name of the CAN interface; must be given with transport socketcan"),
	  .scope = DB_KEY_FOR_CAN, AT(bus, interface) },
	{ NUMBER("bus", "bitrate", "", 10000, 1000000, "bit/s",
	         "Bit rate of the CAN bus, which socketcan only compares with the interface's; "
	         "the family's usual one when not given"),
	  .scope = DB_KEY_FOR_CAN, .of_kind = true, AT(bus, bitrate) },
	{ NUMBER("bus", "baud", "", 300, 4000000, "baud",
	         "Speed of the serial port; the family's usual one, or 115200 with slcan, "
	         "when not given"),
	  .of_kind = true, AT(bus, baud) },
	{ WORD("bus", "parity", "none", "none even odd",
	       "Parity bit"),
	  .scope = DB_KEY_FOR_SERIAL, .of_kind = true, AT(bus, parity) },
	{ NUMBER("bus", "stop-bits", "1", 1, 2, "",
	         "Number of stop bits"),
	  .scope = DB_KEY_FOR_SERIAL, .of_kind = true, AT(bus, stop_bits) },
	{ WORD("bus", "line", "rs485", "rs485 rs232",
	       "RS485: several drives with addresses; RS232: one drive or controller"),
	  .scope = DB_KEY_FOR_SERIAL, AT(bus, line) },
	{ WORD("bus", "direction", "adapter", "adapter rts rts-inverted",
	       "What switches an RS485 line between sending and receiving: the adapter or its driver by "
	       "itself, or the kernel with RTS, raised (rts) or lowered (rts-inverted) while it sends"),
	  .scope = DB_KEY_FOR_SERIAL, AT(bus, direction) },
	{ NUMBER("bus", "rts-before-ms", "0", 0, 100, "ms",
	         "With direction = rts: from switching RTS to the first byte"),
	  .scope = DB_KEY_FOR_SERIAL, AT(bus, rts_before_ms) },
	{ NUMBER("bus", "rts-after-ms", "0", 0, 100, "ms",
	         "With direction = rts: from the last byte to switching RTS back"),
	  .scope = DB_KEY_FOR_SERIAL, AT(bus, rts_after_ms) },
	{ NUMBER("bus", "turnaround-us", "", 0, 100000, "us",
	         "Silence between a drive's answer and the next request, in which drives turn from "
	         "sending to receiving; 3.5 characters and at least 1000 when not given"),
	  .scope = DB_KEY_FOR_SERIAL, .of_kind = true, AT(bus, turnaround_us) },
	{ NUMBER("bus", "cycle-ms", "", 1, 10000, "ms",
	         "Period in which the status of drives is read, of those that move before others; 20 when "
	         "not given, or the first of 50, 100, 200, 500 ... that is enough for one drive at this "
	         "speed"),
	  AT(bus, cycle_ms) },
	{ WORD("bus", "poll", "moving-first", "moving-first even",
	       "Where the line has no room for the status of all drives in each cycle: drives that move "
	       "are read more often than those that stand, or all are read in turn"),
	  AT(bus, polls_evenly) },
	{ WORD("bus", "group-start", "one-by-one", "one-by-one broadcast",
	       "How group_start begins the same staged command on all drives of the bus: one after the "
	       "other, or with one frame, which drives obey that are not in this file, too"),
	  AT(bus, starts_by_broadcast) },
	{ NUMBER("bus", "drive-latency-ms", "30", 1, 1000, "ms",
	         "Longest time a drive may take before it begins to answer"),
	  .of_kind = true, AT(bus, drive_latency_ms) },
	{ WORD("bus", "adapt", "on", "off on",
	       "Whether the times that a drive is given are learnt: on, turnaround-us and "
	       "drive-latency-ms are where they begin; off, where they stay"),
	  AT(bus, adapt) },
	{ NUMBER("bus", "retries", "2", 0, 10, "",
	         "Repeats of a lost harmless exchange before the drive counts as offline"),
	  .of_kind = true, AT(bus, retries) },
	{ NUMBER("bus", "save-interval-s", "10", 0, 3600, "s",
	         "Shortest time between two save_parameters of one drive, because they wear its memory"),
	  .of_kind = true, AT(bus, save_interval_s) },
	{ NUMBER("bus", "priority", "1", 0, 99, "",
	         "Real-time priority (SCHED_FIFO) of the bus's thread, where the system allows it; 0 means "
	         "none"),
	  AT(bus, priority) },
	{ OTHER(DB_KEY_CPUS, "bus", "cpus", "any", 1, 63,
	        "Processors on which the bus's thread may run, such as 3 or 2-3,5, or any"),
	  AT(bus, cpus) },
	{ WORD("bus", "log", "info", LOG_LEVELS,
	       "What the log tells of this bus and its drives: that and all that is graver"),
	  .first = DB_LOG_ERROR, AT(bus, log) },

	{ OTHER(DB_KEY_BUS, "drive", "bus", NULL, 0, 0,
	        "Name of the bus the drive is connected to"),
	  AT(drive, bus) },
	{ OTHER(DB_KEY_PROFILE, "drive", "profile", "", 1, 255,
	        "File with what is the same for all drives of a kind, in the place of the bus's: its section drive holds for this drive; what its section bus has must hold on the bus, too") },
	{ NUMBER("drive", "address", "", 0, 65535, "",
	         "Address on the bus, in the family's range; must be given, but not on RS232 "
	         "without axes"),
	  AT(drive, address) },
	{ WORD("drive", "axis", "x", "x y z a",
	       "Axis of the controller at this address; must be given when it has several drives"),
	  .scope = DB_KEY_FOR_AXES, AT(drive, axis) },
	{ OTHER(DB_KEY_TEXT, "drive", "endpoint", "", 1, 31,
	        "Name of the section endpoint where the drive has its unit; modbus when not given"),
	  AT(drive, endpoint_name) },
	{ NUMBER("drive", "unit", NULL, 1, 247, "",
	         "Modbus unit id under which the drive answers"),
	  AT(drive, unit) },
	{ .section = "drive", .name = "counts-per-unit", .kind = DB_KEY_REAL, .preset = "1.0",
	  .min = 1e-9, .max = 1e9, .unit = "", .words = "",
	  .description = "Drive units in one of the user's units",
	  .of_kind = true, AT(drive, counts_per_unit) },
	{ OTHER(DB_KEY_TEXT, "drive", "unit-name", "counts", 1, 31,
	        "Name of the user's unit"),
	  .of_kind = true, AT(drive, unit_name) },
	{ WORD("drive", "on-client-loss", "stop", "none stop quick-stop disable",
	       "What the drive does when its PLC falls silent"),
	  AT(drive, on_client_loss) },
	{ WORD("drive", "on-exit", "", "none stop quick-stop disable",
	       "What the drive does when the service ends, or when a reload changes it or takes it "
	       "out; as on-client-loss when not given"),
	  AT(drive, on_exit) },
	{ NUMBER("drive", "stop-reaction-ms", "1000", 100, 60000, "ms",
	         "Longest time that a moving drive which was told to stop may go without slowing down "
	         "before that counts as a failure; it is told again all the while"),
	  .of_kind = true, AT(drive, stop_reaction_ms) },
	{ WORD("drive", "on-stop-failure", "none", "none disable",
	       "What is done then beside telling it again: nothing, or its power stage is switched off"),
	  .of_kind = true, AT(drive, on_stop_failure) },
	{ NUMBER("drive", "watchdog-ms", "3000", 0, 60000, "ms",
	         "Longest silence of the PLC after a motion command; 0 turns the watchdog off"),
	  AT(drive, watchdog_ms) },
	{ WORD("drive", "watchdog-feed", "commanders", "requests commanders writes heartbeat",
	       "What tells that the PLC is not silent: reads of any client that may write besides the "
	       "next, reads of connections that have commanded the drive besides the next, only "
	       "admitted commands and other writes of who has commanded the drive, or only a changed "
	       "register heartbeat"),
	  AT(drive, watchdog_feed) },
	{ LIMIT("min-position", -1e12, "Lowest position that may be commanded, in the user's unit"),
	  AT(drive, min_position) },
	{ LIMIT("max-position", -1e12, "Highest position that may be commanded, in the user's unit"),
	  AT(drive, max_position) },
	{ LIMIT("max-velocity", 0, "Highest velocity that may be commanded, in the user's unit per second"),
	  .of_kind = true, AT(drive, max_velocity) },
	{ LIMIT("max-acceleration", 0,
	        "Highest acceleration that may be written, in the user's unit per second squared"),
	  .of_kind = true, AT(drive, max_acceleration) },
	{ .section = "drive", .name = "in-position-window", .kind = DB_KEY_REAL, .preset = "0",
	  .min = 0, .max = 1e12, .unit = "", .words = "",
	  .description = "Distance from the target, in the user's unit, that counts as arrived",
	  .of_kind = true, AT(drive, in_position_window) },
	{ NUMBER("drive", "settling-ms", "0", 0, 10000, "ms",
	         "How long a drive must stand in that window before its move is done"),
	  .of_kind = true, AT(drive, settling_ms) },
	{ WORD("drive", "layout", "neutral", "neutral vsmd",
	       "Register map of this unit: the same as that of every drive, or that of the vendor's "
	       "own Modbus models"),
	  .scope = DB_KEY_FOR_VSMD, .of_kind = true, AT(drive, vendor_layout) },
	{ NUMBER("drive", "vendor-unit", "0", 0, 247, "",
	         "Second unit id, under which the drive answers with the register map of the vendor's "
	         "own Modbus models; 0 means none"),
	  .scope = DB_KEY_FOR_VSMD, AT(drive, vendor_unit) },
	{ WORD("drive", "vendor-word-order", "low-first", "low-first high-first",
	       "Which register of a 32-bit value comes first in that map until a program writes mbs"),
	  .scope = DB_KEY_FOR_VSMD, .of_kind = true, AT(drive, vendor_high_first) },
};
/* clang-format on */

/* Keys of earlier versions whose value is fixed now: a file may still have them. */
static const struct {
	const char *section;
	const char *name;
} RETIRED[] = {
	{ "modbus", "max-pipelined" },
	{ "modbus", "frame-timeout-ms" },
	{ "modbus", "keepalive-s" },
	{ "bus", "queue" },
};

#define KEY_COUNT (sizeof(KEYS) / sizeof(KEYS[0]))

const struct db_config_key *db_keys_all(size_t *count)
{
	*count = KEY_COUNT;
	return KEYS;
}

const struct db_config_key *db_keys_find(const char *section, const char *name)
{
	for (size_t i = 0; i < KEY_COUNT; i++) {
		if (strcmp(KEYS[i].section, section) == 0 && strcmp(KEYS[i].name, name) == 0)
			return &KEYS[i];
	}
	return NULL;
}

bool db_keys_is_retired(const char *section, const char *name)
{
	for (size_t i = 0; i < sizeof(RETIRED) / sizeof(RETIRED[0]); i++) {
		if (strcmp(RETIRED[i].section, section) == 0 && strcmp(RETIRED[i].name, name) == 0)
			return true;
	}
	return false;
}

bool db_keys_fit(const struct db_config_key *key, const struct db_driver *driver)
{
	switch (key->scope) {
	case DB_KEY_FOR_SERIAL:
		return driver->medium == DB_MEDIUM_SERIAL;
	case DB_KEY_FOR_CAN:
		return driver->medium == DB_MEDIUM_CAN;
	case DB_KEY_FOR_AXES:
		return driver->axes > 0;
	case DB_KEY_FOR_VSMD:
		return driver->vendor_layout;
	case DB_KEY_FOR_ALL:
		break;
	}
	return true;
}

void db_keys_put_word(const struct db_config_key *key, void *member, unsigned position)
{
	unsigned value = key->first + position;
	bool flag = position != 0;

	if (key->size == sizeof(flag))
		memcpy(member, &flag, sizeof(flag));
	else
		memcpy(member, &value, sizeof(value));
}

unsigned db_keys_get_word(const struct db_config_key *key, const void *member)
{
	unsigned value;

	if (key->size == sizeof(bool))
		return *(const bool *)member;
	memcpy(&value, member, sizeof(value));
	return value - key->first;
}

struct db_config_key db_keys_of_option(const struct db_option *option)
{
	return (struct db_config_key){
		.section = option->section,
		.name = option->name,
		.kind = option->words[0] != '\0' ? DB_KEY_WORD :
		        option->whole            ? DB_KEY_INTEGER :
		                                   DB_KEY_REAL,
		.preset = option->preset,
		.min = option->min,
		.max = option->max,
		.unit = option->unit,
		.words = option->words,
		.scope = DB_KEY_FOR_ALL,
		.description = option->description,
	};
}

const struct db_option *db_keys_find_option(const struct db_driver *driver, const char *section,
                                            const char *name)
{
	for (size_t i = 0; i < driver->option_count; i++) {
		const struct db_option *option = &driver->options[i];

		if (strcmp(option->section, section) == 0 && strcmp(option->name, name) == 0)
			return option;
	}
	return NULL;
}
