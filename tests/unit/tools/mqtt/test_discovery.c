/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/discovery.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

struct shelf {
	struct db_mqtt_config config;
	char texts[5][32];
	struct db_mqtt_picture *picture;
	json_t *documents; /* by topic */
	json_t *stops;
};

static int open_shelf(void **state)
{
	static struct shelf shelf;
	json_t *drive = json_pack("{s:s}", "name", "lift");
	json_t *registers = json_pack(
		"[{s:s,s:s,s:s},{s:s,s:s,s:s,s:{s:s}},{s:s,s:s,s:s,s:f,s:{s:s,s:s}},"
		"{s:s,s:s,s:s,s:f,s:{s:s}}]",
		"name", "position_units", "type", "f32", "unit", "mm", "name", "status", "type",
		"bits16", "unit", "", "codes", "0", "online", "name", "quality", "type", "u16",
		"unit", "", "max", 1.0, "codes", "0", "bad", "1", "good", "name", "error", "type",
		"u16", "unit", "", "max", 65535.0, "codes", "0", "none");

	shelf = (struct shelf){ .texts = { "gw.1", "drivebridge", "homeassistant" } };
	shelf.config.gateway = shelf.texts[0];
	shelf.config.prefix = shelf.texts[1];
	shelf.config.discovery_prefix = shelf.texts[2];
	shelf.config.role = DB_MQTT_ROLE_ENGINEER;
	shelf.picture = db_mqtt_picture_new(drive, registers);
	shelf.documents = json_object();
	shelf.stops = json_pack("{s:b, s:b}", "stop", 1, "disable", 1);
	json_decref(drive);
	json_decref(registers);
	*state = &shelf;
	return shelf.picture && shelf.documents ? 0 : -1;
}

static int close_shelf(void **state)
{
	struct shelf *shelf = *state;

	db_mqtt_picture_free(shelf->picture);
	json_decref(shelf->documents);
	json_decref(shelf->stops);
	return 0;
}

static void take_document(void *context, const char *topic, const char *text)
{
	struct shelf *shelf = context;

	(void)json_object_set_new(shelf->documents, topic,
	                          text[0] ? json_loads(text, 0, NULL) : json_string(""));
}

/* Of the availability list of a document the topic. */
static const char *get_source(const struct shelf *shelf, const char *topic, size_t place)
{
	const json_t *document = json_object_get(shelf->documents, topic);

	return json_string_value(json_object_get(
		json_array_get(json_object_get(document, "availability"), place), "topic"));
}

/* A member of the document of a topic. */
static const char *get(const struct shelf *shelf, const char *topic, const char *name)
{
	return json_string_value(json_object_get(json_object_get(shelf->documents, topic), name));
}

#define POSITION "homeassistant/sensor/drivebridge_gw_1_lift/position_units/config"
#define STATUS "homeassistant/sensor/drivebridge_gw_1_lift/status/config"
#define QUALITY "homeassistant/sensor/drivebridge_gw_1_lift/quality/config"
#define CAUSE "homeassistant/sensor/drivebridge_gw_1_lift/error/config"
#define ONLINE "homeassistant/binary_sensor/drivebridge_gw_1_lift/status_online/config"
#define STOP "homeassistant/button/drivebridge_gw_1_lift/stop/config"

