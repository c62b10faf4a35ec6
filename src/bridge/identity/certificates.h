/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The certificates with which clients have connected over TLS. Histories, ids and claims of control
 * know a certificate by a number in place of a client's address; here are the names to it, which
 * outlive the connections. Bounded: when all places are taken, the one without connections for
 * longest is reused. The same certificate gets the same number again. Network thread.
 */
#ifndef DRIVEBRIDGE_IDENTITY_CERTIFICATES_H
#define DRIVEBRIDGE_IDENTITY_CERTIFICATES_H

#include "codec/secure_hello.h"
#include "drivebridge/client.h"

struct db_certificates;

/* Null when out of memory. */
struct db_certificates *db_certificates_new(void);
void db_certificates_free(struct db_certificates *certificates);

/*
 * The address under which a client is known, see db_client_address_of_certificate(): held for one
 * connection, which lets go of it at its end. False: every place has connections.
 */
bool db_certificates_hold(struct db_certificates *certificates,
                          const struct db_secure_client *client, uint8_t address[16]);
void db_certificates_let_go(struct db_certificates *certificates, const uint8_t address[16]);

/* The name and the role to an address, "" where they are not known (any more). False: it is no such
 * client's. `certificates` may be null. */
bool db_certificates_find(const struct db_certificates *certificates, const uint8_t address[16],
                          const char **name, const char **role);

#endif
