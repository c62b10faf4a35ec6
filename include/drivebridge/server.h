/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The Modbus TCP server: sockets, framing and the form of requests. Its backend (the register map)
 * knows what the requests mean. Everything here runs on the network thread.
 */
#ifndef DRIVEBRIDGE_SERVER_H
#define DRIVEBRIDGE_SERVER_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"
#include "drivebridge/log.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

struct sd_event;
struct db_server;

enum db_table { DB_TABLE_COILS, DB_TABLE_DISCRETE, DB_TABLE_HOLDING, DB_TABLE_INPUT };

/* Refusals because of a client's rights. Each kind is counted, and logged once. */
enum db_refusal {
	DB_REFUSED_ADDRESS,     /* connection: in neither allow-read nor allow-write */
	DB_REFUSED_FULL,        /* connection: max-clients reached */
	DB_REFUSED_RESERVED,    /* connection: may only read, and the rest is for writers */
	DB_REFUSED_PER_ADDRESS, /* connection: max-clients-per-address reached */
	DB_REFUSED_WRITE,       /* write: its address may only read */
	DB_REFUSED_USER,        /* write: its user, of this machine, may only read */
	DB_REFUSED_USER_READ,   /* connection: its user, of this machine, may not even read */
	DB_REFUSED_CONTROL,     /* write: another client has control of the drive */
	DB_REFUSED_PACE,        /* request: more than max-requests-per-second, answered later */
	DB_REFUSED_DESCRIPTORS, /* connection: the descriptors left are for buses and files */
	DB_REFUSED_INSECURE,    /* connection or write: it has no certificate (require-secure) */
	DB_REFUSED_NO_ROLE,     /* request: its certificate has no role of the configuration */
	DB_REFUSED_ROLE,        /* request: its role does not allow that */
	DB_REFUSED_LINE,        /* write: its serial line has allow = read */
	DB_REFUSED_BROADCAST,   /* request to all units of a serial line: it is no stop */
	DB_REFUSAL_COUNT
};

#define DB_WRITE_LATER (-1)

/* Answers are Modbus exception codes; 0 is success. Addresses are 0-based. */
struct db_backend {
	/*
	 * Units are those of the client's endpoint, here and below. Whether this one exists: 0, or exception 0A. Called before all checks but that of a
	 * request's form.
	 */
	uint8_t (*unit)(void *context, const struct db_client *client, uint8_t unit);

	/* Whether the client's role allows it anything with this unit, which exists: 0, or exception
	 * 01. Only called for clients that have one. */
	uint8_t (*role)(void *context, const struct db_client *client, uint8_t unit);

	/* Registers (HOLDING, INPUT): count values in host order. Bits (COILS, DISCRETE): count
	 * values of 0 or 1. All of one call must come from one snapshot. */
	uint8_t (*read)(void *context, const struct db_client *client, uint8_t unit,
	                enum db_table table, uint16_t address, uint16_t count, uint16_t *values);

	/*
	 * HOLDING or COILS, values as above. Called once per request with the whole write. Returns
	 * 0 or an exception to be answered at once, or DB_WRITE_LATER: then db_server_answer() must
	 * be called exactly once with this token (never from inside this call). Only called for
	 * clients that may write.
	 */
	int (*write)(void *context, const struct db_client *client, uint8_t unit,
	             enum db_table table, uint16_t address, uint16_t count, const uint16_t *values,
	             struct db_write_token token);

	/* Like write, for FC 22 that leaves a holding register unchanged: it changes nothing, so it
	 * repeats no command either, except a stop. */
	int (*write_same)(void *context, const struct db_client *client, uint8_t unit,
	                  uint16_t address, uint16_t value, struct db_write_token token);

	/* True if this write of holding registers is a stop of the unit's drive. */
	bool (*stops)(void *context, const struct db_client *client, uint8_t unit, uint16_t address,
	              uint16_t count, const uint16_t *values);

	/*
	 * A write of holding registers to all of these units (a bit each), as if to each drive's
	 * neutral registers; nobody is answered. A stop is carried out for every drive that the
	 * client may command. False: it is no stop, and nothing was done.
	 */
	bool (*broadcast)(void *context, const struct db_client *client, const uint8_t units[32],
	                  uint16_t address, uint16_t count, const uint16_t *values);

	/* FC 17: server id text and run indicator of a unit. Returns the text's length (<=
	 * size). */
	size_t (*server_id)(void *context, const struct db_client *client, uint8_t unit, char *text,
	                    size_t size, bool *running);

	/* FC 43/14 objects 0..6 (vendor name, product code, revision, vendor URL, product name,
	 * model name, user application name): static text, or null when the unit has no such
	 * object. */
	const char *(*device_id)(void *context, const struct db_client *client, uint8_t unit,
	                         uint8_t object);

	/* A client connected (connected = true) or disconnected. For logs and counters. May be
	 * null. */
	void (*client)(void *context, const struct db_client *client, bool connected);

	/* A client that may only read has tried to write. May be null. */
	void (*denied)(void *context, const struct db_client *client, uint8_t unit,
	               uint16_t address);

	/* A client that could write no longer may. May be null. */
	void (*restricted)(void *context, const struct db_client *client);

	/* The role of a client that may write allows more or less than before. May be null. */
	void (*reassigned)(void *context, const struct db_client *client);
};

/* Exception codes are 01 to 0B. */
#define DB_EXCEPTION_CODES 12

