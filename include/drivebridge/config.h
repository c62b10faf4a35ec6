/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The configuration as the rest of the program sees it: plain structs with defaults filled in and
 * everything checked. Made by db_config_load() (src/config), read-only afterwards, owned by the
 * caller until db_config_free().
 */
#ifndef DRIVEBRIDGE_CONFIG_H
#define DRIVEBRIDGE_CONFIG_H

#include "drivebridge/log.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct db_driver;
struct db_source;
struct db_transport;

/* Settings that only some families have: declared by the driver (struct db_option), kept by their
 * place in its list. Numbers as they are, words by their place among the allowed ones, NAN when not
 * set and without a default. */
#define DB_OPTIONS_MAX 32

/* What is done beside saying it again to a drive that was told to stop and does not slow down. */
enum db_on_stop_failure {
	DB_ON_STOP_FAILURE_NONE,
	DB_ON_STOP_FAILURE_DISABLE, /* it is disabled: its motor then coasts, or its brake falls in */
};

enum db_on_loss { DB_ON_LOSS_NONE, DB_ON_LOSS_STOP, DB_ON_LOSS_QUICK_STOP, DB_ON_LOSS_DISABLE };
/* What tells that the clients of a drive are alive. Each is also told by those behind it. */
/* What feeds a watchdog; what is enough for one is enough for those before it. */
enum db_watchdog_feed {
	DB_FEED_REQUESTS,   /* any read of a client that may write, and what follows */
	DB_FEED_COMMANDERS, /* reads of who has commanded the drive, and what follows */
	DB_FEED_WRITES,     /* commands that are admitted, and other writes of who commands */
	DB_FEED_HEARTBEAT,
};
enum db_id_scope { DB_IDS_OF_DRIVE, DB_IDS_OF_CLIENT };
enum db_control_mode { DB_CONTROL_OFF, DB_CONTROL_DRIVE };
enum db_parity { DB_PARITY_NONE, DB_PARITY_EVEN, DB_PARITY_ODD };
enum db_line { DB_LINE_RS485, DB_LINE_RS232 };
enum db_direction { DB_DIRECTION_ADAPTER, DB_DIRECTION_RTS, DB_DIRECTION_RTS_INVERTED };

/* One entry of allow-read or allow-write: an IPv4 or IPv6 network. IPv4 is kept v4-mapped. */
struct db_network {
	uint8_t address[16];
	uint8_t prefix; /* 0..128, of the v4-mapped form */
};

struct db_modbus_config {
	char *listen; /* "ADDRESS:PORT", "[V6]:PORT"; default "127.0.0.1:502"; port 0 = any free one */
	struct db_network *allow_read; /* default: everyone who can connect to `listen` */
	size_t allow_read_count;
	struct db_network *allow_write; /* default: 127.0.0.0/8 and ::1 */
	size_t allow_write_count;
	bool low_word_first;    /* word-order = high-first (default) or low-first */
	unsigned confirm_ms;    /* confirm-ms, 1..10000, default 40 or what the buses need */
	bool accept_writes;     /* write-confirm = confirmed (default) or accepted */
	bool stale_values;      /* stale = exception (default) or value */
	unsigned gateway_unit;  /* gateway-unit, 1..254, 0 (default) = none beside 0 and 255 */
	unsigned max_clients;   /* max-clients, 1..1024, default 64 */
	unsigned max_pipelined; /* max-pipelined, 1..64 requests in flight per client, default 16 */
	unsigned
		frame_timeout_ms; /* frame-timeout-ms, 100..60000, default 1000: an unfinished frame ends its connection */
	unsigned idle_timeout_s; /* idle-timeout-s, 0 = never (default) */
	unsigned keepalive_s;    /* keepalive-s, 0 = off..7200, default 10: see listener.h */
	/* reserved-writers, default 4 or what max-clients leaves, below max-clients: connections
	 * that only clients who may write can take. */
	unsigned reserved_writers;
	unsigned max_clients_per_address;  /* 0 = no limit (default) */
	unsigned max_requests_per_second;  /* of one address, 0 = no limit (default) */
	enum db_id_scope command_id_scope; /* command-id-scope, default drive */
	enum db_control_mode control;      /* default off */
	unsigned control_timeout_ms;       /* control-timeout-ms, 100..600000, default 5000 */
	enum db_log_level log;             /* default info */
};

