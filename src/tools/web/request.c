/* SPDX-License-Identifier: Apache-2.0 */
#include "web/request.h"
#include "client/lanes.h"
#include "web/service.h"
#include "web/tokens.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#define JSON_TYPE "application/json"

/* Nothing from other sites, nothing inline, not inside a frame. */
static const char *const headers[][2] = {
	{ "Content-Security-Policy",
	  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src "
	  "'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'" },
	{ "X-Content-Type-Options", "nosniff" },
	{ "Referrer-Policy", "no-referrer" },
	{ "X-Frame-Options", "DENY" },
	{ "Cross-Origin-Opener-Policy", "same-origin" },
	{ "Cross-Origin-Resource-Policy", "same-origin" },
	{ "Permissions-Policy", "camera=(), geolocation=(), microphone=()" },
};

/* --- errors ----------------------------------------------------------------------------------- */

/* By the last part of their names. */
static const struct {
	const char *name;
	const char *told;
	unsigned status;
} errors[] = {
	{ DB_CLIENT_UNREACHABLE, "ServiceUnreachable", MHD_HTTP_BAD_GATEWAY },
	{ DB_CLIENT_LOST, "ServiceUnreachable", MHD_HTTP_BAD_GATEWAY },
	{ DB_CLIENT_BAD_ANSWER, "ServiceUnreachable", MHD_HTTP_BAD_GATEWAY },
	{ DB_CLIENT_TIMEOUT, "NoAnswer", MHD_HTTP_GATEWAY_TIMEOUT },
	{ DB_CLIENT_NO_MEMORY, "Busy", MHD_HTTP_SERVICE_UNAVAILABLE },
	{ DB_LANES_FULL, "Busy", MHD_HTTP_SERVICE_UNAVAILABLE },
	{ "org.varlink.service.InvalidParameter", "BadRequest", MHD_HTTP_BAD_REQUEST },
	{ DB_CLIENT_SERVICE "BadValue", "BadValue", MHD_HTTP_BAD_REQUEST },
	{ DB_CLIENT_SERVICE "NotAllowed", "NotAllowed", MHD_HTTP_FORBIDDEN },
	{ DB_CLIENT_SERVICE "NoSuchDrive", "NoSuchDrive", MHD_HTTP_NOT_FOUND },
	{ DB_CLIENT_SERVICE "NoSuchRegister", "NoSuchRegister", MHD_HTTP_NOT_FOUND },
	{ DB_CLIENT_SERVICE "NoSuchBus", "NoSuchBus", MHD_HTTP_NOT_FOUND },
	{ DB_CLIENT_SERVICE "NoSuchTrace", "NoSuchTrace", MHD_HTTP_NOT_FOUND },
	{ DB_CLIENT_SERVICE "NoSuchAlarm", "NoSuchAlarm", MHD_HTTP_NOT_FOUND },
	{ DB_CLIENT_SERVICE "NoSuchCommand", "NoSuchCommand", MHD_HTTP_NOT_FOUND },
	{ DB_CLIENT_SERVICE "NoSuchPosition", "NoSuchPosition", MHD_HTTP_NOT_FOUND },
	{ DB_CLIENT_SERVICE "PositionRefused", "PositionRefused", MHD_HTTP_CONFLICT },
	{ DB_CLIENT_SERVICE "Refused", "Refused", MHD_HTTP_CONFLICT },
	{ DB_CLIENT_SERVICE "ScanFailed", "ScanFailed", MHD_HTTP_CONFLICT },
	{ DB_CLIENT_SERVICE "EditFailed", "EditFailed", MHD_HTTP_CONFLICT },
	{ DB_CLIENT_SERVICE "TooOld", "TooOld", MHD_HTTP_CONFLICT },
	{ DB_CLIENT_SERVICE "Moving", "Moving", MHD_HTTP_CONFLICT },
	{ DB_CLIENT_SERVICE "Busy", "Busy", MHD_HTTP_SERVICE_UNAVAILABLE },
	{ DB_LANES_FULL, "Busy", MHD_HTTP_SERVICE_UNAVAILABLE },
};

json_t *db_web_error_describe(const struct db_client_error *error, unsigned *status)
{
	const char *last = strrchr(error->name, '.');
	const char *told = last ? last + 1 : error->name;
	const json_t *age_ms = json_object_get(error->parameters, "age_ms");
	unsigned found = MHD_HTTP_BAD_GATEWAY;
	char late[DB_WEB_LATE_TEXT] = "";

	for (size_t i = 0; i < sizeof(errors) / sizeof(errors[0]); i++) {
		if (strcmp(errors[i].name, error->name) == 0) {
			told = errors[i].told;
			found = errors[i].status;
		}
	}
	if (status)
		*status = found;
	/* The call was not carried out because it was too long on its way. */
	if (strcmp(error->name, DB_CLIENT_SERVICE "TooOld") == 0)
		db_web_tokens_write_late(late, json_is_integer(age_ms) ?
		                                       json_integer_value(age_ms) * DB_NS_PER_MS :
		                                       DB_TIME_NEVER);
	return json_pack("{s:s, s:o, s:s}", "error", told, "parameters",
	                 error->parameters ? json_incref(error->parameters) : json_object(), "text",
	                 late[0] ? late : error->text);
}

