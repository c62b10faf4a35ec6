/* SPDX-License-Identifier: Apache-2.0 */
#include "web/login.h"
#include "client/log.h"
#include "drivebridge/version.h"
#include "users/users.h"
#include "web/admit.h"
#include "web/call.h"
#include "web/service.h"
#include "web/stream.h"
#include "web/tabs.h"
#include "web/try.h"

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
	snprintf(over, sizeof(over), "%s", id);
	db_web_sessions_end(server->sessions, over);
	db_web_tabs_leave(server, over, DB_WEB_GRIP_LOGOUT);
	db_web_stream_end(server, over, "LoginRequired", "the login has ended");
}

/* Which commands need more than to move a drive. */
static json_t *list_commands(enum db_may may)
{
	json_t *list = json_array();

	for (const char *const *name = db_may_commands(may); *name; name++)
		(void)json_array_append_new(list, json_string(*name));
	return list;
}

/* null: all. */
static json_t *list_drives(const struct db_grant *grant)
{
	json_t *list;

	if (db_grant_has_all(grant))
		return json_null();
	list = json_array();
	for (const char *at = grant->drives; *at;) {
		size_t word = strcspn(at, ",");

		(void)json_array_append_new(list, json_stringn(at, word));
		at += word + (at[word] == ',');
	}
	return list;
}

void db_web_login_tell(struct db_web_request *request)
{
	json_t *mays;

	if (request->token[0] == '\0') {
		struct db_web_secret secret;
		char value[1 + DB_WEB_SECRET_TEXT];

		if (getrandom(&secret, sizeof(secret), 0) != (ssize_t)sizeof(secret)) {
			db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
			                      "no random numbers are to be had; try again");
			return;
		}
		db_web_hex_write(secret.bytes, DB_WEB_SECRET_BYTES, request->token);
		snprintf(value, sizeof(value), "%c%s", DB_WEB_NOBODY, request->token);
		db_web_request_set_cookie(request, value);
	}
	mays = json_array();
	for (enum db_may may = DB_MAY_LOOK; may < DB_MAYS; may++) {
		if (db_grant_has(&request->grant, may, NULL))
			(void)json_array_append_new(mays, json_string(db_may_name(may)));
	}
	/* The version helps who looks for holes. */
	db_web_request_answer(
		request, MHD_HTTP_OK,
		json_pack("{s:s?, s:s, s:o, s:o, s:{s:o, s:o, s:o}, s:{s:b, s:s?, s:i}, s:s, s:s?, "
	                  "s:b, s:o, s:s?}",
	                  "user", request->user[0] ? request->user : NULL, "role",
	                  db_role_name(request->grant.role), "may", mays, "drives",
	                  list_drives(&request->grant), "commands", "stop",
	                  list_commands(DB_MAY_STOP), "engineer", list_commands(DB_MAY_ENGINEER),
	                  "manage", list_commands(DB_MAY_MANAGE), "password", "own",
	                  request->user[0] != '\0' && !request->pam, "weak", request->weak, "least",
	                  (int)request->server->config->password_min_length, "token",
	                  request->token, "version",
	                  request->grant.role > DB_ROLE_NONE ? DB_VERSION : NULL, "service",
	                  db_web_service_is_up(request->server->service), "stops",
	                  db_web_service_stops(request->server->service), "tab",
	                  request->tab[0] ? request->tab : NULL));
}

/* By the address that the line names; a proxy's are together. */
static void log_login(struct db_web_request *request, const char *what, const char *user,
                      const char *why)
{
	struct db_web_caller caller = db_web_request_caller(request);
	char address[DB_WEB_ADDRESS_TEXT];

	db_web_address_write(request->proxied ? &request->proxy : &request->address, address);
	db_client_log_rationed_for(&request->server->login_lines, address, db_client_now(),
	                           DB_CLIENT_WARNING, "%s: login %s%.40s%s%s%s", caller.text,
	                           user[0] ? "as " : "", user, what, why[0] ? ": " : "", why);
}

static void refuse_often(struct db_web_request *request, db_time wait)
{
	request->retry_s = (unsigned)((wait + DB_NS_PER_S - 1) / DB_NS_PER_S);
	log_login(request, "refused: too many attempts", "", "");
	db_web_request_refuse(request, MHD_HTTP_TOO_MANY_REQUESTS, "TooManyAttempts",
	                      "too many attempts; again in %u s", request->retry_s);
}