/* The socket for tools on this machine, see control_socket.h. */
struct db_control_config {
	char *socket; /* path; default "/run/drivebridge/control"; DB_NO_SOCKET: there is none */
	char *read_group; /* read-group: who may read beside who may act; default DB_EVERYBODY */
	char *act_group;  /* act-group: who may act beside root; default "drivebridge" */
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
	/* turnaround-us, 0..100000: silence on a serial line between an answer and the next request;
	 * default 3.5 characters, and at least 1000. 0 on CAN. */
	unsigned turnaround_us;
	enum db_line line; /* line = rs485 (default) or rs232 */
	/* What switches an RS485 line between sending and receiving: direction, default adapter. */
	enum db_direction direction;
	unsigned rts_before_ms; /* rts-before-ms, rts-after-ms, 0 (default)..100 */
	unsigned rts_after_ms;
	unsigned cycle_ms; /* 1..10000, default 20 or what one drive needs */
	unsigned
		drive_latency_ms; /* drive-latency-ms, 1..1000, default 30: the longest time a drive may think before it answers */
	unsigned
		retries; /* retries, 0..10, default 2: repeats of a lost harmless exchange before the drive counts as offline */
	unsigned queue;  /* queue, 1..256, default 32: commands that may wait */
	unsigned
		save_interval_s; /* save-interval-s, 0..3600, default 10: shortest time between two save_parameters of a drive */
	unsigned priority; /* priority, 0 (SCHED_OTHER) or 1..99 (SCHED_FIFO); default 1 */
	uint64_t cpus;     /* cpus, bit n: its thread may run on processor n; 0 (default) = any */
	bool starts_by_broadcast;       /* group-start = one-by-one (default) or broadcast */
	enum db_log_level log;          /* default info */
	double options[DB_OPTIONS_MAX]; /* of the driver's list; those of drives are left NAN */
};

struct db_drive_config {
	char *name;
	const char *source_file;
	unsigned source_line;
	size_t bus;             /* index into buses */
	unsigned address;       /* on the bus; range is the family's; 0 on RS232 */
	unsigned axis;          /* axis, of a controller with several: 0 = x, 1 = y ...; else 0 */
	unsigned unit;          /* Modbus unit 1..247 */
	double counts_per_unit; /* counts-per-unit, > 0, default 1.0 */
	bool counts_given;      /* it is in the file; else what the drive knows goes first */
	char *unit_name;        /* unit-name, default "counts" */
	bool unit_given;        /* it is in the file */
	enum db_on_loss on_client_loss; /* default stop */
	enum db_on_loss on_exit;   /* also when a reload takes it out; default: as on_client_loss */
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
	double *options;        /* as many as the driver's list has; those of buses are left NAN */
};

struct db_config {
	struct db_source *sources; /* first the file that was named, then those of conf.d */
	size_t source_count;
	struct db_modbus_config modbus;
	struct db_control_config control;
	struct db_bus_config *buses;
	size_t bus_count;
	struct db_drive_config *drives;
	size_t drive_count;
};

/*
 * Reads and checks a file, and behind it those of the folder conf.d beside it whose names end in .conf,
 * in the order of their names. On success 0, and *config is to be freed. Otherwise -1 and every error
 * was written to `errors`, a line each: "FILE:LINE: what is wrong; what would be right". Warnings
 * (a cycle that cannot fit, a confirm-ms that cannot be met) go to `errors` too, as
 * "FILE:LINE: warning: ...", and do not fail.
 */
int db_config_load(const char *path, FILE *errors, struct db_config **config);
void db_config_free(struct db_config *config);

/*
 * As db_config_load(); *copy is all that was read as one text, for a file that db_config_load_copy() reads. To be freed;
 * null when there is no memory for it. `copy` may be null.
 */
int db_config_load_with_copy(const char *path, FILE *errors, struct db_config **config,
                             char **copy);

/* The configuration that was at `path` when the file `copy` was written. What is said of it names the files that it was
 * made of, and their lines. Refuses a damaged copy, and one of another path. */
int db_config_load_copy(const char *copy, const char *path, FILE *errors,
                        struct db_config **config);

/* Another number when a file of the configuration at `path` was written, or came, went or may be read by others than
 * before; it opens none of them. */
uint64_t db_config_signature(const char *path);

/*
 * Whether `next`, read from the same files later, looks like something that was cut off on its way to the
 * disk: it has no bus any more, no drive any more and does not end with `end`, or a file that ended with
 * `end` does not. Then *why is a message to be freed, or null when out of memory.
 */
bool db_config_is_cut(const struct db_config *running, const struct db_config *next, char **why);

/* `next` says the same and is forgotten: but which of its files end with `end` is kept. */
void db_config_keep_ends(struct db_config *running, const struct db_config *next);

/*
 * Whether two configurations say the same about the clients, the control socket, a bus or a drive: values with their
 * defaults, and names, but not where in the file. Buses are compared without their drives, and a
 * drive's bus by its name. Each drive's configuration is the one its section belongs to.
 */
bool db_config_same_modbus(const struct db_config *a, const struct db_config *b);
bool db_config_same_control(const struct db_config *a, const struct db_config *b);
bool db_config_same_bus(const struct db_bus_config *a, const struct db_bus_config *b);
bool db_config_same_drive(const struct db_config *config_a, const struct db_drive_config *a,
                          const struct db_config *config_b, const struct db_drive_config *b);

/* Whether both say the same in everything, parts in the same order. */
bool db_config_same(const struct db_config *a, const struct db_config *b);

/* What --check prints: every bus and drive with its settings and the computed times. */
void db_config_describe(const struct db_config *config, FILE *out);

/* All of it as one file, with every key: read again, it says the same. */
void db_config_write(const struct db_config *config, FILE *out);

/*
 * What this machine has of it now, without opening or disturbing anything: whether ports and interfaces
 * are there, are what they should be, and may be opened (for root: by the service's user). What is there
 * goes to `out`, what is missing to `errors` as a warning with file and line.
 */
void db_config_probe(const struct db_config *config, FILE *out, FILE *errors);

#endif
