/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The register view by the names of its registers, for clients that know no addresses: the same table,
 * rights, watchdogs and commanders as behind Modbus units, but every drive in the neutral layout. Network
 * thread only. The names of a family take memory when the first client asks for them.
 */
#ifndef DRIVEBRIDGE_REGMAP_NAMED_H
#define DRIVEBRIDGE_REGMAP_NAMED_H

#include "drivebridge/command_table.h"
#include "drivebridge/registers.h"
#include "regmap/name_list.h"
#include "regmap/words.h"

/* In the place of a drive's number. */
#define DB_NAMED_GATEWAY UINT16_MAX

/* A drive as it is shown now; valid until the next event of the loop. */
struct db_named_drive {
	uint16_t number;
	const struct db_drive_config *config;
	const struct db_bus_config *bus;
	uint64_t commands; /* that it has, as DB_COMMAND_BIT()s */
	const char *unit;  /* of its positions for people; "": counts only */
};

/* Buses and drives in the order of the configuration. False: there are not so many, or it is leaving. */
const struct db_bus_config *db_named_bus(const struct db_registers *registers, size_t place);
size_t db_named_drive_count(const struct db_registers *registers);
bool db_named_drive_at(const struct db_registers *registers, size_t place,
                       struct db_named_drive *drive);
bool db_named_drive_find(const struct db_registers *registers, const char *name,
                         struct db_named_drive *drive);
/* Grows whenever there are other drives: what was found before is to be found again. */
uint32_t db_named_generation(const struct db_registers *registers);

/* The registers of a drive, or of the gateway but for those that repeat what the drives' own tell, by
 * table and address; null: there is no such drive, or no memory. Live as long as the generation. */
const struct db_name_list *db_named_registers(struct db_registers *registers, uint16_t number);

enum db_named_kind {
	DB_NAMED_UNKNOWN, /* of a drive that does not answer, or a parameter that it has not told */
	DB_NAMED_MISSING, /* a parameter that it was asked for and did not tell */
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
};

typedef void db_named_visit_fn(void *context, const char *name, const struct db_entry *entry,
                               const struct db_named_value *value);

/* When a drive's data were taken: 0, never. And how often that was. */
struct db_named_moment {
	db_time taken;
	uint64_t wall_us; /* the same since 1970-01-01 UTC */
	uint32_t samples;
};

/* The values of registers of one drive, all from one snapshot, and its moment (null: not asked for); a request of this
 * client as any read. False: there is no such drive. */
bool db_named_read(struct db_registers *registers, const struct db_client *client, uint16_t number,
                   const struct db_entry *const *entries, size_t count,
                   struct db_named_moment *moment, db_named_visit_fn *visit, void *context);

/* Of a drive by its number: the moment of its data, the period of its bus, its name. 0 and "" when it is not there. */
struct db_named_moment db_named_moment(const struct db_registers *registers, uint16_t number);
bool db_named_online(const struct db_registers *registers, uint16_t number);
db_time db_named_cycle(const struct db_registers *registers, uint16_t number);
const char *db_named_name(const struct db_registers *registers, uint16_t number);

/* What is wrong with it: the registers trouble and error, of one moment, and since when by the clock of the registers.
 * False: there is no such drive. */
bool db_named_trouble(const struct db_registers *registers, uint16_t number,
                      struct db_trouble *trouble, uint16_t *error);

/* As the registers' ops have them; the bus is there. */
void db_named_bus_stats(const struct db_registers *registers, size_t place,
                        struct db_bus_stats *stats);

/* What the gateway's registers tell of one bus (bus#_, line#_), also of those that have none there. False:
 * there is no such bus. */
bool db_named_read_bus(const struct db_registers *registers, size_t place, db_named_visit_fn *visit,
                       void *context);

/* The most that a register that can be written has. */
#define DB_NAMED_WORDS 4

/* The words of a register for db_named_write(). False: no value of its type is this number. */
bool db_named_encode(const struct db_registers *registers, const struct db_entry *entry,
                     double number, uint16_t words[DB_NAMED_WORDS]);

/* Whether the register holds (a part of) this argument of a command; and puts a number that is one of its values
 * where the command takes it from. */
bool db_named_is_argument(const struct db_entry *entry, enum db_arg arg);
void db_named_store_argument(const struct db_entry *entry, double number, struct db_args *args);

#define DB_NAMED_UNIT_MAX 64

/* The unit of the values in a register of a drive or the gateway, of user units by the name that the drive's
 * configuration gives them; "": they have none. */
void db_named_unit(const struct db_registers *registers, uint16_t number,
                   const struct db_entry *entry, char unit[DB_NAMED_UNIT_MAX]);

/* What the configuration allows in the register of a drive, besides what its row or parameter says. False: this
 * is not limited there. */
bool db_named_limit(const struct db_registers *registers, uint16_t number,
                    const struct db_entry *entry, double *min, double *max);

/* A write as db_backend.write. */
int db_named_write(struct db_registers *registers, const struct db_client *client, uint16_t number,
                   enum db_table table, uint16_t address, uint16_t count, const uint16_t *values,
                   struct db_write_token token);

/* How the latest write of this client ended, where that was answered with an exception at once. */
enum db_result db_named_write_result(struct db_registers *registers, const struct db_client *client,
                                     uint16_t number, uint8_t exception);

/* Whether writing this to a register of a drive executes a command with the kept arguments; a stop has none. */
bool db_named_commands(uint16_t number, const struct db_entry *entry, double value);
/* Whether writing this to a register of a drive, or of the gateway, sets drives in motion or keeps a held motion going,
 * with the kept arguments and whatever else is written. */
bool db_named_moves(uint16_t number, const struct db_entry *entry, double value);

/* Commands run from true to false reach each bus all at once; see db_group_gather(). */
void db_named_gather(struct db_registers *registers, bool gathers);

/* A command without an id, which leaves the kept command block alone. A motion is held for hold_ms, as
 * db_commander_execute_held() has it. *entry: its number in the history. */
struct db_write_answer db_named_run(struct db_registers *registers, const struct db_client *client,
                                    uint16_t number, enum db_command command,
                                    const struct db_args *args, uint32_t hold_ms,
                                    struct db_write_token token, uint32_t *entry);

/* The client gives a sign of life for the motion that it holds. False: it holds none of this drive. */
bool db_named_beat(struct db_registers *registers, const struct db_client *client, uint16_t number);
/* It sends nothing any more: all that it holds is stopped. */
void db_named_desert(struct db_registers *registers, const struct db_client *client);

/* What became of it and of the motion that it began: PENDING while that goes on. */
enum db_result db_named_outcome(const struct db_registers *registers, uint16_t number,
                                uint32_t entry);

/* Whether a command of this client would be taken, and not be refused because another one has control; takes control
 * as that would. */
bool db_named_may_command(struct db_registers *registers, const struct db_client *client,
                          uint16_t number);

/* A client is there and waits for its own motion: as a read of its. */
void db_named_hear(struct db_registers *registers, const struct db_client *client, uint16_t number);

#endif
