/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The configuration as the rest of the program sees it: plain structs with defaults filled in and
 * everything checked. Made by db_config_load() (src/bridge/config), read-only afterwards, owned by
 * the caller until db_config_free().
 */
#ifndef DRIVEBRIDGE_CONFIG_H
#define DRIVEBRIDGE_CONFIG_H

#include "drivebridge/log.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

struct db_driver;
struct db_source;
struct db_transport;

/* What is done in addition to repeating the stop when a drive does not slow down. */
enum db_on_stop_failure {
	DB_ON_STOP_FAILURE_NONE,
	/* it is disabled: its motor then coasts, or its brake falls in */
	DB_ON_STOP_FAILURE_DISABLE,
};

enum db_on_loss { DB_ON_LOSS_NONE, DB_ON_LOSS_STOP, DB_ON_LOSS_QUICK_STOP, DB_ON_LOSS_DISABLE };
/* What shows that the clients of a drive are alive. Each is also shown by the values after it. */
/* What feeds a watchdog; what is enough for one value is enough for those before it. */
enum db_watchdog_feed {
	DB_FEED_REQUESTS, /* any read of a client that may write, and everything below */
			  /* reads of clients that have commanded the drive, and everything below */
	DB_FEED_COMMANDERS,
	/* admitted commands, and other writes of clients that command the drive */
	DB_FEED_WRITES,
	DB_FEED_HEARTBEAT,
};
enum db_id_scope { DB_IDS_OF_DRIVE, DB_IDS_OF_CLIENT };
enum db_control_mode { DB_CONTROL_OFF, DB_CONTROL_DRIVE };
enum db_parity { DB_PARITY_NONE, DB_PARITY_EVEN, DB_PARITY_ODD };
enum db_line { DB_LINE_RS485, DB_LINE_RS232 };
enum db_direction { DB_DIRECTION_ADAPTER, DB_DIRECTION_RTS, DB_DIRECTION_RTS_INVERTED };

/* An entry of allow-read or allow-write: an IPv4 or IPv6 network. IPv4 is stored v4-mapped. */
struct db_network {
	uint8_t address[16];
	uint8_t prefix; /* 0..128, of the v4-mapped form */
};

/* A choice of drives. */
struct db_drive_set {
	bool all;
	char *names; /* one after the other, each with its zero byte, an empty one last; null: none */
};

static inline bool db_drive_set_has(const struct db_drive_set *set, const char *name)
{
	const char *listed = set->names;

	while (listed && *listed && strcmp(listed, name) != 0)
		listed += strlen(listed) + 1;
	return set->all || (listed && *listed);
}

/* What clients may whose certificate has this role; see `secure_socket`. */
struct db_role_config {
	char *name;
	struct db_drive_set read;  /* default all; those of `write` are always among them */
	struct db_drive_set write; /* default none */
	/* parameters = no (default) or yes: parameters, watchdog_ms, save_parameters, raw frames */
	bool parameters;
	/* control = no (default) or yes: claims of control, and the gateway's own registers, with
	 * which group commands reach every drive */
	bool control;
};

/*
 * Endpoints have unit spaces of their own: unit 5 of one is another drive than unit 5 of the other.
 * Each has a number that follows from its name and so is the same after each reload: what waits
 * while a reload replaces the configuration never means another endpoint. The section modbus is the
 * first endpoint.
 */
#define DB_ENDPOINT_FIRST UINT32_C(0)
#define DB_ENDPOINTS_MAX 16 /* sections endpoint */
/* No endpoint's number: for programs that name drives, the drives of all. */
#define DB_ENDPOINT_ALL UINT32_MAX

/* FNV-1a of the name; null or "" is the first endpoint. The check of a configuration refuses two
 * names with one number. */
static inline uint32_t db_endpoint_number(const char *name)
{
	uint32_t number = UINT32_C(2166136261);

	if (!name || !*name)
		return DB_ENDPOINT_FIRST;
	for (; *name; name++)
		number = (number ^ (uint8_t)*name) * UINT32_C(16777619);
	return number == DB_ENDPOINT_FIRST || number == DB_ENDPOINT_ALL ? 1 : number;
}

