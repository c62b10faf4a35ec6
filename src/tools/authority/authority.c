/* SPDX-License-Identifier: Apache-2.0 */
#include "authority/authority.h"

#include "authority/files.h"
#include "certificates/certificate.h"

#include <arpa/inet.h>
#include <errno.h>
#include <gnutls/abstract.h>
#include <gnutls/crypto.h>
#include <gnutls/x509-ext.h>
#include <gnutls/x509.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define ROLE_OID "1.3.6.1.4.1.50316.802.1"
#define ROLE_MAX 32
#define UTF8_STRING 0x0C
#define NAME_MAX_LENGTH 64
#define SERIAL_SIZE 16
/* The list need not be renewed: it is made anew with each revocation. */
#define CRL_TIME ((int64_t)20 * 366 * 24 * 3600)

/* A certificate and its key. All 0: none. */
struct pair {
	gnutls_x509_crt_t certificate;
	gnutls_x509_privkey_t key;
};

static bool fail(const char *what, int result)
{
	fprintf(stderr, "%s: %s\n", what, gnutls_strerror(result));
	return false;
}

static void clear_pair(struct pair *pair)
{
	if (pair->certificate)
		gnutls_x509_crt_deinit(pair->certificate);
	if (pair->key)
		gnutls_x509_privkey_deinit(pair->key);
	*pair = (struct pair){ .key = NULL };
}

bool db_authority_is_name(const char *name)
{
	static const char allowed[] =
		"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
	static const char *const taken[] = { "authority", "server", "revoked" };
	size_t length = strspn(name, allowed);

	for (size_t i = 0; i < sizeof(taken) / sizeof(taken[0]); i++) {
		if (strcmp(name, taken[i]) == 0)
			return false;
	}
	/* The file of one client's certificate is not another one's key. */
	return length > 0 && length <= NAME_MAX_LENGTH && name[length] == '\0' && name[0] != '.' &&
	       name[0] != '-' && !(length >= 4 && strcmp(name + length - 4, "-key") == 0);
}

/* --- certificates ----------------------------------------------------------------------------- */

/* A new key, and a certificate with what all have in common. */
static int begin_pair(struct pair *pair, const struct db_authority_request *request)
{
	unsigned char serial[SERIAL_SIZE] = { 0 };
	unsigned char id[20];
	size_t id_size = sizeof(id);
	gnutls_x509_crt_t crt;
	int result = gnutls_x509_privkey_init(&pair->key);

	if (result == 0)
		result = gnutls_x509_privkey_generate(
			pair->key, GNUTLS_PK_ECDSA,
			GNUTLS_CURVE_TO_BITS(GNUTLS_ECC_CURVE_SECP256R1), 0);
	if (result == 0)
		result = gnutls_x509_crt_init(&pair->certificate);
	if (result == 0)
		result = gnutls_rnd(GNUTLS_RND_NONCE, serial, sizeof(serial));
	if (result < 0)
		return result;
	/* Positive, and as long as it is. */
	serial[0] = (unsigned char)((serial[0] & 0x7F) | 0x40);
	crt = pair->certificate;
	result = gnutls_x509_crt_set_version(crt, 3);
	if (result == 0)
		result = gnutls_x509_crt_set_serial(crt, serial, sizeof(serial));
	if (result == 0)
		result = gnutls_x509_crt_set_activation_time(crt, (time_t)request->begins);
	if (result == 0)
		result = gnutls_x509_crt_set_expiration_time(crt, (time_t)request->ends);
	if (result == 0)
		result = gnutls_x509_crt_set_dn_by_oid(crt, GNUTLS_OID_X520_COMMON_NAME, 0,
		                                       request->name,
		                                       (unsigned)strlen(request->name));
	if (result == 0)
		result = gnutls_x509_crt_set_key(crt, pair->key);
	if (result == 0)
		result = gnutls_x509_crt_get_key_id(crt, GNUTLS_KEYID_USE_SHA1, id, &id_size);
	if (result == 0)
		result = gnutls_x509_crt_set_subject_key_id(crt, id, id_size);
	return result;
}

static int add_hosts(gnutls_x509_crt_t crt, const struct db_authority_request *request)
{
	int result = 0;

	for (size_t i = 0; i < request->host_count && result == 0; i++) {
		const char *host = request->hosts[i];
		unsigned char bytes[16];
		unsigned size = inet_pton(AF_INET, host, bytes) == 1  ? 4 :
		                inet_pton(AF_INET6, host, bytes) == 1 ? 16 :
		                                                        0;

		result = size > 0 ?
		                 gnutls_x509_crt_set_subject_alt_name(crt, GNUTLS_SAN_IPADDRESS,
		                                                      bytes, size,
		                                                      GNUTLS_FSAN_APPEND) :
		                 gnutls_x509_crt_set_subject_alt_name(crt, GNUTLS_SAN_DNSNAME, host,
		                                                      (unsigned)strlen(host),
		                                                      GNUTLS_FSAN_APPEND);
	}
	return result;
}

