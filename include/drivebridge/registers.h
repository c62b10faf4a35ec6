/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The register view: what Modbus clients read and what their writes mean. It is the server's
 * backend and owns the commander of each drive. Network thread only; allocates only in
 * db_registers_new() and db_registers_prepare(), and where a client first asks by name
 * (src/bridge/regmap/named.h).
 */
#ifndef DRIVEBRIDGE_REGISTERS_H
#define DRIVEBRIDGE_REGISTERS_H

#include "drivebridge/axis.h"
#include "drivebridge/bus.h"
#include "drivebridge/command.h"
#include "drivebridge/commander.h"
#include "drivebridge/config.h"
#include "drivebridge/configuration.h"
#include "drivebridge/server.h"

struct db_audit_entry;
struct db_registers;

/* What the registers show, in the order of the configuration. Contains parts of several
 * configurations when some of them were not changed by a reload. */
struct db_roster {
	const struct db_modbus_config *modbus;
	const struct db_roster_bus *buses;
	size_t bus_count;
	const struct db_roster_drive *drives;
	size_t drive_count;
};

struct db_roster_bus {
	const struct db_bus_config *config;
	struct db_bus *bus; /* for the ops only */
};

struct db_roster_drive {
	uint16_t drive; /* see struct db_bus_drive; unique, also among removed drives */
	size_t bus;     /* index in the roster's buses */
	const struct db_drive_config *config;
	struct db_axis *axis;
};

struct db_registers_ops {
	db_time (*now)(void *context);
	uint64_t (*wall_us)(void *context); /* since 1970-01-01 UTC */
	/* Hands a request to a bus, and frees its place when it has ended; see struct
	 * db_commander_ops. */
	struct db_request *(*submit)(void *context, struct db_bus *bus,
	                             const struct db_request *request);
	void (*release)(void *context, struct db_request *request);
	/* Requests submitted from true to false are handed to the bus together. May be null. */
	void (*gather)(void *context, struct db_bus *bus, bool gathers);
	/* Answers a postponed write of a Modbus client, see db_server_answer(), or of a session. */
	void (*answer)(void *context, struct db_write_token token, uint8_t exception);
	void (*answer_session)(void *context, struct db_write_token token, enum db_result result);
	void (*bus_stats)(void *context, struct db_bus *bus, struct db_bus_stats *stats);
	void (*server_stats)(void *context, struct db_server_stats *stats);
	/* The clients connected longest, at most `max`; returns their number. Null: clients are not
	 * shown. */
	size_t (*server_clients)(void *context, struct db_server_client *clients, size_t max);
	/* The running configuration compared with the files. Null: the files are in force. */
	struct db_configuration_report (*configuration)(void *context);
	/* The names for an address. Null: db_client_address(). */
	void (*client_words)(void *context, const uint8_t address[16],
	                     struct db_client_words *words);
	/* A client was refused something because of its rights. May be null. */
	void (*refused)(void *context, const struct db_client *client, enum db_refusal kind);
	/* A write to a drive did not achieve what its writer wanted; see struct db_commander_ops.
	 * `client`: null for the bridge's own. May be null. */
	void (*write_refused)(void *context, const struct db_bus_config *bus,
	                      const struct db_drive_config *drive, const struct db_client *client,
	                      const struct db_refused_write *write);
	/* Posts a record of the audit trail: who it was, and when, is added. `client`: null for the
	 * bridge's own. Returns its number, see db_audit_post(). May be null, with the next one. */
	uint32_t (*audit)(void *context, const struct db_client *client,
	                  const struct db_audit_entry *entry);
	void (*audit_end)(void *context, uint32_t record, const char *drive, enum db_result result,
	                  db_time took);
	/* A client connected or disconnected. May be null. */
	void (*client)(void *context, const struct db_client *client, bool connected);
	/* The watchdog stops a drive. `last` fed it last, and may have disconnected since;
	 * DB_CLIENT_NOBODY: none. May be null. */
	void (*tripped)(void *context, const struct db_bus_config *bus,
	                const struct db_drive_config *drive, const struct db_client *last);
	/* A drive is stopped because the holder of its motion is missed; see struct
	 * db_commander_ops. May be null. */
	void (*hold_lost)(void *context, const struct db_bus_config *bus,
	                  const struct db_drive_config *drive, const struct db_client *holder,
	                  bool gone);
};

/* Everything the roster refers to must outlive its time in the registers; the roster itself need
 * not. 0 or -ENOMEM. */
int db_registers_new(const struct db_roster *roster, const struct db_registers_ops *ops,
                     void *context, struct db_registers **registers);
void db_registers_free(struct db_registers *registers);

/*
 * Replaces the roster, in three steps between events of the loop. Preparing allocates all memory
 * needed; 0 or -ENOMEM. Retiring removes the drives that will not be there from their units at
 * once, which then answer 0A; in the gateway's registers they keep their places and are offline;
 * completions of their buses are still taken. The change then replaces the old roster: drives that
 * were there before keep their state; writers that still wait for a removed one are answered as
 * cancelled. Instead, db_registers_change_free() discards what was prepared.
 */
struct db_registers_change;

int db_registers_prepare(struct db_registers *registers, const struct db_roster *roster,
                         struct db_registers_change **change);
void db_registers_retire(struct db_registers *registers, const struct db_registers_change *change);
void db_registers_apply(struct db_registers *registers, struct db_registers_change *change);
void db_registers_change_free(struct db_registers_change *change);

/* For db_server_new(); its context is the struct db_registers. */
extern const struct db_backend db_registers_backend;

/* A bus ended a request, which is released when its result is recorded. */
void db_registers_complete(struct db_registers *registers, struct db_request *request, db_time now);
/* See db_commander_owed_stop(), for the drive of this number. */
enum db_command db_registers_owed_stop(const struct db_registers *registers, uint16_t number);
/* Puts an entry of an earlier run into a drive's history, before those to come, if the drive of this
 * name is still the one at this place of this bus. */
struct db_recalled {
	const char *drive;
	/* Which drive had this name then: */
	const char *bus;
	uint16_t node; /* its address */
	uint16_t axis;
	struct db_history_entry entry;
	struct db_args args; /* of a command */
	const char *param;   /* the parameter that was written; null: a command */
	double value;        /* its new value */
};
void db_registers_recall(struct db_registers *registers, const struct db_recalled *recalled);
/* No client can hold a motion any more: held motions are stopped. */
void db_registers_end_holds(struct db_registers *registers, db_time now);
/* The drive of this number must stand, for a cause of the bridge's own. */
void db_registers_stand(struct db_registers *registers, uint16_t number, enum db_command stop,
                        enum db_stand_cause cause, db_time now);

/* When db_registers_expire() is due: the time of the first waiting writer is up, or a watchdog's.
 * DB_TIME_NEVER. A caller that is late first serves the requests that wait on the clients' sockets:
 * a request that arrived long after this time then counts for all drives that its client had kept
 * going. */
db_time db_registers_next_deadline(struct db_registers *registers);
void db_registers_expire(struct db_registers *registers, db_time now);

#endif
