/* SPDX-License-Identifier: Apache-2.0 */
#include "web/origin.h"
#include "web/address.h"

#include <string.h>
#include <strings.h>

#define NAME_MAX_LENGTH 255

bool db_web_host_is_good(const char *host, const struct db_setting_list *names)
{
	char name[NAME_MAX_LENGTH + 1];
	struct db_web_address address;
	const char *end;
	size_t length;
	size_t digits;

	if (!host)
		return false;
	/* An IPv6 address ends at its bracket. */
	end = host[0] == '[' ? strchr(host, ']') : strchr(host, ':');
	if (host[0] == '[' && !end)
		return false;
	end = !end ? host + strlen(host) : host[0] == '[' ? end + 1 : end;
	/* Nothing follows but, perhaps, a port. */
	digits = *end == ':' ? strspn(end + 1, "0123456789") : 0;
	if (*end != '\0' && (digits < 1 || digits > 5 || end[1 + digits] != '\0'))
		return false;
	if (host[0] == '[') {
		length = (size_t)(end - host) - 2;
		host++;
	} else {
		length = (size_t)(end - host);
	}
	if (length == 0 || length > NAME_MAX_LENGTH)
		return false;
	memcpy(name, host, length);
	name[length] = '\0';
	if (db_web_address_parse(name, &address) || strcasecmp(name, "localhost") == 0)
		return true;
	for (const char *at = names->names; at && *at; at += strlen(at) + 1) {
		if (strcasecmp(at, name) == 0)
			return true;
	}
	return false;
}

bool db_web_origin_is_good(const char *origin, const char *host)
{
	if (!origin)
		return true;
	if (strncmp(origin, "http://", 7) == 0)
		origin += 7;
	else if (strncmp(origin, "https://", 8) == 0)
		origin += 8;
	else
		return false;
	return host && strcasecmp(origin, host) == 0;
}
