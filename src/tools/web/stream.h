/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Long answers: server-sent events, packed by gzip for a browser that takes it. Texts are written
 * once and shared by all streams; the id of each is the moment at which it was written
 * (db_web_moment()). A slow reader holds up only its own connection to the service, which then
 * leaves out old data and says so; of the overview, and of a Subscribe with `merge` in its call, it
 * gets the newest values as soon as it has read the ones before. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_STREAM_H
#define DRIVEBRIDGE_WEB_STREAM_H

#include "client/client.h"
#include "web/request.h"

/* Text of one or several events, reference counted. */
struct db_web_text {
	unsigned users;
	size_t size;
	char bytes[];
};

/* Milliseconds of this program's clock, which pages compare with the ids of texts. */
uint64_t db_web_moment(void);

/* "id: MOMENT\nevent: NAME\ndata: {...}\n\n", with one reference; `event` may be NULL. NULL without
 * memory. */
struct db_web_text *db_web_text_of(const char *event, const json_t *data);
struct db_web_text *db_web_text_use(struct db_web_text *text);
void db_web_text_drop(struct db_web_text *text);

struct db_web_stream;

/* Number of kinds of news in the overview. */
#define DB_WEB_STREAM_KINDS 6

/* The next text of the overview; NULL: nothing now. The stream gets its reference. */
typedef struct db_web_text *db_web_stream_next_fn(void *data, unsigned seen[DB_WEB_STREAM_KINDS]);

/* Begins a streaming call of the service, or answers the request with the reason why not. */
void db_web_stream_begin(struct db_web_request *request);

/* Begins a stream with texts of this program; NULL: the request is answered with the reason. They
 * come from `next`, which is called when there is room and after db_web_stream_poke(); NULL: it is
 * fed by the functions below. `gone` (NULL: nobody needs it) is called when the browser has closed
 * it; after that it must not be used. */
struct db_web_stream *db_web_stream_begin_own(struct db_web_request *request,
                                              db_web_stream_next_fn *next, void (*gone)(void *data),
                                              void *data);

/* Sends an event, with an object as its text. */
void db_web_stream_feed(struct db_web_stream *stream, const char *event, const char *json);

/* The same with an object, which is taken over. Without a stream it does nothing. */
void db_web_stream_tell(struct db_web_stream *stream, const char *event, json_t *object);

/* Ends it; `gone` is not called, and it must not be used any more. */
void db_web_stream_finish(struct db_web_stream *stream);

/* The number of streams with texts from `next`. */
unsigned db_web_stream_count_shared(const struct db_web_server *server);

/* There is a new text for the shared streams. */
void db_web_stream_poke(struct db_web_server *server);

/* Sends keep-alives, and ends streams of ended sessions. */
void db_web_stream_tick(struct db_web_server *server, db_time now);

/* Ends the streams of a session; all with NULL. */
void db_web_stream_end(struct db_web_server *server, const char *session, const char *error,
                       const char *text);

#endif
