/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The nodes below a drive in the address space. They are the same for all drives of a kind, so they
 * are kept once; a node's id is the drive's name, a dot and the path. Independent of the OPC UA
 * library.
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
	DB_OPCUA_COLUMN,           /* of the history */
	DB_OPCUA_CLOCK,            /* of the gateway: the service's own */
	DB_OPCUA_CERTIFICATE_ENDS, /* of the gateway: of this server's own certificate */
	DB_OPCUA_METHOD,
	DB_OPCUA_IDENTIFICATION, /* a folder */
	DB_OPCUA_COMPONENT_NAME,
	DB_OPCUA_LOCATION,
	/* As the drive says itself. */
	DB_OPCUA_MODEL,
	DB_OPCUA_SOFTWARE_REVISION,
	/* Properties of a variable. */
	DB_OPCUA_UNIT,
	DB_OPCUA_RANGE,
	/* Properties of a method. */
	DB_OPCUA_INPUTS,
	DB_OPCUA_OUTPUTS,
};

struct db_opcua_branch {
	enum db_opcua_branch_type type;
	char *path;       /* "Parameters.spd.EURange"; "" for the root */
	const char *name; /* the last part of the path */
	size_t parent;    /* in the list; the root's is itself */
	size_t first;     /* first of its children, which are adjacent; folders are the last */
	size_t count;
	/* its group, or the index of its register, column or command in the kind; for a property
	 * its owner's */
	size_t place;
};

struct db_opcua_tree {
	const struct db_opcua_kind *kind;
	struct db_opcua_branch *list; /* the root is the first one */
	size_t count;
	size_t *sorted; /* by their paths */
	unsigned users; /* counted by the owner */
};

/* The part of the kind that the configuration shows; the kind must outlive it. NULL without memory;
 * freed with db_opcua_tree_free(), NULL is allowed. */
struct db_opcua_tree *db_opcua_tree_new(const struct db_opcua_kind *kind,
                                        const struct db_opcua_config *config, bool gateway);
void db_opcua_tree_free(struct db_opcua_tree *tree);

/* The branch with this path, which needs no terminating zero; NULL when there is none. */
const struct db_opcua_branch *db_opcua_tree_find(const struct db_opcua_tree *tree, const char *path,
                                                 size_t length);

/* The command of a method, of the interface's type Command. */
const json_t *db_opcua_tree_command(const struct db_opcua_tree *tree,
                                    const struct db_opcua_branch *method);

#endif
