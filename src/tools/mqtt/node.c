/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/form.h"

#include "client/clock.h"
#include "client/log.h"
#include "drivebridge/version.h"
#include "mqtt/device.h"
#include "mqtt/host.h"
#include "mqtt/order.h"
#include "mqtt/points.h"
#include "mqtt/store.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>

#define BYTES_PER_KIB 1024
#define NAMESPACE "spBv1.0"
#define REBIRTH "Node Control/Rebirth"

#define SEQ_COUNT 256

/* Births that are asked for come at most once in this time. */
#define BIRTH_INTERVAL (1 * DB_NS_PER_S)

/* The service is on the same machine. */
#define PLANT_PATIENCE (1 * DB_NS_PER_S)

/* Historical messages are sent in portions, one in each of these times. */
#define HISTORY_INTERVAL (200 * DB_NS_PER_MS)
#define HISTORY_PORTIONS 5 /* a second */

struct device {
	char name[DB_MQTT_NAME_MAX];
	char family[DB_MQTT_NAME_MAX];
	struct db_mqtt_points *points;
	bool alive; /* the drive answers */
	bool born;  /* its DBIRTH was published in this session, and no DDEATH */
	bool unfit; /* its DBIRTH is too long for the broker: nothing of it is published */
};

/* What db_mqtt_source_ops.next() has given out. */
enum what {
	NOTHING,
	NODE_BIRTH,
	DEVICE_BIRTH,
	DEVICE_DATA,
	DEVICE_DEATH,
	NODE_DATA,
	HISTORY,
};

struct prepared {
	enum what what;
	struct device *device; /* of a birth or a death */
	struct db_mqtt_topic topic;
	uint8_t *bytes;
	size_t length;
};

struct node {
	const struct db_mqtt_config *config;
	struct db_mqtt_aliases aliases;
	struct db_mqtt_points *points; /* of the node */
	struct device *devices;
	size_t count;
	struct db_mqtt_store *store;
	struct db_mqtt_host host;
	bool connected;
	bool leaving;     /* this session is to end, with a farewell */
	unsigned bd_seq;  /* of this session, or of the next one */
	bool bd_seq_used; /* there was a session with it */
	unsigned seq;     /* of the next message */
	bool unfit;       /* NBIRTH is too long for this broker: nothing is published */
	bool knows_plant; /* the service has said which drives there are */
	db_time connected_at;
	bool wants_birth;     /* NBIRTH and all DBIRTHs are to be published */
	bool born;            /* NBIRTH was published in this session */
	db_time born_at;      /* when, the last time */
	db_time history_from; /* begin of the interval that history_left belongs to */
	unsigned history_left;
	struct prepared prepared;
	struct db_mqtt_topic death; /* NDEATH */
	uint8_t *last_words;        /* the payload of the will or the farewell */
};

static struct db_mqtt_topic topic_of(const struct node *node, const char *type, const char *device)
{
	struct db_mqtt_topic topic;

	snprintf(topic.text, sizeof(topic.text), NAMESPACE "/%s/%s/%s%s%s", node->config->group,
	         type, node->config->gateway, device[0] ? "/" : "", device);
	return topic;
}

static struct device *find_device(const struct node *node, const char *name)
{
	for (size_t i = 0; i < node->count; i++) {
		if (strcmp(node->devices[i].name, name) == 0)
			return &node->devices[i];
	}
	return NULL;
}

/* --- the node's own metrics ------------------------------------------------------------------- */

/* Hosts ask for births by the name of that metric, before they know aliases: it has none. */
static bool add_own(struct db_mqtt_points *points, const char *name, enum db_mqtt_type type,
                    const char *text)
{
	return db_mqtt_points_add(points,
	                          &(struct db_mqtt_point){
					  .kind = DB_MQTT_VALUE,
					  .name = name,
					  .named = strcmp(name, REBIRTH) == 0,
					  .type = type,
					  .properties = json_pack("{s:s}", "documentation", text),
				  });
}

static void set_own(const struct node *node, const char *name, json_t *value)
{
	db_mqtt_points_set(node->points, name, value, db_client_wall_us());
}

