/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/trouble.h"

#include "mqtt/moment.h"

/* Null for 0, which means never. */
static json_t *write_moment(const json_t *us)
{
	return json_integer_value(us) == 0 ? json_null() :
	                                     db_mqtt_moment_describe(json_integer_value(us));
}

json_t *db_mqtt_trouble_write_event(json_t *event)
{
	json_t *copy = json_copy(event);

	(void)json_object_del(copy, "number");
	(void)json_object_del(copy, "time_us");
	(void)json_object_set_new(copy, "time", write_moment(json_object_get(event, "time_us")));
	return copy;
}

json_t *db_mqtt_trouble_write(const json_t *record)
{
	static const char *const words[] = { "cause", "need", "detail", "advice", "errors" };
	json_t *event = json_object_get(record, "event");
	json_t *object = json_object();

	for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
		json_t *word = json_object_get(record, words[i]);

		if (word)
			(void)json_object_set(object, words[i], word);
		else if (!record && i < 4)
			(void)json_object_set_new(object, words[i], json_null());
	}
	(void)json_object_set_new(object, "since",
	                          write_moment(json_object_get(record, "since_us")));
	(void)json_object_set_new(object, "event",
	                          json_is_object(event) ? db_mqtt_trouble_write_event(event) :
	                                                  json_null());
	return object;
}
