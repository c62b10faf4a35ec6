/* SPDX-License-Identifier: Apache-2.0 */
#include "certificates/pair.h"
#include "client/log.h"

#include <string.h>

/* A reason with the file that it is about. */
static void put_path(const char *path, char why[DB_CERTIFICATE_WHY])
{
	char text[DB_CERTIFICATE_WHY];

	snprintf(text, sizeof(text), "%s: %s", path, why);
	memcpy(why, text, sizeof(text));
}

enum db_certificate_state db_certificate_pair_load(struct db_certificate_pair *pair,
                                                   const char *certificate_path,
                                                   const char *key_path, int64_t now,
                                                   char why[DB_CERTIFICATE_WHY])
{
	enum db_certificate_state state = DB_CERTIFICATE_WRONG;

	*pair = (struct db_certificate_pair){ .facts = { .subject = "" } };
	why[0] = '\0';
	if (!db_certificate_file_read(&pair->certificate, certificate_path, why)) {
		put_path(certificate_path, why);
	} else if (!db_certificate_file_read(&pair->key, key_path, why)) {
		put_path(key_path, why);
	} else {
		state = db_certificate_check_pair(&pair->certificate, &pair->key, now, &pair->facts,
		                                  why);
		if (state != DB_CERTIFICATE_GOOD)
			put_path(certificate_path, why);
	}
	if (state != DB_CERTIFICATE_WRONG)
		db_certificate_expiry_set(&pair->expiry, pair->facts.ends);
	return state;
}

void db_certificate_pair_clear(struct db_certificate_pair *pair)
{
	db_certificate_file_clear(&pair->certificate);
	db_certificate_file_clear(&pair->key);
	*pair = (struct db_certificate_pair){ .facts = { .subject = "" } };
}

bool db_certificate_pair_check(const char *certificate_path, const char *key_path, int64_t now,
                               FILE *out)
{
	struct db_certificate_pair pair;
	char why[DB_CERTIFICATE_WHY];
	char date[DB_CERTIFICATE_DATE];
	enum db_certificate_state state = db_certificate_pair_load(&pair, certificate_path,
	                                                           key_path, now, why);

	db_certificate_write_date(pair.facts.ends, date);
	if (state != DB_CERTIFICATE_GOOD)
		fprintf(out, "%s\n", why);
	else if (pair.facts.ends - now <= DB_CERTIFICATE_SOON)
		fprintf(out, "%s: warning: the certificate ends on %s; renew it\n",
		        certificate_path, date);
	db_certificate_pair_clear(&pair);
	return state == DB_CERTIFICATE_GOOD;
}

bool db_certificate_pair_renew(struct db_certificate_pair *pair, const char *certificate_path,
                               const char *key_path, int64_t now, const char *used)
{
	struct db_certificate_pair next;
	char why[DB_CERTIFICATE_WHY];
	char date[DB_CERTIFICATE_DATE];
	bool good = db_certificate_pair_load(&next, certificate_path, key_path, now, why) ==
	            DB_CERTIFICATE_GOOD;
	bool same = db_certificate_file_equal(&pair->certificate, &next.certificate) &&
	            db_certificate_file_equal(&pair->key, &next.key);

	if (!good) {
		db_client_log(DB_CLIENT_ERROR, "%s; the certificate from before stays in use", why);
	} else if (same) {
		db_client_log(DB_CLIENT_NOTICE, "%s: the certificate is the same as before",
		              certificate_path);
	} else {
		db_certificate_write_date(next.facts.ends, date);
		db_client_log(DB_CLIENT_NOTICE,
		              "%s: the certificate of %s, valid until %s, was read; %s has it",
		              certificate_path, next.facts.subject, date, used);
		db_certificate_pair_clear(pair);
		*pair = next;
		return true;
	}
	db_certificate_pair_clear(&next);
	return false;
}

void db_certificate_pair_look(struct db_certificate_pair *pair, const char *certificate_path,
                              int64_t now)
{
	(void)db_certificate_expiry_look(&pair->expiry, certificate_path, now);
}