static bool add_points(const struct node *node)
{
	struct db_mqtt_points *points = node->points;
	bool added =
		add_own(points, "bdSeq", DB_MQTT_INT64, "Number of the session") &&
		add_own(points, REBIRTH, DB_MQTT_BOOLEAN, "True: all births are published again") &&
		add_own(points, "software", DB_MQTT_STRING, "Version of this gateway's software") &&
		add_own(points, "service", DB_MQTT_STRING,
	                "online, or no-service: drivebridged does not answer") &&
		add_own(points, "well", DB_MQTT_BOOLEAN,
	                "Nothing is wrong that somebody must see") &&
		add_own(points, "buffered", DB_MQTT_UINT64, "Messages that wait to be sent") &&
		add_own(points, "dropped", DB_MQTT_UINT64,
	                "Messages that were dropped because too many waited");

	if (added && db_mqtt_config_commands(node->config))
		added = db_mqtt_device_add_common(points, DB_MQTT_RESULT) &&
		        add_own(points, "command age ms", DB_MQTT_UINT32,
		                "So far the clock of who commands may be from this gateway's, with "
		                "the time on the way: an older command is refused, but for "
		                "stops") &&
		        add_own(points, "result/drive", DB_MQTT_STRING,
		                "The drive of a result, where that has no metrics now");
	set_own(node, REBIRTH, json_false());
	set_own(node, "software", json_string(DB_VERSION));
	set_own(node, "service", json_string("no-service"));
	set_own(node, "buffered", json_integer(0));
	set_own(node, "dropped", json_integer(0));
	set_own(node, "command age ms", json_integer(node->config->age_ms));
	return added;
}

/* --- the plant -------------------------------------------------------------------------------- */

static void clear_devices(struct device *devices, size_t count)
{
	for (size_t i = 0; i < count; i++)
		db_mqtt_points_free(devices[i].points);
	free(devices);
}

static void on_found(void *form, const json_t *description, const struct db_plant_drive *drives,
                     size_t count, const json_t *stops)
{
	struct node *node = form;
	const json_t *buses = json_object_get(description, "buses");
	struct device *former = node->devices;
	size_t former_count = node->count;

	node->devices = calloc(count + 1, sizeof(*node->devices));
	node->count = 0;
	for (size_t i = 0; node->devices && i < count; i++) {
		struct device *device = &node->devices[node->count];
		const json_t *bus = db_words_look_up(buses,
		                                     db_words_text(drives[i].description, "bus"));
		char name[DB_MQTT_NAME_MAX + 16];

		snprintf(device->name, sizeof(device->name), "%s",
		         db_words_text(drives[i].description, "name"));
		snprintf(device->family, sizeof(device->family), "%s",
		         db_words_text(bus, "protocol"));
		device->points = db_mqtt_device_new(node->config, &node->aliases, &drives[i],
		                                    device->family, stops);
		if (!device->points) {
			db_client_log(DB_CLIENT_ERROR, "drive %s: out of memory", device->name);
			continue;
		}
		node->count++;
		snprintf(name, sizeof(name), "trouble/%s", device->name);
		(void)add_own(node->points, name, DB_MQTT_STRING,
		              "What is wrong with this drive; none: nothing");
	}
	/* Data that wait keep their meaning as long as the drive has the same metrics. */
	for (size_t i = 0; i < former_count; i++) {
		const struct device *now = find_device(node, former[i].name);

		if (!now || !db_mqtt_points_are_same(former[i].points, now->points))
			db_mqtt_store_forget(node->store, former[i].name);
	}
	clear_devices(former, former_count);
	node->prepared.what = NOTHING;
	set_own(node, "service", json_string("online"));
	node->knows_plant = true;
	/* All that the node may ever publish is in its births. */
	node->wants_birth = node->connected;
	node->born_at -= BIRTH_INTERVAL;
	db_mqtt_store_unpark(node->store);
}

/* Publishes, or keeps, what has changed of a device. */
static void put_news(struct node *node, struct device *device)
{
	bool now = node->born && !node->wants_birth && device->born;
	/* While births are under way they tell it. */
	bool later = !node->born && db_mqtt_points_have_news(device->points);
	struct db_mqtt_payload *payload;
	uint8_t *bytes;
	size_t length;

	if (!(now && db_mqtt_points_have_news(device->points)) && !later)
		return;
	payload = db_mqtt_payload_new();
	if (payload)
		db_mqtt_points_write_news(device->points, payload);
	bytes = db_mqtt_payload_close(payload, &length);
	if (bytes)
		db_mqtt_store_add(node->store, now ? DB_MQTT_SHELF_NOW : DB_MQTT_SHELF_LATER,
		                  device->name, bytes, length);
	free(bytes);
}

