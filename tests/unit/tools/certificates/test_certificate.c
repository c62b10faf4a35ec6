/* SPDX-License-Identifier: Apache-2.0 */
#include "certificates/certificate.h"
#include "certificates/expiry.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <gnutls/abstract.h>
#include <gnutls/x509.h>
#include <cmocka.h>

#define NOW ((int64_t)1800000000)
#define DAY DB_CERTIFICATE_DAY

struct party {
	gnutls_x509_privkey_t key;
	gnutls_x509_crt_t certificate;
};

/* One named `name`, signed by `issuer`, NULL: by itself. */
static struct party make_party(const char *name, const struct party *issuer, int64_t begins,
                               int64_t ends)
{
	struct party party;

	assert_int_equal(gnutls_x509_privkey_init(&party.key), 0);
	assert_int_equal(
		gnutls_x509_privkey_generate(party.key, GNUTLS_PK_ECDSA,
	                                     GNUTLS_CURVE_TO_BITS(GNUTLS_ECC_CURVE_SECP256R1), 0),
		0);
	assert_int_equal(gnutls_x509_crt_init(&party.certificate), 0);
	assert_int_equal(gnutls_x509_crt_set_version(party.certificate, 3), 0);
	assert_int_equal(gnutls_x509_crt_set_key(party.certificate, party.key), 0);
	assert_int_equal(gnutls_x509_crt_set_serial(party.certificate, name, 1), 0);
	assert_int_equal(gnutls_x509_crt_set_dn_by_oid(party.certificate,
	                                               GNUTLS_OID_X520_COMMON_NAME, 0, name,
	                                               (unsigned)strlen(name)),
	                 0);
	assert_int_equal(gnutls_x509_crt_set_activation_time(party.certificate, (time_t)begins), 0);
	assert_int_equal(gnutls_x509_crt_set_expiration_time(party.certificate, (time_t)ends), 0);
	assert_int_equal(gnutls_x509_crt_set_basic_constraints(party.certificate, 1, -1), 0);
	assert_int_equal(gnutls_x509_crt_sign2(party.certificate,
	                                       issuer ? issuer->certificate : party.certificate,
	                                       issuer ? issuer->key : party.key, GNUTLS_DIG_SHA256,
	                                       0),
	                 0);
	return party;
}

/* Signs it anew, with another usage beside the earlier ones. */
static void set_usage(struct party *party, const char *purpose, unsigned usage)
{
	assert_int_equal(gnutls_x509_crt_set_key_purpose_oid(party->certificate, purpose, 0), 0);
	assert_int_equal(gnutls_x509_crt_set_key_usage(party->certificate, usage), 0);
	assert_int_equal(gnutls_x509_crt_sign2(party->certificate, party->certificate, party->key,
	                                       GNUTLS_DIG_SHA256, 0),
	                 0);
}

static void free_party(struct party *party)
{
	gnutls_x509_crt_deinit(party->certificate);
	gnutls_x509_privkey_deinit(party->key);
}

static void append(struct db_certificate_file *file, const gnutls_datum_t *datum)
{
	file->bytes = realloc(file->bytes, file->size + datum->size + 1);
	assert_non_null(file->bytes);
	memcpy(file->bytes + file->size, datum->data, datum->size);
	file->size += datum->size;
	file->bytes[file->size] = '\0';
	gnutls_free(datum->data);
}

static void add_certificate(struct db_certificate_file *file, const struct party *party,
                            gnutls_x509_crt_fmt_t format)
{
	gnutls_datum_t datum;

	assert_int_equal(gnutls_x509_crt_export2(party->certificate, format, &datum), 0);
	append(file, &datum);
}

static struct db_certificate_file key_of(const struct party *party, gnutls_x509_crt_fmt_t format)
{
	struct db_certificate_file file = { .bytes = NULL };
	gnutls_datum_t datum;

	assert_int_equal(gnutls_x509_privkey_export2(party->key, format, &datum), 0);
	append(&file, &datum);
	return file;
}

