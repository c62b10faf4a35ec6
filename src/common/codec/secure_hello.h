/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What drivebridge-tls says at the secure socket of the service before it passes on a client's
 * Modbus: who the client is, after its certificate; and, over a connection of its own, how the
 * program itself is. Both have one fixed size. Pure; any thread.
 */
#ifndef DRIVEBRIDGE_CODEC_SECURE_HELLO_H
#define DRIVEBRIDGE_CODEC_SECURE_HELLO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DB_SECURE_HELLO_SIZE ((size_t)256)

#define DB_SECURE_FINGERPRINT_SIZE 32 /* SHA-256 of the certificate */
#define DB_SECURE_SERIAL_MAX 20
#define DB_SECURE_NAME_MAX 64
#define DB_SECURE_ROLE_MAX 32

/* A client whose certificate was verified. */
struct db_secure_client {
	uint8_t address[16]; /* IPv6, or IPv4 v4-mapped */
	uint16_t port;       /* not 0 */
	uint8_t fingerprint[DB_SECURE_FINGERPRINT_SIZE];
	int64_t expires; /* end of the certificate, s since 1970-01-01 UTC */
	uint8_t serial_size;
	uint8_t serial[DB_SECURE_SERIAL_MAX];
	/* Common name of the certificate: visible ASCII but commas, and spaces inside; "": it has
	 * none. */
	char name[DB_SECURE_NAME_MAX + 1];
	/* Visible ASCII, see db_secure_role_is_good(); "": it has none. */
	char role[DB_SECURE_ROLE_MAX + 1];
	/* 0: the client is connected. Otherwise it has closed its side, and its last bytes, which
	 * follow this hello at once, arrived this number of ms ago: they are carried out, but are
	 * no sign of life. */
	uint32_t waited_ms;
};

/* The program itself, now and since it began. */
struct db_secure_status {
	int64_t expires;        /* end of its own certificate, s since 1970-01-01 UTC */
	int64_t crl_expires;    /* when a newer list of revoked certificates is due; 0: none */
	int64_t client_expires; /* first end of a connected client's certificate; 0: none */
	uint32_t clients;       /* connected now */
	uint32_t greetings;     /* that have not ended, now */
	uint32_t accepted;      /* greetings that succeeded */
	uint32_t refused;       /* greetings that failed, or were not finished */
	uint32_t displaced;     /* greetings that gave way to newer ones */
};

enum db_secure_kind { DB_SECURE_WRONG, DB_SECURE_CLIENT, DB_SECURE_STATUS };

struct db_secure_hello {
	enum db_secure_kind kind;
	union {
		struct db_secure_client client;
		struct db_secure_status status;
	};
};

/* A role: 1 to 32 bytes of visible ASCII, no spaces. */
bool db_secure_role_is_good(const char *role);

/* `hello` is a client or a status whose texts follow the rules above. */
void db_secure_hello_write(const struct db_secure_hello *hello,
                           uint8_t bytes[DB_SECURE_HELLO_SIZE]);
/* WRONG for anything that db_secure_hello_write() does not write. */
enum db_secure_kind db_secure_hello_read(const uint8_t bytes[DB_SECURE_HELLO_SIZE],
                                         struct db_secure_hello *hello);

#endif
