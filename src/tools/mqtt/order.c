/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/order.h"

#include "drivebridge/hash.h"

#include <inttypes.h>
#include <math.h>
#include <sparkplug.pb-c.h>
#include <stdio.h>
#include <string.h>

#define US_PER_MS 1000
/* Whole numbers up to here are exact in a double. */
#define DOUBLE_WHOLE_MAX 9007199254740992.0
/* The year 9999, in ms: no clock shows a later one. */
#define MS_MAX INT64_C(253402300799000)

/* What has been read of a payload. */
struct order {
	const struct db_mqtt_points *points;
	const json_t *stops;
	const char *stop;                /* a command that stops; NULL: none */
	const struct db_mqtt_point *run; /* another command; NULL: none */
	json_t *arguments;
	json_t *written;
	const char *id, *user, *token; /* NULL: not given */
	bool alive;
	bool untimed; /* a metric that counts has no time */
	int64_t ms;   /* the oldest time; 0: none yet */
	const char *wrong;
};

/* The first mistake counts. */
static void refuse(struct order *order, const char *wrong)
{
	if (!order->wrong)
		order->wrong = wrong;
}

/* --- values ----------------------------------------------------------------------------------- */

static bool is_signed(const Spb__FlatMetric *metric, enum db_mqtt_type type)
{
	uint32_t said = metric->has_datatype ? metric->datatype : type;

	return said >= 1 && said <= DB_MQTT_INT64;
}

/* A number; false: it is none, or none that a double has exactly. */
static bool read_number(const Spb__FlatMetric *metric, enum db_mqtt_type type, double *number)
{
	switch (metric->value_case) {
	case SPB__FLAT_METRIC__VALUE_INT_VALUE:
		*number = is_signed(metric, type) ? (double)(int32_t)metric->int_value :
		                                    (double)metric->int_value;
		return true;
	case SPB__FLAT_METRIC__VALUE_LONG_VALUE:
		*number = is_signed(metric, type) ? (double)(int64_t)metric->long_value :
		                                    (double)metric->long_value;
		return fabs(*number) <= DOUBLE_WHOLE_MAX;
	case SPB__FLAT_METRIC__VALUE_FLOAT_VALUE:
		*number = (double)metric->float_value;
		return isfinite(*number);
	case SPB__FLAT_METRIC__VALUE_DOUBLE_VALUE:
		*number = metric->double_value;
		return isfinite(*number);
	default:
		return false;
	}
}

/* The value as the control socket takes it; NULL: it is none of this type. Its range is for the
 * service. */
static json_t *read_value(const Spb__FlatMetric *metric, enum db_mqtt_type type)
{
	double number;

	if (metric->has_is_null && metric->is_null)
		return NULL;
	if (type == DB_MQTT_STRING)
		return metric->value_case == SPB__FLAT_METRIC__VALUE_STRING_VALUE ?
		               json_string(metric->string_value) :
		               NULL;
	if (type == DB_MQTT_BOOLEAN)
		return metric->value_case == SPB__FLAT_METRIC__VALUE_BOOLEAN_VALUE ?
		               json_boolean(metric->boolean_value) :
		               NULL;
	if (!read_number(metric, type, &number))
		return NULL;
	if (type == DB_MQTT_FLOAT || type == DB_MQTT_DOUBLE)
		return json_real(number);
	if (fabs(number) > DOUBLE_WHOLE_MAX || floor(number) != number)
		return NULL;
	return json_integer((json_int_t)number);
}

/* --- metrics ---------------------------------------------------------------------------------- */

