/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A client asks for the id of a condition, which it needs to acknowledge it, as the NodeId of a
 * ConditionType without a path. The library answers that with nothing when it is built without its
 * own conditions, as Debian's is; the NodeId of a BaseEventType it answers with that of the event's
 * node. Here that node is the condition's: so the question is changed in the client's message.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_OPCUA_OPERANDS_H
#define DRIVEBRIDGE_OPCUA_OPERANDS_H

#include <stddef.h>
#include <stdint.h>

/* `chunk`: a whole chunk of a message, not encrypted. Changed only if it is the first one of a
 * request for monitored items; its length stays. */
void db_opcua_operands_mend(uint8_t *chunk, size_t length);

#endif
