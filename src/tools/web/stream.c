/* SPDX-License-Identifier: Apache-2.0 */
#include "web/stream.h"
#include "web/additions.h"
#include "web/call.h"
#include "web/service.h"

#include <inttypes.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <zlib.h>

/* Above this the service's answers are not read until the browser has read some. */
#define QUEUE_FULL ((size_t)32 * 1024)

#define ALIVE_EVERY (400 * DB_NS_PER_MS)
#define BLOCK 1024

/* Most bytes of a stream in the kernel that are not under way yet. The rest waits here, where newer
 * values replace older ones. */
#define UNSENT_MAX 2048

/* A window of 8 KiB, of which gzip's form is written (+ 16), and 48 KiB of memory for each stream:
 * names of registers repeat within that. */
#define WINDOW_BITS (13 + 16)
#define MEMORY_LEVEL 5

struct piece {
	struct db_web_text *text;
	struct piece *next;
};

struct db_web_stream {
	struct db_web_stream *next_stream;
	struct db_web_server *server;
	struct db_web_request *request;
	struct db_link *link; /* of its own; NULL: it is over, or its texts come from `next` */
	struct db_web_additions *additions; /* NULL: its answers are the service's */
	db_web_stream_next_fn *next;        /* NULL: it has a link, or is fed */
	void (*gone)(void *data); /* for a fed stream: called when the browser has closed it */
	void *data;
	unsigned seen[DB_WEB_STREAM_KINDS]; /* `next` stores here what it has returned */
	struct piece *first;
	struct piece **last;
	size_t queued;    /* bytes of all pieces */
	size_t sent;      /* of the first piece */
	bool waiting;     /* the connection is suspended until there is something */
	bool ended;       /* nothing follows after the queue */
	db_time told;     /* when the last bytes were handed over */
	bool merges;      /* what a slow reader has missed is merged */
	json_t *newest;   /* the merged answer, which is not written yet; NULL: none */
	z_stream *packer; /* NULL: the browser takes no gzip */
	bool unflushed;   /* the packer has kept some of what it got */
	bool finished;    /* its end is written */
};

uint64_t db_web_moment(void)
{
	return (uint64_t)(db_client_now() / DB_NS_PER_MS);
}

/* --- texts ------------------------------------------------------------------------------------ */

static struct db_web_text *write_text(const char *event, const char *json)
{
	size_t size = strlen(json) + (event ? strlen(event) : 0) +
	              sizeof("id: 18446744073709551615\nevent: \ndata: \n\n");
	struct db_web_text *text = malloc(sizeof(*text) + size);

	if (text) {
		text->users = 1;
		text->size = (size_t)snprintf(
			text->bytes, size, "id: %" PRIu64 "\n%s%s%sdata: %s\n\n", db_web_moment(),
			event ? "event: " : "", event ? event : "", event ? "\n" : "", json);
	}
	return text;
}

struct db_web_text *db_web_text_of(const char *event, const json_t *data)
{
	char *json = data ? json_dumps(data, JSON_COMPACT) : NULL;
	struct db_web_text *text = json ? write_text(event, json) : NULL;

	free(json);
	return text;
}

struct db_web_text *db_web_text_use(struct db_web_text *text)
{
	if (text)
		text->users++;
	return text;
}

void db_web_text_drop(struct db_web_text *text)
{
	if (text && --text->users == 0)
		free(text);
}

static struct db_web_text *write_newest(struct db_web_stream *stream)
{
	struct db_web_text *text = db_web_text_of(NULL, stream->newest);

	json_decref(stream->newest);
	stream->newest = NULL;
	return text;
}

/* --- queue ------------------------------------------------------------------------------------ */

static void wake(struct db_web_stream *stream)
{
	if (!stream->waiting)
		return;
	stream->waiting = false;
	MHD_resume_connection(stream->request->connection);
	db_web_server_wake(stream->server);
}

/* Takes the text over. */
static void append(struct db_web_stream *stream, struct db_web_text *text)
{
	struct piece *piece = text && !stream->ended ? calloc(1, sizeof(*piece)) : NULL;

	if (!piece) {
		/* A stream with an unnoticed gap is worse than none. gcc's analyzer does not see
		 * that a stream has its pieces, through `last`. */
		stream->ended = true;
		db_web_text_drop(text);
	} else {
		/* gcc's analyzer does not see it here either. */
		piece->text = text;
		*stream->last = piece;
		stream->last = &piece->next;
		stream->queued += text->size;
	}
	if (stream->link)
		db_link_hold(stream->link, stream->queued >= QUEUE_FULL);
	wake(stream);
}

