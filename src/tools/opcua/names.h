/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Names in the address space. The service's registers and commands get names in OPC UA's style by
 * one rule: target_position is TargetPosition. Where OPC 40400-2 (Powertrain, functional model) has
 * a name for a value that every family has, a table has that name: position is PositionActualValue.
 * No conformance is claimed.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_OPCUA_NAMES_H
#define DRIVEBRIDGE_OPCUA_NAMES_H

#include <stdbool.h>

#define DB_OPCUA_NAME_MAX 64

/* Exceptions from the rule among the neutral registers: another name, or values that do not come
 * from the drive. */
struct db_opcua_name {
	const char *reg;
	const char *name; /* NULL: by the rule */
	bool own;         /* the bridge knows it even while the drive is silent */
};

/* The last row has no register. */
extern const struct db_opcua_name db_opcua_names[];

/* The name of a register or command that is no parameter of the vendor. Cut off if it is too
 * long. */
void db_opcua_name_of(const char *reg, char name[DB_OPCUA_NAME_MAX]);

/* True if the value comes from the bridge itself, so that it is good while the drive is silent. */
bool db_opcua_name_is_own(const char *reg);

#endif
