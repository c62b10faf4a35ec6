/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of the gateway's unit. */
#include "regmap/image.h"
#include "regmap/rows.h"

/* --- what is there several times -------------------------------------------------------------- */

static const struct db_repeat each_group_word = {
	.count = DB_GROUP_WORDS,
	.addresses = 1,
	.bytes = sizeof(uint16_t),
};
static const struct db_repeat each_bus = {
	.of = DB_REPEAT_BUSES,
	.count = DB_GATEWAY_BUSES,
	.addresses = 40,
	.bytes = sizeof(struct db_gateway_bus),
};
static const struct db_repeat each_line = {
	.of = DB_REPEAT_BUSES,
	.count = DB_GATEWAY_BUSES,
	.addresses = 16,
	.bytes = sizeof(struct db_gateway_bus),
};
static const struct db_repeat each_drive = {
	.of = DB_REPEAT_DRIVES,
	.count = DB_GATEWAY_DRIVES,
	.addresses = 16,
	.bytes = sizeof(struct db_gateway_drive),
};
static const struct db_repeat each_window = {
	.of = DB_REPEAT_DRIVES,
	.count = DB_GATEWAY_WINDOWS,
	.addresses = DB_WINDOW_REGISTERS,
	.bytes = sizeof(struct db_gateway_window),
};
static const struct db_repeat each_client = {
	.count = DB_GATEWAY_CLIENTS,
	.addresses = 12,
	.bytes = sizeof(struct db_gateway_client),
};
static const struct db_repeat each_client_text = {
	.count = DB_GATEWAY_CLIENTS,
	.addresses = DB_CLIENT_ADDRESS_REGISTERS,
	.bytes = sizeof(struct db_gateway_client),
};

/* --- codes for descriptions ------------------------------------------------------------------- */

static const char *configuration_state_name(unsigned code)
{
	static const char *const names[DB_CONFIGURATION_STATES] = DB_CONFIGURATION_NAMES;

	return names[code];
}

static const struct db_codes configuration_states = { configuration_state_name,
	                                              DB_CONFIGURATION_STATES, .bits = false };

/* --- long descriptions ------------------------------------------------------------------------ */

static const char about_gateway_heartbeat[] =
	"For PLCs with one unit id only: a new value is like one in the heartbeat of every drive "
	"of this endpoint with watchdog-feed = heartbeat; with control = drive of those that the "
	"client controls; reads the value written last";
static const char about_configuration_state[] =
	"Whether the configuration on disk is what runs; refused and last_good need somebody "
	"because a restart would not run what runs now; changed is right and waits for a reload";

/* --- the registers ---------------------------------------------------------------------------- */

// clang-format off
#define FROM(needs, member) \
	.part = DB_PART_##needs, .offset = offsetof(struct db_gateway_image, member)
#define GATEWAY(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(SERVER, member), more.description = (text) }
#define GROUP(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(GROUP, member), more.description = (text) }
#define BUS(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(BUSES, buses[0].member), \
	  EACH(bus) more.description = (text) }
#define LINE(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(BUSES, buses[0].member), \
	  EACH(line) more.description = (text) }
#define CLIENT(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(CLIENTS, connected[0].member), \
	  EACH(client) more.description = (text) }
#define CLIENT_TEXT(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(CLIENTS, connected[0].member), \
	  EACH(client_text) more.description = (text) }
#define DRIVE(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(DRIVES, drives[0].member), \
	  EACH(drive) more.description = (text) }
#define WINDOW(at, title, kind, member, more, text) \
	{ ROW(at, title, kind), FROM(WINDOWS, windows[0].member), \
	  EACH(window) more.description = (text) }