static void test_values(void **state)
{
	struct shelf *shelf = *state;

	db_mqtt_discovery_announce(&shelf->config, shelf->picture, shelf->stops, false,
	                           take_document, shelf);
	assert_int_equal(json_object_size(shelf->documents), 5);
	assert_string_equal(get(shelf, POSITION, "state_topic"),
	                    "drivebridge/gw.1/drive/lift/state");
	assert_string_equal(get(shelf, POSITION, "value_template"),
	                    "{{ value_json['values']['position_units'] }}");
	assert_string_equal(get(shelf, POSITION, "unit_of_measurement"), "mm");
	assert_string_equal(get(shelf, POSITION, "unique_id"),
	                    "drivebridge_gw_1_lift_position_units");
	assert_string_equal(get(shelf, POSITION, "device_class"), "distance");
	assert_string_equal(get(shelf, POSITION, "state_class"), "measurement");
	/* Values of a drive that is lost are unavailable, words about it are not. */
	assert_string_equal(get_source(shelf, POSITION, 0), "drivebridge/gw.1/status");
	assert_string_equal(get_source(shelf, POSITION, 1), "drivebridge/gw.1/drive/lift/state");
	assert_string_equal(get_source(shelf, QUALITY, 0), "drivebridge/gw.1/status");
	assert_null(get_source(shelf, QUALITY, 1));
	assert_string_equal(get(shelf, QUALITY, "device_class"), "enum");
	assert_int_equal(json_array_size(json_object_get(json_object_get(shelf->documents, QUALITY),
	                                                 "options")),
	                 2);
	assert_null(get(shelf, QUALITY, "state_class"));
	/* Not all of its numbers have words. */
	assert_null(get(shelf, CAUSE, "device_class"));
	assert_string_equal(get(shelf, ONLINE, "device_class"), "connectivity");
	assert_string_equal(
		get(shelf, ONLINE, "value_template"),
		"{% set bits = value_json['values']['status'] %}"
		"{{ 'None' if bits is none else 'ON' if 'online' in bits else 'OFF' }}");
	assert_null(get_source(shelf, ONLINE, 1));
	assert_string_equal(get(shelf, STATUS, "value_template"),
	                    "{{ value_json['values']['status'] | join(', ') }}");
	assert_null(get(shelf, STATUS, "unit_of_measurement"));
}

static void test_buttons_are_what_is_allowed(void **state)
{
	struct shelf *shelf = *state;
	char names[] = "enable\0home\0";

	shelf->config.allow.word = DB_MQTT_ALLOW_STOP;
	db_mqtt_discovery_announce(&shelf->config, shelf->picture, shelf->stops, false,
	                           take_document, shelf);
	/* Two buttons: stop and disable. */
	assert_int_equal(json_object_size(shelf->documents), 7);
	assert_string_equal(get(shelf, STOP, "command_topic"), "drivebridge/gw.1/drive/lift/stop");
	assert_string_equal(
		get(shelf, STOP, "command_template"),
		"{\"id\":\"{{ utcnow().timestamp() }}\",\"time\":\"{{ utcnow().isoformat() "
		"}}\",\"command\":\"stop\"}");
	shelf->config.allow = (struct db_setting_list){ DB_SETTING_NAMED, names };
	(void)json_object_clear(shelf->documents);
	db_mqtt_discovery_announce(&shelf->config, shelf->picture, shelf->stops, false,
	                           take_document, shelf);
	assert_int_equal(json_object_size(shelf->documents), 6);
	assert_null(get(shelf, STOP, "command_topic"));
	/* Who has no name in his topic only stops, and so does an observer. */
	shelf->config.allow.word = DB_MQTT_ALLOW_ALL;
	for (unsigned named = 0; named < 2; named++) {
		shelf->config.senders = named ? DB_MQTT_SENDERS_TOPIC : DB_MQTT_SENDERS_OFF;
		shelf->config.role = named ? DB_MQTT_ROLE_ENGINEER : DB_MQTT_ROLE_OBSERVER;
		(void)json_object_clear(shelf->documents);
		db_mqtt_discovery_announce(&shelf->config, shelf->picture, shelf->stops, false,
		                           take_document, shelf);
		assert_int_equal(json_object_size(shelf->documents), 6);
		assert_non_null(get(shelf, STOP, "command_topic"));
	}
	shelf->config.senders = DB_MQTT_SENDERS_OFF;
	shelf->config.allow.word = DB_SETTING_NAMED;
	/* Not for this drive. */
	shelf->config.command_drives = (struct db_setting_list){ DB_SETTING_NAMED, names };
	(void)json_object_clear(shelf->documents);
	db_mqtt_discovery_announce(&shelf->config, shelf->picture, shelf->stops, false,
	                           take_document, shelf);
	assert_int_equal(json_object_size(shelf->documents), 5);
}

static void test_what_is_withdrawn(void **state)
{
	struct shelf *shelf = *state;
	const char *topic;
	const json_t *text;

	db_mqtt_discovery_announce(&shelf->config, shelf->picture, shelf->stops, true,
	                           take_document, shelf);
	assert_non_null(json_object_get(shelf->documents, STOP));
	json_object_foreach(shelf->documents, topic, text)
		assert_string_equal(json_string_value(text), "");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_values, open_shelf, close_shelf),
		cmocka_unit_test_setup_teardown(test_buttons_are_what_is_allowed, open_shelf,
		                                close_shelf),
		cmocka_unit_test_setup_teardown(test_what_is_withdrawn, open_shelf, close_shelf),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
