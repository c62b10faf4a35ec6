/* SPDX-License-Identifier: Apache-2.0 */
#include "certificates/certificate.h"

#include <errno.h>
#include <gnutls/abstract.h>
#include <gnutls/x509.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

/* --- files ------------------------------------------------------------------------------------ */

bool db_certificate_file_read(struct db_certificate_file *file, const char *path,
                              char why[DB_CERTIFICATE_WHY])
{
	FILE *stream = fopen(path, "re");
	struct stat status;

	*file = (struct db_certificate_file){ .bytes = NULL };
	if (!stream || fstat(fileno(stream), &status) != 0) {
		snprintf(why, DB_CERTIFICATE_WHY, "%s", strerror(errno));
	} else if (!S_ISREG(status.st_mode) || status.st_size <= 0 ||
	           (uint64_t)status.st_size > DB_CERTIFICATE_FILE_MAX) {
		snprintf(why, DB_CERTIFICATE_WHY, "it is no file with a certificate or key in it");
	} else {
		file->bytes = calloc(1, (size_t)status.st_size + 1);
		file->size = file->bytes ? fread(file->bytes, 1, (size_t)status.st_size, stream) :
		                           0;
		if (file->size != (size_t)status.st_size) {
			db_certificate_file_clear(file);
			snprintf(why, DB_CERTIFICATE_WHY, "it cannot be read");
		}
	}
	if (stream)
		(void)fclose(stream);
	return file->bytes;
}

void db_certificate_file_clear(struct db_certificate_file *file)
{
	if (file->bytes)
		explicit_bzero(file->bytes, file->size);
	free(file->bytes);
	*file = (struct db_certificate_file){ .bytes = NULL };
}

bool db_certificate_file_equal(const struct db_certificate_file *one,
                               const struct db_certificate_file *other)
{
	return one->size == other->size &&
	       (one->size == 0 || memcmp(one->bytes, other->bytes, one->size) == 0);
}

static gnutls_datum_t datum_of(const struct db_certificate_file *file)
{
	return (gnutls_datum_t){ .data = (unsigned char *)file->bytes,
		                 .size = (unsigned)file->size };
}

static gnutls_x509_crt_fmt_t format_of(const struct db_certificate_file *file)
{
	return memmem(file->bytes, file->size, "-----BEGIN ", 11) ? GNUTLS_X509_FMT_PEM :
	                                                            GNUTLS_X509_FMT_DER;
}

/* --- what is in them -------------------------------------------------------------------------- */

struct list {
	gnutls_x509_crt_t *all;
	unsigned count;
};

static bool read_list(struct list *list, const struct db_certificate_file *file,
                      char why[DB_CERTIFICATE_WHY])
{
	gnutls_datum_t datum = datum_of(file);
	int result;

	*list = (struct list){ .all = NULL };
	result = gnutls_x509_crt_list_import2(&list->all, &list->count, &datum, format_of(file), 0);
	if (result >= 0 && list->count > 0)
		return true;
	snprintf(why, DB_CERTIFICATE_WHY, "it has no certificate that can be read: %s",
	         gnutls_strerror(result < 0 ? result : GNUTLS_E_NO_CERTIFICATE_FOUND));
	return false;
}

static void clear_list(struct list *list)
{
	for (unsigned i = 0; i < list->count; i++)
		gnutls_x509_crt_deinit(list->all[i]);
	gnutls_free(list->all);
}

static void write_name(gnutls_x509_crt_t certificate, char name[DB_CERTIFICATE_NAME])
{
	gnutls_datum_t text;

	name[0] = '\0';
	if (gnutls_x509_crt_get_dn3(certificate, &text, 0) != 0)
		return;
	snprintf(name, DB_CERTIFICATE_NAME, "%s", (const char *)text.data);
	gnutls_free(text.data);
}

void db_certificate_write_date(int64_t time, char text[DB_CERTIFICATE_DATE])
{
	time_t seconds = (time_t)time;
	struct tm parts;

	if (!gmtime_r(&seconds, &parts) ||
	    strftime(text, DB_CERTIFICATE_DATE, "%Y-%m-%d %H:%M UTC", &parts) == 0)
		snprintf(text, DB_CERTIFICATE_DATE, "%lld", (long long)time);
}

/* Fills in the facts. Whether all are valid now. */
static bool check_dates(const struct list *list, int64_t now, struct db_certificate_facts *facts,
                        char why[DB_CERTIFICATE_WHY])
{
	char name[DB_CERTIFICATE_NAME];
	char date[DB_CERTIFICATE_DATE];
	bool good = true;

	write_name(list->all[0], facts->subject);
	for (unsigned i = 0; i < list->count; i++) {
		int64_t begins = gnutls_x509_crt_get_activation_time(list->all[i]);
		int64_t ends = gnutls_x509_crt_get_expiration_time(list->all[i]);

		if (i == 0 || begins > facts->begins)
			facts->begins = begins;
		if (i == 0 || ends < facts->ends)
			facts->ends = ends;
		if (!good || (now >= begins && now < ends))
			continue;
		good = false;
		write_name(list->all[i], name);
		db_certificate_write_date(now < begins ? begins : ends, date);
		snprintf(why, DB_CERTIFICATE_WHY, "the certificate of %s %s %s", name,
		         now < begins ? "is not valid before" : "has ended on", date);
	}
	return good;
}

