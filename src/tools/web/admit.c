/* SPDX-License-Identifier: Apache-2.0 */
#include "web/admit.h"
#include "web/origin.h"
#include "web/tabs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const char *head(const struct db_web_request *request, const char *name)
{
	return MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND, name);
}

/* Headers that may occur only once, or several times. */
struct head_lines {
	unsigned hosts;
	const char *forwarded; /* the last one */
};

static enum MHD_Result count_line(void *data, enum MHD_ValueKind kind, const char *name,
                                  const char *value)
{
	struct head_lines *lines = data;

	(void)kind;
	lines->hosts += strcasecmp(name, MHD_HTTP_HEADER_HOST) == 0;
	if (strcasecmp(name, "X-Forwarded-For") == 0)
		lines->forwarded = value;
	return MHD_YES;
}

/* For a request through a trusted proxy: the client's address that the proxy reports. */
static void find_peer(struct db_web_request *request, const char *forwarded)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		request->connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
	const struct db_web_config *config = request->server->config;
	struct db_web_address told;
	const char *scheme;
	const char *last;

	if (!info || !db_web_address_of(info->client_addr, &request->address))
		memset(&request->address, 0, sizeof(request->address));
	request->secure = config->tls;
	if (!db_web_networks_have(&config->proxies, &request->address))
		return;
	last = forwarded ? strrchr(forwarded, ',') : NULL;
	last = last ? last + 1 + strspn(last + 1, " ") : forwarded;
	/* Only the last entry is the proxy's; the client can forge the entries before it. */
	if (last && db_web_address_parse(last, &told)) {
		request->proxy = request->address;
		request->proxied = true;
		request->address = told;
	}
	scheme = head(request, "X-Forwarded-Proto");
	if (scheme && strcmp(scheme, "https") == 0)
		request->secure = true;
}

static void find_session(struct db_web_request *request)
{
	struct db_web_server *server = request->server;
	const char *cookie = MHD_lookup_connection_value(request->connection, MHD_COOKIE_KIND,
	                                                 request->secure ? DB_WEB_COOKIE_SECURE :
	                                                                   DB_WEB_COOKIE);
	const struct db_web_session *session =
		cookie ? db_web_sessions_find(server->sessions, cookie, db_client_now()) : NULL;

	request->grant = db_web_grant_of_nobody(server->config);
	if (session) {
		(void)snprintf(request->user, sizeof(request->user), "%s", session->user);
		(void)snprintf(request->session, sizeof(request->session), "%s", session->id);
		(void)snprintf(request->token, sizeof(request->token), "%s", session->token);
		request->grant = session->grant;
		request->grant.stops = server->config->readers_may_stop == DB_WEB_YES;
		request->weak = session->weak;
		request->pam = session->pam;
	} else if (cookie && cookie[0] == DB_WEB_NOBODY && db_web_secret_is_good(cookie + 1)) {
		(void)snprintf(request->token, sizeof(request->token), "%s", cookie + 1);
	}
}

static bool is_json(const char *type)
{
	static const char json[] = "application/json";
	size_t length = sizeof(json) - 1;

	return type && strncasecmp(type, json, length) == 0 &&
	       (type[length] == '\0' || type[length] == ';' || type[length] == ' ');
}

struct db_grant db_web_grant_of_nobody(const struct db_web_config *config)
{
	return (struct db_grant){
		.role = config->read == DB_WEB_READ_ALL ? DB_ROLE_OBSERVER : DB_ROLE_NONE,
		.drives = "*",
	};
}

static bool may_at_all(const struct db_web_request *request)
{
	return db_grant_has(&request->grant, request->route.needs, NULL);
}

static void refuse_deed(struct db_web_request *request, enum db_may may, const char *drive)
{
	char why[256];

	db_grant_explain(&request->grant, may, drive, why, sizeof(why));
	db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "NotAllowed", "%s", why);
}