/* --- answers ---------------------------------------------------------------------------------- */

struct db_web_request *db_web_request_find(const struct db_web_server *server, uint64_t number)
{
	struct db_web_request *request = server->requests;

	while (request && request->number != number)
		request = request->next;
	return request;
}

void db_web_request_answer_text(struct db_web_request *request, unsigned status, char *text,
                                const char *type)
{
	if (request->status != 0) {
		free(text);
		return;
	}
	request->text = text;
	/* Without memory for the text the connection ends. */
	request->status = text ? status : MHD_HTTP_INTERNAL_SERVER_ERROR;
	request->type = type;
	request->answer_by = DB_TIME_NEVER;
	if (!request->suspended)
		return;
	request->suspended = false;
	MHD_resume_connection(request->connection);
	db_web_server_wake(request->server);
}

void db_web_request_answer(struct db_web_request *request, unsigned status, json_t *body)
{
	char *text = body && request->status == 0 ? json_dumps(body, JSON_COMPACT) : NULL;

	db_web_request_answer_text(request, status, text, JSON_TYPE);
	json_decref(body);
}

void db_web_request_refuse(struct db_web_request *request, unsigned status, const char *error,
                           const char *format, ...)
{
	char text[512];
	va_list arguments;
	json_t *body;

	va_start(arguments, format);
	vsnprintf(text, sizeof(text), format, arguments);
	va_end(arguments);
	body = json_pack("{s:s, s:{}, s:s}", "error", error, "parameters", "text", text);
	if (request->retry_s > 0)
		(void)json_object_set_new(body, "retry_s", json_integer(request->retry_s));
	request->server->counts.refused++;
	db_web_request_answer(request, status, body);
}

void db_web_request_fail(struct db_web_request *request, const struct db_client_error *error)
{
	unsigned status;
	json_t *body = db_web_error_describe(error, &status);

	db_web_request_answer(request, status, body);
}

/* Below that it is not worth it. */
#define PACK_FROM 2048

/* Packs the text if that is allowed and the browser can unpack it. Without memory it stays as it
 * is. Returns its size. */
static size_t pack_text(struct db_web_request *request)
{
	const char *accepted = MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND,
	                                                   MHD_HTTP_HEADER_ACCEPT_ENCODING);
	size_t size = request->text ? strlen(request->text) : 0;
	z_stream packer = { .next_in = (Bytef *)request->text, .avail_in = (uInt)size };
	size_t most = size;
	char *text;

	if (!request->packable || size < PACK_FROM || !accepted || !strstr(accepted, "gzip") ||
	    deflateInit2(&packer, Z_DEFAULT_COMPRESSION, Z_DEFLATED, MAX_WBITS + 16,
	                 MAX_MEM_LEVEL - 1, Z_DEFAULT_STRATEGY) != Z_OK)
		return size;
	text = malloc(most);
	packer.next_out = (Bytef *)text;
	packer.avail_out = (uInt)most;
	request->packed = text && deflate(&packer, Z_FINISH) == Z_STREAM_END;
	if (request->packed) {
		size = packer.total_out;
		free(request->text);
		request->text = text;
	} else {
		free(text);
	}
	(void)deflateEnd(&packer);
	return size;
}

static struct MHD_Response *make_response(struct db_web_request *request)
{
	const struct db_web_file *file = request->file;
	struct MHD_Response *response;
	const char *accepted;
	bool packed;

	if (request->response) {
		response = request->response;
		request->response = NULL;
		if (request->packed)
			(void)MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_ENCODING,
			                              "gzip");
		return response;
	}
	if (!file) {
		size_t size = pack_text(request);
		char *text = request->text;

		request->text = NULL;
		response = MHD_create_response_from_buffer(size, text, MHD_RESPMEM_MUST_FREE);
		if (response && request->packed)
			(void)MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_ENCODING,
			                              "gzip");
		return response;
	}
	if (request->status == MHD_HTTP_NOT_MODIFIED)
		return MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT);
	accepted = MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND,
	                                       MHD_HTTP_HEADER_ACCEPT_ENCODING);
	packed = file->packed && accepted && strstr(accepted, "gzip");
	response = MHD_create_response_from_buffer(packed ? file->packed_size : file->size,
	                                           packed ? file->packed : file->bytes,
	                                           MHD_RESPMEM_PERSISTENT);
	if (response && packed)
		(void)MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_ENCODING, "gzip");
	return response;
}

