/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/publisher.h"

#include "client/log.h"
#include "drivebridge/version.h"
#include "mqtt/admission.h"
#include "mqtt/broker.h"
#include "mqtt/discovery.h"
#include "mqtt/moment.h"
#include "mqtt/outbox.h"
#include "mqtt/picture.h"
#include "mqtt/plant.h"
#include "mqtt/ration.h"
#include "mqtt/topics.h"

#include <stdlib.h>
#include <string.h>

#define BYTES_PER_KIB 1024

struct db_mqtt_publisher {
	const struct db_mqtt_config *config;
	struct db_mqtt_topic status;
	struct db_mqtt_outbox *outbox;
	struct db_mqtt_broker *broker;
	struct db_mqtt_plant *plant;
	struct db_mqtt_acting *acting;
	struct db_mqtt_picture **pictures;
	size_t picture_count;
	db_time now; /* of this turn; likewise the next */
	int64_t us;
	db_time figures_at;
	db_time echo_at;    /* DB_TIME_NEVER without a connection, or without commands */
	db_time echoed;     /* of the latest echo: when it was sent */
	unsigned echo_mark; /* of the connection */
	db_time heard;      /* of the broker: its latest message */
	db_time subscribed; /* since then its messages are for us */
	db_time served;     /* since then the service is the same one */
	int64_t service;    /* when that began, by its own clock */
	bool there;         /* it is */
	struct db_mqtt_ration answers;
	uint64_t left_out; /* refusals that were not answered */
	bool warned;       /* that the service lets us command nothing */
	struct db_client_log_ration refusals;
	uint64_t skipped;      /* samples that the service left out */
	uint64_t dropped_told; /* of the outbox, when it was logged last */
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

/* Likewise, to be kept by the broker. */
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

static json_t *describe_moment(int64_t us)
{
	char text[DB_MQTT_MOMENT_MAX];

	db_mqtt_moment_write(us, text);
	return json_string(text);
}

/* --- drives ----------------------------------------------------------------------------------- */

static void publish_state_if_due(struct db_mqtt_publisher *publisher,
                                 struct db_mqtt_picture *picture)
{
	const struct db_mqtt_config *config = publisher->config;

