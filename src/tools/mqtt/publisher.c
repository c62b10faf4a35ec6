/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/publisher.h"

#include "client/clock.h"
#include "client/log.h"
#include "client/plant.h"
#include "client/program.h"
#include "drivebridge/version.h"
#include "mqtt/acting.h"
#include "mqtt/admission.h"
#include "mqtt/broker.h"
#include "mqtt/choice.h"
#include "mqtt/discovery.h"
#include "mqtt/moment.h"
#include "mqtt/outbox.h"
#include "mqtt/picture.h"
#include "mqtt/ration.h"
#include "mqtt/senders.h"
#include "mqtt/topics.h"
#include "mqtt/trouble.h"
#include "users/users.h"

#include <stdlib.h>
#include <string.h>

#define BYTES_PER_KIB 1024

struct db_mqtt_publisher {
	sd_event *loop;
	const struct db_mqtt_config *config;
	struct db_mqtt_topic status;
	struct db_mqtt_outbox *outbox;
	struct db_mqtt_broker *broker;
	struct db_waker broker_waker;
	struct db_plant *plant;
	struct db_mqtt_acting *acting;
	struct db_mqtt_senders *senders;
	struct db_mqtt_picture **pictures;
	size_t picture_count;
	json_t *buses; /* those with retained messages: as in Describe */
	db_time now;   /* of this turn; also the next one */
	int64_t us;
	db_time figures_at;
	db_time echo_at;    /* DB_TIME_NEVER without a connection, or without commands */
	db_time echoed;     /* when the latest returned echo was sent */
	unsigned echo_mark; /* of the connection */
	db_time heard;      /* when the broker's latest message arrived */
	db_time subscribed; /* since when this program is subscribed */
	db_time served;     /* since when the service has been the same run */
	int64_t service;    /* when that run began, by its own clock */
	struct db_mqtt_ration answers;
	uint64_t left_out; /* refusals that were not answered */
	bool warned;       /* of the service, which lets this program command nothing */
	struct db_client_log_ration refusals;
	uint64_t skipped;      /* samples that the service left out */
	uint64_t dropped_told; /* of the outbox, when it was last logged */
};

static void publish(struct db_mqtt_publisher *publisher, struct db_mqtt_topic topic, char *text,
                    bool retained)
{
	if (text && retained)
		db_mqtt_outbox_set_retained(publisher->outbox, topic.text, text);
	else if (text)
		db_mqtt_outbox_add_sample(publisher->outbox, DB_MQTT_USUAL, topic.text, text);
	free(text);
}

/* Takes the object over. */
static void publish_json(struct db_mqtt_publisher *publisher, struct db_mqtt_topic topic,
                         json_t *object, enum db_mqtt_lane lane)
{
	char *text = object ? db_mqtt_picture_dump(object) : NULL;

	if (text)
		db_mqtt_outbox_add_sample(publisher->outbox, lane, topic.text, text);
	free(text);
	json_decref(object);
}

/* The same, retained by the broker. */
static void publish_retained(struct db_mqtt_publisher *publisher, struct db_mqtt_topic topic,
                             json_t *object)
{
	publish(publisher, topic, object ? db_mqtt_picture_dump(object) : NULL, true);
	json_decref(object);
}

static struct db_mqtt_topic topic_of(const struct db_mqtt_publisher *publisher, const char *leaf)
{
	return db_mqtt_topic_of_gateway(publisher->config->prefix, publisher->config->gateway,
	                                leaf);
}

static struct db_mqtt_topic topic_of_drive(const struct db_mqtt_publisher *publisher,
                                           const char *drive, const char *leaf)
{
	return db_mqtt_topic_of_drive(publisher->config->prefix, publisher->config->gateway, drive,
	                              leaf);
}

static struct db_mqtt_topic topic_of_bus(const struct db_mqtt_publisher *publisher, const char *bus,
                                         const char *leaf)
{
	return db_mqtt_topic_of_bus(publisher->config->prefix, publisher->config->gateway, bus,
	                            leaf);
}

