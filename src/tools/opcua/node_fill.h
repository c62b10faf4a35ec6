/* SPDX-License-Identifier: Apache-2.0 */
/* The attributes of a node, made when the library asks for it (store.h). */
#ifndef DRIVEBRIDGE_OPCUA_NODE_FILL_H
#define DRIVEBRIDGE_OPCUA_NODE_FILL_H

#include "opcua/nodes.h"
#include "opcua/store.h"

#include <stdbool.h>

/* As in struct db_opcua_store_ops. */
void db_opcua_node_fill(struct db_opcua_nodes *nodes, struct db_opcua_node *node, bool valued);

#endif
