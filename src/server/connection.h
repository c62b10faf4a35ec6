/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One client: its bytes in and out, and its requests in flight. Answers leave in the order of the
 * requests; writes reach the backend the moment they are read, everything else when its turn comes
 * to be answered. Network thread only.
 *
 * Work per call is bounded by the size of the input buffer: one receive of at most 260 bytes, which
 * is 21 register reads or 32 of the shortest requests. What has not been received stays in the
 * kernel, and the loop comes back for it after every other client had its turn.
 */
#ifndef DRIVEBRIDGE_SERVER_CONNECTION_H
#define DRIVEBRIDGE_SERVER_CONNECTION_H

#include "server/execute.h"
#include "server/peers.h"

/* The longest answers to one full input buffer: 32 requests of 8 bytes. */
#define DB_BATCH_SIZE (DB_ADU_MAX / 8 * DB_ADU_MAX)

struct db_connection;

/* What all connections of a server share. */
struct db_connection_shared {
	const struct db_modbus_config *config; /* may be another one between two calls */
	struct db_executor executor;
	struct db_server_stats stats;
	struct db_peers *peers;
	int epoll;
	size_t batch_used;
	/* Answers of the one connection that is being served; empty between calls. */
	uint8_t batch[DB_BATCH_SIZE];
};

/* Counts that something was refused to an address, and has it logged. */
void db_connection_count_refusal(struct db_connection_shared *shared, struct db_peer *peer,
                                 enum db_refusal kind, db_time now);

/* Takes over the descriptor (also on failure) and waits for input. Counts among its peer's until it
 * is freed. Null when out of memory. */
struct db_connection *db_connection_new(struct db_connection_shared *shared, int fd,
                                        const struct db_client *client, struct db_peer *peer,
                                        db_time now);

/* Closes the socket. Answers that come later find nobody. */
void db_connection_free(struct db_connection *connection);

const struct db_client *db_connection_client(const struct db_connection *connection);
void db_connection_describe(const struct db_connection *connection,
                            struct db_server_client *description, db_time now);

/* What is remembered of its address is elsewhere now, and counts it there already. */
void db_connection_rehome(struct db_connection *connection, struct db_peer *peer);

/* The shared configuration is another one now: what its client may do. It goes on with
 * db_connection_advance(). */
void db_connection_adapt(struct db_connection *connection, bool may_write);

/* A request that waits for its turn need not wait any longer. */
void db_connection_take_turn(struct db_connection *connection, db_time now);

/* Counts that something was refused to its client, and has it logged. */
void db_connection_refused(struct db_connection *connection, enum db_refusal kind, db_time now);

/* The next three return false when the connection is over and to be freed. */

/* Its socket is ready (EPOLLIN and so on). */
bool db_connection_ready(struct db_connection *connection, uint32_t events, db_time now);

/* Sends what can be answered and goes on with requests that had to wait. */
bool db_connection_advance(struct db_connection *connection, db_time now);

/* Whether it is within its time limits; a connection that is not counts as timed out. */
bool db_connection_in_time(const struct db_connection *connection, db_time now);

/* Whether it waited for its turn, which has come: db_connection_advance() goes on. */
bool db_connection_has_turn(const struct db_connection *connection, db_time now);

/* When db_connection_in_time() may become false or db_connection_has_turn() true: DB_TIME_NEVER if
 * nothing is running. */
db_time db_connection_deadline(const struct db_connection *connection);

/*
 * Notes the answer to a write. True when db_connection_advance() has something to do now; a write
 * that is unknown or answered already is ignored.
 */
bool db_connection_answer(struct db_connection *connection, uint32_t sequence, uint8_t exception);

#endif
