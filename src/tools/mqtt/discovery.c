/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/discovery.h"

#include "drivebridge/version.h"
#include "mqtt/choice.h"
#include "mqtt/command.h"
#include "mqtt/topics.h"
#include "words/language.h"

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

/* What is shown and pressed while this program has a connection to the service; and values of the
 * drive while they are known. */
enum available { WITH_GATEWAY, WITH_DRIVE };

static json_t *list_availability(const struct announcement *announcement, enum available available)
{
	const struct db_mqtt_config *config = announcement->config;
	const char *drive = db_mqtt_picture_name(announcement->picture);
	json_t *list = json_pack("[{s:s, s:s}]", "topic",
	                         db_mqtt_topic_of_gateway(config, "status").text, "value_template",
	                         "{{ 'online' if value == 'online' else 'offline' }}");

	if (available == WITH_DRIVE)
		(void)json_array_append_new(
			list,
			json_pack("{s:s, s:s}", "topic",
		                  db_mqtt_topic_of_part(config, "drive", drive, "state").text,
		                  "value_template",
		                  "{{ 'offline' if value_json.quality == 'bad' else 'online' }}"));
	return list;
}

/* What people read: the name of a register, a command or a bit in the configured language, as the
 * page has it; in English as it is. A bit is told with its register. */
static void write_title(const struct announcement *announcement, const char *name, const char *unit,
                        const char *bit, char *title, size_t size)
{
	const struct db_words_language *language = announcement->config->language;
	size_t length = db_words_name_length(name, unit);
	const char *words = db_words_find_name(language, name, length);
	const char *bit_words = bit ? db_words_find_name(language, bit, strlen(bit)) : NULL;

	/* In English, and where the language has no words, it is the name. */
	if (!words) {
		words = name;
		length = language ? length : strlen(name);
	} else {
		length = strlen(words);
	}
	snprintf(title, size, "%.*s%s%s", (int)length, words,
	         !bit     ? "" :
	         language ? ": " :
	                    "_",
	         bit_words ? bit_words :
	         bit       ? bit :
	                     "");
}

/* Takes the document's own members over and adds the common ones. */
static void put_document(const struct announcement *announcement, const char *component,
                         const char *name, const char *title, enum available available,
                         json_t *document)
{
	const struct db_mqtt_config *config = announcement->config;
	const char *drive = db_mqtt_picture_name(announcement->picture);
	char topic[512], id[256];
	json_t *common;
	char *text = NULL;

	snprintf(topic, sizeof(topic), "%s/%s/%s/%s/config", config->discovery_prefix, component,
	         announcement->device, name);
	snprintf(id, sizeof(id), "%s_%s", announcement->device, name);
	common = json_pack("{s:s, s:s, s:o, s:s, s:{s:[s], s:s, s:s}, s:{s:s, s:s}}", "name", title,
	                   "unique_id", id, "availability",
	                   list_availability(announcement, available), "availability_mode", "all",
	                   "device", "identifiers", announcement->device, "name", drive, "model",
	                   "drivebridge", "origin", "name", "drivebridge-mqtt", "sw_version",
	                   DB_VERSION);
	if (common && document && json_object_update(document, common) == 0)
		text = db_mqtt_picture_dump(document);
	if (text)
		announcement->document(announcement->context, topic,
		                       announcement->withdraw ? "" : text);
	json_decref(common);
	json_decref(document);
	free(text);
}

/* Home Assistant's classes of values, by unit, with its words for these. It refuses a class with a
 * unit that it does not know there: mm/s has none. */
static const struct {
	const char *unit;
	const char *class;
	const char *word;
} classes[] = {
	{ "mm", "distance", "mm" },      { "cm", "distance", "cm" },  { "m", "distance", "m" },
	{ "in", "distance", "in" },      { "m/s", "speed", "m/s" },   { "A", "current", "A" },
	{ "mA", "current", "mA" },       { "V", "voltage", "V" },     { "mV", "voltage", "mV" },
	{ "degC", "temperature", "°C" }, { "Hz", "frequency", "Hz" }, { "ms", "duration", "ms" },
	{ "s", "duration", "s" },        { "W", "power", "W" },
};

/* The words that a value may be, in the order of their numbers; NULL unless each of its numbers has
 * one: Home Assistant refuses others. */
static json_t *list_words(const json_t *reg)
{
	const json_t *codes = json_object_get(reg, "codes");
	double max = json_number_value(json_object_get(reg, "max"));
	json_t *words = json_array();
	char number[16];

	for (unsigned i = 0; (double)i <= max && i <= json_object_size(codes); i++) {
		const char *word;

		snprintf(number, sizeof(number), "%u", i);
		word = json_string_value(json_object_get(codes, number));
		if (word)
			(void)json_array_append_new(words, json_string(word));
	}
	if (max > 0.0 && (double)json_array_size(words) == max + 1.0)
		return words;
	json_decref(words);
	return NULL;
}

