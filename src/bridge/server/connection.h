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

struct db_connection;

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

const struct db_client *db_connection_client(const struct db_connection *connection);
/* Its address in the network, which is not that of its client where that has a user of this
 * machine. */
const uint8_t *db_connection_address(const struct db_connection *connection);
void db_connection_describe(const struct db_connection *connection,
                            struct db_server_client *description, db_time now);

/* The record of its address has moved, and counts this connection already. */
void db_connection_rehome(struct db_connection *connection, struct db_peer *peer);

/* The client's rights, from now on. Then call db_connection_advance(). `barred`: its certificate
 * has no role of the configuration, and every request is answered 01. */
void db_connection_adapt(struct db_connection *connection, bool may_write,
                         const struct db_role_config *role, bool barred);

bool db_connection_is_barred(const struct db_connection *connection);
/* The role that its certificate has; null: it came without. */
const char *db_connection_role(const struct db_connection *connection);

/* A request that waits for its turn need not wait any longer. */
void db_connection_take_turn(struct db_connection *connection, db_time now);

/* Counts a refusal to its client, and logs it where due. */
void db_connection_refused(struct db_connection *connection, enum db_refusal kind, db_time now);

/* The next three return false when the connection is over and to be freed. */

/* Its socket is ready (EPOLLIN and so on). */
bool db_connection_ready(struct db_connection *connection, uint32_t events, db_time now);

/* Sends the answers that are ready and continues with requests that had to wait. */
bool db_connection_advance(struct db_connection *connection, db_time now);

/* True if it is within its time limits; otherwise the connection counts as timed out. */
bool db_connection_in_time(const struct db_connection *connection, db_time now);

/* True if it waited for its turn, which has come: call db_connection_advance(). */
bool db_connection_has_turn(const struct db_connection *connection, db_time now);

/* When db_connection_in_time() may become false or db_connection_has_turn() true: DB_TIME_NEVER if
 * nothing is running. */
db_time db_connection_deadline(const struct db_connection *connection);

/*
 * Notes the answer to a write. True when db_connection_advance() has something to do now; unknown
 * or already answered writes are ignored.
 */
bool db_connection_answer(struct db_connection *connection, uint32_t sequence, uint8_t exception);

#endif
