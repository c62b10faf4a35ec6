/* SPDX-License-Identifier: Apache-2.0 */
#include "tls/trust.h"

#include "certificates/certificate.h"
#include "tls/role.h"

#include <gnutls/x509.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHAIN_MAX 8

/* A newer list of revoked certificates is due, or this one is of a clock that is ahead of ours:
 * what it revokes is revoked, and a plant does not stand still for it. */
#define UNTIMELY \
	(GNUTLS_CERT_REVOCATION_DATA_SUPERSEDED | GNUTLS_CERT_REVOCATION_DATA_ISSUED_IN_FUTURE)

/* --- loading ---------------------------------------------------------------------------------- */

/* A file in the form of the library; it is the file's memory. */
static gnutls_datum_t datum_of(const struct db_certificate_file *file)
{
	return (gnutls_datum_t){ .data = (unsigned char *)file->bytes,
		                 .size = (unsigned)file->size };
}

static bool read_file(struct db_certificate_file *file, const char *key, const char *path,
                      char why[DB_TLS_WHY])
{
	char reason[DB_CERTIFICATE_WHY];

	if (db_certificate_file_read(file, path, reason))
		return true;
	snprintf(why, DB_TLS_WHY, "%s = %s: %s", key, path, reason);
	return false;
}

static bool load_own(struct db_tls_trust *trust, const struct db_tls_config *config, int64_t now,
                     char why[DB_TLS_WHY], char doubt[DB_TLS_WHY])
{
	struct db_certificate_file certificate = { .bytes = NULL };
	struct db_certificate_file key = { .bytes = NULL };
	struct db_certificate_facts facts = { .ends = 0 };
	char reason[DB_CERTIFICATE_WHY] = "";
	enum db_certificate_state state;
	gnutls_datum_t certificate_datum;
	gnutls_datum_t key_datum;
	bool good = false;
	int result;

	if (!read_file(&certificate, "certificate-file", config->certificate_file, why) ||
	    !read_file(&key, "key-file", config->key_file, why))
		goto end;
	state = db_certificate_check_pair(&certificate, &key, now, &facts, reason);
	if (state == DB_CERTIFICATE_GOOD)
		state = db_certificate_check_server(&certificate, reason);
	switch (state) {
	case DB_CERTIFICATE_WRONG:
		snprintf(why, DB_TLS_WHY, "certificate-file = %s: %s", config->certificate_file,
		         reason);
		goto end;
	case DB_CERTIFICATE_DOUBTFUL:
		snprintf(doubt, DB_TLS_WHY, "certificate-file = %s: %s", config->certificate_file,
		         reason);
		break;
	case DB_CERTIFICATE_GOOD:
		break;
	}
	trust->expires = facts.ends;
	certificate_datum = datum_of(&certificate);
	key_datum = datum_of(&key);
	result = gnutls_certificate_set_x509_key_mem(trust->credentials, &certificate_datum,
	                                             &key_datum, GNUTLS_X509_FMT_PEM);
	good = result >= 0;
	if (!good)
		snprintf(why, DB_TLS_WHY, "certificate-file = %s: %s", config->certificate_file,
		         gnutls_strerror(result));
end:
	db_certificate_file_clear(&certificate);
	db_certificate_file_clear(&key);
	return good;
}

static bool load_authorities(struct db_tls_trust *trust, const struct db_tls_config *config,
                             int64_t now, char why[DB_TLS_WHY])
{
	struct db_certificate_file file;
	struct db_certificate_facts facts;
	char reason[DB_CERTIFICATE_WHY];
	gnutls_datum_t datum;
	int count;

	if (!read_file(&file, "ca-file", config->ca_file, why))
		return false;
	datum = datum_of(&file);
	if (db_certificate_check_list(&file, now, &facts, reason) == DB_CERTIFICATE_WRONG) {
		snprintf(why, DB_TLS_WHY, "ca-file = %s: %s", config->ca_file, reason);
		db_certificate_file_clear(&file);
		return false;
	}
	count = gnutls_x509_trust_list_add_trust_mem(trust->authorities, &datum, NULL,
	                                             GNUTLS_X509_FMT_PEM, 0, 0);
	/* Their names are told to clients, which choose a certificate by them. */
	if (count > 0)
		count = gnutls_certificate_set_x509_trust_mem(trust->credentials, &datum,
		                                              GNUTLS_X509_FMT_PEM);
	db_certificate_file_clear(&file);
	if (count <= 0)
		snprintf(why, DB_TLS_WHY, "ca-file = %s: %s", config->ca_file,
		         gnutls_strerror(count < 0 ? count : GNUTLS_E_NO_CERTIFICATE_FOUND));
	return count > 0;
}

