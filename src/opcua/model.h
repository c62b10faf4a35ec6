/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives as the address space shows them: their registers with types and names, and the values that are known.
 * Everything comes from the service; nothing of a family is known here, nor anything of OPC UA's library.
 *
 * No I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_MODEL_H
#define DRIVEBRIDGE_OPCUA_MODEL_H

#include "drivebridge/time.h"
#include "opcua/names.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum db_opcua_type {
	DB_OPCUA_BOOL,
	DB_OPCUA_U16,
	DB_OPCUA_I16,
	DB_OPCUA_U32,
	DB_OPCUA_I32,
	DB_OPCUA_U64,
	DB_OPCUA_F32,
	DB_OPCUA_TEXT,
};

/* Where a register is shown, and what is read together. */
enum db_opcua_group {
	DB_OPCUA_PROCESS,    /* at the drive itself */
	DB_OPCUA_COMMAND,    /* the command block */
	DB_OPCUA_PARAMETERS, /* the vendor's */
	DB_OPCUA_SERVICE,    /* what the bridge knows of it */
	DB_OPCUA_BITS,       /* of status words, inputs and outputs */
	DB_OPCUA_HISTORY,
	DB_OPCUA_GROUPS
};

/* The folder of a group in the address space, "" for that of process data. */
const char *db_opcua_group_folder(enum db_opcua_group group);

struct db_opcua_register {
	const char *name;
	char shown[DB_OPCUA_NAME_MAX];
	enum db_opcua_type type;
	enum db_opcua_group group;
	bool writable;
	bool own; /* the bridge knows it also while the drive is silent */
	bool has_range;
	double min;
	double max;
	const char *unit;
	json_t *codes; /* NULL: none */
	bool bits;     /* the codes name bits */
	const char *description;
	bool streamed; /* the service tells it unasked */
};

/* One field of all entries of the history, the newest first. */
#define DB_OPCUA_HISTORY_MAX 32
struct db_opcua_column {
	char shown[DB_OPCUA_NAME_MAX];
	const struct db_opcua_register *first;
	size_t count;
	size_t places[DB_OPCUA_HISTORY_MAX]; /* in the kind's list */
};

/* Whether its range is all that its type can hold, which needs not be said. */
bool db_opcua_register_is_full(const struct db_opcua_register *reg);

/* What drives with the same registers and commands have in common. */
struct db_opcua_kind {
	unsigned number;   /* no other kind that is there has it */
	json_t *registers; /* as the service told them; texts are in there */
	json_t *commands;
	struct db_opcua_register *list;
	size_t count;
	struct db_opcua_register **by_name; /* as many, for finding one */
	struct db_opcua_column *columns;
	size_t column_count;
	unsigned users;
	struct db_opcua_kind *next;
};

struct db_opcua_value {
	bool known;
	int64_t since_us; /* the drive's data had it then first */
	union {
		bool flag;
		uint64_t number;
		int64_t whole;
		float real;
		char *text; /* owned */
	};
};

struct db_opcua_drive;

/* One register of one drive. */
struct db_opcua_item {
	struct db_opcua_drive *drive;
	struct db_opcua_register *reg;
	struct db_opcua_value value;
	unsigned watchers; /* monitored items */
};

struct db_opcua_drive {
	char name[64]; /* "" is the gateway */
	char bus[64];
	struct db_opcua_kind *kind;
	struct db_opcua_item *items; /* as many as kind->count */
	int64_t time_us;             /* of the drive's data; 0: never */
	unsigned quality;            /* 0 bad, 64 uncertain, 192 good */
	bool lost;                   /* there is no service */
	bool late;                   /* it has not answered for a while */
	db_time taken
		[DB_OPCUA_GROUPS]; /* when its group was read last; 0: never, or it must be again */
	db_time streamed;          /* when its last sample came */
	bool begun; /* the stream has told all that is watched of it, and now tells what changes */
	bool missed; /* ... but something of that was not taken, or is newer here: it is to begin anew */
	int64_t outdated_us; /* what was told before is older than a command */
	char result[32];     /* of the last command from here */
	char reason[256];    /* why it was refused, "" */
};

/* Leaves of the history's entries but the first what differs from that, in place: the rest is said once. Without `history`
 * they are left out. */
void db_opcua_registers_shorten(json_t *registers, bool history);

/* Finds or makes a kind. Keeps references to both. NULL without memory, or when they are not what they should be. */
struct db_opcua_kind *db_opcua_kind_take(struct db_opcua_kind **kinds, json_t *registers,
                                         json_t *commands);
/* The register of this name, NULL when there is none. */
struct db_opcua_register *db_opcua_kind_find(const struct db_opcua_kind *kind, const char *name);
void db_opcua_kind_release(struct db_opcua_kind **kinds, struct db_opcua_kind *kind);

/* Takes the kind over. NULL without memory. */
struct db_opcua_drive *db_opcua_drive_new(const char *name, const char *bus,
                                          struct db_opcua_kind *kind);
void db_opcua_drive_free(struct db_opcua_kind **kinds, struct db_opcua_drive *drive);

/* Who watches the registers of `before` watches those of the same names here. */
void db_opcua_drive_take_watchers(struct db_opcua_drive *drive,
                                  const struct db_opcua_drive *before);

/* The item of a register, NULL when there is none. */
struct db_opcua_item *db_opcua_drive_find(const struct db_opcua_drive *drive, const char *reg);

/* Values by register name, of data that the drive told at `time_us` (0: as before). */
void db_opcua_drive_take(struct db_opcua_drive *drive, json_t *values, int64_t time_us);

/* How good a value is. */
enum db_opcua_quality {
	DB_OPCUA_GOOD,
	DB_OPCUA_UNCERTAIN,   /* the last one that came */
	DB_OPCUA_NO_CONTACT,  /* the drive or the service is silent */
	DB_OPCUA_NOTHING_YET, /* it never came */
};

/* Of what the service told of the drive, or of the buses if that is the gateway. */
enum db_opcua_quality db_opcua_drive_quality(const struct db_opcua_drive *drive);
enum db_opcua_quality db_opcua_item_quality(const struct db_opcua_item *item);

/* The names of a group, those of its quality and time with them, or without those that the stream tells: a new array; NULL
 * without memory. */
json_t *db_opcua_group_names(const struct db_opcua_kind *kind, enum db_opcua_group group,
                             bool streamed);

#endif
