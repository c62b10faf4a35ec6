/* SPDX-License-Identifier: Apache-2.0 */
/* Addresses of browsers and networks of them: IPv6, or IPv4 v4-mapped. Pure. */
#ifndef DRIVEBRIDGE_WEB_ADDRESS_H
#define DRIVEBRIDGE_WEB_ADDRESS_H

#include "reader/settings.h"

#include <netinet/in.h>
#include <stdbool.h>
#include <sys/socket.h>

struct db_web_address {
	unsigned char bytes[16];
};

/* False for anything but IPv4 and IPv6. */
bool db_web_address_of(const struct sockaddr *socket_address, struct db_web_address *address);
bool db_web_address_parse(const char *text, struct db_web_address *address);

#define DB_WEB_ADDRESS_TEXT INET6_ADDRSTRLEN
void db_web_address_write(const struct db_web_address *address, char text[DB_WEB_ADDRESS_TEXT]);

/* Whether it is one of this machine's loopback. */
bool db_web_address_is_local(const struct db_web_address *address);

/* "ADDRESS" or "ADDRESS/BITS"; false when it is none. */
bool db_web_network_is_good(const char *network);

/* Whether one of the list's networks has it. */
bool db_web_networks_have(const struct db_setting_list *list, const struct db_web_address *address);

/* "ADDRESS:PORT" or "[ADDRESS]:PORT". False when it is none. */
bool db_web_endpoint_parse(const char *text, struct sockaddr_storage *endpoint, socklen_t *size);

#endif
