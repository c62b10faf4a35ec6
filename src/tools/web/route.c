/* SPDX-License-Identifier: Apache-2.0 */
#include "web/route.h"

#include <stddef.h>
#include <string.h>

#define CALL "/api/call/"
#define STREAM "/api/stream/"

static const struct {
	const char *path;
	const char *method;
	struct db_web_route route;
} table[] = {
	{ "/api/session", "GET", { DB_WEB_SESSION, "", DB_ROLE_NONE, false } },
	{ "/metrics", "GET", { DB_WEB_METRICS, "", DB_ROLE_NONE, false } },
	{ "/api/login", "POST", { DB_WEB_LOGIN, "", DB_ROLE_NONE, false } },
	{ "/api/logout", "POST", { DB_WEB_LOGOUT, "", DB_ROLE_NONE, false } },
	{ "/api/alive", "POST", { DB_WEB_ALIVE, "", DB_ROLE_OPERATOR, false } },
	{ "/api/jog", "POST", { DB_WEB_JOG, "", DB_ROLE_OPERATOR, true } },
	{ "/api/commission/steps", "POST", { DB_WEB_COMMISSION_STEPS, "", DB_ROLE_READER, false } },
	{ "/api/commission", "POST", { DB_WEB_COMMISSION_SAY, "", DB_ROLE_OPERATOR, true } },
	{ STREAM "commission",
	  "POST",
	  { DB_WEB_COMMISSION, "commission", DB_ROLE_OPERATOR, true } },
	{ "/api/setup", "POST", { DB_WEB_SETUP_SAY, "", DB_ROLE_OPERATOR, true } },
	{ STREAM "setup", "POST", { DB_WEB_SETUP, "setup", DB_ROLE_OPERATOR, true } },
	{ "/api/parameters/file", "POST", { DB_WEB_PARAMETERS_FILE, "", DB_ROLE_READER, false } },
	{ "/api/parameters/read", "POST", { DB_WEB_PARAMETERS_READ, "", DB_ROLE_READER, false } },
	{ "/api/parameters/end", "POST", { DB_WEB_PARAMETERS_END, "", DB_ROLE_OPERATOR, true } },
	{ STREAM "parameters",
	  "POST",
	  { DB_WEB_PARAMETERS, "parameters", DB_ROLE_OPERATOR, true } },
	{ CALL "Describe", "POST", { DB_WEB_CALL, "Describe", DB_ROLE_READER, false } },
	{ CALL "Registers", "POST", { DB_WEB_CALL, "Registers", DB_ROLE_READER, false } },
	{ CALL "Commands", "POST", { DB_WEB_CALL, "Commands", DB_ROLE_READER, false } },
	{ CALL "Read", "POST", { DB_WEB_CALL, "Read", DB_ROLE_READER, false } },
	{ CALL "Traces", "POST", { DB_WEB_CALL, "Traces", DB_ROLE_READER, false } },
	{ CALL "Figures", "POST", { DB_WEB_CALL, "Figures", DB_ROLE_READER, false } },
	{ CALL "Write", "POST", { DB_WEB_CALL, "Write", DB_ROLE_OPERATOR, true } },
	{ CALL "Run", "POST", { DB_WEB_CALL, "Run", DB_ROLE_OPERATOR, true } },
	{ CALL "Reload", "POST", { DB_WEB_CALL, "Reload", DB_ROLE_OPERATOR, true } },
	{ CALL "SetUp", "POST", { DB_WEB_CALL, "SetUp", DB_ROLE_OPERATOR, true } },
	{ STREAM "Subscribe", "POST", { DB_WEB_STREAM, "Subscribe", DB_ROLE_READER, false } },
	{ STREAM "Events", "POST", { DB_WEB_STREAM, "Events", DB_ROLE_READER, false } },
	{ STREAM "Trace", "POST", { DB_WEB_STREAM, "Trace", DB_ROLE_READER, false } },
	{ STREAM "Scan", "POST", { DB_WEB_STREAM, "Scan", DB_ROLE_OPERATOR, false } },
	{ STREAM "overview", "POST", { DB_WEB_OVERVIEW, "", DB_ROLE_READER, false } },
};

struct db_web_route db_web_route_find(const char *method, const char *path)
{
	bool get = strcmp(method, "GET") == 0 || strcmp(method, "HEAD") == 0;

	for (size_t i = 0; i < sizeof(table) / sizeof(table[0]); i++) {
		if (strcmp(table[i].path, path) != 0)
			continue;
		if (strcmp(table[i].method, get ? "GET" : method) == 0)
			return table[i].route;
		return (struct db_web_route){ .kind = DB_WEB_WRONG_METHOD,
			                      .name = table[i].method };
	}
	/* The page is one folder without others inside. */
	if (path[0] != '/' || strchr(path + 1, '/'))
		return (struct db_web_route){ .kind = DB_WEB_UNKNOWN, .name = "" };
	if (!get)
		return (struct db_web_route){ .kind = DB_WEB_WRONG_METHOD, .name = "GET" };
	return (struct db_web_route){ .kind = DB_WEB_FILE,
		                      .name = path[1] ? path + 1 : "index.html" };
}
