/* SPDX-License-Identifier: Apache-2.0 */
#include "web/users.h"
#include "client/log.h"
#include "web/service.h"
#include "web/try.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The file is on a disk, which may be slow. */
#define CHANGE_WITHIN (20 * DB_NS_PER_S)

/* NULL: it is missing, or has a null byte in it. */
static const char *text_of(const struct db_web_request *request, const char *name)
{
	json_t *value = json_object_get(request->parameters, name);
	const char *text = json_string_value(value);

	return text && strlen(text) == json_string_length(value) ? text : NULL;
}

static void refuse_password(struct db_web_request *request, const char *wrong)
{
	db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadPassword",
	                      "the new password is not taken: %s; %u characters or more", wrong,
	                      request->server->config->password_min_length);
}

/* `before`: as the user is now; NULL: there is none. Whoever changes him meanwhile is the first. */
static void ask(struct db_web_request *request, struct db_web_work *work,
                const struct db_user *before)
{
	work->known = before;
	if (before)
		work->user = *before;
	if (!work->compares)
		snprintf(work->by, sizeof(work->by), "%s", request->user);
	work->pam_folder = request->server->config->pam_folder;
	work->number = request->number;
	work->path = request->server->config->users_file;
	request->answer_by = db_client_now() + CHANGE_WITHIN;
	if (!db_web_hasher_ask(request->server->hasher, work, true))
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "others log in at this moment; try again");
	explicit_bzero(work, sizeof(*work));
	/* The passwords are needed nowhere else. */
	if (request->body)
		explicit_bzero(request->body, request->used);
}

/* --- the user's own password ------------------------------------------------------------------ */

static void change_own(struct db_web_request *request, const struct db_user *user)
{
	struct db_web_server *server = request->server;
	const char *password = text_of(request, "password");
	const char *fresh = text_of(request, "fresh");
	struct db_web_work work = { .compares = true, .change = DB_WEB_CHANGE_PUT };
	const char *wrong;
	db_time wait;

	if (!password || !fresh || strlen(password) > DB_PASSWORD_MAX) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "right is {\"password\": of now, \"fresh\": the new one}");
		return;
	}
	wrong = db_password_judge(fresh, user->name, server->config->password_min_length);
	if (!wrong && strcmp(password, fresh) == 0)
		wrong = "it is the one of now";
	if (user->pam) {
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "NotHere",
		                      "this password is not kept here: PAM checks it");
		return;
	}
	if (wrong) {
		refuse_password(request, wrong);
		return;
	}
	/* Guessing at an open page is limited like guessing at the login. */
	wait = db_web_try_password(request, user->name, user);
	if (wait > 0) {
		request->retry_s = (unsigned)((wait + DB_NS_PER_S - 1) / DB_NS_PER_S);
		db_web_request_refuse(request, MHD_HTTP_TOO_MANY_REQUESTS, "TooManyAttempts",
		                      "too many attempts; again in %u s", request->retry_s);
		return;
	}
	work.fresh = *user;
	snprintf(work.password, sizeof(work.password), "%s", password);
	snprintf(work.fresh_password, sizeof(work.fresh_password), "%s", fresh);
	ask(request, &work, user);
}

/* --- users ------------------------------------------------------------------------------------ */

static json_t *describe(const struct db_users *users)
{
	json_t *made = json_array();

	for (size_t i = 0; i < users->count; i++) {
		const struct db_user *user = &users->list[i];

		(void)json_array_append_new(made, json_pack("{s:s, s:s, s:s, s:b, s:b}", "user",
		                                            user->name, "role",
		                                            db_role_name(user->grant.role),
		                                            "drives", user->grant.drives, "pam",
		                                            user->pam, "former", user->former));
	}
	return made;
}

/* False: the file cannot be used, and the request is answered with that. */
static bool load(struct db_web_request *request, struct db_users *users)
{
	char *said = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&said, &size);
	bool good = db_users_load(users, request->server->config->users_file, &db_web_keeper, out);

	if (out)
		(void)fclose(out);
	if (!good)
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "BadFile",
		                      "the file of users cannot be used: %s", said ? said : "");
	free(said);
	return good;
}

json_t *db_web_users_list(struct db_web_request *request)
{
	struct db_users users;
	json_t *made = load(request, &users) ? describe(&users) : NULL;

	db_users_clear(&users);
	return made;
}

/* The user as he is to be, from the request. False: it is answered with the mistake. */
static bool read_user(struct db_web_request *request, const struct db_user *before,
                      struct db_user *user, const char **password)
{
	const char *name = text_of(request, "user");
	const char *role = text_of(request, "role");
	const char *drives = text_of(request, "drives");
	bool pam = json_is_true(json_object_get(request->parameters, "pam"));
	const char *wrong;

