/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/broker.h"

#include "client/log.h"
#include "mqtt/gate.h"
#include "mqtt/packet.h"
#include "mqtt/retry.h"
#include "mqtt/tls_files.h"

#include <errno.h>
#include <mosquitto.h>
#include <mqtt_protocol.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

/* From the begin of a connection to the broker's answer. */
#define CONNECT_MAX (15 * DB_NS_PER_S)
#define MISC_INTERVAL (1 * DB_NS_PER_S)

#define OLD_VERSION                                                                    \
	"the broker does not speak MQTT 5; mqtt-version = 3.1.1 is for such brokers, " \
	"without commands"

enum state {
	AWAY,
	CONNECTING, /* until the port has answered */
	GREETING,   /* until the broker has answered */
	CONNECTED,
};

/* What is remembered of each of the brokers. */
struct place {
	char told[256]; /* last logged error; "" while it is connected */
};

struct db_mqtt_broker {
	const struct db_mqtt_config *config;
	const struct db_mqtt_source_ops *source_ops;
	void *source;
	const struct db_mqtt_broker_ops *ops;
	void *context;
	struct place *places; /* those of the configuration, in its order */
	size_t place;         /* of the broker that this is connected to, or tried next */
	struct db_mqtt_tls_files *files; /* NULL without TLS */
	struct mosquitto *client;        /* a new one for each connection */
	struct db_mqtt_gate *gate;       /* of that client; NULL with TLS */
	enum state state;
	struct db_mqtt_retry retry;
	db_time give_up_at; /* while it is not connected */
	db_time misc_at;
	/* number of the unconfirmed message that was sent past the outbox; 0: none */
	int urgent;
	bool accepted;     /* the library has reported it in this turn */
	char why[256];     /* why it is not connected; "" */
	char library[256]; /* the library's error messages */
	char refused[256]; /* the last topic logged as refused */
	struct db_mqtt_broker_stats stats;
};

struct db_mqtt_broker *db_mqtt_broker_new(const struct db_mqtt_config *config,
                                          const struct db_mqtt_source_ops *source_ops, void *source,
                                          const struct db_mqtt_broker_ops *ops, void *context)
{
	struct db_mqtt_broker *broker = calloc(1, sizeof(*broker));

	if (!broker)
		return NULL;
	(void)mosquitto_lib_init();
	broker->config = config;
	broker->source_ops = source_ops;
	broker->source = source;
	broker->ops = ops;
	broker->context = context;
	broker->places = calloc(config->address_count, sizeof(*broker->places));
	if (config->tls)
		broker->files = db_mqtt_tls_files_new(config);
	if (broker->places && (broker->files || !config->tls))
		return broker;
	db_mqtt_broker_free(broker);
	return NULL;
}

/* --- callbacks of the library ----------------------------------------------------------------- */

static void on_log(struct mosquitto *client, void *data, int level, const char *text)
{
	struct db_mqtt_broker *broker = data;

	(void)client;
	if (level == MOSQ_LOG_ERR && broker->library[0] == '\0')
		snprintf(broker->library, sizeof(broker->library), "%s", text);
}

