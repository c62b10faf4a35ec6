/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive that moves while a button is held: what a page's grip orders goes to the drive over the page's connection, and
 * when the grip is over the drive is told to stop until it has confirmed that. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_JOG_H
#define DRIVEBRIDGE_WEB_JOG_H

#include "web/grip.h"
#include "web/link.h"
#include "web/request.h"

struct db_web_jog;

/* The link outlives it, or is told with db_web_jog_lose(). NULL without memory; freed with db_web_jog_free() behind the
 * closing of the link. NULL is allowed. */
struct db_web_jog *db_web_jog_new(struct db_web_server *server, struct db_web_link *act);
void db_web_jog_free(struct db_web_jog *jog);

/* A beat: what it orders is begun, and the request answered with how the grip stands. False when it is no beat at all;
 * then it is answered with that. */
bool db_web_jog_take(struct db_web_jog *jog, struct db_web_request *request);

/* The drive, or every one with NULL, is being stopped by another button of the page: the grip is over. */
void db_web_jog_yield(struct db_web_jog *jog, const char *drive);

/* What the drive does now, as it was read: one that moved and stands has been stopped. */
void db_web_jog_see(struct db_web_jog *jog, const char *drive, bool moves);

/* Ends the grip, and stops what it moves. */
void db_web_jog_end(struct db_web_jog *jog, enum db_web_grip_end end);

/* Nothing can be said over the link any more: what moves is told to stop over another one. */
void db_web_jog_lose(struct db_web_jog *jog);

/* Tells stops that were not confirmed again. */
void db_web_jog_tick(struct db_web_jog *jog, db_time now);

/* Whether nothing moves because of it, as far as is known. */
bool db_web_jog_is_over(const struct db_web_jog *jog, db_time now);

#endif