static void on_sample(void *form, const json_t *sample, int64_t us)
{
	struct node *node = form;
	struct device *device = find_device(node, db_words_text(sample, "drive"));

	if (!device)
		return;
	device->alive = db_mqtt_device_take(device->points, json_object_get(sample, "values"), us);
	if (device->alive)
		put_news(node, device);
}

static void on_troubles(void *form, const struct db_client_troubles *troubles, const json_t *news)
{
	struct node *node = form;
	size_t i;
	const json_t *record;

	json_array_foreach(json_object_get(news, "drives"), i, record)
	{
		char name[DB_MQTT_NAME_MAX + 16];

		snprintf(name, sizeof(name), "trouble/%s", db_words_text(record, "drive"));
		set_own(node, name, json_string(db_words_text(record, "cause")));
	}
	set_own(node, "well", json_boolean(troubles->well));
}

static void on_lost(void *form)
{
	struct node *node = form;

	set_own(node, "service", json_string("no-service"));
	set_own(node, "well", json_null());
	for (size_t i = 0; i < node->count; i++) {
		char name[DB_MQTT_NAME_MAX + 16];

		node->devices[i].alive = false;
		snprintf(name, sizeof(name), "trouble/%s", node->devices[i].name);
		set_own(node, name, json_null());
	}
}

static uint64_t on_figures(void *form, const struct db_mqtt_figures *figures)
{
	struct node *node = form;
	struct db_mqtt_store_stats stats = db_mqtt_store_read_stats(node->store);

	(void)figures;
	set_own(node, "buffered", json_integer((json_int_t)stats.messages));
	set_own(node, "dropped", json_integer((json_int_t)stats.dropped));
	return stats.dropped;
}

/* --- commands --------------------------------------------------------------------------------- */

static void on_result(void *form, const struct db_mqtt_outcome *outcome)
{
	struct node *node = form;
	struct device *device = find_device(node, outcome->drive);
	int64_t us = db_client_wall_us();

	if (device) {
		db_mqtt_device_note(device->points, outcome, us);
		/* It is no value of the past: without a session the next birth has it. */
		if (node->born && device->born)
			put_news(node, device);
	}
	if (device && device->born)
		return;
	/* A drive that does not answer has no metrics that may be published. */
	db_mqtt_device_note(node->points, outcome, us);
	set_own(node, "result/drive", json_string(outcome->drive));
}

static void on_connected(void *form, struct db_mqtt_broker *broker)
{
	struct node *node = form;

	node->connected = true;
	node->connected_at = db_client_now();
	node->bd_seq_used = true;
	node->leaving = false;
	node->born = false;
	node->unfit = false;
	node->wants_birth = true;
	node->born_at = -BIRTH_INTERVAL;
	node->history_left = 0;
	node->prepared.what = NOTHING;
	set_own(node, "bdSeq", json_integer(node->bd_seq));
	db_mqtt_host_connect(&node->host, node->config, db_client_now());
	if (node->config->primary_host[0])
		db_mqtt_broker_subscribe(broker, node->host.topic.text, 1, true);
	db_mqtt_broker_subscribe(broker, topic_of(node, "NCMD", "").text, 1, false);
	/* A stop is as safe as its sender makes it: with quality of service 1 it is not dropped. */
	if (db_mqtt_config_commands(node->config))
		db_mqtt_broker_subscribe(broker, topic_of(node, "DCMD", "+").text, 1, false);
}

static void on_disconnected(void *form)
{
	struct node *node = form;

	node->connected = false;
	node->born = false;
	node->wants_birth = false;
	node->prepared.what = NOTHING;
	for (size_t i = 0; i < node->count; i++)
		node->devices[i].born = false;
	db_mqtt_store_end(node->store, !node->leaving);
}

static bool is_open(const void *form)
{
	const struct node *node = form;

	return node->born && !node->wants_birth;
}

