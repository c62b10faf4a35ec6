/* SPDX-License-Identifier: Apache-2.0 */
#include "web/device.h"

#include <gnutls/crypto.h>
#include <stdio.h>
#include <string.h>

#define DIGEST_BYTES 32
#define ID_LENGTH (DB_WEB_SECRET_TEXT - 1)

static bool authenticate(const char *id, const char *user, const char *hash, char *digits)
{
	char text[DB_WEB_SECRET_TEXT + DB_USERS_NAME_MAX + 16];
	unsigned char digest[DIGEST_BYTES];

	/* Everybody could make what an empty key authenticates. */
	if (hash[0] == '\0')
		return false;
	snprintf(text, sizeof(text), "device %s %s", id, user);
	if (gnutls_hmac_fast(GNUTLS_MAC_SHA256, hash, strlen(hash), text, strlen(text), digest) !=
	    0)
		return false;
	db_web_hex_write(digest, sizeof(digest), digits);
	return true;
}

bool db_web_device_write(const struct db_web_secret *device, const char *user, const char *hash,
                         char text[DB_WEB_DEVICE_TEXT])
{
	char id[DB_WEB_SECRET_TEXT];

	db_web_hex_write(device->bytes, DB_WEB_SECRET_BYTES, id);
	snprintf(text, DB_WEB_DEVICE_TEXT, "%s.", id);
	return authenticate(id, user, hash, text + ID_LENGTH + 1);
}

bool db_web_device_read(const char *text, const char *user, const char *hash,
                        char id[DB_WEB_SECRET_TEXT])
{
	char expected[2 * DIGEST_BYTES + 1];
	unsigned char differ = 0;

	if (strlen(text) != DB_WEB_DEVICE_TEXT - 1 || text[ID_LENGTH] != '.')
		return false;
	memcpy(id, text, ID_LENGTH);
	id[ID_LENGTH] = '\0';
	if (!db_web_secret_is_good(id) || !authenticate(id, user, hash, expected))
		return false;
	for (size_t i = 0; i < sizeof(expected); i++)
		differ |= (unsigned char)(expected[i] ^ text[ID_LENGTH + 1 + i]);
	return differ == 0;
}

void db_web_device_name(const char *user, bool secure, char name[DB_WEB_DEVICE_NAME])
{
	unsigned char digest[DIGEST_BYTES] = { 0 };
	char digits[17];

	/* Whoever looks into a browser reads no names of users there. */
	(void)gnutls_hash_fast(GNUTLS_DIG_SHA256, user, strlen(user), digest);
	db_web_hex_write(digest, 8, digits);
	snprintf(name, DB_WEB_DEVICE_NAME, "%sdrivebridge-device-%s", secure ? "__Host-" : "",
	         digits);
}
