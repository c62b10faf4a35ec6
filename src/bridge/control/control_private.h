/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the control socket for each other: what all of them know, the kinds of calls, and
 * what goes on while a call lasts. Network thread only.
 */
#ifndef DRIVEBRIDGE_CONTROL_CONTROL_PRIVATE_H
#define DRIVEBRIDGE_CONTROL_CONTROL_PRIVATE_H

#include "control/actors.h"
#include "control/call.h"
#include "control/ids.h"
#include "control/session.h"
#include "drivebridge/clock.h"
#include "drivebridge/control_socket.h"
#include "drivebridge/edit.h"
#include "drivebridge/scan.h"
#include "identity/rights.h"

#include <stddef.h>
#include <systemd/sd-event.h>
#include <time.h>

/* --- what all know ---------------------------------------------------------------------------- */

/* The contents of struct db_control_socket, used by all files of the room. */

/* Since the service began. */
struct db_control_stats {
	uint64_t accepted;
	uint64_t refused; /* connections: there were too many, or they may not read */
	uint64_t dropped; /* connections that did not read their answers */
	uint64_t calls;
	uint64_t errors;
	/* calls of clients that may not act, or while another client has control */
	uint64_t denied;
	uint64_t skipped; /* samples and events left out for slow readers */
};

struct db_control_socket {
	struct db_control_socket_setup setup;
	const struct db_control_config *config;
	struct db_log_source log;
	struct db_rights rights;
	struct db_actors actors;
	struct db_ids ids;
	int listener;         /* -1: there is none */
	char *path;           /* of the listener */
	bool accepts;         /* it is being polled */
	db_time accept_again; /* before, no client is accepted: there were no descriptors left */
	int epoll;
	int turn_fd; /* readable while calls wait for their turn */
	bool wants_turn;
	sd_event_source *io;
	sd_event_source *timer;
	db_time armed;
	db_time rest_until; /* no stream is served before */
	uint32_t run;       /* number of this run for tokens, see token.h */
	struct db_session *sessions[DB_SESSIONS_MOST];
	size_t count;
	uint64_t last_turn;
	uint32_t last_id;
	uint64_t started_us; /* since 1970-01-01 UTC */
	struct db_control_stats stats;
};

/* The clock of tokens: it continues while the machine sleeps, and while a turn of the loop is
 * delayed. */
static inline db_time db_control_clock(void)
{
	return db_clock_read(CLOCK_BOOTTIME);
}

/* The loop's time: when this turn of it began. */
static inline db_time db_control_now(const struct db_control_socket *control)
{
	uint64_t us = 0;

	sd_event_now(control->setup.loop, CLOCK_MONOTONIC, &us);
	return (db_time)us * DB_NS_PER_US;
}

/* --- calls.c ---------------------------------------------------------------------------------- */

/* The methods, and one call of a session. */

/* True if the first message may be taken now; its length otherwise is unchanged. */
bool db_calls_has_next(struct db_session *session, size_t *length);

/* Carries out a message, whatever its content. */
void db_calls_take(struct db_session *session, const char *text, size_t length);

/* The description of the interface, as in docs/. */
extern const char db_calls_interface[];

/* --- look.c ----------------------------------------------------------------------------------- */

/* The calls that only read: Describe, Registers, Commands, Read, Figures. */

void db_look_describe(const struct db_call *call);
void db_look_registers(const struct db_call *call);
void db_look_commands(const struct db_call *call);
void db_look_read(const struct db_call *call);
void db_look_figures(const struct db_call *call);

/* Called when it is due (DB_WAITS_FOR_REGISTERS): writes another part of the answer. */
void db_look_describe_more(struct db_session *session, db_time now);

/* True if a register belongs to what is shown of a drive or of the gateway when no names are
 * given. */
bool db_look_is_process(const struct db_entry *entry);

/* --- streams.c -------------------------------------------------------------------------------- */

/* The calls that wait for events: Subscribe, Events and Reload. */

void db_streams_subscribe(const struct db_call *call);
void db_streams_events(const struct db_call *call);
void db_streams_reload(const struct db_call *call);

/* An event in the form of the definition. */
json_t *db_streams_event(const struct db_log_line *line);

/* Called when it is due (DB_WAITS_FOR_VALUES, _EVENTS). */
void db_streams_look(struct db_session *session, db_time now);

/* A reload has ended, with these lines of errors. */
void db_streams_reloaded(struct db_session *session, const char *errors);

/* --- traces.c --------------------------------------------------------------------------------- */

/* The calls for traces of buses: Trace and Traces. */

void db_traces_follow(const struct db_call *call);
void db_traces_list(const struct db_call *call);

/* Called when it is due (DB_WAITS_FOR_TRACE). */
void db_traces_look(struct db_session *session, db_time now);

/* --- troubles.c ------------------------------------------------------------------------------- */

/* The call Troubles: what is wrong, and what to do about it, for all front ends in the same form.
 *
 */

void db_troubles_call(const struct db_call *call);

/* Called when it is due (DB_WAITS_FOR_TROUBLES). */
void db_troubles_look(struct db_session *session, db_time now);

/* The name of this trouble of the configuration: "refused" ... */
const char *db_troubles_of_configuration(enum db_configuration_state state);

/* --- audit.c ---------------------------------------------------------------------------------- */

/* The calls for the audit trail: Audit reads it, Note adds what a tool's users did. */

