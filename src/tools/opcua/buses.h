/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the service reports of its buses, each fact by its name. Independent of the OPC UA library.
 *
 * No I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_BUSES_H
#define DRIVEBRIDGE_OPCUA_BUSES_H

#include "opcua/names.h"

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

struct db_opcua_fact {
	char name[DB_OPCUA_NAME_MAX];
	json_t *value; /* a boolean, a number or a text */
	int64_t time_us;
	struct db_opcua_fact *next;
};

struct db_opcua_bus {
	char name[64];
	struct db_opcua_fact *facts;
	struct db_opcua_bus *next;
};

/* Takes a list of buses (the interface's type Bus): buses that are not in it are removed, with all
 * their facts. */
void db_opcua_buses_describe(struct db_opcua_bus **buses, json_t *told, int64_t time_us);
/* ... and their measured figures, by their names. */
void db_opcua_buses_measure(struct db_opcua_bus *buses, json_t *told, int64_t time_us);
/* ... and what is wrong with them: the service's records by their names. */
void db_opcua_buses_diagnose(struct db_opcua_bus *buses, json_t *records, int64_t time_us);
void db_opcua_buses_free(struct db_opcua_bus **buses);

/* "line" is a bus, "line.Up" a fact of it; the text needs no terminating zero. False: there is none
 * of that name. */
bool db_opcua_buses_find(struct db_opcua_bus *buses, const char *text, size_t length,
                         struct db_opcua_bus **bus, struct db_opcua_fact **fact);

#endif
