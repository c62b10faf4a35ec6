/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Certificates: the server's own, made at the first start, and the trusted ones of clients. All are
 * files in folders, which are read again for each client:
 *
 *   own       cert.der, key.der
 *   trusted   clients, or the authorities that sign theirs
 *   issuers   authorities between those, which alone make nobody trusted
 *   revoked   their revocation lists
 *   rejected  the latest clients that were not trusted; moved into `trusted` they are
 */
#ifndef DRIVEBRIDGE_OPCUA_SECURITY_H
#define DRIVEBRIDGE_OPCUA_SECURITY_H

#include "opcua/config.h"

#include <open62541/server.h>

/* Afterwards the folders and the server's certificate exist; a failure is logged. Both are freed
 * with UA_ByteString_clear(). */
UA_StatusCode db_opcua_security_load(const struct db_opcua_config *config, const UA_Logger *logger,
                                     UA_ByteString *certificate, UA_ByteString *key);

/* Checks clients' certificates against the folders; freed by its own clear(). */
UA_StatusCode db_opcua_security_guard(const struct db_opcua_config *config,
                                      UA_CertificateVerification *guard);

#endif
