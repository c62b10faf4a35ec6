/* SPDX-License-Identifier: Apache-2.0 */
#include "web/sessions.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct db_web_sessions {
	db_time idle;
	db_time longest;
	uint32_t last_number;
	struct db_web_session list[DB_WEB_SESSIONS_MAX];
};

struct db_web_sessions *db_web_sessions_new(db_time idle, db_time longest)
{
	struct db_web_sessions *sessions = calloc(1, sizeof(*sessions));

	if (!sessions)
		return NULL;
	sessions->idle = idle;
	sessions->longest = longest;
	return sessions;
}

void db_web_sessions_free(struct db_web_sessions *sessions)
{
	for (size_t i = 0; sessions && i < DB_WEB_SESSIONS_MAX; i++)
		explicit_bzero(&sessions->list[i], sizeof(sessions->list[i]));
	free(sessions);
}

void db_web_hex_write(const unsigned char *bytes, size_t count, char *text)
{
	for (size_t i = 0; i < count; i++)
		snprintf(text + 2 * i, 3, "%02x", bytes[i]);
}

bool db_web_secret_is_good(const char *text)
{
	return strlen(text) == DB_WEB_SECRET_TEXT - 1 &&
	       strspn(text, "0123456789abcdef") == DB_WEB_SECRET_TEXT - 1;
}

bool db_web_secret_equal(const char *one, const char *other)
{
	unsigned char differ = 0;

	if (!db_web_secret_is_good(one) || !db_web_secret_is_good(other))
		return false;
	for (size_t i = 0; i < DB_WEB_SECRET_TEXT; i++)
		differ |= (unsigned char)(one[i] ^ other[i]);
	return differ == 0;
}

static bool is_over(const struct db_web_sessions *sessions, const struct db_web_session *session,
                    db_time now)
{
	return now - session->used >= sessions->idle || now - session->begun >= sessions->longest;
}

const struct db_web_session *db_web_sessions_begin(struct db_web_sessions *sessions,
                                                   const struct db_user *user, const char *weak,
                                                   const struct db_web_address *from,
                                                   const struct db_web_secret secrets[2],
                                                   db_time now)
{
	struct db_web_session *place = &sessions->list[0];

	for (size_t i = 0; i < DB_WEB_SESSIONS_MAX; i++) {
		struct db_web_session *session = &sessions->list[i];

		if (session->id[0] != '\0' && is_over(sessions, session, now))
			explicit_bzero(session, sizeof(*session));
		if (place->id[0] != '\0' && (session->id[0] == '\0' || session->used < place->used))
			place = session;
	}
	explicit_bzero(place, sizeof(*place));
	db_web_hex_write(secrets[0].bytes, DB_WEB_SECRET_BYTES, place->id);
	db_web_hex_write(secrets[1].bytes, DB_WEB_SECRET_BYTES, place->token);
	place->number = ++sessions->last_number;
	place->from = *from;
	snprintf(place->user, sizeof(place->user), "%s", user->name);
	place->grant = user->grant;
	place->pam = user->pam;
	place->weak = weak;
	place->hash = db_users_digest(user);
	place->begun = now;
	place->used = now;
	return place;
}

static struct db_web_session *look_up(struct db_web_sessions *sessions, const char *id)
{
	for (size_t i = 0; i < DB_WEB_SESSIONS_MAX; i++) {
		if (db_web_secret_equal(sessions->list[i].id, id))
			return &sessions->list[i];
	}
	return NULL;
}

const struct db_web_session *db_web_sessions_find(struct db_web_sessions *sessions, const char *id,
                                                  db_time now)
{
	struct db_web_session *session = look_up(sessions, id);

	if (session && is_over(sessions, session, now)) {
		explicit_bzero(session, sizeof(*session));
		return NULL;
	}
	return session;
}

size_t db_web_sessions_of(struct db_web_sessions *sessions, const char *user, db_time now,
                          const struct db_web_session *found[DB_WEB_SESSIONS_MAX])
{
	size_t count = 0;

	for (size_t i = 0; i < DB_WEB_SESSIONS_MAX; i++) {
		const struct db_web_session *session = &sessions->list[i];
		size_t place = count;

		if (session->id[0] == '\0' || strcmp(session->user, user) != 0 ||
		    is_over(sessions, session, now))
			continue;
		for (; place > 0 && found[place - 1]->number > session->number; place--)
			found[place] = found[place - 1];
		found[place] = session;
		count++;
	}
	return count;
}

void db_web_sessions_touch(struct db_web_sessions *sessions, const char *id, db_time now)
{
	struct db_web_session *session = look_up(sessions, id);

	if (session)
		session->used = now;
}

void db_web_sessions_renew(struct db_web_sessions *sessions, const char *id,
                           const struct db_user *user)
{
	struct db_web_session *session = look_up(sessions, id);

	if (!session || strcmp(session->user, user->name) != 0)
		return;
	session->weak = NULL;
	session->hash = db_users_digest(user);
}

void db_web_sessions_end(struct db_web_sessions *sessions, const char *id)
{
	struct db_web_session *session = look_up(sessions, id);

	if (session)
		explicit_bzero(session, sizeof(*session));
}

void db_web_sessions_review(struct db_web_sessions *sessions, db_web_session_check_fn *check,
                            void *context)
{
	for (size_t i = 0; i < DB_WEB_SESSIONS_MAX; i++) {
		struct db_web_session *session = &sessions->list[i];

		if (session->id[0] != '\0' && !check(context, session))
			explicit_bzero(session, sizeof(*session));
	}
}
