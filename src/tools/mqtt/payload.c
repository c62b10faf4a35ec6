/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/payload.h"

#include <sparkplug.pb-c.h>
#include <stdlib.h>
#include <string.h>

#define US_PER_MS 1000

/* All memory of a payload that is being built is in such blocks, and freed at once. */
struct block {
	struct block *next;
	max_align_t data[];
};

struct list {
	Spb__Metric **metrics;
	size_t count;
	size_t room;
};

struct db_mqtt_payload {
	struct block *blocks;
	struct list metrics;
	struct list members;   /* of the template that is being filled */
	Spb__Template *filled; /* NULL: none is */
	bool failed;           /* there was no memory */
};

struct db_mqtt_payload *db_mqtt_payload_new(void)
{
	return calloc(1, sizeof(struct db_mqtt_payload));
}

/* Zeroed; NULL without memory. */
static void *take_block(struct db_mqtt_payload *payload, size_t size)
{
	struct block *block = calloc(1, sizeof(*block) + size);

	if (!block) {
		payload->failed = true;
		return NULL;
	}
	block->next = payload->blocks;
	payload->blocks = block;
	return block->data;
}

static char *copy_text(struct db_mqtt_payload *payload, const char *text)
{
	size_t size = strlen(text) + 1;
	char *copy = take_block(payload, size);

	if (copy)
		memcpy(copy, text, size);
	return copy;
}

enum db_mqtt_type db_mqtt_type_of(const char *type)
{
	static const struct {
		const char *name;
		enum db_mqtt_type type;
	} types[] = {
		{ "bool", DB_MQTT_BOOLEAN },  { "u16", DB_MQTT_UINT16 },
		{ "bits16", DB_MQTT_UINT16 }, { "u32", DB_MQTT_UINT32 },
		{ "bits32", DB_MQTT_UINT32 }, { "i16", DB_MQTT_INT32 },
		{ "i32", DB_MQTT_INT32 },     { "u64", DB_MQTT_UINT64 },
		{ "f32", DB_MQTT_FLOAT },
	};

	for (size_t i = 0; i < sizeof(types) / sizeof(types[0]); i++) {
		if (strcmp(types[i].name, type) == 0)
			return types[i].type;
	}
	return DB_MQTT_STRING;
}

/* --- properties ------------------------------------------------------------------------------- */

static void put_property(struct db_mqtt_payload *payload, Spb__PropertySet *set, const char *key,
                         const json_t *value)
{
	char *name = copy_text(payload, key);
	Spb__PropertyValue *made = take_block(payload, sizeof(*made));

	if (!name || !made)
		return;
	spb__property_value__init(made);
	made->has_type = 1;
	if (json_is_string(value)) {
		made->type = DB_MQTT_STRING;
		made->value_case = SPB__PROPERTY_VALUE__VALUE_STRING_VALUE;
		made->string_value = copy_text(payload, json_string_value(value));
	} else if (json_is_boolean(value)) {
		made->type = DB_MQTT_BOOLEAN;
		made->value_case = SPB__PROPERTY_VALUE__VALUE_BOOLEAN_VALUE;
		made->boolean_value = json_is_true(value);
	} else if (json_is_integer(value)) {
		made->type = DB_MQTT_INT32;
		made->value_case = SPB__PROPERTY_VALUE__VALUE_INT_VALUE;
		made->int_value = (uint32_t)json_integer_value(value);
	} else {
		made->type = DB_MQTT_DOUBLE;
		made->value_case = SPB__PROPERTY_VALUE__VALUE_DOUBLE_VALUE;
		made->double_value = json_real_value(value);
	}
	set->keys[set->n_keys++] = name;
	set->values[set->n_values++] = made;
}

