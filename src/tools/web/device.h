/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Browsers that a user has logged in with before. Each has a cookie that says so, for this user
 * alone, authenticated with the hash of the password: it needs no memory here, outlives a restart,
 * and counts no more when the password is another one. Whoever guesses at a user's name from
 * elsewhere takes none of the attempts of such a browser.
 *
 * Pure: random bytes are passed in. Any thread.
 */
#ifndef DRIVEBRIDGE_WEB_DEVICE_H
#define DRIVEBRIDGE_WEB_DEVICE_H

#include "web/sessions.h"

/* "DEVICE.AUTHENTICATION" in lower hexadecimal digits, and the zero byte. */
#define DB_WEB_DEVICE_TEXT (DB_WEB_SECRET_TEXT + 64 + 1)

/* The cookie of a browser with this random number. False: it cannot be made, without a hash above
 * all. */
bool db_web_device_write(const struct db_web_secret *device, const char *user, const char *hash,
                         char text[DB_WEB_DEVICE_TEXT]);

/* Whether a cookie was made for this user with this hash. `id` receives the browser's number. */
bool db_web_device_read(const char *text, const char *user, const char *hash,
                        char id[DB_WEB_SECRET_TEXT]);

/* The cookie's name, one for each user: several may share a browser. */
#define DB_WEB_DEVICE_NAME 64
void db_web_device_name(const char *user, bool secure, char name[DB_WEB_DEVICE_NAME]);

#endif
