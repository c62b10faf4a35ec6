/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive that moves while a button is held: the velocity of a page's grip is sent to the drive
 * over the page's connection, and after the end of the grip a stop is sent until the drive has
 * confirmed it. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_JOG_H
#define DRIVEBRIDGE_WEB_JOG_H

#include "client/link.h"
#include "web/grip.h"
#include "web/request.h"

struct db_web_jog;

/* The link outlives it, or db_web_jog_lose() is called. NULL without memory; freed with
 * db_web_jog_free() after the link was closed. NULL is allowed. */
struct db_web_jog *db_web_jog_new(struct db_web_server *server, struct db_link *act);
void db_web_jog_free(struct db_web_jog *jog);

/* A beat: carries it out, and answers the request with the state of the grip. False when it is no
 * valid beat; then the answer is that error. */
bool db_web_jog_take(struct db_web_jog *jog, struct db_web_request *request);

/* The drive, or every one with NULL, is being stopped by another button of the page: its grip is
 * over, also one that still waits for the drive before. */
void db_web_jog_yield(struct db_web_jog *jog, const char *drive);

/* The drive's state as just read: a drive that moved and now stands has been stopped. */
void db_web_jog_see(struct db_web_jog *jog, const char *drive, bool moves);

/* Ends the grip, and stops the motion. */
void db_web_jog_end(struct db_web_jog *jog, enum db_web_grip_end end);

/* The link is lost: a moving drive is stopped over another one. */
void db_web_jog_lose(struct db_web_jog *jog);

/* Repeats stops that were not confirmed. */
void db_web_jog_tick(struct db_web_jog *jog, db_time now);

/* True if, as far as is known, nothing moves because of it. */
bool db_web_jog_is_over(const struct db_web_jog *jog, db_time now);

#endif