/* --- drives ----------------------------------------------------------------------------------- */

static struct db_mqtt_picture *find_picture(const struct db_mqtt_publisher *publisher,
                                            const char *drive)
{
	for (size_t i = 0; i < publisher->picture_count; i++) {
		if (strcmp(db_mqtt_picture_name(publisher->pictures[i]), drive) == 0)
			return publisher->pictures[i];
	}
	return NULL;
}

static void on_sample(void *context, const json_t *sample, int64_t us)
{
	struct db_mqtt_publisher *publisher = context;
	const struct db_mqtt_config *config = publisher->config;
	const char *drive = db_client_text(sample, "drive");
	struct db_mqtt_picture *picture = find_picture(publisher, drive);

	if (!picture)
		return;
	publish(publisher, topic_of_drive(publisher, drive, "changes"),
	        db_mqtt_picture_take(picture, json_object_get(sample, "values"), us), false);
	if (db_mqtt_picture_state_is_due(picture, config->state_interval_ms * DB_NS_PER_MS,
	                                 config->refresh_s * DB_NS_PER_S, db_client_now()))
		publish(publisher, topic_of_drive(publisher, drive, "state"),
		        db_mqtt_picture_write_state(picture), true);
}

static void on_skipped(void *context, int64_t count)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->skipped += (uint64_t)count;
}

static void publish_document(void *context, const char *topic, const char *text)
{
	const struct db_mqtt_publisher *publisher = context;

	db_mqtt_outbox_set_retained(publisher->outbox, topic, text);
}

static void forget_pictures(struct db_mqtt_publisher *publisher)
{
	for (size_t i = 0; i < publisher->picture_count; i++)
		db_mqtt_picture_free(publisher->pictures[i]);
	free(publisher->pictures);
	publisher->pictures = NULL;
	publisher->picture_count = 0;
}

/* Removes the retained messages of drives and buses that no longer exist. */
static void withdraw_missing(struct db_mqtt_publisher *publisher, const json_t *description)
{
	static const char *const of_drive[] = { "about", "state", "trouble" };
	static const char *const of_bus[] = { "figures", "trouble" };
	const json_t *drives = json_object_get(description, "drives");
	json_t *buses = json_object_get(description, "buses");
	size_t b;
	const json_t *bus;

	for (size_t i = 0; i < publisher->picture_count; i++) {
		const char *name = db_mqtt_picture_name(publisher->pictures[i]);

		if (db_client_named(drives, name))
			continue;
		if (publisher->config->discovery)
			db_mqtt_discovery_announce(publisher->config, publisher->pictures[i],
			                           db_plant_stops(publisher->plant), true,
			                           publish_document, publisher);
		for (size_t l = 0; l < sizeof(of_drive) / sizeof(of_drive[0]); l++)
			db_mqtt_outbox_set_retained(
				publisher->outbox,
				topic_of_drive(publisher, name, of_drive[l]).text, "");
	}
	json_array_foreach(publisher->buses, b, bus)
	{
		const char *name = db_client_text(bus, "name");

		for (size_t l = 0; !db_client_named(buses, name) && l < 2; l++)
			db_mqtt_outbox_set_retained(publisher->outbox,
			                            topic_of_bus(publisher, name, of_bus[l]).text,
			                            "");
	}
	json_decref(publisher->buses);
	publisher->buses = json_incref(buses);
}

static void choose_drives(void *context, json_t *description)
{
	const struct db_mqtt_publisher *publisher = context;

	db_mqtt_choose_drives(publisher->config, json_object_get(description, "drives"));
}

static json_t *choose_registers(void *context, const char *drive, json_t *received, bool commands)
{
	const struct db_mqtt_publisher *publisher = context;

	(void)drive;
	return commands ? json_null() : db_mqtt_choose_registers(publisher->config, received);
}

