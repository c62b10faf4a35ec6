/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/form.h"

#include "client/clock.h"
#include "drivebridge/version.h"
#include "mqtt/choice.h"
#include "mqtt/discovery.h"
#include "mqtt/moment.h"
#include "mqtt/outbox.h"
#include "mqtt/picture.h"
#include "mqtt/trouble.h"
#include "users/users.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>

#define BYTES_PER_KIB 1024

struct plain {
	const struct db_mqtt_config *config;
	struct db_mqtt_topic status;
	struct db_mqtt_outbox *outbox;
	struct db_mqtt_picture **pictures;
	size_t picture_count;
	json_t *buses; /* those with retained messages: as in Describe */
};

static void publish(struct plain *plain, struct db_mqtt_topic topic, char *text, bool retained)
{
	if (text && retained)
		db_mqtt_outbox_set_retained(plain->outbox, topic.text, text);
	else if (text)
		db_mqtt_outbox_add_sample(plain->outbox, DB_MQTT_USUAL, topic.text, text);
	free(text);
}

/* Takes the object over. */
static void publish_json(struct plain *plain, struct db_mqtt_topic topic, json_t *object,
                         enum db_mqtt_lane lane)
{
	char *text = object ? db_mqtt_picture_dump(object) : NULL;

	if (text)
		db_mqtt_outbox_add_sample(plain->outbox, lane, topic.text, text);
	free(text);
	json_decref(object);
}

/* The same, retained by the broker. */
static void publish_retained(struct plain *plain, struct db_mqtt_topic topic, json_t *object)
{
	publish(plain, topic, object ? db_mqtt_picture_dump(object) : NULL, true);
	json_decref(object);
}

static struct db_mqtt_topic topic_of(const struct plain *plain, const char *leaf)
{
	return db_mqtt_topic_of_gateway(plain->config, leaf);
}

static struct db_mqtt_topic topic_of_part(const struct plain *plain, const char *kind,
                                          const char *name, const char *leaf)
{
	return db_mqtt_topic_of_part(plain->config, kind, name, leaf);
}

/* --- drives ----------------------------------------------------------------------------------- */

static struct db_mqtt_picture *find_picture(const struct plain *plain, const char *drive)
{
	for (size_t i = 0; i < plain->picture_count; i++) {
		if (strcmp(db_mqtt_picture_name(plain->pictures[i]), drive) == 0)
			return plain->pictures[i];
	}
	return NULL;
}

static void on_sample(void *form, const json_t *sample, int64_t us)
{
	struct plain *plain = form;
	const struct db_mqtt_config *config = plain->config;
	const char *drive = db_words_text(sample, "drive");
	struct db_mqtt_picture *picture = find_picture(plain, drive);

	if (!picture)
		return;
	publish(plain, topic_of_part(plain, "drive", drive, "changes"),
	        db_mqtt_picture_take(picture, json_object_get(sample, "values"), us), false);
	if (db_mqtt_picture_state_is_due(picture, config->state_interval_ms * DB_NS_PER_MS,
	                                 config->refresh_s * DB_NS_PER_S, db_client_now()))
		publish(plain, topic_of_part(plain, "drive", drive, "state"),
		        db_mqtt_picture_write(picture, picture->values), true);
}

static void publish_document(void *form, const char *topic, const char *text)
{
	const struct plain *plain = form;

	db_mqtt_outbox_set_retained(plain->outbox, topic, text);
}

static void forget_pictures(struct plain *plain)
{
	for (size_t i = 0; i < plain->picture_count; i++)
		db_mqtt_picture_free(plain->pictures[i]);
	free(plain->pictures);
	plain->pictures = NULL;
	plain->picture_count = 0;
}