static enum db_mqtt_kind take(void *form, const char *topic, const void *bytes, size_t length,
                              const json_t *stops, struct db_mqtt_received *received)
{
	struct node *node = form;
	struct db_mqtt_topic head = topic_of(node, "DCMD", "");
	size_t head_length = strlen(head.text);
	const struct device *device;
	bool alive;

	if (strcmp(topic, node->host.topic.text) == 0) {
		db_mqtt_host_take(&node->host, bytes, length, db_client_now(), (unsigned)rand());
		return DB_MQTT_NOTHING;
	}
	if (strcmp(topic, topic_of(node, "NCMD", "").text) == 0) {
		if (db_mqtt_order_asks(bytes, length, REBIRTH))
			node->wants_birth = true;
		return DB_MQTT_NOTHING;
	}
	if (strncmp(topic, head.text, head_length) != 0 || topic[head_length] != '/')
		return DB_MQTT_NOTHING;
	device = find_device(node, topic + head_length + 1);
	if (!device)
		return DB_MQTT_NOTHING;
	snprintf(received->drive, sizeof(received->drive), "%s", device->name);
	received->wrong = db_mqtt_order_read(device->points, stops, bytes, length,
	                                     &received->command, &alive);
	return alive ? DB_MQTT_ALIVE : DB_MQTT_COMMAND;
}

/* --- what is sent ----------------------------------------------------------------------------- */

/* NDEATH. Its number is that of the births that it ends. */
static bool write_death(struct node *node, struct db_mqtt_message *message)
{
	struct db_mqtt_payload *payload = db_mqtt_payload_new();
	int64_t us = db_client_wall_us();
	json_t *number = json_integer(node->bd_seq);
	uint8_t *metrics;
	size_t metrics_length;
	size_t length = 0;

	if (payload)
		db_mqtt_payload_add(payload, &(struct db_mqtt_metric){ .name = "bdSeq",
		                                                       .alias = DB_MQTT_NO_ALIAS,
		                                                       .us = us,
		                                                       .type = DB_MQTT_INT64,
		                                                       .typed = true,
		                                                       .value = number,
		                                                       .quality = DB_MQTT_UNSAID });
	metrics = db_mqtt_payload_close(payload, &metrics_length);
	free(node->last_words);
	node->last_words = metrics ? db_mqtt_payload_finish(us, DB_MQTT_NO_SEQ, metrics,
	                                                    metrics_length, &length) :
	                             NULL;
	free(metrics);
	json_decref(number);
	*message = (struct db_mqtt_message){
		.topic = node->death.text, .payload = node->last_words, .length = length, .qos = 1
	};
	return node->last_words != NULL;
}

static bool write_will(void *form, struct db_mqtt_message *message)
{
	struct node *node = form;

	if (node->bd_seq_used)
		node->bd_seq = (node->bd_seq + 1) % SEQ_COUNT;
	node->bd_seq_used = false;
	return write_death(node, message);
}

static bool write_farewell(void *form, struct db_mqtt_message *message)
{
	struct node *node = form;

	if (!write_death(node, message))
		return false;
	message->qos = 0;
	node->leaving = true;
	return true;
}

static uint8_t *write_node_birth(const struct node *node, size_t *length)
{
	struct db_mqtt_payload *payload = db_mqtt_payload_new();
	int64_t us = db_client_wall_us();
	struct db_mqtt_points **points = calloc(node->count + 1, sizeof(*points));

	for (size_t i = 0; points && i < node->count; i++)
		points[i] = node->devices[i].points;
	if (payload && points) {
		db_mqtt_points_write_all(node->points, payload, us);
		for (size_t i = 0; node->config->templates && i < node->count; i++) {
			size_t first = 0;

			/* Each family once. */
			while (strcmp(node->devices[first].family, node->devices[i].family) != 0)
				first++;
			if (first == i)
				db_mqtt_points_write_definition(node->devices[i].family, points,
				                                node->count, payload, us);
		}
	}
	free(points);
	return db_mqtt_payload_close(payload, length);
}

static uint8_t *write_points(struct db_mqtt_points *points, bool all, size_t *length)
{
	struct db_mqtt_payload *payload = db_mqtt_payload_new();

	if (payload && all)
		db_mqtt_points_write_all(points, payload, db_client_wall_us());
	else if (payload)
		db_mqtt_points_write_news(points, payload);
	return db_mqtt_payload_close(payload, length);
}

