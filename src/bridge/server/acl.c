/* SPDX-License-Identifier: Apache-2.0 */
#include "server/acl.h"
#include "drivebridge/client.h"
#include "identity/local_user.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <string.h>

#define V4_MAPPED 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF

static const uint8_t V4_PREFIX[] = { V4_MAPPED };

static const struct db_network LOOPBACK[] = {
	{ .address = { V4_MAPPED, 127, 0, 0, 0 }, .prefix = 96 + 8 },
	{ .address = { [15] = 1 }, .prefix = 128 },
};

bool db_acl_match(const struct db_network *networks, size_t count, const uint8_t address[16])
{
	for (size_t i = 0; i < count; i++) {
		const struct db_network *network = &networks[i];
		unsigned prefix = network->prefix > 128 ? 128 : network->prefix;
		unsigned whole = prefix / 8;
		unsigned mask = 0xFF00u >> (prefix % 8) & 0xFFu;

		if (memcmp(network->address, address, whole) == 0 &&
		    (mask == 0 || ((network->address[whole] ^ address[whole]) & mask) == 0))
			return true;
	}
	return false;
}

enum db_access db_acl_access(const struct db_modbus_config *config, uint32_t endpoint,
                             const uint8_t address[16])
{
	struct db_endpoint_config at;
	bool may_write;

	if (!db_modbus_endpoint_find(config, endpoint, &at))
		return DB_ACCESS_NONE;
	if (at.allow_write_count > 0)
		may_write = db_acl_match(at.allow_write, at.allow_write_count, address);
	else
		may_write = db_acl_match(LOOPBACK, sizeof(LOOPBACK) / sizeof(LOOPBACK[0]), address);
	if (may_write)
		return DB_ACCESS_WRITE;
	if (at.allow_read_count == 0 || db_acl_match(at.allow_read, at.allow_read_count, address))
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

void db_acl_identify(int fd, const uint8_t network[16], uint8_t address[16])
{
	uid_t user;

	switch (db_local_user(fd, &user)) {
	case DB_LOCAL_NO:
		memcpy(address, network, 16);
		return;
	case DB_LOCAL_UNKNOWN:
		user = DB_CLIENT_USER_UNKNOWN;
		break;
	case DB_LOCAL_USER:
		break;
	}
	db_client_address_of_user(network, user, address);
}

enum db_access db_acl_of_client(const struct db_modbus_config *config, uint32_t endpoint,
                                const struct db_rights *rights, const uint8_t network[16],
                                const uint8_t address[16])
{
	static const enum db_access OF_RIGHT[] = {
		[DB_RIGHT_NONE] = DB_ACCESS_NONE,
		[DB_RIGHT_READ] = DB_ACCESS_READ,
		[DB_RIGHT_ACT] = DB_ACCESS_WRITE,
	};
	static const enum db_access INSECURE[] = {
		[DB_SECURE_NOT_REQUIRED] = DB_ACCESS_WRITE,
		[DB_SECURE_FOR_WRITES] = DB_ACCESS_READ,
		[DB_SECURE_FOR_ALL] = DB_ACCESS_NONE,
	};
	enum db_access access = db_acl_access(config, endpoint, network);
	enum db_access most = INSECURE[config->require_secure];
	uint32_t user;

	if (db_client_user_of_address(address, &user))
		most = rights ? OF_RIGHT[db_rights_of_user(rights, user)] : DB_ACCESS_WRITE;
	return access < most ? access : most;
}

enum db_access db_acl_of_certificate(const struct db_modbus_config *config, uint32_t endpoint,
                                     const uint8_t network[16], const char *name,
                                     const struct db_role_config **role)
{
	enum db_access access = db_acl_access(config, endpoint, network);
	const struct db_role_config *found = NULL;

	for (size_t i = 0; i < config->role_count && !found; i++) {
		if (strcmp(config->roles[i].name, name) == 0)
			found = &config->roles[i];
	}
	*role = found;
	if (access == DB_ACCESS_WRITE &&
	    (!found || !(found->write.all || found->write.names || found->control)))
		return DB_ACCESS_READ;
	return access;
}