/* A further TCP endpoint, beside the one of the section modbus, whose other settings hold here
 * too. */
struct db_endpoint_config {
	char *name;
	uint32_t number;               /* db_endpoint_number() of the name */
	unsigned source_line;          /* while the configuration is read */
	char *listen;                  /* as of the section modbus, and given */
	struct db_network *allow_read; /* these two as of the section modbus when not given */
	size_t allow_read_count;
	struct db_network *allow_write;
	size_t allow_write_count;
	char *secure_socket;   /* as of the section modbus; default DB_NO_SOCKET */
	unsigned gateway_unit; /* 1..254, 0 (default) = none in addition to 0 and 255 */
	/* max-clients, 1..1024, default: as of the section modbus. They are this endpoint's own:
	 * clients of other endpoints take none of them. */
	unsigned max_clients;
	unsigned reserved_writers; /* as of the section modbus, but below max_clients */
};

/* A serial line on which a PLC reaches drives over Modbus RTU. */
struct db_rtu_config {
	char *name;
	const char *source_file;
	unsigned source_line;
	char *device;
	unsigned baud;               /* default 19200 */
	enum db_parity parity;       /* default even */
	unsigned stop_bits;          /* 1 (default) or 2 */
	enum db_direction direction; /* as of a bus */
	unsigned rts_before_ms;
	unsigned rts_after_ms;
	char *endpoint_name; /* endpoint: whose units these are; null: the first one's */
	uint32_t endpoint;   /* its number */
	/* Units that are answered here, a bit each; all others belong to other devices. */
	uint8_t units[32];
	bool may_write;  /* allow = read (default) or write */
	char *role_name; /* the section role that limits it; null: none */
	const struct db_role_config *role;
	/* answer-timeout-ms, 20..10000, default 1000: how long the PLC waits for an answer */
	unsigned answer_timeout_ms;
	enum db_log_level log; /* default info */
};

static inline bool db_rtu_has_unit(const struct db_rtu_config *line, unsigned unit)
{
	return unit < 256 && (line->units[unit / 8] >> (unit % 8) & 1);
}

/* What clients of the network without a certificate may still do. */
enum db_require_secure {
	DB_SECURE_NOT_REQUIRED,
	DB_SECURE_FOR_WRITES, /* they may only read */
	DB_SECURE_FOR_ALL,    /* they may not connect */
};

struct db_modbus_config {
	/* "ADDRESS:PORT", "[V6]:PORT"; default "127.0.0.1:502"; port 0 = any free one */
	char *listen;
	struct db_network *allow_read; /* default: everyone who can connect to `listen` */
	size_t allow_read_count;
	struct db_network *allow_write; /* default: 127.0.0.0/8 and ::1 */
	size_t allow_write_count;
	/* local-writers = command-group (default) or everybody: users of this machine have the
	 * rights that they have at the control socket, or those of their address alone */
	bool everybody_writes_here;
	/* secure-socket: where drivebridge-tls hands clients over; DB_NO_SOCKET (default) or null */
	char *secure_socket;
	enum db_require_secure require_secure; /* require-secure, default no */
	struct db_role_config *roles;
	size_t role_count;
	struct db_endpoint_config *endpoints; /* the further ones */
	size_t endpoint_count;
	struct db_rtu_config *lines;
	size_t line_count;
	bool low_word_first; /* word-order = high-first (default) or low-first */
	unsigned confirm_ms; /* confirm-ms, 1..10000, default 40 or what the buses need */
	bool accept_writes;  /* write-confirm = confirmed (default) or accepted */
	bool stale_values;   /* stale = exception (default) or value */
			     /* gateway-unit, 1..254, 0 (default) = none in addition to 0 and 255 */
	unsigned gateway_unit;
	unsigned max_clients;   /* max-clients, 1..1024, default 64 */
	unsigned max_pipelined; /* requests of one connection in work at once; from a file 16 */
	/* An unfinished request ends its connection after this time; from a file 1000. */
	unsigned frame_timeout_ms;
	unsigned idle_timeout_s; /* idle-timeout-s, 0 = never (default) */
	/* reserved-writers, default 4 or what max-clients leaves, below max-clients: connections
	 * that only clients with write access can take. */
	unsigned reserved_writers;
	unsigned max_clients_per_address;  /* 0 = no limit (default) */
	unsigned max_requests_per_second;  /* of one address, 0 = no limit (default) */
	enum db_id_scope command_id_scope; /* command-id-scope, default drive */
	enum db_control_mode control;      /* default off */
	unsigned control_timeout_ms;       /* control-timeout-ms, 100..600000, default 5000 */
	enum db_log_level log;             /* default info */
};

