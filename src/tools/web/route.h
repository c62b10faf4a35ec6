/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a request asks for, by its method and path: one table of all paths and what each needs.
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_ROUTE_H
#define DRIVEBRIDGE_WEB_ROUTE_H

#include "users/roles.h"

#include <stdbool.h>
#include <stddef.h>

enum db_web_kind {
	DB_WEB_UNKNOWN,      /* nothing has this path */
	DB_WEB_WRONG_METHOD, /* the path exists, but only for GET or only for POST */
	DB_WEB_FILE,         /* a file of the page, by its name */
	DB_WEB_SESSION,
	DB_WEB_METRICS,
	DB_WEB_LOGIN,
	DB_WEB_LOGOUT,
	DB_WEB_SESSIONS,     /* the user's own */
	DB_WEB_SESSIONS_END, /* some of them end */
	DB_WEB_PASSWORD,     /* the user's own is changed */
	DB_WEB_USERS,        /* the list of them */
	DB_WEB_USERS_PUT,    /* one is made, or changed */
	DB_WEB_USERS_REMOVE,
	DB_WEB_ALIVE,
	DB_WEB_CLOCK, /* the moment of this program's clock */
	DB_WEB_JOG,
	DB_WEB_SEQUENCE,         /* a beat of a sequence of named positions */
	DB_WEB_COMMISSION,       /* the stream of a commissioning */
	DB_WEB_COMMISSION_SAY,   /* a message to it */
	DB_WEB_COMMISSION_STEPS, /* the list of its steps */
	DB_WEB_PARAMETERS,       /* the stream of a writing of parameters */
	DB_WEB_PARAMETERS_END,   /* ends it */
	DB_WEB_PARAMETERS_FILE,  /* the file of a drive */
	DB_WEB_PARAMETERS_READ,  /* the values in a file */
	DB_WEB_SETUP,            /* the stream of setting up a drive */
	DB_WEB_SETUP_SAY,        /* an answer to it */
	DB_WEB_CALL,             /* a call with one answer */
	DB_WEB_CONFIGURATION,    /* a call about the configuration's text */
	DB_WEB_STREAM,           /* a call with many answers */
	DB_WEB_OVERVIEW,         /* the shared stream of all drives */
	DB_WEB_TRAIL_SEARCH,     /* records of the audit trail, newest first */
	DB_WEB_TRAIL_VERIFY,     /* whether its chain is whole */
	DB_WEB_TRAIL_FILE,       /* its records as a file, in the form that `name` says */
	DB_WEB_GATEWAY,          /* what is in a file of the whole gateway */
	DB_WEB_HEALTH,           /* how drives have been */
	DB_WEB_ALARMS,           /* alarms that have changed */
	DB_WEB_ACKNOWLEDGE,      /* one of them was seen */
};

struct db_web_route {
	enum db_web_kind kind;
	const char *name; /* the call's method, the file, or what needs a role; else "" */
	/* What the request needs at least; its content may need more: db_web_admit_content(). */
	enum db_may needs;
	bool acts; /* uses the tab's own connection */
};

/* Largest body, in bytes: of a request, and of one with a file. */
#define DB_WEB_BODY_MAX ((size_t)16 * 1024)
#define DB_WEB_FILE_BODY_MAX ((size_t)48 * 1024)

static inline size_t db_web_body_max(const struct db_web_route *route)
{
	return route->kind == DB_WEB_PARAMETERS_READ || route->kind == DB_WEB_CONFIGURATION ?
	               DB_WEB_FILE_BODY_MAX :
	               DB_WEB_BODY_MAX;
}

/* `name` of a file points into `path`. HEAD counts as GET. */
struct db_web_route db_web_route_find(const char *method, const char *path);

#endif
