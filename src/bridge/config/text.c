/* SPDX-License-Identifier: Apache-2.0 */
#include "config/text.h"

#include <arpa/inet.h>
#include <errno.h>
#include <limits.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const uint8_t V4_MAPPED[12] = { [10] = 0xFF, [11] = 0xFF };

bool db_text_number(const char *text, unsigned *number)
{
	unsigned long long value;

	/* strtoull() alone would take signs, spaces and hexadecimal. */
	if (text[0] == '\0' || text[strspn(text, "0123456789")] != '\0')
		return false;
	errno = 0;
	value = strtoull(text, NULL, 10);
	if (errno || value > UINT_MAX)
		return false;
	*number = (unsigned)value;
	return true;
}

bool db_text_is_hex(const char *text)
{
	return text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
}

bool db_text_integer(const char *text, double *number)
{
	bool negative = text[0] == '-';
	unsigned value;

	if (db_text_is_hex(text)) {
		unsigned long long digits;

		if (text[2] == '\0' || text[2 + strspn(text + 2, "0123456789abcdefABCDEF")] != '\0')
			return false;
		errno = 0;
		digits = strtoull(text, NULL, 16);
		if (errno || digits > UINT_MAX)
			return false;
		*number = (double)digits;
		return true;
	}
	if (!db_text_number(text + negative, &value))
		return false;
	*number = negative ? -(double)value : value;
	return true;
}

bool db_text_real(const char *text, double *number)
{
	locale_t plain;
	double value;
	char *end;

	if (text[0] == '\0' || text[strspn(text, "0123456789.eE+-")] != '\0')
		return false;
	plain = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
	if (!plain)
		return false;
	value = strtod_l(text, &end, plain);
	freelocale(plain);
	if (*end != '\0' || !isfinite(value))
		return false;
	*number = value;
	return true;
}

bool db_text_word(const char *text, const char *words, unsigned *position)
{
	size_t wanted = strlen(text);

	for (unsigned i = 0; *words; i++) {
		size_t length = strcspn(words, " ");

		if (length == wanted && memcmp(words, text, length) == 0) {
			*position = i;
			return true;
		}
		words += length;
		words += *words == ' ';
	}
	return false;
}

void db_text_put_word(FILE *out, const char *words, unsigned position)
{
	while (position-- > 0) {
		words += strcspn(words, " ");
		words += *words == ' ';
	}
	fprintf(out, "%.*s", (int)strcspn(words, " "), words);
}

bool db_text_listen(const char *text)
{
	const char *colon = strrchr(text, ':');
	bool bracket = text[0] == '[';
	char address[INET6_ADDRSTRLEN + 1];
	struct in6_addr ignored;
	unsigned port;
	size_t length;

	if (!colon || !db_text_number(colon + 1, &port) || port > 65535)
		return false;
	length = (size_t)(colon - text);
	if (bracket) {
		if (length < 2 || text[length - 1] != ']')
			return false;
		text++;
		length -= 2;
	}
	if (length >= sizeof(address))
		return false;
	memcpy(address, text, length);
	address[length] = '\0';
	return inet_pton(bracket ? AF_INET6 : AF_INET, address, &ignored) == 1;
}

enum db_network_error db_text_network(const char *text, struct db_network *network)
{
	const char *slash = strchr(text, '/');
	size_t length = slash ? (size_t)(slash - text) : strlen(text);
	char address[INET6_ADDRSTRLEN + 1];
	unsigned bits, prefix;
	bool host_bits = false;

	if (length >= sizeof(address))
		return DB_NETWORK_NO_ADDRESS;
	memcpy(address, text, length);
	address[length] = '\0';
	if (inet_pton(AF_INET, address, network->address + sizeof(V4_MAPPED)) == 1) {
		memcpy(network->address, V4_MAPPED, sizeof(V4_MAPPED));
		bits = 32;
	} else if (inet_pton(AF_INET6, address, network->address) == 1) {
		bits = 128;
	} else {
		return DB_NETWORK_NO_ADDRESS;
	}
	prefix = bits;
	if (slash && (!db_text_number(slash + 1, &prefix) || prefix > bits))
		return DB_NETWORK_PREFIX;
	network->prefix = (uint8_t)(128 - bits + prefix);
	for (unsigned bit = network->prefix; bit < 128; bit++) {
		uint8_t mask = (uint8_t)(0x80u >> (bit % 8));

		host_bits |= (network->address[bit / 8] & mask) != 0;
		network->address[bit / 8] &= (uint8_t)~mask;
	}
	return host_bits ? DB_NETWORK_HOST_BITS : DB_NETWORK_OK;
}

