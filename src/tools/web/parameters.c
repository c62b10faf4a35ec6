/* SPDX-License-Identifier: Apache-2.0 */
#include "web/parameters.h"
#include "client/log.h"
#include "params/file.h"
#include "params/writer.h"
#include "web/call.h"
#include "web/service.h"
#include "web/stream.h"
#include "web/tabs.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DRIVE_MAX 64
#define FILE_NAME_MAX 120
#define ANSWER_WITHIN (15 * DB_NS_PER_S)
/* After this time a writing pauses until the next tick, so that the page's watchdogs are fed. */
#define PAUSE_EVERY (200 * DB_NS_PER_MS)

struct db_web_parameters {
	struct db_web_parameters *next;
	struct db_web_server *server;
	struct db_web_caller caller;
	enum db_web_kind kind;
	uint64_t number; /* of its request */
	char drive[DRIVE_MAX];
	char family[40];
	json_t *registers;
	bool waiting; /* for an answer of the service, which frees it if it has ended */
	bool ended;
	/* Of a writing: */
	struct db_web_stream *stream; /* NULL: the page has closed it */
	struct db_web_request *page;  /* valid as long as the stream */
	db_time answer_by;
	db_time paused;
	bool pausing;
	bool standing;   /* only while the drive stands */
	bool checks;     /* and that it does is to be checked first */
	const char *end; /* why no more is to be written; NULL */
	json_t *values;
	json_t *plan;
	struct db_params_writer writer; /* begun when there is a plan */
};

static void go_on(struct db_web_parameters *job);

/* --- life ------------------------------------------------------------------------------------- */

static void dispose(struct db_web_parameters *job)
{
	struct db_web_parameters **at = &job->server->parameters;

	while (*at && *at != job)
		at = &(*at)->next;
	if (*at)
		*at = job->next;
	db_params_writer_clear(&job->writer);
	json_decref(job->registers);
	json_decref(job->values);
	json_decref(job->plan);
	free(job);
}

/* The page has its answer, or is gone. */
static void end(struct db_web_parameters *job)
{
	job->ended = true;
	if (!job->waiting)
		dispose(job);
}

/* Its request, as long as it is not answered. */
static struct db_web_request *find_request(const struct db_web_parameters *job)
{
	return job->stream ? job->page : db_web_request_find(job->server, job->number);
}

/* Nothing could be done. Takes the body over. */
static void refuse(struct db_web_parameters *job, unsigned status, json_t *body)
{
	struct db_web_request *request = find_request(job);
	struct db_web_stream *stream = job->stream;

	if (stream) {
		db_web_stream_tell(job->stream, "error", body);
		job->stream = NULL;
		db_web_stream_finish(stream);
	} else if (request) {
		db_web_request_answer(request, status, body);
	} else {
		json_decref(body);
	}
	end(job);
}

static json_t *describe_error(const char *name, const char *text)
{
	return json_pack("{s:s, s:{}, s:s}", "error", name, "parameters", "text", text);
}

/* A shortened name may end within a letter. */
static json_t *describe_mistakes(char *said)
{
	json_t *body = describe_error("BadFile", said);

	for (char *at = said; !body && *at; at++) {
		if ((unsigned char)*at >= 0x80)
			*at = '?';
	}
	return body ? body : describe_error("BadFile", said);
}

static void fail(struct db_web_parameters *job, const struct db_client_error *error)
{
	unsigned status;
	json_t *body = db_web_error_describe(error, &status);

	refuse(job, status, body);
}

/* --- files ------------------------------------------------------------------------------------ */

