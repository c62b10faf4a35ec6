/* SPDX-License-Identifier: Apache-2.0 */
/* Whether Sparkplug's primary host application is online at the broker to which this gateway is
 * connected. Pure; time is passed in. */
#ifndef DRIVEBRIDGE_MQTT_HOST_H
#define DRIVEBRIDGE_MQTT_HOST_H

#include "drivebridge/time.h"
#include "mqtt/config.h"
#include "mqtt/topics.h"

struct db_mqtt_host {
	struct db_mqtt_topic topic; /* of its STATE; "": none is configured */
	bool online;
	bool left;      /* it was there, and is not any more */
	bool others;    /* there are other brokers, where it may be */
	int64_t ms;     /* of its newest STATE in this session; 0: none */
	db_time since;  /* of this session */
	db_time spread; /* births wait for a random part of it when the host comes back */
	db_time from;   /* when they may be published */
	char why[160];
};

/* A new session: what the other broker told does not count. */
void db_mqtt_host_connect(struct db_mqtt_host *host, const struct db_mqtt_config *config,
                          db_time now);

/* Takes the payload of a STATE. Another one than Sparkplug has, and an older one than the newest,
 * are left out. When the host comes while this gateway waits for it, all gateways of a fleet would
 * publish their births at once: `chance` chooses this one's moment within the spread. */
void db_mqtt_host_take(struct db_mqtt_host *host, const char *text, size_t length, db_time now,
                       unsigned chance);

/* True if births and data may be published. */
bool db_mqtt_host_allows(const struct db_mqtt_host *host, db_time now);

/* Why this session is to end; NULL: it goes on. *due is brought forward to when that is to be asked
 * again. */
const char *db_mqtt_host_complain(struct db_mqtt_host *host, db_time now, db_time *due);

#endif