/* Signed by the issuer, or by itself. */
static int sign(const struct pair *pair, const struct pair *issuer)
{
	unsigned char id[32];
	size_t id_size = sizeof(id);
	int result = gnutls_x509_crt_get_subject_key_id(issuer->certificate, id, &id_size, NULL);

	if (result == 0)
		result = gnutls_x509_crt_set_authority_key_id(pair->certificate, id, id_size);
	return result < 0 ? result :
	                    gnutls_x509_crt_sign2(pair->certificate, issuer->certificate,
	                                          issuer->key, GNUTLS_DIG_SHA256, 0);
}

/* --- files of them ---------------------------------------------------------------------------- */

static bool write_pair(const struct pair *pair, const struct db_authority_request *request,
                       const char *name, const char *group, bool replace)
{
	gnutls_datum_t certificate = { .data = NULL };
	gnutls_datum_t key = { .data = NULL };
	char key_name[NAME_MAX_LENGTH + 8];
	bool good = false;
	int result = gnutls_x509_crt_export2(pair->certificate, GNUTLS_X509_FMT_PEM, &certificate);

	if (result == 0)
		result = gnutls_x509_privkey_export2_pkcs8(pair->key, GNUTLS_X509_FMT_PEM, NULL,
		                                           GNUTLS_PKCS_PLAIN, &key);
	snprintf(key_name, sizeof(key_name), "%s-key", name);
	if (result < 0)
		(void)fail(name, result);
	else
		/* The key first: a certificate without its key is of no use. */
		good = db_authority_write(request->folder, key_name,
		                          &(struct db_authority_text){ key.data, key.size, group },
		                          replace) &&
		       db_authority_write(request->folder, name,
		                          &(struct db_authority_text){ certificate.data,
		                                                       certificate.size, NULL },
		                          replace);
	gnutls_free(certificate.data);
	if (key.data)
		gnutls_memset(key.data, 0, key.size);
	gnutls_free(key.data);
	return good;
}

static bool read_certificate(gnutls_x509_crt_t *certificate, const char *folder, const char *name)
{
	struct db_certificate_file file;
	gnutls_datum_t datum;
	int result;

	if (!db_authority_read(folder, name, &file))
		return false;
	datum = (gnutls_datum_t){ (unsigned char *)file.bytes, (unsigned)file.size };
	result = gnutls_x509_crt_init(certificate);
	if (result == 0)
		result = gnutls_x509_crt_import(*certificate, &datum, GNUTLS_X509_FMT_PEM);
	db_certificate_file_clear(&file);
	return result == 0 || fail(name, result);
}

static bool read_authority(struct pair *authority, const char *folder)
{
	struct db_certificate_file file;
	gnutls_datum_t datum;
	int result;

	*authority = (struct pair){ .key = NULL };
	if (!read_certificate(&authority->certificate, folder, "authority") ||
	    !db_authority_read(folder, "authority-key", &file))
		return false;
	datum = (gnutls_datum_t){ (unsigned char *)file.bytes, (unsigned)file.size };
	result = gnutls_x509_privkey_init(&authority->key);
	if (result == 0)
		result = gnutls_x509_privkey_import(authority->key, &datum, GNUTLS_X509_FMT_PEM);
	db_certificate_file_clear(&file);
	return result == 0 || fail("authority-key", result);
}

/* --- the list of revoked ones ----------------------------------------------------------------- */

static bool write_list(const struct pair *authority, const char *folder, gnutls_x509_crl_t list,
                       int64_t now)
{
	unsigned char number[8];
	unsigned char id[32];
	size_t id_size = sizeof(id);
	gnutls_datum_t text = { .data = NULL };
	bool good;
	int result;

	for (unsigned i = 0; i < sizeof(number); i++)
		number[i] = (unsigned char)((uint64_t)now >> 8 * (sizeof(number) - 1 - i));
	result = gnutls_x509_crl_set_version(list, 2);
	if (result == 0)
		result = gnutls_x509_crl_set_this_update(list, (time_t)now);
	if (result == 0)
		result = gnutls_x509_crl_set_next_update(list, (time_t)(now + CRL_TIME));
	if (result == 0)
		result = gnutls_x509_crl_set_number(list, number, sizeof(number));
	if (result == 0)
		result = gnutls_x509_crt_get_subject_key_id(authority->certificate, id, &id_size,
		                                            NULL);
	if (result == 0)
		result = gnutls_x509_crl_set_authority_key_id(list, id, id_size);
	if (result == 0)
		result = gnutls_x509_crl_sign2(list, authority->certificate, authority->key,
		                               GNUTLS_DIG_SHA256, 0);
	if (result == 0)
		result = gnutls_x509_crl_export2(list, GNUTLS_X509_FMT_PEM, &text);
	if (result < 0)
		return fail("revoked", result);
	good = db_authority_write(folder, "revoked",
	                          &(struct db_authority_text){ text.data, text.size, NULL }, true);
	gnutls_free(text.data);
	return good;
}