/* Removes the retained messages of drives and buses that no longer exist. */
static void withdraw_missing(struct plain *plain, const json_t *description, const json_t *stops)
{
	static const char *const of_drive[] = { "about", "state", "trouble" };
	static const char *const of_bus[] = { "figures", "trouble" };
	const json_t *drives = json_object_get(description, "drives");
	json_t *buses = json_object_get(description, "buses");
	size_t b;
	const json_t *bus;

	for (size_t i = 0; i < plain->picture_count; i++) {
		const char *name = db_mqtt_picture_name(plain->pictures[i]);

		if (db_words_look_up(drives, name))
			continue;
		if (plain->config->discovery)
			db_mqtt_discovery_announce(plain->config, plain->pictures[i], stops, true,
			                           publish_document, plain);
		for (size_t l = 0; l < sizeof(of_drive) / sizeof(of_drive[0]); l++)
			db_mqtt_outbox_set_retained(
				plain->outbox,
				topic_of_part(plain, "drive", name, of_drive[l]).text, "");
	}
	json_array_foreach(plain->buses, b, bus)
	{
		const char *name = db_words_text(bus, "name");

		for (size_t l = 0; !db_words_look_up(buses, name) && l < 2; l++)
			db_mqtt_outbox_set_retained(
				plain->outbox, topic_of_part(plain, "bus", name, of_bus[l]).text,
				"");
	}
	json_decref(plain->buses);
	plain->buses = json_incref(buses);
}

static json_t *keep(const struct db_mqtt_config *config, json_t *received, bool commands)
{
	return commands ? json_null() : db_mqtt_choose_registers(config, received);
}

static void on_found(void *form, const json_t *description, const struct db_plant_drive *drives,
                     size_t count, const json_t *stops)
{
	struct plain *plain = form;

	withdraw_missing(plain, description, stops);
	forget_pictures(plain);
	plain->pictures = calloc(count + 1, sizeof(struct db_mqtt_picture *));
	for (size_t i = 0; plain->pictures && i < count; i++) {
		struct db_mqtt_picture *picture = db_mqtt_picture_new(drives[i].description,
		                                                      drives[i].registers);

		if (!picture)
			continue;
		plain->pictures[plain->picture_count++] = picture;
		publish(plain,
		        topic_of_part(plain, "drive", db_mqtt_picture_name(picture), "about"),
		        db_mqtt_picture_write_about(picture), true);
		if (plain->config->discovery)
			db_mqtt_discovery_announce(plain->config, picture, stops, false,
			                           publish_document, plain);
	}
	db_mqtt_outbox_set_retained(plain->outbox, plain->status.text, "online");
}

static void on_troubles(void *form, const struct db_client_troubles *troubles, const json_t *news)
{
	struct plain *plain = form;
	size_t i;
	const json_t *record;

	json_array_foreach(json_object_get(news, "drives"), i, record)
	{
		const char *drive = db_words_text(record, "drive");

		if (find_picture(plain, drive))
			publish_retained(plain, topic_of_part(plain, "drive", drive, "trouble"),
			                 db_mqtt_trouble_write(record));
	}
	json_array_foreach(json_object_get(news, "buses"), i, record) publish_retained(
		plain, topic_of_part(plain, "bus", db_words_text(record, "bus"), "trouble"),
		db_mqtt_trouble_write(record));
	publish_retained(plain, topic_of(plain, "trouble"),
	                 json_pack("{s:b, s:o}", "well", troubles->well, "configuration",
	                           db_mqtt_trouble_write(troubles->configuration)));
}

/* Old values must not pass for current ones. */
static void on_lost(void *form)
{
	struct plain *plain = form;
	size_t i;
	const json_t *bus;

	db_mqtt_outbox_set_retained(plain->outbox, plain->status.text, "no-service");
	for (i = 0; i < plain->picture_count; i++) {
		struct db_mqtt_picture *picture = plain->pictures[i];
		const char *drive = db_mqtt_picture_name(picture);

		publish(plain, topic_of_part(plain, "drive", drive, "changes"),
		        db_mqtt_picture_take(picture, NULL, db_client_wall_us()), false);
		publish(plain, topic_of_part(plain, "drive", drive, "state"),
		        db_mqtt_picture_write(picture, picture->values), true);
		publish_retained(plain, topic_of_part(plain, "drive", drive, "trouble"),
		                 db_mqtt_trouble_write(NULL));
	}
	json_array_foreach(plain->buses, i, bus) publish_retained(
		plain, topic_of_part(plain, "bus", db_words_text(bus, "name"), "trouble"),
		db_mqtt_trouble_write(NULL));
	publish_retained(
		plain, topic_of(plain, "trouble"),
		json_pack("{s:n, s:o}", "well", "configuration", db_mqtt_trouble_write(NULL)));
}

