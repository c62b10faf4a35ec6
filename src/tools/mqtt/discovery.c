/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/discovery.h"

#include "drivebridge/version.h"
#include "mqtt/choice.h"
#include "mqtt/command.h"
#include "mqtt/topics.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What all documents of a drive's announcement share. */
struct announcement {
	const struct db_mqtt_config *config;
	const struct db_mqtt_picture *picture;
	bool withdraw;
	db_mqtt_document_fn *document;
	void *context;
	char device[192]; /* unique for the drive, in the characters that an identifier may have */
};

/* Takes the document's own members over and adds the common ones. */
static void put_document(const struct announcement *announcement, const char *component,
                         const char *name, json_t *document)
{
	const struct db_mqtt_config *config = announcement->config;
	const char *drive = db_mqtt_picture_name(announcement->picture);
	char topic[512], id[256];
	json_t *common;
	char *text = NULL;

	(void)snprintf(topic, sizeof(topic), "%s/%s/%s/%s/config", config->discovery_prefix,
	               component, announcement->device, name);
	(void)snprintf(id, sizeof(id), "%s_%s", announcement->device, name);
	common = json_pack(
		"{s:s, s:s, s:s, s:s, s:{s:[s], s:s, s:s}, s:{s:s, s:s}}", "name", name,
		"unique_id", id, "availability_topic",
		db_mqtt_topic_of_gateway(config->prefix, config->gateway, "status").text,
		"availability_template", "{{ 'online' if value == 'online' else 'offline' }}",
		"device", "identifiers", announcement->device, "name", drive, "model",
		"drivebridge", "origin", "name", "drivebridge-mqtt", "sw_version", DB_VERSION);
	if (common && document && json_object_update(document, common) == 0)
		text = db_mqtt_picture_dump(document);
	if (text)
		announcement->document(announcement->context, topic,
		                       announcement->withdraw ? "" : text);
	json_decref(common);
	json_decref(document);
	free(text);
}

static void put_value(const struct announcement *announcement, const char *name, const json_t *reg)
{
	const struct db_mqtt_config *config = announcement->config;
	const char *drive = db_mqtt_picture_name(announcement->picture);
	const char *type = json_string_value(json_object_get(reg, "type"));
	const char *unit = json_string_value(json_object_get(reg, "unit"));
	bool bits = type && strncmp(type, "bits", 4) == 0 && json_object_get(reg, "codes");
	char value[128];
	json_t *document;

	/* With `value_json.values` the template language would take the object's method of that
	 * name. */
	(void)snprintf(value, sizeof(value), "{{ value_json['values']['%s']%s }}", name,
	               bits ? " | join(', ')" : "");
	document = json_pack(
		"{s:s, s:s}", "state_topic",
		db_mqtt_topic_of_drive(config->prefix, config->gateway, drive, "state").text,
		"value_template", value);
	if (unit && unit[0])
		(void)json_object_set_new(document, "unit_of_measurement", json_string(unit));
	put_document(announcement, "sensor", name, document);
}

static void put_button(const struct announcement *announcement, const char *command, bool stops)
{
	const struct db_mqtt_config *config = announcement->config;
	const char *drive = db_mqtt_picture_name(announcement->picture);
	char message[192];

	if (!announcement->withdraw && !db_mqtt_choice_allows(config, drive, command, stops))
		return;
	(void)snprintf(message, sizeof(message),
	               "{\"id\":\"{{ utcnow().timestamp() }}\",\"time\":\"{{ utcnow().isoformat() "
	               "}}\",\"command\":\"%s\"}",
	               command);
	put_document(announcement, "button", command,
	             json_pack("{s:s, s:s}", "command_topic",
	                       db_mqtt_topic_of_drive(config->prefix, config->gateway, drive,
	                                              stops ? "stop" : "command")
	                               .text,
	                       "command_template", message));
}

void db_mqtt_discovery_announce(const struct db_mqtt_config *config,
                                const struct db_mqtt_picture *picture, const json_t *stops,
                                bool withdraw, db_mqtt_document_fn *document, void *context)
{
	/* Commands without arguments that every drive has. */
	static const char *const commands[] = { "stop", "enable", "disable", "clear_fault" };
	struct announcement announcement = {
		.config = config,
		.picture = picture,
		.withdraw = withdraw,
		.document = document,
		.context = context,
	};
	json_t *registers = db_mqtt_picture_registers(picture);
	const char *name;
	const json_t *reg;

	(void)snprintf(announcement.device, sizeof(announcement.device), "drivebridge_%s_%s",
	               config->gateway, db_mqtt_picture_name(picture));
	for (char *at = announcement.device; *at; at++) {
		if (!isalnum((unsigned char)*at) && *at != '-')
			*at = '_';
	}
	json_object_foreach(registers, name, reg) put_value(&announcement, name, reg);
	for (size_t i = 0; i < sizeof(commands) / sizeof(commands[0]); i++)
		put_button(&announcement, commands[i], json_object_get(stops, commands[i]));
}