static Spb__PropertySet *make_properties(struct db_mqtt_payload *payload,
                                         const struct db_mqtt_metric *metric)
{
	size_t count = json_object_size(metric->properties) + 1;
	Spb__PropertySet *set = take_block(payload, sizeof(*set));
	json_t *quality;
	const char *key;
	const json_t *value;

	if (!set)
		return NULL;
	spb__property_set__init(set);
	set->keys = take_block(payload, count * sizeof(*set->keys));
	set->values = take_block(payload, count * sizeof(Spb__PropertyValue *));
	if (!set->keys || !set->values)
		return NULL;
	json_object_foreach(metric->properties, key, value) put_property(payload, set, key, value);
	quality = metric->quality != DB_MQTT_UNSAID ? json_integer(metric->quality) : NULL;
	if (quality)
		put_property(payload, set, "Quality", quality);
	json_decref(quality);
	return set;
}

/* --- values ----------------------------------------------------------------------------------- */

/* False: the value is of another type. */
static bool put_value(struct db_mqtt_payload *payload, Spb__Metric *made, enum db_mqtt_type type,
                      const json_t *value)
{
	switch (type) {
	case DB_MQTT_INT32:
	case DB_MQTT_UINT16:
	case DB_MQTT_UINT32:
		made->value_case = SPB__METRIC__VALUE_INT_VALUE;
		made->int_value = (uint32_t)json_integer_value(value);
		return json_is_integer(value);
	case DB_MQTT_INT64:
	case DB_MQTT_UINT64:
		made->value_case = SPB__METRIC__VALUE_LONG_VALUE;
		made->long_value = (uint64_t)json_integer_value(value);
		return json_is_integer(value);
	case DB_MQTT_FLOAT:
		made->value_case = SPB__METRIC__VALUE_FLOAT_VALUE;
		made->float_value = (float)json_number_value(value);
		return json_is_number(value);
	case DB_MQTT_DOUBLE:
		made->value_case = SPB__METRIC__VALUE_DOUBLE_VALUE;
		made->double_value = json_number_value(value);
		return json_is_number(value);
	case DB_MQTT_BOOLEAN:
		made->value_case = SPB__METRIC__VALUE_BOOLEAN_VALUE;
		made->boolean_value = json_is_true(value);
		return json_is_boolean(value);
	case DB_MQTT_STRING:
		if (!json_is_string(value))
			return false;
		made->value_case = SPB__METRIC__VALUE_STRING_VALUE;
		made->string_value = copy_text(payload, json_string_value(value));
		return true;
	case DB_MQTT_TEMPLATE:
		break;
	}
	return false;
}

static void put_metric(struct db_mqtt_payload *payload, struct list *list, Spb__Metric *made)
{
	/* The former array stays a block of the payload. */
	if (list->count == list->room) {
		size_t room = list->room ? 2 * list->room : 16;
		Spb__Metric **grown = take_block(payload, room * sizeof(Spb__Metric *));

		if (!grown)
			return;
		if (list->count > 0)
			memcpy(grown, list->metrics, list->count * sizeof(Spb__Metric *));
		list->metrics = grown;
		list->room = room;
	}
	list->metrics[list->count++] = made;
}

/* NULL without memory. */
static Spb__Metric *make_metric(struct db_mqtt_payload *payload,
                                const struct db_mqtt_metric *metric)
{
	Spb__Metric *made = take_block(payload, sizeof(*made));

	if (!made)
		return NULL;
	spb__metric__init(made);
	if (metric->name)
		made->name = copy_text(payload, metric->name);
	made->has_alias = metric->alias != DB_MQTT_NO_ALIAS;
	made->alias = (uint64_t)metric->alias;
	made->has_timestamp = 1;
	made->timestamp = (uint64_t)(metric->us / US_PER_MS);
	made->has_datatype = metric->typed;
	made->datatype = metric->type;
	if (metric->properties || metric->quality != DB_MQTT_UNSAID)
		made->properties = make_properties(payload, metric);
	return made;
}

