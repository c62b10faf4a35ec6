/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives and buses that the address space shows, and the meaning of a node's id:
 * "feeder.Parameters.spd", "/Gateway.DriveCount", "/Buses.line.Up". Independent of the OPC UA
 * library.
 *
 * No I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_ROSTER_H
#define DRIVEBRIDGE_OPCUA_ROSTER_H

#include "opcua/alarms.h"
#include "opcua/buses.h"
#include "opcua/config.h"
#include "opcua/model.h"
#include "opcua/tree.h"

/* Names of drives have no slash. */
#define DB_OPCUA_DRIVES "/Drives"
#define DB_OPCUA_BUSES "/Buses"
#define DB_OPCUA_GATEWAY "/Gateway"

struct UA_MonitoredItem;

/* A drive, or the gateway. */
struct db_opcua_shown {
	struct db_opcua_drive *drive;
	const char *name; /* the beginning of its ids */
	bool gateway;
	struct db_opcua_tree *tree; /* the tree of its kind, shared with other drives */
	char location[160];
	struct UA_MonitoredItem *listeners; /* subscriptions to its events; the library's */
};

/* Empty when all is 0. */
struct db_opcua_roster {
	uint16_t space;                 /* the namespace of this gateway's nodes */
	uint16_t types;                 /* ... and of the types, which every gateway has */
	uint16_t devices;               /* ... and of OPC UA for Devices */
	struct db_opcua_shown **drives; /* sorted by their names */
	size_t count;
	struct db_opcua_bus *buses;
	struct db_opcua_alarms alarms;
	/* The library's indexes of these types of references; 0: it has none. */
	uint8_t has_condition;
	uint8_t has_interface;
};

enum db_opcua_subject_type {
	DB_OPCUA_ALL_DRIVES,
	DB_OPCUA_ALL_BUSES,
	DB_OPCUA_ALL_ALARMS,
	DB_OPCUA_OF_DRIVE,  /* `shown` and `branch` */
	DB_OPCUA_BUS,       /* `bus` */
	DB_OPCUA_FACT,      /* `bus` and `fact` */
	DB_OPCUA_OF_TYPES,  /* `row` */
	DB_OPCUA_CONDITION, /* `alarm`, and `member` if it is not DB_OPCUA_MEMBERS */
};

/* What a node stands for. Fields not mentioned above are NULL. */
struct db_opcua_subject {
	enum db_opcua_subject_type type;
	struct db_opcua_shown *shown;
	const struct db_opcua_branch *branch;
	const struct db_opcua_bus *bus;
	const struct db_opcua_fact *fact;
	const struct db_opcua_type_row *row;
	const struct db_opcua_alarm *alarm;
	enum db_opcua_member member;
};

/* The drive must outlive its entry here; `description` of the interface's type Drive. NULL without
 * memory. */
struct db_opcua_shown *db_opcua_roster_add(struct db_opcua_roster *roster,
                                           const struct db_opcua_config *config,
                                           struct db_opcua_drive *drive, const json_t *description);
void db_opcua_roster_remove(struct db_opcua_roster *roster, struct db_opcua_shown *shown);
void db_opcua_roster_clear(struct db_opcua_roster *roster);

/* By the name at the beginning of its ids, which needs no terminating zero; NULL: none. */
struct db_opcua_shown *db_opcua_roster_find(const struct db_opcua_roster *roster, const char *name,
                                            size_t length);

/* Finds what an id of this gateway's namespace stands for. False: no node has that id. */
bool db_opcua_roster_identify(const struct db_opcua_roster *roster, const char *id, size_t length,
                              struct db_opcua_subject *subject);

#endif