void db_web_login(struct db_web_request *request)
{
	struct db_web_server *server = request->server;
	const char *user = json_string_value(json_object_get(request->parameters, "user"));
	json_t *secret = json_object_get(request->parameters, "password");
	const char *password = json_string_value(secret);
	struct db_users users = { .list = NULL };
	const struct db_user *known = NULL;
	struct db_web_work work = { .number = request->number, .compares = true };
	db_time wait;

	if (!user || !password || json_string_length(secret) != strlen(password) ||
	    strlen(password) > DB_PASSWORD_MAX || strlen(user) > DB_USERS_NAME_MAX) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "a login is {\"user\": ..., \"password\": ...}");
		return;
	}
	if (db_users_load(&users, server->config->users_file, &db_web_keeper, stderr))
		known = db_users_find(&users, user);
	wait = db_web_try_password(request, user, known);
	if (wait > 0) {
		refuse_often(request, wait);
		goto end;
	}
	request->answer_by = db_client_now() + HASH_WITHIN;
	if (known && (request->known = malloc(sizeof(*known))))
		*request->known = *known;
	/* An unknown user's answer takes as long as a known one's. */
	if (!known)
		snprintf(work.user.hash, sizeof(work.user.hash), "%s",
		         users.count > 0 && !users.list[0].pam ? users.list[0].hash : NOBODY_HASH);
	else
		work.user = *known;
	work.pam_folder = server->config->pam_folder;
	snprintf(work.password, sizeof(work.password), "%s", password);
	if (known && !known->pam)
		request->weak = db_password_judge(password, user,
		                                  server->config->password_min_length);
	if (!db_web_hasher_ask(work.user.pam ? server->asker : server->hasher, &work,
	                       request->device[0] != '\0'))
		refuse_often(request, DB_NS_PER_S);
	explicit_bzero(&work, sizeof(work));
	/* The password is needed nowhere else. */
	if (request->body)
		explicit_bzero(request->body, request->used);
end:
	db_users_clear(&users);
}

static void begin_session(struct db_web_request *request)
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
	session = db_web_sessions_begin(server->sessions, request->known, request->weak,
	                                &request->address, secrets, db_client_now());
	explicit_bzero(secrets, sizeof(secrets));
	snprintf(request->user, sizeof(request->user), "%s", session->user);
	snprintf(request->session, sizeof(request->session), "%s", session->id);
	snprintf(request->token, sizeof(request->token), "%s", session->token);
	request->pam = session->pam;
	request->grant = session->grant;
	request->grant.stops = server->config->readers_may_stop == DB_WEB_YES;
	request->logged_in = true;
	/* Already this connection is one of somebody who is logged in. */
	if (request->place)
		request->place->known = true;
	db_web_request_set_cookie(request, session->id);
	db_web_login_tell(request);
}

/* Whether the user stands in the file as before: PAM may have taken its time. */
static bool is_as_before(const struct db_web_server *server, const struct db_user *before)
{
	struct db_users users;
	const struct db_user *now = NULL;
	bool same;

	if (db_users_load(&users, server->config->users_file, &db_web_keeper, stderr))
		now = db_users_find(&users, before->name);
	same = now && db_users_digest(now) == db_users_digest(before);
	db_users_clear(&users);
	return same;
}

void db_web_login_end(struct db_web_request *request, const struct db_web_work *work)
{
	struct db_web_server *server = request->server;
	const char *user = json_string_value(json_object_get(request->parameters, "user"));
	struct db_web_caller caller = db_web_request_caller(request);
	bool right = work->right && request->known;
	bool changed = right && !is_as_before(server, request->known);

	if (right && !changed) {
		const char *role = db_role_name(request->known->grant.role);

		db_web_try_was_right(request, user);
		db_client_log(DB_CLIENT_NOTICE, "%s: logged in as %s, %s%s%s", caller.text, user,
		              role, request->weak ? "; the password is weak: " : "",
		              request->weak ? request->weak : "");
		db_plant_note(server->service->plant, &(struct db_plant_note){ .kind = "login",
		                                                               .what = "in",
		                                                               .user = user,
		                                                               .from = caller.from,
		                                                               .text = role });
		server->counts.logins++;
		begin_session(request);
		return;
	}
	/* An unknown name may be a password typed in the wrong field. */
	log_login(request, " failed", request->known ? user : "an unknown user",
	          changed ? "the user was changed meanwhile" : work->why);
	db_plant_note(server->service->plant,
	              &(struct db_plant_note){ .kind = "login",
	                                       .what = "in",
	                                       .from = caller.from,
	                                       .text = request->known ? user : "an unknown user",
	                                       .refused = true });
	server->counts.failed_logins++;
	db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginFailed",
	                      "the user or the password is wrong");
}

void db_web_logout(struct db_web_request *request)
{
	struct db_web_server *server = request->server;

	if (request->session[0] != '\0') {
		struct db_web_caller caller = db_web_request_caller(request);

		db_web_log_action(request, "logged out", NULL);
		db_plant_note(server->service->plant,
		              &(struct db_plant_note){ .kind = "login",
		                                       .what = "out",
		                                       .user = caller.user,
		                                       .from = caller.from });
		end_session(server, request->session);
	}
	request->user[0] = '\0';
	request->session[0] = '\0';
	request->token[0] = '\0';
	request->grant = db_web_grant_of_nobody(server->config);
	request->weak = NULL;
	db_web_login_tell(request);
}