/* The first reason is kept. */
static void set_reason(struct db_mqtt_broker *broker, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

static void set_reason(struct db_mqtt_broker *broker, const char *format, ...)
{
	va_list arguments;

	va_start(arguments, format);
	if (broker->why[0] == '\0')
		vsnprintf(broker->why, sizeof(broker->why), format, arguments);
	va_end(arguments);
}

static void on_connect(struct mosquitto *client, void *data, int code, int flags,
                       const mosquitto_property *properties)
{
	struct db_mqtt_broker *broker = data;

	(void)client;
	(void)flags;
	(void)properties;
	if (code == 0)
		broker->accepted = true;
	else if (code == MQTT_RC_UNSUPPORTED_PROTOCOL_VERSION &&
	         broker->config->version == DB_MQTT_VERSION_5)
		set_reason(broker, "%s", OLD_VERSION);
	else
		/* It answers in its own version of MQTT, which may differ from ours: below 128 it
		 * is 3.1.1. */
		set_reason(broker, "the broker refuses the connection: %s",
		           code >= 128 ? mosquitto_reason_string(code) :
		                         mosquitto_connack_string(code));
}

static void on_disconnect(struct mosquitto *client, void *data, int code,
                          const mosquitto_property *properties)
{
	struct db_mqtt_broker *broker = data;

	(void)client;
	(void)properties;
	if (code == MQTT_RC_SESSION_TAKEN_OVER)
		set_reason(broker, "%s",
		           "another client with the same client-id has connected; each gateway "
		           "needs one of its own");
	else if (code >= 128)
		set_reason(broker, "the broker has ended the connection: %s",
		           mosquitto_reason_string(code));
}

static void on_publish(struct mosquitto *client, void *data, int number, int code,
                       const mosquitto_property *properties)
{
	struct db_mqtt_broker *broker = data;

	(void)client;
	(void)properties;
	if (code >= 128) {
		broker->stats.refused++;
		if (broker->refused[0] == '\0')
			db_client_log(DB_CLIENT_WARNING,
			              "the broker does not take a message of this gateway: %s; "
			              "look at its access list",
			              mosquitto_reason_string(code));
		snprintf(broker->refused, sizeof(broker->refused), "said");
	}
	if (number == broker->urgent)
		broker->urgent = 0;
	else if (broker->source_ops->confirmed)
		broker->source_ops->confirmed(broker->source, number);
}

static void on_subscribe(struct mosquitto *client, void *data, int number, int count,
                         const int *granted, const mosquitto_property *properties)
{
	(void)client;
	(void)data;
	(void)number;
	(void)properties;
	for (int i = 0; i < count; i++) {
		if (granted[i] >= 128)
			db_client_log(
				DB_CLIENT_ERROR,
				"the broker lets this gateway have no commands: %s; look at its "
				"access list",
				mosquitto_reason_string(granted[i]));
	}
}

static void on_message(struct mosquitto *client, void *data,
                       const struct mosquitto_message *message,
                       const mosquitto_property *properties)
{
	struct db_mqtt_broker *broker = data;

	(void)client;
	(void)properties;
	broker->ops->message(broker->context, message->topic,
	                     message->payload ? message->payload : "", (size_t)message->payloadlen,
	                     message->retain);
}

/* --- connecting ------------------------------------------------------------------------------- */

static const struct db_mqtt_address *address_of(const struct db_mqtt_broker *broker)
{
	return &broker->config->addresses[broker->place];
}

/* Closes the connection, and logs the reason once. */
static void give_up(struct db_mqtt_broker *broker, db_time now)
{
	const struct db_mqtt_address *address = address_of(broker);
	struct place *place = &broker->places[broker->place];
	bool was_connected = broker->state == CONNECTED;

	if (was_connected || strcmp(broker->why, place->told) != 0)
		db_client_log(DB_CLIENT_WARNING,
		              "no connection to the broker %s, port %u: %s; it is tried again",
		              address->host, address->port, broker->why);
	memcpy(place->told, broker->why, sizeof(place->told));
	mosquitto_destroy(broker->client);
	broker->client = NULL;
	db_mqtt_gate_close(broker->gate);
	broker->gate = NULL;
	broker->state = AWAY;
	broker->place = (broker->place + 1) % broker->config->address_count;
	/* The others are tried at once, but for the spread of a fleet that has lost the same
	 * broker. */
	if (was_connected)
		db_mqtt_retry_lose(&broker->retry, now, broker->config->spread_s * DB_NS_PER_S,
		                   broker->config->address_count > 1, (unsigned)rand());
	else if (broker->place == 0)
		db_mqtt_retry_fail(&broker->retry, now, (unsigned)rand());
	if (was_connected)
		broker->ops->lost(broker->context);
}

/* Handles a result of the library; `cause` is errno at that time. */
static void fail(struct db_mqtt_broker *broker, int result, int cause, db_time now)
{
	/* Debian 12's library reports it as an error of TLS, that of 13 as one of the system. */
	if (broker->config->tls && broker->state != CONNECTED && broker->library[0])
		set_reason(broker, "TLS fails: %s", broker->library);
	else if (result == MOSQ_ERR_ERRNO && cause != 0)
		set_reason(broker, "%s", strerror(cause));
	else if (result == MOSQ_ERR_EAI)
		set_reason(broker, "its name cannot be resolved: %s", gai_strerror(cause));
	else if (result == MOSQ_ERR_KEEPALIVE)
		set_reason(broker, "it has fallen silent");
	else if (result == MOSQ_ERR_CONN_LOST || result == MOSQ_ERR_NO_CONN)
		set_reason(broker, "the broker has closed the connection");
	else if (result == MOSQ_ERR_MALFORMED_PACKET && broker->state != CONNECTED &&
	         broker->config->version == DB_MQTT_VERSION_5)
		/* Debian 13's library handles the short answer of 3.1.1 this way; that of 12
		 * returns a code. */
		set_reason(broker, "%s", OLD_VERSION);
	else
		set_reason(broker, "%s", mosquitto_strerror(result));
	give_up(broker, now);
}

/* 0 or an error of the library. */
static int set_up(struct db_mqtt_broker *broker)
{
	const struct db_mqtt_config *config = broker->config;
	struct db_mqtt_message will;
	int result;

	if (!broker->source_ops->will(broker->source, &will))
		return MOSQ_ERR_NOMEM;
	mosquitto_log_callback_set(broker->client, on_log);
	mosquitto_connect_v5_callback_set(broker->client, on_connect);
	mosquitto_disconnect_v5_callback_set(broker->client, on_disconnect);
	mosquitto_publish_v5_callback_set(broker->client, on_publish);
	mosquitto_subscribe_v5_callback_set(broker->client, on_subscribe);
	mosquitto_message_v5_callback_set(broker->client, on_message);
	result = mosquitto_int_option(broker->client, MOSQ_OPT_PROTOCOL_VERSION,
	                              config->version == DB_MQTT_VERSION_5 ? MQTT_PROTOCOL_V5 :
	                                                                     MQTT_PROTOCOL_V311);
	if (!result)
		result = mosquitto_int_option(broker->client, MOSQ_OPT_TCP_NODELAY, 1);
	if (!result)
		result = mosquitto_will_set(broker->client, will.topic, (int)will.length,
		                            will.payload, will.qos, will.retained);
	if (!result && config->user[0])
		result = mosquitto_username_pw_set(broker->client, config->user,
		                                   config->password[0] ? config->password : NULL);
	if (!result && config->tls)
		result = mosquitto_tls_set(
			broker->client,
			db_mqtt_tls_files_path(broker->files, DB_MQTT_TLS_AUTHORITIES), NULL,
			db_mqtt_tls_files_path(broker->files, DB_MQTT_TLS_CERTIFICATE),
			db_mqtt_tls_files_path(broker->files, DB_MQTT_TLS_KEY), NULL);
	return result;
}

/* Asks the broker to send no long messages, for which the library would allocate memory. The
 * library only accepts this setting together with a connection, but keeps it even when it refuses
 * to connect, as here: 1 s is no valid keepalive. */
static int limit_packets(struct db_mqtt_broker *broker)
{
	mosquitto_property *properties = NULL;
	int result = mosquitto_property_add_int32(&properties, MQTT_PROP_MAXIMUM_PACKET_SIZE,
	                                          DB_MQTT_PACKET_MAX);

	if (!result)
		(void)mosquitto_connect_bind_v5(broker->client, address_of(broker)->host,
		                                (int)address_of(broker)->port, 1, NULL, properties);
	mosquitto_property_free_all(&properties);
	return result;
}

static void start(struct db_mqtt_broker *broker, db_time now)
{
	const struct db_mqtt_config *config = broker->config;
	unsigned timeout_ms = config->keepalive_s * 1000;
	int result = MOSQ_ERR_NOMEM;

	broker->why[0] = '\0';
	broker->library[0] = '\0';
	broker->refused[0] = '\0';
	broker->urgent = 0;
	broker->accepted = false;
	/* A clean session: messages published while this program is away are not kept. */
	broker->client = mosquitto_new(config->client_id, true, broker);
	if (broker->client)
		result = set_up(broker);
	if (!result && config->version == DB_MQTT_VERSION_5)
		result = limit_packets(broker);
	errno = 0;
	if (!result)
		result = mosquitto_connect_async(broker->client, address_of(broker)->host,
		                                 (int)address_of(broker)->port,
		                                 (int)config->keepalive_s);
	if (result) {
		fail(broker, result, errno, now);
		return;
	}
	/* A pulled cable is then noticed as fast as silence. */
	(void)setsockopt(mosquitto_socket(broker->client), IPPROTO_TCP, TCP_USER_TIMEOUT,
	                 &timeout_ms, sizeof(timeout_ms));
	if (!config->tls) {
		broker->gate = db_mqtt_gate_open(mosquitto_socket(broker->client),
		                                 config->version == DB_MQTT_VERSION_5);
		if (!broker->gate) {
			fail(broker, MOSQ_ERR_ERRNO, errno, now);
			return;
		}
	}
	broker->state = CONNECTING;
	broker->give_up_at = now + CONNECT_MAX;
	broker->misc_at = now + MISC_INTERVAL;
}

/* True if bytes wait for room on their way to the broker. */
static bool is_choked(const struct db_mqtt_broker *broker)
{
	return mosquitto_want_write(broker->client) ||
	       (broker->gate && (db_mqtt_gate_poll_fd(broker->gate).events & POLLOUT));
}

struct pollfd db_mqtt_broker_watch(const struct db_mqtt_broker *broker, db_time *due)
{
	struct pollfd poll_fd = { .fd = -1, .events = POLLIN };

	*due = db_time_min(*due, broker->state == AWAY ? broker->retry.due : broker->misc_at);
	if (broker->state != AWAY && broker->state != CONNECTED)
		*due = db_time_min(*due, broker->give_up_at);
	if (!broker->client)
		return poll_fd;
	if (broker->gate)
		poll_fd = db_mqtt_gate_poll_fd(broker->gate);
	else
		poll_fd.fd = mosquitto_socket(broker->client);
	/* During the TLS handshake the library always asks to write, although it waits for the
	 * other side. */
	if (broker->state == CONNECTING || (broker->state == CONNECTED && is_choked(broker)))
		poll_fd.events |= POLLOUT;
	return poll_fd;
}

/* Sends the library's bytes, as far as there is room. False: the connection is lost. */
static bool flush(struct db_mqtt_broker *broker, db_time now)
{
	if (!broker->gate || db_mqtt_gate_send(broker->gate))
		return true;
	fail(broker, MOSQ_ERR_ERRNO, errno, now);
	return false;
}

/* As much as the broker accepts. */
static void send_messages(struct db_mqtt_broker *broker, db_time now)
{
	struct db_mqtt_message message;

	while (!is_choked(broker) && broker->source_ops->next(broker->source, now, &message)) {
		int number = 0;
		int result;

		errno = 0;
		result = mosquitto_publish(broker->client, &number, message.topic,
		                           (int)message.length, message.payload, message.qos,
		                           message.retained);
		/* A message that this broker can never accept is not repeated. */
		if (result == MOSQ_ERR_OVERSIZE_PACKET || result == MOSQ_ERR_PAYLOAD_SIZE) {
			broker->stats.refused++;
			broker->source_ops->sent(broker->source, 0, true, now);
			continue;
		}
		if (result) {
			fail(broker, result, errno, now);
			return;
		}
		broker->stats.sent++;
		broker->stats.bytes += strlen(message.topic) + message.length;
		broker->source_ops->sent(broker->source, message.qos > 0 ? number : 0, false, now);
		if (!flush(broker, now))
			return;
	}
}

/* 0 or an error of the library; an error of the gate is translated. */
static int read_some(struct db_mqtt_broker *broker)
{
	enum db_mqtt_gate_end end;
	int result = MOSQ_ERR_SUCCESS;
	int waiting = 0;
	int cause;

	/* Reading also continues the TLS handshake, whatever poll() reports. */
	errno = 0;
	if (!broker->gate)
		return mosquitto_loop_read(broker->client, 1);
	end = db_mqtt_gate_receive(broker->gate);
	cause = errno;
	/* What came through the gate. The library processes a few packets at a time. */
	while (!result && mosquitto_socket(broker->client) >= 0 &&
	       ioctl(mosquitto_socket(broker->client), FIONREAD, &waiting) == 0 && waiting > 0) {
		errno = 0;
		result = mosquitto_loop_read(broker->client, 1);
	}
	if (result || end == DB_MQTT_GATE_OPEN)
		return result;
	if (end == DB_MQTT_GATE_WRONG)
		set_reason(broker, "%s",
		           "the broker sends what no broker of MQTT may, or a message that is too "
		           "long");
	errno = cause;
	return end == DB_MQTT_GATE_CLOSED ? MOSQ_ERR_CONN_LOST :
	       end == DB_MQTT_GATE_BROKEN ? MOSQ_ERR_ERRNO :
	                                    MOSQ_ERR_MALFORMED_PACKET;
}

static void serve(struct db_mqtt_broker *broker, short revents, db_time now)
{
	int fd = broker->gate ? db_mqtt_gate_poll_fd(broker->gate).fd :
	                        mosquitto_socket(broker->client);
	socklen_t size = sizeof(int);
	int cause = 0;
	int result;

	if (broker->state == CONNECTING && (revents & (POLLERR | POLLHUP)) &&
	    getsockopt(fd, SOL_SOCKET, SO_ERROR, &cause, &size) == 0 && cause != 0)
		set_reason(broker, "%s", strerror(cause));
	result = read_some(broker);
	if (!result && mosquitto_socket(broker->client) >= 0) {
		errno = 0;
		result = mosquitto_loop_write(broker->client, 1);
	}
	if (!result && mosquitto_socket(broker->client) < 0)
		result = MOSQ_ERR_CONN_LOST;
	/* The library does not notice the end of a connection during the TLS handshake. */
	if (!result && broker->state != CONNECTED && !broker->accepted &&
	    (revents & (POLLHUP | POLLERR))) {
		set_reason(broker, "it does not take the connection");
		result = MOSQ_ERR_CONN_LOST;
	}
	if (result) {
		fail(broker, result, errno, now);
		return;
	}
	if (broker->state == CONNECTING)
		broker->state = GREETING;
	if (broker->state != GREETING || !broker->accepted)
		return;
	broker->state = CONNECTED;
	broker->stats.connections++;
	broker->places[broker->place].told[0] = '\0';
	broker->retry = (struct db_mqtt_retry){ .due = 0 };
	db_client_log(DB_CLIENT_NOTICE, "connected to the broker %s, port %u%s",
	              address_of(broker)->host, address_of(broker)->port,
	              broker->config->tls ? ", with TLS" : "");
	broker->ops->connected(broker->context);
}

/* Publishes the farewell and ends the session, as far as there is room for both at once. Without
 * room the broker publishes the will. */
static void say_farewell(struct db_mqtt_broker *broker)
{
	struct db_mqtt_message message;

	if (broker->state != CONNECTED || is_choked(broker) || !broker->source_ops->farewell ||
	    !broker->source_ops->farewell(broker->source, &message) ||
	    mosquitto_publish(broker->client, NULL, message.topic, (int)message.length,
	                      message.payload, message.qos, message.retained) ||
	    is_choked(broker))
		return;
	/* With MQTT 5 the will is published, too: whoever has missed the farewell gets that. */
	(void)mosquitto_disconnect_v5(
		broker->client,
		broker->config->version == DB_MQTT_VERSION_5 ? MQTT_RC_DISCONNECT_WITH_WILL_MSG : 0,
		NULL);
	if (broker->gate)
		(void)db_mqtt_gate_send(broker->gate);
}

void db_mqtt_broker_free(struct db_mqtt_broker *broker)
{
	if (!broker)
		return;
	say_farewell(broker);
	/* Without a farewell also without a DISCONNECT, so that the broker publishes the will. */
	mosquitto_destroy(broker->client);
	db_mqtt_gate_close(broker->gate);
	db_mqtt_tls_files_free(broker->files);
	free(broker->places);
	(void)mosquitto_lib_cleanup();
	free(broker);
}

void db_mqtt_broker_leave(struct db_mqtt_broker *broker, const char *why, db_time now)
{
	if (broker->state != CONNECTED)
		return;
	say_farewell(broker);
	set_reason(broker, "%s", why);
	give_up(broker, now);
}

void db_mqtt_broker_handle(struct db_mqtt_broker *broker, short revents, db_time now, int64_t us)
{
	int result = 0;

	if (broker->files)
		db_certificate_pair_look(&broker->files->pair, broker->config->certificate_file,
		                         us / 1000000);
	if (broker->state == AWAY && now >= broker->retry.due)
		start(broker, now);
	else if (broker->state != AWAY && revents != 0)
		serve(broker, revents, now);
	if (broker->state != AWAY && now >= broker->misc_at) {
		broker->misc_at = now + MISC_INTERVAL;
		errno = 0;
		result = mosquitto_loop_misc(broker->client);
		if (result)
			fail(broker, result, errno, now);
	}
	if (broker->state != AWAY && broker->state != CONNECTED && now >= broker->give_up_at) {
		set_reason(broker, "it does not answer");
		give_up(broker, now);
	}
	if (broker->state != AWAY && broker->state != CONNECTING && !flush(broker, now))
		return;
	if (broker->state == CONNECTED)
		send_messages(broker, now);
}

void db_mqtt_broker_renew(struct db_mqtt_broker *broker)
{
	if (broker->files)
		db_mqtt_tls_files_renew(broker->files);
	else
		db_client_log(DB_CLIENT_NOTICE,
		              "without tls there is nothing to be read again; the configuration is "
		              "read at a start");
}

void db_mqtt_broker_subscribe(struct db_mqtt_broker *broker, const char *filter, int qos, bool kept)
{
	int options = MQTT_SUB_OPT_RETAIN_AS_PUBLISHED |
	              (kept ? MQTT_SUB_OPT_SEND_RETAIN_ALWAYS : MQTT_SUB_OPT_SEND_RETAIN_NEVER);
	int result = mosquitto_subscribe_v5(broker->client, NULL, filter, qos, options, NULL);

	if (result)
		db_client_log(DB_CLIENT_ERROR, "cannot subscribe to %s: %s", filter,
		              mosquitto_strerror(result));
}

void db_mqtt_broker_send_now(struct db_mqtt_broker *broker, const char *topic, const char *text)
{
	int number = 0;

	if (broker->state == CONNECTED && broker->urgent == 0 && !is_choked(broker) &&
	    !mosquitto_publish(broker->client, &number, topic, (int)strlen(text), text, 1, false))
		broker->urgent = number;
}

struct db_mqtt_broker_stats db_mqtt_broker_read_stats(const struct db_mqtt_broker *broker)
{
	struct db_mqtt_broker_stats stats = broker->stats;

	if (broker->files)
		stats.certificate_ends = broker->files->pair.facts.ends;
	return stats;
}