	*user = (struct db_user){ .pam = pam };
	*password = text_of(request, "password");
	if (!name || !db_users_name_is_good(name) || !role ||
	    !db_role_read(role, &user->grant.role) || !drives || !db_drives_are_good(drives)) {
		db_web_request_refuse(
			request, MHD_HTTP_BAD_REQUEST, "BadRequest",
			"right is {\"user\": 1 to 32 letters, digits, '.', '-' and '_', \"role\": "
			"..., \"drives\": \"*\" or names with commas, \"password\": ...}");
		return false;
	}
	snprintf(user->name, sizeof(user->name), "%s", name);
	snprintf(user->grant.drives, sizeof(user->grant.drives), "%s", drives);
	if (pam) {
		*password = NULL;
		return true;
	}
	if (!*password && before && !before->pam) {
		snprintf(user->hash, sizeof(user->hash), "%s", before->hash);
		return true;
	}
	wrong = *password ? db_password_judge(*password, name,
	                                      request->server->config->password_min_length) :
	                    "there is none";
	if (wrong)
		refuse_password(request, wrong);
	return !wrong;
}

static void put(struct db_web_request *request, const struct db_users *users)
{
	const char *name = text_of(request, "user");
	const struct db_user *before = name ? db_users_find(users, name) : NULL;
	struct db_web_work work = { .change = DB_WEB_CHANGE_PUT };
	const char *password;

	if (!read_user(request, before, &work.fresh, &password))
		return;
	if (password)
		snprintf(work.fresh_password, sizeof(work.fresh_password), "%s", password);
	ask(request, &work, before);
}

static void remove_user(struct db_web_request *request, const struct db_users *users)
{
	const char *name = text_of(request, "user");
	const struct db_user *user = name ? db_users_find(users, name) : NULL;
	struct db_web_work work = { .change = DB_WEB_CHANGE_REMOVE };

	if (!user) {
		db_web_request_refuse(request, MHD_HTTP_NOT_FOUND, "NoSuchUser",
		                      "there is no user of this name");
		return;
	}
	work.fresh = *user;
	ask(request, &work, user);
}

void db_web_users_take(struct db_web_request *request)
{
	struct db_users users;
	const struct db_user *own;

	if (!load(request, &users)) {
		db_users_clear(&users);
		return;
	}
	own = db_users_find(&users, request->user);
	if (request->route.kind == DB_WEB_USERS)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:o, s:i}", "users", describe(&users),
		                                "min_length",
		                                (int)request->server->config->password_min_length));
	else if (request->route.kind == DB_WEB_USERS_PUT)
		put(request, &users);
	else if (request->route.kind == DB_WEB_USERS_REMOVE)
		remove_user(request, &users);
	else if (own)
		change_own(request, own);
	else
		db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginRequired",
		                      "this needs a login");
	db_users_clear(&users);
}

/* --- the end of a change ---------------------------------------------------------------------- */

static void log_end(const struct db_web_request *request, const struct db_web_work *work,
                    const char *who)
{
	const struct db_user *user = &work->fresh;

	if (!work->right)
		db_client_log(DB_CLIENT_WARNING, "%s: the password was not changed: wrong", who);
	else if (!work->done)
		db_client_log(DB_CLIENT_ERROR, "%s: users were not changed: %s", who, work->why);
	else if (work->change == DB_WEB_CHANGE_REMOVE)
		db_client_log(DB_CLIENT_NOTICE, "%s: removed the user %s", who, user->name);
	else if (work->compares)
		db_client_log(DB_CLIENT_NOTICE, "%s: changed the own password", who);
	else
		db_client_log(DB_CLIENT_NOTICE, "%s: user %s: %s, drives %s%s", who, user->name,
		              db_role_name(user->grant.role), user->grant.drives,
		              !request                     ? "" :
		              user->pam                    ? ", password by PAM" :
		              text_of(request, "password") ? ", a new password" :
		                                             "");
}

void db_web_users_end(struct db_web_server *server, struct db_web_request *request,
                      const struct db_web_work *work)
{
	struct db_web_caller caller = { .text = "a page that has left", .from = "page" };
	const char *what = work->change == DB_WEB_CHANGE_REMOVE ? "removed" :
	                   work->compares                       ? "password" :
	                                                          "put";
	char detail[128];

	if (request)
		caller = db_web_request_caller(request);
	log_end(request, work, caller.text);
	snprintf(detail, sizeof(detail), "%s: %s, %.48s", work->fresh.name,
	         db_role_name(work->fresh.grant.role), work->fresh.grant.drives);
	db_plant_note(server->service->plant, &(struct db_plant_note){ .kind = "users",
	                                                               .what = what,
	                                                               .user = caller.user,
	                                                               .from = caller.from,
	                                                               .text = detail,
	                                                               .refused = !work->done });
	if (!request)
		return;
	if (work->right && work->compares)
		db_web_try_was_right(request, request->user);
	if (!work->right) {
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "WrongPassword",
		                      "the password of now is wrong");
	} else if (!work->done) {
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "NotWritten",
		                      "the file of users was not changed: %s", work->why);
	} else {
		/* Whoever changes his own stays logged in here, and nowhere else. */
		if (work->compares) {
			db_web_sessions_renew(server->sessions, request->session, &work->fresh);
			db_web_try_keep_device(request, &work->fresh);
		}
		db_web_request_answer(request, MHD_HTTP_OK, json_object());
	}
}