/* The endpoints in one form: the section modbus is the first one, at index 0, with the name "". */
static inline size_t db_modbus_endpoint_count(const struct db_modbus_config *modbus)
{
	return 1 + modbus->endpoint_count;
}

/* Its texts and lists are those of the configuration. */
static inline struct db_endpoint_config db_modbus_endpoint_at(const struct db_modbus_config *modbus,
                                                              size_t index)
{
	if (index > 0)
		return modbus->endpoints[index - 1];
	return (struct db_endpoint_config){
		.number = DB_ENDPOINT_FIRST,
		.listen = modbus->listen,
		.allow_read = modbus->allow_read,
		.allow_read_count = modbus->allow_read_count,
		.allow_write = modbus->allow_write,
		.allow_write_count = modbus->allow_write_count,
		.secure_socket = modbus->secure_socket,
		.gateway_unit = modbus->gateway_unit,
		.max_clients = modbus->max_clients,
		.reserved_writers = modbus->reserved_writers,
	};
}

/* The one with this number. False: there is none. */
static inline bool db_modbus_endpoint_find(const struct db_modbus_config *modbus, uint32_t number,
                                           struct db_endpoint_config *endpoint)
{
	for (size_t i = 0; i < db_modbus_endpoint_count(modbus); i++) {
		*endpoint = db_modbus_endpoint_at(modbus, i);
		if (endpoint->number == number)
			return true;
	}
	return false;
}

/* The name of the one with this number; "" for the first one, and where there is none. */
static inline const char *db_modbus_endpoint_name(const struct db_modbus_config *modbus,
                                                  uint32_t number)
{
	struct db_endpoint_config found;

	return db_modbus_endpoint_find(modbus, number, &found) && found.name ? found.name : "";
}

/* The socket for tools on this machine, see control_socket.h. */
struct db_control_config {
	char *socket; /* path; default "/run/drivebridge/control"; DB_NO_SOCKET: there is none */
	/* read-group: may read, in addition to those who may act; default DB_EVERYBODY */
	char *read_group;
	/* act-group: may act, in addition to root and the service's own user; default
	 * "drivebridge" */
	char *act_group;
	bool audit_off;     /* audit = off, default on */
	unsigned audit_mib; /* audit-mib, 1..4096, default 32 */
	bool edit;          /* edit = off (default) or on: clients may change buses and drives */
	bool health_off;    /* health = off, default on */
};

#define DB_NO_SOCKET "off"
#define DB_EVERYBODY "everybody"

