/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What stands below a drive in the address space. It is the same for all drives of a kind, so it is kept once for them; a
 * node's id is the drive's name, a dot and the path. Nothing of OPC UA's library is known here.
 *
 * No I/O, no clock; allocates.
 */
#ifndef DRIVEBRIDGE_OPCUA_TREE_H
#define DRIVEBRIDGE_OPCUA_TREE_H

#include "opcua/config.h"
#include "opcua/model.h"

enum db_opcua_branch_type {
	DB_OPCUA_ROOT,   /* the drive itself, or the gateway */
	DB_OPCUA_FOLDER, /* of a group */
	DB_OPCUA_VARIABLE,
	DB_OPCUA_COLUMN, /* of the history */
	DB_OPCUA_CLOCK,  /* of the gateway: the service's own */
	DB_OPCUA_METHOD,
	DB_OPCUA_IDENTIFICATION, /* a folder */
	DB_OPCUA_COMPONENT_NAME,
	DB_OPCUA_LOCATION,
	/* Properties of a variable. */
	DB_OPCUA_UNIT,
	DB_OPCUA_RANGE,
	DB_OPCUA_VALUE_NAMES,
	DB_OPCUA_BIT_NAMES,
	/* Properties of a method. */
	DB_OPCUA_INPUTS,
	DB_OPCUA_OUTPUTS,
};

struct db_opcua_branch {
	enum db_opcua_branch_type type;
	char *path;       /* "Parameters.spd.EURange"; "" is the root's */
	const char *name; /* the last part of it */
	size_t parent;    /* in the list; the root's is itself */
	size_t first;     /* of what stands below it, side by side; folders are the last */
	size_t count;
	size_t place; /* its group, or the place of its register, column or command in the kind; a property has its owner's */
};

struct db_opcua_tree {
	const struct db_opcua_kind *kind;
	struct db_opcua_branch *list; /* the root is the first one */
	size_t count;
	size_t *sorted; /* by their paths */
	unsigned users; /* its owner's to count */
};

/* Of the kind, which must outlive it, what the configuration shows. NULL without memory; freed with db_opcua_tree_free(),
 * NULL is allowed. */
struct db_opcua_tree *db_opcua_tree_new(const struct db_opcua_kind *kind,
                                        const struct db_opcua_config *config, bool gateway);
void db_opcua_tree_free(struct db_opcua_tree *tree);

/* The branch with this path, which need not be ended by a zero byte; NULL when there is none. */
const struct db_opcua_branch *db_opcua_tree_find(const struct db_opcua_tree *tree, const char *path,
                                                 size_t length);

#endif
