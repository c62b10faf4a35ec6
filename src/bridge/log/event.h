/* SPDX-License-Identifier: Apache-2.0 */
/* Properties of each event for the log. Internal to src/bridge/log. */
#ifndef DRIVEBRIDGE_LOG_EVENT_H
#define DRIVEBRIDGE_LOG_EVENT_H

#include "drivebridge/log.h"

/* Events of one topic are counted together when they repeat, with the text of the newest one: the
 * last line about a drive is then always the present state. */
enum db_topic {
	DB_TOPIC_SERVICE,
	DB_TOPIC_CONFIG,
	DB_TOPIC_THREAD,
	DB_TOPIC_CLIENT,
	DB_TOPIC_REFUSAL,
	DB_TOPIC_WATCHDOG,
	DB_TOPIC_HOLD,
	DB_TOPIC_PORT,
	DB_TOPIC_SPEED,
	DB_TOPIC_SETTING,
	DB_TOPIC_PRESENCE,
	DB_TOPIC_FAULT,
	DB_TOPIC_WARNING,
	DB_TOPIC_RESTART,
	DB_TOPIC_EXIT,
	DB_TOPIC_TIMING,
	DB_TOPIC_COMMAND,
	DB_TOPIC_AUDIT,
	DB_TOPIC_HEALTH,
};

struct db_event_kind {
	const char *name;
	const char *message_id; /* of the journal: 32 hexadecimal digits, never changed */
	enum db_log_level level;
	enum db_topic topic;
	unsigned most; /* lines in a minute before they are only counted; 0: not limited */
	/* The same for lines stored for later queries, at least as many: each outage is a separate
	 * event. */
	unsigned kept;
};

const struct db_event_kind *db_event_kind(enum db_event event);

#endif
