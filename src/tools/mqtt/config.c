/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/config.h"
#include "certificates/pair.h"
#include "client/clock.h"
#include "words/language.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define PASSWORD_MAX 1024

/* Its members may read the secrets. */
#define GROUP "drivebridge-mqtt"

/* The service streams 128 registers at most; two of them are in every message. */
#define VALUES_MAX 126

static void add_out_of_memory(struct db_settings *settings)
{
	db_messages_add_error(settings->messages, 0, "out of memory; free some and try again");
}

/* `text` must be one level of a topic, or with `levels` one or several. */
static void check_topic(struct db_settings *settings, const char *section, const char *name,
                        const char *text, bool levels)
{
	size_t length = strlen(text);

	if (length == 0 || text[strcspn(text, "+#")] != '\0' || text[0] == '$' || text[0] == '/' ||
	    text[length - 1] == '/' || strstr(text, "//") || (!levels && strchr(text, '/')))
		db_messages_add_error(
			settings->messages, db_settings_line(settings, section, name),
			"%s = %s cannot be a part of topics: no + and #, no $ first, no "
			"empty level%s",
			name, text, levels ? "" : ", no /");
}

static void check_tls(struct db_settings *settings, const struct db_mqtt_config *config)
{
	struct db_certificate_pair pair = { .facts = { .subject = "" } };
	struct db_certificate_file authorities;
	char why[DB_CERTIFICATE_WHY] = "";
	int64_t now = db_client_wall_us() / 1000000;

	if (!db_certificate_file_read(&authorities, config->ca_file, why) ||
	    db_certificate_check_list(&authorities, now, &pair.facts, why) == DB_CERTIFICATE_WRONG)
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "broker", "ca-file"),
		                      "ca-file = %s: %s", config->ca_file, why);
	db_certificate_file_clear(&authorities);
	if (!config->certificate_file[0] || !config->key_file[0])
		return;
	if (db_certificate_pair_load(&pair, config->certificate_file, config->key_file, now, why) ==
	    DB_CERTIFICATE_WRONG)
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "broker", "certificate-file"),
		                      "%s", why);
	db_certificate_pair_clear(&pair);
	db_settings_check_secret(settings, "broker", "key-file", config->key_file, GROUP);
}

static void read_password(struct db_settings *settings)
{
	struct db_mqtt_config *config = settings->values;
	FILE *file = config->password_file[0] ? fopen(config->password_file, "re") : NULL;
	char line[PASSWORD_MAX] = "";

	if (config->password_file[0] && !file)
		db_messages_add_error(
			settings->messages, db_settings_line(settings, "broker", "password-file"),
			"password-file = %s: %s", config->password_file, strerror(errno));
	if (file) {
		if (!fgets(line, sizeof(line), file))
			line[0] = '\0';
		(void)fclose(file);
		line[strcspn(line, "\r\n")] = '\0';
		if (line[0] == '\0')
			db_messages_add_error(settings->messages,
			                      db_settings_line(settings, "broker", "password-file"),
			                      "password-file = %s has nothing in its first line",
			                      config->password_file);
	}
	/* gcc's analyzer does not see that the values outlive their loading. */
	config->password = strdup(line);
	explicit_bzero(line, sizeof(line));
	if (!config->password)
		add_out_of_memory(settings);
}

/* HOST, HOST:PORT or [ADDRESS]:PORT, where an address may have colons; without a port *port stays.
 * False: it is none of these. */
static bool cut_address(const char *text, const char **host, size_t *length, unsigned *port)
{
	const char *colon = strchr(text, ':');
	const char *rest;
	unsigned long number;
	char *end;

	if (text[0] == '[') {
		*host = text + 1;
		*length = strcspn(*host, "]");
		if ((*host)[*length] != ']')
			return false;
		rest = *host + *length + 1;
	} else {
		/* With a second colon it is an address. */
		*host = text;
		*length = colon && !strchr(colon + 1, ':') ? (size_t)(colon - text) : strlen(text);
		rest = text + *length;
	}
	if (*length == 0 || rest[0] == '\0')
		return *length > 0;
	if (rest[0] != ':' || rest[1] < '0' || rest[1] > '9')
		return false;
	errno = 0;
	number = strtoul(rest + 1, &end, 10);
	*port = (unsigned)number;
	return *end == '\0' && errno == 0 && number >= 1 && number <= 65535;
}

static void add_address(struct db_settings *settings, const char *host, size_t length,
                        unsigned port)
{
	struct db_mqtt_config *config = settings->values;
	struct db_mqtt_address *address = &config->addresses[config->address_count];

	/* gcc's analyzer does not see that the configuration has it now. */
	address->host = strndup(host, length);
	address->port = port;
	if (address->host)
		config->address_count++;
	else
		add_out_of_memory(settings);
}

/* `host` and `port` first, then the others. */
static void list_addresses(struct db_settings *settings)
{
	struct db_mqtt_config *config = settings->values;
	size_t count = 1;

	for (const char *at = config->others.names; at && *at; at += strlen(at) + 1)
		count++;
	/* gcc's analyzer does not see that the configuration has them now. */
	config->addresses = calloc(count, sizeof(*config->addresses));
	if (!config->addresses) {
		add_out_of_memory(settings);
		return;
	}
	add_address(settings, config->host, strlen(config->host), config->port);
	for (const char *at = config->others.names; at && *at; at += strlen(at) + 1) {
		unsigned port = config->port;
		const char *host;
		size_t length;

		if (cut_address(at, &host, &length, &port))
			add_address(settings, host, length, port);
		else
			db_messages_add_error(settings->messages,
			                      db_settings_line(settings, "broker", "others"),
			                      "others: '%s' is no HOST or HOST:PORT", at);
	}
}