/* Begins the stream of the published values. */
static void subscribe(struct db_mqtt_publisher *publisher, const struct db_plant_drive *drives,
                      size_t count)
{
	json_t *values = db_mqtt_collect_names(publisher->config, drives, count);
	json_t *names = json_array();

	for (size_t i = 0; i < count; i++)
		(void)json_array_append(names, json_object_get(drives[i].description, "name"));
	/* No drives would mean all of them. */
	if (count > 0)
		db_plant_subscribe(publisher->plant, names, values, publisher->config->interval_ms,
		                   false);
	json_decref(names);
	json_decref(values);
}

static void on_found(void *context, json_t *description, const struct db_plant_drive *drives,
                     size_t count)
{
	struct db_mqtt_publisher *publisher = context;
	const char *version = json_string_value(json_object_get(description, "version"));
	int64_t service = json_integer_value(json_object_get(description, "started_us"));

	/* Another run of the service does not remember earlier ids. */
	if (service != publisher->service)
		publisher->served = db_client_now();
	publisher->service = service;
	/* Services of before have no audit trail. */
	db_mqtt_acting_set_audit(publisher->acting, json_object_get(description, "audit_trouble"));
	withdraw_missing(publisher, description);
	forget_pictures(publisher);
	publisher->pictures = calloc(count + 1, sizeof(struct db_mqtt_picture *));
	for (size_t i = 0; publisher->pictures && i < count; i++) {
		struct db_mqtt_picture *picture = db_mqtt_picture_new(drives[i].description,
		                                                      drives[i].registers);

		if (!picture)
			continue;
		publisher->pictures[publisher->picture_count++] = picture;
		publish(publisher,
		        topic_of_drive(publisher, db_mqtt_picture_name(picture), "about"),
		        db_mqtt_picture_write_about(picture), true);
		if (publisher->config->discovery)
			db_mqtt_discovery_announce(publisher->config, picture,
			                           db_plant_stops(publisher->plant), false,
			                           publish_document, publisher);
	}
	db_mqtt_outbox_set_retained(publisher->outbox, publisher->status.text, "online");
	if (db_mqtt_config_commands(publisher->config) && !publisher->warned &&
	    !json_is_true(json_object_get(description, "may_act"))) {
		db_client_log(
			DB_CLIENT_WARNING,
			"commands are on, but the service lets this program only read: its user must "
			"belong to the service's act-group (see drivebridge-mqtt(8))");
		publisher->warned = true;
	}
	db_client_log(DB_CLIENT_NOTICE, "connected to drivebridged %s; drives: %zu",
	              version ? version : "", publisher->picture_count);
	subscribe(publisher, drives, count);
}

static void on_troubles(void *context, const struct db_client_troubles *troubles,
                        const json_t *news)
{
	struct db_mqtt_publisher *publisher = context;
	size_t i;
	const json_t *record;

	json_array_foreach(json_object_get(news, "drives"), i, record)
	{
		const char *drive = db_client_text(record, "drive");

		if (find_picture(publisher, drive))
			publish_retained(publisher, topic_of_drive(publisher, drive, "trouble"),
			                 db_mqtt_trouble_write(record));
	}
	json_array_foreach(json_object_get(news, "buses"), i, record) publish_retained(
		publisher, topic_of_bus(publisher, db_client_text(record, "bus"), "trouble"),
		db_mqtt_trouble_write(record));
	publish_retained(publisher, topic_of(publisher, "trouble"),
	                 json_pack("{s:b, s:o}", "well", troubles->well, "configuration",
	                           db_mqtt_trouble_write(troubles->configuration)));
}

