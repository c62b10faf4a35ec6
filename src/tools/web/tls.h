/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The certificate that browsers get: each connection keeps the one that it began with, new ones
 * have the newest. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_TLS_H
#define DRIVEBRIDGE_WEB_TLS_H

#include "certificates/pair.h"
#include "web/config.h"

#include <gnutls/gnutls.h>

/* What one connection or more have; belongs to struct db_web_tls. */
struct db_web_credentials;

/* The other files of this room read `pair`, and change nothing. */
struct db_web_tls {
	const struct db_web_config *config;
	struct db_certificate_pair pair; /* for the library at its start; valid until a reload */
	struct db_web_credentials *newest;
};

/* TLS 1.2 and 1.3, with forward secrecy and authenticated encryption. */
#define DB_WEB_TLS_PRIORITIES \
	"SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2:-RSA:-SHA1:-AES-128-CBC:-AES-256-CBC"

/* The configuration has a certificate, and stays valid. NULL: it cannot be used, and the log has
 * the reason. Freed with db_web_tls_free() when no connection is left; NULL is allowed. */
struct db_web_tls *db_web_tls_new(const struct db_web_config *config);
void db_web_tls_free(struct db_web_tls *tls);

/* Reads the files again; if they are not good, what was before stays in use. Logs it. */
void db_web_tls_reload(struct db_web_tls *tls);

/* Gives a new connection the newest certificate, before its greeting. To be given back when it is
 * closed. NULL: without memory; it has the one of the start. */
struct db_web_credentials *db_web_tls_begin(struct db_web_tls *tls, gnutls_session_t session);
void db_web_tls_end(struct db_web_credentials *credentials);

/* To be called now and then: frees what no connection has any more, and says that a certificate
 * ends. */
void db_web_tls_tick(struct db_web_tls *tls);

#endif
