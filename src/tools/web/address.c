/* SPDX-License-Identifier: Apache-2.0 */
#include "web/address.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const unsigned char v4_prefix[12] = { 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF };

static bool is_v4(const struct db_web_address *address)
{
	return memcmp(address->bytes, v4_prefix, sizeof(v4_prefix)) == 0;
}

bool db_web_address_of(const struct sockaddr *socket_address, struct db_web_address *address)
{
	struct sockaddr_in6 v6;
	struct sockaddr_in v4;

	if (socket_address->sa_family == AF_INET) {
		memcpy(&v4, socket_address, sizeof(v4));
		memcpy(address->bytes, v4_prefix, sizeof(v4_prefix));
		memcpy(address->bytes + sizeof(v4_prefix), &v4.sin_addr, sizeof(v4.sin_addr));
		return true;
	}
	if (socket_address->sa_family != AF_INET6)
		return false;
	memcpy(&v6, socket_address, sizeof(v6));
	memcpy(address->bytes, &v6.sin6_addr, sizeof(address->bytes));
	return true;
}

bool db_web_address_parse(const char *text, struct db_web_address *address)
{
	memcpy(address->bytes, v4_prefix, sizeof(v4_prefix));
	return inet_pton(AF_INET, text, address->bytes + sizeof(v4_prefix)) == 1 ||
	       inet_pton(AF_INET6, text, address->bytes) == 1;
}

void db_web_address_write(const struct db_web_address *address, char text[DB_WEB_ADDRESS_TEXT])
{
	bool v4 = is_v4(address);

	if (!inet_ntop(v4 ? AF_INET : AF_INET6, address->bytes + (v4 ? sizeof(v4_prefix) : 0), text,
	               DB_WEB_ADDRESS_TEXT))
		text[0] = '\0';
}

struct db_web_address db_web_address_prefix(const struct db_web_address *address)
{
	struct db_web_address prefix = *address;

	if (!is_v4(address))
		memset(prefix.bytes + 8, 0, 8);
	return prefix;
}

bool db_web_address_is_local(const struct db_web_address *address)
{
	static const struct db_web_address loopback = { { [15] = 1 } };

	return is_v4(address) ? address->bytes[sizeof(v4_prefix)] == 127 :
	                        memcmp(address, &loopback, sizeof(loopback)) == 0;
}

static bool parse_network(const char *text, struct db_web_address *address, unsigned *bits)
{
	const char *slash = strchr(text, '/');
	size_t length = slash ? (size_t)(slash - text) : strlen(text);
	char host[DB_WEB_ADDRESS_TEXT];
	unsigned most;

	if (length >= sizeof(host))
		return false;
	memcpy(host, text, length);
	host[length] = '\0';
	if (!db_web_address_parse(host, address))
		return false;
	most = is_v4(address) ? 32 : 128;
	*bits = most;
	if (slash) {
		char *end;
		unsigned long number = strtoul(slash + 1, &end, 10);

		if (!isdigit((unsigned char)slash[1]) || *end != '\0' || number > most)
			return false;
		*bits = (unsigned)number;
	}
	*bits += 128 - most;
	return true;
}

bool db_web_network_is_good(const char *network)
{
	struct db_web_address address;
	unsigned bits;

	return parse_network(network, &address, &bits);
}

static bool network_has(const char *network, const struct db_web_address *address)
{
	struct db_web_address first;
	unsigned bits;

	if (!parse_network(network, &first, &bits))
		return false;
	for (unsigned i = 0; i < bits; i++) {
		unsigned differ = first.bytes[i / 8] ^ address->bytes[i / 8];

		if (differ & (0x80U >> (i % 8)))
			return false;
	}
	return true;
}

bool db_web_networks_have(const struct db_setting_list *list, const struct db_web_address *address)
{
	for (const char *at = list->names; at && *at; at += strlen(at) + 1) {
		if (network_has(at, address))
			return true;
	}
	return false;
}

bool db_web_endpoint_parse(const char *text, struct sockaddr_storage *endpoint, socklen_t *size)
{
	bool v6 = text[0] == '[';
	const char *colon = strrchr(text, ':');
	size_t length = colon ? (size_t)(colon - text) : 0;
	char host[DB_WEB_ADDRESS_TEXT + 2] = "";
	unsigned long port;
	char *end;

	if (!colon || length >= sizeof(host) || !isdigit((unsigned char)colon[1]))
		return false;
	port = strtoul(colon + 1, &end, 10);
	if (*end != '\0' || port > 65535 || (v6 && (length < 3 || colon[-1] != ']')))
		return false;
	if (v6)
		memcpy(host, text + 1, length - 2);
	else
		memcpy(host, text, length);
	memset(endpoint, 0, sizeof(*endpoint));
	if (v6) {
		struct sockaddr_in6 made = { .sin6_family = AF_INET6,
			                     .sin6_port = htons((uint16_t)port) };

		*size = sizeof(made);
		if (inet_pton(AF_INET6, host, &made.sin6_addr) != 1)
			return false;
		memcpy(endpoint, &made, sizeof(made));
	} else {
		struct sockaddr_in made = { .sin_family = AF_INET,
			                    .sin_port = htons((uint16_t)port) };

		*size = sizeof(made);
		if (inet_pton(AF_INET, host, &made.sin_addr) != 1)
			return false;
		memcpy(endpoint, &made, sizeof(made));
	}
	return true;
}
