/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Answers that go on: server-sent events. Texts are made once and given to all that want them. Who reads slowly holds up
 * his own connection to the service, which then leaves out what is old and says so; of the overview he gets what is
 * newest. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_STREAM_H
#define DRIVEBRIDGE_WEB_STREAM_H

#include "client/client.h"
#include "web/request.h"

/* Text of one or several events, shared. */
struct db_web_text {
	unsigned users;
	size_t size;
	char bytes[];
};

/* "event: NAME\ndata: {...}\n\n", with one user; `event` may be NULL. NULL without memory. */
struct db_web_text *db_web_text_of(const char *event, const json_t *data);
struct db_web_text *db_web_text_use(struct db_web_text *text);
void db_web_text_drop(struct db_web_text *text);

struct db_web_stream;

/* So many kinds of things the overview tells. */
#define DB_WEB_STREAM_KINDS 5

/* What the overview wants to tell next; NULL: nothing now. The stream's own to keep. */
typedef struct db_web_text *db_web_stream_next_fn(void *data, unsigned seen[DB_WEB_STREAM_KINDS]);

/* Begins a call of the service that goes on, or answers the request with why not. */
void db_web_stream_begin(struct db_web_request *request);

/* Begins a stream whose texts `next` gives, asked whenever there is room and after db_web_stream_poke(). */
void db_web_stream_begin_shared(struct db_web_request *request, db_web_stream_next_fn *next,
                                void *data);

/* So many have their texts from `next`. */
unsigned db_web_stream_count_shared(const struct db_web_server *server);

/* There is something new for those that share. */
void db_web_stream_poke(struct db_web_server *server);

/* Signs of life, sessions that are over. */
void db_web_stream_tick(struct db_web_server *server, db_time now);

/* Ends those of a session; of all with NULL. */
void db_web_stream_end(struct db_web_server *server, const char *session, const char *error,
                       const char *text);

#endif