static void test_a_pair_with_its_chain_is_good(void **state)
{
	struct party root = make_party("root", NULL, NOW - 100 * DAY, NOW + 100 * DAY);
	struct party gateway = make_party("gateway", &root, NOW - DAY, NOW + 50 * DAY);
	struct db_certificate_file chain = { .bytes = NULL };
	struct db_certificate_file key = key_of(&gateway, GNUTLS_X509_FMT_PEM);
	struct db_certificate_facts facts;
	char why[DB_CERTIFICATE_WHY] = "";

	(void)state;
	add_certificate(&chain, &gateway, GNUTLS_X509_FMT_PEM);
	add_certificate(&chain, &root, GNUTLS_X509_FMT_PEM);
	assert_int_equal(db_certificate_check_pair(&chain, &key, NOW, &facts, why),
	                 DB_CERTIFICATE_GOOD);
	assert_string_equal(facts.subject, "CN=gateway");
	assert_int_equal(facts.begins, NOW - DAY);
	assert_int_equal(facts.ends, NOW + 50 * DAY);
	assert_int_equal(db_certificate_check_pair(&chain, &key, NOW + 50 * DAY, &facts, why),
	                 DB_CERTIFICATE_DOUBTFUL);
	assert_string_equal(why, "the certificate of CN=gateway has ended on 2027-03-06 08:00 UTC");
	assert_int_equal(db_certificate_check_pair(&chain, &key, NOW - 2 * DAY, &facts, why),
	                 DB_CERTIFICATE_DOUBTFUL);
	assert_non_null(strstr(why, "is not valid before 2027-01-14 08:00 UTC"));
	db_certificate_file_clear(&chain);

	/* the one that signed it ends first */
	add_certificate(&chain, &root, GNUTLS_X509_FMT_PEM);
	db_certificate_file_clear(&key);
	key = key_of(&root, GNUTLS_X509_FMT_PEM);
	add_certificate(&chain, &gateway, GNUTLS_X509_FMT_PEM);
	assert_int_equal(db_certificate_check_pair(&chain, &key, NOW, &facts, why),
	                 DB_CERTIFICATE_DOUBTFUL);
	assert_string_equal(why, "the certificate of CN=root is not signed by the next one, that "
	                         "of CN=gateway");
	assert_int_equal(facts.ends, NOW + 50 * DAY);
	assert_int_equal(db_certificate_check_list(&chain, NOW, &facts, why), DB_CERTIFICATE_GOOD);
	assert_int_equal(facts.ends, NOW + 100 * DAY);
	assert_int_equal(db_certificate_check_list(&chain, NOW + 99 * DAY, &facts, why),
	                 DB_CERTIFICATE_GOOD);
	assert_int_equal(db_certificate_check_list(&chain, NOW + 101 * DAY, &facts, why),
	                 DB_CERTIFICATE_DOUBTFUL);
	db_certificate_file_clear(&chain);
	db_certificate_file_clear(&key);
	free_party(&gateway);
	free_party(&root);
}

static void test_a_foreign_key_is_wrong(void **state)
{
	static const gnutls_x509_crt_fmt_t formats[] = { GNUTLS_X509_FMT_PEM, GNUTLS_X509_FMT_DER };
	struct party one = make_party("one", NULL, NOW - DAY, NOW + DAY);
	struct party other = make_party("other", NULL, NOW - DAY, NOW + DAY);
	struct db_certificate_facts facts;
	char why[DB_CERTIFICATE_WHY];

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct db_certificate_file certificate = { .bytes = NULL };
		struct db_certificate_file own = key_of(&one, formats[i]);
		struct db_certificate_file foreign = key_of(&other, formats[i]);

		add_certificate(&certificate, &one, formats[i]);
		assert_int_equal(db_certificate_check_pair(&certificate, &own, NOW, &facts, why),
		                 DB_CERTIFICATE_GOOD);
		assert_int_equal(
			db_certificate_check_pair(&certificate, &foreign, NOW, &facts, why),
			DB_CERTIFICATE_WRONG);
		assert_string_equal(why, "the key does not belong to the certificate");
		assert_int_equal(
			db_certificate_check_pair(&certificate, &certificate, NOW, &facts, why),
			DB_CERTIFICATE_WRONG);
		assert_non_null(strstr(why, "the key cannot be read"));
		assert_int_equal(db_certificate_check_pair(&own, &own, NOW, &facts, why),
		                 DB_CERTIFICATE_WRONG);
		assert_non_null(strstr(why, "no certificate that can be read"));
		db_certificate_file_clear(&certificate);
		db_certificate_file_clear(&own);
		db_certificate_file_clear(&foreign);
	}
	free_party(&one);
	free_party(&other);
}

