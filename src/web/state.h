/* SPDX-License-Identifier: Apache-2.0 */
/* The insides of struct db_web_server: what the files of the room that serve work on. One thread. */
#ifndef DRIVEBRIDGE_WEB_STATE_H
#define DRIVEBRIDGE_WEB_STATE_H

#include "drivebridge/time.h"

#include "client/log.h"
#include "web/attempts.h"
#include "web/config.h"
#include "web/connections.h"
#include "web/hasher.h"
#include "web/page.h"
#include "web/sessions.h"

#include <microhttpd.h>
#include <systemd/sd-event.h>

struct db_web_overview;
struct db_web_request;
struct db_web_service;
struct db_web_stops;
struct db_web_stream;
struct db_web_tab;

/* Since this program began. */
struct db_web_counts {
	uint64_t requests;
	uint64_t refused; /* requests: no right, no room, or malformed */
	uint64_t logins;
	uint64_t failed_logins;
	uint64_t jogs;
	uint64_t late_jogs; /* ended because beats were missing */
};

struct db_web_server {
	sd_event *loop;
	const struct db_web_config *config;
	struct MHD_Daemon *daemon;
	sd_event_source *ready; /* the daemon's epoll */
	sd_event_source *turn;  /* the daemon is to run without that */
	sd_event_source *tick;
	sd_event_source *hashed;
	sd_event_source *signals[2];
	bool ending;
	db_time end_by;
	struct db_web_page *page;
	struct db_web_sessions *sessions;
	struct db_web_attempts attempts;
	struct db_client_log_ration login_lines; /* of logins in vain */
	struct db_web_hasher *hasher;
	uint64_t users_stamp; /* of the file of users when sessions were last held against it */
	struct db_web_service *service;
	struct db_web_stops *stops;
	struct db_web_overview *overview;
	struct db_web_request *requests;
	struct db_web_stream *streams;
	struct db_web_tab *tabs;
	uint64_t last_number; /* of requests */
	struct db_web_connections *connections;
	struct db_web_counts counts;
};

db_time db_web_clock(void);

/* The daemon runs before the loop waits again: something was given to a connection. */
void db_web_server_wake(struct db_web_server *server);

#endif