static void answer_values(struct db_web_parameters *job, const char *name, const char *text)
{
	json_t *families = json_pack("{s:O}", job->family, job->registers);
	struct db_params file;
	char *said = NULL;
	size_t length = 0;
	FILE *errors = open_memstream(&said, &length);
	struct db_web_request *request = find_request(job);
	bool right = errors && db_params_read(&file, name, text, families, errors);
	json_t *body = NULL;

	if (right && strcmp(file.family, job->family) != 0) {
		right = false;
		fprintf(errors, "%s:%u: these are parameters of %s, and %s is %s\n", name,
		        file.family_line, file.family, job->drive, job->family);
	}
	if (errors)
		(void)fclose(errors);
	if (right)
		body = json_pack("{s:s, s:s, s:O}", "name", name, "identity", file.identity,
		                 "values", file.values);
	else if (said)
		body = describe_mistakes(said);
	right = right && body;
	if (!body)
		body = describe_error("BadFile", "its identity is too long, or there is no memory");
	db_web_request_answer(request, right ? MHD_HTTP_OK : MHD_HTTP_BAD_REQUEST, body);
	/* It only says whether the file was read. */
	/* cppcheck-suppress deallocuse */
	if (errors)
		db_params_clear(&file);
	free(said);
	json_decref(families);
	end(job);
}

/* `answer` is that to a read of db_params_names(). */
static void answer_file(struct db_web_parameters *job, const json_t *answer)
{
	struct db_web_request *request = find_request(job);
	struct db_params drive;
	char *text = NULL;

	if (!db_params_take(&drive, job->drive, job->family, job->registers, answer))
		db_web_request_refuse(request, MHD_HTTP_CONFLICT, "Refused",
		                      "the parameters of %s are not known now; the overview says "
		                      "what it needs",
		                      job->drive);
	else
		text = db_params_write(&drive);
	if (text)
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:s, s:o, s:O?, s:I}", "text", text, "not_told",
		                                db_params_untold(&drive), "missing", drive.missing,
		                                "oldest_ms", db_params_oldest_ms(&drive)));
	else
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
	free(text);
	db_params_clear(&drive);
	end(job);
}

/* --- writing ---------------------------------------------------------------------------------- */

static void report(void *data, const char *name, const char *state, const char *text,
                   const json_t *value)
{
	const struct db_web_parameters *job = data;

	db_web_stream_tell(job->stream, "parameter",
	                   json_pack("{s:s, s:s, s:s, s:O*}", "name", name, "state", state, "text",
	                             text, "value", value));
}

/* With those that were not tried any more. */
static void conclude(struct db_web_parameters *job)
{
	struct db_params_writer *writer = &job->writer;
	struct db_web_stream *stream = job->stream;
	json_t *untried = db_params_writer_untried(writer);
	size_t i;
	const json_t *name;

	json_array_foreach(untried, i, name)
	{
		(void)json_object_set_new(writer->failed, json_string_value(name),
		                          json_string("not tried any more"));
		report(job, json_string_value(name), "stopped", "not tried any more", NULL);
	}
	json_decref(untried);
	db_client_log(DB_CLIENT_NOTICE, "%s: parameters of %s: %zu written, %zu not%s%s",
	              job->caller.text, job->drive, json_array_size(writer->written),
	              json_object_size(writer->failed), writer->over[0] ? ": " : "", writer->over);
	db_web_stream_tell(job->stream, "result",
	                   json_pack("{s:O, s:O, s:s}", "written", writer->written, "failed",
	                             writer->failed, "over", writer->over));
	job->stream = NULL;
	if (stream)
		db_web_stream_finish(stream);
	end(job);
}

static void begin_writing(struct db_web_parameters *job)
{
	json_t *names = json_array();
	const char *name;
	json_t *value;

	json_object_foreach(job->values, name, value)
	{
		(void)json_array_append_new(names, json_string(name));
	}
	job->plan = db_params_order(job->registers, names);
	json_decref(names);
	job->writer = (struct db_params_writer){
		.drive = job->drive,
		.registers = job->registers,
		.values = job->values,
		.plan = job->plan,
		.standing = job->standing,
		.report = report,
		.data = job,
	};
	db_params_writer_begin(&job->writer);
	go_on(job);
}

static void take_written(struct db_web_parameters *job, const json_t *answer,
                         const struct db_client_error *error)
{
	struct db_client_error told = { .parameters = NULL };
	json_t *described = error ? db_web_error_describe(error, NULL) : NULL;

	if (error) {
		told = *error;
		snprintf(told.text, sizeof(told.text), "%s",
		         json_string_value(json_object_get(described, "text")));
	}
	db_params_writer_take(&job->writer, answer, &told);
	json_decref(described);
	if (db_client_now() - job->paused < PAUSE_EVERY)
		go_on(job);
	else
		job->pausing = true;
}

