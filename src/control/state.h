/* SPDX-License-Identifier: Apache-2.0 */
/* The insides of struct db_control_socket: what all files of the room work on. Network thread only. */
#ifndef DRIVEBRIDGE_CONTROL_STATE_H
#define DRIVEBRIDGE_CONTROL_STATE_H

#include "control/actors.h"
#include "control/ids.h"
#include "control/rights.h"
#include "control/session.h"
#include "drivebridge/control_socket.h"

#include <systemd/sd-event.h>
#include <time.h>

/* Since the service began. */
struct db_control_stats {
	uint64_t accepted;
	uint64_t refused; /* connections: there were too many, or they may not read */
	uint64_t dropped; /* connections that did not read their answers */
	uint64_t calls;
	uint64_t errors;
	uint64_t denied;  /* calls of who may not act, or while another client has control */
	uint64_t skipped; /* samples and events left out for slow readers */
};

struct db_control_socket {
	struct db_control_socket_setup setup;
	const struct db_control_config *config;
	struct db_log_source log;
	struct db_rights rights;
	struct db_actors actors;
	struct db_ids *ids;
	int listener; /* -1: there is none */
	char *path;   /* of the listener */
	bool accepts; /* it is listened to */
	int epoll;
	int turn_fd; /* readable while calls wait for their turn */
	bool wants_turn;
	sd_event_source *io;
	sd_event_source *timer;
	db_time armed;
	db_time rest_until; /* no stream is looked at before */
	uint32_t run;       /* of tokens, see token.h */
	struct db_session *sessions[DB_SESSIONS_MOST];
	size_t count;
	uint64_t last_turn;
	uint32_t last_id;
	uint64_t started_us; /* since 1970-01-01 UTC */
	struct db_control_stats stats;
};

/* What tokens have: it goes on while the machine sleeps, and while a turn of the loop is held up. */
static inline db_time db_control_clock(void)
{
	struct timespec now;

	clock_gettime(CLOCK_BOOTTIME, &now);
	return (db_time)now.tv_sec * DB_NS_PER_S + now.tv_nsec;
}

/* The loop's time: of when this turn of it began. */
static inline db_time db_control_now(const struct db_control_socket *control)
{
	uint64_t us = 0;

	sd_event_now(control->setup.loop, CLOCK_MONOTONIC, &us);
	return (db_time)us * DB_NS_PER_US;
}

#endif
