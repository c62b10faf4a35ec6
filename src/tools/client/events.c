/* SPDX-License-Identifier: Apache-2.0 */
#include "client/events.h"

static int64_t integer_of(const json_t *event, const char *key)
{
	return json_integer_value(json_object_get(event, key));
}

static size_t count_seen(const struct db_client_events *seen, const json_t *events)
{
	size_t i;
	const json_t *event;

	json_array_foreach(events, i, event)
	{
		if (seen->number == 0 && integer_of(event, "time_us") >= seen->from_us)
			return i;
		/* After a restart of the service this number belongs to another event, or to none.
		 */
		if (seen->number > 0 && integer_of(event, "number") == seen->number &&
		    integer_of(event, "time_us") == seen->time_us)
			return i + 1;
	}
	return seen->number == 0 ? i : 0;
}

size_t db_client_events_skip(struct db_client_events *seen, const json_t *events)
{
	const json_t *last = json_array_get(events, json_array_size(events) - 1);
	size_t count = seen->connected ? 0 : count_seen(seen, events);

	seen->connected = true;
	if (last) {
		seen->number = integer_of(last, "number");
		seen->time_us = integer_of(last, "time_us");
	}
	return count;
}
