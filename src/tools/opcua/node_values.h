/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the library calls when a client reads or writes the value of a node, or calls it. A node's
 * context is its subject.
 */
#ifndef DRIVEBRIDGE_OPCUA_NODE_VALUES_H
#define DRIVEBRIDGE_OPCUA_NODE_VALUES_H

#include <open62541/server.h>

UA_StatusCode db_opcua_node_read(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *node, void *node_context,
                                 UA_Boolean source_time_wanted, const UA_NumericRange *range,
                                 UA_DataValue *value);
UA_StatusCode db_opcua_node_write(UA_Server *server, const UA_NodeId *session,
                                  void *session_context, const UA_NodeId *node, void *node_context,
                                  const UA_NumericRange *range, const UA_DataValue *value);

/* The library writes what it knows of an event into its node; a condition has that already. */
UA_StatusCode db_opcua_node_drop(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *node, void *node_context,
                                 const UA_NumericRange *range, const UA_DataValue *value);

UA_StatusCode db_opcua_node_call(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *method_id, void *method_context,
                                 const UA_NodeId *object, void *object_context, size_t input_count,
                                 const UA_Variant *input, size_t output_count, UA_Variant *output);

/* A drive's methods are called by their own ids: of a type's the library finds only those of the
 * drive's own type, not of those above it (1.4.11). */
UA_StatusCode db_opcua_node_refuse(UA_Server *server, const UA_NodeId *session,
                                   void *session_context, const UA_NodeId *method_id,
                                   void *method_context, const UA_NodeId *object,
                                   void *object_context, size_t input_count,
                                   const UA_Variant *input, size_t output_count,
                                   UA_Variant *output);

#endif
