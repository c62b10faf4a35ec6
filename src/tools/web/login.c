/* SPDX-License-Identifier: Apache-2.0 */
#include "web/login.h"
#include "client/log.h"
#include "drivebridge/version.h"
#include "users/users.h"
#include "web/call.h"
#include "web/service.h"
#include "web/stream.h"
#include "web/tabs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#define HASH_WITHIN (20 * DB_NS_PER_S)

/* Compared with passwords of unknown users when there are no users at all: the hash of no
 * password. */
#define NOBODY_HASH "$y$j7T$XGZBbEaTCYtdeFj6cREyH/$XV/QmZiW8pfD5CJL0Ov2bAMdZsAfSvD5rgWGrcVQ6n2"

static void end_session(struct db_web_server *server, const char *id)
{
	char over[DB_WEB_SECRET_TEXT];

	/* `id` may point into the session that is removed here. */
	(void)snprintf(over, sizeof(over), "%s", id);
	db_web_sessions_end(server->sessions, over);
	db_web_tabs_leave(server, over, DB_WEB_GRIP_LOGOUT);
	db_web_stream_end(server, over, "LoginRequired", "the login has ended");
}

void db_web_login_tell(struct db_web_request *request)
{
	if (request->token[0] == '\0') {
		struct db_web_secret secret;
		char value[1 + DB_WEB_SECRET_TEXT];

		if (getrandom(&secret, sizeof(secret), 0) != (ssize_t)sizeof(secret)) {
			db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
			                      "no random numbers are to be had; try again");
			return;
		}
		db_web_secret_write(&secret, request->token);
		(void)snprintf(value, sizeof(value), "%c%s", DB_WEB_NOBODY, request->token);
		db_web_request_set_cookie(request, value);
	}
	/* The version helps who looks for holes. */
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:s?, s:s, s:s, s:s?, s:b, s:o, s:s?}", "user",
	                                request->user[0] ? request->user : NULL, "role",
	                                db_role_name(request->role), "token", request->token,
	                                "version", request->role > DB_ROLE_NONE ? DB_VERSION : NULL,
	                                "service", db_web_service_is_up(request->server->service),
	                                "stops", db_web_service_stops(request->server->service),
	                                "tab", request->tab[0] ? request->tab : NULL));
}

/* By the address that the line names; a proxy's are together. */
static void log_login(struct db_web_request *request, const char *what, const char *user)
{
	struct db_web_caller caller = db_web_request_caller(request);
	char address[DB_WEB_ADDRESS_TEXT];

	db_web_address_write(request->proxied ? &request->proxy : &request->address, address);
	db_client_log_rationed_for(&request->server->login_lines, address, db_client_now(),
	                           DB_CLIENT_WARNING, "%s: login %s%.40s%s", caller.text,
	                           user[0] ? "as " : "", user, what);
}

static void refuse_often(struct db_web_request *request, db_time wait)
{
	request->retry_s = (unsigned)((wait + DB_NS_PER_S - 1) / DB_NS_PER_S);
	log_login(request, "refused: too many attempts", "");
	db_web_request_refuse(request, MHD_HTTP_TOO_MANY_REQUESTS, "TooManyAttempts",
	                      "too many attempts; again in %u s", request->retry_s);
}

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
		(void)snprintf(request->device_cookie, sizeof(request->device_cookie), "%s",
		               cookie);
		return;
	}
	request->device[0] = '\0';
	if (getrandom(&number, sizeof(number), 0) != (ssize_t)sizeof(number) ||
	    !db_web_device_write(&number, user->name, user->hash, request->device_cookie))
		request->device_cookie[0] = '\0';
}

void db_web_login(struct db_web_request *request)
{
	struct db_web_server *server = request->server;
	const char *user = json_string_value(json_object_get(request->parameters, "user"));
	json_t *secret = json_object_get(request->parameters, "password");
	const char *password = json_string_value(secret);
	struct db_users users = { .list = NULL };
	struct db_web_attempt attempt;
	const struct db_user *known = NULL;
	const char *hash = NOBODY_HASH;
	db_time wait;

	if (!user || !password || json_string_length(secret) != strlen(password) ||
	    strlen(password) > DB_USERS_PASSWORD_MAX || strlen(user) > DB_USERS_NAME_MAX) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "a login is {\"user\": ..., \"password\": ...}");
		return;
	}
	if (db_users_load(&users, server->config->users_file, &db_web_keeper, stderr))
		known = db_users_find(&users, user);
	if (known)
		find_device(request, known);
	attempt = attempt_of(request, user);
	wait = db_web_attempts_take(&server->attempts, &attempt, db_client_now());
	if (wait > 0) {
		refuse_often(request, wait);
		goto end;
	}
	/* An unknown user's answer takes as long as a known one's. */
	if (known)
		hash = known->hash;
	else if (users.count > 0)
		hash = users.list[0].hash;
	request->answer_by = db_client_now() + HASH_WITHIN;
	request->known = known;
	if (known) {
		request->login_role = known->role;
		request->digest = db_users_digest(known);
	}
	if (!db_web_hasher_ask(server->hasher, request->number, password, hash,
	                       request->device[0] != '\0'))
		refuse_often(request, DB_NS_PER_S);
	/* The password is needed nowhere else. */
	if (request->body)
		explicit_bzero(request->body, request->used);
