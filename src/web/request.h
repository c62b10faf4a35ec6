/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A request of a browser from its head to its answer, which may come later: meanwhile its connection is suspended. One
 * thread.
 */
#ifndef DRIVEBRIDGE_WEB_REQUEST_H
#define DRIVEBRIDGE_WEB_REQUEST_H

#include "client/client.h"
#include "web/route.h"
#include "web/state.h"

/* What a body may have. */
#define DB_WEB_BODY_MAX 16384

#define DB_WEB_TAB_MAX 32

struct db_web_request {
	struct db_web_request *next;
	struct db_web_server *server;
	struct MHD_Connection *connection;
	struct db_web_connection *place; /* among the connections; NULL: it has none */
	uint64_t number;                 /* no other request has had it */
	struct db_web_route route;

	/* Whose it is. */
	struct db_web_address address;
	bool secure;                      /* the browser's connection is encrypted */
	enum db_role role;                /* with what everybody may */
	char user[DB_USERS_NAME_MAX + 1]; /* "": nobody is logged in */
	char session[DB_WEB_SECRET_TEXT]; /* "" likewise */
	char token[DB_WEB_SECRET_TEXT];   /* "": there is no cookie */
	char tab[DB_WEB_TAB_MAX + 1];     /* "": not told */
	uint64_t call; /* its number among those of the page that act; 0: not told */

	char *body;
	size_t used;
	size_t received; /* with what was not kept */
	bool too_long;
	json_t *parameters; /* of the body; an object */

	/* Of a login: whether there is such a user, and as what he would be logged in. */
	bool known;
	enum db_role login_role;
	unsigned long digest;

	bool taken; /* it has been dispatched */
	bool suspended;
	db_time answer_by; /* else it is answered with that; DB_TIME_NEVER */

	/* The answer. */
	unsigned status; /* 0: there is none yet */
	char *text;
	const char *type;
	char cookie[160]; /* to be set; "" */
	unsigned retry_s; /* 0: nothing is said about it */
	const struct db_web_file *file;
	struct MHD_Response *response; /* of what goes on; NULL: it is made of the above */
	void (*end_stream)(struct db_web_stream *stream);
	struct db_web_stream *stream;
};

/* The request of this number; NULL: it has been answered and is gone. */
struct db_web_request *db_web_request_find(const struct db_web_server *server, uint64_t number);

/* Answers with an object, which is taken over. */
void db_web_request_answer(struct db_web_request *request, unsigned status, json_t *body);

/* Answers with a text, which is taken over. */
void db_web_request_answer_text(struct db_web_request *request, char *text, const char *type);

/* Answers with an error of this side. */
void db_web_request_refuse(struct db_web_request *request, unsigned status, const char *error,
                           const char *format, ...) __attribute__((format(printf, 4, 5)));

/* Answers with one of the service, or of the connection to it. */
void db_web_request_fail(struct db_web_request *request, const struct db_client_error *error);

/* As such an error is told: a new object. `status` may be NULL. */
json_t *db_web_error_describe(const struct db_client_error *error, unsigned *status);

/* There is an answer, or a stream: the connection goes on. */
void db_web_request_resume(struct db_web_request *request);

/* Hands its answer to the daemon. */
enum MHD_Result db_web_request_send(struct db_web_request *request);

/* "anna at 192.168.10.5": for the log. */
struct db_web_caller {
	char user[DB_USERS_NAME_MAX + 1]; /* "": nobody is logged in */
	char text[DB_USERS_NAME_MAX + DB_WEB_ADDRESS_TEXT + 16];
};
struct db_web_caller db_web_request_caller(const struct db_web_request *request);

/* Its cookie is to be set to this; "": taken away. */
void db_web_request_set_cookie(struct db_web_request *request, const char *value);

/* The cookie's name where the connection is encrypted, and where it is not. */
#define DB_WEB_COOKIE_SECURE "__Host-drivebridge"
#define DB_WEB_COOKIE "drivebridge"

/* The cookie of nobody begins with this, its token follows. */
#define DB_WEB_NOBODY 'n'

void db_web_request_free(struct db_web_request *request);

#endif
