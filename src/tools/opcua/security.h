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

#include "certificates/pair.h"
#include "opcua/config.h"

#include <open62541/server.h>

/* Afterwards the folders and the server's certificate exist, and `own` has it; a failure is logged.
 * To be cleared with db_certificate_pair_clear(). */
UA_StatusCode db_opcua_security_load(const struct db_opcua_config *config,
                                     struct db_certificate_pair *own);

/* Reads the server's certificate again: true if another one is there now, which can be used. Logs
 * it. */
bool db_opcua_security_renew(const struct db_opcua_config *config, struct db_certificate_pair *own);

/* To be called now and then: says in the log that it ends. `us`: microseconds since 1970-01-01
 * UTC. */
void db_opcua_security_look(const struct db_opcua_config *config, struct db_certificate_pair *own,
                            int64_t us);

/* For --check: false if there is a certificate and it is not good; errors go to standard error. */
bool db_opcua_security_check(const struct db_opcua_config *config);

/* A file's bytes, which stay the file's. */
UA_ByteString db_opcua_security_bytes(const struct db_certificate_file *file);

/* What clients ask for over signed channels of this policy is mended (operands.h). To be called
 * once for each policy, of one server. */
void db_opcua_security_mend(UA_SecurityPolicy *policy);

/* Checks clients' certificates against the folders; freed by its own clear(). */
UA_StatusCode db_opcua_security_guard(const struct db_opcua_config *config,
                                      UA_CertificateVerification *guard);

#endif
