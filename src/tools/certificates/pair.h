/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The certificate and the private key that a program shows to its peers: read at its start, looked
 * at by --check, and read again when they were renewed.
 *
 * Times are in seconds since 1970-01-01 UTC. One thread.
 */
#ifndef DRIVEBRIDGE_CERTIFICATES_PAIR_H
#define DRIVEBRIDGE_CERTIFICATES_PAIR_H

#include "certificates/certificate.h"
#include "certificates/expiry.h"

#include <stdio.h>

/* All 0: there is none. */
struct db_certificate_pair {
	struct db_certificate_file certificate;
	struct db_certificate_file key;
	struct db_certificate_facts facts;
	struct db_certificate_expiry expiry;
};

/* Reads and checks both files, PEM or DER. `why` says what is wrong or doubtful, and in which file.
 * To be cleared with db_certificate_pair_clear() in any case. */
enum db_certificate_state db_certificate_pair_load(struct db_certificate_pair *pair,
                                                   const char *certificate_path,
                                                   const char *key_path, int64_t now,
                                                   char why[DB_CERTIFICATE_WHY]);
void db_certificate_pair_clear(struct db_certificate_pair *pair);

/* For --check. False: it is wrong or doubtful. Says so on `out`, and that it ends soon. */
bool db_certificate_pair_check(const char *certificate_path, const char *key_path, int64_t now,
                               FILE *out);

/*
 * Reads the files again. True: they are good and others than before, and `pair` has them. Else it
 * stays as it is. What happens is logged. `used` tells when they take effect, as a part of a
 * sentence.
 */
bool db_certificate_pair_renew(struct db_certificate_pair *pair, const char *certificate_path,
                               const char *key_path, int64_t now, const char *used);

/* To be called now and then: says in the log that it ends (certificates/expiry.h). */
void db_certificate_pair_look(struct db_certificate_pair *pair, const char *certificate_path,
                              int64_t now);

#endif
