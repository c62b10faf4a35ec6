/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Passwords that the machine checks (PAM), by its service "drivebridge": a directory of a company,
 * say. Takes as long as that does: not for a loop. No state; any thread, one call at a time.
 */
#ifndef DRIVEBRIDGE_USERS_PAM_H
#define DRIVEBRIDGE_USERS_PAM_H

#include <stdbool.h>
#include <stddef.h>

#define DB_PAM_SERVICE "drivebridge"

/* True if PAM has that service. `folder`: where its file stands, "" for PAM's own folders. */
bool db_pam_is_there(const char *folder);

/*
 * True if PAM takes the password and the account is valid. `folder`: as above. `why`: what failed,
 * "" where it was the password or the name. A service without a file of its own is refused: PAM
 * would take the rules of "other".
 */
bool db_pam_check(const char *folder, const char *user, const char *password, char *why,
                  size_t size);

#endif