/* Old values must not pass for current ones. */
static void on_lost(void *context)
{
	struct db_mqtt_publisher *publisher = context;
	size_t i;
	const json_t *bus;

	db_mqtt_outbox_set_retained(publisher->outbox, publisher->status.text, "no-service");
	for (i = 0; i < publisher->picture_count; i++) {
		struct db_mqtt_picture *picture = publisher->pictures[i];
		const char *drive = db_mqtt_picture_name(picture);

		publish(publisher, topic_of_drive(publisher, drive, "changes"),
		        db_mqtt_picture_forget(picture, db_client_wall_us()), false);
		publish(publisher, topic_of_drive(publisher, drive, "state"),
		        db_mqtt_picture_write_state(picture), true);
		publish_retained(publisher, topic_of_drive(publisher, drive, "trouble"),
		                 db_mqtt_trouble_write(NULL));
	}
	json_array_foreach(publisher->buses, i, bus) publish_retained(
		publisher, topic_of_bus(publisher, db_client_text(bus, "name"), "trouble"),
		db_mqtt_trouble_write(NULL));
	publish_retained(
		publisher, topic_of(publisher, "trouble"),
		json_pack("{s:n, s:o}", "well", "configuration", db_mqtt_trouble_write(NULL)));
}

/* --- the rest --------------------------------------------------------------------------------- */

static void on_event(void *context, json_t *event)
{
	struct db_mqtt_publisher *publisher = context;

	publish_json(publisher, topic_of(publisher, "event"), db_mqtt_trouble_write_event(event),
	             DB_MQTT_PROMPT);
}

static void on_figures(void *context, json_t *buses)
{
	struct db_mqtt_publisher *publisher = context;
	const char *bus;
	json_t *figures;

	json_object_foreach(buses, bus, figures) publish_retained(
		publisher, topic_of_bus(publisher, bus, "figures"),
		json_pack("{s:o, s:O}", "time", db_mqtt_moment_describe(db_client_wall_us()),
	                  "values", figures));
}

static void publish_figures(struct db_mqtt_publisher *publisher)
{
	struct db_mqtt_outbox_stats outbox = db_mqtt_outbox_read_stats(publisher->outbox);
	struct db_mqtt_broker_stats broker = db_mqtt_broker_read_stats(publisher->broker);

	publish_retained(
		publisher, topic_of(publisher, "figures"),
		json_pack("{s:o, s:s, s:{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:o*}}",
	                  "time", db_mqtt_moment_describe(db_client_wall_us()), "version",
	                  DB_VERSION, "values", "connections", (json_int_t)broker.connections,
	                  "sent", (json_int_t)broker.sent, "bytes", (json_int_t)broker.bytes,
	                  "refused", (json_int_t)broker.refused, "dropped",
	                  (json_int_t)outbox.dropped, "buffered", (json_int_t)outbox.messages,
	                  "buffered_bytes", (json_int_t)outbox.bytes, "skipped",
	                  (json_int_t)publisher->skipped, "left_out",
	                  (json_int_t)publisher->left_out, "certificate_ends_s",
	                  broker.certificate_ends ? json_integer(broker.certificate_ends) : NULL));
	if (outbox.dropped > publisher->dropped_told)
		db_client_log(DB_CLIENT_WARNING,
		              "the buffer is full: %llu messages more dropped, the oldest first",
		              (unsigned long long)(outbox.dropped - publisher->dropped_told));
	publisher->dropped_told = outbox.dropped;
	publisher->figures_at = db_client_now() +
	                        publisher->config->figures_interval_s * DB_NS_PER_S;
}

/* --- commands --------------------------------------------------------------------------------- */

/* A probe that the broker sends back: a message that arrives after it was not on its way for
 * longer. */
static void send_echo(struct db_mqtt_publisher *publisher)
{
	const struct db_mqtt_config *config = publisher->config;
	db_time silence = config->keepalive_s * DB_NS_PER_S;
	char text[64];

	/* A broker that is connected but silent, or this late, counts as lost for the senders of
	 * commands. */
	if (db_client_now() - publisher->echoed > silence && db_mqtt_acting_drop(publisher->acting))
		db_client_log(
			DB_CLIENT_WARNING,
			db_client_now() - publisher->heard > silence ?
				"the broker has sent nothing for %u s: what was commanded over it is "
				"given up" :
				"what the broker sends is more than %u s late: what was commanded "
				"over it is given up",
			config->keepalive_s);
	(void)snprintf(text, sizeof(text), "%u %lld", publisher->echo_mark,
	               (long long)db_client_now());
	db_mqtt_broker_send_now(publisher->broker, topic_of(publisher, "echo").text, text);
	publisher->echo_at = db_client_now() + config->age_ms * DB_NS_PER_MS / 4;
}