static void test_whether_a_certificate_is_for_servers(void **state)
{
	struct party party = make_party("gateway", NULL, NOW - DAY, NOW + DAY);
	struct db_certificate_file file = { .bytes = NULL };
	char why[DB_CERTIFICATE_WHY] = "";

	(void)state;
	/* Without usages it is for everything. */
	add_certificate(&file, &party, GNUTLS_X509_FMT_PEM);
	assert_int_equal(db_certificate_check_server(&file, why), DB_CERTIFICATE_GOOD);
	db_certificate_file_clear(&file);

	set_usage(&party, GNUTLS_KP_TLS_WWW_CLIENT, GNUTLS_KEY_DIGITAL_SIGNATURE);
	add_certificate(&file, &party, GNUTLS_X509_FMT_PEM);
	assert_int_equal(db_certificate_check_server(&file, why), DB_CERTIFICATE_DOUBTFUL);
	assert_non_null(strstr(why, "CN=gateway is not for server authentication"));
	db_certificate_file_clear(&file);

	set_usage(&party, GNUTLS_KP_TLS_WWW_SERVER, GNUTLS_KEY_DIGITAL_SIGNATURE);
	add_certificate(&file, &party, GNUTLS_X509_FMT_DER);
	assert_int_equal(db_certificate_check_server(&file, why), DB_CERTIFICATE_GOOD);
	db_certificate_file_clear(&file);

	set_usage(&party, GNUTLS_KP_TLS_WWW_SERVER, GNUTLS_KEY_KEY_ENCIPHERMENT);
	add_certificate(&file, &party, GNUTLS_X509_FMT_PEM);
	assert_int_equal(db_certificate_check_server(&file, why), DB_CERTIFICATE_DOUBTFUL);
	assert_non_null(strstr(why, "is not for digital signatures"));
	db_certificate_file_clear(&file);
	free_party(&party);
}

static void test_files_are_read_or_it_is_said_why_not(void **state)
{
	char path[] = "/tmp/drivebridge-XXXXXX";
	int fd = mkstemp(path);
	struct db_certificate_file file;
	char why[DB_CERTIFICATE_WHY];

	(void)state;
	assert_true(fd >= 0);
	assert_false(db_certificate_file_read(&file, path, why));
	assert_string_equal(why, "it is no file with a certificate or key in it");
	assert_int_equal(write(fd, "junk", 4), 4);
	(void)close(fd);
	assert_true(db_certificate_file_read(&file, path, why));
	assert_int_equal(file.size, 4);
	assert_string_equal(file.bytes, "junk");
	assert_true(db_certificate_file_equal(&file, &file));
	db_certificate_file_clear(&file);
	(void)unlink(path);
	assert_false(db_certificate_file_read(&file, path, why));
	assert_string_equal(why, "No such file or directory");
	assert_false(db_certificate_file_read(&file, "/", why));
}

static void test_the_end_is_said_at_30_7_and_1_days_and_at_it(void **state)
{
	struct db_certificate_expiry expiry;
	unsigned lines = 0;

	(void)state;
	db_certificate_expiry_set(&expiry, 0);
	assert_false(db_certificate_expiry_look(&expiry, "none", NOW));
	db_certificate_expiry_set(&expiry, NOW + 40 * DAY);
	assert_false(db_certificate_expiry_look(&expiry, "file", NOW));
	for (int64_t now = NOW; now < NOW + 45 * DAY; now += 3600)
		lines += db_certificate_expiry_look(&expiry, "file", now);
	assert_int_equal(lines, 4);
	/* one that ends soon says so once, at once */
	db_certificate_expiry_set(&expiry, NOW + 5 * DAY);
	assert_true(db_certificate_expiry_look(&expiry, "file", NOW));
	assert_false(db_certificate_expiry_look(&expiry, "file", NOW + 3600));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_pair_with_its_chain_is_good),
		cmocka_unit_test(test_a_foreign_key_is_wrong),
		cmocka_unit_test(test_whether_a_certificate_is_for_servers),
		cmocka_unit_test(test_files_are_read_or_it_is_said_why_not),
		cmocka_unit_test(test_the_end_is_said_at_30_7_and_1_days_and_at_it),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
