/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a request asks for, by its method and path: one table of what there is and which role it needs. Pure.
 */
#ifndef DRIVEBRIDGE_WEB_ROUTE_H
#define DRIVEBRIDGE_WEB_ROUTE_H

#include "users/roles.h"

#include <stdbool.h>

enum db_web_kind {
	DB_WEB_UNKNOWN,      /* there is nothing of this name */
	DB_WEB_WRONG_METHOD, /* there is, but for GET or for POST only */
	DB_WEB_FILE,         /* of the page, by its name */
	DB_WEB_SESSION,
	DB_WEB_METRICS,
	DB_WEB_LOGIN,
	DB_WEB_LOGOUT,
	DB_WEB_ALIVE,
	DB_WEB_JOG,
	DB_WEB_CALL,     /* one answer */
	DB_WEB_STREAM,   /* many */
	DB_WEB_OVERVIEW, /* the stream that everybody shares */
};

struct db_web_route {
	enum db_web_kind kind;
	const char *name;  /* of the call's method, of the file; else "" */
	enum db_role role; /* that it needs */
	bool acts;         /* goes over the tab's own connection */
};

/* `name` of a file points into `path`. HEAD is as GET. */
struct db_web_route db_web_route_find(const char *method, const char *path);

#endif
