/* SPDX-License-Identifier: Apache-2.0 */
/* What nodes.c, node_fill.c and node_values.c share. */
#ifndef DRIVEBRIDGE_OPCUA_NODES_PRIVATE_H
#define DRIVEBRIDGE_OPCUA_NODES_PRIVATE_H

#include "opcua/historian.h"
#include "opcua/nodes.h"
#include "opcua/roster.h"
#include "opcua/store.h"

struct db_opcua_nodes {
	const struct db_opcua_config *config;
	const struct db_opcua_nodes_ops *ops;
	void *context;
	UA_Server *server;
	struct db_opcua_plant *plant;
	struct db_opcua_store *store;
	struct db_opcua_roster roster;
	struct db_opcua_locales locales;
	struct db_opcua_conditions *conditions;
	struct db_opcua_past *past;
	struct db_opcua_historian historian;
	UA_MonitoredItem *listeners; /* of the events of all drives */
	UA_DataTypeArray *enumerations;
	/* Of the drives that came and went, for clients; told together. The ids are owned. */
	UA_ModelChangeStructureDataType *changes;
	size_t change_count;
};

/* How often the service is asked for figures of its buses, in milliseconds. */
#define DB_OPCUA_FIGURES_INTERVAL 1000.0

#endif
