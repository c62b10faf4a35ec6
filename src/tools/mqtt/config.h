/* SPDX-License-Identifier: Apache-2.0 */
/* The configuration file of drivebridge-mqtt. Reads files and nothing else. */
#ifndef DRIVEBRIDGE_MQTT_CONFIG_H
#define DRIVEBRIDGE_MQTT_CONFIG_H

#include "reader/settings.h"
#include "users/roles.h"

/* Indexes of words. */
enum { DB_MQTT_VALUES_USUAL, DB_MQTT_VALUES_ALL };
enum { DB_MQTT_ALL = 0 }; /* publish drives, command drives */
enum { DB_MQTT_ALLOW_NONE, DB_MQTT_ALLOW_STOP, DB_MQTT_ALLOW_ALL };
enum { DB_MQTT_OFF, DB_MQTT_ON };
enum { DB_MQTT_VERSION_5, DB_MQTT_VERSION_3_1_1 };
enum { DB_MQTT_TIME_REQUIRED, DB_MQTT_TIME_OPTIONAL };
enum { DB_MQTT_ROLE_OBSERVER, DB_MQTT_ROLE_OPERATOR, DB_MQTT_ROLE_ENGINEER };
enum { DB_MQTT_SENDERS_OFF, DB_MQTT_SENDERS_TOPIC };
enum { DB_MQTT_PAYLOAD_JSON, DB_MQTT_PAYLOAD_SPARKPLUG };

struct db_words_language;

/* Where a broker listens. */
struct db_mqtt_address {
	char *host;
	unsigned port; /* never 0 */
};

struct db_mqtt_config {
	char *socket;

	char *host;
	unsigned port; /* never 0 */
	struct db_setting_list others;
	/* From host, port and others: all brokers, in the order in which they are tried. */
	struct db_mqtt_address *addresses;
	size_t address_count; /* at least 1 */
	unsigned version;
	unsigned tls;
	char *ca_file;
	char *certificate_file; /* "": none; also the other files */
	char *key_file;
	char *client_id;
	char *user;
	char *password_file;
	char *password; /* read from the file; "": none */
	unsigned keepalive_s;
	unsigned spread_s;

	unsigned payload;
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
	unsigned discovery_language;        /* index of a word */
	struct db_words_language *language; /* its texts; NULL: English */

	char *group;
	char *primary_host; /* "": none */
	unsigned templates;
	unsigned history_rate;

	struct db_setting_list allow;
	struct db_setting_list command_drives;
	unsigned parameters;
	unsigned age_ms;
	unsigned time;
	unsigned role;
	unsigned senders;
	char *users_file;
};

/* The table of all keys, the source of docs/mqtt-keys.csv and the manual page. */
extern const struct db_setting db_mqtt_keys[];

/* For db_settings_load() of a struct db_mqtt_config. Reads the files that it names, too. The
 * context of its loading is the name of this machine, which is the gateway's if none is given. */
extern const struct db_settings_form db_mqtt_form;

/* What may be done over MQTT at most, whoever the sender is. */
enum db_role db_mqtt_config_role(const struct db_mqtt_config *config);

/* True if commands are allowed for any drive. */
bool db_mqtt_config_commands(const struct db_mqtt_config *config);

#endif
