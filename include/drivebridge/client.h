/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A client in the form used by all rooms but the server, and a write that is answered later. Pure;
 * any thread.
 */
#ifndef DRIVEBRIDGE_CLIENT_H
#define DRIVEBRIDGE_CLIENT_H

#include "drivebridge/result.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/* Numbers that no client has: no particular client, and the parts of a group command. */
#define DB_CLIENT_NOBODY 0
#define DB_CLIENT_GROUP UINT32_MAX

/* Sessions of the control socket have numbers from here on, connections of Modbus those below: the
 * number alone determines where an answer goes. */
#define DB_CLIENT_FIRST_SESSION UINT32_C(0x80000000)

/* The next number of the same kind; skips those that no client has. */
uint32_t db_client_number_after(uint32_t id);
bool db_client_is_session(uint32_t id);

struct db_role_config;

/* The client that sent a request. Valid for the duration of the call. */
struct db_client {
	uint32_t id; /* number of this connection: unique while it lasts; none of those above */
	/* IPv6, or IPv4 v4-mapped; of a session: db_client_address_of_session(); of a user of this
	 * machine: db_client_address_of_user(); over TLS: db_client_address_of_certificate(); on a
	 * serial line: db_client_address_of_line() */
	uint8_t address[16];
	uint16_t port; /* not 0; for a session a number of its own, within 16 bits */
	/* The number of its endpoint, in whose units its requests are meant: see
	 * db_endpoint_number(). Sessions name drives and see those of all endpoints. */
	uint32_t endpoint;
	bool may_write;
	/* What the role of its certificate allows; null: it has none, and no limits of that kind.
	 * Not to be kept longer than the call. */
	const struct db_role_config *role;
	/* The request arrived at or after this time: a request that waited in a buffer is no sign
	 * of life at present. 0: just now. */
	db_time arrived;
};

/* When its request arrived, as far as known. */
static inline db_time db_client_arrived(const struct db_client *client, db_time now)
{
	return client && client->arrived != 0 ? client->arrived : now;
}

#define DB_CLIENT_ADDRESS_MAX 46

/* The identity of a session. Two with the same identity are, for the drives, one client that came
 * back. */
struct db_client_session {
	uint32_t user;  /* user of its process, as reported by the kernel */
	uint32_t actor; /* number for what else is known: names; 0: nothing */
	bool named;     /* it has stated for whom it acts */
};

/* The identity in the form of an address that no network client has. */
void db_client_address_of_session(const struct db_client_session *session, uint8_t address[16]);
/* False: it is no session's address. */
bool db_client_session_of_address(const uint8_t address[16], struct db_client_session *session);

/* A network client on this machine: its address and its user, whom the kernel knows (see
 * identity/local_user.h), in the form of an address that no other client has. So two users are two
 * clients. */
#define DB_CLIENT_USER_UNKNOWN UINT32_MAX
void db_client_address_of_user(const uint8_t network[16], uint32_t user, uint8_t address[16]);
/* False: it is no such client's address. */
bool db_client_user_of_address(const uint8_t address[16], uint32_t *user);

/* A client with a verified certificate: its address and the certificate's number (see
 * identity/certificates.h), not 0. Of an IPv6 address nothing is kept. */
void db_client_address_of_certificate(const uint8_t network[16], uint32_t certificate,
                                      uint8_t address[16]);
/* False: it is no such client's address. */
bool db_client_certificate_of_address(const uint8_t address[16], uint32_t *certificate);

/* The client on a serial line, which is whoever sends requests there: known by the line's name, of
 * at most this length. */
#define DB_CLIENT_LINE_NAME_MAX 15
void db_client_address_of_line(const char *name, uint8_t address[16]);
/* False: it is no line's address. */
bool db_client_line_of_address(const uint8_t address[16], char name[DB_CLIENT_LINE_NAME_MAX + 1]);

/* True if both are one client for ids, claims of control and watchdogs: the same address; or the
 * same certificate, wherever it comes from. */
bool db_client_same(const uint8_t a[16], const uint8_t b[16]);

/* The address as people write it: "192.168.10.5", "fd00::5"; "127.0.0.1, user 1000"; "control, user
 * 1000"; "192.168.10.5, certificate 3fa9c1b2"; "rtu press-plc". */
void db_client_address(const uint8_t address[16], char text[DB_CLIENT_ADDRESS_MAX]);

/* Names of users, terminated: those of this machine, and those for whom a session acts. */
#define DB_CLIENT_PROCESS_USER_MAX 32
#define DB_CLIENT_USER_MAX 33

#define DB_CLIENT_WORDS_MAX 160

/* A client in words. */
struct db_client_words {
	/* as above; "control, user anna", "127.0.0.1, user anna", "192.168.10.5, certificate
	 * press-plc, role Operator" where the names are known */
	char address[DB_CLIENT_WORDS_MAX];
	/* the user for whom a session says it acts; "": not stated */
	char user[DB_CLIENT_USER_MAX];
};

/* `process_user`: of a session or a client on this machine, `user`: of a session; "": not known. */
void db_client_words_init(struct db_client_words *words, const uint8_t address[16],
                          const char *process_user, const char *user);

/* The same for a client with a certificate: its name and role, "" where there is none or not known. */
void db_client_words_init_certificate(struct db_client_words *words, const uint8_t address[16],
                                      const char *name, const char *role);

/* Both in one: "control, user drivebridge-web for anna". The first is confirmed by the kernel. */
#define DB_CLIENT_TEXT_MAX (DB_CLIENT_WORDS_MAX + 5 + DB_CLIENT_USER_MAX)
void db_client_words_join(const struct db_client_words *words, char text[DB_CLIENT_TEXT_MAX]);

/* An IPv4 address as one number, the first byte highest; DB_CLIENT_IPV6 for other addresses. */
#define DB_CLIENT_IPV6 UINT32_MAX
uint32_t db_client_ipv4(const uint8_t address[16]);

/*
 * Identifies a write that is to be answered later. It may always be answered: when its connection
 * has ended meanwhile, the answer is dropped.
 */
struct db_write_token {
	uint32_t client;
	uint32_t sequence;
};

/* The answer to a write. */
struct db_write_answer {
	bool later; /* no answer yet: the write is answered at its end, by its token */
	/* Otherwise the result. PENDING: it was submitted, and the writer will not be notified of
	 * its end. */
	enum db_result result;
};

/* True if the write was not refused: it was carried out, or is pending. */
static inline bool db_write_is_taken(struct db_write_answer answer)
{
	return answer.later || answer.result == DB_RESULT_PENDING ||
	       db_result_is_success(answer.result);
}

#endif
