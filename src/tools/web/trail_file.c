/* SPDX-License-Identifier: Apache-2.0 */
#include "web/trail_file.h"
#include "capture/audit_text.h"
#include "web/admit.h"
#include "web/call.h"
#include "web/trail.h"
#include "web/trail_filter.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define BLOCK ((size_t)16 * 1024)

struct file {
	struct db_web_trail_reader reader;
	struct db_web_request *request;
	struct db_web_trail_filter filter;
	bool cef;
	json_int_t next; /* number of the record with which the next page begins */
	char *lines;     /* of the latest page; NULL: all sent */
	size_t size;
	size_t sent;
	bool waiting; /* the connection is suspended until there are lines */
	bool over;
	bool broken; /* it could not be read to its end */
};

static void resume(struct file *file)
{
	if (!file->waiting)
		return;
	file->waiting = false;
	MHD_resume_connection(file->request->connection);
	db_web_server_wake(file->request->server);
}

/* --- reading ---------------------------------------------------------------------------------- */

static void take_turn(struct db_web_trail_reader *reader)
{
	struct file *file = (struct file *)(void *)reader;
	struct db_web_request *request = file->request;

	/* It may take hours. */
	if (db_web_sessions_find(request->server->sessions, request->session, db_client_now())) {
		db_web_trail_ask(request->server,
		                 db_web_trail_filter_query(&file->filter, file->next));
		return;
	}
	file->broken = true;
	db_web_trail_leave(request->server, reader);
	resume(file);
}

static void take_page(struct db_web_trail_reader *reader, json_t *page,
                      const struct db_client_error *error)
{
	struct file *file = (struct file *)(void *)reader;
	struct db_web_server *server = file->request->server;
	FILE *out;
	json_t *record;
	size_t i;

	free(file->lines);
	file->lines = NULL;
	file->size = 0;
	if (error) {
		file->broken = true;
	} else {
		file->next = json_integer_value(json_object_get(page, "next"));
		file->over = json_is_true(json_object_get(page, "over"));
		out = open_memstream(&file->lines, &file->size);
		json_array_foreach(out ? json_object_get(page, "records") : NULL, i, record)
		{
			if (!db_web_trail_filter_has(&file->filter, record))
				continue;
			if (file->cef) {
				db_capture_audit_write_cef(record, out);
			} else {
				(void)json_dumpf(record, out,
				                 JSON_COMPACT | JSON_REAL_PRECISION(9));
				fputc('\n', out);
			}
		}
		file->sent = 0;
		file->broken = !out || fclose(out) != 0;
	}
	/* A page without any that are wanted is followed by the next one. */
	if (file->size == 0 && !file->over && !file->broken) {
		take_turn(reader);
		return;
	}
	db_web_trail_leave(server, reader);
	resume(file);
}

/* --- sending ---------------------------------------------------------------------------------- */

static ssize_t take_bytes(void *data, uint64_t position, char *buffer, size_t most)
{
	struct file *file = data;
	size_t count = file->size - file->sent;

	(void)position;
	if (count > 0) {
		count = count < most ? count : most;
		memcpy(buffer, file->lines + file->sent, count);
		file->sent += count;
		return (ssize_t)count;
	}
	if (file->broken)
		return MHD_CONTENT_READER_END_WITH_ERROR;
	if (file->over)
		return MHD_CONTENT_READER_END_OF_STREAM;
	file->waiting = true;
	MHD_suspend_connection(file->request->connection);
	db_web_trail_enter(file->request->server, &file->reader);
	return 0;
}

static void end_file(void *job)
{
	struct file *file = job;

	db_web_trail_leave(file->request->server, &file->reader);
	free(file->lines);
	free(file);
}

/* --- the request ------------------------------------------------------------------------------ */

static enum MHD_Result read_argument(void *data, enum MHD_ValueKind kind, const char *name,
                                     const char *value)
{
	json_t *parameters = data;
	char *end = NULL;
	long long number = value ? strtoll(value, &end, 10) : 0;

	(void)kind;
	if (strcmp(name, "refused") == 0)
		(void)json_object_set_new(parameters, name, json_true());
	else if (strcmp(name, "since_us") == 0 || strcmp(name, "until_us") == 0)
		(void)json_object_set_new(
			parameters, name,
			end && end != value && *end == '\0' ? json_integer(number) : json_null());
	else
		(void)json_object_set_new(parameters, name, json_string(value ? value : ""));
	return MHD_YES;
}

static bool attach(struct db_web_request *request, struct file *file)
{
	time_t now = time(NULL);
	struct tm local = { .tm_year = 0 };
	char name[64];
	char text[128];

	request->response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, BLOCK, take_bytes,
	                                                      file, NULL);
	if (!request->response)
		return false;
	(void)localtime_r(&now, &local);
	(void)strftime(name, sizeof(name), "audit-%Y%m%d-%H%M%S", &local);
	snprintf(text, sizeof(text), "attachment; filename=\"%s.%s\"", name,
	         file->cef ? "cef" : "jsonl");
	(void)MHD_add_response_header(request->response, MHD_HTTP_HEADER_CONTENT_DISPOSITION, text);
	request->type = file->cef ? "text/plain; charset=utf-8" : "application/x-ndjson";
	request->status = MHD_HTTP_OK;
	return true;
}

void db_web_trail_file(struct db_web_request *request)
{
	struct file *file;
	unsigned count = 0;

	(void)MHD_get_connection_values(request->connection, MHD_GET_ARGUMENT_KIND, read_argument,
	                                request->parameters);
	db_web_admit_content(request);
	if (request->status != 0)
		return;
	for (const struct db_web_request *one = request->server->requests; one; one = one->next)
		count += one->route.kind == DB_WEB_TRAIL_FILE && one->job;
	if (count >= DB_WEB_TRAIL_FILES) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "others download the trail at this moment; try again");
		return;
	}
	file = calloc(1, sizeof(*file));
	if (!file) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	file->reader = (struct db_web_trail_reader){ .turn = take_turn, .take = take_page };
	file->request = request;
	file->filter.grant = request->grant;
	file->cef = strcmp(request->route.name, "audit.cef") == 0;
	request->job = file;
	request->end_job = end_file;
	if (!db_web_trail_filter_read(&file->filter, request->parameters))
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "who, drive, kind, through and text have up to %d bytes; "
		                      "since_us and until_us are microseconds since 1970",
		                      DB_WEB_TRAIL_TEXT - 1);
	else if (!attach(request, file))
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
	else
		db_web_log_action(request, "downloads the audit trail", request->parameters);
}
