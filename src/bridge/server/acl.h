/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The rights to connect, read and write. Pure functions of the configuration.
 */
#ifndef DRIVEBRIDGE_SERVER_ACL_H
#define DRIVEBRIDGE_SERVER_ACL_H

#include "drivebridge/config.h"
#include "drivebridge/server.h"

#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

enum db_access { DB_ACCESS_NONE, DB_ACCESS_READ, DB_ACCESS_WRITE };

/* True if an address (IPv6, or IPv4 v4-mapped) is in a network. */
bool db_acl_match(const struct db_network *network, const uint8_t address[16]);

/*
 * A client's rights. Writing includes reading. An empty allow_read means everyone, an empty
 * allow_write the local machine only.
 */
enum db_access db_acl_access(const struct db_modbus_config *config, const uint8_t address[16]);

/* Address and port of a peer; false for anything but IPv4 and IPv6. */
bool db_acl_peer(const struct sockaddr_storage *peer, uint8_t address[16], uint16_t *port);

#endif