static void drop_first(struct db_web_stream *stream)
{
	struct piece *piece = stream->first;

	stream->first = piece->next;
	if (!stream->first)
		stream->last = &stream->first;
	stream->queued -= piece->text->size;
	stream->sent = 0;
	db_web_text_drop(piece->text);
	free(piece);
	if (stream->link && stream->queued < QUEUE_FULL / 2)
		db_link_hold(stream->link, false);
}

static void tell_gone(struct db_web_stream *stream)
{
	void (*gone)(void *data) = stream->gone;

	stream->gone = NULL;
	if (gone)
		gone(stream->data);
}

static void end(struct db_web_stream *stream, const char *event, json_t *data)
{
	struct db_link *link = stream->link;

	/* gcc's analyzer does not see that the queue has the text. */
	stream->link = NULL;
	stream->next = NULL;
	db_link_close(link);
	if (!stream->ended && stream->newest)
		append(stream, write_newest(stream));
	if (!stream->ended)
		append(stream, db_web_text_of(event, data));
	/* gcc's analyzer does not see it here either. */
	stream->ended = true;
	json_decref(data);
	wake(stream);
	tell_gone(stream);
}

/* Samples of one drive: later values replace earlier ones. */
static void merge_sample(json_t *samples, json_t *sample)
{
	const char *drive = json_string_value(json_object_get(sample, "drive"));
	size_t i;
	json_t *before;

	json_array_foreach(samples, i, before)
	{
		const char *name = json_string_value(json_object_get(before, "drive"));

		if (!drive || !name || strcmp(name, drive) != 0)
			continue;
		(void)json_object_update(json_object_get(before, "values"),
		                         json_object_get(sample, "values"));
		(void)json_object_set(before, "time_us", json_object_get(sample, "time_us"));
		return;
	}
	(void)json_array_append(samples, sample);
}

/* Keeps an answer of Subscribe until there is room for it. */
static void merge(struct db_web_stream *stream, json_t *answer)
{
	json_t *samples = json_object_get(stream->newest, "samples");
	json_int_t skipped;
	json_t *sample;
	size_t i;

	if (!stream->newest) {
		stream->newest = json_incref(answer);
		wake(stream);
		return;
	}
	json_array_foreach(json_object_get(answer, "samples"), i, sample)
		merge_sample(samples, sample);
	skipped = 1 + json_integer_value(json_object_get(stream->newest, "skipped")) +
	          json_integer_value(json_object_get(answer, "skipped"));
	(void)json_object_set_new(answer, "skipped", json_integer(skipped));
	(void)json_object_set(answer, "samples", samples);
	json_decref(stream->newest);
	stream->newest = json_incref(answer);
}

/* Writes what waits to be written, if nothing written waits to be sent. */
static void fill_queue(struct db_web_stream *stream)
{
	struct db_web_text *text = NULL;

	if (stream->first)
		return;
	if (stream->newest)
		text = write_newest(stream);
	else if (stream->next && !stream->ended)
		text = stream->next(stream->data, stream->seen);
	if (text)
		append(stream, text);
}

static size_t copy_bytes(struct db_web_stream *stream, char *buffer, size_t most)
{
	size_t used = 0;

	for (fill_queue(stream); stream->first && used < most; fill_queue(stream)) {
		size_t count = stream->first->text->size - stream->sent;

		if (count > most - used)
			count = most - used;
		memcpy(buffer + used, stream->first->text->bytes + stream->sent, count);
		used += count;
		stream->sent += count;
		if (stream->sent == stream->first->text->size)
			drop_first(stream);
	}
	return used;
}

/* The same, packed; what it has taken can be read as soon as these bytes have arrived. */
static size_t pack_bytes(struct db_web_stream *stream, char *buffer, size_t most)
{
	z_stream *packer = stream->packer;

	packer->next_out = (Bytef *)buffer;
	packer->avail_out = (uInt)most;
	for (fill_queue(stream); stream->first && packer->avail_out > 0; fill_queue(stream)) {
		size_t left = stream->first->text->size - stream->sent;

		packer->next_in = (Bytef *)stream->first->text->bytes + stream->sent;
		packer->avail_in = (uInt)left;
		(void)deflate(packer, Z_NO_FLUSH);
		stream->unflushed = true;
		stream->sent += left - packer->avail_in;
		if (packer->avail_in == 0)
			drop_first(stream);
	}
	packer->avail_in = 0;
	if (stream->first || packer->avail_out == 0)
		return most - packer->avail_out;
	if (stream->ended && !stream->finished)
		stream->finished = deflate(packer, Z_FINISH) == Z_STREAM_END;
	else if (stream->unflushed)
		(void)deflate(packer, Z_SYNC_FLUSH);
	stream->unflushed = packer->avail_out == 0;
	return most - packer->avail_out;
}