/* Longer than a browser is unused, as far as anybody knows. */
#define DEVICE_DAYS 180

enum MHD_Result db_web_request_send(struct db_web_request *request)
{
	struct MHD_Response *response = make_response(request);
	enum MHD_Result result;
	char value[48];
	char device[DB_WEB_DEVICE_NAME];
	char cookie[sizeof(request->device_cookie) + DB_WEB_DEVICE_NAME + 96];

	if (!response)
		return MHD_NO;
	for (size_t i = 0; i < sizeof(headers) / sizeof(headers[0]); i++)
		(void)MHD_add_response_header(response, headers[i][0], headers[i][1]);
	(void)MHD_add_response_header(response, MHD_HTTP_HEADER_CACHE_CONTROL,
	                              request->file ? "no-cache" : "no-store");
	if (request->file) {
		(void)MHD_add_response_header(response, MHD_HTTP_HEADER_ETAG, request->file->etag);
		(void)MHD_add_response_header(response, MHD_HTTP_HEADER_VARY,
		                              MHD_HTTP_HEADER_ACCEPT_ENCODING);
	}
	(void)MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, request->type);
	if (request->cookie[0] != '\0')
		(void)MHD_add_response_header(response, MHD_HTTP_HEADER_SET_COOKIE,
		                              request->cookie);
	if (request->logged_in && request->device_cookie[0] != '\0') {
		db_web_device_name(request->user, request->secure, device);
		snprintf(cookie, sizeof(cookie),
		         "%s=%s; Path=/; HttpOnly; SameSite=Strict; Max-Age=%d%s", device,
		         request->device_cookie, DEVICE_DAYS * 24 * 3600,
		         request->secure ? "; Secure" : "");
		(void)MHD_add_response_header(response, MHD_HTTP_HEADER_SET_COOKIE, cookie);
	}
	/* How long a browser that has come with TLS comes in no other way. */
	if (request->secure) {
		snprintf(value, sizeof(value), "max-age=%u",
		         request->server->config->hsts_days * 24 * 3600);
		(void)MHD_add_response_header(response, MHD_HTTP_HEADER_STRICT_TRANSPORT_SECURITY,
		                              value);
	}
	if (request->retry_s > 0) {
		snprintf(value, sizeof(value), "%u", request->retry_s);
		(void)MHD_add_response_header(response, MHD_HTTP_HEADER_RETRY_AFTER, value);
	}
	if (request->status == MHD_HTTP_METHOD_NOT_ALLOWED)
		(void)MHD_add_response_header(
			response, MHD_HTTP_HEADER_ALLOW,
			strcmp(request->route.name, "POST") == 0 ? "POST" : "GET, HEAD");
	result = MHD_queue_response(request->connection, request->status, response);
	MHD_destroy_response(response);
	return result;
}

/* --- the caller ------------------------------------------------------------------------------- */

struct db_web_caller db_web_request_caller(const struct db_web_request *request)
{
	struct db_web_caller caller;
	char address[DB_WEB_ADDRESS_TEXT];
	char proxy[DB_WEB_ADDRESS_TEXT] = "";

	db_web_address_write(&request->address, address);
	if (request->proxied)
		db_web_address_write(&request->proxy, proxy);
	snprintf(caller.user, sizeof(caller.user), "%s", request->user);
	snprintf(caller.text, sizeof(caller.text), "%s at %s%s%s",
	         request->user[0] ? request->user : "nobody", address, proxy[0] ? " through " : "",
	         proxy);
	snprintf(caller.from, sizeof(caller.from), "%s%s",
	         request->server->service->has_audit ? "page, " : "",
	         request->server->service->has_audit ? address : "");
	return caller;
}

void db_web_request_set_cookie(struct db_web_request *request, const char *value)
{
	snprintf(request->cookie, sizeof(request->cookie),
	         "%s=%s; Path=/; HttpOnly; SameSite=Strict%s",
	         request->secure ? DB_WEB_COOKIE_SECURE : DB_WEB_COOKIE, value,
	         request->secure ? "; Secure" : "");
}

void db_web_request_free(struct db_web_request *request)
{
	for (struct db_web_request **at = &request->server->requests; *at; at = &(*at)->next) {
		if (*at == request) {
			*at = request->next;
			break;
		}
	}
	if (request->response)
		MHD_destroy_response(request->response);
	if (request->end_stream)
		request->end_stream(request->stream);
	if (request->end_job)
		request->end_job(request->job);
	json_decref(request->parameters);
	if (request->known)
		explicit_bzero(request->known, sizeof(*request->known));
	free(request->known);
	if (request->body)
		explicit_bzero(request->body, request->used);
	free(request->body);
	free(request->text);
	free(request);
}