static void take_mark(struct order *order, const struct db_mqtt_point *point,
                      const Spb__FlatMetric *metric)
{
	const char *text = metric->value_case == SPB__FLAT_METRIC__VALUE_STRING_VALUE ?
	                           metric->string_value :
	                           NULL;

	if (point->type == DB_MQTT_BOOLEAN)
		order->alive = metric->value_case == SPB__FLAT_METRIC__VALUE_BOOLEAN_VALUE &&
		               metric->boolean_value;
	else if (!text)
		refuse(order, "id, user and token of the sender are texts");
	else if (strcmp(point->what, "id") == 0)
		order->id = text;
	else if (strcmp(point->what, "user") == 0)
		order->user = text;
	else
		order->token = text;
}

/* Into arguments or values to be written. */
static void take_value(struct order *order, json_t *values, const char *name,
                       const struct db_mqtt_point *point, const Spb__FlatMetric *metric)
{
	json_t *value = read_value(metric, point->type);

	if (!value)
		refuse(order, "a metric has no value, or one of another type than in the DBIRTH");
	else if (json_object_get(values, name))
		refuse(order, "a metric is there twice");
	else
		(void)json_object_set(values, name, value);
	json_decref(value);
}

static void take_command(struct order *order, const struct db_mqtt_point *point,
                         const Spb__FlatMetric *metric)
{
	/* What stops is carried out in doubt. */
	if (json_object_get(order->stops, point->what)) {
		order->stop = point->what;
		return;
	}
	if (order->run)
		refuse(order, "there are two commands; one message has one");
	order->run = point;
	if (point->first[0])
		take_value(order, order->arguments, point->first, point, metric);
	else if (metric->value_case != SPB__FLAT_METRIC__VALUE_BOOLEAN_VALUE ||
	         !metric->boolean_value)
		refuse(order, "this command is run by the value true, and by nothing else");
}

static void take_metric(struct order *order, const Spb__FlatPayload *payload,
                        const Spb__FlatMetric *metric)
{
	const struct db_mqtt_point *point = NULL;
	uint64_t ms = metric->has_timestamp  ? metric->timestamp :
	              payload->has_timestamp ? payload->timestamp :
	                                       0;

	if (metric->name && metric->name[0])
		point = db_mqtt_points_find(order->points, metric->name, 0);
	else if (metric->has_alias && metric->alias <= INT64_MAX)
		point = db_mqtt_points_find(order->points, NULL, (int64_t)metric->alias);
	if (!point) {
		refuse(order, "it has a metric that the DBIRTH of this drive does not have");
		return;
	}
	if (metric->has_is_historical && metric->is_historical)
		refuse(order, "a historical value is no command");
	switch (point->kind) {
	case DB_MQTT_RUN:
		take_command(order, point, metric);
		break;
	case DB_MQTT_ARGUMENT:
		take_value(order, order->arguments, point->what, point, metric);
		break;
	case DB_MQTT_MARK:
		take_mark(order, point, metric);
		return;
	case DB_MQTT_VALUE:
		if (!point->writable)
			refuse(order, "it has a metric that cannot be written");
		take_value(order, order->written, point->what, point, metric);
		break;
	case DB_MQTT_RESULT:
		refuse(order, "it has a metric that cannot be written");
		break;
	}
	if (ms == 0 || ms > (uint64_t)MS_MAX)
		order->untimed = true;
	else if (order->ms == 0 || (int64_t)ms < order->ms)
		order->ms = (int64_t)ms;
}

/* --- the whole -------------------------------------------------------------------------------- */

/* The same bytes are the same command: a broker may deliver a message twice. The time and the name
 * are in the id as they are, values by a hash of all bytes. */
static void make_id(const struct order *order, const void *bytes, size_t length,
                    char id[DB_MQTT_ID_MAX + 1])
{
	snprintf(id, DB_MQTT_ID_MAX + 1, "%" PRId64 " %.24s %016" PRIx64, order->ms,
	         order->run ? order->run->what : "write",
	         db_hash_add(DB_HASH_BEGIN, bytes, length));
}

/* Moves what was read to the command, which owns it then. */
static void fill_command(struct order *order, const void *bytes, size_t length,
                         struct db_mqtt_command *command)
{
	json_t *user = json_string(order->user ? order->user : "");