	if (db_mqtt_picture_state_is_due(picture, config->state_interval_ms * DB_NS_PER_MS,
	                                 config->refresh_s * DB_NS_PER_S, publisher->now))
		publish(publisher,
		        topic_of_drive(publisher, db_mqtt_picture_name(picture), "state"),
		        db_mqtt_picture_write_state(picture), true);
}

static void take_sample(void *context, const json_t *sample, int64_t us)
{
	struct db_mqtt_publisher *publisher = context;
	const char *drive = json_string_value(json_object_get(sample, "drive"));

	for (size_t i = 0; drive && i < publisher->picture_count; i++) {
		struct db_mqtt_picture *picture = publisher->pictures[i];

		if (strcmp(db_mqtt_picture_name(picture), drive) != 0)
			continue;
		publish(publisher, topic_of_drive(publisher, drive, "changes"),
		        db_mqtt_picture_take(picture, json_object_get(sample, "values"), us),
		        false);
		publish_state_if_due(publisher, picture);
		return;
	}
}

static void take_skipped(void *context, int64_t count)
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

/* A drive that there was, and is no more, leaves nothing behind at the broker. */
static void withdraw_missing(struct db_mqtt_publisher *publisher, const json_t *drives)
{
	static const char *const leaves[] = { "about", "state" };

	for (size_t i = 0; i < publisher->picture_count; i++) {
		const char *name = db_mqtt_picture_name(publisher->pictures[i]);
		bool there = false;
		size_t d;
		const json_t *drive;

		json_array_foreach(drives, d, drive)
		{
			const char *other = json_string_value(json_object_get(drive, "name"));

			there = there || (other && strcmp(other, name) == 0);
		}
		if (!there && publisher->config->discovery)
			db_mqtt_discovery_announce(publisher->config, publisher->pictures[i], true,
			                           publish_document, publisher);
		for (size_t l = 0; !there && l < sizeof(leaves) / sizeof(leaves[0]); l++)
			db_mqtt_outbox_set_retained(publisher->outbox,
			                            topic_of_drive(publisher, name, leaves[l]).text,
			                            "");
	}
}

static void greet_plant(void *context, const json_t *description, const json_t *registers)
{
	struct db_mqtt_publisher *publisher = context;
	const json_t *drives = json_object_get(description, "drives");
	const char *version = json_string_value(json_object_get(description, "version"));
	int64_t service = json_integer_value(json_object_get(description, "started_us"));
	size_t i;
	const json_t *drive;

	/* Another run of it has forgotten which ids there were. */
	if (service != publisher->service)
		publisher->served = publisher->now;
	publisher->service = service;
	publisher->there = true;
	withdraw_missing(publisher, drives);
	forget_pictures(publisher);
	publisher->pictures = calloc(json_array_size(drives) + 1, sizeof(struct db_mqtt_picture *));
	json_array_foreach(drives, i, drive)
	{
		const char *name = json_string_value(json_object_get(drive, "name"));
		struct db_mqtt_picture *picture =
			publisher->pictures && name ?
				db_mqtt_picture_new(drive, json_object_get(registers, name)) :
				NULL;

		if (!picture)
			continue;
		publisher->pictures[publisher->picture_count++] = picture;
		publish(publisher, topic_of_drive(publisher, name, "about"),
		        db_mqtt_picture_write_about(picture), true);
		if (publisher->config->discovery)
			db_mqtt_discovery_announce(publisher->config, picture, false,
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
	db_client_log(DB_CLIENT_NOTICE, "drivebridged %s is there, drives: %zu",
	              version ? version : "", publisher->picture_count);
}

/* Nobody is to take old values for those of now. */
static void miss_plant(void *context)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->there = false;
	db_mqtt_outbox_set_retained(publisher->outbox, publisher->status.text, "no-service");
	for (size_t i = 0; i < publisher->picture_count; i++) {
		struct db_mqtt_picture *picture = publisher->pictures[i];
		const char *drive = db_mqtt_picture_name(picture);

		publish(publisher, topic_of_drive(publisher, drive, "changes"),
		        db_mqtt_picture_forget(picture, publisher->us), false);
		publish(publisher, topic_of_drive(publisher, drive, "state"),
		        db_mqtt_picture_write_state(picture), true);
	}
}

/* --- the rest --------------------------------------------------------------------------------- */

static void take_event(void *context, json_t *event)
{
	struct db_mqtt_publisher *publisher = context;
	json_t *copy = json_copy(event);

	(void)json_object_del(copy, "number");
	(void)json_object_del(copy, "time_us");
	(void)json_object_set_new(
		copy, "time",
		describe_moment(json_integer_value(json_object_get(event, "time_us"))));
	publish_json(publisher, topic_of(publisher, "event"), copy, DB_MQTT_PROMPT);
}

static void take_figures(void *context, json_t *buses)
{
	struct db_mqtt_publisher *publisher = context;
	const char *bus;
	json_t *figures;

	json_object_foreach(buses, bus, figures) publish_retained(
		publisher,
		db_mqtt_topic_of_bus(publisher->config->prefix, publisher->config->gateway, bus,
	                             "figures"),
		json_pack("{s:o, s:O}", "time", describe_moment(publisher->us), "values", figures));
}

static void publish_figures(struct db_mqtt_publisher *publisher)
{
	struct db_mqtt_outbox_stats outbox = db_mqtt_outbox_read_stats(publisher->outbox);
	struct db_mqtt_broker_stats broker = db_mqtt_broker_read_stats(publisher->broker);

	publish_retained(
		publisher, topic_of(publisher, "figures"),
		json_pack("{s:o, s:s, s:{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I}}", "time",
	                  describe_moment(publisher->us), "version", DB_VERSION, "values",
	                  "connections", (json_int_t)broker.connections, "sent",
	                  (json_int_t)broker.sent, "bytes", (json_int_t)broker.bytes, "refused",
	                  (json_int_t)broker.refused, "dropped", (json_int_t)outbox.dropped,
	                  "buffered", (json_int_t)outbox.messages, "buffered_bytes",
	                  (json_int_t)outbox.bytes, "skipped", (json_int_t)publisher->skipped,
	                  "left_out", (json_int_t)publisher->left_out));
	if (outbox.dropped > publisher->dropped_told)
		db_client_log(DB_CLIENT_WARNING,
		              "the buffer is full: %llu messages more dropped, the oldest first",
		              (unsigned long long)(outbox.dropped - publisher->dropped_told));
	publisher->dropped_told = outbox.dropped;
	publisher->figures_at = publisher->now +
	                        publisher->config->figures_interval_s * DB_NS_PER_S;
}

/* --- commands --------------------------------------------------------------------------------- */

/* A text that the broker sends back: what arrives behind it was not on its way for longer than it was. */
static void send_echo(struct db_mqtt_publisher *publisher)
{
	const struct db_mqtt_config *config = publisher->config;
	db_time silence = config->keepalive_s * DB_NS_PER_S;
	char text[64];

	/* A broker that holds the connection and does nothing, or is so late, is lost for who commands over it. */
	if (publisher->now - publisher->echoed > silence && db_mqtt_acting_drop(publisher->acting))
		db_client_log(
			DB_CLIENT_WARNING,
			publisher->now - publisher->heard > silence ?
				"the broker has sent nothing for %u s: what was commanded over it is "
				"given up" :
				"what the broker sends is more than %u s late: what was commanded "
				"over it is given up",
			config->keepalive_s);
	(void)snprintf(text, sizeof(text), "%u %lld", publisher->echo_mark,
	               (long long)publisher->now);
	db_mqtt_broker_send_now(publisher->broker, topic_of(publisher, "echo").text, text);
	publisher->echo_at = publisher->now + config->age_ms * DB_NS_PER_MS / 4;
}

static void take_echo(struct db_mqtt_publisher *publisher, const char *text)
{
	unsigned mark;
	long long sent;

	if (sscanf(text, "%u %lld", &mark, &sent) == 2 && mark == publisher->echo_mark &&
	    sent > publisher->echoed && sent <= publisher->now)
		publisher->echoed = sent;
}

static void greet_broker(void *context)
{
	struct db_mqtt_publisher *publisher = context;
	const struct db_mqtt_config *config = publisher->config;

	/* How much was dropped is known with the first values that come late. */
	publish_figures(publisher);
	if (!db_mqtt_config_commands(config))
		return;
	publisher->echo_mark = (unsigned)rand();
	publisher->echoed = publisher->now - 2 * config->age_ms * DB_NS_PER_MS;
	publisher->echo_at = publisher->now;
	publisher->heard = publisher->now;
	publisher->subscribed = publisher->now;
	/* The echo and stops must not be dropped in a flood; what else comes is to be dropped rather than be late. */
	db_mqtt_broker_subscribe(publisher->broker, topic_of(publisher, "echo").text, 1);
	db_mqtt_broker_subscribe(publisher->broker, topic_of_drive(publisher, "+", "stop").text, 1);
	db_mqtt_broker_subscribe(publisher->broker, topic_of_drive(publisher, "+", "command").text,
	                         0);
	db_mqtt_broker_subscribe(publisher->broker, topic_of_drive(publisher, "+", "alive").text,
	                         0);
}

/* Who commands over it cannot stop anything any more: for the drives that is the loss of a client. */
static void miss_broker(void *context)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->echo_at = DB_TIME_NEVER;
	(void)db_mqtt_acting_drop(publisher->acting);
}

static void publish_result(void *context, const struct db_mqtt_outcome *outcome)
{
	struct db_mqtt_publisher *publisher = context;
	json_t *object;

	/* A flood of what nobody takes is to cost the others nothing. */
	if (outcome->refused && !db_mqtt_ration_take(&publisher->answers, outcome->drive,
	                                             outcome->sender, publisher->now)) {
		publisher->left_out++;
		return;
	}
	object = json_pack("{s:o, s:s, s:s, s:s}", "time", describe_moment(publisher->us), "id",
	                   outcome->id, "command", outcome->command, "result", outcome->result);
	if (object && outcome->repeated)
		(void)json_object_set_new(object, "repeated", json_true());
	if (object && outcome->why[0])
		(void)json_object_set_new(object, "reason", json_string(outcome->why));
	publish_json(publisher, topic_of_drive(publisher, outcome->drive, "result"), object,
	             outcome->refused ? DB_MQTT_LAST : DB_MQTT_PROMPT);
}

static void refuse_command(struct db_mqtt_publisher *publisher,
                           const struct db_mqtt_outcome *outcome)
{
	db_client_log_rationed(&publisher->refusals, publisher->now, DB_CLIENT_WARNING,
	                       "drive %s: a command from the broker is refused: %s", outcome->drive,
	                       outcome->why);
	publish_result(publisher, outcome);
}

static bool has_drive(const struct db_mqtt_publisher *publisher, const char *drive)
{
	for (size_t i = 0; i < publisher->picture_count; i++) {
		if (strcmp(db_mqtt_picture_name(publisher->pictures[i]), drive) == 0)
			return true;
	}
	return false;
}

/* Why it is not carried out: NULL when it is. `refusal` is then its result. */
static const char *judge_command(const struct db_mqtt_publisher *publisher,
                                 const struct db_mqtt_command *command,
                                 const struct db_mqtt_arrival *arrival, const char **refusal,
                                 char why[DB_MQTT_REASON_MAX])
{
	*refusal = db_mqtt_admission_judge(publisher->config, command, arrival, why);
	if (*refusal)
		return why;
	/* One that comes back meanwhile may have carried it out before. */
	if (!publisher->there && !db_mqtt_command_is_stop(command)) {
		*refusal = "lost";
		return "drivebridged is not there";
	}
	return NULL;
}

static void take_command(struct db_mqtt_publisher *publisher, struct db_mqtt_command *command,
                         const char *wrong, const char *drive, bool retained)
{
	const struct db_mqtt_arrival arrival = {
		.drive = drive,
		.retained = retained,
		.now = publisher->now,
		.us = publisher->us,
		.sent_behind = publisher->echoed,
		.subscribed = publisher->subscribed,
		.served = publisher->served,
	};
	const char *refusal = "bad_message";
	char why[DB_MQTT_REASON_MAX];

	if (!wrong)
		wrong = judge_command(publisher, command, &arrival, &refusal, why);
	if (!wrong)
		db_mqtt_acting_run(publisher->acting, drive, command,
		                   db_mqtt_admission_left_ms(publisher->config, command, &arrival),
		                   publisher->now);
	else
		refuse_command(publisher, &(struct db_mqtt_outcome){
						  .drive = drive,
						  .sender = command->user ? command->user : "",
						  .id = command->id,
						  .command = command->name ? command->name : "",
						  .result = refusal,
						  .why = wrong,
						  .refused = true,
					  });
	db_mqtt_command_clear(command);
}

static bool is_leaf(const struct db_mqtt_publisher *publisher, const char *topic, const char *leaf,
                    char drive[DB_MQTT_NAME_MAX])
{
	const struct db_mqtt_config *config = publisher->config;

	return db_mqtt_topic_is_of_drive(topic, config->prefix, config->gateway, leaf, drive);
}

static void take_message(void *context, const char *topic, const char *text, size_t length,
                         bool retained)
{
	struct db_mqtt_publisher *publisher = context;
	bool fresh = publisher->now - publisher->echoed <= publisher->config->age_ms * DB_NS_PER_MS;
	struct db_mqtt_command command;
	char drive[DB_MQTT_NAME_MAX];
	const char *wrong;

	publisher->heard = publisher->now;
	if (strcmp(topic, topic_of(publisher, "echo").text) == 0) {
		take_echo(publisher, text);
	} else if (is_leaf(publisher, topic, "command", drive) && has_drive(publisher, drive)) {
		wrong = db_mqtt_command_parse(text, length, &command);
		take_command(publisher, &command, wrong, drive, retained);
	} else if (is_leaf(publisher, topic, "stop", drive) && has_drive(publisher, drive)) {
		wrong = db_mqtt_command_parse_stop(text, length, &command);
		take_command(publisher, &command, wrong, drive, retained);
	} else if (is_leaf(publisher, topic, "alive", drive) && fresh && !retained) {
		db_mqtt_acting_feed(publisher->acting, drive, publisher->now);
	}
}

/* --- its life --------------------------------------------------------------------------------- */

struct db_mqtt_publisher *db_mqtt_publisher_new(const struct db_mqtt_config *config)
{
	static const struct db_mqtt_plant_ops plant_ops = {
		.found = greet_plant,
		.lost = miss_plant,
		.sample = take_sample,
		.skipped = take_skipped,
		.event = take_event,
		.figures = take_figures,
	};
	static const struct db_mqtt_broker_ops broker_ops = {
		.connected = greet_broker,
		.lost = miss_broker,
		.message = take_message,
	};
	struct db_mqtt_publisher *publisher = calloc(1, sizeof(*publisher));

