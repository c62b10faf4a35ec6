/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The address space: a node for each drive, its registers, commands and history, and for the buses
 * and the gateway itself. One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_NODES_H
#define DRIVEBRIDGE_OPCUA_NODES_H

#include "opcua/conditions.h"
#include "opcua/config.h"
#include "opcua/past.h"
#include "opcua/plant.h"
#include "users/roles.h"

#include <open62541/server.h>

struct db_opcua_nodes;

struct db_opcua_nodes_ops {
	/* A client writes: the value as JSON, which stays the caller's. */
	UA_StatusCode (*write)(void *context, const UA_NodeId *session, struct db_opcua_item *item,
	                       json_t *value);
	/* The newest token that the client's session has, for motions that it starts from now on;
	 * "": none. The text is copied. */
	UA_StatusCode (*write_clock)(void *context, const UA_NodeId *session, const char *token);
	/* When this server's own certificate ends, in seconds since 1970-01-01 UTC. */
	int64_t (*certificate_ends)(void *context);
	/* A client calls a command; takes `arguments` over. `result` and `reason` are its
	 * outputs. */
	UA_StatusCode (*run)(void *context, const UA_NodeId *session, struct db_opcua_drive *drive,
	                     const char *command, json_t *arguments);
	/* A client acknowledges an alarm. */
	db_opcua_acknowledge_fn *acknowledge;
	/* A client wants to read past events. */
	db_opcua_may_read_trail_fn *may_read_trail;
};

/* Shows what `config` selects of each drive; `config` must outlive it. NULL without memory; freed
 * with db_opcua_nodes_free() after the server, NULL is allowed. */
struct db_opcua_nodes *db_opcua_nodes_new(sd_event *loop, const struct db_opcua_config *config,
                                          const struct db_opcua_nodes_ops *ops, void *context);
void db_opcua_nodes_free(struct db_opcua_nodes *nodes);

/* For the configuration of the server, which has to clear it. */
UA_Nodestore db_opcua_nodes_store(struct db_opcua_nodes *nodes);

/* Adds the permanent folders, after the server was made with this store. Values are asked of the
 * plant, whose handlers are these, with the nodes as their context. */
UA_StatusCode db_opcua_nodes_begin(struct db_opcua_nodes *nodes, UA_Server *server,
                                   struct db_opcua_plant *plant);
extern const struct db_opcua_plant_ops db_opcua_nodes_plant_ops;

/* What a client needs at least to call this method or to write this variable. */
struct db_opcua_need {
	enum db_may may;   /* DB_MAYS: nobody may */
	const char *drive; /* of which drive; NULL: of any */
	const char *of;    /* the drive whose node it is; NULL: of no drive */
	const char *name;  /* the method's command, or the variable's register; NULL: neither */
	bool written;      /* it is being written */
};

struct db_opcua_need db_opcua_nodes_need(const struct db_opcua_nodes *nodes, const UA_NodeId *node,
                                         void *node_context);

/* Does the work that is due; returns when it is to be called next. */
db_time db_opcua_nodes_tend(struct db_opcua_nodes *nodes, db_time now);

/* A monitored item of a node's value was added or removed. */
void db_opcua_nodes_watch(struct db_opcua_nodes *nodes, const UA_NodeId *node, bool removed);

#endif