static void on_broker_connected(void *context)
{
	struct db_mqtt_publisher *publisher = context;
	const struct db_mqtt_config *config = publisher->config;

	/* The number of dropped samples is published before the first late values. */
	publish_figures(publisher);
	if (!db_mqtt_config_commands(config))
		return;
	publisher->echo_mark = (unsigned)rand();
	publisher->echoed = db_client_now() - 2 * config->age_ms * DB_NS_PER_MS;
	publisher->echo_at = db_client_now();
	publisher->heard = db_client_now();
	publisher->subscribed = db_client_now();
	/* The echo and stops must not be dropped in a flood; other commands are better dropped than
	 * late. */
	db_mqtt_broker_subscribe(publisher->broker, topic_of(publisher, "echo").text, 1);
	db_mqtt_broker_subscribe(publisher->broker, topic_of_drive(publisher, "+", "stop").text, 1);
	db_mqtt_broker_subscribe(publisher->broker, topic_of_drive(publisher, "+", "command").text,
	                         0);
	if (config->senders == DB_MQTT_SENDERS_OFF) {
		db_mqtt_broker_subscribe(publisher->broker,
		                         topic_of_drive(publisher, "+", "alive").text, 0);
		return;
	}
	/* Topics without a name are received, too: their senders may only stop, and are told so. */
	db_mqtt_broker_subscribe(publisher->broker, topic_of_drive(publisher, "+", "stop/+").text,
	                         1);
	db_mqtt_broker_subscribe(publisher->broker,
	                         topic_of_drive(publisher, "+", "command/+").text, 0);
	db_mqtt_broker_subscribe(publisher->broker, topic_of_drive(publisher, "+", "alive/+").text,
	                         0);
}

/* Senders of commands cannot stop a drive any more: the drives lose their client. */
static void on_broker_lost(void *context)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->echo_at = DB_TIME_NEVER;
	(void)db_mqtt_acting_drop(publisher->acting);
}

static void publish_result(void *context, const struct db_mqtt_outcome *outcome)
{
	struct db_mqtt_publisher *publisher = context;
	json_t *object;

	/* A flood of refused commands must not delay other results. */
	if (outcome->refused && !db_mqtt_ration_take(&publisher->answers, outcome->drive,
	                                             outcome->sender, db_client_now())) {
		publisher->left_out++;
		return;
	}
	object = json_pack("{s:o, s:s, s:s, s:s}", "time",
	                   db_mqtt_moment_describe(db_client_wall_us()), "id", outcome->id,
	                   "command", outcome->command, "result", outcome->result);
	if (object && outcome->repeated)
		(void)json_object_set_new(object, "repeated", json_true());
	if (object && outcome->why[0])
		(void)json_object_set_new(object, "reason", json_string(outcome->why));
	publish_json(publisher, topic_of_drive(publisher, outcome->drive, "result"), object,
	             outcome->refused ? DB_MQTT_LAST : DB_MQTT_PROMPT);
}

/* The name in the topic is the sender's, whatever the message says. NULL, or the mistake. */
static const char *take_sender(const struct db_mqtt_publisher *publisher,
                               struct db_mqtt_command *command, const char *sender,
                               const char *wrong)
{
	if (publisher->config->senders == DB_MQTT_SENDERS_OFF)
		return wrong;
	if (!wrong && !command->stops && command->user[0] && strcmp(command->user, sender) != 0)
		wrong = "it names another user than its topic";
	/* Others cannot be users, and could look like something else in the audit trail. */
	command->user = db_users_name_is_good(sender) ? sender : "";
	return wrong;
}

