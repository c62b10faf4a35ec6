/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the service for each other, and what all of them know. Network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_SERVICE_PRIVATE_H
#define DRIVEBRIDGE_SERVICE_SERVICE_PRIVATE_H

#include "drivebridge/control_socket.h"
#include "drivebridge/log.h"
#include "drivebridge/registers.h"
#include "drivebridge/scan.h"
#include "drivebridge/server.h"
#include "drivebridge/time.h"
#include "drivebridge/trace_keeper.h"
#include "service/plant.h"

#include <stdbool.h>
#include <stdio.h>
#include <sys/types.h>
#include <systemd/sd-event.h>

struct configuration;
struct edit;
struct must_stand;
struct positions;
struct reload;
struct service;
struct status;
struct writing;

/* --- state.c ---------------------------------------------------------------------------------- */

/*
 * The contents of the service, used by all of its parts.
 */

struct service {
	struct db_log_source log; /* the network side's */
	const char *path;         /* the configuration's */
	sd_event *loop;
	sd_event_source *term;
	sd_event_source *deadline; /* timer for the clients' first deadline */
	db_time armed;
	sd_event_source *pulse; /* feeds systemd's watchdog; null: there is none */
	db_time watchdog;       /* systemd's time-out */
	struct plant *plant;
	uint16_t last_number;
	struct db_registers *registers;
	struct db_server *server;
	struct db_control_socket *control;
	struct reload *reload; /* in progress; null */
	bool reload_again;     /* another one was requested meanwhile */
	char *reload_errors;   /* errors of the current one, one line each; null: none so far */
	struct db_trace_keeper *traces;
	sd_event_source *keeping;            /* timer for the next trace to be kept */
	uint32_t last_bus;                   /* last number used */
	struct configuration *configuration; /* compared with its files */
	struct edit *edit;                   /* in progress; null */
	struct must_stand *must_stand;       /* drives that must stand, across a restart */
	struct positions *positions;         /* named ones */
	struct writing *writing;             /* of them, in progress; null */
	struct db_audit *audit;
	struct db_health *health;
	sd_event_source *health_timer;
	db_time alarms_from;   /* before, drives may not have been asked yet */
	bool log_in_use;       /* by a thread that a disk holds up */
	struct status *status; /* the line shown by systemd; null: not used */
	int lock;              /* of the configuration, see alone_take(); -1: none */
};

/* The loop's time: when this turn of it began. */
db_time service_now(const struct service *service);

/* The log source of the network side for a bus. */
struct db_log_source service_log_of(const struct service *service,
                                    const struct db_bus_config *bus_config);

/* The path of a file or folder of this name in systemd's StateDirectory, to be freed; null: systemd
 * gives none. 0 or -ENOMEM, with null. */
int service_state_path(const char *name, char **path);

/* See struct db_registers_ops and struct db_control_socket_ops. */
void service_read_server_stats(void *context, struct db_server_stats *stats);

/* Logs the addresses on which clients can connect, as far as they are others than before; `before`:
 * null at the start. */
void service_log_listening(const struct service *service, const struct db_modbus_config *before,
                           const struct db_modbus_config *modbus);

/* Clients of the Modbus port leave descriptors for the buses of the plant and for reloads, and
 * users of this machine have the rights there that the plant's configuration gives them. */
void service_limit_clients(struct service *service);

/* --- loop.c ----------------------------------------------------------------------------------- */

/*
 * The network thread's loop: signals, buses' completions, the clients' first deadline, and
 * systemd's watchdog.
 */

/* Watches the plant's buses; the registers are set later, but before it runs. 0 or a negative
 * errno. */
int loop_new(struct service *service);

/* Does nothing where systemd does not require it. 0 or a negative errno. A hung bus thread is as
 * bad as a hung network thread: both must run for the watchdog to be fed. */
int loop_feed_watchdog(struct service *service);

/* True if every bus's thread has run within half of systemd's time-out; a bus whose thread has not
 * is logged. */
bool loop_buses_are_alive(struct service *service, db_time now);

void loop_free(struct service *service);

/* --- registers.c ------------------------------------------------------------------------------ */

/*
 * What the registers need from the service: the time, the buses, the server and the log. Their
 * context is the struct service.
 */

extern const struct db_registers_ops service_registers_ops;

/* Watches a new bus for completions. 0 or a negative errno. */
int service_watch_bus(struct service *service, struct plant_bus *bus);

/* Fetches the bus's completions. */
void service_collect(struct plant_bus *bus);

/* --- reload.c --------------------------------------------------------------------------------- */

/*
 * A reload: from the running plant to that of the new file, while equal parts continue to run.
 *
 * First everything that will be needed is made; if anything fails, nothing has changed. Then the
 * obsolete parts are retired: buses end, and drives are removed from theirs according to on-exit.
 * That takes some time, in which the network thread continues its work. When all of it has ended,
 * so that its ports and addresses are free, the new plant takes its place.
 */

/* Tells of a bus, or of a drive (else null), what a reload does to it; not of those that go on. */
typedef void reload_tell_fn(void *context, const struct db_bus_config *bus,
                            const struct plant_drive *drive, const char *text);

