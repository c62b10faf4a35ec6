/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives as the address space shows them: their registers with types and names, and the known
 * values. Everything comes from the service; independent of families and of the OPC UA library.
 *
 * No I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_MODEL_H
#define DRIVEBRIDGE_OPCUA_MODEL_H

#include "drivebridge/time.h"
#include "opcua/names.h"
#include "opcua/types.h"

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

/* Where a register is shown; a group is read together. */
enum db_opcua_group {
	DB_OPCUA_PROCESS,    /* directly below the drive */
	DB_OPCUA_COMMAND,    /* the command block */
	DB_OPCUA_PARAMETERS, /* the vendor's */
	DB_OPCUA_SERVICE,    /* what the bridge knows of the drive */
	DB_OPCUA_BITS,       /* of status words, inputs and outputs */
	DB_OPCUA_HISTORY,
	/* what is wrong: not registers; the service reports it when it changes */
	DB_OPCUA_DIAGNOSIS,
	DB_OPCUA_GROUPS
};

/* The folder of a group in the address space, "" for process data. */
const char *db_opcua_group_folder(enum db_opcua_group group);

struct db_opcua_register {
	const char *name;
	char shown[DB_OPCUA_NAME_MAX];
	enum db_opcua_type type;
	enum db_opcua_group group;
	bool writable;
	bool own; /* the bridge knows it even while the drive is silent */
	bool has_range;
	double min;
	double max;
	const char *unit;
	json_t *codes; /* NULL: none */
	bool bits;     /* the codes are names of bits */
	const char *description;
	const struct db_opcua_type_row *data; /* its data type, if that is ours; else NULL */
	bool streamed;                        /* part of the service's stream */
};

/* What each method returns: texts. */
#define DB_OPCUA_OUTPUTS_COUNT 2
struct db_opcua_output {
	const char *name;
	const char *text;
};
extern const struct db_opcua_output db_opcua_outputs[DB_OPCUA_OUTPUTS_COUNT];

/* One field of all entries of the history, the newest first. */
#define DB_OPCUA_HISTORY_MAX 32
struct db_opcua_column {
	char shown[DB_OPCUA_NAME_MAX];
	struct db_opcua_register *first; /* its data type is that of all */
	size_t count;
	size_t places[DB_OPCUA_HISTORY_MAX]; /* indexes in the kind's list */
};

/* True if its range ends only where its type does. It bounds nothing then, and is not shown: a
 * client's deadband of one percent of it would hide all changes. */
bool db_opcua_register_is_open(const struct db_opcua_register *reg);

/* What drives with the same registers and commands share. */
struct db_opcua_kind {
	unsigned number; /* unique among the existing kinds */
	/* of the family, or of the gateway */
	const struct db_opcua_type_row *type;
	json_t *registers; /* from the service; other texts point into it */
	json_t *commands;
	struct db_opcua_register *list;
	size_t count;
	struct db_opcua_register **by_name; /* the same, sorted for searching */
	struct db_opcua_column *columns;
	size_t column_count;
	unsigned users;
	struct db_opcua_kind *next;
};

struct db_opcua_value {
	bool known;
	int64_t since_us; /* since when the drive's data has this value */
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
	unsigned watchers; /* number of monitored items */
};

struct db_opcua_drive {
	char name[64]; /* "": the gateway */
	char bus[64];
	struct db_opcua_kind *kind;
	struct db_opcua_item *items; /* kind->count of them */
	int64_t time_us;             /* of the drive's data; 0: never */
	unsigned quality;            /* 0 bad, 64 uncertain, 192 good */
	bool lost;                   /* the service is not connected */
	bool late;                   /* it has not answered for a while */
	db_time taken
		/* when its group was last read; 0: never, or it has to be read again */
		[DB_OPCUA_GROUPS];
	db_time streamed; /* when its last sample arrived */
	bool begun;       /* the stream has sent all watched values, and now sends changes */
	/* ... but some of them were not used, or are newer here: the stream has to start again */
	bool missed;
	int64_t outdated_us; /* values with an older time are from before a command */
	char result[32];     /* of the last command of this program */
	char reason[256];    /* why it was refused, "": it was not */
};

/* Removes what is not shown here, such as addresses of Modbus; and from the history's entries,
 * except the first one, what is equal to the first: the common part is given once. Without
 * `history` the entries are left out. */
void db_opcua_registers_shorten(json_t *registers, bool history);

/* Adds the diagnosis to the registers of a drive, or of the gateway. */
void db_opcua_registers_add_diagnosis(json_t *registers, bool gateway);

/* Finds or makes a kind of drives of this type. Keeps references to both objects. NULL without
 * memory, or when they do not have the expected form. */
struct db_opcua_kind *db_opcua_kind_take(struct db_opcua_kind **kinds,
                                         const struct db_opcua_type_row *type, json_t *registers,
                                         json_t *commands);
/* The register of this name, NULL when there is none. */
struct db_opcua_register *db_opcua_kind_find(const struct db_opcua_kind *kind, const char *name);
void db_opcua_kind_release(struct db_opcua_kind **kinds, struct db_opcua_kind *kind);

/* Takes the kind over. NULL without memory. */
struct db_opcua_drive *db_opcua_drive_new(const char *name, const char *bus,
                                          struct db_opcua_kind *kind);
void db_opcua_drive_free(struct db_opcua_kind **kinds, struct db_opcua_drive *drive);

/* Monitored items of the registers of `before` now count for those of the same names here. */
void db_opcua_drive_take_watchers(struct db_opcua_drive *drive,
                                  const struct db_opcua_drive *before);

/* The item of a register, NULL when there is none. */
struct db_opcua_item *db_opcua_drive_find(const struct db_opcua_drive *drive, const char *reg);

/* Values by register name, from data with the drive's time `time_us` (0: unchanged). */
void db_opcua_drive_take(struct db_opcua_drive *drive, json_t *values, int64_t time_us);

/* What is wrong with the drive, from the service's record, since `us` (microseconds since
 * 1970-01-01 UTC); ... */
void db_opcua_drive_diagnose(struct db_opcua_drive *drive, const json_t *record, int64_t us);
/* ... and for the gateway: what is wrong with the configuration, and whether all is well. */
void db_opcua_gateway_diagnose(struct db_opcua_drive *gateway, const json_t *configuration,
                               bool well, int64_t us);

/* The quality of a value. */
enum db_opcua_quality {
	DB_OPCUA_GOOD,
	DB_OPCUA_UNCERTAIN,   /* the last one received */
	DB_OPCUA_NO_CONTACT,  /* the drive or the service is silent */
	DB_OPCUA_NOTHING_YET, /* no value was ever received */
};

/* For the values of the drive, or of the buses for the gateway. */
enum db_opcua_quality db_opcua_drive_quality(const struct db_opcua_drive *drive);
enum db_opcua_quality db_opcua_item_quality(const struct db_opcua_item *item);

/* The names of a group, with those of its quality and time, or without those in the stream: a new
 * array; NULL without memory. */
json_t *db_opcua_group_names(const struct db_opcua_kind *kind, enum db_opcua_group group,
                             bool streamed);

#endif