/* Whether each certificate is signed by the next one. */
static bool check_chain(const struct list *list, char why[DB_CERTIFICATE_WHY])
{
	char name[DB_CERTIFICATE_NAME];
	char next[DB_CERTIFICATE_NAME];

	for (unsigned i = 0; i + 1 < list->count; i++) {
		unsigned status = 0;

		/* The dates are looked at by themselves. */
		if (gnutls_x509_crt_verify(list->all[i], &list->all[i + 1], 1,
		                           GNUTLS_VERIFY_DISABLE_TIME_CHECKS |
		                                   GNUTLS_VERIFY_ALLOW_X509_V1_CA_CRT,
		                           &status) == 0 &&
		    status == 0)
			continue;
		write_name(list->all[i], name);
		write_name(list->all[i + 1], next);
		snprintf(why, DB_CERTIFICATE_WHY,
		         "the certificate of %s is not signed by the next one, that of %s", name,
		         next);
		return false;
	}
	return true;
}

/* Whether the private key is that of the certificate's public key. */
static bool check_key(gnutls_x509_crt_t certificate, const struct db_certificate_file *file,
                      char why[DB_CERTIFICATE_WHY])
{
	gnutls_datum_t datum = datum_of(file);
	gnutls_privkey_t key = NULL;
	gnutls_pubkey_t ours = NULL;
	gnutls_pubkey_t theirs = NULL;
	unsigned char one[64];
	unsigned char other[64] = { 0 };
	size_t one_size = sizeof(one);
	size_t other_size = sizeof(other);
	bool good = false;
	int result;

	result = gnutls_privkey_init(&key);
	if (result == 0)
		result = gnutls_privkey_import_x509_raw(key, &datum, format_of(file), NULL, 0);
	if (result != 0) {
		snprintf(why, DB_CERTIFICATE_WHY, "the key cannot be read: %s",
		         gnutls_strerror(result));
		goto end;
	}
	result = gnutls_pubkey_init(&ours);
	if (result == 0)
		result = gnutls_pubkey_init(&theirs);
	if (result == 0)
		result = gnutls_pubkey_import_privkey(ours, key, 0, 0);
	if (result == 0)
		result = gnutls_pubkey_import_x509(theirs, certificate, 0);
	if (result == 0)
		result = gnutls_pubkey_get_key_id(ours, GNUTLS_KEYID_USE_SHA256, one, &one_size);
	if (result == 0)
		result = gnutls_pubkey_get_key_id(theirs, GNUTLS_KEYID_USE_SHA256, other,
		                                  &other_size);
	good = result == 0 && one_size == other_size && memcmp(one, other, one_size) == 0;
	if (!good)
		snprintf(why, DB_CERTIFICATE_WHY, "the key does not belong to the certificate%s%s",
		         result != 0 ? ": " : "", result != 0 ? gnutls_strerror(result) : "");
end:
	gnutls_pubkey_deinit(theirs);
	gnutls_pubkey_deinit(ours);
	gnutls_privkey_deinit(key);
	return good;
}

enum db_certificate_state db_certificate_check_pair(const struct db_certificate_file *certificate,
                                                    const struct db_certificate_file *key,
                                                    int64_t now, struct db_certificate_facts *facts,
                                                    char why[DB_CERTIFICATE_WHY])
{
	enum db_certificate_state state = DB_CERTIFICATE_WRONG;
	struct list list;

	*facts = (struct db_certificate_facts){ .subject = "" };
	if (!read_list(&list, certificate, why))
		return DB_CERTIFICATE_WRONG;
	if (check_key(list.all[0], key, why))
		state = check_dates(&list, now, facts, why) && check_chain(&list, why) ?
		                DB_CERTIFICATE_GOOD :
		                DB_CERTIFICATE_DOUBTFUL;
	clear_list(&list);
	return state;
}

enum db_certificate_state db_certificate_check_server(const struct db_certificate_file *certificate,
                                                      char why[DB_CERTIFICATE_WHY])
{
	const char *missing = NULL;
	char name[DB_CERTIFICATE_NAME];
	unsigned usage = 0;
	struct list list;

	if (!read_list(&list, certificate, why))
		return DB_CERTIFICATE_WRONG;
	if (gnutls_x509_crt_check_key_purpose(list.all[0], GNUTLS_KP_TLS_WWW_SERVER, 0) == 0)
		missing = "server authentication (extended key usage)";
	else if (gnutls_x509_crt_get_key_usage(list.all[0], &usage, NULL) == 0 &&
	         (usage & GNUTLS_KEY_DIGITAL_SIGNATURE) == 0)
		missing = "digital signatures (key usage)";
	if (missing) {
		write_name(list.all[0], name);
		snprintf(why, DB_CERTIFICATE_WHY,
		         "the certificate of %s is not for %s: clients refuse it", name, missing);
	}
	clear_list(&list);
	return missing ? DB_CERTIFICATE_DOUBTFUL : DB_CERTIFICATE_GOOD;
}

enum db_certificate_state db_certificate_check_list(const struct db_certificate_file *file,
                                                    int64_t now, struct db_certificate_facts *facts,
                                                    char why[DB_CERTIFICATE_WHY])
{
	bool valid = false;
	struct list list;

	*facts = (struct db_certificate_facts){ .subject = "" };
	if (!read_list(&list, file, why))
		return DB_CERTIFICATE_WRONG;
	write_name(list.all[0], facts->subject);
	for (unsigned i = 0; i < list.count; i++) {
		int64_t begins = gnutls_x509_crt_get_activation_time(list.all[i]);
		int64_t ends = gnutls_x509_crt_get_expiration_time(list.all[i]);

		valid = valid || (now >= begins && now < ends);
		if (i == 0 || begins < facts->begins)
			facts->begins = begins;
		if (i == 0 || ends > facts->ends)
			facts->ends = ends;
	}
	if (!valid)
		snprintf(why, DB_CERTIFICATE_WHY, "none of its certificates is valid now");
	clear_list(&list);
	return valid ? DB_CERTIFICATE_GOOD : DB_CERTIFICATE_DOUBTFUL;
}