end:
	db_users_clear(&users);
}

static void begin_session(struct db_web_request *request, const char *user)
{
	struct db_web_server *server = request->server;
	struct db_web_secret secrets[2];
	const struct db_web_session *session;

	if (getrandom(secrets, sizeof(secrets), 0) != (ssize_t)sizeof(secrets)) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "no random numbers are to be had; try again");
		return;
	}
	/* The session of this cookie so far ends. */
	if (request->session[0] != '\0')
		end_session(server, request->session);
	session = db_web_sessions_begin(server->sessions, user, request->login_role,
	                                request->digest, secrets, db_client_now());
	explicit_bzero(secrets, sizeof(secrets));
	(void)snprintf(request->user, sizeof(request->user), "%s", session->user);
	(void)snprintf(request->session, sizeof(request->session), "%s", session->id);
	(void)snprintf(request->token, sizeof(request->token), "%s", session->token);
	request->role = session->role;
	request->logged_in = true;
	db_web_request_set_cookie(request, session->id);
	db_web_login_tell(request);
}

void db_web_login_compared(struct db_web_server *server)
{
	struct db_web_caller caller;
	uint64_t number;
	bool right;

	while (db_web_hasher_take(server->hasher, &number, &right)) {
		struct db_web_request *request = server->requests;
		struct db_web_attempt attempt;
		const char *user;

		while (request && request->number != number)
			request = request->next;
		if (!request || request->status != 0)
			continue;
		user = json_string_value(json_object_get(request->parameters, "user"));
		caller = db_web_request_caller(request);
		if (right && request->known) {
			attempt = attempt_of(request, user);
			db_web_attempts_give_back(&server->attempts, &attempt);
			db_client_log(DB_CLIENT_NOTICE, "%s: logged in as %s, %s", caller.text,
			              user, db_role_name(request->login_role));
			db_web_service_note(server->service, "login", "in", user, caller.from,
			                    db_role_name(request->login_role), false);
			server->counts.logins++;
			begin_session(request, user);
		} else {
			/* An unknown name may be a password typed in the wrong field. */
			log_login(request, " failed", request->known ? user : "an unknown user");
			db_web_service_note(server->service, "login", "in", "", caller.from,
			                    request->known ? user : "an unknown user", true);
			server->counts.failed_logins++;
			db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginFailed",
			                      "the user or the password is wrong");
		}
	}
}

void db_web_logout(struct db_web_request *request)
{
	struct db_web_server *server = request->server;

	if (request->session[0] != '\0') {
		struct db_web_caller caller = db_web_request_caller(request);

		db_web_log_action(request, "logged out", NULL);
		db_web_service_note(server->service, "login", "out", caller.user, caller.from, "",
		                    false);
		end_session(server, request->session);
	}
	request->user[0] = '\0';
	request->session[0] = '\0';
	request->token[0] = '\0';
	request->role = server->config->read == DB_WEB_READ_ALL ? DB_ROLE_READER : DB_ROLE_NONE;
	db_web_login_tell(request);
}

static bool may_stay(const void *context, const struct db_web_session *session)
{
	const struct db_user *user = db_users_find(context, session->user);
	bool same = user && db_users_digest(user) == session->hash;

	if (!same)
		db_client_log(DB_CLIENT_NOTICE, "%s: logged out, for the file of users has changed",
		              session->user);
	return same;
}

void db_web_login_review(struct db_web_server *server)
{
	struct db_users users;
	uint64_t stamp = db_users_stamp(server->config->users_file);

	if (stamp == server->users_stamp)
		return;
	/* Who has changed the file may be no user of the page: root did. */
	if (server->users_stamp != 0)
		db_web_service_note(server->service, "users", "changed", "", "page",
		                    server->config->users_file, false);
	server->users_stamp = stamp;
	/* If the file cannot be read, there are no users. */
	(void)db_users_load(&users, server->config->users_file, &db_web_keeper, stderr);
	db_web_sessions_review(server->sessions, may_stay, &users);
	db_users_clear(&users);
}
