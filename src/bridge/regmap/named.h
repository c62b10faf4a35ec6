/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The register view by the names of its registers, for clients that do not use addresses: the same
 * table, rights, watchdogs and commanders as for Modbus units, but every drive in the neutral
 * layout. Network thread only. The names of a family take memory when the first client asks for
 * them.
 */
#ifndef DRIVEBRIDGE_REGMAP_NAMED_H
#define DRIVEBRIDGE_REGMAP_NAMED_H

#include "drivebridge/command_table.h"
#include "drivebridge/registers.h"
#include "regmap/name_list.h"
#include "regmap/regmap_private.h"

/* Used instead of a drive's number. */
#define DB_NAMED_GATEWAY UINT16_MAX

/* A drive as shown now; valid until the next event of the loop. */
struct db_named_drive {
	uint16_t number;
	const struct db_drive_config *config;
	const struct db_bus_config *bus;
	uint64_t commands; /* supported commands, as DB_COMMAND_BIT()s */
	const char *unit;  /* unit of its positions for people; "": counts only */
	bool controlled;   /* clients take control of it before they command it */
};

/* Buses and drives in the order of the configuration. False: there are fewer, or it is being
 * removed. */
const struct db_bus_config *db_named_bus(const struct db_registers *registers, size_t place);
size_t db_named_drive_count(const struct db_registers *registers);
bool db_named_drive_at(const struct db_registers *registers, size_t place,
                       struct db_named_drive *drive);
bool db_named_drive_find(const struct db_registers *registers, const char *name,
                         struct db_named_drive *drive);
/* Incremented whenever the drives change: earlier results are then invalid. */
uint32_t db_named_generation(const struct db_registers *registers);

/* The registers of a drive, or of the gateway except those that repeat the drives' own, by table
 * and address; null: there is no such drive, or no memory. Valid as long as the generation. */
const struct db_name_list *db_named_registers(struct db_registers *registers, uint16_t number);

/* The registers of the gateway that repeat the process data of the drives, in their order; as
 * above. */
const struct db_name_list *db_named_windows(struct db_registers *registers);

const struct db_modbus_config *db_named_modbus(const struct db_registers *registers);

enum db_named_kind {
	/* of a drive that does not answer, or a parameter that it has not reported */
	DB_NAMED_UNKNOWN,
	DB_NAMED_MISSING, /* a parameter that it was asked for and did not report */
	DB_NAMED_WHOLE,
	DB_NAMED_REAL,
	DB_NAMED_TEXT,
	DB_NAMED_FLAG,
};

struct db_named_value {
	enum db_named_kind kind;
	int64_t whole; /* FLAG: 0 or 1 */
	float real;
	char text[2 * DB_CELL_REGISTERS_MAX + 1];
	/* for a known parameter: when the drive reported it, by the monotonic clock; else 0 */
	db_time told;
};

typedef void db_named_visit_fn(void *context, const char *name, const struct db_entry *entry,
                               const struct db_named_value *value);

/* When a drive's data were taken: 0, never; and how often. */
struct db_named_moment {
	db_time taken;
	uint64_t wall_us; /* the same since 1970-01-01 UTC */
	uint32_t samples;
};

/* The values of registers of one drive, all from one snapshot, and its moment (null: not wanted);
 * counts as a read of this client. False: there is no such drive. */
bool db_named_read(struct db_registers *registers, const struct db_client *client, uint16_t number,
                   const struct db_entry *const *entries, size_t count,
                   struct db_named_moment *moment, db_named_visit_fn *visit, void *context);

/* For a drive by its number: the moment of its data, the period of its bus, its name. 0 and "" when
 * it is not there. */
struct db_named_moment db_named_moment(const struct db_registers *registers, uint16_t number);
bool db_named_online(const struct db_registers *registers, uint16_t number);
db_time db_named_cycle(const struct db_registers *registers, uint16_t number);
const char *db_named_name(const struct db_registers *registers, uint16_t number);

/* Its trouble: the registers trouble and error, of one moment, and since when by the clock of the
 * registers. False: there is no such drive. */
bool db_named_trouble(const struct db_registers *registers, uint16_t number,
                      struct db_trouble *trouble, uint16_t *error);