/* Whether nothing was found in a verification but, perhaps, an untimely list. */
static bool is_good(unsigned status)
{
	/* "Invalid" comes with every other one. */
	return status == 0 ||
	       ((status & UNTIMELY) && (status | UNTIMELY) == (UNTIMELY | GNUTLS_CERT_INVALID));
}

/* Whether every list is signed by one of the authorities, timely or not. */
static bool are_signed(const char *ca_file, gnutls_x509_crl_t *lists, unsigned count)
{
	char reason[DB_CERTIFICATE_WHY];
	struct db_certificate_file file;
	gnutls_x509_crt_t *authorities = NULL;
	unsigned authority_count = 0;
	gnutls_datum_t datum;
	bool good;

	if (!db_certificate_file_read(&file, ca_file, reason))
		return false;
	datum = datum_of(&file);
	good = gnutls_x509_crt_list_import2(&authorities, &authority_count, &datum,
	                                    GNUTLS_X509_FMT_PEM, 0) >= 0;
	db_certificate_file_clear(&file);
	for (unsigned i = 0; good && i < count; i++) {
		unsigned status = 1;

		good = gnutls_x509_crl_verify(lists[i], authorities, authority_count,
		                              GNUTLS_VERIFY_DISABLE_TIME_CHECKS, &status) >= 0 &&
		       is_good(status);
	}
	for (unsigned i = 0; i < authority_count; i++)
		gnutls_x509_crt_deinit(authorities[i]);
	gnutls_free(authorities);
	return good;
}

static bool load_crls(struct db_tls_trust *trust, const struct db_tls_config *config,
                      char why[DB_TLS_WHY])
{
	struct db_certificate_file file;
	gnutls_x509_crl_t *lists = NULL;
	gnutls_datum_t datum;
	unsigned count = 0;
	int result;

	if (config->crl_file[0] == '\0')
		return true;
	if (!read_file(&file, "crl-file", config->crl_file, why))
		return false;
	datum = datum_of(&file);
	result = gnutls_x509_crl_list_import2(&lists, &count, &datum, GNUTLS_X509_FMT_PEM, 0);
	db_certificate_file_clear(&file);
	for (unsigned i = 0; i < count; i++) {
		int64_t due = gnutls_x509_crl_get_next_update(lists[i]);

		if (due > 0 && (trust->crl_expires == 0 || due < trust->crl_expires))
			trust->crl_expires = due;
	}
	/* It takes the lists over. */
	if (result >= 0 && are_signed(config->ca_file, lists, count))
		result = gnutls_x509_trust_list_add_crls(trust->authorities, lists, count, 0, 0);
	else
		for (unsigned i = 0; i < count; i++)
			gnutls_x509_crl_deinit(lists[i]);
	gnutls_free(lists);
	if (result >= 0 && (unsigned)result == count && count > 0)
		return true;
	snprintf(why, DB_TLS_WHY, "crl-file = %s: %s", config->crl_file,
	         result < 0 ? gnutls_strerror(result) :
	         count == 0 ? "it has no list of revoked certificates" :
	                      "a list in it is not signed by an authority of ca-file");
	return false;
}

struct db_tls_trust *db_tls_trust_load(const struct db_tls_config *config, int64_t now,
                                       char why[DB_TLS_WHY], char doubt[DB_TLS_WHY])
{
	struct db_tls_trust *trust = calloc(1, sizeof(*trust));

	doubt[0] = '\0';
	snprintf(why, DB_TLS_WHY, "out of memory");
	if (!trust)
		return NULL;
	trust->holders = 1;
	if (gnutls_certificate_allocate_credentials(&trust->credentials) == 0 &&
	    gnutls_x509_trust_list_init(&trust->authorities, 0) == 0 &&
	    load_own(trust, config, now, why, doubt) && load_authorities(trust, config, now, why) &&
	    load_crls(trust, config, why))
		return trust;
	db_tls_trust_let_go(trust);
	return NULL;
}

struct db_tls_trust *db_tls_trust_hold(struct db_tls_trust *trust)
{
	trust->holders++;
	return trust;
}

void db_tls_trust_let_go(struct db_tls_trust *trust)
{
	if (!trust || --trust->holders > 0)
		return;
	if (trust->credentials)
		gnutls_certificate_free_credentials(trust->credentials);
	if (trust->authorities)
		gnutls_x509_trust_list_deinit(trust->authorities, 1);
	free(trust);
}

/* --- a client's certificate ------------------------------------------------------------------- */