/* As many bytes as the connection has room for. */
static ssize_t take_bytes(void *data, uint64_t position, char *buffer, size_t most)
{
	struct db_web_stream *stream = data;
	size_t used = stream->packer ? pack_bytes(stream, buffer, most) :
	                               copy_bytes(stream, buffer, most);

	(void)position;
	if (used > 0) {
		stream->told = db_client_now();
		return (ssize_t)used;
	}
	if (stream->ended)
		return MHD_CONTENT_READER_END_OF_STREAM;
	stream->waiting = true;
	MHD_suspend_connection(stream->request->connection);
	return 0;
}

/* --- life ------------------------------------------------------------------------------------- */

static struct db_web_stream *make(struct db_web_request *request)
{
	struct db_web_stream *stream = calloc(1, sizeof(*stream));

	if (!stream) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return NULL;
	}
	stream->server = request->server;
	stream->request = request;
	stream->last = &stream->first;
	stream->told = db_client_now();
	stream->next_stream = request->server->streams;
	request->server->streams = stream;
	return stream;
}

static void free_stream(struct db_web_stream *stream)
{
	struct db_link *link = stream->link;

	tell_gone(stream);
	for (struct db_web_stream **at = &stream->server->streams; *at; at = &(*at)->next_stream) {
		if (*at == stream) {
			*at = stream->next_stream;
			break;
		}
	}
	stream->link = NULL;
	db_link_close(link);
	while (stream->first)
		drop_first(stream);
	json_decref(stream->newest);
	db_web_additions_free(stream->additions);
	if (stream->packer)
		(void)deflateEnd(stream->packer);
	free(stream->packer);
	free(stream);
}

/* From now on the request owns it. */
static void attach(struct db_web_stream *stream)
{
	struct db_web_request *request = stream->request;
	const char *accepted = MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND,
	                                                   MHD_HTTP_HEADER_ACCEPT_ENCODING);
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		request->connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	z_stream *packer = accepted && strstr(accepted, "gzip") ? calloc(1, sizeof(*packer)) : NULL;
	int most = UNSENT_MAX;

	/* What it sends is packed if the browser can unpack it; without memory it is not. */
	if (packer && deflateInit2(packer, Z_DEFAULT_COMPRESSION, Z_DEFLATED, WINDOW_BITS,
	                           MEMORY_LEVEL, Z_DEFAULT_STRATEGY) != Z_OK) {
		free(packer);
		packer = NULL;
	}
	stream->packer = packer;
	request->packed = packer;
	/* A kernel without it holds more, whose age the page knows. */
	if (info)
		(void)setsockopt(info->connect_fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &most,
		                 sizeof(most));
	request->response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, BLOCK, take_bytes,
	                                                      stream, NULL);
	request->stream = stream;
	request->end_stream = free_stream;
	request->status = request->response ? MHD_HTTP_OK : MHD_HTTP_INTERNAL_SERVER_ERROR;
	request->type = "text/event-stream";
	request->answer_by = DB_TIME_NEVER;
}

static void on_answer(void *data, json_t *parameters, const struct db_client_error *error,
                      bool more)
{
	struct db_web_stream *stream = data;

	/* This side is closing it. */
	if (!stream->link)
		return;
	if (error) {
		end(stream, "error", db_web_error_describe(error, NULL));
		return;
	}
	db_web_additions_complete(stream->additions, parameters);
	if (stream->merges)
		merge(stream, parameters);
	else
		append(stream, db_web_text_of(NULL, parameters));
	if (!more)
		end(stream, "end", json_object());
}

static void lose(void *data)
{
	struct db_web_stream *stream = data;

	end(stream, "error",
	    json_pack("{s:s, s:{}, s:s}", "error", "ServiceUnreachable", "parameters", "text",
	              "the service has closed the connection"));
}

/* False: the connection is lost. */
static bool call_service(struct db_web_stream *stream)
{
	const struct db_web_request *request = stream->request;

	return db_link_send(stream->link, request->route.name, json_incref(request->parameters),
	                    true, on_answer, stream) == 0;
}

static void on_registers(void *data, json_t *parameters, const struct db_client_error *error,
                         bool more)
{
	struct db_web_stream *stream = data;
	char problem[256];

	(void)more;
	if (!stream->link)
		return;
	if (error)
		end(stream, "error", db_web_error_describe(error, NULL));
	else if (!db_web_additions_take_registers(stream->additions,
	                                          json_object_get(parameters, "registers"), problem,
	                                          sizeof(problem)))
		end(stream, "error",
		    json_pack("{s:s, s:{}, s:s}", "error", "BadValue", "parameters", "text",
		              problem));
	else if (!call_service(stream))
		lose(stream);
}

