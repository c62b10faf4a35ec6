/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/client.h"

#include <arpa/inet.h>
#include <string.h>

static const uint8_t v4_prefix[] = { 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF };

static bool is_ipv4(const uint8_t address[16])
{
	return memcmp(address, v4_prefix, sizeof v4_prefix) == 0;
}

uint32_t db_client_number_after(uint32_t id)
{
	do
		id++;
	while (id == DB_CLIENT_NOBODY || id == DB_CLIENT_GROUP);
	return id;
}

void db_client_address(const uint8_t address[16], char text[DB_CLIENT_ADDRESS_MAX])
{
	bool v4 = is_ipv4(address);

	inet_ntop(v4 ? AF_INET : AF_INET6, v4 ? address + sizeof v4_prefix : address, text,
	          DB_CLIENT_ADDRESS_MAX);
}

uint32_t db_client_ipv4(const uint8_t address[16])
{
	if (!is_ipv4(address))
		return DB_CLIENT_IPV6;
	return (uint32_t)address[12] << 24 | (uint32_t)address[13] << 16 |
	       (uint32_t)address[14] << 8 | address[15];
}
