/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One client: its bytes in and out, and its requests in flight. Answers leave in the order of the
 * requests; writes reach the backend when they are read, everything else when it is its turn to be
 * answered. Network thread only.
 *
 * Work per call is bounded by the size of the input buffer: one receive of at most 260 bytes, which
 * is 21 register reads or 32 of the shortest requests. Bytes that were not received stay in the
 * kernel, and the loop returns to them after every other client had its turn.
 */
#ifndef DRIVEBRIDGE_SERVER_CONNECTION_H
#define DRIVEBRIDGE_SERVER_CONNECTION_H

#include "server/execute.h"
#include "server/peers.h"

/* The longest answers to one full input buffer: 32 requests of 8 bytes. */
#define DB_BATCH_SIZE (DB_ADU_MAX / 8 * DB_ADU_MAX)

struct db_connection_entry;

/* Data shared by all connections of a server. */
struct db_connection_shared {
	const struct db_modbus_config *config; /* may change between two calls */
	struct db_executor executor;
	struct db_server_stats stats;
	struct db_peers *peers;
	int epoll;
	size_t batch_used;
	/* Answers of the one connection that is being served; empty between calls. */
	uint8_t batch[DB_BATCH_SIZE];
};

/* Only connection.c changes it, but for what is said of the server. */
struct db_connection {
	struct db_connection_shared *shared;
	/* The server changes the rights of the client: then db_connection_advance() is due. */
	struct db_client client;
	struct db_peer
		*peer; /* the record of its address; another one when the records were moved */
	uint64_t requests;
	struct db_diagnostics diagnostics;
	db_time since;
	db_time frame_since;  /* when the unfinished frame in `in` began */
	db_time active_since; /* last byte in either direction */
	db_time turn;         /* time of the next request, when it came too early; else 0. The
	                         server ends the wait when the limit is another one */
	int fd;
	uint32_t events; /* events that epoll waits for */

	/* Ring of `room` entries, allocated only while not empty. */
	struct db_connection_entry *queue;
	unsigned room;
	uint32_t sequence; /* number of the first entry; the others follow without gaps */
	unsigned first, queued, unfinished;

	/* Answers that the socket did not take; allocated only while not empty. */
	uint8_t *out;
	size_t out_sent, out_used;

	/* Arrival times of received bytes, see note_arrival(); client.arrived is for the bytes in
	 * `in`. */
	bool behind;       /* the socket contains, or may contain, bytes older than now */
	size_t marked;     /* bytes that were there at mark_time and are not read yet */
	db_time mark_time; /* later bytes arrived after this time */

	char *role;   /* of its certificate, "": none; null: it came without */
	bool barred;  /* every request is answered 01 */
	bool closing; /* the client has closed its side, and its last bytes are being read */
	bool ended;   /* the client will send nothing more */
	bool waiting; /* a request in `in` may not be taken yet */
	uint16_t in_used;
	uint8_t in[DB_ADU_MAX];
};

/* Counts a refusal to an address, and logs it where due. */
void db_connection_count_refusal(struct db_connection_shared *shared, struct db_peer *peer,
                                 enum db_refusal kind, db_time now);

/* Takes over the descriptor (also on failure) and waits for input. Counts as a connection of its
 * peer until it is freed. `role`: that of its certificate, "" when it has none; null: it came
 * without. `client->arrived`: when what is in the socket already came; 0: now. Null when out of
 * memory. */
struct db_connection *db_connection_new(struct db_connection_shared *shared, int fd,
                                        const struct db_client *client, const char *role,
                                        struct db_peer *peer, db_time now);

/* Closes the socket. Later answers are dropped. */
void db_connection_free(struct db_connection *connection);

/* The next two return false when the connection is over and to be freed. */

/* Its socket is ready (EPOLLIN and so on). */
bool db_connection_ready(struct db_connection *connection, uint32_t events, db_time now);

/* Sends the answers that are ready and continues with requests that had to wait. */
bool db_connection_advance(struct db_connection *connection, db_time now);

/* When it is closed because its client has not completed something; DB_TIME_NEVER: nothing is
 * running. */
db_time db_connection_time_limit(const struct db_connection *connection);

/* The same, or the earlier time at which its next request has its turn: then
 * db_connection_advance() is due. */
db_time db_connection_deadline(const struct db_connection *connection);

/*
 * Notes the answer to a write. True when db_connection_advance() has something to do now; unknown
 * or already answered writes are ignored.
 */
bool db_connection_answer(struct db_connection *connection, uint32_t sequence, uint8_t exception);

#endif
