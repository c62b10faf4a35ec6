/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The store of nodes that the library has its nodes in. Those of the drives are made when they are asked for and forgotten
 * when they are released: a drive takes no memory for its hundreds of nodes, and comes and goes at once. All others,
 * the standard's and the types of events, are in the library's own store.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_STORE_H
#define DRIVEBRIDGE_OPCUA_STORE_H

#include "opcua/roster.h"

#include <open62541/plugin/nodestore.h>
#include <stdbool.h>

/* Ids are not longer. */
#define DB_OPCUA_ID_MAX 256

/* A node while somebody holds it. The context of the library's node is its subject, which is there for as long. */
struct db_opcua_node {
	UA_Node node;
	struct db_opcua_subject subject;
	char id[DB_OPCUA_ID_MAX];
	UA_LocalizedTextListEntry display_name;
	UA_LocalizedTextListEntry description;
	UA_UInt32 any_length; /* 0, the dimension of an array */
	void *value;          /* freed with free() when the node is forgotten; NULL: none */
	/* Where those who listen to the node's events are kept; NULL: nobody can. */
	UA_MonitoredItem **listeners;
	UA_MonitoredItem *listeners_before;
	UA_NodeReferenceKind kinds[6];
	void *references;           /* the memory that they are in */
	struct db_opcua_node *next; /* of those that nobody holds */
};

struct db_opcua_references;

struct db_opcua_store_ops {
	/* Whose id this is. False: there is no such node here. */
	bool (*find)(void *context, UA_String id, struct db_opcua_subject *subject);
	/* Makes the node, but for its id and its references. Texts stay those of the subject. `valued`: the value is asked
	 * for, where it is in the node. */
	void (*fill)(void *context, struct db_opcua_node *node, bool valued);
	/* Tells its references with db_opcua_store_refer(), those of one type and direction one after the other, and twice
	 * the same ones. */
	void (*refer)(void *context, const struct db_opcua_subject *subject,
	              struct db_opcua_references *references);
};

struct db_opcua_store;

/* NULL without memory; freed with db_opcua_store_free() after the server, NULL is allowed. */
struct db_opcua_store *db_opcua_store_new(const struct db_opcua_store_ops *ops, void *context);
void db_opcua_store_free(struct db_opcua_store *store);

/* For the configuration of a server, which has to have it cleared. */
UA_Nodestore db_opcua_store_give(struct db_opcua_store *store);

/* From now on ids of this namespace are looked for here first. */
void db_opcua_store_begin(struct db_opcua_store *store, UA_UInt16 space);

/* Whether such references are asked for: others need not be told. */
bool db_opcua_store_wants(const struct db_opcua_references *references, UA_Byte type, bool inverse);

/* One more reference, to `target` of this name. The id is copied. */
void db_opcua_store_refer(struct db_opcua_references *references, UA_Byte type, bool inverse,
                          UA_NodeId target, UA_QualifiedName name);

/* A reference of one of the library's own nodes comes, or goes. */
UA_StatusCode db_opcua_store_link(struct db_opcua_store *store, UA_UInt32 from, UA_Byte type,
                                  UA_NodeId target, UA_QualifiedName name, bool comes);

#endif
