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
	{ "/api/session", "GET", { DB_WEB_SESSION, "", DB_MAY_NOTHING, false } },
	{ "/metrics", "GET", { DB_WEB_METRICS, "", DB_MAY_NOTHING, false } },
	{ "/api/login", "POST", { DB_WEB_LOGIN, "", DB_MAY_NOTHING, false } },
	{ "/api/logout", "POST", { DB_WEB_LOGOUT, "", DB_MAY_NOTHING, false } },
	{ "/api/sessions", "POST", { DB_WEB_SESSIONS, "", DB_MAY_LOOK, false } },
	{ "/api/sessions/end", "POST", { DB_WEB_SESSIONS_END, "", DB_MAY_LOOK, false } },
	{ "/api/password", "POST", { DB_WEB_PASSWORD, "", DB_MAY_LOOK, false } },
	{ "/api/users", "POST", { DB_WEB_USERS, "users", DB_MAY_APPOINT, false } },
	{ "/api/users/put", "POST", { DB_WEB_USERS_PUT, "users/put", DB_MAY_APPOINT, false } },
	{ "/api/users/remove",
	  "POST",
	  { DB_WEB_USERS_REMOVE, "users/remove", DB_MAY_APPOINT, false } },
	{ "/api/alive", "POST", { DB_WEB_ALIVE, "", DB_MAY_LOOK, false } },
	{ "/api/clock", "POST", { DB_WEB_CLOCK, "", DB_MAY_LOOK, false } },
	{ "/api/jog", "POST", { DB_WEB_JOG, "jog", DB_MAY_MOVE, true } },
	{ "/api/sequence", "POST", { DB_WEB_SEQUENCE, "sequence", DB_MAY_MOVE, true } },
	{ "/api/commission/steps", "POST", { DB_WEB_COMMISSION_STEPS, "", DB_MAY_LOOK, false } },
	{ "/api/commission",
	  "POST",
	  { DB_WEB_COMMISSION_SAY, "commission", DB_MAY_ENGINEER, true } },
	{ STREAM "commission", "POST", { DB_WEB_COMMISSION, "commission", DB_MAY_ENGINEER, true } },
	{ "/api/setup", "POST", { DB_WEB_SETUP_SAY, "setup", DB_MAY_MANAGE, true } },
	{ STREAM "setup", "POST", { DB_WEB_SETUP, "setup", DB_MAY_MANAGE, true } },
	{ "/api/parameters/file", "POST", { DB_WEB_PARAMETERS_FILE, "", DB_MAY_LOOK, false } },
	{ "/api/parameters/read", "POST", { DB_WEB_PARAMETERS_READ, "", DB_MAY_LOOK, false } },
	{ "/api/parameters/end",
	  "POST",
	  { DB_WEB_PARAMETERS_END, "parameters", DB_MAY_ENGINEER, true } },
	{ STREAM "parameters", "POST", { DB_WEB_PARAMETERS, "parameters", DB_MAY_ENGINEER, true } },
	{ CALL "Describe", "POST", { DB_WEB_CALL, "Describe", DB_MAY_LOOK, false } },
	{ CALL "Registers", "POST", { DB_WEB_CALL, "Registers", DB_MAY_LOOK, false } },
	{ CALL "Commands", "POST", { DB_WEB_CALL, "Commands", DB_MAY_LOOK, false } },
	{ CALL "Read", "POST", { DB_WEB_CALL, "Read", DB_MAY_LOOK, false } },
	{ CALL "Positions", "POST", { DB_WEB_CALL, "Positions", DB_MAY_LOOK, false } },
	{ CALL "Teach", "POST", { DB_WEB_CALL, "Teach", DB_MAY_ENGINEER, true } },
	{ CALL "Forget", "POST", { DB_WEB_CALL, "Forget", DB_MAY_ENGINEER, true } },
	{ CALL "Traces", "POST", { DB_WEB_CALL, "Traces", DB_MAY_LOOK, false } },
	{ CALL "Figures", "POST", { DB_WEB_CALL, "Figures", DB_MAY_LOOK, false } },
	{ CALL "Write", "POST", { DB_WEB_CALL, "Write", DB_MAY_STOP, true } },
	{ CALL "Run", "POST", { DB_WEB_CALL, "Run", DB_MAY_STOP, true } },
	{ CALL "Reload", "POST", { DB_WEB_CALL, "Reload", DB_MAY_MANAGE, true } },
	{ CALL "Configuration",
	  "POST",
	  { DB_WEB_CONFIGURATION, "Configuration", DB_MAY_MANAGE, true } },
	{ CALL "CheckConfiguration",
	  "POST",
	  { DB_WEB_CONFIGURATION, "CheckConfiguration", DB_MAY_MANAGE, true } },
	{ CALL "SetConfiguration",
	  "POST",
	  { DB_WEB_CONFIGURATION, "SetConfiguration", DB_MAY_MANAGE, true } },
	{ CALL "SetUp", "POST", { DB_WEB_CALL, "SetUp", DB_MAY_MANAGE, true } },
	{ STREAM "Subscribe", "POST", { DB_WEB_STREAM, "Subscribe", DB_MAY_LOOK, false } },
	{ STREAM "Events", "POST", { DB_WEB_STREAM, "Events", DB_MAY_LOOK, false } },
	{ STREAM "Trace", "POST", { DB_WEB_STREAM, "Trace", DB_MAY_LOOK, false } },
	{ STREAM "Scan", "POST", { DB_WEB_STREAM, "Scan", DB_MAY_MANAGE, false } },
	{ "/api/audit", "POST", { DB_WEB_TRAIL_SEARCH, "audit", DB_MAY_AUDIT, false } },
	{ "/api/audit/verify",
	  "POST",
	  { DB_WEB_TRAIL_VERIFY, "audit/verify", DB_MAY_AUDIT, false } },
	{ "/api/audit.jsonl", "GET", { DB_WEB_TRAIL_FILE, "audit.jsonl", DB_MAY_AUDIT, false } },
	{ "/api/audit.cef", "GET", { DB_WEB_TRAIL_FILE, "audit.cef", DB_MAY_AUDIT, false } },
	{ "/api/gateway", "POST", { DB_WEB_GATEWAY, "gateway", DB_MAY_LOOK, false } },
	{ "/api/health", "POST", { DB_WEB_HEALTH, "Health", DB_MAY_LOOK, false } },
	{ "/api/health/rows", "POST", { DB_WEB_HEALTH, "HealthRows", DB_MAY_LOOK, false } },
	{ "/api/alarms", "POST", { DB_WEB_ALARMS, "Alarms", DB_MAY_LOOK, false } },
	{ CALL "AcknowledgeAlarm",
	  "POST",
	  { DB_WEB_ACKNOWLEDGE, "AcknowledgeAlarm", DB_MAY_MOVE, true } },
	{ STREAM "overview", "POST", { DB_WEB_OVERVIEW, "", DB_MAY_LOOK, false } },
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