void db_mqtt_payload_add(struct db_mqtt_payload *payload, const struct db_mqtt_metric *metric)
{
	Spb__Metric *made = make_metric(payload, metric);

	if (!made)
		return;
	if (!put_value(payload, made, metric->type, metric->value)) {
		made->value_case = SPB__METRIC__VALUE__NOT_SET;
		made->has_is_null = 1;
		made->is_null = 1;
	}
	put_metric(payload, payload->filled ? &payload->members : &payload->metrics, made);
}

void db_mqtt_payload_begin(struct db_mqtt_payload *payload, const struct db_mqtt_metric *metric,
                           const char *definition)
{
	Spb__Metric *made = make_metric(payload, metric);
	Spb__Template *template = take_block(payload, sizeof(*template));

	if (!made || !template)
		return;
	spb__template__init(template);
	template->has_is_definition = 1;
	template->is_definition = definition == NULL;
	if (definition)
		template->template_ref = copy_text(payload, definition);
	made->value_case = SPB__METRIC__VALUE_TEMPLATE_VALUE;
	made->template_value = template;
	put_metric(payload, &payload->metrics, made);
	payload->filled = template;
	payload->members = (struct list){ .count = 0 };
}

void db_mqtt_payload_end(struct db_mqtt_payload *payload)
{
	if (!payload->filled)
		return;
	payload->filled->metrics = payload->members.metrics;
	payload->filled->n_metrics = payload->members.count;
	payload->filled = NULL;
}

/* --- bytes ------------------------------------------------------------------------------------ */

/* There is room for `tail` bytes more. */
static uint8_t *pack(const Spb__Payload *whole, size_t tail, size_t *length)
{
	size_t size = spb__payload__get_packed_size(whole);
	uint8_t *bytes = malloc(size + tail + 1);

	if (bytes)
		*length = spb__payload__pack(whole, bytes);
	return bytes;
}

uint8_t *db_mqtt_payload_close(struct db_mqtt_payload *payload, size_t *length)
{
	Spb__Payload whole = SPB__PAYLOAD__INIT;
	uint8_t *bytes = NULL;

	*length = 0;
	if (!payload)
		return NULL;
	whole.metrics = payload->metrics.metrics;
	whole.n_metrics = payload->metrics.count;
	if (!payload->failed)
		bytes = pack(&whole, 0, length);
	while (payload->blocks) {
		struct block *next = payload->blocks->next;

		free(payload->blocks);
		payload->blocks = next;
	}
	free(payload);
	return bytes;
}

uint8_t *db_mqtt_payload_finish(int64_t us, int seq, const uint8_t *metrics, size_t metrics_length,
                                size_t *length)
{
	Spb__Payload head = SPB__PAYLOAD__INIT;
	uint8_t *bytes;

	head.has_timestamp = 1;
	head.timestamp = (uint64_t)(us / US_PER_MS);
	head.has_seq = seq != DB_MQTT_NO_SEQ;
	head.seq = (uint64_t)seq;
	bytes = pack(&head, metrics_length, length);
	/* The bytes of two messages of one type, one after the other, are a message with the fields
	 * of both: that is a rule of Protocol Buffers. */
	if (bytes && metrics_length > 0)
		memcpy(bytes + *length, metrics, metrics_length);
	*length += bytes ? metrics_length : 0;
	return bytes;
}

uint8_t *db_mqtt_payload_mark(const uint8_t *metrics, size_t metrics_length, size_t *length)
{
	Spb__Payload *payload = spb__payload__unpack(NULL, metrics_length, metrics);
	uint8_t *bytes;

	if (!payload)
		return NULL;
	for (size_t i = 0; i < payload->n_metrics; i++) {
		payload->metrics[i]->has_is_historical = 1;
		payload->metrics[i]->is_historical = 1;
	}
	bytes = pack(payload, 0, length);
	spb__payload__free_unpacked(payload, NULL);
	return bytes;
}
