/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The address space: a node for each drive, its registers, commands and history, and for the buses and the gateway
 * itself. One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_NODES_H
#define DRIVEBRIDGE_OPCUA_NODES_H

#include "opcua/config.h"
#include "opcua/model.h"

#include <open62541/server.h>

/* The namespace of all of it. */
#define DB_OPCUA_NAMESPACE "urn:drivebridge:drives"

struct db_opcua_nodes;

struct db_opcua_nodes_ops {
	/* Brings an item up to date before it is read. */
	void (*fetch)(void *context, struct db_opcua_item *item);
	/* Others are watched than before. */
	void (*rewatch)(void *context);
	/* A client writes: the value as JSON, which stays the caller's. */
	UA_StatusCode (*write)(void *context, const UA_NodeId *session, struct db_opcua_item *item,
	                       json_t *value);
	/* A token of the service's clock. */
	UA_StatusCode (*read_clock)(void *context, char token[DB_OPCUA_TOKEN_MAX]);
	/* The newest one that the client's session has, for what it starts from now on; "": none. The text is taken. */
	UA_StatusCode (*write_clock)(void *context, const UA_NodeId *session, const char *token);
	/* A client calls a command; takes `arguments` over. `result` and `reason` are its outputs. */
	UA_StatusCode (*run)(void *context, const UA_NodeId *session, struct db_opcua_drive *drive,
	                     const char *command, json_t *arguments);
};

/* What `config` says of drives is shown, which must outlive it. NULL without memory; freed with db_opcua_nodes_free() after
 * the server, NULL is allowed. */
struct db_opcua_nodes *db_opcua_nodes_new(const struct db_opcua_config *config,
                                          const struct db_opcua_nodes_ops *ops, void *context);
void db_opcua_nodes_free(struct db_opcua_nodes *nodes);

/* For the configuration of the server, which has to have it cleared. */
UA_Nodestore db_opcua_nodes_store(struct db_opcua_nodes *nodes);

/* The folders that are always there, once there is a server with this store. */
UA_StatusCode db_opcua_nodes_begin(struct db_opcua_nodes *nodes, UA_Server *server);

/* A drive with all its nodes. The drive must outlive them. */
void db_opcua_nodes_add(struct db_opcua_nodes *nodes, struct db_opcua_drive *drive,
                        const json_t *description);
/* By another one of its name: who listens to its events listens to that one's. */
void db_opcua_nodes_replace(struct db_opcua_nodes *nodes, const struct db_opcua_drive *before,
                            struct db_opcua_drive *drive, const json_t *description);
void db_opcua_nodes_remove(struct db_opcua_nodes *nodes, const struct db_opcua_drive *drive);

/* The buses and what is measured of them, instead of those before. */
void db_opcua_nodes_set_buses(struct db_opcua_nodes *nodes, json_t *buses);
void db_opcua_nodes_set_figures(struct db_opcua_nodes *nodes, json_t *buses);

/* The node of a drive, or the one of all of them when there is no such; freed with UA_NodeId_clear(). */
UA_NodeId db_opcua_nodes_of_drive(const struct db_opcua_nodes *nodes, const char *drive);

/* A monitored item of a node's value comes or goes. */
void db_opcua_nodes_watch(struct db_opcua_nodes *nodes, const UA_NodeId *node, bool removed);

#endif