	if (!publisher)
		return NULL;
	publisher->config = config;
	publisher->status = topic_of(publisher, "status");
	publisher->outbox = db_mqtt_outbox_new(config->buffer_messages,
	                                       (size_t)config->buffer_kib * BYTES_PER_KIB);
	if (publisher->outbox)
		publisher->broker = db_mqtt_broker_new(config, publisher->status.text,
		                                       publisher->outbox, &broker_ops, publisher);
	publisher->plant = db_mqtt_plant_new(config, &plant_ops, publisher);
	publisher->acting = db_mqtt_acting_new(config->socket, publish_result, publisher);
	publisher->echo_at = DB_TIME_NEVER;
	if (!publisher->outbox || !publisher->broker || !publisher->plant || !publisher->acting) {
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
	db_mqtt_acting_free(publisher->acting);
	db_mqtt_plant_free(publisher->plant);
	db_mqtt_broker_free(publisher->broker);
	db_mqtt_outbox_free(publisher->outbox);
	forget_pictures(publisher);
	free(publisher);
}

void db_mqtt_publisher_watch(const struct db_mqtt_publisher *publisher,
                             struct pollfd fds[DB_MQTT_PUBLISHER_FDS])
{
	fds[0] = db_mqtt_broker_watch(publisher->broker);
	db_mqtt_plant_watch(publisher->plant, fds + 1);
	db_mqtt_acting_watch(publisher->acting, fds + 1 + DB_MQTT_PLANT_FDS);
}

db_time db_mqtt_publisher_due(const struct db_mqtt_publisher *publisher)
{
	db_time due = db_mqtt_broker_due(publisher->broker);

	if (db_mqtt_plant_due(publisher->plant) < due)
		due = db_mqtt_plant_due(publisher->plant);
	if (publisher->echo_at < due)
		due = publisher->echo_at;
	return publisher->figures_at < due ? publisher->figures_at : due;
}

void db_mqtt_publisher_handle(struct db_mqtt_publisher *publisher,
                              const struct pollfd fds[DB_MQTT_PUBLISHER_FDS], db_time now,
                              int64_t us)
{
	publisher->now = now;
	publisher->us = us;
	db_mqtt_plant_handle(publisher->plant, now, us);
	db_mqtt_acting_handle(publisher->acting);
	if (now >= publisher->figures_at)
		publish_figures(publisher);
	if (now >= publisher->echo_at)
		send_echo(publisher);
	db_mqtt_broker_handle(publisher->broker, fds[0].revents, now);
}
