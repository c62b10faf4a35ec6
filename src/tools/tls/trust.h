/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whom this gateway trusts, and how it shows itself: its certificate and key, the authorities and
 * their lists of revoked certificates, loaded from files into one object, which is replaced as a
 * whole. Times are seconds since 1970-01-01 UTC. One thread.
 */
#ifndef DRIVEBRIDGE_TLS_TRUST_H
#define DRIVEBRIDGE_TLS_TRUST_H

#include "codec/secure_hello.h"
#include "tls/config.h"

#include <gnutls/gnutls.h>
#include <gnutls/x509.h>

#define DB_TLS_WHY 512

/* The other files of this room read it, and change nothing. */
struct db_tls_trust {
	unsigned holders;
	gnutls_certificate_credentials_t credentials;
	gnutls_x509_trust_list_t authorities;
	int64_t expires;     /* end of its own certificate */
	int64_t crl_expires; /* when a newer list of revoked ones is due; 0: there is no list */
};

/* Null: a file is wrong; `why` says which, and what is wrong. Otherwise `doubt` says what peers may
 * refuse, or "". */
struct db_tls_trust *db_tls_trust_load(const struct db_tls_config *config, int64_t now,
                                       char why[DB_TLS_WHY], char doubt[DB_TLS_WHY]);
/* Sessions that use its credentials keep it. Null is fine. */
struct db_tls_trust *db_tls_trust_hold(struct db_tls_trust *trust);
void db_tls_trust_let_go(struct db_tls_trust *trust);

/*
 * Whether the client's certificate in this session is good now: signed by an authority, for
 * clients, in its time, not revoked. True: `client` is filled in but for its address and port.
 * Otherwise `why` says why not; `client` has its name, if it has any.
 */
bool db_tls_trust_verify(const struct db_tls_trust *trust, gnutls_session_t session,
                         struct db_secure_client *client, char why[DB_TLS_WHY]);

#endif