/* Address, name, type, member of the image, access and other properties, description. */
static const struct db_row registers[] = {
	/* What the gateway is, and the server. */
	GATEWAY( 0, "version_major",     U16,    version_major,           READ,
	        "Version of drivebridge: first number"),
	GATEWAY( 1, "version_minor",     U16,    version_minor,           READ,
	        "Version of drivebridge: second number"),
	GATEWAY( 2, "version_patch",     U16,    version_patch,           READ,
	        "Version of drivebridge: third number"),
	GATEWAY( 3, "bus_count",         U16,    bus_count,               READ,
	        "Buses in the configuration"),
	GATEWAY( 4, "drive_count",       U16,    drive_count,             READ,
	        "Drives of this endpoint in the configuration"),
	GATEWAY( 5, "drives_online",     U16,    drives_online,           READ,
	        "Drives of this endpoint that are online"),
	GATEWAY( 6, "uptime_s",          U32,    uptime_s,                READ UNIT("s"),
	        "Time since the bridge started"),
	GATEWAY( 8, "clients",           U32,    server.clients,          READ,
	        "Modbus TCP clients connected"),
	GATEWAY(10, "clients_peak",      U32,    server.clients_peak,     READ,
	        "The most there were at once"),
	GATEWAY(12, "accepted",          U32,    server.accepted,         READ,
	        "Connections accepted"),
	GATEWAY(14, "refused_full",      U32,    server.refused_full,     READ,
	        "Connections refused because max-clients was reached"),
	GATEWAY(16, "refused_address",   U32,    server.refused_address,  READ,
	        "Connections refused because of the address"),
	GATEWAY(18, "refused_writes",    U32,    server.refused_writes,   READ,
	        "Writes refused because the client may only read"),
	GATEWAY(20, "requests",          U32,    server.requests,         READ,
	        "Requests received"),
	GATEWAY(22, "exceptions",        U32,    server.exceptions,       READ,
	        "Exceptions answered"),
	GATEWAY(24, "bad_frames",        U32,    server.bad_frames,       READ,
	        "Connections closed for what cannot be Modbus"),
	GATEWAY(26, "timeouts",          U32,    server.timeouts,         READ,
	        "Connections closed for an unfinished frame or idling"),
	GATEWAY(28, "refused_reserved",  U32,    server.refused_reserved, READ,
	        "Connections refused because the remaining ones are reserved for clients that may "
	        "write"),
	GATEWAY(30, "refused_per_address", U32,  server.refused_per_address, READ,
	        "Connections refused because max-clients-per-address was reached"),
	GATEWAY(32, "refused_control",   U32,    server.refused_control,  READ,
	        "Writes refused because another client has control of the drive"),
	GATEWAY(34, "held_back",         U32,    server.held_back,        READ,
	        "Requests that were answered later because of max-requests-per-second"),
	GATEWAY(36, "configuration_state", U16,  configuration_state,     READ CODES(configuration_states),
	        about_configuration_state),
	GATEWAY(40, "configuration_since_us", U64, configuration_since_us, READ UNIT("us"),
	        "Since when; counted from 1970-01-01 UTC"),

	/* Commands to many drives in one write. */
	GROUP(60, "group_stop",       U16,    group_stop,       WRITE UPTO(3),
	      "Written 1=stop 2=quick_stop 3=disable: every drive of every bus and every endpoint; "
	      "answered when all have confirmed; reads 0"),
	GROUP(61, "group_start",      U16,    group_start,      WRITE UPTO(1),
	      "Written 1: starts the staged_command of every drive of this endpoint; answered "
	      "when all have confirmed; reads 0"),
	GROUP(62, "group_staged",     U16,    group_staged,     READ,
	      "Drives of this endpoint with a staged_command"),
	GROUP(63, "group_drives",     U16,    group_drives,     READ,
	      "Drives of the latest group command that was written at this endpoint"),
	GROUP(64, "group_result",     U16,    group_result,     READ,
	      "Highest exception code of its drives so far; 0=none; each drive's own result "
	      "tells more"),
	GROUP(65, "group_busy",       U16,    group_busy,       READ,
	      "1=some drive has not ended its part yet"),
	GROUP(66, "group_skew_us",    U32,    group_skew_us,    READ UNIT("us"),
	      "From the first to the last drive's command on the wire"),
	GROUP(68, "heartbeat",        U16,    heartbeat,        HEARTBEAT ANY_U16,
	      about_gateway_heartbeat),
	GROUP(70, "group_units#",     BITS16, group_units,      LIST EACH(group_word),
	      "Units of this endpoint that group_stop_units stops: bit 0 of group_units1 is unit 1 and bit 15 of "
	      "group_units16 would be unit 256; kept until they are written again"),
	GROUP(86, "group_stop_units", U16,    group_stop_units, LIST UPTO(3),
	      "As group_stop for the units of group_units; best written with them in one "
	      "request; 0A when some of them have no drive but the others are stopped all the "
	      "same; reads 0"),

	/* A block for each bus. */
	BUS(100, "bus#_up",           U16,    up,                  READ,
	    "Port of bus #: 0=closed 1=open; only the first 8 buses have registers"),
	BUS(101, "bus#_last_error",   U16,    last_error,          READ,
	    "Bus #: errno of the last failed open or lost port; 0=none"),
	BUS(102, "bus#_period_us",    U32,    stats.period_us,     READ UNIT("us"),
	    "Bus #: configured cycle"),
	BUS(104, "bus#_cycle_us",     U32,    stats.cycle_us,      READ UNIT("us"),
	    "Bus #: time the last cycle took"),
	BUS(106, "bus#_cycle_max_us", U32,    stats.cycle_max_us,  READ UNIT("us"),
	    "Bus #: longest cycle"),
	BUS(108, "bus#_jitter_us",    U32,    stats.jitter_us,     READ UNIT("us"),
	    "Bus #: lateness of the last cycle's start"),
	BUS(110, "bus#_jitter_max_us", U32,   stats.jitter_max_us, READ UNIT("us"),
	    "Bus #: largest lateness"),
	BUS(112, "bus#_utilisation",  U32,    stats.utilisation,   READ UNIT("permille"),
	    "Bus #: part of the last second in which the wire was busy or waited for"),
	BUS(114, "bus#_cycles",       U32,    stats.cycles,        READ,
	    "Bus #: cycles run"),
	BUS(116, "bus#_overruns",     U32,    stats.overruns,      READ,
	    "Bus #: cycles that had not ended when the next was due"),
	BUS(118, "bus#_transactions", U32,    stats.transactions,  READ,
	    "Bus #: exchanges on the wire"),
	BUS(120, "bus#_retries",      U32,    stats.retries,       READ,
	    "Bus #: exchanges repeated"),
	BUS(122, "bus#_timeouts",     U32,    stats.timeouts,      READ,
	    "Bus #: answers that did not come in time"),
	BUS(124, "bus#_bad_frames",   U32,    stats.bad_frames,    READ,
	    "Bus #: frames with a wrong checksum or form"),
	BUS(126, "bus#_stray_frames", U32,    stats.stray_frames,  READ,
	    "Bus #: good frames that nobody had asked for"),
	BUS(128, "bus#_garbage_bytes", U32,   stats.garbage_bytes, READ,
	    "Bus #: bytes outside of frames"),
	BUS(130, "bus#_opens",        U32,    stats.opens,         READ,
	    "Bus #: how often the port was opened"),
	BUS(132, "bus#_queued",       U32,    stats.queued,        READ,
	    "Bus #: commands waiting now"),
	BUS(134, "bus#_online",       U32,    stats.online,        READ,
	    "Bus #: drives online now"),
	BUS(136, "bus#_reports",      U32,    stats.reports,       READ,
	    "Bus #: frames that drives sent by themselves and that were used"),

	/* What adapters and controllers report of each bus's line. */
	LINE(440, "line#_state",       BITS16, line_state,              READ,
	     "Line of bus #: bit 0 carries frames; 1 bus off; 2 error passive; 3 error warning"),
	LINE(441, "line#_error",       U16,    line_error,              READ,
	     "Line of bus #: errno of what keeps an open port from carrying frames; 0=none"),
	LINE(442, "line#_bus_offs",    U32,    stats.port.bus_offs,     READ,
	     "Line of bus #: times the CAN controller went bus off"),
	LINE(444, "line#_error_passives", U32, stats.port.error_passives, READ,
	     "Line of bus #: times the CAN controller became error passive"),
	LINE(446, "line#_arbitration_lost", U32, stats.port.arbitration_lost, READ,
	     "Line of bus #: frames that lost arbitration as far as the controller reports it"),
	LINE(448, "line#_line_errors", U32,    stats.port.line_errors,  READ,
	     "Line of bus #: stuff form CRC and acknowledge errors on the wire"),
	LINE(450, "line#_overflows",   U32,    stats.port.overflows,    READ,
	     "Line of bus #: frames lost in the controller or adapter"),
	LINE(452, "line#_refused",     U32,    stats.port.refused,      READ,
	     "Line of bus #: frames or settings that the adapter refused"),
	LINE(454, "line#_bitrate",     U32,    stats.port.bitrate,      READ UNIT("bit/s"),
	     "Line of bus #: bit rate that the interface is set to; 0=not known"),

	/* What is wrong with the configuration on disk. */
	GATEWAY(600, "configuration_message", TEXT, configuration_message, READ
	        LENGTH(DB_CONFIGURATION_MESSAGE_REGISTERS),
	        "What is to be said of it: the first error with its file and line; empty=nothing"),

	/* The connected clients. */
	CLIENT(700, "client#_ipv4",      U32,    ipv4,        READ,
	       "IPv4 address of client # with its first byte highest; 0=none 4294967295=see "
	       "client#_address; the 16 clients that are connected longest have registers"),
	CLIENT(702, "client#_port",      U16,    port,        READ ANY_U16,
	       "Client #: its TCP port"),
	CLIENT(703, "client#_may_write", U16,    may_write,   READ UPTO(1),
	       "Client #: 1=it may write"),
	CLIENT(704, "client#_requests",  U32,    requests,    READ,
	       "Client #: requests received"),
	CLIENT(706, "client#_idle_s",    U32,    idle_s,      READ UNIT("s"),
	       "Client #: time since the last byte in either direction"),
	CLIENT(708, "client#_connected_s", U32,  connected_s, READ UNIT("s"),
	       "Client #: time since it connected"),
	CLIENT(710, "client#_controls",  BITS32, controls,    READ,
	       "Client #: drives that it has control of; bit 0 = the first drive of the "
	       "endpoint"),

	/* A block for each drive. */
	DRIVE(1000, "drive#_unit",       U16,    unit,                    READ,
	      "Modbus unit of drive #; only the first 32 drives have registers here"),
	DRIVE(1001, "drive#_online",     U16,    online,                  READ,
	      "Drive #: 1=online"),
	DRIVE(1002, "drive#_axis_state", U16,    axis_state,              READ,
	      "Drive #: as axis_state"),
	DRIVE(1003, "drive#_error",      U16,    error,                   READ,
	      "Drive #: as error"),
	DRIVE(1004, "drive#_age_ms",     U32,    age_ms,                  READ UNIT("ms"),
	      "Drive #: age of its process data"),
	DRIVE(1006, "drive#_round_trip_us", U32, stats.round_trip_us,     READ UNIT("us"),
	      "Drive #: last round trip"),
	DRIVE(1008, "drive#_round_trip_max_us", U32, stats.round_trip_max_us, READ UNIT("us"),
	      "Drive #: longest round trip"),
	DRIVE(1010, "drive#_requests",   U32,    stats.requests,          READ,
	      "Drive #: requests sent"),
	DRIVE(1012, "drive#_retries",    U32,    stats.retries,           READ,
	      "Drive #: requests repeated"),
	DRIVE(1014, "drive#_timeouts",   U32,    stats.timeouts,          READ,
	      "Drive #: answers that did not come in time"),

	/* The clients' addresses as text. */
	CLIENT_TEXT(1520, "client#_address", TEXT,   address, READ
	            LENGTH(DB_CLIENT_ADDRESS_REGISTERS),
	            "Client #: its address; empty=none"),

	/* The flat window, a block of process data for each drive. */
	WINDOW(2000, "window#_unit",      U16,    unit,           READ,
	       "Modbus unit of drive #; every drive has a window"),
	WINDOW(2001, "window#_online",    U16,    online,         READ,
	       "Window of drive #: 1=online"),
	WINDOW(2002, "window#_axis_state", U16,   axis_state,     READ,
	       "Window of drive #: as axis_state; Offline while it is not online"),
	WINDOW(2003, "window#_error",     U16,    error,          READ,
	       "Window of drive #: as error"),
	WINDOW(2004, "window#_status",    BITS32, status,         READ,
	       "Window of drive #: as status"),
	WINDOW(2006, "window#_quality",   U16,    quality,        READ,
	       "Window of drive #: as quality; 0=bad: position and velocity are the last known"),
	WINDOW(2007, "window#_active_command", U16, active_command, READ,
	       "Window of drive #: as active_command"),
	WINDOW(2008, "window#_age_ms",    U32,    age_ms,         READ UNIT("ms"),
	       "Window of drive #: age of its process data"),
	WINDOW(2010, "window#_position",  I32,    position,       READ UNIT("counts"),
	       "Window of drive #: as position"),
	WINDOW(2012, "window#_velocity",  F32,    velocity,       READ UNIT("counts/s"),
	       "Window of drive #: as velocity"),
	WINDOW(2014, "window#_position_units", F32, position_units, READ,
	       "Window of drive #: as position_units"),
	WINDOW(2016, "window#_velocity_units", F32, velocity_units, READ,
	       "Window of drive #: as velocity_units"),
	WINDOW(2018, "window#_drive_status", BITS32, drive_status, READ,
	       "Window of drive #: as drive_status"),
	WINDOW(2020, "window#_result_id", U16,    result_id,      READ,
	       "Window of drive #: as result_id"),
	WINDOW(2021, "window#_result",    U16,    result,         READ,
	       "Window of drive #: as result"),
	WINDOW(2022, "window#_inputs",    BITS16, inputs,         READ,
	       "Window of drive #: as inputs"),
	WINDOW(2023, "window#_outputs",   BITS16, outputs,        READ,
	       "Window of drive #: as outputs"),
};
// clang-format on

const struct db_row_set db_gateway_registers = {
	DB_VIEW_GATEWAY,
	DB_TABLE_HOLDING,
	registers,
	COUNT_OF(registers),
};
