/* SPDX-License-Identifier: Apache-2.0 */
#include "web/try.h"

#include <stdio.h>
#include <sys/random.h>

static struct db_web_attempt attempt_of(const struct db_web_request *request, const char *user)
{
	return (struct db_web_attempt){ .address = request->address,
		                        .proxy = request->proxied ? &request->proxy : NULL,
		                        .user = user,
		                        .device = request->device };
}

/* Whether this browser is one that the user has logged in with; else it becomes one if the password
 * is right. */
static void find_device(struct db_web_request *request, const struct db_user *user)
{
	char name[DB_WEB_DEVICE_NAME];
	const char *cookie;
	struct db_web_secret number;

	db_web_device_name(user->name, request->secure, name);
	cookie = MHD_lookup_connection_value(request->connection, MHD_COOKIE_KIND, name);
	if (cookie && db_web_device_read(cookie, user->name, user->hash, request->device)) {
		snprintf(request->device_cookie, sizeof(request->device_cookie), "%s", cookie);
		return;
	}
	request->device[0] = '\0';
	if (getrandom(&number, sizeof(number), 0) != (ssize_t)sizeof(number) ||
	    !db_web_device_write(&number, user->name, user->hash, request->device_cookie))
		request->device_cookie[0] = '\0';
}

db_time db_web_try_password(struct db_web_request *request, const char *name,
                            const struct db_user *user)
{
	struct db_web_attempt attempt;

	/* Without a hash here nothing could authenticate the cookie. */
	if (user && !user->pam)
		find_device(request, user);
	attempt = attempt_of(request, name);
	return db_web_attempts_take(&request->server->attempts, &attempt, db_client_now());
}

void db_web_try_was_right(struct db_web_request *request, const char *name)
{
	struct db_web_attempt attempt = attempt_of(request, name);

	db_web_attempts_give_back(&request->server->attempts, &attempt);
}

void db_web_try_keep_device(struct db_web_request *request, const struct db_user *user)
{
	find_device(request, user);
	request->logged_in = true;
}
