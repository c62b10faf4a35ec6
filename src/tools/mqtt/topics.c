/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/topics.h"

#include <stdio.h>
#include <string.h>

struct db_mqtt_topic db_mqtt_topic_of_gateway(const struct db_mqtt_config *config, const char *leaf)
{
	struct db_mqtt_topic topic;

	snprintf(topic.text, sizeof(topic.text), "%s/%s/%s", config->prefix, config->gateway, leaf);
	return topic;
}

struct db_mqtt_topic db_mqtt_topic_of_part(const struct db_mqtt_config *config, const char *kind,
                                           const char *name, const char *leaf)
{
	struct db_mqtt_topic topic;

	snprintf(topic.text, sizeof(topic.text), "%s/%s/%s/%s/%s", config->prefix, config->gateway,
	         kind, name, leaf);
	return topic;
}

bool db_mqtt_topic_is_of_drive(const char *topic, const struct db_mqtt_config *config,
                               const char *leaf, char drive[DB_MQTT_NAME_MAX],
                               char sender[DB_MQTT_TOPIC_MAX])
{
	struct db_mqtt_topic head = db_mqtt_topic_of_gateway(config, "drive/");
	size_t length = strlen(head.text);
	size_t part = strlen(leaf);
	size_t name;

	if (strncmp(topic, head.text, length) != 0)
		return false;
	topic += length;
	name = strcspn(topic, "/");
	if (name == 0 || name >= DB_MQTT_NAME_MAX || topic[name] != '/' ||
	    strncmp(topic + name + 1, leaf, part) != 0)
		return false;
	sender[0] = '\0';
	if (topic[name + 1 + part] == '/') {
		const char *last = topic + name + 1 + part + 1;

		if (last[0] == '\0' || strchr(last, '/') || strlen(last) >= DB_MQTT_TOPIC_MAX)
			return false;
		strcpy(sender, last);
	} else if (topic[name + 1 + part] != '\0') {
		return false;
	}
	memcpy(drive, topic, name);
	drive[name] = '\0';
	return true;
}
