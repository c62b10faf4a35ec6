/* SPDX-License-Identifier: Apache-2.0 */
/* The ids of nodes, and what each node refers to. Pure. */
#ifndef DRIVEBRIDGE_OPCUA_REFERENCES_H
#define DRIVEBRIDGE_OPCUA_REFERENCES_H

#include "opcua/store.h"

struct db_opcua_id {
	char text[DB_OPCUA_ID_MAX];
};

/* "feeder.Parameters.spd"; an empty part is left out. */
struct db_opcua_id db_opcua_id_of(const char *owner, const char *part);

/* The texts stay the caller's. */
UA_NodeId db_opcua_node_id(const struct db_opcua_roster *roster, const struct db_opcua_id *id);
UA_NodeId db_opcua_type_id(const struct db_opcua_roster *roster,
                           const struct db_opcua_type_row *row);

/* The name of a drive or a bus, which is this gateway's; and one that types have, too: a member
 * matches its type's by it. */
UA_QualifiedName db_opcua_own_name(const struct db_opcua_roster *roster, const char *name);
UA_QualifiedName db_opcua_member_name(const struct db_opcua_roster *roster, const char *name);
/* "drive.feeder.no_answer". */
UA_QualifiedName db_opcua_condition_name(const struct db_opcua_roster *roster,
                                         const struct db_opcua_alarm *alarm);
/* The name of a row: that of a property is the standard's. */
/* Of a node below a drive. */
UA_QualifiedName db_opcua_branch_name(const struct db_opcua_roster *roster,
                                      const struct db_opcua_branch *branch);
UA_QualifiedName db_opcua_row_name(const struct db_opcua_roster *roster,
                                   const struct db_opcua_type_row *row);

/* As of struct db_opcua_store_ops. */
void db_opcua_refer(const struct db_opcua_roster *roster, const struct db_opcua_subject *subject,
                    struct db_opcua_references *references);

#endif
