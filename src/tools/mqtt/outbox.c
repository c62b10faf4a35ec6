/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/outbox.h"

#include <stdlib.h>
#include <string.h>

struct sample {
	struct sample *next;
	size_t bytes;
	enum db_mqtt_lane lane;
	const char *payload; /* stored after the topic */
	char topic[];
};

struct lane {
	struct sample *first; /* in their order */
	struct sample *last;
};

struct retained {
	char *topic;
	char *payload;
	bool wanted;    /* to be sent */
	bool under_way; /* the former text is not confirmed yet */
};

/* A sent, unconfirmed message: a sample, or the retained text of this index. */
struct flight {
	int number;
	struct sample *sample; /* NULL: a retained text */
	size_t retained;
};

struct db_mqtt_outbox {
	size_t messages_max;
	size_t bytes_max;
	struct lane lanes[DB_MQTT_LANES];
	struct retained *retained;
	size_t retained_count;
	struct flight window[DB_MQTT_WINDOW]; /* in their order */
	size_t under_way;
	/* index returned by db_mqtt_outbox_next(), or their count: the first sample */
	size_t next_retained;
	struct db_mqtt_outbox_stats stats;
};

struct db_mqtt_outbox *db_mqtt_outbox_new(size_t messages, size_t bytes)
{
	struct db_mqtt_outbox *outbox = calloc(1, sizeof(*outbox));

	if (!outbox)
		return NULL;
	outbox->messages_max = messages;
	outbox->bytes_max = bytes;
	return outbox;
}

/* The lane to send from next; NULL: none. */
static struct lane *find_first(struct db_mqtt_outbox *outbox)
{
	for (size_t i = 0; i < DB_MQTT_LANES; i++) {
		if (outbox->lanes[i].first)
			return &outbox->lanes[i];
	}
	return NULL;
}

/* The first sample leaves the queue; it is not freed. */
static struct sample *take_first(struct db_mqtt_outbox *outbox, struct lane *lane)
{
	struct sample *sample = lane->first;

	lane->first = sample->next;
	if (!lane->first)
		lane->last = NULL;
	outbox->stats.messages--;
	return sample;
}

static void free_sample(struct db_mqtt_outbox *outbox, struct sample *sample)
{
	outbox->stats.bytes -= sample->bytes;
	free(sample);
}

void db_mqtt_outbox_free(struct db_mqtt_outbox *outbox)
{
	if (!outbox)
		return;
	db_mqtt_outbox_start_over(outbox);
	for (struct lane *lane; (lane = find_first(outbox)) != NULL;)
		free_sample(outbox, take_first(outbox, lane));
	for (size_t i = 0; i < outbox->retained_count; i++) {
		free(outbox->retained[i].topic);
		free(outbox->retained[i].payload);
	}
	free(outbox->retained);
	free(outbox);
}

static bool has_room(const struct db_mqtt_outbox *outbox, size_t bytes)
{
	return outbox->stats.messages < outbox->messages_max &&
	       outbox->stats.bytes + bytes <= outbox->bytes_max;
}

void db_mqtt_outbox_add_sample(struct db_mqtt_outbox *outbox, enum db_mqtt_lane lane,
                               const char *topic, const char *payload)
{
	struct lane *queue = &outbox->lanes[lane];
	size_t topic_size = strlen(topic) + 1;
	size_t payload_size = strlen(payload) + 1;
	size_t bytes = sizeof(struct sample) + topic_size + payload_size;
	struct sample *sample;

	/* The least important lane is dropped first, until there is room, or nothing of this one
	 * and the less important ones is left. */
	for (size_t i = DB_MQTT_LANES; i-- > (size_t)lane;) {
		while (outbox->lanes[i].first && !has_room(outbox, bytes)) {
			free_sample(outbox, take_first(outbox, &outbox->lanes[i]));
			outbox->stats.dropped++;
		}
	}
	sample = has_room(outbox, bytes) ? malloc(bytes) : NULL;
	if (!sample) {
		outbox->stats.dropped++;
		return;
	}
	sample->next = NULL;
	sample->bytes = bytes;
	sample->lane = lane;
	memcpy(sample->topic, topic, topic_size);
	memcpy(sample->topic + topic_size, payload, payload_size);
	sample->payload = sample->topic + topic_size;
	if (queue->last)
		queue->last->next = sample;
	else
		queue->first = sample;
	queue->last = sample;
	outbox->stats.messages++;
	outbox->stats.bytes += bytes;
}

