/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One connection to the control socket: messages in, answers out, and the current call. Bounded:
 * input by DB_MESSAGE_MAX, output by one answer, because the next call waits until that is sent.
 * Network thread only. Internal to src/bridge/control.
 */
#ifndef DRIVEBRIDGE_CONTROL_SESSION_H
#define DRIVEBRIDGE_CONTROL_SESSION_H

#include "control/message.h"
#include "drivebridge/audit.h"
#include "drivebridge/client.h"
#include "drivebridge/time.h"

struct db_control_socket;

/* What a session waits for before its next call. */
enum db_session_wait {
	DB_WAITS_FOR_NOTHING,
	DB_WAITS_FOR_WRITE,     /* the confirmation of a part of a Write */
	DB_WAITS_FOR_RUN,       /* the end of a command */
	DB_WAITS_FOR_STOPS,     /* the end of several stops */
	DB_WAITS_FOR_MOTION,    /* the end of the motion that its command began */
	DB_WAITS_FOR_FIRST,     /* the end of the earlier instance of the same call */
	DB_WAITS_FOR_REGISTERS, /* the rest of an answer that is written in parts */
	DB_WAITS_FOR_VALUES,    /* the client to end its Subscribe */
	DB_WAITS_FOR_EVENTS,
	DB_WAITS_FOR_TRACE,
	DB_WAITS_FOR_TROUBLES,
	DB_WAITS_FOR_RELOAD,
	DB_WAITS_FOR_SCAN,
	DB_WAITS_FOR_AUDIT,
	DB_WAITS_FOR_EDIT,
	DB_WAITS_FOR_HEALTH,
	DB_WAITS_FOR_ALARMS,
};

/* Whether the first message may be taken while its session waits for something. */
enum db_session_next { DB_NEXT_UNKNOWN, DB_NEXT_WAITS, DB_NEXT_BEATS };

struct db_session {
	struct db_control_socket *control;
	struct db_client client; /* its address is that of the actor */
	uint32_t actor;          /* held; 0: none */
	uint32_t user;           /* of the process, as the kernel says */
	int fd;
	uint32_t events;              /* events that epoll waits for */
	char from[DB_AUDIT_FROM_MAX]; /* where whom it acts for is; "": not stated */
	bool acted;                   /* it has commanded something */
	bool stops_only;              /* it has a place reserved for stops */
	bool ended;                   /* the client will send nothing more */
	bool deserted;                /* ... and motions that it held were stopped */
	bool gone;                    /* and it receives nothing more */
	bool broken;                  /* to be closed when its answers are sent */

	uint64_t turn;     /* calls of sessions with lower ones are taken first */
	size_t turn_bytes; /* number of bytes in `in` that arrived for this turn */
	bool introduced;   /* the last call stated for whom it acts ... */
	bool turn_kept;    /* ... so the next one keeps its turn */

	enum db_session_next next; /* kind of the first waiting message, if that matters */

	char *in; /* allocated only while not empty, as `out` */
	size_t in_used;
	db_time in_arrived; /* the content of `in` arrived at or after this time */
	/* since when the rest of a message, or a stop on its place, is missing; 0: nothing */
	db_time owes_since;
	db_time behind_since; /* bytes may wait in the socket since then; 0: none */

	char *out;
	size_t out_sent;
	size_t out_used;
	db_time out_since; /* when the client last took a part of it */

	/* The current call, and how it is to be answered. */
	const char *method; /* lives as long as the program; null: none yet */
	enum db_session_wait wait;
	bool more;
	bool oneway;
	uint32_t sequence; /* number of its write */
	db_time due;       /* when it must be checked again; DB_TIME_NEVER */

	uint16_t drive; /* drive of a command */
	uint32_t entry; /* its entry in the history */
	bool until_end;
	uint64_t once; /* handle of a call with an id; 0: it has none */
	bool repeated; /* ... and the call is a repeat */
	void *job;     /* one block of memory, of a Write, a Stop, a Subscribe or a Trace; null */
	uint64_t next_event;
	unsigned reloads; /* number of reloads that must end */
};

/* Takes the descriptor over. Null when out of memory. */
struct db_session *db_session_new(struct db_control_socket *control, int fd,
                                  const struct db_client *client, db_time now);
void db_session_free(struct db_session *session);

/* Reads the available bytes, as far as there is room. False: the connection is broken. */
bool db_session_receive(struct db_session *session, db_time now);
/* Sends waiting bytes. False: the connection is broken. */
bool db_session_send(struct db_session *session, db_time now);

/* A client that takes nothing of its answers for this time is dropped. */
#define DB_SESSION_STUCK (10 * DB_NS_PER_S)

/* When that will be, if nothing changes; DB_TIME_NEVER while no answer waits. */
db_time db_session_stuck_at(const struct db_session *session);

/* A client that has begun a message and not completed it is dropped after this time; one with a
 * place for stops that sends none, sooner. */
#define DB_SESSION_HALF (10 * DB_NS_PER_S)
#define DB_SESSION_STOPLESS (100 * DB_NS_PER_MS)

/* Called whenever something may have changed. Returns when its client must have sent the rest;
 * DB_TIME_NEVER: nothing is missing. */
db_time db_session_owes_until(struct db_session *session, db_time now);

/* True if a whole message has arrived. */
bool db_session_has_whole(const struct db_session *session, size_t *length);
/* True if a whole message waits and it is its turn; or the rest is too long for one. */
bool db_session_has_message(const struct db_session *session, size_t *length);
/* Removes the first message. */
void db_session_drop_message(struct db_session *session, size_t length);

/* True if everything is done that can be done for it. */
bool db_session_is_over(const struct db_session *session);

/* Answers its call. Takes over the parameters (null: none). An answer that `continues` is not the
 * last one. If there is no memory for an answer, the session is broken. */
void db_session_reply(struct db_session *session, json_t *parameters, bool continues);
void db_session_fail(struct db_session *session, const char *error, json_t *parameters);

/*
 * A part of the text of an answer that would take too long to be written at once; the last one
 * contains the end of the message, and with it the call is answered.
 */
void db_session_append(struct db_session *session, const char *text, size_t length, bool last);

/* Sets its identity from now on. `process_user` is "" when not known, `named` when it has not
 * stated for whom it acts. */
void db_session_set_actor(struct db_session *session, uint32_t user, const char *process_user,
                          const char *named);

/* Its name for a line of the log. */
void db_session_text(const struct db_session *session, char text[DB_CLIENT_TEXT_MAX]);

/* Adds a record of what its client did to the audit trail. */
void db_session_record(struct db_session *session, const struct db_audit_entry *entry);

/* True if it may act; if not, its call is answered with that. */
bool db_session_require_act(struct db_session *session);

/* The usual errors. */
void db_session_fail_parameter(struct db_session *session, const char *parameter);
void db_session_fail_drive(struct db_session *session, const char *drive);
void db_session_fail_register(struct db_session *session, const char *drive, const char *name);
void db_session_fail_value(struct db_session *session, const char *name, const char *reason);
void db_session_fail_result(struct db_session *session, enum db_result result, const char *reason);

#endif