/* Since the server began; counters go on from 0 when they are full. */
struct db_server_stats {
	uint32_t clients; /* now */
	uint32_t clients_peak;
	uint32_t accepted;
	uint32_t refused_full;     /* connections refused: max-clients reached, or no descriptors */
	uint32_t refused_address;  /* connections refused: not in allow-read or allow-write */
	uint32_t refused_writes;   /* writes refused: client may only read */
	uint32_t refused_reserved; /* connections refused: may only read, the rest is reserved */
	uint32_t refused_per_address; /* connections refused: too many of one address */
	uint32_t refused_control;     /* writes refused: another client has control of the drive */
	uint32_t held_back;           /* requests that had to wait: too many of one address */
	uint32_t requests;
	uint32_t exceptions;
	uint32_t exceptions_by_code[DB_EXCEPTION_CODES];
	uint32_t bad_frames; /* connections closed for a frame that cannot be Modbus */
	uint32_t timeouts;   /* connections closed for an unfinished frame, or idle */
};

/* One connection, or serial line with a PLC, as it is now. */
struct db_server_client {
	struct db_client client;
	uint64_t requests;
	db_time idle;      /* since the last byte in either direction */
	db_time connected; /* since it connected */
};

/*
 * Listens on all endpoints and serves on the loop's thread. The backend must outlive the server, as must the log of
 * the source, which is copied; so must the configuration, or the time until another one takes its
 * place. 0, or a negative errno (EADDRINUSE, EACCES, EINVAL for an address that cannot be read
 * ...); *where is then the address, or null when it was something else.
 */
int db_server_new(struct sd_event *loop, const struct db_modbus_config *config,
                  const struct db_backend *backend, void *context, const struct db_log_source *log,
                  struct db_server **result, const char **where);

/* Closes every connection; pending tokens become void. */
void db_server_free(struct db_server *server);

/*
 * Other settings, in two steps. Preparing does all that can fail, such as listening on another
 * address in addition to the old one; it changes nothing that a client could notice. 0 or a
 * negative errno, and *where as above. Then db_server_apply() lets them take effect, or db_server_change_free() forgets
 * them; no event is to be served in between. Connections stay, except those of clients that may not
 * connect any more. The former configuration is not used afterwards.
 */
struct db_server_change;

int db_server_prepare(struct db_server *server, const struct db_modbus_config *config,
                      struct db_server_change **change, const char **where);
void db_server_apply(struct db_server *server, struct db_server_change *change);
void db_server_change_free(struct db_server_change *change);

/* Serves every client once whose requests wait, as the loop does: called late before acting on
 * silence. Not from inside the backend's calls. */
void db_server_catch_up(struct db_server *server);

/* Answers a write that the backend postponed. exception 0 = success. */
void db_server_answer(struct db_server *server, struct db_write_token token, uint8_t exception);

/*
 * From now on, also for those that are connected, clients on this machine have at most the rights
 * that their user has at the control socket. Null, the default: the address alone decides. The
 * rights are copied.
 */
struct db_rights;
void db_server_set_rights(struct db_server *server, const struct db_rights *rights);

/* The name and the role of the certificate with this address, "" where there is none or they are
 * not known any more. False: it is no certificate's. The server may be null. */
bool db_server_certificate(const struct db_server *server, const uint8_t address[16],
                           const char **name, const char **role);

/* How drivebridge-tls is, which hands clients with certificates over; with several of them, on several
 * endpoints, the first dates and the sums. False: none is connected. */
struct db_secure_status;
bool db_server_secure_status(const struct db_server *server, struct db_secure_status *status);

/* Refuses connections that would leave the process fewer than `count` file descriptors: other uses,
 * such as a bus that opens its port again, always find them. 0, the default, keeps none. */
void db_server_keep_descriptors(struct db_server *server, unsigned count);

/* True if the endpoint with this number, which is there, listens on an address that the machine did
 * not have at the beginning. */
bool db_server_is_early(const struct db_server *server, uint32_t endpoint);

/* The port it listens on (for port 0 in the configuration). */
uint16_t db_server_port(const struct db_server *server, uint32_t endpoint);

void db_server_stats(const struct db_server *server, struct db_server_stats *stats);

/* A serial line of the configuration, and what came over it since the service began to use it. Counters
 * go on from 0 when they are full. */
struct db_server_line {
	const char *name; /* these two until the next change of the configuration */
	const char *device;
	bool up;           /* its port is open */
	int error;         /* why not, as an errno */
	uint32_t requests; /* for units of this gateway, and broadcasts */
	uint32_t answers;  /* sent */
	uint32_t repeated; /* requests that repeated one in progress, and were not executed again */
	uint32_t late;     /* answers not sent: the PLC did not wait any longer */
	uint32_t missed;   /* requests not executed: another one came before they were taken */
	uint32_t foreign;  /* frames for, or from, other devices */
	uint32_t bad;      /* bytes that were no frames, such as those with a wrong CRC */
	uint32_t overruns; /* more bytes without a silence than frames have */
	uint32_t echoes;   /* frames received that were sent */
};

/* The line at this index of the configuration; false: there are no more. */
bool db_server_read_line(const struct db_server *server, size_t index, struct db_server_line *line);

/* The lines, then the connections that have been there longest, at most `max`. Returns how many. */
size_t db_server_clients(const struct db_server *server, struct db_server_client *clients,
                         size_t max);

/* The backend refused a client something because of its rights (DB_REFUSED_CONTROL). */
void db_server_refused(struct db_server *server, const struct db_client *client,
                       enum db_refusal kind);

#endif
