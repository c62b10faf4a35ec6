/* SPDX-License-Identifier: Apache-2.0 */
#include "web/tls.h"
#include "client/clock.h"
#include "client/log.h"

#include <stdlib.h>

struct db_web_credentials {
	struct db_web_credentials *next; /* older */
	gnutls_certificate_credentials_t library;
	unsigned users; /* connections */
};

static void free_credentials(struct db_web_credentials *credentials)
{
	if (credentials->library)
		gnutls_certificate_free_credentials(credentials->library);
	free(credentials);
}

/* Makes the pair that which new connections get. */
static bool use_pair(struct db_web_tls *tls)
{
	const struct db_certificate_pair *pair = &tls->pair;
	gnutls_datum_t certificate = { .data = (unsigned char *)pair->certificate.bytes,
		                       .size = (unsigned)pair->certificate.size };
	gnutls_datum_t key = { .data = (unsigned char *)pair->key.bytes,
		               .size = (unsigned)pair->key.size };
	struct db_web_credentials *made = calloc(1, sizeof(*made));
	int result = GNUTLS_E_MEMORY_ERROR;

	if (made)
		result = gnutls_certificate_allocate_credentials(&made->library);
	if (result == 0)
		result = gnutls_certificate_set_x509_key_mem2(made->library, &certificate, &key,
		                                              GNUTLS_X509_FMT_PEM, NULL, 0);
	if (result < 0) {
		db_client_log(DB_CLIENT_ERROR, "%s cannot be used: %s",
		              tls->config->certificate_file, gnutls_strerror(result));
		if (made)
			free_credentials(made);
		return false;
	}
	made->next = tls->newest;
	tls->newest = made;
	return true;
}

struct db_web_tls *db_web_tls_new(const struct db_web_config *config)
{
	struct db_web_tls *tls = calloc(1, sizeof(*tls));
	char why[DB_CERTIFICATE_WHY] = "out of memory";
	enum db_certificate_state state = DB_CERTIFICATE_WRONG;

	if (tls) {
		tls->config = config;
		state = db_certificate_pair_load(&tls->pair, config->certificate_file,
		                                 config->key_file, db_client_wall_us() / 1000000,
		                                 why);
	}
	if (state == DB_CERTIFICATE_WRONG) {
		db_client_log(DB_CLIENT_ERROR, "%s", why);
	} else {
		/* A page with it is better than none, from which nothing can be stopped. */
		if (state == DB_CERTIFICATE_DOUBTFUL)
			db_client_log(DB_CLIENT_WARNING, "%s; browsers may refuse it", why);
		if (use_pair(tls))
			return tls;
	}
	db_web_tls_free(tls);
	return NULL;
}

void db_web_tls_free(struct db_web_tls *tls)
{
	if (!tls)
		return;
	while (tls->newest) {
		struct db_web_credentials *gone = tls->newest;

		tls->newest = gone->next;
		free_credentials(gone);
	}
	db_certificate_pair_clear(&tls->pair);
	free(tls);
}

void db_web_tls_reload(struct db_web_tls *tls)
{
	if (db_certificate_pair_renew(&tls->pair, tls->config->certificate_file,
	                              tls->config->key_file, db_client_wall_us() / 1000000,
	                              "each new connection"))
		(void)use_pair(tls);
}

struct db_web_credentials *db_web_tls_begin(struct db_web_tls *tls, gnutls_session_t session)
{
	if (gnutls_credentials_set(session, GNUTLS_CRD_CERTIFICATE, tls->newest->library) != 0)
		return NULL;
	tls->newest->users++;
	return tls->newest;
}

void db_web_tls_end(struct db_web_credentials *credentials)
{
	if (credentials)
		credentials->users--;
}

void db_web_tls_tick(struct db_web_tls *tls)
{
	struct db_web_credentials **at = &tls->newest->next;

	while (*at) {
		struct db_web_credentials *one = *at;

		if (one->users > 0) {
			at = &one->next;
			continue;
		}
		*at = one->next;
		free_credentials(one);
	}
	db_certificate_pair_look(&tls->pair, tls->config->certificate_file,
	                         db_client_wall_us() / 1000000);
}
