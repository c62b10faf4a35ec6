/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Files with certificates and private keys: whether they can be used, and until when. PEM, or DER
 * with one certificate, whatever library then uses them.
 *
 * Time is passed in, in seconds since 1970-01-01 UTC. Any thread.
 */
#ifndef DRIVEBRIDGE_CERTIFICATES_CERTIFICATE_H
#define DRIVEBRIDGE_CERTIFICATES_CERTIFICATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Size of a text that says what is wrong, a part of a sentence. */
#define DB_CERTIFICATE_WHY 384
#define DB_CERTIFICATE_NAME 128
/* "2026-12-04 11:00 UTC" */
#define DB_CERTIFICATE_DATE 32

/* Most bytes of a file: a system's list of authorities has some hundred thousand. */
#define DB_CERTIFICATE_FILE_MAX ((size_t)1024 * 1024)

/* A file in memory. All 0: none. */
struct db_certificate_file {
	char *bytes; /* followed by a zero byte, which is not counted */
	size_t size;
};

/* False: it cannot be read, is empty or too long; `why` says so. Cleared with
 * db_certificate_file_clear() in any case. */
bool db_certificate_file_read(struct db_certificate_file *file, const char *path,
                              char why[DB_CERTIFICATE_WHY]);

/* Wipes and frees it. */
void db_certificate_file_clear(struct db_certificate_file *file);

bool db_certificate_file_equal(const struct db_certificate_file *one,
                               const struct db_certificate_file *other);

enum db_certificate_state {
	DB_CERTIFICATE_GOOD,
	/* It can be used, but peers may refuse it: not one of its chain is signed by the next one,
	 * or it is not valid now. */
	DB_CERTIFICATE_DOUBTFUL,
	/* It cannot be used: it is no certificate, or the key is not its key. */
	DB_CERTIFICATE_WRONG,
};

struct db_certificate_facts {
	char subject[DB_CERTIFICATE_NAME]; /* of the first certificate */
	int64_t begins;                    /* when all are valid: from here */
	int64_t ends;                      /* to here */
};

/*
 * Checks a certificate, the first one of its file, with those that it was signed by behind it, and
 * its private key. `facts` is filled in unless it is wrong; `why` unless it is good.
 */
enum db_certificate_state db_certificate_check_pair(const struct db_certificate_file *certificate,
                                                    const struct db_certificate_file *key,
                                                    int64_t now, struct db_certificate_facts *facts,
                                                    char why[DB_CERTIFICATE_WHY]);

/*
 * The same for certificates that others are checked against: authorities, say. Their order means
 * nothing; from the facts' beginning to their end at least one of them is valid, and it is doubtful
 * when now none is.
 */
enum db_certificate_state db_certificate_check_list(const struct db_certificate_file *file,
                                                    int64_t now, struct db_certificate_facts *facts,
                                                    char why[DB_CERTIFICATE_WHY]);

/*
 * Whether the first certificate of a file is for servers, by its usages: doubtful, and `why`, when
 * it is not. One without usages is for everything.
 */
enum db_certificate_state db_certificate_check_server(const struct db_certificate_file *certificate,
                                                      char why[DB_CERTIFICATE_WHY]);

void db_certificate_write_date(int64_t time, char text[DB_CERTIFICATE_DATE]);

#endif
