/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The control socket: tools of this machine use it with names, over a Unix socket in varlink's wire
 * format (docs/io.drivebridge.Control.varlink). Their requests go through the register view like a
 * PLC's, with the same rules. Everything here runs on the network thread, one call in a turn of its
 * loop.
 */
#ifndef DRIVEBRIDGE_CONTROL_SOCKET_H
#define DRIVEBRIDGE_CONTROL_SOCKET_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"
#include "drivebridge/configuration.h"
#include "drivebridge/log.h"

#include <stdbool.h>

struct db_audit;
struct db_audit_entry;
struct db_control_socket;
struct db_edit_answer;
struct db_edit_request;
struct db_health;
struct db_positions;
struct db_registers;
struct db_scan_find;
struct db_scan_foreign;
struct db_scan_plan;
struct db_scan_progress;
struct db_secure_status;
struct db_server_line;
struct db_server_stats;
struct db_trace;
struct db_trace_keeper;
struct sd_event;

struct db_control_socket_ops {
	/* Requests a reload, whose end is db_control_socket_reloaded(), perhaps at once. False: one
	 * is in progress already, and another one follows it. */
	bool (*reload)(void *context);
	/* The running configuration compared with the files. */
	struct db_configuration_report (*configuration)(void *context);
	/* Begins it: db_control_socket_edited() gets the answer. 0, -EBUSY, -EPERM (it is not allowed
	 * to change anything) or another negative errno. May be null: there is no editing. */
	int (*edit)(void *context, const struct db_edit_request *request);
	void (*server_stats)(void *context, struct db_server_stats *stats);
	/* As db_server_secure_status(). May be null: there is no secure socket. */
	bool (*secure_status)(void *context, struct db_secure_status *status);
	/* As db_server_read_line(). May be null: there are no lines. */
	bool (*line)(void *context, size_t index, struct db_server_line *line);
	/* As those for a bus in scan.h, with the bus's name; -ENODEV: there is no such bus. */
	int (*scan)(void *context, const char *bus, const struct db_scan_plan *plan,
	            uint32_t *number);
	bool (*scan_read)(void *context, const char *bus, uint32_t number,
	                  struct db_scan_progress *progress);
	const struct db_scan_find *(*scan_find)(void *context, const char *bus, size_t index);
	const struct db_scan_foreign *(*scan_foreign)(void *context, const char *bus, size_t index);
	void (*scan_cancel)(void *context, const char *bus, uint32_t number);
	/* The trace of a bus, null when there is none of that name, and a number that no other bus
	 * ever has. */
	const struct db_trace *(*trace)(void *context, const char *bus, uint32_t *number);
	/* As in struct db_registers_ops. */
	uint32_t (*audit_post)(void *context, const struct db_client *client,
	                       const struct db_audit_entry *entry);
	/* The named positions; null: there are none (yet). */
	struct db_positions *(*positions)(void *context);
	/* They were changed, and are to be written to the disk soon. */
	void (*positions_changed)(void *context);
	/* Why they cannot be written; "": they can. Valid until the next event. */
	const char *(*positions_trouble)(void *context);
};

/* Maximum number of sessions, more than drivebridge-mqtt, -opcua and -webd use together, so that
 * there is one left for a person's stop; the reserved ones are only for clients that may act. */
#define DB_SESSIONS_MAX 64
#define DB_SESSIONS_RESERVED 8
/* And so many of a user who may only read: none leaves others without. */
#define DB_SESSIONS_OF_READER 8

/* When all these are taken, this number of further sessions is accepted for stops only. One that sends
 * nothing for 0.1 s is closed; the more there are, the shorter a stop waits behind silent ones. */
#define DB_SESSIONS_FOR_STOPS 8

/* Sessions accepted in one turn may replace others, which are still to be freed. */
#define DB_SESSIONS_ACCEPTED_AT_ONCE 4
#define DB_SESSIONS_MOST (DB_SESSIONS_MAX + DB_SESSIONS_FOR_STOPS + DB_SESSIONS_ACCEPTED_AT_ONCE)

/* Maximum number of descriptors in use. */
#define DB_CONTROL_SOCKET_DESCRIPTORS (DB_SESSIONS_MOST + 5)

struct db_control_socket_setup {
	struct sd_event *loop;
	const struct db_control_config *config;
	const char *configuration; /* path of the file, for clients that ask */
	struct db_registers *registers;
	const struct db_trace_keeper *traces;
	/* The audit trail, and values of the drives with alarms; either is null before its
	 * beginning. */
	struct db_audit *const *audit;
	struct db_health *const *health;
	struct db_log_source log;
	const struct db_control_socket_ops *ops;
	void *context;
};

/*
 * Listens if possible: if not, that is logged and there is no socket, because PLCs come first.
 * Everything the setup refers to must outlive it. 0 or a negative errno.
 */
int db_control_socket_new(const struct db_control_socket_setup *setup,
                          struct db_control_socket **control);
/* Ends every session and removes the socket. Null is fine. */
void db_control_socket_free(struct db_control_socket *control);

/* Another configuration is in force; the former is not used afterwards. Sessions stay if they still
 * may. */
void db_control_socket_change(struct db_control_socket *control,
                              const struct db_control_config *config,
                              const struct db_log_source *log);

/* Answers a postponed write or command of a session. */
void db_control_socket_answer(struct db_control_socket *control, struct db_write_token token,
                              enum db_result result);

/* The names of any client; for a session those that belong to its address. A user whose name was
 * forgotten because there were too many others is "?". The socket may be null. */
void db_control_socket_words(const struct db_control_socket *control, const uint8_t address[16],
                             struct db_client_words *words);

/* What is known of a session for the audit trail; null: nothing. Valid until the next event. */
struct db_control_socket_names {
	const char *login; /* user of its process */
	const char *user;  /* for whom it says it acts */
	const char *from;  /* and from where */
};
void db_control_socket_names(const struct db_control_socket *control,
                             const struct db_client *client, struct db_control_socket_names *names);

/* The address of a session of an earlier run, with the names that it had. */
void db_control_socket_recall(struct db_control_socket *control, uint32_t user, const char *login,
                              const char *named, uint8_t address[16]);

/* A reload has ended: its errors, one line each; "" or null: it is in force. */
void db_control_socket_reloaded(struct db_control_socket *control, const char *errors);

/* The answer to the latest op `edit`; whoever asked may be gone. */
void db_control_socket_edited(struct db_control_socket *control,
                              const struct db_edit_answer *answer);

/* Serves requests that wait on the sockets, as the loop does: called late before acting on
 * silence. */
void db_control_socket_catch_up(struct db_control_socket *control);

#endif
