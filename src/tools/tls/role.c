/* SPDX-License-Identifier: Apache-2.0 */
#include "tls/role.h"

#include <string.h>

#define UTF8_STRING 0x0C /* the tag in DER; a length of up to 32 is one byte */

bool db_tls_role_read(const uint8_t *value, size_t size, char role[DB_SECURE_ROLE_MAX + 1])
{
	role[0] = '\0';
	if (size < 3 || size > 2 + DB_SECURE_ROLE_MAX || value[0] != UTF8_STRING ||
	    value[1] != size - 2 || memchr(value + 2, 0, size - 2))
		return false;
	memcpy(role, value + 2, size - 2);
	role[size - 2] = '\0';
	if (db_secure_role_is_good(role))
		return true;
	role[0] = '\0';
	return false;
}
