/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A certificate authority in a folder, for a plant that has none: its key, the certificates that it
 * has signed, and its list of revoked ones. Keys are P-256. Files that are there are not replaced
 * but where that is said. Times are seconds since 1970-01-01 UTC. Errors are printed. One process
 * at a time.
 *
 *	authority.pem, authority-key.pem   the authority
 *	server.pem, server-key.pem         the gateway's
 *	NAME.pem, NAME-key.pem             a client's
 *	revoked.pem                        the list of revoked certificates
 */
#ifndef DRIVEBRIDGE_AUTHORITY_AUTHORITY_H
#define DRIVEBRIDGE_AUTHORITY_AUTHORITY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DB_AUTHORITY_HOSTS_MAX 16

struct db_authority_request {
	const char *folder;
	/* Of the authority its name; of a client also the name of its files. */
	const char *name;
	const char *role;         /* of a client; null: none */
	const char *const *hosts; /* of a server: names and addresses that clients connect to */
	size_t host_count;
	int64_t begins;
	int64_t ends;
};

/* Makes the folder if need be, the authority, and a list that revokes nothing. */
bool db_authority_make(const struct db_authority_request *request);
/* Replaces the gateway's own certificate and key. */
bool db_authority_make_server(const struct db_authority_request *request);
bool db_authority_make_client(const struct db_authority_request *request);

/* Adds the client's certificate to the list of revoked ones, and signs that list again. Uses these
 * members of the request: the folder, the name, and `begins`, which is the present time. */
bool db_authority_revoke(const struct db_authority_request *request);

/* True if it can be the name of a client, and of its files: 1 to 64 of A-Z a-z 0-9 . _ - and none
 * of the names above. */
bool db_authority_is_name(const char *name);

#endif
