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

/* Of addresses that begin so the network knows none (RFC 4291). */
#define SESSION_PREFIX 0x01

/* Where the parts of a session's are. */
enum { SESSION_USER = 1, SESSION_ACTOR = 5, SESSION_NAMED = 9 };

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

static void put_u32(uint8_t bytes[4], uint32_t value)
{
	for (unsigned i = 0; i < 4; i++)
		bytes[i] = (uint8_t)(value >> (24 - 8 * i));
}

static uint32_t get_u32(const uint8_t bytes[4])
{
	return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 |
	       bytes[3];
}

void db_client_address_of_session(const struct db_client_session *session, uint8_t address[16])
{
	memset(address, 0, 16);
	address[0] = SESSION_PREFIX;
	put_u32(address + SESSION_USER, session->user);
	put_u32(address + SESSION_ACTOR, session->actor);
	address[SESSION_NAMED] = session->named;
}

bool db_client_session_of_address(const uint8_t address[16], struct db_client_session *session)
{
	*session = (struct db_client_session){
		.user = get_u32(address + SESSION_USER),
		.actor = get_u32(address + SESSION_ACTOR),
		.named = address[SESSION_NAMED] != 0,
	};
	return address[0] == SESSION_PREFIX;
}

void db_client_address(const uint8_t address[16], char text[DB_CLIENT_ADDRESS_MAX])
{
	bool v4 = is_ipv4(address);
	struct db_client_session session;

	if (db_client_session_of_address(address, &session))
		snprintf(text, DB_CLIENT_ADDRESS_MAX, "control, user %u", (unsigned)session.user);
	else
		inet_ntop(v4 ? AF_INET : AF_INET6, v4 ? address + sizeof v4_prefix : address, text,
		          DB_CLIENT_ADDRESS_MAX);
}

void db_client_words_init(struct db_client_words *words, const uint8_t address[16],
                          const char *process_user, const char *user)
{
	if (process_user[0] != '\0')
		snprintf(words->address, sizeof words->address, "control, user %.31s",
		         process_user);
	else
		db_client_address(address, words->address);
	snprintf(words->user, sizeof words->user, "%s", user);
}

void db_client_words_join(const struct db_client_words *words, char text[DB_CLIENT_TEXT_MAX])
{
	snprintf(text, DB_CLIENT_TEXT_MAX, "%s%s%s", words->address,
	         words->user[0] != '\0' ? " for " : "", words->user);
}

uint32_t db_client_ipv4(const uint8_t address[16])
{
	if (!is_ipv4(address))
		return DB_CLIENT_IPV6;
	return get_u32(address + sizeof v4_prefix);
}
