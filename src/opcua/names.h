/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Names in the address space. The service's registers and commands get names as OPC UA has them by one rule:
 * target_position is TargetPosition. Where OPC 40400-2 (Powertrain, functional model) has a name for what every
 * family of drives has, a table has that: position is PositionActualValue. No conformance is claimed by it.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_OPCUA_NAMES_H
#define DRIVEBRIDGE_OPCUA_NAMES_H

#include <stdbool.h>

#define DB_OPCUA_NAME_MAX 64

/* A name of the neutral registers that the rule would make otherwise, or whose values do not come from the drive. */
struct db_opcua_name {
	const char *reg;
	const char *name; /* NULL: by the rule */
	bool own;         /* the bridge knows it also while the drive is silent */
};

/* The last row has no register. */
extern const struct db_opcua_name db_opcua_names[];

/* What a register or command that is none of the vendor's parameters is called. Cut where it is too long. */
void db_opcua_name_of(const char *reg, char name[DB_OPCUA_NAME_MAX]);

/* Whether the bridge itself tells its value, so that it is good while the drive is silent. */
bool db_opcua_name_is_own(const char *reg);

#endif