static void handle_command(struct db_mqtt_publisher *publisher, struct db_mqtt_command *command,
                           const char *wrong, const char *drive, const char *sender, bool retained)
{
	const struct db_grant grant = db_mqtt_senders_grant(publisher->senders, sender);
	const struct db_mqtt_arrival arrival = {
		.drive = drive,
		.grant = &grant,
		.retained = retained,
		.now = db_client_now(),
		.us = db_client_wall_us(),
		.sent_behind = publisher->echoed,
		.subscribed = publisher->subscribed,
		.served = publisher->served,
	};
	struct db_mqtt_outcome refusal = {
		.drive = drive,
		.sender = command->user ? command->user : "",
		.id = command->id,
		.command = command->name ? command->name : "",
		.result = wrong ? "bad_message" : NULL,
		.why = wrong,
		.refused = true,
	};
	char why[DB_MQTT_REASON_MAX];

	if (!wrong) {
		refusal.result = db_mqtt_admission_judge(publisher->config, command, &arrival, why);
		refusal.why = why;
	}
	/* A service that returns meanwhile may have carried it out before. */
	if (!refusal.result && !db_plant_is_there(publisher->plant) && !command->stops) {
		refusal.result = "lost";
		refusal.why = "drivebridged is not there";
	}
	if (refusal.result) {
		db_client_log_rationed(&publisher->refusals, arrival.now, DB_CLIENT_WARNING,
		                       "drive %s: a command from the broker is refused: %s", drive,
		                       refusal.why);
		publish_result(publisher, &refusal);
	} else {
		db_mqtt_acting_run(publisher->acting, drive, command,
		                   db_mqtt_admission_left_ms(publisher->config, command, &arrival),
		                   arrival.now);
	}
	db_mqtt_command_clear(command);
}

static bool is_leaf(const struct db_mqtt_publisher *publisher, const char *topic, const char *leaf,
                    char drive[DB_MQTT_NAME_MAX], char sender[DB_MQTT_TOPIC_MAX])
{
	const struct db_mqtt_config *config = publisher->config;

	return db_mqtt_topic_is_of_drive(topic, config->prefix, config->gateway, leaf, drive,
	                                 sender) &&
	       (sender[0] == '\0' || config->senders == DB_MQTT_SENDERS_TOPIC);
}

/* Only he who has commanded the drive keeps it going, and as long as he may. */
static void feed(struct db_mqtt_publisher *publisher, const char *drive, const char *sender)
{
	struct db_grant grant = db_mqtt_senders_grant(publisher->senders, sender);
	bool named = publisher->config->senders == DB_MQTT_SENDERS_TOPIC;

	if (!named || (sender[0] && db_grant_has(&grant, DB_MAY_MOVE, drive)))
		db_mqtt_acting_feed(publisher->acting, drive, named ? sender : NULL,
		                    db_client_now());
}

static void on_message(void *context, const char *topic, const char *text, size_t length,
                       bool retained)
{
	struct db_mqtt_publisher *publisher = context;
	db_time now = db_client_now();
	bool current = now - publisher->echoed <= publisher->config->age_ms * DB_NS_PER_MS;
	const json_t *stops = db_plant_stops(publisher->plant);
	struct db_mqtt_command command;
	char drive[DB_MQTT_NAME_MAX];
	char sender[DB_MQTT_TOPIC_MAX];
	const char *wrong;
	unsigned mark;
	long long sent;

	publisher->heard = now;
	if (strcmp(topic, topic_of(publisher, "echo").text) == 0) {
		if (sscanf(text, "%u %lld", &mark, &sent) == 2 && mark == publisher->echo_mark &&
		    sent > publisher->echoed && sent <= now)
			publisher->echoed = sent;
	} else if (is_leaf(publisher, topic, "command", drive, sender) &&
	           find_picture(publisher, drive)) {
		wrong = db_mqtt_command_parse(text, length, stops, &command);
		wrong = take_sender(publisher, &command, sender, wrong);
		handle_command(publisher, &command, wrong, drive, sender, retained);
	} else if (is_leaf(publisher, topic, "stop", drive, sender) &&
	           find_picture(publisher, drive)) {
		wrong = db_mqtt_command_parse_stop(text, length, stops, &command);
		wrong = take_sender(publisher, &command, sender, wrong);
		handle_command(publisher, &command, wrong, drive, sender, retained);
	} else if (is_leaf(publisher, topic, "alive", drive, sender) && current && !retained) {
		feed(publisher, drive, sender);
	}
}

