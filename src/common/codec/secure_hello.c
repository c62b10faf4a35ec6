/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/secure_hello.h"

#include <string.h>

static const uint8_t MAGIC[] = { 'D', 'B', 'T', 'L', 'S', 1 };

/* Where things stand: first the magic and the kind, then what is of the kind. */
enum { KIND = sizeof(MAGIC), BODY };
enum {
	CLIENT_PORT = BODY,
	CLIENT_ADDRESS = CLIENT_PORT + 2,
	CLIENT_FINGERPRINT = CLIENT_ADDRESS + 16,
	CLIENT_EXPIRES = CLIENT_FINGERPRINT + DB_SECURE_FINGERPRINT_SIZE,
	CLIENT_SERIAL = CLIENT_EXPIRES + 8,
	CLIENT_NAME = CLIENT_SERIAL + 1 + DB_SECURE_SERIAL_MAX,
	CLIENT_ROLE = CLIENT_NAME + DB_SECURE_NAME_MAX,
	CLIENT_WAITED = CLIENT_ROLE + DB_SECURE_ROLE_MAX,
	CLIENT_END = CLIENT_WAITED + 4,
};
enum {
	STATUS_TIMES = BODY,
	STATUS_COUNTS = STATUS_TIMES + 3 * 8,
	STATUS_END = STATUS_COUNTS + 5 * 4,
};

static void put(uint8_t *bytes, unsigned size, uint64_t value)
{
	for (unsigned i = 0; i < size; i++)
		bytes[i] = (uint8_t)(value >> 8 * (size - 1 - i));
}

static uint64_t get(const uint8_t *bytes, unsigned size)
{
	uint64_t value = 0;

	for (unsigned i = 0; i < size; i++)
		value = value << 8 | bytes[i];
	return value;
}

/* A text fills its field, or zeros follow it. False: something else follows. */
static bool get_text(const uint8_t *bytes, size_t size, char *text)
{
	size_t length = strnlen((const char *)bytes, size);

	memcpy(text, bytes, length);
	text[length] = '\0';
	for (size_t i = length; i < size; i++) {
		if (bytes[i] != 0)
			return false;
	}
	return true;
}

static bool is_visible(char character)
{
	return character > ' ' && character <= '~';
}

bool db_secure_role_is_good(const char *role)
{
	size_t length = 0;

	while (length <= DB_SECURE_ROLE_MAX && is_visible(role[length]))
		length++;
	return length > 0 && length <= DB_SECURE_ROLE_MAX && role[length] == '\0';
}

/* A comma separates it from what else is said of a client. */
static bool is_name(const char *name)
{
	size_t length = strlen(name);

	if (length > 0 && (name[0] == ' ' || name[length - 1] == ' '))
		return false;
	for (size_t i = 0; i < length; i++) {
		if ((!is_visible(name[i]) && name[i] != ' ') || name[i] == ',')
			return false;
	}
	return true;
}

static bool read_client(const uint8_t *bytes, struct db_secure_client *client)
{
	client->port = (uint16_t)get(bytes + CLIENT_PORT, 2);
	memcpy(client->address, bytes + CLIENT_ADDRESS, sizeof(client->address));
	memcpy(client->fingerprint, bytes + CLIENT_FINGERPRINT, sizeof(client->fingerprint));
	client->expires = (int64_t)get(bytes + CLIENT_EXPIRES, 8);
	client->serial_size = bytes[CLIENT_SERIAL];
	if (client->serial_size > DB_SECURE_SERIAL_MAX)
		return false;
	memcpy(client->serial, bytes + CLIENT_SERIAL + 1, client->serial_size);
	client->waited_ms = (uint32_t)get(bytes + CLIENT_WAITED, 4);
	return client->port != 0 &&
	       get_text(bytes + CLIENT_NAME, DB_SECURE_NAME_MAX, client->name) &&
	       is_name(client->name) &&
	       get_text(bytes + CLIENT_ROLE, DB_SECURE_ROLE_MAX, client->role) &&
	       (client->role[0] == '\0' || db_secure_role_is_good(client->role));
}