/* Bytes that are not visible, and commas, become question marks. */
static void read_name(gnutls_x509_crt_t certificate, char name[DB_SECURE_NAME_MAX + 1])
{
	char whole[256];
	size_t size = sizeof(whole);
	size_t length;

	name[0] = '\0';
	if (gnutls_x509_crt_get_dn_by_oid(certificate, GNUTLS_OID_X520_COMMON_NAME, 0, 0, whole,
	                                  &size) != 0)
		return;
	length = strnlen(whole, DB_SECURE_NAME_MAX);
	for (size_t i = 0; i < length; i++) {
		bool space = whole[i] == ' ' && i > 0 && i < length - 1;

		name[i] = (whole[i] > ' ' && whole[i] <= '~' && whole[i] != ',') || space ?
		                  whole[i] :
		                  '?';
	}
	name[length] = '\0';
}

/* "" unless there is exactly one extension, and a role in it. */
static void read_role(gnutls_x509_crt_t certificate, char role[DB_SECURE_ROLE_MAX + 1])
{
	gnutls_datum_t first = { .data = NULL };
	gnutls_datum_t second = { .data = NULL };
	unsigned critical;

	role[0] = '\0';
	if (gnutls_x509_crt_get_extension_by_oid2(certificate, DB_TLS_ROLE_OID, 0, &first,
	                                          &critical) != 0)
		return;
	if (gnutls_x509_crt_get_extension_by_oid2(certificate, DB_TLS_ROLE_OID, 1, &second,
	                                          &critical) != 0)
		(void)db_tls_role_read(first.data, first.size, role);
	gnutls_free(first.data);
	gnutls_free(second.data);
}

static bool read_client(gnutls_x509_crt_t certificate, struct db_secure_client *client)
{
	size_t size = sizeof(client->fingerprint);
	size_t serial_size = sizeof(client->serial);

	read_name(certificate, client->name);
	read_role(certificate, client->role);
	client->expires = gnutls_x509_crt_get_expiration_time(certificate);
	if (gnutls_x509_crt_get_serial(certificate, client->serial, &serial_size) != 0)
		return false;
	client->serial_size = (uint8_t)serial_size;
	return gnutls_x509_crt_get_fingerprint(certificate, GNUTLS_DIG_SHA256, client->fingerprint,
	                                       &size) == 0;
}

static bool verify_chain(const struct db_tls_trust *trust, gnutls_x509_crt_t *chain, unsigned count,
                         char why[DB_TLS_WHY])
{
	char purpose[] = GNUTLS_KP_TLS_WWW_CLIENT;
	gnutls_typed_vdata_st usage = { .type = GNUTLS_DT_KEY_PURPOSE_OID,
		                        .data = (unsigned char *)purpose };
	unsigned status = 0;
	gnutls_datum_t text;
	int result;

	result = gnutls_x509_trust_list_verify_crt2(trust->authorities, chain, count, &usage, 1, 0,
	                                            &status, NULL);
	if (result < 0) {
		snprintf(why, DB_TLS_WHY, "%s", gnutls_strerror(result));
		return false;
	}
	if (is_good(status))
		return true;
	if (gnutls_certificate_verification_status_print(status, GNUTLS_CRT_X509, &text, 0) != 0)
		return false;
	snprintf(why, DB_TLS_WHY, "%s", (const char *)text.data);
	gnutls_free(text.data);
	return false;
}

bool db_tls_trust_verify(const struct db_tls_trust *trust, gnutls_session_t session,
                         struct db_secure_client *client, char why[DB_TLS_WHY])
{
	gnutls_x509_crt_t chain[CHAIN_MAX];
	unsigned count = 0;
	unsigned sent = 0;
	const gnutls_datum_t *list = gnutls_certificate_get_peers(session, &sent);
	bool good = list && sent > 0 && sent <= CHAIN_MAX;

	snprintf(why, DB_TLS_WHY, "it has no certificate, or too long a chain");
	*client = (struct db_secure_client){ .port = 0 };
	while (good && count < sent) {
		good = gnutls_x509_crt_init(&chain[count]) == 0;
		if (!good)
			break;
		good = gnutls_x509_crt_import(chain[count], &list[count], GNUTLS_X509_FMT_DER) == 0;
		count++;
	}
	if (good) {
		snprintf(why, DB_TLS_WHY, "its certificate cannot be read");
		good = read_client(chain[0], client) && verify_chain(trust, chain, count, why);
	}
	for (unsigned i = 0; i < count; i++)
		gnutls_x509_crt_deinit(chain[i]);
	return good;
}
