/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/login.h"

#include "client/clock.h"
#include "users/attempts.h"

#include <open62541/types_generated.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

/* Password attempts that one address has at once, and the time until one is available again. */
static const struct db_attempts_limit each = { .most = 5, .every = 5 * DB_NS_PER_S };

/* The same for all addresses together. A comparison takes some hundredths of a second, in which no
 * other client is served: after a wrong password no other is compared in the same round. */
static const struct db_attempts_limit together = { .most = 10, .every = DB_NS_PER_S / 2 };

const struct db_users_keeper db_opcua_keeper = {
	.program = "drivebridge-opcua",
	.former = DB_USERS_FORMER_OPCUA,
};

struct db_opcua_logins {
	const struct db_opcua_config *config;
	struct db_client_log_rations *lines;
	struct db_attempts attempts;
	/* A wrong password in this round, of connections that are not signed or are. */
	bool wrong[2];
	/* A hash that no password has: an unknown user takes as long as a known one. */
	char nobody[160];
};

struct db_opcua_logins *db_opcua_logins_new(const struct db_opcua_config *config,
                                            struct db_client_log_rations *lines)
{
	struct db_opcua_logins *logins = calloc(1, sizeof(*logins));

	if (!logins || !db_password_hash("nobody", logins->nobody) ||
	    getrandom(&logins->attempts.seed, sizeof(logins->attempts.seed), 0) < 0) {
		free(logins);
		return NULL;
	}
	logins->config = config;
	logins->lines = lines;
	return logins;
}

void db_opcua_logins_begin(struct db_opcua_logins *logins)
{
	memset(logins->wrong, 0, sizeof(logins->wrong));
}

/* BadUserAccessDenied: wrong password, or no such user. Right ones are not counted. */
static UA_StatusCode check_password(struct db_opcua_logins *logins, const char *address,
                                    bool is_signed, const char *name, const char *password,
                                    struct db_opcua_login *login)
{
	db_time now = db_client_now();
	struct db_attempts *attempts = &logins->attempts;
	uint64_t own = db_attempts_key(attempts, 'a', address, strlen(address));
	/* Unsigned connections have attempts of their own: they take none from the signed ones. */
	uint64_t all = db_attempts_key(attempts, is_signed ? 's' : 'u', "", 0);
	const struct db_user *user = NULL;
	struct db_users users = { .list = NULL };
	const char *weak;
	bool right;

	if (db_users_load(&users, logins->config->users, &db_opcua_keeper, stderr))
		user = db_users_find(&users, name);
	if (user)
		snprintf(login->user, sizeof(login->user), "%s", user->name);
	if (logins->wrong[is_signed] || db_attempts_wait(attempts, own, each, now) > 0 ||
	    db_attempts_wait(attempts, all, together, now) > 0) {
		db_users_clear(&users);
		return UA_STATUSCODE_BADTCPSERVERTOOBUSY;
	}
	/* The library waits for the answer, and with it every client. */
	if (user && user->pam)
		db_client_log_rationed_for(logins->lines, address, now, DB_CLIENT_WARNING,
		                           "%s: the password of %s is checked by PAM, which only "
		                           "the page does",
		                           address, login->user);
	right = db_password_matches(user && !user->pam ? user->hash : logins->nobody, password) &&
	        user;
	if (right) {
		login->grant = user->grant;
		login->digest = db_users_digest(user);
		/* OPC UA has no words for this: the log has. */
		weak = db_password_judge(password, user->name, logins->config->password_min_length);
		if (weak)
			db_client_log_rationed_for(
				logins->lines, user->name, now, DB_CLIENT_WARNING,
				"the password of %s is weak: %s; the page changes it, or "
				"drivebridge-opcua --add-user",
				user->name, weak);
	} else {
		db_attempts_count(attempts, own, all, each, now);
		db_attempts_count(attempts, all, own, together, now);
		logins->wrong[is_signed] = true;
	}
	db_users_clear(&users);
	return right ? UA_STATUSCODE_GOOD : UA_STATUSCODE_BADUSERACCESSDENIED;
}

static bool copy_text(const UA_String *string, char *text, size_t size)
{
	if (string->length >= size || memchr(string->data, '\0', string->length))
		return false;
	memcpy(text, string->data, string->length);
	text[string->length] = '\0';
	return true;
}

UA_StatusCode db_opcua_logins_check(struct db_opcua_logins *logins, const char *address,
                                    bool is_signed, const UA_ExtensionObject *token,
                                    struct db_opcua_login *login)
{
	char password[DB_PASSWORD_MAX + 1] = "";
	char name[DB_USERS_NAME_MAX + 1] = "";
	const UA_UserNameIdentityToken *named;
	UA_StatusCode status = UA_STATUSCODE_BADUSERACCESSDENIED;

	*login = (struct db_opcua_login){ .grant.role = DB_ROLE_NONE };
	/* A missing token means anonymous. */
	if (token->encoding == UA_EXTENSIONOBJECT_ENCODED_NOBODY ||
	    (token->encoding >= UA_EXTENSIONOBJECT_DECODED &&
	     token->content.decoded.type == &UA_TYPES[UA_TYPES_ANONYMOUSIDENTITYTOKEN])) {
		login->grant = (struct db_grant){ .role = DB_ROLE_OBSERVER, .drives = "*" };
		return logins->config->anonymous == DB_OPCUA_READ ? UA_STATUSCODE_GOOD : status;
	}
	if (token->encoding < UA_EXTENSIONOBJECT_DECODED ||
	    token->content.decoded.type != &UA_TYPES[UA_TYPES_USERNAMEIDENTITYTOKEN])
		return status;
	named = token->content.decoded.data;
	login->named = true;
	if (copy_text(&named->userName, name, sizeof(name)) &&
	    copy_text(&named->password, password, sizeof(password)))
		status = check_password(logins, address, is_signed, name, password, login);
	explicit_bzero(name, sizeof(name));
	explicit_bzero(password, sizeof(password));
	login->grant.stops = is_signed && logins->config->readers_may_stop == DB_OPCUA_YES;
	/* An unsigned connection may be anybody's. */
	if (!is_signed)
		login->grant.role = DB_ROLE_OBSERVER;
	return status;
}