/* --- calls ------------------------------------------------------------------------------------ */

static void take_answer(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct db_web_parameters *job = data;
	struct db_web_request *request;

	(void)more;
	job->waiting = false;
	request = find_request(job);
	if (job->ended || !request) {
		dispose(job);
	} else if (job->plan) {
		take_written(job, error ? NULL : parameters, error);
	} else if (error) {
		fail(job, error);
	} else if (!job->registers) {
		job->registers = json_incref(json_object_get(parameters, "registers"));
		go_on(job);
	} else if (job->kind == DB_WEB_PARAMETERS_FILE) {
		answer_file(job, parameters);
	} else if (db_words_has_bit(
			   db_words_look_up(job->registers, "status"),
			   json_object_get(json_object_get(parameters, "values"), "status"),
			   "moving")) {
		refuse(job, MHD_HTTP_CONFLICT,
		       describe_error("Refused", "the drive moves; stop it first"));
	} else {
		job->checks = false;
		begin_writing(job);
	}
}

static void call(struct db_web_parameters *job, struct db_link *link, const char *method,
                 json_t *parameters)
{
	struct db_client_error error = { .parameters = NULL };

	job->answer_by = db_client_now() + ANSWER_WITHIN;
	if (link && db_link_send(link, method, parameters, false, take_answer, job) == 0) {
		job->waiting = true;
		return;
	}
	if (!link)
		json_decref(parameters);
	db_client_error_set(&error, DB_CLIENT_UNREACHABLE, "drivebridged cannot be reached");
	if (job->plan) {
		db_params_writer_take(&job->writer, NULL, &error);
		conclude(job);
	} else {
		fail(job, &error);
	}
	db_client_error_clear(&error);
}

static void write_next(struct db_web_parameters *job)
{
	struct db_params_writer *writer = &job->writer;
	const char *why = job->end;
	struct db_link *link = db_web_tabs_link(job->page, job->drive, &why);
	const char *method;
	json_t *parameters;

	if (why && !writer->reads_back)
		db_params_writer_end(writer, why);
	method = db_params_writer_next(writer, &parameters);
	if (method)
		call(job, link, method, parameters);
	else
		conclude(job);
}

/* The next call. */
static void go_on(struct db_web_parameters *job)
{
	struct db_link *link = db_web_service_reader(job->server->service);
	const struct db_web_request *request = find_request(job);

	job->pausing = false;
	if (job->plan)
		write_next(job);
	else if (!job->registers)
		call(job, link, "Registers", json_pack("{s:s}", "drive", job->drive));
	else if (job->kind == DB_WEB_PARAMETERS_READ)
		answer_values(job, json_string_value(json_object_get(request->parameters, "name")),
		              json_string_value(json_object_get(request->parameters, "text")));
	else if (job->kind == DB_WEB_PARAMETERS_FILE)
		call(job, link, "Read",
		     json_pack("{s:s, s:o}", "drive", job->drive, "names",
		               db_params_names(job->registers)));
	else if (job->checks)
		call(job, link, "Read",
		     json_pack("{s:s, s:[s]}", "drive", job->drive, "names", "status"));
	else
		begin_writing(job);
}

/* --- requests of pages ------------------------------------------------------------------------ */

static void lose_page(void *data)
{
	struct db_web_parameters *job = data;

	job->stream = NULL;
	end(job);
}

/* True: they are numbers by name, at least one. */
static bool are_values(json_t *values)
{
	const char *name;
	json_t *value;

	json_object_foreach(values, name, value)
	{
		if (!json_is_number(value))
			return false;
	}
	return json_object_size(values) > 0;
}

