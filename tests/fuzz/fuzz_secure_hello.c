/* SPDX-License-Identifier: Apache-2.0 */
/* Any hello at the secure socket, and any value of a certificate's role: what is taken for one is written the same
 * again, and its texts are what others may show as they are. */
#include "codec/secure_hello.h"
#include "tls/role.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_text(const char *text, size_t most)
{
	size_t length = strnlen(text, most + 1);

	if (length > most)
		abort();
	for (size_t i = 0; i < length; i++) {
		if (text[i] < ' ' || text[i] > '~')
			abort();
	}
}

static void check_hello(const uint8_t bytes[DB_SECURE_HELLO_SIZE])
{
	struct db_secure_hello hello;
	uint8_t again[DB_SECURE_HELLO_SIZE];

	if (db_secure_hello_read(bytes, &hello) == DB_SECURE_WRONG)
		return;
	db_secure_hello_write(&hello, again);
	if (memcmp(bytes, again, sizeof(again)) != 0)
		abort();
	if (hello.kind != DB_SECURE_CLIENT)
		return;
	check_text(hello.client.name, DB_SECURE_NAME_MAX);
	check_text(hello.client.role, DB_SECURE_ROLE_MAX);
	if (hello.client.port == 0 || hello.client.serial_size > DB_SECURE_SERIAL_MAX ||
	    strchr(hello.client.name, ',') || strchr(hello.client.role, ' '))
		abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	uint8_t bytes[DB_SECURE_HELLO_SIZE] = { 0 };
	char role[DB_SECURE_ROLE_MAX + 1];

	memcpy(bytes, data, size < sizeof(bytes) ? size : sizeof(bytes));
	check_hello(bytes);
	if (db_tls_role_read(data, size, role)) {
		check_text(role, DB_SECURE_ROLE_MAX);
		if (strlen(role) != size - 2 || memcmp(role, data + 2, size - 2) != 0)
			abort();
	} else if (role[0] != '\0') {
		abort();
	}
	return 0;
}
