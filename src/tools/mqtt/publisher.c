/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/publisher.h"

#include "client/clock.h"
#include "client/log.h"
#include "client/plant.h"
#include "client/program.h"
#include "mqtt/acting.h"
#include "mqtt/admission.h"
#include "mqtt/broker.h"
#include "mqtt/choice.h"
#include "mqtt/form.h"
#include "mqtt/past.h"
#include "mqtt/ration.h"
#include "mqtt/senders.h"
#include "mqtt/topics.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct db_mqtt_form_ops *const forms[] = {
	[DB_MQTT_PAYLOAD_JSON] = &db_mqtt_plain,
	[DB_MQTT_PAYLOAD_SPARKPLUG] = &db_mqtt_node,
};

struct db_mqtt_publisher {
	sd_event *loop;
	const struct db_mqtt_config *config;
	const struct db_mqtt_form_ops *ops;
	void *form;
	struct db_mqtt_broker *broker;
	struct db_waker broker_waker;
	struct db_plant *plant;
	struct db_mqtt_acting *acting;
	struct db_mqtt_senders *senders;
	struct db_mqtt_topic echo;
	db_time figures_at;
	db_time echo_at;    /* DB_TIME_NEVER without a connection, or without commands */
	db_time echoed;     /* when the latest returned echo was sent */
	unsigned echo_mark; /* of the connection */
	db_time heard;      /* when the broker's latest message arrived */
	db_time subscribed; /* since when this program is subscribed */
	db_time served;     /* since when the service has been the same run */
	int64_t service;    /* when that run began, by its own clock */
	/* The latest time of the commands that were passed on, by their senders' clocks, and before
	 * that run. */
	int64_t newest;
	int64_t newest_before;
	struct db_mqtt_past past; /* and those without a time */
	struct db_mqtt_ration answers;
	uint64_t left_out; /* refusals that were not answered */
	bool warned;       /* of the service, which lets this program command nothing */
	struct db_client_log_ration refusals;
	uint64_t skipped;      /* samples that the service left out */
	uint64_t dropped_told; /* messages, when it was last logged */
};

/* --- the plant -------------------------------------------------------------------------------- */

static void on_sample(void *context, const json_t *sample, int64_t us)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->ops->sample(publisher->form, sample, us);
}

static void on_skipped(void *context, int64_t count)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->skipped += (uint64_t)count;
}

/* Removes the drives that are not to be published. */
static void choose_drives(void *context, json_t *description)
{
	const struct db_mqtt_publisher *publisher = context;
	const struct db_setting_list *chosen = &publisher->config->drives;
	json_t *drives = json_object_get(description, "drives");

	if (chosen->word != DB_SETTING_NAMED)
		return;
	for (size_t i = json_array_size(drives); i-- > 0;) {
		if (!db_setting_list_has(chosen, db_words_text(json_array_get(drives, i), "name")))
			(void)json_array_remove(drives, i);
	}
}

static json_t *keep(void *context, const char *drive, json_t *received, bool commands)
{
	const struct db_mqtt_publisher *publisher = context;

	(void)drive;
	return publisher->ops->keep(publisher->config, received, commands);
}

static void on_found(void *context, json_t *description, const struct db_plant_drive *drives,
                     size_t count)
{
	struct db_mqtt_publisher *publisher = context;
	const char *version = json_string_value(json_object_get(description, "version"));
	int64_t service = json_integer_value(json_object_get(description, "started_us"));
	json_t *values, *names;

	/* Another run of the service does not remember earlier ids. */
	if (service != publisher->service) {
		publisher->served = db_client_now();
		publisher->newest_before = publisher->newest;
		db_mqtt_past_end_run(&publisher->past);
	}
	publisher->service = service;
	/* Services of before have no audit trail. */
	db_mqtt_acting_set_audit(publisher->acting, json_object_get(description, "audit_trouble"));
	publisher->ops->found(publisher->form, description, drives, count,
	                      db_plant_stops(publisher->plant));
	if (db_mqtt_config_commands(publisher->config) && !publisher->warned &&
	    !json_is_true(json_object_get(description, "may_act"))) {
		db_client_log(
			DB_CLIENT_WARNING,
			"commands are on, but the service lets this program only read: its user "
			"must belong to the service's act-group (see drivebridge-mqtt(8))");
		publisher->warned = true;
	}
	db_client_log(DB_CLIENT_NOTICE, "connected to drivebridged %s; drives: %zu",
	              version ? version : "", count);
	values = db_mqtt_collect_names(publisher->config, drives, count);
	names = json_array();
	for (size_t i = 0; i < count; i++)
		(void)json_array_append(names, json_object_get(drives[i].description, "name"));
	/* Without names the stream would be of all drives. */
	if (count > 0)
		db_plant_subscribe(publisher->plant, names, values, publisher->config->interval_ms,
		                   false);
	json_decref(names);
	json_decref(values);
}

