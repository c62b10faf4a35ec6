/* SPDX-License-Identifier: Apache-2.0 */
/* What drivebridge-mqtt is told by its configuration file. Reads files and nothing else. */
#ifndef DRIVEBRIDGE_MQTT_CONFIG_H
#define DRIVEBRIDGE_MQTT_CONFIG_H

#include "reader/settings.h"

/* Positions of words. */
enum { DB_MQTT_VALUES_USUAL, DB_MQTT_VALUES_ALL };
enum { DB_MQTT_ALL = 0 }; /* publish drives, command drives */
enum { DB_MQTT_ALLOW_NONE, DB_MQTT_ALLOW_STOP, DB_MQTT_ALLOW_ALL };
enum { DB_MQTT_OFF, DB_MQTT_ON };
enum { DB_MQTT_VERSION_5, DB_MQTT_VERSION_3_1_1 };
enum { DB_MQTT_TIME_REQUIRED, DB_MQTT_TIME_OPTIONAL };

struct db_mqtt_config {
	char *socket;

	char *host;
	unsigned port; /* never 0 */
	unsigned version;
	unsigned tls;
	char *ca_file;
	char *certificate_file; /* "": none, likewise the others */
	char *key_file;
	char *client_id;
	char *user;
	char *password_file;
	char *password; /* read from the file; "": none */
	unsigned keepalive_s;

	char *gateway; /* never "" */
	char *prefix;
	struct db_setting_list drives;
	struct db_setting_list values;
	unsigned interval_ms;
	unsigned state_interval_ms;
	unsigned refresh_s;
	unsigned figures_interval_s;
	unsigned events;
	unsigned qos;
	unsigned buffer_messages;
	unsigned buffer_kib;
	unsigned discovery;
	char *discovery_prefix;

	struct db_setting_list allow;
	struct db_setting_list command_drives;
	unsigned parameters;
	unsigned age_ms;
	unsigned time;
};

/*
 * Reads a file and what it names. False: it cannot be used. Errors and warnings go to `out`, "PATH:LINE: text" each.
 * `host_name` is the gateway's name where none is given. To be freed with db_mqtt_config_free() in any case.
 */
bool db_mqtt_config_load(const char *path, const char *host_name, FILE *out,
                         struct db_mqtt_config *config);

/* The same from a text; `path` is for messages. */
bool db_mqtt_config_parse(const char *text, const char *path, const char *host_name, FILE *out,
                          struct db_mqtt_config *config);

void db_mqtt_config_free(struct db_mqtt_config *config);

/* Whether anything may be commanded. */
bool db_mqtt_config_commands(const struct db_mqtt_config *config);

#endif