struct db_bus_config {
	char *name;
	const char *source_file;
	unsigned source_line;
	const struct db_driver *driver;       /* protocol = one of the driver list's names */
	const struct db_transport *transport; /* default: serial, or socketcan for CAN families */
	char *device;                         /* serial and slcan: path of the port; else null */
	char *interface;       /* socketcan: name of the network interface; else null */
	unsigned baud;         /* of the serial port; default: the family's, or 115200 for slcan */
	unsigned bitrate;      /* CAN: bit/s, 10000..1000000; default: the family's */
	enum db_parity parity; /* default none */
	unsigned stop_bits;    /* 1 (default) or 2 */
	/* turnaround-us, 0..100000: silence on a serial line between an answer and the next
	 * request; default 3.5 characters, and at least 1000. 0 on CAN. */
	unsigned turnaround_us;
	/* adapt = on (default) or off: turnaround_us and drive_latency_ms are start values for each
	 * drive, or fixed. */
	bool adapt;
	enum db_line line; /* line = rs485 (default) or rs232 */
	/* How an RS485 line is switched between sending and receiving: direction, default
	 * adapter. */
	enum db_direction direction;
	unsigned rts_before_ms; /* rts-before-ms, rts-after-ms, 0 (default)..100 */
	unsigned rts_after_ms;
	unsigned cycle_ms; /* 1..10000, default 20 or what one drive needs */
	/* drive-latency-ms, 1..1000, default 30: the longest time until a drive begins to answer */
	unsigned drive_latency_ms;
	/* retries, 0..10, default 2: repeats of a lost harmless exchange before the drive counts as
	 * offline */
	unsigned retries;
	unsigned queue; /* commands that may wait for the bus; from a file 32 */
	/* save-interval-s, 0..3600, default 10: shortest time between two save_parameters of a
	 * drive */
	unsigned save_interval_s;
	unsigned priority; /* priority, 0 (SCHED_OTHER) or 1..99 (SCHED_FIFO); default 1 */
	uint64_t cpus;     /* cpus, bit n: its thread may run on processor n; 0 (default) = any */
	bool starts_by_broadcast; /* group-start = one-by-one (default) or broadcast */
	bool polls_evenly;        /* poll = moving-first (default) or even */
	enum db_log_level log;    /* default info */
	void *options;            /* the family's own settings: see struct db_option */
};

struct db_drive_config {
	char *name;
	const char *source_file;
	unsigned source_line;
	size_t bus;             /* index into buses */
	unsigned address;       /* on the bus; range is the family's; 0 on RS232 */
	unsigned axis;          /* axis, of a controller with several: 0 = x, 1 = y ...; else 0 */
	char *endpoint_name;    /* endpoint: in whose units it is; null: in the first one's */
	uint32_t endpoint;      /* its number */
	unsigned unit;          /* Modbus unit 1..247 */
	double counts_per_unit; /* counts-per-unit, > 0, default 1.0 */
	/* set in the file; otherwise the drive's own value is used if known */
	bool counts_given;
	char *unit_name;                /* unit-name, default "counts" */
	bool unit_given;                /* set in the file */
	enum db_on_loss on_client_loss; /* default stop */
	enum db_on_loss on_exit;   /* also when a reload removes it; default: as on_client_loss */
	unsigned watchdog_ms;      /* 0 = off, default 3000 */
	unsigned stop_reaction_ms; /* stop-reaction-ms, 100..60000, default 1000 */
	enum db_on_stop_failure on_stop_failure; /* on-stop-failure, default none */
	enum db_watchdog_feed watchdog_feed;     /* watchdog-feed, default commanders */
	/* Limits in the user's units, NAN = none: min-position, max-position, max-velocity,
	 * max-acceleration. */
	double min_position;
	double max_position;
	double max_velocity;
	double max_acceleration;
	double in_position_window; /* in-position-window, user's units, >= 0, default 0 */
	unsigned settling_ms;      /* settling-ms, 0 (default)..10000 */
	/* VSMD families: the register map of the vendor's own Modbus models. */
	bool vendor_layout;   /* layout = neutral (default) or vsmd: that of `unit` */
	unsigned vendor_unit; /* vendor-unit, 1..247, 0 (default) = no second unit with that map */
	bool vendor_high_first; /* vendor-word-order = low-first (default) or high-first */
	void *options;          /* the family's own settings of a drive */
};

/* A bus or drive with a profile. */
struct db_profile_use {
	bool is_drive;
	size_t index;     /* index among the buses or drives */
	const char *path; /* of the profile */
	char *keys;       /* keys set by it, separated by commas */
};

struct db_config {
	struct db_source *sources; /* first the file given, then those of conf.d, then profiles */
	size_t source_count;
	struct db_modbus_config modbus;
	struct db_control_config control;
	struct db_bus_config *buses;
	size_t bus_count;
	struct db_drive_config *drives;
	size_t drive_count;
	struct db_profile_use *profile_uses; /* null where there is no profile, which is usual */
	size_t profile_use_count;
};