static void on_troubles(void *context, const struct db_client_troubles *troubles,
                        const json_t *news)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->ops->troubles(publisher->form, troubles, news);
}

static void on_lost(void *context)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->ops->lost(publisher->form);
}

static void on_event(void *context, json_t *event)
{
	struct db_mqtt_publisher *publisher = context;

	if (publisher->ops->event)
		publisher->ops->event(publisher->form, event);
}

static void on_bus_figures(void *context, json_t *buses)
{
	struct db_mqtt_publisher *publisher = context;

	if (publisher->ops->bus_figures)
		publisher->ops->bus_figures(publisher->form, buses);
}

static void publish_figures(struct db_mqtt_publisher *publisher)
{
	const struct db_mqtt_figures figures = {
		.broker = db_mqtt_broker_read_stats(publisher->broker),
		.skipped = publisher->skipped,
		.left_out = publisher->left_out,
	};
	uint64_t dropped = publisher->ops->figures(publisher->form, &figures);

	if (dropped > publisher->dropped_told)
		db_client_log(DB_CLIENT_WARNING,
		              "the buffer is full: %llu messages more dropped, the oldest first",
		              (unsigned long long)(dropped - publisher->dropped_told));
	publisher->dropped_told = dropped;
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
				"the broker has sent nothing for %u s: what was commanded over it "
				"is given up" :
				"what the broker sends is more than %u s late: what was commanded "
				"over it is given up",
			config->keepalive_s);
	snprintf(text, sizeof(text), "%u %lld", publisher->echo_mark, (long long)db_client_now());
	db_mqtt_broker_send_now(publisher->broker, publisher->echo.text, text);
	publisher->echo_at = db_client_now() + config->age_ms * DB_NS_PER_MS / 4;
}

static void on_broker_connected(void *context)
{
	struct db_mqtt_publisher *publisher = context;
	const struct db_mqtt_config *config = publisher->config;

	/* The number of dropped samples is published before the first late values. */
	publish_figures(publisher);
	publisher->ops->connected(publisher->form, publisher->broker);
	if (!db_mqtt_config_commands(config))
		return;
	publisher->echo_mark = (unsigned)rand();
	publisher->echoed = db_client_now() - 2 * config->age_ms * DB_NS_PER_MS;
	publisher->echo_at = db_client_now();
	publisher->heard = db_client_now();
	publisher->subscribed = db_client_now();
	/* A dropped echo would look like a lost broker. */
	db_mqtt_broker_subscribe(publisher->broker, publisher->echo.text, 1, false);
}

/* Senders of commands cannot stop a drive any more: the drives lose their client. */
static void on_broker_lost(void *context)
{
	struct db_mqtt_publisher *publisher = context;

	publisher->echo_at = DB_TIME_NEVER;
	if (publisher->ops->disconnected)
		publisher->ops->disconnected(publisher->form);
	(void)db_mqtt_acting_drop(publisher->acting);
}

static void publish_result(void *context, const struct db_mqtt_outcome *outcome)
{
	struct db_mqtt_publisher *publisher = context;

	/* A flood of refused commands must not delay other results. */
	if (outcome->refused && !db_mqtt_ration_take(&publisher->answers, outcome->drive,
	                                             outcome->sender, db_client_now())) {
		publisher->left_out++;
		return;
	}
	publisher->ops->result(publisher->form, outcome);
}