/* Where a drive stands, and from what that is counted; all of one moment. */
struct db_named_place {
	bool online;
	bool identified; /* its identity and parameters are valid */
	bool stands;
	bool homed;
	bool homed_here; /* and homing was the last command that may have changed the origin */
	bool lost;       /* its origin, or it may have been */
	int32_t position;
	double counts_per_unit; /* 0: not known yet */
	const char *unit;       /* "": counts only */
	char identity[DB_IDENTITY_MAX + 1];
	/* Changes with everything that may have changed the origin, as far as it is known. */
	uint32_t commands;
	uint32_t restarts;
	uint32_t doubts;
};
/* False: there is no such drive. */
bool db_named_place(const struct db_registers *registers, uint16_t number,
                    struct db_named_place *place);

/* False: the drive moves, or is to move. */
bool db_named_stands(const struct db_registers *registers, uint16_t number);

/* When the latest stop of the drive arrived; 0: none yet, or there is no such drive. */
db_time db_named_stopped(const struct db_registers *registers, uint16_t number);

/* As in the registers' ops; the bus must exist. */
void db_named_bus_stats(const struct db_registers *registers, size_t place,
                        struct db_bus_stats *stats);

/* The values of the gateway's registers for one bus (bus#_, line#_), also for buses that have none
 * there. False: there is no such bus. */
bool db_named_read_bus(const struct db_registers *registers, size_t place, db_named_visit_fn *visit,
                       void *context);

/* Maximum number of words of a register that can be written. */
#define DB_NAMED_WORDS 4

/* The words of a register for db_named_write(). False: this number is no value of its type. */
bool db_named_encode(const struct db_registers *registers, const struct db_entry *entry,
                     double number, uint16_t words[DB_NAMED_WORDS]);

/* True if the register holds (a part of) this argument of a command. The second function stores a
 * number that is one of its values in the command's arguments. */
bool db_named_is_argument(const struct db_entry *entry, enum db_arg arg);
void db_named_store_argument(const struct db_entry *entry, double number, struct db_args *args);

#define DB_NAMED_UNIT_MAX 64

/* The unit of the values in a register of a drive or the gateway; for user units the name that the
 * drive's configuration gives them; "": none. */
void db_named_unit(const struct db_registers *registers, uint16_t number,
                   const struct db_entry *entry, char unit[DB_NAMED_UNIT_MAX]);

/* The limits of the configuration for the register of a drive, in addition to those of its row or
 * parameter: of target_velocity and velocity, of position if there is one to either side. False: it
 * has none. */
bool db_named_limit(const struct db_registers *registers, uint16_t number,
                    const struct db_entry *entry, double *min, double *max);

/* A write as db_backend.write. */
int db_named_write(struct db_registers *registers, const struct db_client *client, uint16_t number,
                   enum db_table table, uint16_t address, uint16_t count, const uint16_t *values,
                   struct db_write_token token);

/* The result of the latest write of this client, where that was answered with an exception at
 * once. */
enum db_result db_named_write_result(struct db_registers *registers, const struct db_client *client,
                                     uint16_t number, uint8_t exception);

/* True if writing this to a register of a drive executes a command with the kept arguments; a stop
 * has none. */
bool db_named_commands(uint16_t number, const struct db_entry *entry, double value);
/* True if writing this to a register of a drive, or of the gateway, starts a motion or keeps a held
 * one going, with the kept arguments and whatever else is written. */
bool db_named_moves(uint16_t number, const struct db_entry *entry, double value);

/* Commands run from true to false reach each bus together; see db_group_gather(). */
void db_named_gather(struct db_registers *registers, bool gathers);

/* A command without an id, which leaves the kept command block unchanged. A motion is held for
 * hold_ms, see struct db_request. *entry: its number in the history. */
struct db_write_answer db_named_run(struct db_registers *registers, const struct db_client *client,
                                    uint16_t number, enum db_command command,
                                    const struct db_args *args, uint32_t hold_ms,
                                    struct db_write_token token, uint32_t *entry);

/* The client gives a sign of life for the motion that it holds. False: it holds none of this
 * drive. */
bool db_named_beat(struct db_registers *registers, const struct db_client *client, uint16_t number);
/* The client sends nothing any more: all motions that it holds are stopped. */
void db_named_desert(struct db_registers *registers, const struct db_client *client);

/* The result of the command and of the motion that it began: PENDING while that continues. */
enum db_result db_named_outcome(const struct db_registers *registers, uint16_t number,
                                uint32_t entry);

/* True if a command of this client would not be refused because another one has control; takes
 * control as the command would. */
bool db_named_may_command(struct db_registers *registers, const struct db_client *client,
                          uint16_t number);

/* A client is alive and waits for its own motion: counts as a read. */
void db_named_hear(struct db_registers *registers, const struct db_client *client, uint16_t number);

#endif
