/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A request of a browser from its headers to its answer, which may come later: until then its
 * connection is suspended. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_REQUEST_H
#define DRIVEBRIDGE_WEB_REQUEST_H

#include "client/client.h"
#include "client/link.h"
#include "web/device.h"
#include "web/route.h"
#include "web/state.h"

#define DB_WEB_TAB_MAX 32

struct db_web_request {
	struct db_web_request *next;
	struct db_web_server *server;
	struct MHD_Connection *connection;
	struct db_web_connection *place; /* its entry among the connections; NULL: it has none */
	uint64_t number;                 /* unique among all requests */
	struct db_web_route route;

	/* Who sent it. */
	struct db_web_address address;
	struct db_web_address proxy;      /* that has told the address */
	bool proxied;                     /* there is such a one */
	bool secure;                      /* the browser's connection is encrypted */
	struct db_grant grant;            /* at least what everybody may */
	const char *weak;                 /* what is wrong with the password, as of the session */
	bool pam;                         /* likewise, PAM checks it */
	char user[DB_USERS_NAME_MAX + 1]; /* "": nobody is logged in */
	char session[DB_WEB_SECRET_TEXT]; /* "": nobody is logged in */
	char token[DB_WEB_SECRET_TEXT];   /* "": there is no cookie */
	char tab[DB_WEB_TAB_MAX + 1];     /* "": not given */
	uint64_t call; /* its number among the acting calls of the page; 0: not given */

	char *body;
	size_t used;
	size_t received; /* bytes, also those that were not kept */
	bool too_long;
	json_t *parameters; /* of the body; an object */

	/* For a login: the user; NULL: there is none of this name. */
	struct db_user *known;
	bool logged_in;                  /* by this request */
	char device[DB_WEB_SECRET_TEXT]; /* the browser's; "": not known as this user's */

	bool taken; /* it has been dispatched */
	bool suspended;
	db_time answer_by; /* without an answer until then it fails; DB_TIME_NEVER */

	/* The answer. */
	unsigned status; /* 0: there is none yet */
	char *text;
	const char *type;
	char cookie[160];                       /* to be set; "": none */
	char device_cookie[DB_WEB_DEVICE_TEXT]; /* the same, but only when logged_in */
	unsigned retry_s;                       /* 0: no such header */
	const struct db_web_file *file;
	struct MHD_Response *response; /* of a stream; NULL: it is made of the fields above */
	bool packed;                   /* by gzip */
	bool packable;                 /* the text may be packed: it has no secrets in it */
	void (*end_stream)(struct db_web_stream *stream);
	struct db_web_stream *stream;
	/* What works for it, which ends with it; NULL: nothing. */
	void (*end_job)(void *job);
	void *job;
};

/* The request of this number; NULL: it has been answered and is gone. */
struct db_web_request *db_web_request_find(const struct db_web_server *server, uint64_t number);

/* Answers with an object, which is taken over. */
void db_web_request_answer(struct db_web_request *request, unsigned status, json_t *body);

/* Answers with a text, which is taken over. */
void db_web_request_answer_text(struct db_web_request *request, unsigned status, char *text,
                                const char *type);

/* Answers with an error of this server. */
void db_web_request_refuse(struct db_web_request *request, unsigned status, const char *error,
                           const char *format, ...) __attribute__((format(printf, 4, 5)));

/* Answers with an error of the service, or of the connection to it. */
void db_web_request_fail(struct db_web_request *request, const struct db_client_error *error);

/* The error in the form of an answer: a new object. `status` may be NULL. */
json_t *db_web_error_describe(const struct db_client_error *error, unsigned *status);

/* Hands its answer to the daemon. */
enum MHD_Result db_web_request_send(struct db_web_request *request);

/* "anna at 192.168.10.5", "anna at 10.0.0.7 through 127.0.0.1": for the log. */
struct db_web_caller {
	char user[DB_USERS_NAME_MAX + 1]; /* "": nobody is logged in */
	char text[DB_USERS_NAME_MAX + 2 * DB_WEB_ADDRESS_TEXT + 32];
	/* for the audit trail: "page, 10.0.0.7"; "" for a service that has none */
	char from[DB_LINK_FROM_MAX + 1];
};
struct db_web_caller db_web_request_caller(const struct db_web_request *request);

/* Sets its cookie to this value. */
void db_web_request_set_cookie(struct db_web_request *request, const char *value);

/* The cookie's name where the connection is encrypted, and where it is not. */
#define DB_WEB_COOKIE_SECURE "__Host-drivebridge"
#define DB_WEB_COOKIE "drivebridge"

/* The cookie of a browser without a login begins with this letter, its token follows. */
#define DB_WEB_NOBODY 'n'

void db_web_request_free(struct db_web_request *request);

#endif