static void handle_command(struct db_mqtt_publisher *publisher,
                           const struct db_mqtt_received *received, bool retained)
{
	const struct db_mqtt_command *command = &received->command;
	const char *drive = received->drive;
	const char *wrong = received->wrong;
	const struct db_grant grant = db_mqtt_senders_grant(publisher->senders, received->sender);
	uint64_t key = db_mqtt_past_key(drive, command->user ? command->user : received->sender,
	                                command->id);
	db_time now = db_client_now();
	const struct db_mqtt_arrival arrival = {
		.drive = drive,
		.grant = &grant,
		.retained = retained,
		.now = now,
		.us = db_client_wall_us(),
		.sent_behind = publisher->echoed,
		.subscribed = publisher->subscribed,
		.served = publisher->served,
		.newest_before = publisher->newest_before,
		.had = !command->timed && db_mqtt_past_had(&publisher->past, key, now),
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
		return;
	}
	if (command->timed && !command->stops && command->us > publisher->newest)
		publisher->newest = command->us;
	if (!command->timed && !command->stops)
		db_mqtt_past_note(&publisher->past, key, now);
	db_mqtt_acting_run(publisher->acting, drive, command,
	                   db_mqtt_admission_left_ms(publisher->config, command, &arrival),
	                   arrival.now);
}

static void on_message(void *context, const char *topic, const char *text, size_t length,
                       bool retained)
{
	struct db_mqtt_publisher *publisher = context;
	const struct db_mqtt_config *config = publisher->config;
	db_time now = db_client_now();
	bool current = now - publisher->echoed <= config->age_ms * DB_NS_PER_MS;
	bool named = config->senders == DB_MQTT_SENDERS_TOPIC;
	struct db_mqtt_received received = { .wrong = NULL };
	struct db_grant grant;
	unsigned mark;
	long long sent;

	publisher->heard = now;
	if (strcmp(topic, publisher->echo.text) == 0) {
		if (sscanf(text, "%u %lld", &mark, &sent) == 2 && mark == publisher->echo_mark &&
		    sent > publisher->echoed && sent <= now)
			publisher->echoed = sent;
		return;
	}
	switch (publisher->ops->take(publisher->form, topic, text, length,
	                             db_plant_stops(publisher->plant), &received)) {
	case DB_MQTT_COMMAND:
		handle_command(publisher, &received, retained);
		break;
	case DB_MQTT_ALIVE:
		if (!current || retained)
			break;
		/* Only he who has commanded the drive keeps it going, and as long as he may. */
		grant = db_mqtt_senders_grant(publisher->senders, received.sender);
		if (!named ||
		    (received.sender[0] && db_grant_has(&grant, DB_MAY_MOVE, received.drive)))
			db_mqtt_acting_feed(publisher->acting, received.drive,
			                    named ? received.sender : NULL, db_client_now());
		break;
	case DB_MQTT_NOTHING:
		break;
	}
	db_mqtt_command_clear(&received.command);
}

/* --- its life --------------------------------------------------------------------------------- */

struct db_mqtt_publisher *db_mqtt_publisher_new(sd_event *loop, const struct db_mqtt_config *config)
{
	static const struct db_plant_ops plant_ops = {
		.choose = choose_drives,
		.keep = keep,
		.found = on_found,
		.lost = on_lost,
		.sample = on_sample,
		.skipped = on_skipped,
		.event = on_event,
		.figures = on_bus_figures,
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
	publisher->ops = forms[config->payload];
	publisher->form = publisher->ops->open(config);
	if (publisher->form)
		publisher->broker = db_mqtt_broker_new(config, &publisher->ops->source,
		                                       publisher->form, &broker_ops, publisher);
	publisher->plant = db_plant_new(loop, &wishes, &plant_ops, publisher);
	publisher->acting = db_mqtt_acting_new(loop, config->socket, publish_result, publisher);
	publisher->senders = db_mqtt_senders_new(config);
	publisher->echo = db_mqtt_topic_of_gateway(config, "echo");
	publisher->echo_at = DB_TIME_NEVER;
	if (publisher->form && publisher->broker && publisher->plant && publisher->acting &&
	    publisher->senders)
		return publisher;
	db_mqtt_publisher_free(publisher);
	return NULL;
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
	publisher->ops->close(publisher->form);
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

	due = db_plant_tend(publisher->plant, now);
	if (now >= publisher->figures_at)
		publish_figures(publisher);
	if (now >= publisher->echo_at && publisher->ops->is_open(publisher->form))
		send_echo(publisher);
	db_mqtt_broker_handle(publisher->broker, happened, now, us);
	if (publisher->ops->turn)
		due = db_time_min(due,
		                  publisher->ops->turn(publisher->form, publisher->broker, now));
	watched = db_mqtt_broker_watch(publisher->broker, &due);
	db_waker_arm(&publisher->broker_waker, publisher->loop, watched.fd,
	             (uint32_t)watched.events);
	if (publisher->ops->is_open(publisher->form))
		due = db_time_min(due, publisher->echo_at);
	return db_time_min(due, publisher->figures_at);
}