/* --- other sessions of the same user ---------------------------------------------------------- */

/* What it moves ends as when he logs out there. */
static void end_other(struct db_web_request *request, const struct db_web_session *session)
{
	struct db_web_caller caller = db_web_request_caller(request);
	char address[DB_WEB_ADDRESS_TEXT];
	char text[DB_WEB_ADDRESS_TEXT + 32];

	db_web_address_write(&session->from, address);
	snprintf(text, sizeof(text), "another session, from %s", address);
	db_client_log(DB_CLIENT_NOTICE, "%s: logged out %s", caller.text, text);
	db_plant_note(request->server->service->plant, &(struct db_plant_note){ .kind = "login",
	                                                                        .what = "out",
	                                                                        .user = caller.user,
	                                                                        .from = caller.from,
	                                                                        .text = text });
	end_session(request->server, session->id);
}

void db_web_login_own(struct db_web_request *request)
{
	const struct db_web_session *found[DB_WEB_SESSIONS_MAX];
	json_t *number = json_object_get(request->parameters, "number");
	json_t *others = json_object_get(request->parameters, "others");
	db_time now = db_client_now();
	size_t count = db_web_sessions_of(request->server->sessions, request->user, now, found);
	json_t *list;
	size_t ended = 0;

	if (request->route.kind == DB_WEB_SESSIONS_END) {
		if (json_is_integer(number) == json_is_true(others)) {
			db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
			                      "either {\"number\": ...} or {\"others\": true}");
			return;
		}
		for (size_t i = 0; i < count; i++) {
			if (strcmp(found[i]->id, request->session) == 0 ||
			    (number && found[i]->number != json_integer_value(number)))
				continue;
			end_other(request, found[i]);
			ended++;
		}
		if (number && ended == 0) {
			db_web_request_refuse(request, MHD_HTTP_CONFLICT, "NoSuchSession",
			                      "you have no other session of this number any more");
			return;
		}
	}
	/* Those that there are now. */
	list = json_array();
	count = db_web_sessions_of(request->server->sessions, request->user, now, found);
	for (size_t i = 0; i < count; i++) {
		char address[DB_WEB_ADDRESS_TEXT];

		db_web_address_write(&found[i]->from, address);
		(void)json_array_append_new(
			list,
			json_pack("{s:I, s:s, s:I, s:I, s:b}", "number",
		                  (json_int_t)found[i]->number, "from", address, "begun_ms",
		                  (json_int_t)((now - found[i]->begun) / DB_NS_PER_MS), "used_ms",
		                  (json_int_t)((now - found[i]->used) / DB_NS_PER_MS), "own",
		                  strcmp(found[i]->id, request->session) == 0));
	}
	db_web_request_answer(request, MHD_HTTP_OK, json_pack("{s:o}", "sessions", list));
}

struct review {
	struct db_web_server *server;
	struct db_users users;
};

static bool may_stay(void *context, const struct db_web_session *session)
{
	struct review *review = context;
	const struct db_user *user = db_users_find(&review->users, session->user);
	const struct db_web_request *change = review->server->requests;

	if (user && db_users_digest(user) == session->hash)
		return true;
	/* The request with which he changes his own password; one of which something is missing yet
	 * changes nothing. */
	while (change && (change->route.kind != DB_WEB_PASSWORD || !change->taken ||
	                  change->status != 0 || strcmp(change->session, session->id) != 0))
		change = change->next;
	/* With another password alone, which he is just giving himself: looked at again then. */
	if (user && user->grant.role == session->grant.role &&
	    strcmp(user->grant.drives, session->grant.drives) == 0 && change) {
		review->server->users_stamp = 0;
		return true;
	}
	db_client_log(DB_CLIENT_NOTICE, "%s: logged out, for the file of users has changed",
	              session->user);
	return false;
}

void db_web_login_review(struct db_web_server *server)
{
	struct review review = { .server = server };
	uint64_t stamp = db_users_stamp(server->config->users_file, &db_web_keeper);

	if (stamp == server->users_stamp)
		return;
	/* Who has changed the file may be no user of the page: root did. */
	if (server->users_stamp != 0)
		db_plant_note(server->service->plant,
		              &(struct db_plant_note){ .kind = "users",
		                                       .what = "changed",
		                                       .from = "page",
		                                       .text = server->config->users_file });
	server->users_stamp = stamp;
	/* If the file cannot be read, there are no users. */
	(void)db_users_load(&review.users, server->config->users_file, &db_web_keeper, stderr);
	db_web_sessions_review(server->sessions, may_stay, &review);
	db_users_clear(&review.users);
}
