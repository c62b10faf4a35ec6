/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/config.h"
#include "users/users.h"

#define AT(member) .offset = offsetof(struct db_mqtt_config, member)

/* clang-format off */
const struct db_setting db_mqtt_keys[] = {
	{ DB_TEXT_SETTING("service", "socket", "/run/drivebridge/control", 1, 107,
	                  "The control socket of drivebridged"),
	  AT(socket) },

	{ DB_TEXT_SETTING("broker", "host", NULL, 1, 255,
	                  "Address or name of the broker; with tls the name that its certificate has"),
	  AT(host) },
	{ DB_NUMBER_SETTING("broker", "port", "", 1, 65535, "",
	                    "TCP port of the broker; 1883, or 8883 with tls, when not given"),
	  AT(port) },
	{ DB_LIST_SETTING("broker", "others", "none", "none",
	                  "More brokers, each as HOST or HOST:PORT: when one cannot be reached or is lost, the next one is tried, and "
	                  "behind the last one host again. All other keys hold for each of them"),
	  AT(others) },
	{ DB_WORD_SETTING("broker", "mqtt-version", "5", "5 3.1.1",
	                  "Version of the protocol; commands need 5, because only there a message shows that it was published "
	                  "as a retained one"),
	  AT(version) },
	{ DB_WORD_SETTING("broker", "tls", "off", "off on",
	                  "Whether the connection is encrypted and the broker's certificate and name are checked; a check that "
	                  "fails cannot be overruled"),
	  AT(tls) },
	{ DB_TEXT_SETTING("broker", "ca-file", "/etc/ssl/certs/ca-certificates.crt", 1, 255,
	                  "With tls: certificates of the authorities that are trusted (PEM)"),
	  AT(ca_file) },
	{ DB_TEXT_SETTING("broker", "certificate-file", "", 1, 255,
	                  "With tls: certificate of this client (PEM), where the broker wants one"),
	  AT(certificate_file) },
	{ DB_TEXT_SETTING("broker", "key-file", "", 1, 255,
	                  "With tls: the private key for it (PEM, without a passphrase), which not everybody may read"),
	  AT(key_file) },
	{ DB_TEXT_SETTING("broker", "client-id", "", 1, 64,
	                  "Client identifier, of which a broker has one connection at a time; drivebridge-GATEWAY when not given"),
	  AT(client_id) },
	{ DB_TEXT_SETTING("broker", "user", "", 1, 128,
	                  "User name for the broker; none when not given"),
	  AT(user) },
	{ DB_TEXT_SETTING("broker", "password-file", "", 1, 255,
	                  "File whose first line is the password, which not everybody may read"),
	  AT(password_file) },
	{ DB_NUMBER_SETTING("broker", "keepalive-s", "10", 5, 600, "s",
	                    "Longest silence of the connection before the broker is asked whether it is there; it counts as lost "
	                    "after as long again"),
	  AT(keepalive_s) },
	{ DB_NUMBER_SETTING("broker", "spread-s", "0", 0, 3600, "s",
	                    "After a lost connection a random time up to this is waited for before the next one: where hundreds of "
	                    "gateways have lost one broker, they do not all come back at once; so it is with births when a primary host comes back"),
	  AT(spread_s) },

	{ DB_WORD_SETTING("publish", "payload", "json", "json sparkplug",
	                  "What is published: texts under the topics of prefix, or Sparkplug B 3.0 under those of spBv1.0; "
	                  "then gateway is the name of the edge node, each drive is a device, and the section sparkplug counts"),
	  AT(payload) },
	{ DB_TEXT_SETTING("publish", "gateway", "", 1, 64,
	                  "Name of this gateway in the topics; the machine's host name when not given"),
	  AT(gateway) },
	{ DB_TEXT_SETTING("publish", "prefix", "drivebridge", 1, 128,
	                  "What all topics begin with"),
	  AT(prefix) },
	{ DB_LIST_SETTING("publish", "drives", "all", "all",
	                  "Which drives are published"),
	  AT(drives) },
	{ DB_LIST_SETTING("publish", "values", "usual", "usual all",
	                  "Which values by the names of their registers, parameters too; usual: axis_state, error, status, "
	                  "position, velocity, position_units and velocity_units; all: all process data"),
	  AT(values) },
	{ DB_NUMBER_SETTING("publish", "interval-ms", "1000", 20, 3600000, "ms",
	                    "How often a drive's values are looked at; those that changed are published"),
	  AT(interval_ms) },
	{ DB_NUMBER_SETTING("publish", "state-interval-ms", "5000", 20, 3600000, "ms",
	                    "How often a drive's retained state is published at most, while something changes"),
	  AT(state_interval_ms) },
	{ DB_NUMBER_SETTING("publish", "refresh-s", "60", 1, 86400, "s",
	                    "How often it is published at least"),
	  AT(refresh_s) },
	{ DB_NUMBER_SETTING("publish", "figures-interval-s", "10", 1, 86400, "s",
	                    "How often the figures of the buses and of this program are published"),
	  AT(figures_interval_s) },
	{ DB_WORD_SETTING("publish", "events", "on", "off on",
	                  "Whether the service's events are published"),
	  AT(events) },
	{ DB_WORD_SETTING("publish", "qos", "1", "0 1",
	                  "Quality of service: 1 is confirmed by the broker and repeated after a lost connection, 0 is not"),
	  AT(qos) },
	{ DB_NUMBER_SETTING("publish", "buffer-messages", "10000", 100, 1000000, "",
	                    "Messages that are kept while the broker is away or slow; then the oldest ones are dropped"),
	  AT(buffer_messages) },
	{ DB_NUMBER_SETTING("publish", "buffer-kib", "4096", 256, 1048576, "KiB",
	                    "Memory that they take at most"),
	  AT(buffer_kib) },
	{ DB_WORD_SETTING("publish", "discovery", "off", "off homeassistant",
	                  "Whether drives are announced to Home Assistant, which then shows them by itself"),
	  AT(discovery) },
	{ DB_TEXT_SETTING("publish", "discovery-prefix", "homeassistant", 1, 64,
	                  "Topic under which it looks for announcements"),
	  AT(discovery_prefix) },

	{ DB_TEXT_SETTING("sparkplug", "group", "drivebridge", 1, 64,
	                  "The group of the edge node, a part of its topics"),
	  AT(group) },
	{ DB_TEXT_SETTING("sparkplug", "primary-host", "", 1, 64,
	                  "The host application that must be there: without it nothing is published but kept, and sent as historical "
	                  "when it is there again; with several brokers the next one is tried. None when not given"),
	  AT(primary_host) },
	{ DB_WORD_SETTING("sparkplug", "templates", "off", "off on",
	                  "Whether the values of a drive are published as one metric, an instance of its family's template; off: each "
	                  "value is a metric of its own"),
	  AT(templates) },
	{ DB_NUMBER_SETTING("sparkplug", "history-rate", "50", 5, 10000, "1/s",
	                    "How many historical messages are sent at most, between those of now: a fleet whose host was away for "
	                    "minutes must not bury it"),
	  AT(history_rate) },

	{ DB_LIST_SETTING("command", "allow", "none", "none stop all",
	                  "Which commands are taken from the broker, by their names; stop: stop, quick_stop and disable. The service decides "
	                  "beside that: this program's user must belong to its act-group"),
	  AT(allow) },
	{ DB_LIST_SETTING("command", "drives", "all", "all",
	                  "For which of the published drives"),
	  AT(command_drives) },
	{ DB_WORD_SETTING("command", "parameters", "off", "off on",
	                  "Whether registers may be written as well"),
	  AT(parameters) },
	{ DB_NUMBER_SETTING("command", "age-ms", "2000", 200, 60000, "ms",
	                    "Longest time from the sending of a command to its arrival here; an older one is refused, but for stops"),
	  AT(age_ms) },
	{ DB_WORD_SETTING("command", "time", "required", "required optional",
	                  "Whether a command must say when it was sent; optional is for clients without a clock: what their "
	                  "library held back, for minutes perhaps, is then executed as well, but for the first age-ms of a "
	                  "connection"),
	  AT(time) },
	{ DB_WORD_SETTING("command", "role", "engineer", "observer operator engineer",
	                  "What may be done at most, whoever sends it, beside allow and parameters; observer: stop and quick_stop; "
	                  "operator: all commands but the engineer's; engineer: set_position, save_parameters, raw_frame and registers, too"),
	  AT(role) },
	{ DB_WORD_SETTING("command", "senders", "off", "off topic",
	                  "How it is known who sends a command; topic: from the last part of the topic, command/USER, stop/USER and "
	                  "alive/USER, which the broker's access list must guard; then the user's role and drives in users-file count, "
	                  "and who is not there may only stop"),
	  AT(senders) },
	{ DB_TEXT_SETTING("command", "users-file", DB_USERS_PATH, 1, 255,
	                  "With senders = topic: the file with users, which page and OPC UA have in common"),
	  AT(users_file) },
	{ .name = NULL },
};
/* clang-format on */
