/* SPDX-License-Identifier: Apache-2.0 */
#include "server/acl.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <string.h>

#define V4_MAPPED 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF

static const uint8_t V4_PREFIX[] = { V4_MAPPED };

static const struct db_network LOOPBACK[] = {
	{ .address = { V4_MAPPED, 127, 0, 0, 0 }, .prefix = 96 + 8 },
	{ .address = { [15] = 1 }, .prefix = 128 },
};

bool db_acl_match(const struct db_network *network, const uint8_t address[16])
{
	unsigned prefix = network->prefix > 128 ? 128 : network->prefix;
	unsigned whole = prefix / 8;
	unsigned mask = 0xFF00u >> (prefix % 8) & 0xFFu;

	if (memcmp(network->address, address, whole) != 0)
		return false;
	return mask == 0 || ((network->address[whole] ^ address[whole]) & mask) == 0;
}

static bool any_match(const struct db_network *networks, size_t count, const uint8_t address[16])
{
	for (size_t i = 0; i < count; i++)
		if (db_acl_match(&networks[i], address))
			return true;
	return false;
}

enum db_access db_acl_access(const struct db_modbus_config *config, const uint8_t address[16])
{
	bool may_write;

	if (config->allow_write_count > 0)
		may_write = any_match(config->allow_write, config->allow_write_count, address);
	else
		may_write = any_match(LOOPBACK, sizeof(LOOPBACK) / sizeof(LOOPBACK[0]), address);
	if (may_write)
		return DB_ACCESS_WRITE;
	if (config->allow_read_count == 0 ||
	    any_match(config->allow_read, config->allow_read_count, address))
		return DB_ACCESS_READ;
	return DB_ACCESS_NONE;
}

bool db_acl_peer(const struct sockaddr_storage *peer, uint8_t address[16], uint16_t *port)
{
	struct sockaddr_in v4;
	struct sockaddr_in6 v6;

	switch (peer->ss_family) {
	case AF_INET:
		memcpy(&v4, peer, sizeof(v4));
		memcpy(address, V4_PREFIX, sizeof(V4_PREFIX));
		memcpy(address + sizeof(V4_PREFIX), &v4.sin_addr, 4);
		*port = ntohs(v4.sin_port);
		return true;
	case AF_INET6:
		memcpy(&v6, peer, sizeof(v6));
		memcpy(address, &v6.sin6_addr, 16);
		*port = ntohs(v6.sin6_port);
		return true;
	default:
		return false;
	}
}