void db_web_stream_begin(struct db_web_request *request)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_web_stream *stream;
	const char *problem = NULL;
	const char *drive;
	unsigned count = 0;
	bool sent;

	if (request->route.needs > DB_MAY_LOOK)
		db_web_log_action(request, request->route.name, request->parameters);
	for (stream = request->server->streams; stream; stream = stream->next_stream)
		count += stream->link != NULL;
	if (count >= DB_WEB_STREAM_LINKS) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy",
		                      "there are %u streams of values, events and traces already; "
		                      "close another page",
		                      count);
		return;
	}
	stream = make(request);
	if (!stream)
		return;
	/* The service does not know this one. */
	stream->merges = strcmp(request->route.name, "Subscribe") == 0 &&
	                 json_is_true(json_object_get(request->parameters, "merge"));
	if (stream->merges)
		(void)json_object_del(request->parameters, "merge");
	stream->additions = db_web_additions_new(request, &problem);
	if (problem) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadValue", "%s", problem);
		free_stream(stream);
		return;
	}
	stream->link = db_web_service_open(request->server->service, lose, stream, &error);
	/* A trigger is read with the registers of its drive, so these are asked for first. */
	drive = db_web_additions_drive(stream->additions);
	sent = stream->link &&
	       (drive ? db_link_send(stream->link, "Registers", json_pack("{s:s}", "drive", drive),
	                             false, on_registers, stream) == 0 :
	                call_service(stream));
	if (!sent) {
		if (error.name[0] == '\0')
			db_client_error_set(&error, DB_CLIENT_LOST,
			                    "the service has closed the connection");
		db_web_request_fail(request, &error);
		db_client_error_clear(&error);
		free_stream(stream);
		return;
	}
	attach(stream);
}

struct db_web_stream *db_web_stream_begin_own(struct db_web_request *request,
                                              db_web_stream_next_fn *next, void (*gone)(void *data),
                                              void *data)
{
	struct db_web_stream *stream = make(request);

	if (!stream)
		return NULL;
	stream->next = next;
	stream->gone = gone;
	stream->data = data;
	attach(stream);
	return stream;
}

void db_web_stream_feed(struct db_web_stream *stream, const char *event, const char *json)
{
	append(stream, write_text(event, json));
}

void db_web_stream_tell(struct db_web_stream *stream, const char *event, json_t *object)
{
	char *json = stream && object ? json_dumps(object, JSON_COMPACT) : NULL;

	if (json)
		db_web_stream_feed(stream, event, json);
	free(json);
	json_decref(object);
}

void db_web_stream_finish(struct db_web_stream *stream)
{
	stream->gone = NULL;
	end(stream, "end", json_object());
}

unsigned db_web_stream_count_shared(const struct db_web_server *server)
{
	unsigned count = 0;

	for (const struct db_web_stream *stream = server->streams; stream;
	     stream = stream->next_stream)
		count += stream->next != NULL;
	return count;
}

void db_web_stream_poke(struct db_web_server *server)
{
	for (struct db_web_stream *stream = server->streams; stream; stream = stream->next_stream) {
		if (stream->next)
			wake(stream);
	}
}

void db_web_stream_tick(struct db_web_server *server, db_time now)
{
	static const char alive[] = ": alive\n\n";

	for (struct db_web_stream *stream = server->streams; stream; stream = stream->next_stream) {
		const struct db_web_request *request = stream->request;
		struct db_web_text *text;

		if (stream->ended)
			continue;
		/* Viewing keeps an observer's session alive without input; those of others have to
		 * expire. */
		if (request->session[0] != '\0' &&
		    !db_web_sessions_find(server->sessions, request->session, now))
			db_web_stream_end(server, request->session, "LoginRequired",
			                  "the login has ended");
		else if (request->session[0] != '\0' && request->grant.role == DB_ROLE_OBSERVER)
			db_web_sessions_touch(server->sessions, request->session, now);
		if (stream->ended || !stream->waiting || now - stream->told < ALIVE_EVERY)
			continue;
		/* gcc's analyzer does not see that the queue gets the text. */
		text = malloc(sizeof(*text) + sizeof(alive));
		if (text) {
			text->users = 1;
			text->size = sizeof(alive) - 1;
			memcpy(text->bytes, alive, sizeof(alive));
		}
		append(stream, text);
	}
}

void db_web_stream_end(struct db_web_server *server, const char *session, const char *error,
                       const char *text)
{
	for (struct db_web_stream *stream = server->streams; stream; stream = stream->next_stream) {
		if (!stream->ended && (!session || strcmp(stream->request->session, session) == 0))
			end(stream, "error",
			    json_pack("{s:s, s:{}, s:s}", "error", error, "parameters", "text",
			              text));
	}
}
