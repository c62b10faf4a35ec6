/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/client.h"

#include "codec/big_endian.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>

static const uint8_t v4_prefix[] = { 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF };

static bool is_ipv4(const uint8_t address[16])
{
	return memcmp(address, v4_prefix, sizeof(v4_prefix)) == 0;
}

/* Prefixes of addresses that do not exist in the network (RFC 4291). */
#define SESSION_PREFIX 0x01
#define USER_PREFIX 0x02
#define CERTIFICATE_PREFIX 0x03
#define LINE_PREFIX 0x04

/* Positions of the parts of a session's address. */
enum { SESSION_USER = 1, SESSION_ACTOR = 5, SESSION_NAMED = 9 };
/* And of the address of a client on this machine, or with a certificate, whose number is in the
 * user's place. */
enum { LOCAL_USER = 1, LOCAL_FORM = 5, LOCAL_IPV4 = 12 };
/* What its network address was. */
enum { FORM_IPV4 = 1, FORM_IPV6_LOOPBACK, FORM_IPV6 };

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

void db_client_address_of_session(const struct db_client_session *session, uint8_t address[16])
{
	memset(address, 0, 16);
	address[0] = SESSION_PREFIX;
	put_be32(session->user, address + SESSION_USER);
	put_be32(session->actor, address + SESSION_ACTOR);
	address[SESSION_NAMED] = session->named;
}

bool db_client_session_of_address(const uint8_t address[16], struct db_client_session *session)
{
	*session = (struct db_client_session){
		.user = get_be32(address + SESSION_USER),
		.actor = get_be32(address + SESSION_ACTOR),
		.named = address[SESSION_NAMED] != 0,
	};
	return address[0] == SESSION_PREFIX;
}

/* An address with what the kernel, or a certificate, says about its client. */
static void put_vouched(uint8_t prefix, uint32_t number, const uint8_t network[16],
                        uint8_t address[16])
{
	static const uint8_t loopback[16] = { [15] = 1 };
	uint8_t made[16] = { prefix };

	put_be32(number, made + LOCAL_USER);
	if (is_ipv4(network)) {
		made[LOCAL_FORM] = FORM_IPV4;
		memcpy(made + LOCAL_IPV4, network + sizeof(v4_prefix), 4);
	} else {
		made[LOCAL_FORM] = memcmp(network, loopback, sizeof(loopback)) == 0 ?
		                           FORM_IPV6_LOOPBACK :
		                           FORM_IPV6;
	}
	memcpy(address, made, sizeof(made));
}

void db_client_address_of_user(const uint8_t network[16], uint32_t user, uint8_t address[16])
{
	put_vouched(USER_PREFIX, user, network, address);
}

void db_client_address_of_certificate(const uint8_t network[16], uint32_t certificate,
                                      uint8_t address[16])
{
	put_vouched(CERTIFICATE_PREFIX, certificate, network, address);
}

bool db_client_certificate_of_address(const uint8_t address[16], uint32_t *certificate)
{
	*certificate = get_be32(address + LOCAL_USER);
	return address[0] == CERTIFICATE_PREFIX;
}

void db_client_address_of_line(const char *name, uint8_t address[16])
{
	memset(address, 0, 16);
	address[0] = LINE_PREFIX;
	memcpy(address + 1, name, strnlen(name, DB_CLIENT_LINE_NAME_MAX));
}

bool db_client_line_of_address(const uint8_t address[16], char name[DB_CLIENT_LINE_NAME_MAX + 1])
{
	memcpy(name, address + 1, DB_CLIENT_LINE_NAME_MAX);
	name[DB_CLIENT_LINE_NAME_MAX] = '\0';
	return address[0] == LINE_PREFIX;
}

bool db_client_same(const uint8_t a[16], const uint8_t b[16])
{
	return memcmp(a, b, a[0] == CERTIFICATE_PREFIX ? LOCAL_FORM : 16) == 0;
}

bool db_client_user_of_address(const uint8_t address[16], uint32_t *user)
{
	*user = get_be32(address + LOCAL_USER);
	return address[0] == USER_PREFIX;
}