	if (order->user && !db_mqtt_command_user_is_good(user))
		refuse(order, "the user is a text of 1 to 32 bytes");
	if (order->id && (order->id[0] == '\0' || strlen(order->id) > DB_MQTT_ID_MAX))
		refuse(order, "the id is a text of 1 to 64 bytes");
	command->stops = order->stop != NULL;
	/* A stop in a message with mistakes is carried out all the same. */
	if (order->stop && order->wrong) {
		json_decref(user);
		user = json_string("");
		order->wrong = NULL;
	}
	command->message = json_pack("{s:o*, s:s*, s:s*}", "user", user, "token", order->token,
	                             "command",
	                             order->stop ? order->stop :
	                             order->run  ? order->run->what :
	                                           NULL);
	if (!command->message) {
		refuse(order, "out of memory");
		return;
	}
	if (order->id && strlen(order->id) <= DB_MQTT_ID_MAX)
		snprintf(command->id, sizeof(command->id), "%s", order->id);
	else if (!order->stop)
		make_id(order, bytes, length, command->id);
	command->timed = order->ms > 0;
	command->us = order->ms * US_PER_MS;
	command->user = json_string_value(json_object_get(command->message, "user"));
	command->token = json_string_value(json_object_get(command->message, "token"));
	command->name = json_string_value(json_object_get(command->message, "command"));
	if (order->stop)
		return;
	(void)json_object_set(command->message, "arguments",
	                      order->run ? order->arguments : order->written);
	command->arguments = json_object_get(command->message, "arguments");
	if (order->run && json_object_size(order->arguments) == 0)
		command->arguments = NULL;
}

const char *db_mqtt_order_read(const struct db_mqtt_points *points, const json_t *stops,
                               const void *bytes, size_t length, struct db_mqtt_command *command,
                               bool *alive)
{
	struct order order = { .points = points, .stops = stops };
	Spb__FlatPayload *payload;

	*command = (struct db_mqtt_command){ .user = "" };
	*alive = false;
	if (length > DB_MQTT_COMMAND_MAX)
		return "the message is too long";
	payload = spb__flat_payload__unpack(NULL, length, bytes);
	if (!payload)
		return "the message is no payload of Sparkplug";
	order.arguments = json_object();
	order.written = json_object();
	if (order.arguments && order.written) {
		for (size_t i = 0; i < payload->n_metrics; i++)
			take_metric(&order, payload, payload->metrics[i]);
		*alive = order.alive && !order.run && !order.stop &&
		         json_object_size(order.written) == 0;
		if (order.run && json_object_size(order.written) > 0)
			refuse(&order, "either a command or registers are written, not both");
		if (!order.run && json_object_size(order.written) == 0)
			refuse(&order, "there is no command, and nothing to be written");
		if (order.untimed)
			refuse(&order, "neither its metrics nor the payload have a time");
		fill_command(&order, bytes, length, command);
	} else {
		refuse(&order, "out of memory");
	}
	json_decref(order.arguments);
	json_decref(order.written);
	spb__flat_payload__free_unpacked(payload, NULL);
	return order.wrong;
}

bool db_mqtt_order_asks(const void *bytes, size_t length, const char *name)
{
	Spb__FlatPayload *payload = length <= DB_MQTT_COMMAND_MAX ?
	                                    spb__flat_payload__unpack(NULL, length, bytes) :
	                                    NULL;
	bool asks = false;

	for (size_t i = 0; payload && i < payload->n_metrics; i++) {
		const Spb__FlatMetric *metric = payload->metrics[i];
		bool named = metric->name && strcmp(metric->name, name) == 0;

		asks = asks ||
		       (named && metric->value_case == SPB__FLAT_METRIC__VALUE_BOOLEAN_VALUE &&
		        metric->boolean_value);
	}
	if (payload)
		spb__flat_payload__free_unpacked(payload, NULL);
	return asks;
}