/*
 * Tells what a reload with this configuration, which it takes over, would do. *next, which is to be
 * freed by plant_free() with the running plant, has what was told of. 0 or a negative errno.
 */
int reload_foresee(struct service *service, struct db_config *config, struct plant **next,
                   reload_tell_fn *tell, void *context);

/* Of a struct service: begins a reload, which may be over when this returns. False: one is in
 * progress, and another one follows it. */
bool reload_ask(void *context);

/* Continues the current reload as far as possible. Called in every turn of the loop. */
void reload_step(struct service *service);

/* The service ends, and its buses have ended: frees what the current reload has prepared. */
void reload_abandon(struct service *service);

/* --- must_stand.c ----------------------------------------------------------------------------- */

/*
 * Which drives must stand, across restarts of the service and reloads: this applies to the drive at
 * the same place on the wire, whatever its name. A held motion has no holder in another run: its
 * drive must stand there. Stored in a small file next to the control socket, in memory that a
 * reboot clears; without a socket it is lost at a restart.
 */

/* Reads the file, and stops its drives as soon as their buses are there. 0 or a negative errno; a
 * file that cannot be read is logged. */
int must_stand_begin(struct service *service);
/* Checks the drives of the plant now, and repeatedly while one of them must stand. Called before
 * and after the plant changes. */
void must_stand_look(struct service *service);
/* A stop was submitted to a bus, or a request has ended there. */
void must_stand_look_soon(struct service *service);
/* The buses have ended: writes the file for drives that still must stand. */
void must_stand_end(struct service *service);

/* --- positions.c ------------------------------------------------------------------------------ */

/*
 * The named positions of the drives, in a file of systemd's StateDirectory, which is replaced as a
 * whole shortly after each change; without that folder in memory only.
 */

/* Reads the file. 0 or a negative errno; a file that cannot be understood is logged and kept under
 * another name. */
int positions_begin(struct service *service);

/* See struct db_control_socket_ops. */

/* Null before the beginning. */
struct db_positions *positions_list(void *context);
/* Has them written soon. */
void positions_changed(void *context);
/* Why they cannot be written; "": they can, or there is no folder for them. */
const char *positions_trouble(void *context);

/* Writes what is still to be written. The disk's thread has ended. */
void positions_end(struct service *service);

/* --- traces.c --------------------------------------------------------------------------------- */

/* Traces of buses: those kept because of trouble, and all for clients that ask.  */

/* 0 or a negative errno. */
int traces_begin(struct service *service);
void traces_end(struct service *service);

/* The bus has sent a notification. */
void traces_look(struct plant_bus *bus);
/* The watchdog stops a drive of it. */
void traces_note_tripped(struct service *service, const struct db_bus_config *bus_config,
                         const struct db_drive_config *drive);
/* The bus is about to be freed. */
void traces_leave(struct plant_bus *bus);

/* --- scans.c ---------------------------------------------------------------------------------- */

/* Scans of the plant's buses by their names, for the control socket: its ops. */

int scans_begin(void *context, const char *bus, const struct db_scan_plan *plan, uint32_t *number);
bool scans_read(void *context, const char *bus, uint32_t number, struct db_scan_progress *progress);
const struct db_scan_find *scans_find(void *context, const char *bus, size_t index);
const struct db_scan_foreign *scans_foreign(void *context, const char *bus, size_t index);
void scans_cancel(void *context, const char *bus, uint32_t number);

/* --- audit.c ---------------------------------------------------------------------------------- */

/*
 * The audit trail: in systemd's StateDirectory, with what the histories of the drives need after a
 * restart; without that folder only in the journal.
 */

struct db_audit_entry;

/* Fills the histories from what was recorded last. 0 or a negative errno. */
int audit_begin(struct service *service);
/* Writes what is still to be written. */
void audit_end(struct service *service);

/* See struct db_registers_ops. */
uint32_t audit_post(void *context, const struct db_client *client,
                    const struct db_audit_entry *entry);
void audit_post_end(void *context, uint32_t record, const char *drive, enum db_result result,
                    db_time took);

/* --- health.c --------------------------------------------------------------------------------- */

/*
 * How the drives are, and the alarms: looked at several times in a second, and kept in systemd's
 * StateDirectory; without that folder only in memory.
 */

/* 0 or a negative errno. */
int health_begin(struct service *service);
/* The plant is another one. */
void health_set_drives(struct service *service);
/* Writes what is still to be written. */
void health_end(struct service *service);

/* --- alone.c ---------------------------------------------------------------------------------- */

/*
 * Only one process may run a configuration: two would be two masters on each of its buses. Serial
 * ports are locked one by one, CAN interfaces cannot be.
 */

/*
 * Locks the configuration at this path for this process, as long as the returned descriptor stays
 * open. -EBUSY when another process of this user or of root has it, *holder then is its id, or 0
 * when not known; or another negative errno.
 */
int alone_take(const char *path, pid_t *holder);

#endif