/* The next one of the past whose device is there. NULL: none, or not yet. */
static const struct db_mqtt_stored *find_history(struct node *node, db_time now)
{
	const struct db_mqtt_stored *stored;

	if (now - node->history_from >= HISTORY_INTERVAL) {
		node->history_from = now;
		node->history_left = (node->config->history_rate + HISTORY_PORTIONS - 1) /
		                     HISTORY_PORTIONS;
	}
	while ((stored = db_mqtt_store_first(node->store, DB_MQTT_SHELF_LATER)) != NULL) {
		const struct device *device = find_device(node, stored->device);

		if (device && device->born)
			return node->history_left > 0 ? stored : NULL;
		db_mqtt_store_park(node->store);
	}
	return NULL;
}

/* When births may be published at the earliest. At the start the service is asked first: some hosts
 * take births of the same session with other metrics for repetitions. */
static db_time read_birth_time(const struct node *node)
{
	db_time earliest = node->born_at + BIRTH_INTERVAL;

	if (!node->knows_plant)
		earliest = db_time_max(earliest, node->connected_at + PLANT_PATIENCE);
	return earliest;
}

/* What comes next, with its metrics: to be freed, NULL without memory or where it has none. The
 * order is that of Sparkplug: births, then data. */
static uint8_t *choose(struct node *node, db_time now, struct prepared *next, size_t *length)
{
	const struct db_mqtt_stored *stored;
	uint8_t *bytes;

	*length = 0;
	*next = (struct prepared){ .what = NOTHING };
	if (!db_mqtt_host_allows(&node->host, now) || node->unfit)
		return NULL;
	if (node->wants_birth) {
		if (now < read_birth_time(node))
			return NULL;
		next->what = NODE_BIRTH;
		next->topic = topic_of(node, "NBIRTH", "");
		return write_node_birth(node, length);
	}
	for (size_t i = 0; i < node->count; i++) {
		next->device = &node->devices[i];
		if (!next->device->alive || next->device->born || next->device->unfit)
			continue;
		next->what = DEVICE_BIRTH;
		next->topic = topic_of(node, "DBIRTH", next->device->name);
		return write_points(next->device->points, true, length);
	}
	stored = db_mqtt_store_first(node->store, DB_MQTT_SHELF_NOW);
	if (stored) {
		next->what = DEVICE_DATA;
		next->topic = topic_of(node, "DDATA", stored->device);
		bytes = malloc(stored->length + 1);
		if (bytes)
			memcpy(bytes, stored->metrics, stored->length);
		*length = stored->length;
		return bytes;
	}
	for (size_t i = 0; i < node->count; i++) {
		next->device = &node->devices[i];
		if (next->device->alive || !next->device->born)
			continue;
		next->what = DEVICE_DEATH;
		next->topic = topic_of(node, "DDEATH", next->device->name);
		return NULL;
	}
	if (db_mqtt_points_have_news(node->points)) {
		next->what = NODE_DATA;
		next->topic = topic_of(node, "NDATA", "");
		return write_points(node->points, false, length);
	}
	stored = find_history(node, now);
	if (!stored)
		return NULL;
	next->what = HISTORY;
	next->topic = topic_of(node, "DDATA", stored->device);
	return db_mqtt_payload_mark(stored->metrics, stored->length, length);
}

static bool find_next(void *form, db_time now, struct db_mqtt_message *message)
{
	struct node *node = form;
	struct prepared *prepared = &node->prepared;
	uint8_t *metrics;
	size_t length;
	bool needs;

	free(prepared->bytes);
	prepared->bytes = NULL;
	metrics = choose(node, now, prepared, &length);
	needs = prepared->what != DEVICE_DEATH;
	/* Without memory it is tried again at the next turn. */
	if (prepared->what != NOTHING && (metrics || !needs))
		prepared->bytes = db_mqtt_payload_finish(
			db_client_wall_us(), prepared->what == NODE_BIRTH ? 0 : (int)node->seq,
			metrics, metrics ? length : 0, &prepared->length);
	free(metrics);
	if (!prepared->bytes)
		return false;
	*message = (struct db_mqtt_message){ .topic = prepared->topic.text,
		                             .payload = prepared->bytes,
		                             .length = prepared->length };
	return true;
}

