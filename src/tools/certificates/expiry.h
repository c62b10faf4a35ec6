/* SPDX-License-Identifier: Apache-2.0 */
/* Says in the log that a certificate ends: 30, 7 and 1 days before, and when it has. One thread. */
#ifndef DRIVEBRIDGE_CERTIFICATES_EXPIRY_H
#define DRIVEBRIDGE_CERTIFICATES_EXPIRY_H

#include <stdbool.h>
#include <stdint.h>

#define DB_CERTIFICATE_DAY ((int64_t)24 * 3600)
/* So long before its end whoever is to renew it should know. */
#define DB_CERTIFICATE_SOON (30 * DB_CERTIFICATE_DAY)

/* All 0: there is no certificate. */
struct db_certificate_expiry {
	int64_t ends; /* seconds since 1970-01-01 UTC; 0: there is none */
	unsigned said;
};

/* Another certificate, which ends then; 0: none. */
void db_certificate_expiry_set(struct db_certificate_expiry *expiry, int64_t ends);

/* To be called now and then. `what` begins the line: "certificate-file = /etc/...". True: a line
 * was written. */
bool db_certificate_expiry_look(struct db_certificate_expiry *expiry, const char *what,
                                int64_t now);

#endif