/* --- its life --------------------------------------------------------------------------------- */

struct db_mqtt_publisher *db_mqtt_publisher_new(sd_event *loop, const struct db_mqtt_config *config)
{
	static const struct db_plant_ops plant_ops = {
		.choose = choose_drives,
		.keep = choose_registers,
		.found = on_found,
		.lost = on_lost,
		.sample = on_sample,
		.skipped = on_skipped,
		.event = on_event,
		.figures = on_figures,
		.troubles = on_troubles,
	};
	static const struct db_mqtt_broker_ops broker_ops = {
		.connected = on_broker_connected,
		.lost = on_broker_lost,
		.message = on_message,
	};
	const struct db_plant_wishes wishes = {
		.socket = config->socket,
		.registers = true,
		.events = config->events == DB_MQTT_ON,
		.troubles = true,
		.interval = config->figures_interval_s * DB_NS_PER_S,
	};
	struct db_mqtt_publisher *publisher = calloc(1, sizeof(*publisher));

	if (!publisher)
		return NULL;
	publisher->loop = loop;
	publisher->config = config;
	publisher->status = topic_of(publisher, "status");
	publisher->outbox = db_mqtt_outbox_new(config->buffer_messages,
	                                       (size_t)config->buffer_kib * BYTES_PER_KIB);
	if (publisher->outbox)
		publisher->broker = db_mqtt_broker_new(config, publisher->status.text,
		                                       publisher->outbox, &broker_ops, publisher);
	publisher->plant = db_plant_new(loop, &wishes, &plant_ops, publisher);
	publisher->acting = db_mqtt_acting_new(loop, config->socket, publish_result, publisher);
	publisher->senders = db_mqtt_senders_new(config);
	publisher->echo_at = DB_TIME_NEVER;
	if (!publisher->outbox || !publisher->broker || !publisher->plant || !publisher->acting ||
	    !publisher->senders) {
		db_mqtt_publisher_free(publisher);
		return NULL;
	}
	db_mqtt_outbox_set_retained(publisher->outbox, publisher->status.text, "no-service");
	return publisher;
}

void db_mqtt_publisher_free(struct db_mqtt_publisher *publisher)
{
	if (!publisher)
		return;
	(void)db_waker_take(&publisher->broker_waker);
	db_mqtt_acting_free(publisher->acting);
	db_mqtt_senders_free(publisher->senders);
	db_plant_free(publisher->plant);
	db_mqtt_broker_free(publisher->broker);
	db_mqtt_outbox_free(publisher->outbox);
	forget_pictures(publisher);
	json_decref(publisher->buses);
	free(publisher);
}

void db_mqtt_publisher_renew(void *context)
{
	struct db_mqtt_publisher *publisher = context;

	db_mqtt_broker_renew(publisher->broker);
}

db_time db_mqtt_publisher_turn(void *context, db_time now, int64_t us)
{
	struct db_mqtt_publisher *publisher = context;
	short happened = (short)db_waker_take(&publisher->broker_waker);
	struct pollfd watched;
	db_time due;
	db_time broker_due;

	db_mqtt_broker_look(publisher->broker, us);
	due = db_plant_tend(publisher->plant, now);
	if (now >= publisher->figures_at)
		publish_figures(publisher);
	if (now >= publisher->echo_at)
		send_echo(publisher);
	db_mqtt_broker_handle(publisher->broker, happened, now);
	watched = db_mqtt_broker_watch(publisher->broker);
	db_waker_arm(&publisher->broker_waker, publisher->loop, watched.fd,
	             (uint32_t)watched.events);
	broker_due = db_mqtt_broker_due(publisher->broker);
	if (broker_due < due)
		due = broker_due;
	if (publisher->echo_at < due)
		due = publisher->echo_at;
	return publisher->figures_at < due ? publisher->figures_at : due;
}
