/* SPDX-License-Identifier: Apache-2.0 */
/* A certificate that a program makes for itself, signed with its own key. Any thread. */
#ifndef DRIVEBRIDGE_CERTIFICATES_OWN_H
#define DRIVEBRIDGE_CERTIFICATES_OWN_H

#include "certificates/certificate.h"

/* What is in it. */
struct db_certificate_wish {
	const char *name; /* its subject's common name */
	const char *organization;
	const char *host; /* a name of this machine */
	const char *uri;  /* of the application */
	unsigned days;    /* that it is valid */
};

/*
 * Makes a key, RSA with 2048 bits, and a certificate for it, both in DER. It serves both ends of a
 * connection and signs nothing for others. Takes some tenths of a second. False: it cannot be made;
 * `why` says so. Both are cleared with db_certificate_file_clear() in any case.
 */
bool db_certificate_make_own(const struct db_certificate_wish *wish, int64_t now,
                             struct db_certificate_file *certificate,
                             struct db_certificate_file *key, char why[DB_CERTIFICATE_WHY]);

#endif
