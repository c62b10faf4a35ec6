/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A client as the rooms behind the server know it, and the write of one that is answered later.
 * Pure; any thread.
 */
#ifndef DRIVEBRIDGE_CLIENT_H
#define DRIVEBRIDGE_CLIENT_H

#include "drivebridge/result.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/* Numbers that no client has: nobody in particular, and the parts of a group command. */
#define DB_CLIENT_NOBODY 0
#define DB_CLIENT_GROUP UINT32_MAX

/* Sessions of the control socket have numbers from here on, connections of Modbus those below: an answer finds
 * its way by its client's number alone. */
#define DB_CLIENT_FIRST_SESSION UINT32_C(0x80000000)

/* The number that follows among those of its kind; skips those that no client has. */
uint32_t db_client_number_after(uint32_t id);
bool db_client_is_session(uint32_t id);

/* Who asks. Valid for the duration of the call. */
struct db_client {
	uint32_t id; /* of this connection: no other one's while it lasts; none of those above */
	uint8_t address
		[16];  /* IPv6, or IPv4 v4-mapped; of a session: db_client_address_of_session() */
	uint16_t port; /* not 0; of a session: a number of its own, as far as 16 bits go */
	bool may_write;
	/* The request did not reach this machine before this time, and perhaps at this time: one
	 * that waited in a buffer is no sign of life of now. 0: just now. */
	db_time arrived;
};

/* When its request arrived, as far as is known. */
static inline db_time db_client_arrived(const struct db_client *client, db_time now)
{
	return client && client->arrived != 0 ? client->arrived : now;
}

#define DB_CLIENT_ADDRESS_MAX 46

/* Who a session is. Two that are the same in all of this are, for the drives, one client that came back. */
struct db_client_session {
	uint32_t user;  /* of its process, as the kernel tells it */
	uint32_t actor; /* stands for what is known beside that: names; 0: nothing */
	bool named;     /* it has said for whom it acts */
};

/* That in the place of an address: one that no client of a network has. */
void db_client_address_of_session(const struct db_client_session *session, uint8_t address[16]);
/* False: it is no session's. */
bool db_client_session_of_address(const uint8_t address[16], struct db_client_session *session);

/* The address as people write it: "192.168.10.5", "fd00::5"; "control, user 1000". */
void db_client_address(const uint8_t address[16], char text[DB_CLIENT_ADDRESS_MAX]);

/* Names of users with their ends: those of this machine, and those whom a session acts for. */
#define DB_CLIENT_PROCESS_USER_MAX 32
#define DB_CLIENT_USER_MAX 33

/* A client in words. */
struct db_client_words {
	char address
		[DB_CLIENT_ADDRESS_MAX]; /* as above; "control, user anna" where the name is known */
	char user[DB_CLIENT_USER_MAX];   /* whom a session says it acts for; "": it has not said */
};

/* `process_user` and `user` are a session's, "": not known. */
void db_client_words_init(struct db_client_words *words, const uint8_t address[16],
                          const char *process_user, const char *user);

/* Both in one: "control, user drivebridge-web for anna". The first is what the kernel vouches for. */
#define DB_CLIENT_TEXT_MAX (DB_CLIENT_ADDRESS_MAX + 5 + DB_CLIENT_USER_MAX)
void db_client_words_join(const struct db_client_words *words, char text[DB_CLIENT_TEXT_MAX]);

/* An IPv4 address in one number, the first byte highest; DB_CLIENT_IPV6 for what is none. */
#define DB_CLIENT_IPV6 UINT32_MAX
uint32_t db_client_ipv4(const uint8_t address[16]);

/*
 * Names one write that is to be answered later. Stays valid in the sense that answering it is
 * always allowed: when its connection has gone meanwhile, the answer is dropped.
 */
struct db_write_token {
	uint32_t client;
	uint32_t sequence;
};

/* What the writer is told of its write. */
struct db_write_answer {
	bool later; /* nothing yet: it waits for the end, and is told that by its token */
	/* Else this. PENDING: it is on its way, and the writer is not told of its end. */
	enum db_result result;
};

/* Whether the write was not refused: it was carried out, or is on its way. */
static inline bool db_write_is_taken(struct db_write_answer answer)
{
	return answer.later || answer.result == DB_RESULT_PENDING ||
	       db_result_is_success(answer.result);
}

#endif
