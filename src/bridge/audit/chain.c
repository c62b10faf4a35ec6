/* SPDX-License-Identifier: Apache-2.0 */
#include "audit/audit_private.h"

#include <nettle/base16.h>
#include <nettle/memops.h>
#include <string.h>

#define SEAL_BYTES 16
#define SEAL_DIGITS (DB_SEAL_MAX - 1)

/* What is between a record and its seal, and after that. */
static const char seal_begin[] = ",\"seal\":\"";
static const char seal_end[] = "\"}";

#define BEGIN_LENGTH (sizeof(seal_begin) - 1)
#define END_LENGTH (sizeof(seal_end) - 1)

_Static_assert(sizeof(seal_begin) + SEAL_DIGITS + sizeof(seal_end) <= DB_CHAIN_END_MAX,
               "the end of a line has room");

void db_chain_init(struct db_chain *chain, const uint8_t key[DB_CHAIN_KEY])
{
	hmac_sha256_set_key(&chain->hash, DB_CHAIN_KEY, key);
	memset(chain->seal, '0', SEAL_DIGITS);
	chain->seal[SEAL_DIGITS] = '\0';
}

static void compute(struct db_chain *chain, const char *body, size_t length, char seal[DB_SEAL_MAX])
{
	uint8_t digest[SEAL_BYTES];

	hmac_sha256_update(&chain->hash, SEAL_DIGITS, (const uint8_t *)chain->seal);
	hmac_sha256_update(&chain->hash, length, (const uint8_t *)body);
	/* Ready for the next line, with the same key. */
	hmac_sha256_digest(&chain->hash, sizeof(digest), digest);
	base16_encode_update(seal, sizeof(digest), digest);
	seal[SEAL_DIGITS] = '\0';
}

void db_chain_seal(struct db_chain *chain, const char *body, size_t length,
                   char end[DB_CHAIN_END_MAX])
{
	char seal[DB_SEAL_MAX];

	compute(chain, body, length, seal);
	memcpy(chain->seal, seal, sizeof(seal));
	memcpy(end, seal_begin, BEGIN_LENGTH);
	memcpy(end + BEGIN_LENGTH, seal, SEAL_DIGITS);
	memcpy(end + BEGIN_LENGTH + SEAL_DIGITS, seal_end, sizeof(seal_end));
}

enum db_chain_verdict db_chain_check(struct db_chain *chain, const char *line, size_t length)
{
	const size_t end = BEGIN_LENGTH + SEAL_DIGITS + END_LENGTH;
	char digits[DB_SEAL_MAX] = "";
	char right[DB_SEAL_MAX];
	const char *seal;
	size_t body;
	bool fits;

	/* The seal at the end of a line. */
	if (length <= end)
		return DB_CHAIN_NO_LINE;
	body = length - end;
	seal = line + body + BEGIN_LENGTH;
	if (memcmp(line + body, seal_begin, BEGIN_LENGTH) != 0 ||
	    memcmp(seal + SEAL_DIGITS, seal_end, END_LENGTH) != 0)
		return DB_CHAIN_NO_LINE;
	memcpy(digits, seal, SEAL_DIGITS);
	if (strspn(digits, "0123456789abcdef") != SEAL_DIGITS)
		return DB_CHAIN_NO_LINE;
	compute(chain, line, body, right);
	fits = memeql_sec(right, seal, SEAL_DIGITS);
	memcpy(chain->seal, seal, SEAL_DIGITS);
	return fits ? DB_CHAIN_GOOD : DB_CHAIN_WRONG;
}