/* The entry of the topic, a new one if necessary; NULL without memory. */
static struct retained *find_retained(struct db_mqtt_outbox *outbox, const char *topic)
{
	struct retained *grown;
	char *copy;

	for (size_t i = 0; i < outbox->retained_count; i++) {
		if (strcmp(outbox->retained[i].topic, topic) == 0)
			return &outbox->retained[i];
	}
	grown = reallocarray(outbox->retained, outbox->retained_count + 1, sizeof(*grown));
	copy = strdup(topic);
	if (grown)
		outbox->retained = grown;
	if (!grown || !copy) {
		free(copy);
		return NULL;
	}
	grown[outbox->retained_count] = (struct retained){ .topic = copy };
	return &grown[outbox->retained_count++];
}

void db_mqtt_outbox_set_retained(struct db_mqtt_outbox *outbox, const char *topic,
                                 const char *payload)
{
	char *copy = strdup(payload);
	struct retained *retained = copy ? find_retained(outbox, topic) : NULL;

	if (!retained) {
		free(copy);
		return;
	}
	free(retained->payload);
	/* gcc's analyzer does not see that the outbox has it now. */
	retained->payload = copy;
	retained->wanted = true;
}

bool db_mqtt_outbox_next(struct db_mqtt_outbox *outbox, struct db_mqtt_message *message)
{
	const struct lane *lane = find_first(outbox);
	size_t place = 0;

	if (outbox->under_way == DB_MQTT_WINDOW)
		return false;
	/* The former text of a topic is confirmed first: so they arrive in their order. */
	while (place < outbox->retained_count &&
	       (!outbox->retained[place].wanted || outbox->retained[place].under_way))
		place++;
	outbox->next_retained = place;
	if (place < outbox->retained_count)
		*message = (struct db_mqtt_message){ .topic = outbox->retained[place].topic,
			                             .payload = outbox->retained[place].payload,
			                             .retained = true };
	else if (lane)
		*message = (struct db_mqtt_message){ .topic = lane->first->topic,
			                             .payload = lane->first->payload };
	else
		return false;
	message->length = strlen(message->payload);
	return true;
}

void db_mqtt_outbox_sent(struct db_mqtt_outbox *outbox, int number)
{
	struct flight flight = { .number = number, .retained = outbox->next_retained };
	struct lane *lane = find_first(outbox);

	if (flight.retained < outbox->retained_count) {
		outbox->retained[flight.retained].wanted = false;
		outbox->retained[flight.retained].under_way = number > 0;
	} else if (lane) {
		flight.sample = take_first(outbox, lane);
	}
	if (number > 0) {
		outbox->window[outbox->under_way++] = flight;
		return;
	}
	if (flight.sample)
		free_sample(outbox, flight.sample);
	outbox->stats.confirmed++;
}

void db_mqtt_outbox_confirm(struct db_mqtt_outbox *outbox, int number)
{
	size_t place = 0;
	struct flight flight;

	while (place < outbox->under_way && outbox->window[place].number != number)
		place++;
	if (place == outbox->under_way)
		return;
	flight = outbox->window[place];
	outbox->under_way--;
	memmove(&outbox->window[place], &outbox->window[place + 1],
	        (outbox->under_way - place) * sizeof(flight));
	if (flight.sample)
		free_sample(outbox, flight.sample);
	else
		outbox->retained[flight.retained].under_way = false;
	outbox->stats.confirmed++;
}

void db_mqtt_outbox_start_over(struct db_mqtt_outbox *outbox)
{
	/* Back to the heads of their lanes, in their order. */
	while (outbox->under_way > 0) {
		struct sample *sample = outbox->window[--outbox->under_way].sample;
		struct lane *lane;

		if (!sample)
			continue;
		lane = &outbox->lanes[sample->lane];
		sample->next = lane->first;
		lane->first = sample;
		if (!lane->last)
			lane->last = sample;
		outbox->stats.messages++;
	}
	for (size_t i = 0; i < outbox->retained_count; i++) {
		outbox->retained[i].wanted = true;
		outbox->retained[i].under_way = false;
	}
}

struct db_mqtt_outbox_stats db_mqtt_outbox_read_stats(const struct db_mqtt_outbox *outbox)
{
	return outbox->stats;
}
