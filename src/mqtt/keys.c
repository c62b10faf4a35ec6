/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/keys.h"
#include "mqtt/config.h"

#define AT(member) .offset = offsetof(struct db_mqtt_config, member)

#define TEXT(s, n, p, low, high, d)                                                          \
	.section = s, .name = n, .kind = DB_MQTT_TEXT, .preset = p, .min = low, .max = high, \
	.unit = "", .words = "", .description = d
#define NUMBER(s, n, p, low, high, u, d)                                                       \
	.section = s, .name = n, .kind = DB_MQTT_NUMBER, .preset = p, .min = low, .max = high, \
	.unit = u, .words = "", .description = d
#define WORD(s, n, p, w, d)                                                                 \
	.section = s, .name = n, .kind = DB_MQTT_WORD, .preset = p, .unit = "", .words = w, \
	.description = d
#define LIST(s, n, p, w, d)                                                                 \
	.section = s, .name = n, .kind = DB_MQTT_LIST, .preset = p, .unit = "", .words = w, \
	.description = d

/* clang-format off */
const struct db_mqtt_key db_mqtt_keys[] = {
	{ TEXT("service", "socket", "/run/drivebridge/control", 1, 107,
	       "The control socket of drivebridged"),
	  AT(socket) },

	{ TEXT("broker", "host", NULL, 1, 255,
	       "Address or name of the broker; with tls the name that its certificate has"),
	  AT(host) },
	{ NUMBER("broker", "port", "", 1, 65535, "",
	         "TCP port of the broker; 1883, or 8883 with tls, when not given"),
	  AT(port) },
	{ WORD("broker", "mqtt-version", "5", "5 3.1.1",
	       "Version of the protocol; commands need 5, because only there a message shows that it was published "
	       "as a retained one"),
	  AT(version) },
	{ WORD("broker", "tls", "off", "off on",
	       "Whether the connection is encrypted and the broker's certificate and name are checked; a check that "
	       "fails cannot be overruled"),
	  AT(tls) },
	{ TEXT("broker", "ca-file", "/etc/ssl/certs/ca-certificates.crt", 1, 255,
	       "With tls: certificates of the authorities that are trusted (PEM)"),
	  AT(ca_file) },
	{ TEXT("broker", "certificate-file", "", 1, 255,
	       "With tls: certificate of this client (PEM), where the broker wants one"),
	  AT(certificate_file) },
	{ TEXT("broker", "key-file", "", 1, 255,
	       "With tls: the private key for it (PEM, without a passphrase), which not everybody may read"),
	  AT(key_file) },
	{ TEXT("broker", "client-id", "", 1, 64,
	       "Client identifier, of which a broker has one connection at a time; drivebridge-GATEWAY when not given"),
	  AT(client_id) },
	{ TEXT("broker", "user", "", 1, 128,
	       "User name for the broker; none when not given"),
	  AT(user) },
	{ TEXT("broker", "password-file", "", 1, 255,
	       "File whose first line is the password, which not everybody may read"),
	  AT(password_file) },
	{ NUMBER("broker", "keepalive-s", "10", 5, 600, "s",
	         "Longest silence of the connection before the broker is asked whether it is there; it counts as lost "
	         "after as long again"),
	  AT(keepalive_s) },

	{ TEXT("publish", "gateway", "", 1, 64,
	       "Name of this gateway in the topics; the machine's host name when not given"),
	  AT(gateway) },
	{ TEXT("publish", "prefix", "drivebridge", 1, 128,
	       "What all topics begin with"),
	  AT(prefix) },
	{ LIST("publish", "drives", "all", "all",
	       "Which drives are published"),
	  AT(drives) },
	{ LIST("publish", "values", "usual", "usual all",
	       "Which values by the names of their registers, parameters too; usual: axis_state, error, status, "
	       "position, velocity, position_units and velocity_units; all: all process data"),
	  AT(values) },
	{ NUMBER("publish", "interval-ms", "1000", 20, 3600000, "ms",
	         "How often a drive's values are looked at; those that changed are published"),
	  AT(interval_ms) },
	{ NUMBER("publish", "state-interval-ms", "5000", 20, 3600000, "ms",
	         "How often a drive's retained state is published at most, while something changes"),
	  AT(state_interval_ms) },
	{ NUMBER("publish", "refresh-s", "60", 1, 86400, "s",
	         "How often it is published at least"),
	  AT(refresh_s) },
	{ NUMBER("publish", "figures-interval-s", "10", 1, 86400, "s",
	         "How often the figures of the buses and of this program are published"),
	  AT(figures_interval_s) },
	{ WORD("publish", "events", "on", "off on",
	       "Whether the service's events are published"),
	  AT(events) },
	{ WORD("publish", "qos", "1", "0 1",
	       "Quality of service: 1 is confirmed by the broker and repeated after a lost connection, 0 is not"),
	  AT(qos) },
	{ NUMBER("publish", "buffer-messages", "10000", 100, 1000000, "",
	         "Messages that are kept while the broker is away or slow; then the oldest ones are dropped"),
	  AT(buffer_messages) },
	{ NUMBER("publish", "buffer-kib", "4096", 256, 1048576, "KiB",
	         "Memory that they take at most"),
	  AT(buffer_kib) },
	{ WORD("publish", "discovery", "off", "off homeassistant",
	       "Whether drives are announced to Home Assistant, which then shows them by itself"),
	  AT(discovery) },
	{ TEXT("publish", "discovery-prefix", "homeassistant", 1, 64,
	       "Topic under which it looks for announcements"),
	  AT(discovery_prefix) },

	{ LIST("command", "allow", "none", "none stop all",
	       "Which commands are taken from the broker, by their names; stop: stop and quick_stop. The service decides "
	       "beside that: this program's user must belong to its act-group"),
	  AT(allow) },
	{ LIST("command", "drives", "all", "all",
	       "For which of the published drives"),
	  AT(command_drives) },
	{ WORD("command", "parameters", "off", "off on",
	       "Whether registers may be written as well"),
	  AT(parameters) },
	{ NUMBER("command", "age-ms", "2000", 200, 60000, "ms",
	         "Longest time from the sending of a command to its arrival here; an older one is refused, but for stops"),
	  AT(age_ms) },
	{ WORD("command", "time", "required", "required optional",
	       "Whether a command must say when it was sent; optional is for clients without a clock: what their "
	       "library held back, for minutes perhaps, is then executed as well"),
	  AT(time) },
	{ .name = NULL },
};
/* clang-format on */
