/* SPDX-License-Identifier: Apache-2.0 */
/* The insides of struct db_web_server, for the files of this room. One thread. */
#ifndef DRIVEBRIDGE_WEB_STATE_H
#define DRIVEBRIDGE_WEB_STATE_H

#include "drivebridge/time.h"

#include "client/clock.h"
#include "client/log.h"
#include "web/attempts.h"
#include "web/config.h"
#include "web/connections.h"
#include "web/hasher.h"
#include "web/page.h"
#include "web/sessions.h"
#include "web/tls.h"

#include <microhttpd.h>
#include <systemd/sd-event.h>

struct db_lanes;
struct db_link;
struct db_web_commission;
struct db_web_overview;
struct db_web_parameters;
struct db_web_request;
struct db_web_service;
struct db_web_setup;
struct db_web_stop;
struct db_web_stream;
struct db_web_tab;
struct db_web_trail_reader;

/* Counters since this program began. */
struct db_web_counts {
	uint64_t requests;
	uint64_t refused; /* requests: no right, no room, or malformed */
	uint64_t logins;
	uint64_t failed_logins;
	uint64_t jogs;
	uint64_t late_jogs; /* ended because no beats arrived */
};

/* How the audit trail is read (trail.h). */
struct db_web_trail {
	struct db_link *link;              /* NULL: nobody reads */
	struct db_web_trail_reader *first; /* the one that reads now; the others wait */
	bool asked;
	bool ended;
	db_time answer_by;
};

struct db_web_server {
	sd_event *loop;
	const struct db_web_config *config;
	struct db_web_door *door;
	struct MHD_Daemon *daemon;
	struct db_web_tls *tls; /* NULL: there is none */
	sd_event_source *ready; /* the daemon's epoll */
	sd_event_source *turn;  /* the daemon has to run without an event of its epoll */
	sd_event_source *pause; /* the same, but not at once */
	db_time ran;            /* when the daemon's last run ended */
	db_time rest;           /* from then on, before the next run for strangers */
	unsigned runs;          /* in a row, for no other reason than that the daemon asks for it */
	sd_event_source *tick;
	sd_event_source *hashed;
	sd_event_source *asked;
	sd_event_source *signals[3];
	bool ending;
	db_time end_by;
	struct db_web_page *page;
	struct db_web_sessions *sessions;
	struct db_attempts attempts;
	struct db_client_log_rations login_lines; /* for failed logins */
	struct db_web_hasher *hasher;
	struct db_web_hasher *asker; /* of PAM, which may take seconds */
	uint64_t users_stamp; /* of the file of users when sessions were last checked against it */
	struct db_web_service *service;
	struct db_lanes *lanes;
	struct db_web_stop *stops; /* of pages, without an answer yet */
	struct db_web_overview *overview;
	struct db_web_request *requests;
	struct db_web_stream *streams;
	struct db_web_tab *tabs;
	struct db_web_commission *commissions;
	struct db_web_parameters *parameters;
	struct db_web_setup *setups;
	struct db_web_trail trail;
	unsigned calls_aside; /* their connections (call.h) */
	uint64_t last_number; /* of requests */
	struct db_web_connections *connections;
	struct db_web_counts counts;
};

/* How late the timer of a hold may fire. */
#define DB_WEB_TIMER_ACCURACY_US 1000

/* Lets the daemon run before the loop waits again, because a connection has new data to send. */
static inline void db_web_server_wake(struct db_web_server *server)
{
	server->runs = 0;
	/* gcc's analyzer takes what a caller has just given to the server for lost. */
	(void)sd_event_source_set_enabled(server->turn, SD_EVENT_ONESHOT);
}

/* A timer of a hold, off as made; it goes before the requests of browsers. Below 0: no memory. */
static inline int db_web_server_add_timer(struct db_web_server *server, sd_event_source **timer,
                                          sd_event_time_handler_t fired, void *data)
{
	int error = sd_event_add_time(server->loop, timer, CLOCK_MONOTONIC, UINT64_MAX,
	                              DB_WEB_TIMER_ACCURACY_US, fired, data);

	if (error < 0)
		return error;
	(void)sd_event_source_set_enabled(*timer, SD_EVENT_OFF);
	(void)sd_event_source_set_priority(*timer, SD_EVENT_PRIORITY_IMPORTANT);
	return 0;
}

#endif
