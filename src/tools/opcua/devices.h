/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The part of OPC UA for Devices (OPC 10000-100) that drives have: a drive is a component, listed
 * in DeviceSet, with a functional group Identification. Ids and names are the standard's.
 */
#ifndef DRIVEBRIDGE_OPCUA_DEVICES_H
#define DRIVEBRIDGE_OPCUA_DEVICES_H

#include <open62541/server.h>

#define DB_OPCUA_DEVICES_NAMESPACE "http://opcfoundation.org/UA/DI/"
/* Of the model whose part this is. */
#define DB_OPCUA_DEVICES_VERSION "1.04.0"
#define DB_OPCUA_DEVICES_DATE "2022-11-03"

/* Its nodes. */
#define DB_OPCUA_DEVICE_SET 5001
#define DB_OPCUA_FUNCTIONAL_GROUP_TYPE 1005
#define DB_OPCUA_VENDOR_NAMEPLATE 15035
#define DB_OPCUA_TAG_NAMEPLATE 15048

/* Adds them to the library's own store, and tells the index of their namespace. */
UA_StatusCode db_opcua_devices_add(UA_Server *server, UA_UInt16 *space);

#endif
