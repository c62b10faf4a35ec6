/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The library's store of nodes. Nodes of the drives are made when they are requested and freed when
 * they are released: so a drive needs no memory for its hundreds of nodes, and is added and removed
 * at once. All others, the standard's and the types of events, are in the library's own store.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_STORE_H
#define DRIVEBRIDGE_OPCUA_STORE_H

#include "opcua/locales.h"
#include "opcua/roster.h"

#include <open62541/plugin/nodestore.h>
#include <stdbool.h>

/* Longest id. */
#define DB_OPCUA_ID_MAX 256

/* A node while the library holds it. The context of the library's node is its subject, which is
 * valid as long. */
struct db_opcua_node {
	UA_Node node;
	struct db_opcua_subject subject;
	char id[DB_OPCUA_ID_MAX];
	UA_LocalizedTextListEntry display_name[1 + DB_OPCUA_LOCALE_IDS];
	struct db_opcua_texts description; /* cleared together with the node */
	bool described;                    /* the description is requested, in any language */
	UA_UInt32 any_length;              /* 0, the dimension of an array */
	bool written;                      /* the library holds it to write it */
	void *value; /* freed with free() together with the node; NULL: none */
	/* Where the subscriptions to the node's events are kept; NULL: it has no events. */
	UA_MonitoredItem **listeners;
	UA_MonitoredItem *listeners_before;
	void *references;           /* the memory of its references and of their kinds */
	struct db_opcua_node *next; /* in the list of free nodes */
};

struct db_opcua_references;

struct db_opcua_store_ops {
	/* Finds the subject of an id. False: there is no such node here. */
	bool (*find)(void *context, UA_UInt16 space, UA_String id,
	             struct db_opcua_subject *subject);
	/* Fills the node in, except its id and its references. Texts stay the subject's. `valued`:
	 * the value is requested, if the node itself has it. */
	void (*fill)(void *context, struct db_opcua_node *node, bool valued);
	/* Adds its references with db_opcua_store_refer(): those of one type and direction
	 * together. Called twice, with equal results. */
	void (*refer)(void *context, const struct db_opcua_subject *subject,
	              struct db_opcua_references *references);
};

struct db_opcua_store;

/* NULL without memory; freed with db_opcua_store_free() after the server, NULL is allowed. */
struct db_opcua_store *db_opcua_store_new(const struct db_opcua_store_ops *ops, void *context);
void db_opcua_store_free(struct db_opcua_store *store);

/* For the configuration of a server, which has to clear it. */
UA_Nodestore db_opcua_store_give(struct db_opcua_store *store);

/* True if the library holds the node of this subject to write it. */
bool db_opcua_store_is_written(const struct db_opcua_subject *subject);

/* From now on ids of these two namespaces are searched here first. */
void db_opcua_store_begin(struct db_opcua_store *store, UA_UInt16 space, UA_UInt16 types);

/* True if such references are requested: others need not be added. */
bool db_opcua_store_wants(const struct db_opcua_references *references, UA_Byte type, bool inverse);

/* Adds a reference to `target` of this name. The id is copied. */
void db_opcua_store_refer(struct db_opcua_references *references, UA_Byte type, bool inverse,
                          UA_NodeId target, UA_QualifiedName name);

/* The library's index of this type of references of the standard; 0: it has none. */
UA_Byte db_opcua_store_reference_type(const struct db_opcua_store *store, UA_UInt32 type);

/* A reference of one of the library's own nodes is added or removed. */
UA_StatusCode db_opcua_store_link(struct db_opcua_store *store, UA_NodeId from, UA_Byte type,
                                  UA_NodeId target, UA_QualifiedName name, bool comes);

#endif
