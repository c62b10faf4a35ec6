/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/client.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>

static const uint8_t v4_prefix[] = { 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF };

static bool is_ipv4(const uint8_t address[16])
{
	return memcmp(address, v4_prefix, sizeof v4_prefix) == 0;
}

/* Of addresses that begin so the network knows none (RFC 4291); behind it the user's number and name. */
#define USER_PREFIX 0x01
#define USER_NAME 5

static bool is_user(const uint8_t address[16])
{
	return address[0] == USER_PREFIX;
}

uint32_t db_client_number_after(uint32_t id)
{
	if (db_client_is_session(id))
		return id + 1 == DB_CLIENT_GROUP ? DB_CLIENT_FIRST_SESSION : id + 1;
	return id + 1 == DB_CLIENT_FIRST_SESSION ? DB_CLIENT_NOBODY + 1 : id + 1;
}

bool db_client_is_session(uint32_t id)
{
	return id >= DB_CLIENT_FIRST_SESSION && id != DB_CLIENT_GROUP;
}

void db_client_address_of_user(uint32_t user, const char *name, uint8_t address[16])
{
	memset(address, 0, 16);
	address[0] = USER_PREFIX;
	for (unsigned i = 0; i < 4; i++)
		address[1 + i] = (uint8_t)(user >> (24 - 8 * i));
	/* Half a name would be another one's. */
	if (!name || strlen(name) > 16 - USER_NAME)
		return;
	for (unsigned i = 0; name[i]; i++)
		address[USER_NAME + i] = (uint8_t)name[i];
}

void db_client_address(const uint8_t address[16], char text[DB_CLIENT_ADDRESS_MAX])
{
	bool v4 = is_ipv4(address);
	unsigned user = (unsigned)address[1] << 24 | (unsigned)address[2] << 16 |
	                (unsigned)address[3] << 8 | address[4];

	if (is_user(address) && address[USER_NAME] != '\0') {
		snprintf(text, DB_CLIENT_ADDRESS_MAX, "control, user %.*s", 16 - USER_NAME,
		         (const char *)address + USER_NAME);
		return;
	}
	if (is_user(address)) {
		snprintf(text, DB_CLIENT_ADDRESS_MAX, "control, user %u", user);
		return;
	}
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