/* False: the request is answered with the mistake. */
static bool check_request(struct db_web_request *request)
{
	const json_t *parameters = request->parameters;
	const char *drive = json_string_value(json_object_get(parameters, "drive"));
	const char *name = json_string_value(json_object_get(parameters, "name"));
	const char *right = "{\"drive\": ...}";
	bool good = drive && drive[0] != '\0' && strlen(drive) < DRIVE_MAX;

	if (request->route.kind == DB_WEB_PARAMETERS_READ) {
		right = "{\"drive\": ..., \"name\": of the file, \"text\": what is in it}";
		good = good && name && strlen(name) < FILE_NAME_MAX &&
		       json_is_string(json_object_get(parameters, "text"));
	} else if (request->route.kind == DB_WEB_PARAMETERS) {
		right = "{\"drive\": ..., \"values\": numbers by name}";
		good = good && are_values(json_object_get(parameters, "values"));
	}
	if (!good)
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest", "right is %s",
		                      right);
	return good;
}

static struct db_web_parameters *find_writing(const struct db_web_server *server, const char *drive)
{
	struct db_web_parameters *one = server->parameters;

	while (one &&
	       (one->kind != DB_WEB_PARAMETERS || one->ended || strcmp(one->drive, drive) != 0))
		one = one->next;
	return one;
}

/* False: the request is answered with the reason. */
static bool begin_stream(struct db_web_parameters *job, struct db_web_request *request)
{
	const struct db_web_parameters *other = find_writing(job->server, job->drive);

	if (other) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "%s writes parameters into %s already", other->caller.text,
		                      job->drive);
		return false;
	}
	if (!db_web_tabs_begin(request, job->drive))
		return false;
	job->values = json_incref(json_object_get(request->parameters, "values"));
	job->checks = job->standing = json_is_true(
		json_object_get(request->parameters, "standing"));
	job->paused = db_client_now();
	job->page = request;
	job->stream = db_web_stream_begin_own(request, NULL, lose_page, job);
	return job->stream;
}

void db_web_parameters_take(struct db_web_request *request)
{
	const json_t *description = request->server->service->description;
	const char *drive = json_string_value(json_object_get(request->parameters, "drive"));
	struct db_web_parameters *job;
	const json_t *entry;
	const json_t *bus;

	if (!check_request(request))
		return;
	/* The page has enough. */
	if (request->route.kind == DB_WEB_PARAMETERS_END) {
		job = find_writing(request->server, drive);
		if (job && (!job->stream || strcmp(job->page->tab, request->tab) != 0 ||
		            strcmp(job->page->session, request->session) != 0))
			job = NULL;
		if (job)
			job->end = "it was ended";
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:b}", "ends", job != NULL));
		return;
	}
	if (request->route.acts)
		db_web_log_action(request, request->route.name, request->parameters);
	job = calloc(1, sizeof(*job));
	if (!job) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	/* The family of a drive is the protocol of its bus. */
	entry = db_words_look_up(json_object_get(description, "drives"), drive);
	bus = db_words_look_up(json_object_get(description, "buses"), db_words_text(entry, "bus"));
	job->server = request->server;
	job->caller = db_web_request_caller(request);
	job->kind = request->route.kind;
	job->number = request->number;
	snprintf(job->drive, sizeof(job->drive), "%s", drive);
	snprintf(job->family, sizeof(job->family), "%s", db_words_text(bus, "protocol"));
	if (job->kind == DB_WEB_PARAMETERS && !begin_stream(job, request)) {
		free(job);
		return;
	}
	if (job->kind != DB_WEB_PARAMETERS)
		request->answer_by = db_client_now() + ANSWER_WITHIN;
	job->next = request->server->parameters;
	request->server->parameters = job;
	go_on(job);
}

void db_web_parameters_tick(struct db_web_server *server, db_time now)
{
	struct db_web_parameters *next;

	for (struct db_web_parameters *job = server->parameters; job; job = next) {
		next = job->next;
		if (job->ended || job->kind != DB_WEB_PARAMETERS)
			continue;
		if (job->waiting && now >= job->answer_by) {
			refuse(job, 0,
			       describe_error("NoAnswer", "the service does not answer in time"));
		} else if (job->pausing) {
			job->paused = now;
			go_on(job);
		}
	}
}

void db_web_parameters_free(struct db_web_server *server)
{
	while (server->parameters) {
		struct db_web_parameters *job = server->parameters;

		server->parameters = job->next;
		dispose(job);
	}
}