/* What stands before the user of a client on this machine, or before a certificate. */
static void put_place(const uint8_t address[16], char text[DB_CLIENT_ADDRESS_MAX])
{
	if (address[LOCAL_FORM] == FORM_IPV4)
		inet_ntop(AF_INET, address + LOCAL_IPV4, text, DB_CLIENT_ADDRESS_MAX);
	else if (address[0] == CERTIFICATE_PREFIX && address[LOCAL_FORM] == FORM_IPV6)
		strcpy(text, "IPv6");
	else
		strcpy(text, address[LOCAL_FORM] == FORM_IPV6_LOOPBACK ? "::1" : "this machine");
}

void db_client_address(const uint8_t address[16], char text[DB_CLIENT_ADDRESS_MAX])
{
	bool v4 = is_ipv4(address);
	struct db_client_session session;
	char line[DB_CLIENT_LINE_NAME_MAX + 1];
	size_t length;
	uint32_t user;

	if (db_client_line_of_address(address, line)) {
		snprintf(text, DB_CLIENT_ADDRESS_MAX, "rtu %s", line);
		return;
	}
	if (db_client_session_of_address(address, &session)) {
		snprintf(text, DB_CLIENT_ADDRESS_MAX, "control, user %u", (unsigned)session.user);
		return;
	}
	if (db_client_certificate_of_address(address, &user)) {
		put_place(address, text);
		length = strlen(text);
		snprintf(text + length, DB_CLIENT_ADDRESS_MAX - length, ", certificate %08x",
		         (unsigned)user);
		return;
	}
	if (db_client_user_of_address(address, &user)) {
		put_place(address, text);
		length = strlen(text);
		if (user == DB_CLIENT_USER_UNKNOWN)
			strcpy(text + length, ", user unknown");
		else
			snprintf(text + length, DB_CLIENT_ADDRESS_MAX - length, ", user %u",
			         (unsigned)user);
	} else {
		inet_ntop(v4 ? AF_INET : AF_INET6, v4 ? address + sizeof(v4_prefix) : address, text,
		          DB_CLIENT_ADDRESS_MAX);
	}
}

void db_client_words_init(struct db_client_words *words, const uint8_t address[16],
                          const char *process_user, const char *user)
{
	char place[DB_CLIENT_ADDRESS_MAX] = "control";
	uint32_t number;

	if (db_client_user_of_address(address, &number))
		put_place(address, place);
	/* Half a name could be another user's: one that is too long is shown as its number. */
	if (process_user[0] == '\0' ||
	    snprintf(words->address, sizeof(words->address), "%s, user %s", place, process_user) >=
	            DB_CLIENT_ADDRESS_MAX)
		db_client_address(address, words->address);
	snprintf(words->user, sizeof(words->user), "%s", user);
}

void db_client_words_init_certificate(struct db_client_words *words, const uint8_t address[16],
                                      const char *name, const char *role)
{
	char place[DB_CLIENT_ADDRESS_MAX];

	words->user[0] = '\0';
	put_place(address, place);
	if (name[0] == '\0') {
		db_client_address(address, place);
		snprintf(words->address, sizeof(words->address), "%s", place);
	} else {
		snprintf(words->address, sizeof(words->address), "%s, certificate %s%s%s", place,
		         name, role[0] != '\0' ? ", role " : "", role);
	}
}

void db_client_words_join(const struct db_client_words *words, char text[DB_CLIENT_TEXT_MAX])
{
	snprintf(text, DB_CLIENT_TEXT_MAX, "%s%s%s", words->address,
	         words->user[0] != '\0' ? " for " : "", words->user);
}

uint32_t db_client_ipv4(const uint8_t address[16])
{
	uint32_t user;

	if ((db_client_user_of_address(address, &user) || address[0] == CERTIFICATE_PREFIX) &&
	    address[LOCAL_FORM] == FORM_IPV4)
		return get_be32(address + LOCAL_IPV4);
	return is_ipv4(address) ? get_be32(address + sizeof(v4_prefix)) : DB_CLIENT_IPV6;
}