void db_secure_hello_write(const struct db_secure_hello *hello, uint8_t bytes[DB_SECURE_HELLO_SIZE])
{
	memset(bytes, 0, DB_SECURE_HELLO_SIZE);
	memcpy(bytes, MAGIC, sizeof(MAGIC));
	bytes[KIND] = (uint8_t)hello->kind;
	if (hello->kind == DB_SECURE_CLIENT) {
		put(bytes + CLIENT_PORT, 2, hello->client.port);
		memcpy(bytes + CLIENT_ADDRESS, hello->client.address,
		       sizeof(hello->client.address));
		memcpy(bytes + CLIENT_FINGERPRINT, hello->client.fingerprint,
		       sizeof(hello->client.fingerprint));
		put(bytes + CLIENT_EXPIRES, 8, (uint64_t)hello->client.expires);
		bytes[CLIENT_SERIAL] = hello->client.serial_size;
		memcpy(bytes + CLIENT_SERIAL + 1, hello->client.serial, hello->client.serial_size);
		memcpy(bytes + CLIENT_NAME, hello->client.name, strlen(hello->client.name));
		memcpy(bytes + CLIENT_ROLE, hello->client.role, strlen(hello->client.role));
		put(bytes + CLIENT_WAITED, 4, hello->client.waited_ms);
	} else {
		const int64_t times[] = { hello->status.expires, hello->status.crl_expires,
			                  hello->status.client_expires };
		const uint32_t counts[] = { hello->status.clients, hello->status.greetings,
			                    hello->status.accepted, hello->status.refused,
			                    hello->status.displaced };

		for (unsigned i = 0; i < sizeof(times) / sizeof(times[0]); i++)
			put(bytes + STATUS_TIMES + 8 * i, 8, (uint64_t)times[i]);
		for (unsigned i = 0; i < sizeof(counts) / sizeof(counts[0]); i++)
			put(bytes + STATUS_COUNTS + 4 * i, 4, counts[i]);
	}
}

enum db_secure_kind db_secure_hello_read(const uint8_t bytes[DB_SECURE_HELLO_SIZE],
                                         struct db_secure_hello *hello)
{
	bool good = memcmp(bytes, MAGIC, sizeof(MAGIC)) == 0;
	uint8_t same[DB_SECURE_HELLO_SIZE];

	memset(hello, 0, sizeof(*hello));
	if (good && bytes[KIND] == DB_SECURE_CLIENT) {
		good = read_client(bytes, &hello->client);
	} else if (good && bytes[KIND] == DB_SECURE_STATUS) {
		int64_t *const times[] = { &hello->status.expires, &hello->status.crl_expires,
			                   &hello->status.client_expires };
		uint32_t *const counts[] = { &hello->status.clients, &hello->status.greetings,
			                     &hello->status.accepted, &hello->status.refused,
			                     &hello->status.displaced };

		for (unsigned i = 0; i < sizeof(times) / sizeof(times[0]); i++)
			*times[i] = (int64_t)get(bytes + STATUS_TIMES + 8 * i, 8);
		for (unsigned i = 0; i < sizeof(counts) / sizeof(counts[0]); i++)
			*counts[i] = (uint32_t)get(bytes + STATUS_COUNTS + 4 * i, 4);
	} else {
		good = false;
	}
	if (!good)
		return hello->kind = DB_SECURE_WRONG;
	hello->kind = (enum db_secure_kind)bytes[KIND];
	/* What is unused is zero. */
	db_secure_hello_write(hello, same);
	if (memcmp(same, bytes, sizeof(same)) != 0)
		hello->kind = DB_SECURE_WRONG;
	return hello->kind;
}

_Static_assert(CLIENT_END <= DB_SECURE_HELLO_SIZE && STATUS_END <= DB_SECURE_HELLO_SIZE,
               "all of it fits");
