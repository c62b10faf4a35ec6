/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The rights to connect, read and write: by address, user of this machine, or role of a
 * certificate. Functions of the configuration and, for users, of what the kernel and two files say.
 */
#ifndef DRIVEBRIDGE_SERVER_ACL_H
#define DRIVEBRIDGE_SERVER_ACL_H

#include "drivebridge/config.h"
#include "drivebridge/server.h"
#include "identity/rights.h"

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

enum db_access { DB_ACCESS_NONE, DB_ACCESS_READ, DB_ACCESS_WRITE };

/* True if an address (IPv6, or IPv4 v4-mapped) is in one of the networks. */
bool db_acl_match(const struct db_network *networks, size_t count, const uint8_t address[16]);

/*
 * A client's rights at the endpoint with this number: none where there is no such endpoint (any
 * more). Writing includes reading. An empty allow_read means everyone, an empty allow_write the
 * local machine only.
 */
enum db_access db_acl_access(const struct db_modbus_config *config, uint32_t endpoint,
                             const uint8_t address[16]);

/* Address and port of a peer; false for anything but IPv4 and IPv6. */
bool db_acl_peer(const struct sockaddr_storage *peer, uint8_t address[16], uint16_t *port);

/* The address under which a client is known: that of one on this machine contains its user, even
 * when it cannot be found out, so that nothing on this machine passes for a network client. */
void db_acl_identify(int fd, const uint8_t network[16], uint8_t address[16]);

/* What a client without a certificate may do, by both of its addresses. `rights` are those of users
 * of this machine; null: they have no less than others. */
enum db_access db_acl_of_client(const struct db_modbus_config *config, uint32_t endpoint,
                                const struct db_rights *rights, const uint8_t network[16],
                                const uint8_t address[16]);

/* What a client may do whose certificate has the role of this name: where its address and its role
 * allow it. *role becomes null if the configuration has none: then nothing is answered. */
enum db_access db_acl_of_certificate(const struct db_modbus_config *config, uint32_t endpoint,
                                     const uint8_t network[16], const char *name,
                                     const struct db_role_config **role);

#endif