/* --- the rest --------------------------------------------------------------------------------- */

static void on_event(void *form, json_t *event)
{
	struct plain *plain = form;

	publish_json(plain, topic_of(plain, "event"), db_mqtt_trouble_write_event(event),
	             DB_MQTT_PROMPT);
}

static void on_bus_figures(void *form, json_t *buses)
{
	struct plain *plain = form;
	const char *bus;
	json_t *figures;

	json_object_foreach(buses, bus, figures) publish_retained(
		plain, topic_of_part(plain, "bus", bus, "figures"),
		json_pack("{s:o, s:O}", "time", db_mqtt_moment_describe(db_client_wall_us()),
	                  "values", figures));
}

static uint64_t on_figures(void *form, const struct db_mqtt_figures *figures)
{
	struct plain *plain = form;
	const struct db_mqtt_broker_stats *broker = &figures->broker;
	struct db_mqtt_outbox_stats outbox = db_mqtt_outbox_read_stats(plain->outbox);

	publish_retained(
		plain, topic_of(plain, "figures"),
		json_pack(
			"{s:o, s:s, s:{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:o*}}", "time",
			db_mqtt_moment_describe(db_client_wall_us()), "version", DB_VERSION,
			"values", "connections", (json_int_t)broker->connections, "sent",
			(json_int_t)broker->sent, "bytes", (json_int_t)broker->bytes, "refused",
			(json_int_t)broker->refused, "dropped", (json_int_t)outbox.dropped,
			"buffered", (json_int_t)outbox.messages, "buffered_bytes",
			(json_int_t)outbox.bytes, "skipped", (json_int_t)figures->skipped,
			"left_out", (json_int_t)figures->left_out, "certificate_ends_s",
			broker->certificate_ends ? json_integer(broker->certificate_ends) : NULL));
	return outbox.dropped;
}

/* --- commands --------------------------------------------------------------------------------- */

static void on_result(void *form, const struct db_mqtt_outcome *outcome)
{
	struct plain *plain = form;
	json_t *object = json_pack("{s:o, s:s, s:s, s:s}", "time",
	                           db_mqtt_moment_describe(db_client_wall_us()), "id", outcome->id,
	                           "command", outcome->command, "result", outcome->result);

	if (object && outcome->repeated)
		(void)json_object_set_new(object, "repeated", json_true());
	if (object && outcome->why[0])
		(void)json_object_set_new(object, "reason", json_string(outcome->why));
	publish_json(plain, topic_of_part(plain, "drive", outcome->drive, "result"), object,
	             outcome->refused ? DB_MQTT_LAST : DB_MQTT_PROMPT);
}

static void subscribe(const struct plain *plain, struct db_mqtt_broker *broker, const char *leaf,
                      int qos)
{
	db_mqtt_broker_subscribe(broker, topic_of_part(plain, "drive", "+", leaf).text, qos, false);
}

static void on_connected(void *form, struct db_mqtt_broker *broker)
{
	struct plain *plain = form;

	db_mqtt_outbox_start_over(plain->outbox);
	if (!db_mqtt_config_commands(plain->config))
		return;
	/* Stops must not be dropped in a flood; other commands are better dropped than late. */
	subscribe(plain, broker, "stop", 1);
	subscribe(plain, broker, "command", 0);
	if (plain->config->senders == DB_MQTT_SENDERS_OFF) {
		subscribe(plain, broker, "alive", 0);
		return;
	}
	/* Topics without a name are received, too: their senders may only stop, and are told so. */
	subscribe(plain, broker, "stop/+", 1);
	subscribe(plain, broker, "command/+", 0);
	subscribe(plain, broker, "alive/+", 0);
}

static bool is_open(const void *form)
{
	(void)form;
	return true;
}

