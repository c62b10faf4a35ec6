/* SPDX-License-Identifier: Apache-2.0 */
/* Addresses of browsers, and networks: IPv6, or IPv4 as v4-mapped. Pure. */
#ifndef DRIVEBRIDGE_WEB_ADDRESS_H
#define DRIVEBRIDGE_WEB_ADDRESS_H

#include "reader/settings.h"

#include <netinet/in.h>
#include <stdbool.h>
#include <sys/socket.h>

struct db_web_address {
	unsigned char bytes[16];
};

/* False for other families than IPv4 and IPv6. */
bool db_web_address_of(const struct sockaddr *socket_address, struct db_web_address *address);
bool db_web_address_parse(const char *text, struct db_web_address *address);

#define DB_WEB_ADDRESS_TEXT INET6_ADDRSTRLEN
void db_web_address_write(const struct db_web_address *address, char text[DB_WEB_ADDRESS_TEXT]);

/* What one machine may have to itself: the first 64 bits of IPv6, a whole address of IPv4. The rest
 * is 0. */
struct db_web_address db_web_address_prefix(const struct db_web_address *address);

/* True for a loopback address. */
bool db_web_address_is_local(const struct db_web_address *address);

/* True for "ADDRESS" or "ADDRESS/BITS". */
bool db_web_network_is_good(const char *network);

/* True if one of the list's networks contains it. */
bool db_web_networks_have(const struct db_setting_list *list, const struct db_web_address *address);

/* "ADDRESS:PORT" or "[ADDRESS]:PORT". False for another form. */
bool db_web_endpoint_parse(const char *text, struct sockaddr_storage *endpoint, socklen_t *size);

#endif
