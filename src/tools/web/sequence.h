/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that go to named positions one after the other while a button is held: each step is sent
 * when the one before has ended and its wait has passed, over the page's connection, and the
 * service is told to hold the motion. After the end of the grip all drives that were moved are told
 * to stop until that is confirmed. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_SEQUENCE_H
#define DRIVEBRIDGE_WEB_SEQUENCE_H

#include "client/link.h"
#include "web/grip.h"
#include "web/request.h"

#define DB_WEB_STEPS_MAX 32
/* Longest wait after a step, in milliseconds. */
#define DB_WEB_STEP_WAIT_MAX 600000

struct db_web_sequence;

/* The link outlives it, or db_web_sequence_lose() is called. NULL without memory; freed with
 * db_web_sequence_free() after the link was closed. NULL is allowed. */
struct db_web_sequence *db_web_sequence_new(struct db_web_server *server, struct db_link *act);
void db_web_sequence_free(struct db_web_sequence *sequence);

/*
 * A beat: {"grip", "beat", "held", "token", "steps"}, where `steps` of the first one is the list
 * [{"drive", "position", "velocity", "wait_ms"}]; velocity 0: the drive's own. Later beats need
 * none. Carries it out, and answers the request with the state of the grip, or with an error when
 * it is no valid beat. Returns the drive that moves for it now; NULL: none.
 */
const char *db_web_sequence_take(struct db_web_sequence *sequence, struct db_web_request *request);

/* The drive, or every one with NULL, is being stopped by another button of the page: if it is one
 * of the sequence, the grip is over. */
void db_web_sequence_yield(struct db_web_sequence *sequence, const char *drive);

/* Ends the grip, and stops the motion. */
void db_web_sequence_end(struct db_web_sequence *sequence, enum db_web_grip_end end);

/* The link is lost: moved drives are stopped over another one. */
void db_web_sequence_lose(struct db_web_sequence *sequence);

/* Repeats stops that were not confirmed. */
void db_web_sequence_tick(struct db_web_sequence *sequence, db_time now);

/* True if, as far as is known, nothing moves because of it. */
bool db_web_sequence_is_over(const struct db_web_sequence *sequence, db_time now);

#endif
