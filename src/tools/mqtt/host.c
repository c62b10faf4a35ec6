/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/host.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>

/* Its STATE is retained, and comes at once. Where there are other brokers, these are tried after
 * this time. */
#define WAIT (5 * DB_NS_PER_S)

/* A STATE that comes later than this after the connection is no retained one: the host has come. */
#define RETAINED (2 * DB_NS_PER_S)

void db_mqtt_host_connect(struct db_mqtt_host *host, const struct db_mqtt_config *config,
                          db_time now)
{
	*host = (struct db_mqtt_host){ .others = config->address_count > 1,
		                       .since = now,
		                       .spread = config->spread_s * DB_NS_PER_S };
	if (config->primary_host[0] == '\0')
		return;
	snprintf(host->topic.text, sizeof(host->topic.text), "spBv1.0/STATE/%s",
	         config->primary_host);
	snprintf(host->why, sizeof(host->why), "the primary host %s is not there",
	         config->primary_host);
}

void db_mqtt_host_take(struct db_mqtt_host *host, const char *text, size_t length, db_time now,
                       unsigned chance)
{
	json_t *state = json_loadb(text, length, JSON_REJECT_DUPLICATES, NULL);
	const json_t *online = json_object_get(state, "online");
	const json_t *ms = json_object_get(state, "timestamp");

	if (json_is_boolean(online) && json_is_integer(ms) && json_integer_value(ms) >= host->ms) {
		host->ms = json_integer_value(ms);
		host->left = host->left || (host->online && !json_is_true(online));
		if (!host->online && json_is_true(online) && now - host->since > RETAINED)
			host->from = now + host->spread / 1000 * (chance % 1000);
		host->online = json_is_true(online);
	}
	json_decref(state);
}

bool db_mqtt_host_allows(const struct db_mqtt_host *host, db_time now)
{
	return host->topic.text[0] == '\0' || (host->online && !host->left && now >= host->from);
}

const char *db_mqtt_host_complain(struct db_mqtt_host *host, db_time now, db_time *due)
{
	if (host->topic.text[0] == '\0')
		return NULL;
	if (host->left)
		return host->why;
	if (host->online && now < host->from)
		*due = db_time_min(*due, host->from);
	if (host->online || !host->others)
		return NULL;
	if (now - host->since >= WAIT)
		return host->why;
	*due = db_time_min(*due, host->since + WAIT);
	return NULL;
}