void db_text_of_network(const struct db_network *network, char text[DB_NETWORK_TEXT_MAX])
{
	bool v4 = network->prefix >= 96 &&
	          memcmp(network->address, V4_MAPPED, sizeof(V4_MAPPED)) == 0;
	char address[INET6_ADDRSTRLEN] = "";

	inet_ntop(v4 ? AF_INET : AF_INET6, network->address + (v4 ? sizeof(V4_MAPPED) : 0), address,
	          sizeof(address));
	snprintf(text, DB_NETWORK_TEXT_MAX, "%s/%u", address, network->prefix - (v4 ? 96u : 0u));
}

bool db_text_cpus(const char *text, uint64_t *cpus)
{
	char part[16];
	char *dash;
	unsigned first, last;

	*cpus = 0;
	if (strcmp(text, "any") == 0)
		return true;
	/* Each part is one processor or a range of them, at most 63. */
	for (;;) {
		size_t length = strcspn(text, ",");

		if (length >= sizeof(part))
			return false;
		memcpy(part, text, length);
		part[length] = '\0';
		dash = strchr(part, '-');
		if (dash)
			*dash = '\0';
		if (!db_text_number(part, &first) ||
		    !db_text_number(dash ? dash + 1 : part, &last) || first > last || last > 63)
			return false;
		for (unsigned cpu = first; cpu <= last; cpu++)
			*cpus |= UINT64_C(1) << cpu;
		if (text[length] == '\0')
			return true;
		text += length + 1;
	}
}

void db_text_of_cpus(uint64_t cpus, char text[DB_CPUS_TEXT_MAX])
{
	size_t used = 0;

	text[0] = '\0';
	for (unsigned cpu = 0; cpu < 64; cpu++) {
		unsigned last = cpu;

		if (!(cpus >> cpu & 1))
			continue;
		while (last < 63 && cpus >> (last + 1) & 1)
			last++;
		used += (size_t)snprintf(text + used, DB_CPUS_TEXT_MAX - used, "%s%u",
		                         used > 0 ? "," : "", cpu);
		if (last > cpu)
			used += (size_t)snprintf(text + used, DB_CPUS_TEXT_MAX - used, "-%u", last);
		cpu = last;
	}
}

/* --- units ------------------------------------------------------------------------------------ */

#define UNIT_MIN 1u
#define UNIT_MAX 247u

bool db_text_units(const char *text, uint8_t units[DB_UNITS_SIZE])
{
	size_t length = strcspn(text, "-");
	char begin[8];
	unsigned first;
	unsigned last;

	if (snprintf(begin, sizeof(begin), "%.*s", (int)length, text) >= (int)sizeof(begin) ||
	    !db_text_number(begin, &first))
		return false;
	last = first;
	if (text[length] == '-' && !db_text_number(text + length + 1, &last))
		return false;
	if (first < UNIT_MIN || last > UNIT_MAX || last < first)
		return false;
	for (unsigned unit = first; unit <= last; unit++)
		units[unit / 8] |= (uint8_t)(1u << (unit % 8));
	return true;
}

static bool has_unit(const uint8_t units[DB_UNITS_SIZE], unsigned unit)
{
	return unit <= UNIT_MAX && (units[unit / 8] >> (unit % 8) & 1);
}

void db_text_of_units(const uint8_t units[DB_UNITS_SIZE], const char *quote,
                      char text[DB_UNITS_TEXT_MAX])
{
	size_t used = 0;

	text[0] = '\0';
	for (unsigned unit = UNIT_MIN; unit <= UNIT_MAX; unit++) {
		unsigned last = unit;
		int length;

		if (!has_unit(units, unit))
			continue;
		while (has_unit(units, last + 1))
			last++;
		length = snprintf(text + used, DB_UNITS_TEXT_MAX - used, "%s%s%u",
		                  used > 0 ? ", " : "", quote, unit);
		used += (size_t)length;
		length = last > unit ? snprintf(text + used, DB_UNITS_TEXT_MAX - used, "-%u%s",
		                                last, quote) :
		                       snprintf(text + used, DB_UNITS_TEXT_MAX - used, "%s", quote);
		used += (size_t)length;
		unit = last;
	}
}