static void begin_births(struct node *node, db_time now)
{
	node->wants_birth = false;
	node->born = true;
	node->born_at = now;
	node->seq = 0;
	for (size_t i = 0; i < node->count; i++) {
		node->devices[i].born = false;
		node->devices[i].unfit = false;
	}
	/* What was to be sent is older than what the births tell. */
	db_mqtt_store_defer(node->store);
}

/* What was given out has been sent, or with `refused` is left out: too long for the broker. */
static void on_sent(void *form, int number, bool refused, db_time now)
{
	struct node *node = form;
	struct device *device = node->prepared.device;

	(void)number;
	if (refused)
		db_client_log(
			DB_CLIENT_ERROR,
			"%s has %zu bytes, which is too long for this broker; choose fewer values",
			node->prepared.topic.text, node->prepared.length);
	switch (node->prepared.what) {
	case NOTHING:
		return;
	case NODE_BIRTH:
		node->unfit = refused;
		if (!refused)
			begin_births(node, now);
		break;
	case DEVICE_BIRTH:
		device->unfit = refused;
		device->born = !refused;
		db_mqtt_store_unpark(node->store);
		break;
	case DEVICE_DEATH:
		device->born = false;
		break;
	case NODE_DATA:
		break;
	case DEVICE_DATA:
	case HISTORY: {
		bool history = node->prepared.what == HISTORY;
		enum db_mqtt_shelf shelf = history ? DB_MQTT_SHELF_LATER : DB_MQTT_SHELF_NOW;

		if (refused)
			db_mqtt_store_drop(node->store, shelf);
		else
			db_mqtt_store_sent(node->store, shelf, now);
		node->history_left -= history;
		break;
	}
	}
	if (!refused)
		node->seq = (node->seq + 1) % SEQ_COUNT;
	node->prepared.what = NOTHING;
}

/* --- its life --------------------------------------------------------------------------------- */

static db_time turn(void *form, struct db_mqtt_broker *broker, db_time now)
{
	struct node *node = form;
	const char *why;
	db_time due = DB_TIME_NEVER;

	/* A connection is noticed to be lost after twice this time at the latest. */
	db_mqtt_store_settle(node->store, now - 3 * node->config->keepalive_s * DB_NS_PER_S);
	if (!node->connected)
		return due;
	why = db_mqtt_host_complain(&node->host, now, &due);
	if (why) {
		db_mqtt_broker_leave(broker, why, now);
		return now;
	}
	if (node->wants_birth && db_mqtt_host_allows(&node->host, now))
		due = db_time_min(due, db_time_max(now, read_birth_time(node)));
	else if (db_mqtt_store_first(node->store, DB_MQTT_SHELF_LATER))
		due = db_time_min(due, node->history_from + HISTORY_INTERVAL);
	return due;
}

static void close_node(void *form)
{
	struct node *node = form;

	if (!node)
		return;
	free(node->prepared.bytes);
	free(node->last_words);
	clear_devices(node->devices, node->count);
	db_mqtt_points_free(node->points);
	db_mqtt_store_free(node->store);
	json_decref(node->aliases.known);
	free(node);
}

static void *open_node(const struct db_mqtt_config *config)
{
	struct node *node = calloc(1, sizeof(*node));

	if (!node)
		return NULL;
	node->config = config;
	node->death = topic_of(node, "NDEATH", "");
	node->store = db_mqtt_store_new(config->buffer_messages,
	                                (size_t)config->buffer_kib * BYTES_PER_KIB);
	node->aliases.known = json_object();
	if (node->aliases.known)
		node->points = db_mqtt_points_new(&node->aliases, "", "");
	if (node->store && node->points && add_points(node))
		return node;
	close_node(node);
	return NULL;
}

const struct db_mqtt_form_ops db_mqtt_node = {
	.open = open_node,
	.close = close_node,
	.source = { .will = write_will,
	            .farewell = write_farewell,
	            .next = find_next,
	            .sent = on_sent },
	.keep = db_mqtt_device_keep,
	.found = on_found,
	.lost = on_lost,
	.sample = on_sample,
	.troubles = on_troubles,
	.figures = on_figures,
	.result = on_result,
	.connected = on_connected,
	.disconnected = on_disconnected,
	.is_open = is_open,
	.take = take,
	.turn = turn,
};