/* Each bit with a name as a sensor that is on or off. */
static void put_bits(const struct announcement *announcement, const char *name, const char *topic,
                     json_t *codes)
{
	static const struct {
		const char *bit;
		const char *class;
	} meanings[] = {
		{ "online", "connectivity" }, { "bus_up", "connectivity" },
		{ "moving", "moving" },       { "error_stop", "problem" },
		{ "warning", "problem" },     { "latched", "problem" },
	};
	const char *key;
	const json_t *code;

	json_object_foreach(codes, key, code)
	{
		const char *bit = json_string_value(code);
		char value[256], id[128], title[256];
		json_t *document;

		if (!bit)
			continue;
		/* "None" means unknown. */
		snprintf(value, sizeof(value),
		         "{%% set bits = value_json['values']['%s'] %%}"
		         "{{ 'None' if bits is none else 'ON' if '%s' in bits else 'OFF' }}",
		         name, bit);
		snprintf(id, sizeof(id), "%s_%s", name, bit);
		write_title(announcement, name, "", bit, title, sizeof(title));
		document = json_pack("{s:s, s:s}", "state_topic", topic, "value_template", value);
		for (size_t i = 0; i < sizeof(meanings) / sizeof(meanings[0]); i++) {
			if (strcmp(name, "status") == 0 && strcmp(bit, meanings[i].bit) == 0)
				(void)json_object_set_new(document, "device_class",
				                          json_string(meanings[i].class));
		}
		put_document(announcement, "binary_sensor", id, title, WITH_GATEWAY, document);
	}
}

static void put_value(const struct announcement *announcement, const char *name, const json_t *reg)
{
	const struct db_mqtt_config *config = announcement->config;
	const char *drive = db_mqtt_picture_name(announcement->picture);
	struct db_mqtt_topic topic = db_mqtt_topic_of_part(config, "drive", drive, "state");
	const char *type = json_string_value(json_object_get(reg, "type"));
	const char *unit = json_string_value(json_object_get(reg, "unit"));
	json_t *codes = json_object_get(reg, "codes");
	bool bits = type && strncmp(type, "bits", 4) == 0 && codes;
	bool number = type && strcmp(type, "text") != 0 && !codes;
	char value[128], title[256];
	json_t *document, *words;

	/* With `value_json.values` the template language would take the object's method of that
	 * name. */
	snprintf(value, sizeof(value), "{{ value_json['values']['%s']%s }}", name,
	         bits ? " | join(', ')" : "");
	document = json_pack("{s:s, s:s}", "state_topic", topic.text, "value_template", value);
	if (unit && unit[0]) {
		const char *word = unit;

		for (size_t i = 0; i < sizeof(classes) / sizeof(classes[0]); i++) {
			if (strcmp(unit, classes[i].unit) != 0)
				continue;
			word = classes[i].word;
			(void)json_object_set_new(document, "device_class",
			                          json_string(classes[i].class));
		}
		(void)json_object_set_new(document, "unit_of_measurement", json_string(word));
	}
	words = codes && !bits ? list_words(reg) : NULL;
	if (words) {
		(void)json_object_set_new(document, "device_class", json_string("enum"));
		(void)json_object_set_new(document, "options", words);
	}
	/* Home Assistant keeps statistics of it. A moment is no measurement. */
	if (number && strcmp(type, "u64") != 0)
		(void)json_object_set_new(document, "state_class", json_string("measurement"));
	/* A word may be the service's own, such as Offline. */
	write_title(announcement, name, unit ? unit : "", NULL, title, sizeof(title));
	put_document(announcement, "sensor", name, title, codes ? WITH_GATEWAY : WITH_DRIVE,
	             document);
	/* What a drive can do does not change. */
	if (bits && strcmp(name, "capabilities") != 0)
		put_bits(announcement, name, topic.text, codes);
}

static void put_button(const struct announcement *announcement, const char *command, bool stops)
{
	const struct db_mqtt_config *config = announcement->config;
	const char *drive = db_mqtt_picture_name(announcement->picture);
	char message[192], title[256];

	if (!announcement->withdraw && !db_mqtt_choice_allows(config, drive, command, stops))
		return;
	snprintf(message, sizeof(message),
	         "{\"id\":\"{{ utcnow().timestamp() }}\",\"time\":\"{{ utcnow().isoformat() "
	         "}}\",\"command\":\"%s\"}",
	         command);
	/* A stop counts for a drive that does not answer, too. */
	write_title(announcement, command, "", NULL, title, sizeof(title));
	put_document(
		announcement, "button", command, title, WITH_GATEWAY,
		json_pack("{s:s, s:s}", "command_topic",
	                  db_mqtt_topic_of_part(config, "drive", drive, stops ? "stop" : "command")
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
	const char *name;
	const json_t *reg;

	snprintf(announcement.device, sizeof(announcement.device), "drivebridge_%s_%s",
	         config->gateway, db_mqtt_picture_name(picture));
	for (char *at = announcement.device; *at; at++) {
		if (!isalnum((unsigned char)*at) && *at != '-')
			*at = '_';
	}
	json_object_foreach(picture->registers, name, reg) put_value(&announcement, name, reg);
	for (size_t i = 0; i < sizeof(commands) / sizeof(commands[0]); i++)
		put_button(&announcement, commands[i], json_object_get(stops, commands[i]));
}