static bool is_leaf(const struct plain *plain, const char *topic, const char *leaf,
                    struct db_mqtt_received *received)
{
	const struct db_mqtt_config *config = plain->config;

	return db_mqtt_topic_is_of_drive(topic, config, leaf, received->drive, received->sender) &&
	       (received->sender[0] == '\0' || config->senders == DB_MQTT_SENDERS_TOPIC);
}

static enum db_mqtt_kind take(void *form, const char *topic, const void *bytes, size_t length,
                              const json_t *stops, struct db_mqtt_received *received)
{
	struct plain *plain = form;
	struct db_mqtt_command *command = &received->command;

	if (is_leaf(plain, topic, "alive", received))
		return DB_MQTT_ALIVE;
	if (is_leaf(plain, topic, "command", received) && find_picture(plain, received->drive))
		received->wrong = db_mqtt_command_parse(bytes, length, stops, &received->command);
	else if (is_leaf(plain, topic, "stop", received) && find_picture(plain, received->drive))
		received->wrong = db_mqtt_command_parse_stop(bytes, length, stops,
		                                             &received->command);
	else
		return DB_MQTT_NOTHING;
	if (plain->config->senders == DB_MQTT_SENDERS_OFF)
		return DB_MQTT_COMMAND;
	/* The name in the topic is the sender's, whatever the message says. A name that no user can
	 * have could look like something else in the audit trail. */
	if (!received->wrong && !command->stops && command->user[0] &&
	    strcmp(command->user, received->sender) != 0)
		received->wrong = "it names another user than its topic";
	command->user = db_users_name_is_good(received->sender) ? received->sender : "";
	return DB_MQTT_COMMAND;
}

/* --- what is sent ----------------------------------------------------------------------------- */

static bool write_will(void *form, struct db_mqtt_message *message)
{
	const struct plain *plain = form;

	*message = (struct db_mqtt_message){ .topic = plain->status.text,
		                             .payload = "offline",
		                             .length = strlen("offline"),
		                             .retained = true,
		                             .qos = plain->config->qos ? 1 : 0 };
	return true;
}

static bool find_next(void *form, db_time now, struct db_mqtt_message *message)
{
	struct plain *plain = form;

	(void)now;
	if (!db_mqtt_outbox_next(plain->outbox, message))
		return false;
	message->qos = plain->config->qos ? 1 : 0;
	return true;
}

static void on_sent(void *form, int number, bool refused, db_time now)
{
	struct plain *plain = form;

	(void)refused;
	(void)now;
	db_mqtt_outbox_sent(plain->outbox, number);
}

static void on_confirmed(void *form, int number)
{
	struct plain *plain = form;

	db_mqtt_outbox_confirm(plain->outbox, number);
}

/* --- its life --------------------------------------------------------------------------------- */

static void close_plain(void *form)
{
	struct plain *plain = form;

	if (!plain)
		return;
	db_mqtt_outbox_free(plain->outbox);
	forget_pictures(plain);
	json_decref(plain->buses);
	free(plain);
}

static void *open_plain(const struct db_mqtt_config *config)
{
	struct plain *plain = calloc(1, sizeof(*plain));

	if (!plain)
		return NULL;
	plain->config = config;
	plain->status = topic_of(plain, "status");
	plain->outbox = db_mqtt_outbox_new(config->buffer_messages,
	                                   (size_t)config->buffer_kib * BYTES_PER_KIB);
	if (!plain->outbox) {
		free(plain);
		return NULL;
	}
	db_mqtt_outbox_set_retained(plain->outbox, plain->status.text, "no-service");
	return plain;
}

const struct db_mqtt_form_ops db_mqtt_plain = {
	.open = open_plain,
	.close = close_plain,
	.source = { .will = write_will,
	            .next = find_next,
	            .sent = on_sent,
	            .confirmed = on_confirmed },
	.keep = keep,
	.found = on_found,
	.lost = on_lost,
	.sample = on_sample,
	.event = on_event,
	.bus_figures = on_bus_figures,
	.troubles = on_troubles,
	.figures = on_figures,
	.result = on_result,
	.connected = on_connected,
	.is_open = is_open,
	.take = take,
};