/* Refuses what a page of another site could make a browser send. */
static void check_post(struct db_web_request *request)
{
	const char *length = head(request, MHD_HTTP_HEADER_CONTENT_LENGTH);
	const char *token = head(request, "X-Drivebridge");
	const char *site = head(request, "Sec-Fetch-Site");
	const char *tab = head(request, "X-Tab");
	const char *call = head(request, "X-Call");

	if (!db_web_origin_is_good(head(request, MHD_HTTP_HEADER_ORIGIN),
	                           head(request, MHD_HTTP_HEADER_HOST)) ||
	    (site && strcmp(site, "same-origin") != 0))
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "WrongOrigin",
		                      "this request was made by another page");
	else if (!is_json(head(request, MHD_HTTP_HEADER_CONTENT_TYPE)))
		db_web_request_refuse(request, MHD_HTTP_UNSUPPORTED_MEDIA_TYPE, "BadContentType",
		                      "the body's type is to be application/json");
	else if (!may_at_all(request) && request->user[0] == '\0')
		db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginRequired",
		                      "this needs a login");
	else if (!token || !db_web_secret_equal(token, request->token))
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "BadToken",
		                      "the token in X-Drivebridge is not this session's; fetch "
		                      "/api/session");
	else if (!may_at_all(request))
		refuse_deed(request, request->route.needs, NULL);
	else if (length && strtoul(length, NULL, 10) > db_web_body_max(&request->route))
		db_web_request_refuse(request, MHD_HTTP_CONTENT_TOO_LARGE, "TooLong",
		                      "the body may have %zu bytes",
		                      db_web_body_max(&request->route));
	else if (tab && !db_web_tab_is_good(tab))
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "X-Tab is 16 to 32 hexadecimal digits");
	else if (call && !db_web_call_number_read(call, &request->call))
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "X-Call is a number from 1");
	else if (tab)
		(void)snprintf(request->tab, sizeof(request->tab), "%s", tab);
}

/* A download, which the browser makes by itself from a link of the page. */
static void check_download(struct db_web_request *request)
{
	const char *site = head(request, "Sec-Fetch-Site");

	if (site && strcmp(site, "same-origin") != 0 && strcmp(site, "none") != 0)
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "WrongOrigin",
		                      "this request was made by another page");
	else if (!may_at_all(request) && request->user[0] == '\0')
		db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginRequired",
		                      "this needs a login");
	else if (!may_at_all(request))
		refuse_deed(request, request->route.needs, NULL);
}

static void check_head(struct db_web_request *request, unsigned hosts)
{
	if (hosts != 1 || !db_web_host_is_good(head(request, MHD_HTTP_HEADER_HOST),
	                                       &request->server->config->hosts))
		db_web_request_refuse(
			request, MHD_HTTP_MISDIRECTED_REQUEST, "WrongHost",
			"this gateway is called by its address, or by a name that its "
			"configuration has in hosts");
	else if (request->route.kind == DB_WEB_UNKNOWN)
		db_web_request_refuse(request, MHD_HTTP_NOT_FOUND, "NoSuchPath",
		                      "there is nothing of this name");
	else if (request->route.kind == DB_WEB_WRONG_METHOD)
		db_web_request_refuse(request, MHD_HTTP_METHOD_NOT_ALLOWED, "WrongMethod",
		                      "this needs another method");
	else if (request->route.kind == DB_WEB_TRAIL_FILE)
		check_download(request);
	else if (request->route.kind != DB_WEB_FILE && request->route.kind != DB_WEB_SESSION &&
	         request->route.kind != DB_WEB_METRICS)
		check_post(request);
}

void db_web_admit(struct db_web_request *request)
{
	struct head_lines lines = { .hosts = 0 };

	(void)MHD_get_connection_values(request->connection, MHD_HEADER_KIND, count_line, &lines);
	find_peer(request, lines.forwarded);
	find_session(request);
	check_head(request, lines.hosts);
}

/* What a write of several registers needs: of each. False: it is refused. */
static bool admit_writes(struct db_web_request *request, const char *drive)
{
	json_t *values = json_object_get(request->parameters, "values");
	const char *name;
	json_t *value;

	json_object_foreach(values, name, value)
	{
		enum db_may needs = db_may_of_write(drive, name, json_number_value(value));

		if (!db_grant_has(&request->grant, needs, drive)) {
			refuse_deed(request, needs, drive);
			return false;
		}
	}
	/* A write of nothing is the service's to refuse, of who may write. */
	return json_object_size(values) > 0 || db_grant_has(&request->grant, DB_MAY_MOVE, drive);
}

void db_web_admit_content(struct db_web_request *request)
{
	const struct db_web_route *route = &request->route;
	const char *command = json_string_value(json_object_get(request->parameters, "command"));
	const char *drive = json_string_value(json_object_get(request->parameters, "drive"));
	enum db_may needs = route->needs;

	if (route->kind == DB_WEB_CALL && strcmp(route->name, "Write") == 0) {
		if (!admit_writes(request, drive ? drive : "") && request->status == 0)
			refuse_deed(request, DB_MAY_MOVE, drive);
		return;
	}
	if (route->kind == DB_WEB_CALL && strcmp(route->name, "Run") == 0)
		needs = command ? db_may_of_command(command, &drive) : DB_MAY_MOVE;
	if (!db_grant_has(&request->grant, needs, drive))
		refuse_deed(request, needs, drive);
}
