/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drives and buses that the address space shows, and which of their nodes an id is: "feeder.Parameters.spd",
 * "/Gateway.DriveCount", "/Buses.line.Up". Nothing of OPC UA's library is known here.
 *
 * No I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_ROSTER_H
#define DRIVEBRIDGE_OPCUA_ROSTER_H

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
	const char *name; /* that its ids begin with */
	bool gateway;
	struct db_opcua_tree *tree; /* that of its kind, which others have as well */
	char location[160];
	struct UA_MonitoredItem *listeners; /* to its events; the library's */
};

/* Empty when all is 0. */
struct db_opcua_roster {
	struct db_opcua_shown **drives; /* by their names */
	size_t count;
	struct db_opcua_bus *buses;
};

enum db_opcua_subject_type {
	DB_OPCUA_ALL_DRIVES,
	DB_OPCUA_ALL_BUSES,
	DB_OPCUA_OF_DRIVE, /* `shown` and `branch` */
	DB_OPCUA_BUS,      /* `bus` */
	DB_OPCUA_FACT,     /* `bus` and `fact` */
};

/* What a node is about. What is not said above is NULL. */
struct db_opcua_subject {
	enum db_opcua_subject_type type;
	struct db_opcua_shown *shown;
	const struct db_opcua_branch *branch;
	const struct db_opcua_bus *bus;
	const struct db_opcua_fact *fact;
};

/* The drive, which must outlive its place here; `description` of the interface's type Drive. NULL without memory. */
struct db_opcua_shown *db_opcua_roster_add(struct db_opcua_roster *roster,
                                           const struct db_opcua_config *config,
                                           struct db_opcua_drive *drive, const json_t *description);
void db_opcua_roster_remove(struct db_opcua_roster *roster, struct db_opcua_shown *shown);
void db_opcua_roster_clear(struct db_opcua_roster *roster);

/* By the name that its ids begin with, which need not be ended by a zero byte; NULL. */
struct db_opcua_shown *db_opcua_roster_find(const struct db_opcua_roster *roster, const char *name,
                                            size_t length);

/* What node an id is of. False: there is none of that id. */
bool db_opcua_roster_identify(const struct db_opcua_roster *roster, const char *id, size_t length,
                              struct db_opcua_subject *subject);

#endif