/* The entries of the list that there is, in a new one: a signed list is not changed. */
static int copy_entries(gnutls_x509_crl_t list, const struct db_certificate_file *file)
{
	gnutls_datum_t datum = { (unsigned char *)file->bytes, (unsigned)file->size };
	gnutls_x509_crl_t old = NULL;
	int result = gnutls_x509_crl_init(&old);
	int count = 0;

	if (result == 0)
		result = gnutls_x509_crl_import(old, &datum, GNUTLS_X509_FMT_PEM);
	if (result == 0)
		count = gnutls_x509_crl_get_crt_count(old);
	for (int i = 0; i < count && result == 0; i++) {
		unsigned char serial[64];
		size_t size = sizeof(serial);
		time_t since;

		result = gnutls_x509_crl_get_crt_serial(old, (unsigned)i, serial, &size, &since);
		if (result == 0)
			result = gnutls_x509_crl_set_crt_serial(list, serial, size, since);
	}
	if (old)
		gnutls_x509_crl_deinit(old);
	return result;
}

/* --- what people ask for ---------------------------------------------------------------------- */

bool db_authority_make(const struct db_authority_request *request)
{
	struct pair pair = { .key = NULL };
	gnutls_x509_crl_t list = NULL;
	bool good = false;
	int result;

	if (mkdir(request->folder, 0755) != 0 && errno != EEXIST) {
		fprintf(stderr, "%s: %s\n", request->folder, strerror(errno));
		return false;
	}
	result = begin_pair(&pair, request);
	if (result == 0)
		result = gnutls_x509_crt_set_basic_constraints(pair.certificate, 1, 0);
	if (result == 0)
		result = gnutls_x509_crt_set_key_usage(
			pair.certificate, GNUTLS_KEY_KEY_CERT_SIGN | GNUTLS_KEY_CRL_SIGN);
	if (result == 0)
		result = sign(&pair, &pair);
	if (result == 0)
		result = gnutls_x509_crl_init(&list);
	if (result < 0)
		(void)fail("authority", result);
	else
		good = write_pair(&pair, request, "authority", "", false) &&
		       write_list(&pair, request->folder, list, request->begins);
	if (list)
		gnutls_x509_crl_deinit(list);
	clear_pair(&pair);
	return good;
}

/* A certificate for one end of connections. */
static bool issue(const struct db_authority_request *request, const char *purpose,
                  const char *file_name, const char *group, bool replace)
{
	struct pair authority;
	struct pair pair = { .key = NULL };
	unsigned char role[2 + ROLE_MAX] = { UTF8_STRING };
	size_t length = request->role ? strlen(request->role) : 0;
	bool good = false;
	int result;

	if (!read_authority(&authority, request->folder))
		goto end;
	result = begin_pair(&pair, request);
	if (result == 0)
		result = gnutls_x509_crt_set_basic_constraints(pair.certificate, 0, -1);
	if (result == 0)
		result = gnutls_x509_crt_set_key_usage(pair.certificate,
		                                       GNUTLS_KEY_DIGITAL_SIGNATURE);
	if (result == 0)
		result = gnutls_x509_crt_set_key_purpose_oid(pair.certificate, purpose, 0);
	if (result == 0)
		result = add_hosts(pair.certificate, request);
	if (result == 0 && request->role) {
		role[1] = (unsigned char)length;
		// NOLINTNEXTLINE(bugprone-not-null-terminated-result) ; a length stands before it
		memcpy(role + 2, request->role, length);
		result = gnutls_x509_crt_set_extension_by_oid(pair.certificate, ROLE_OID, role,
		                                              2 + length, 0);
	}
	if (result == 0)
		result = sign(&pair, &authority);
	good = result < 0 ? fail(request->name, result) :
	                    write_pair(&pair, request, file_name, group, replace);
end:
	clear_pair(&pair);
	clear_pair(&authority);
	return good;
}

bool db_authority_make_server(const struct db_authority_request *request)
{
	return issue(request, GNUTLS_KP_TLS_WWW_SERVER, "server", "drivebridge-tls", true);
}

bool db_authority_make_client(const struct db_authority_request *request)
{
	return issue(request, GNUTLS_KP_TLS_WWW_CLIENT, request->name, "", false);
}

bool db_authority_revoke(const struct db_authority_request *request)
{
	struct pair authority = { .key = NULL };
	gnutls_x509_crt_t certificate = NULL;
	struct db_certificate_file file = { .bytes = NULL };
	gnutls_x509_crl_t list = NULL;
	bool good = false;
	int result;

	if (!read_authority(&authority, request->folder) ||
	    !read_certificate(&certificate, request->folder, request->name) ||
	    !db_authority_read(request->folder, "revoked", &file))
		goto end;
	result = gnutls_x509_crl_init(&list);
	if (result == 0)
		result = copy_entries(list, &file);
	if (result == 0)
		result = gnutls_x509_crl_set_crt(list, certificate, (time_t)request->begins);
	good = result < 0 ? fail("revoked", result) :
	                    write_list(&authority, request->folder, list, request->begins);
end:
	if (list)
		gnutls_x509_crl_deinit(list);
	if (certificate)
		gnutls_x509_crt_deinit(certificate);
	db_certificate_file_clear(&file);
	clear_pair(&authority);
	return good;
}
