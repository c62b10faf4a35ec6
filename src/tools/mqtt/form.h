/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The form in which a plant is published and commands are written: texts under topics of their own
 * (plain.c), or Sparkplug (node.c). A form knows topics and payloads, and what is to be sent next;
 * who may command, and when, it does not know.
 */
#ifndef DRIVEBRIDGE_MQTT_FORM_H
#define DRIVEBRIDGE_MQTT_FORM_H

#include "client/plant.h"
#include "mqtt/acting.h"
#include "mqtt/broker.h"
#include "mqtt/command.h"
#include "mqtt/config.h"
#include "mqtt/topics.h"

/* Figures of this program. */
struct db_mqtt_figures {
	struct db_mqtt_broker_stats broker;
	uint64_t skipped;  /* samples that the service left out */
	uint64_t left_out; /* refusals that were not answered */
};

enum db_mqtt_kind {
	DB_MQTT_NOTHING, /* nothing that the caller is to act upon */
	DB_MQTT_COMMAND,
	DB_MQTT_ALIVE, /* a sign of life of who commands the drive */
};

struct db_mqtt_received {
	char drive[DB_MQTT_NAME_MAX];   /* one that is published */
	char sender[DB_MQTT_TOPIC_MAX]; /* from the topic; "": not given */
	struct db_mqtt_command command; /* to be cleared in every case */
	const char *wrong;              /* NULL, or the mistake in words */
};

/* All objects of the plant stay the plant's. */
struct db_mqtt_form_ops {
	/* `config` must outlive it. NULL without memory. */
	void *(*open)(const struct db_mqtt_config *config);
	void (*close)(void *form);
	struct db_mqtt_source_ops source; /* with the form as its source */

	/* What is kept of a drive's registers or commands, as db_plant_ops has it. */
	json_t *(*keep)(const struct db_mqtt_config *config, json_t *received, bool commands);
	/* `stops`: an object with the names of commands that stop a drive. */
	void (*found)(void *form, const json_t *description, const struct db_plant_drive *drives,
	              size_t count, const json_t *stops);
	void (*lost)(void *form);
	void (*sample)(void *form, const json_t *sample, int64_t us);
	/* These two may be null: then it publishes nothing of it. */
	void (*event)(void *form, json_t *event);
	void (*bus_figures)(void *form, json_t *buses);
	void (*troubles)(void *form, const struct db_client_troubles *troubles, const json_t *news);
	/* Returns the number of messages that were dropped since the start of this program. */
	uint64_t (*figures)(void *form, const struct db_mqtt_figures *figures);
	void (*result)(void *form, const struct db_mqtt_outcome *outcome);

	/* There is a connection: subscribes, and begins to send. */
	void (*connected)(void *form, struct db_mqtt_broker *broker);
	void (*disconnected)(void *form); /* may be null */
	/* True when other messages may be sent over the connection, too. */
	bool (*is_open)(const void *form);
	/* What a message asks for. */
	enum db_mqtt_kind (*take)(void *form, const char *topic, const void *bytes, size_t length,
	                          const json_t *stops, struct db_mqtt_received *received);
	/* Does the work that is due, and returns when it is to be called next; null: there is none.
	 */
	db_time (*turn)(void *form, struct db_mqtt_broker *broker, db_time now);
};

/* Texts in JSON, on topics of this program's own (topics.h). */
extern const struct db_mqtt_form_ops db_mqtt_plain;
/* Sparkplug B. */
extern const struct db_mqtt_form_ops db_mqtt_node;

#endif
