/* SPDX-License-Identifier: Apache-2.0 */
#include "certificates/expiry.h"
#include "certificates/certificate.h"
#include "client/log.h"

/* Time left when it is said; the last one is its end. */
static const int64_t steps[] = { DB_CERTIFICATE_SOON, 7 * DB_CERTIFICATE_DAY, DB_CERTIFICATE_DAY,
	                         0 };
#define STEPS (sizeof(steps) / sizeof(steps[0]))

void db_certificate_expiry_set(struct db_certificate_expiry *expiry, int64_t ends)
{
	*expiry = (struct db_certificate_expiry){ .ends = ends };
}

bool db_certificate_expiry_look(struct db_certificate_expiry *expiry, const char *what, int64_t now)
{
	char date[DB_CERTIFICATE_DATE];
	unsigned step = 0;

	if (expiry->ends == 0)
		return false;
	while (step < STEPS && expiry->ends - now <= steps[step])
		step++;
	/* A clock that was set back and comes forward again has it said again. */
	if (step <= expiry->said) {
		expiry->said = step;
		return false;
	}
	expiry->said = step;
	db_certificate_write_date(expiry->ends, date);
	if (step == STEPS)
		db_client_log(DB_CLIENT_ERROR, "%s: the certificate has ended on %s; renew it",
		              what, date);
	else
		db_client_log(step == STEPS - 1 ? DB_CLIENT_ERROR : DB_CLIENT_WARNING,
		              "%s: the certificate ends on %s, in %lld h; renew it", what, date,
		              (long long)((expiry->ends - now) / 3600));
	return true;
}