void db_audit_call(const struct db_call *call);
void db_audit_note(const struct db_call *call);

/* Called when it is due (DB_WAITS_FOR_AUDIT). */
void db_audit_look(struct db_session *session, db_time now);

/* --- edit.c ----------------------------------------------------------------------------------- */

/* The calls that read, check and change buses and drives of the configuration: Configuration,
 * CheckConfiguration and SetConfiguration. */

void db_edit_read(const struct db_call *call);
void db_edit_check(const struct db_call *call);
void db_edit_set(const struct db_call *call);

/* Called for each session when an answer has come: it is that of one with DB_WAITS_FOR_EDIT. */
void db_edit_answered(struct db_session *session, const struct db_edit_answer *answer);

/* --- health.c --------------------------------------------------------------------------------- */

/* The call Health: how drives have been in the last week. */

void db_health_call(const struct db_call *call);
/* The call HealthRows: of all drives, as rows of figures. */
void db_health_rows_call(const struct db_call *call);

/* Called when it is due (DB_WAITS_FOR_HEALTH). */
void db_health_look(struct db_session *session, db_time now);

/* --- alarms.c --------------------------------------------------------------------------------- */

/* The calls Alarms and AcknowledgeAlarm. */

void db_alarms_call(const struct db_call *call);
void db_alarms_acknowledge_call(const struct db_call *call);

/* Called when it is due (DB_WAITS_FOR_ALARMS). */
void db_alarms_look(struct db_session *session, db_time now);

/* --- positions.c ------------------------------------------------------------------------------ */

/* The calls Positions, Teach and Forget, and how Run goes to a position by its name. */

void db_positions_call(const struct db_call *call);
void db_positions_teach(const struct db_call *call);
void db_positions_forget(const struct db_call *call);

/* Run with `position`: puts its target among the arguments of the call. True without `position`.
 * False: the call was answered. */
bool db_positions_resolve(const struct db_call *call, const struct db_command_row *row,
                          const struct db_named_drive *drive);
/* Whether the drive still counts from where it was taught; also without `position`. False: the call
 * was answered, and is not to be carried out. */
bool db_positions_allow(const struct db_call *call, const struct db_command_row *row,
                        const struct db_named_drive *drive);

/* --- metrics.c -------------------------------------------------------------------------------- */

/* All counters and measurements, in the text format of Prometheus. */

void db_metrics_call(const struct db_call *call);

/* --- scan.c ----------------------------------------------------------------------------------- */

/* The calls that look for drives and set one up: Scan and SetUp. */

void db_scan_call(const struct db_call *call);
void db_scan_set_up(const struct db_call *call);

/* Called when it is due (DB_WAITS_FOR_SCAN). */
void db_scan_look(struct db_session *session, db_time now);

/* The client that has set a bus aside: "control, user anna, drivebridgectl (process 4711)"; "" when
 * none here has. */
void db_scan_whose(const struct db_control_socket *control, const char *bus,
                   char text[DB_SCAN_WHOSE_MAX]);

/* The session, which waits for its scan, is over, or no longer reads its answers: the scan ends. */
void db_scan_forget(struct db_session *session);

/* --- stops.c ---------------------------------------------------------------------------------- */

/*
 * Stops over the control socket: which calls are stops, and the call Stop, which stops several
 * drives at once, each separately.
 */

/* True if a call may be made on a place reserved for stops: a stop by Stop, Run or Write, or an
 * Introduce, which states for whom the following stop is. Pure. */
bool db_stops_has_place(const struct db_message *message);

void db_stops_call(const struct db_call *call);

/* One of the stops that the session waits for (DB_WAITS_FOR_STOPS) has ended. */
void db_stops_ended(struct db_session *session, uint32_t sequence, enum db_result result);

/* Answers a session that waits for a stop of any kind: the stop continues, and nobody waits for it.
 * For DB_WAITS_FOR_STOPS this is also called when it is due. */
void db_stops_leave(struct db_session *session);

/* --- held.c ----------------------------------------------------------------------------------- */

/* Proof of age (Clock, and the tokens of calls that move), and the beats of held motions.  */

void db_held_clock(const struct db_call *call);
void db_held_beat(const struct db_call *call);
/* A Beat without an answer, while its session waits for the end of another call. */
void db_held_beat_silently(const struct db_call *call);

/* A token of the present time; the caller frees it. */
json_t *db_held_token(const struct db_control_socket *control);

/* True if the call's token, if it has one, is young enough to start or hold a motion; if not, the
 * call is answered. */
bool db_held_is_young(const struct db_call *call);

/* False if the drive was stopped since the moment of the call's not_stopped_since, a token that may
 * be of any age, or it is not known whether it was: the call is answered. */
bool db_held_is_unstopped(const struct db_call *call, uint16_t drive);

/* The optional parameter hold_ms, 0 when it is missing: holding a motion needs a token, a command
 * that moves, and a client that can send beats. False: the call was answered. */
bool db_held_span(const struct db_call *call, const struct db_command_row *row, uint32_t *hold_ms);

/* --- text.c ----------------------------------------------------------------------------------- */

/* Texts from people and from drives, which may contain any bytes. Pure. */

/* Length in bytes of the UTF-8 character at the beginning of a text. 0: the text is at its end,
 * begins with invalid bytes, or with a character that is invisible or changes how the rest is
 * displayed. */
size_t db_text_character(const char *text);

#endif