/*
 * Reads and checks a file, after it those of the folder conf.d next to it whose names end in
 * .conf, in the order of their names, and then the edited one, with the profiles that they name. On success 0, and *config
 * is to be freed. Otherwise -1 and every error was written to `errors`, a line each: "FILE:LINE:
 * what is wrong; what would be right". Warnings (a cycle that cannot fit, a confirm-ms that cannot
 * be met) go to `errors` too, as "FILE:LINE: warning: ...", and do not fail.
 */
int db_config_load(const char *path, FILE *errors, struct db_config **config);
void db_config_free(struct db_config *config);

/* Null if it has no profile. */
const struct db_profile_use *db_config_find_profile(const struct db_config *config, bool is_drive,
                                                    size_t index);

/* The result of reading a configuration. */
struct db_config_reading {
	struct db_config *config; /* null: there are errors */
	/* everything read as one text, for a file that db_config_load_copy() reads; null: none */
	char *copy;
	/* Paths of the profiles that the files name, each with its zero byte, an empty one last;
	 * also when there are errors. Null: none. */
	char *profiles;
	/* db_config_signature() before they were read; 0: they were being changed */
	uint64_t signature;
};

/* As db_config_load(), with all details; as if the edited file had the text `edited`, unless that is
 * null. Must be cleared in any case. */
int db_config_read(const char *path, const char *edited, FILE *errors,
                   struct db_config_reading *reading);
void db_config_reading_clear(struct db_config_reading *reading);

/*
 * The file that clients of the service write (src/bridge/service/edit.h): edited/edited.conf next to
 * `path`, which need not exist. It has only buses and drives, and names profiles of the folder
 * profiles alone: who writes it must not change who may. To be freed; null: no memory.
 */
char *db_config_edited_path(const char *path);

/* The configuration that was at `path` when the file `copy` was written. Messages name the original
 * files and their lines. Refuses a damaged copy, and one of another path. */
int db_config_load_copy(const char *copy, const char *path, FILE *errors,
                        struct db_config **config);

/* Changes when a file of the configuration at `path` is written, added, removed or readable by
 * others than before; opens none of them. `profiles`: those it names, as in a reading. Never 0. */
uint64_t db_config_signature(const char *path, const char *profiles);

/*
 * True if `next`, read from the same files later, looks like something that was cut off while being
 * written: it has no bus any more, no drive any more and does not end with `end`, or a file that
 * ended with `end` does not. Then *why is a message to be freed, or null when out of memory.
 */
bool db_config_is_cut(const struct db_config *running, const struct db_config *next, char **why);

/* `next` is equal and discarded: only which of its files end with `end` is kept. */
void db_config_keep_ends(struct db_config *running, const struct db_config *next);

/*
 * Whether two configurations are equal in the clients, the control socket, a bus or a drive: values
 * with their defaults, and names, but not places in the file. Buses are compared without their
 * drives, and a drive's bus by its name. Each drive's configuration is the one its section belongs
 * to.
 */
bool db_config_same_modbus(const struct db_config *a, const struct db_config *b);
bool db_config_same_control(const struct db_config *a, const struct db_config *b);
bool db_config_same_bus(const struct db_bus_config *a, const struct db_bus_config *b);
bool db_config_same_drive(const struct db_config *config_a, const struct db_drive_config *a,
                          const struct db_config *config_b, const struct db_drive_config *b);

/* True if both are equal in everything, parts in the same order. */
bool db_config_same(const struct db_config *a, const struct db_config *b);

/* The output of --check: every bus and drive with its settings and the computed times. */
void db_config_describe(const struct db_config *config, FILE *out);

/* The whole configuration as one file, with every key: reading it gives an equal configuration. */
void db_config_write(const struct db_config *config, FILE *out);

/*
 * Checks what this machine has of it now, without opening or disturbing anything: whether ports and
 * interfaces exist, are of the right kind, and may be opened (for root: by the service's user).
 * What exists is written to `out`, what is missing to `errors` as a warning with file and line.
 */
void db_config_probe(const struct db_config *config, FILE *out, FILE *errors);

#endif