static void check_broker(struct db_settings *settings)
{
	struct db_mqtt_config *config = settings->values;

	if (config->port == 0)
		config->port = config->tls ? 8883 : 1883;
	list_addresses(settings);
	db_settings_check_certificate(settings, "broker", config->certificate_file,
	                              config->key_file);
	if (config->password_file[0] && !config->user[0])
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "broker", "password-file"),
		                      "a password needs a user; set user");
	if (config->tls) {
		check_tls(settings, config);
	} else if (config->certificate_file[0]) {
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "broker", "certificate-file"),
		                      "certificate-file is for tls = on");
	} else if (config->password_file[0]) {
		db_messages_add_warning(settings->messages,
		                        db_settings_line(settings, "broker", "password-file"),
		                        "without tls the password goes over the network as it is");
	}
	db_settings_check_secret(settings, "broker", "password-file", config->password_file, GROUP);
	read_password(settings);
}

static void set_if_empty(struct db_settings *settings, char **text, const char *head,
                         const char *name)
{
	if ((*text)[0] != '\0')
		return;
	free(*text);
	if (asprintf(text, "%s%s", head, name) < 0) {
		*text = NULL;
		add_out_of_memory(settings);
	}
}

static void check_sparkplug(struct db_settings *settings)
{
	const struct db_mqtt_config *config = settings->values;
	static const char *const keys[] = { "group", "primary-host", "templates", "history-rate" };

	check_topic(settings, "sparkplug", "group", config->group, false);
	if (config->primary_host[0])
		check_topic(settings, "sparkplug", "primary-host", config->primary_host, false);
	for (size_t i = 0; i < sizeof(keys) / sizeof(keys[0]); i++) {
		unsigned line = db_settings_line(settings, "sparkplug", keys[i]);

		if (line > 0 && config->payload != DB_MQTT_PAYLOAD_SPARKPLUG)
			db_messages_add_error(settings->messages, line,
			                      "%s is for payload = sparkplug", keys[i]);
	}
	if (config->payload != DB_MQTT_PAYLOAD_SPARKPLUG)
		return;
	if (config->senders == DB_MQTT_SENDERS_TOPIC)
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "command", "senders"),
		                      "senders = topic does not go with payload = sparkplug, whose "
		                      "topics have no place for a user");
	if (config->time == DB_MQTT_TIME_OPTIONAL)
		db_messages_add_error(
			settings->messages, db_settings_line(settings, "command", "time"),
			"time = optional does not go with payload = sparkplug: a command without "
			"its time could not be told from one that comes twice");
	if (config->discovery)
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "publish", "discovery"),
		                      "discovery announces texts; payload = sparkplug has none");
}

static void check_whole(struct db_settings *settings, const void *host_name)
{
	static const char *const languages[] = { "", "de", "zh_CN" };
	struct db_mqtt_config *config = settings->values;
	const char *language = languages[config->discovery_language];
	const char *folder = db_words_folder(getenv);
	size_t values = 0;

	check_broker(settings);
	for (const char *name = config->values.names; name && *name; name += strlen(name) + 1)
		values++;
	if (values > VALUES_MAX)
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "publish", "values"),
		                      "values has %zu names; %d at most", values, VALUES_MAX);
	set_if_empty(settings, &config->gateway, "", host_name);
	set_if_empty(settings, &config->client_id, "drivebridge-", config->gateway);
	if (!config->gateway || !config->client_id)
		return;
	check_topic(settings, "publish", "gateway", config->gateway, false);
	check_topic(settings, "publish", "prefix", config->prefix, true);
	check_topic(settings, "publish", "discovery-prefix", config->discovery_prefix, true);
	check_sparkplug(settings);
	/* Without its texts the names are English, and the program runs. */
	if (config->discovery && language[0]) {
		config->language = db_words_open_language(folder, language);
		if (!config->language)
			db_messages_add_warning(
				settings->messages,
				db_settings_line(settings, "publish", "discovery-language"),
				"discovery-language: no texts of %s in %s: %s; names are English",
				language, folder, strerror(errno));
	}
	if (db_mqtt_config_commands(config) && config->version != DB_MQTT_VERSION_5)
		db_messages_add_error(settings->messages,
		                      db_settings_line(settings, "broker", "mqtt-version"),
		                      "commands need mqtt-version = 5: in 3.1.1 a message does not "
		                      "show that it was published as a retained one");
}

static void clear_added(void *values)
{
	struct db_mqtt_config *config = values;

	if (config->password)
		explicit_bzero(config->password, strlen(config->password));
	free(config->password);
	db_words_close_language(config->language);
	for (size_t i = 0; i < config->address_count; i++)
		free(config->addresses[i].host);
	free(config->addresses);
}

enum db_role db_mqtt_config_role(const struct db_mqtt_config *config)
{
	static const enum db_role roles[] = { DB_ROLE_OBSERVER, DB_ROLE_OPERATOR,
		                              DB_ROLE_ENGINEER };

	return roles[config->role];
}

const struct db_settings_form db_mqtt_form = {
	.keys = db_mqtt_keys,
	.sections = "service, broker, publish, sparkplug and command",
	.size = sizeof(struct db_mqtt_config),
	.check = check_whole,
	.clear = clear_added,
};

bool db_mqtt_config_commands(const struct db_mqtt_config *config)
{
	return config->parameters == DB_MQTT_ON || config->allow.word != DB_MQTT_ALLOW_NONE;
}
