/* SPDX-License-Identifier: Apache-2.0 */
#include "web/admit.h"
#include "web/origin.h"
#include "web/service.h"
#include "web/tabs.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Of what was refused, as the audit trail takes it. */
#define NOTED_MAX 32

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

/* Makes the request one of this session's user, or of nobody without a session of this id. */
static void take_session(struct db_web_request *request, const char *id)
{
	struct db_web_server *server = request->server;
	const struct db_web_session *session = db_web_sessions_find(server->sessions, id,
	                                                            db_client_now());

	snprintf(request->user, sizeof(request->user), "%s", session ? session->user : "");
	snprintf(request->session, sizeof(request->session), "%s", session ? session->id : "");
	snprintf(request->token, sizeof(request->token), "%s", session ? session->token : "");
	request->grant = session ? session->grant : db_web_grant_of_nobody(server->config);
	request->grant.stops = session && server->config->readers_may_stop == DB_WEB_YES;
	request->weak = session ? session->weak : NULL;
	request->pam = session && session->pam;
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

/* Refuses it, and adds that to the audit trail. `what`: the command or register, as the request
 * calls it; NULL: neither. */
static void refuse_deed(struct db_web_request *request, enum db_may may, const char *drive,
                        const char *what)
{
	static const char letters[] = "abcdefghijklmnopqrstuvwxyz0123456789_";
	const struct db_web_service *service = request->server->service;
	const struct db_web_caller caller = db_web_request_caller(request);
	bool known = drive && drive[0] &&
	             db_words_look_up(json_object_get(service->description, "drives"), drive);
	/* Words that are no name are not the trail's: they may be long, or mislead its reader. */
	bool good = what && what[strspn(what, letters)] == '\0' &&
	            strlen(what) + sizeof("write ") <= NOTED_MAX;
	char deed[NOTED_MAX];
	char why[256];

	if (strcmp(request->route.name, "Write") == 0)
		snprintf(deed, NOTED_MAX, "write%s%s", good ? " " : "", good ? what : "");
	else
		snprintf(deed, NOTED_MAX, "%s", good ? what : request->route.name);
	db_grant_explain(&request->grant, may, drive, why, sizeof(why));
	db_plant_note(service->plant,
	              &(struct db_plant_note){ .kind = "denied",
	                                       .what = deed,
	                                       .user = caller.user,
	                                       .from = caller.from,
	                                       .drive = known ? drive : NULL,
	                                       .text = known || !drive || !drive[0] ?
	                                                       why :
	                                                       "of a drive that is not there",
	                                       .refused = true });
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
	const char *wrong = db_web_tabs_judge(tab, call);

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
		refuse_deed(request, request->route.needs, NULL, NULL);
	else if (length && strtoul(length, NULL, 10) > db_web_body_max(&request->route))
		db_web_request_refuse(request, MHD_HTTP_CONTENT_TOO_LARGE, "TooLong",
		                      "the body may have %zu bytes",
		                      db_web_body_max(&request->route));
	else if (wrong)
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest", "%s", wrong);
	if (request->status != 0)
		return;
	snprintf(request->tab, sizeof(request->tab), "%s", tab ? tab : "");
	request->call = call ? strtoull(call, NULL, 10) : 0;
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
		refuse_deed(request, request->route.needs, NULL, NULL);
}

void db_web_admit(struct db_web_request *request)
{
	struct head_lines lines = { .hosts = 0 };
	const char *cookie;

	(void)MHD_get_connection_values(request->connection, MHD_HEADER_KIND, count_line, &lines);
	find_peer(request, lines.forwarded);
	cookie = MHD_lookup_connection_value(request->connection, MHD_COOKIE_KIND,
	                                     request->secure ? DB_WEB_COOKIE_SECURE :
	                                                       DB_WEB_COOKIE);
	take_session(request, cookie ? cookie : "");
	if (cookie && cookie[0] == DB_WEB_NOBODY && db_web_secret_is_good(cookie + 1))
		snprintf(request->token, sizeof(request->token), "%s", cookie + 1);
	if (lines.hosts != 1 || !db_web_host_is_good(head(request, MHD_HTTP_HEADER_HOST),
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

void db_web_admit_again(struct db_web_request *request)
{
	char id[DB_WEB_SECRET_TEXT];

	snprintf(id, sizeof(id), "%s", request->session);
	take_session(request, id);
	if (request->route.needs == DB_MAY_NOTHING)
		return;
	if (request->session[0] == '\0')
		db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginRequired",
		                      "the login has ended");
	else if (!may_at_all(request))
		refuse_deed(request, request->route.needs, NULL, NULL);
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
			refuse_deed(request, needs, drive, name);
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
	bool runs = route->kind == DB_WEB_CALL && strcmp(route->name, "Run") == 0;
	const json_t *step;
	size_t i;

	if (route->kind == DB_WEB_CALL && strcmp(route->name, "Write") == 0) {
		if (!admit_writes(request, drive ? drive : "") && request->status == 0)
			refuse_deed(request, DB_MAY_MOVE, drive, NULL);
		return;
	}
	/* Alarms without a drive are of a bus, or of the configuration: of all drives. */
	if (route->kind == DB_WEB_ACKNOWLEDGE && !drive)
		drive = "";
	/* The chain is of all lines. */
	if (route->kind == DB_WEB_TRAIL_VERIFY)
		drive = "";
	/* A sequence needs the right to move each of its drives; its later beats name none. */
	if (route->kind == DB_WEB_SEQUENCE) {
		json_array_foreach(json_object_get(request->parameters, "steps"), i, step)
		{
			drive = json_string_value(json_object_get(step, "drive"));
			if (request->status == 0 &&
			    !db_grant_has(&request->grant, DB_MAY_MOVE, drive ? drive : ""))
				refuse_deed(request, DB_MAY_MOVE, drive, "sequence");
		}
		return;
	}
	if (runs)
		needs = command ? db_may_of_command(command, &drive) : DB_MAY_MOVE;
	if (!db_grant_has(&request->grant, needs, drive))
		refuse_deed(request, needs, drive, runs ? command : NULL);
}
