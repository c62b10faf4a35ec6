/* SPDX-License-Identifier: Apache-2.0 */
#include "certificates/own.h"

#include <gnutls/crypto.h>
#include <gnutls/x509.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define KEY_BITS 2048
#define SERIAL_BYTES 16
#define KEY_ID_MAX 64
/* A client's clock may be behind. */
#define BEFORE ((int64_t)3600)

/* 0 or an error of the library. */
static int describe(gnutls_x509_crt_t certificate, gnutls_x509_privkey_t key,
                    const struct db_certificate_wish *wish, int64_t now)
{
	unsigned char serial[SERIAL_BYTES];
	unsigned char id[KEY_ID_MAX];
	size_t size = sizeof(id);
	int64_t ends = now + (int64_t)wish->days * 24 * 3600;
	int result = gnutls_rnd(GNUTLS_RND_NONCE, serial, sizeof(serial));

	/* Positive, and not shortened. */
	serial[0] = (unsigned char)((serial[0] & 0x7F) | 0x40);
	if (result == 0)
		result = gnutls_x509_crt_set_version(certificate, 3);
	if (result == 0)
		result = gnutls_x509_crt_set_serial(certificate, serial, sizeof(serial));
	if (result == 0)
		result = gnutls_x509_crt_set_activation_time(certificate, (time_t)(now - BEFORE));
	if (result == 0)
		result = gnutls_x509_crt_set_expiration_time(certificate, (time_t)ends);
	if (result == 0)
		result = gnutls_x509_crt_set_dn_by_oid(certificate, GNUTLS_OID_X520_COMMON_NAME, 0,
		                                       wish->name, (unsigned)strlen(wish->name));
	if (result == 0)
		result = gnutls_x509_crt_set_dn_by_oid(
			certificate, GNUTLS_OID_X520_ORGANIZATION_NAME, 0, wish->organization,
			(unsigned)strlen(wish->organization));
	if (result == 0)
		result = gnutls_x509_crt_set_subject_alt_name(
			certificate, GNUTLS_SAN_DNSNAME, wish->host, (unsigned)strlen(wish->host),
			GNUTLS_FSAN_SET);
	if (result == 0)
		result = gnutls_x509_crt_set_subject_alt_name(
			certificate, GNUTLS_SAN_URI, wish->uri, (unsigned)strlen(wish->uri),
			GNUTLS_FSAN_APPEND);
	if (result == 0)
		result = gnutls_x509_crt_set_key(certificate, key);
	if (result == 0)
		result = gnutls_x509_crt_set_basic_constraints(certificate, 0, -1);
	if (result == 0)
		result = gnutls_x509_crt_set_key_usage(
			certificate, GNUTLS_KEY_DIGITAL_SIGNATURE | GNUTLS_KEY_NON_REPUDIATION |
					     GNUTLS_KEY_KEY_ENCIPHERMENT |
					     GNUTLS_KEY_DATA_ENCIPHERMENT);
	if (result == 0)
		result = gnutls_x509_crt_set_key_purpose_oid(certificate, GNUTLS_KP_TLS_WWW_SERVER,
		                                             0);
	if (result == 0)
		result = gnutls_x509_crt_set_key_purpose_oid(certificate, GNUTLS_KP_TLS_WWW_CLIENT,
		                                             0);
	if (result == 0)
		result = gnutls_x509_crt_get_key_id(certificate, 0, id, &size);
	if (result == 0)
		result = gnutls_x509_crt_set_subject_key_id(certificate, id, size);
	if (result == 0)
		result = gnutls_x509_crt_set_authority_key_id(certificate, id, size);
	return result;
}

static bool keep(struct db_certificate_file *file, const gnutls_datum_t *datum)
{
	file->bytes = calloc(1, (size_t)datum->size + 1);
	if (!file->bytes)
		return false;
	memcpy(file->bytes, datum->data, datum->size);
	file->size = datum->size;
	return true;
}

bool db_certificate_make_own(const struct db_certificate_wish *wish, int64_t now,
                             struct db_certificate_file *certificate,
                             struct db_certificate_file *key, char why[DB_CERTIFICATE_WHY])
{
	gnutls_x509_privkey_t secret = NULL;
	gnutls_x509_crt_t made = NULL;
	gnutls_datum_t made_bytes = { .data = NULL };
	gnutls_datum_t secret_bytes = { .data = NULL };
	bool good;
	int result;

	*certificate = (struct db_certificate_file){ .bytes = NULL };
	*key = (struct db_certificate_file){ .bytes = NULL };
	result = gnutls_x509_privkey_init(&secret);
	if (result == 0)
		result = gnutls_x509_privkey_generate(secret, GNUTLS_PK_RSA, KEY_BITS, 0);
	if (result == 0)
		result = gnutls_x509_crt_init(&made);
	if (result == 0)
		result = describe(made, secret, wish, now);
	if (result == 0)
		result = gnutls_x509_crt_sign2(made, made, secret, GNUTLS_DIG_SHA256, 0);
	if (result == 0)
		result = gnutls_x509_crt_export2(made, GNUTLS_X509_FMT_DER, &made_bytes);
	if (result == 0)
		result = gnutls_x509_privkey_export2(secret, GNUTLS_X509_FMT_DER, &secret_bytes);
	good = result == 0 && keep(certificate, &made_bytes) && keep(key, &secret_bytes);
	if (!good)
		snprintf(why, DB_CERTIFICATE_WHY, "%s",
		         result != 0 ? gnutls_strerror(result) : "out of memory");
	if (secret_bytes.data)
		explicit_bzero(secret_bytes.data, secret_bytes.size);
	gnutls_free(secret_bytes.data);
	gnutls_free(made_bytes.data);
	if (made)
		gnutls_x509_crt_deinit(made);
	if (secret)
		gnutls_x509_privkey_deinit(secret);
	return good;
}
