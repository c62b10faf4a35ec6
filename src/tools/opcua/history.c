/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/history.h"

#include <string.h>

const char *db_opcua_history_field(const char *reg)
{
	/* Only what means the same in both: counters count since the drive was added, and the
	 * service keeps how often something was in an interval. */
	static const char *const fields[][2] = {
		{ "round_trip_mean_us", "round_trip_us" },
		{ "round_trip_max_us", "round_trip_longest_us" },
		{ "temperature", "hottest" },
	};

	for (size_t i = 0; i < sizeof(fields) / sizeof(fields[0]); i++) {
		if (strcmp(fields[i][0], reg) == 0)
			return fields[i][1];
	}
	return NULL;
}

bool db_opcua_history_is_valid(const struct db_opcua_history_query *query)
{
	return (query->start_us != 0) + (query->end_us != 0) + (query->most != 0) >= 2;
}

bool db_opcua_history_is_backward(const struct db_opcua_history_query *query)
{
	return query->start_us == 0 || (query->end_us != 0 && query->end_us < query->start_us);
}

int64_t db_opcua_history_first_bound(const struct db_opcua_history_query *query)
{
	return query->start_us != 0 ? query->start_us : query->end_us;
}

int64_t db_opcua_history_last_bound(const struct db_opcua_history_query *query)
{
	return query->start_us != 0 ? query->end_us : 0;
}

int64_t db_opcua_history_since(const struct db_opcua_history_query *query)
{
	int64_t first = db_opcua_history_is_backward(query) ? db_opcua_history_last_bound(query) :
	                                                      query->start_us;

	/* A value next to a bound may be long before it, when the service did not run. The service
	 * leaves out what ended at the moment that it is asked for. */
	return query->bounds || first == 0 ? 0 : first - 1;
}

/* Those that have the field, in the order of reading. */
struct walk {
	const json_t *values;
	const char *field;
	bool backward;
	size_t place; /* values that were looked at */
};

static bool next_value(struct walk *walk, struct db_opcua_history_value *value)
{
	size_t count = json_array_size(walk->values);

	while (walk->place < count) {
		size_t at = walk->backward ? count - 1 - walk->place : walk->place;
		const json_t *told = json_array_get(walk->values, at);
		const json_t *number = json_object_get(told, walk->field);

		walk->place++;
		/* Of a round trip 0 means that there was no answer. */
		if (!json_is_number(number) ||
		    (json_number_value(number) == 0.0 && strcmp(walk->field, "hottest") != 0))
			continue;
		*value = (struct db_opcua_history_value){
			.us = json_integer_value(json_object_get(told, "end_us")),
			.number = json_number_value(number),
		};
		return true;
	}
	return false;
}

/* A value, unless the page is full: then the next one begins here. */
static bool add(const struct db_opcua_history_query *query, struct db_opcua_history_page *page,
                struct db_opcua_history_value value)
{
	size_t most = query->most > 0 && query->most < DB_OPCUA_HISTORY_PAGE ?
	                      query->most :
	                      DB_OPCUA_HISTORY_PAGE;

	if (page->count == most) {
		page->after_us = page->list[most - 1].us;
		return false;
	}
	page->list[page->count++] = value;
	return true;
}

void db_opcua_history_pick(const struct db_opcua_history_query *query, const json_t *values,
                           const char *field, struct db_opcua_history_page *page)
{
	bool backward = db_opcua_history_is_backward(query);
	int64_t sign = backward ? -1 : 1;
	int64_t first = db_opcua_history_first_bound(query) * sign;
	int64_t last = db_opcua_history_last_bound(query) * sign;
	bool ends = db_opcua_history_last_bound(query) != 0;
	bool begun = query->after_us != 0 || !query->bounds;
	struct walk walk = { .values = values, .field = field, .backward = backward };
	struct db_opcua_history_value before = { .us = query->start_us ? query->start_us :
		                                                         query->end_us,
		                                 .missing = true };
	struct db_opcua_history_value value;

	page->count = 0;
	page->after_us = 0;
	while (next_value(&walk, &value)) {
		int64_t at = value.us * sign;

		if (at < first) {
			before = value;
			continue;
		}
		/* The bound itself is there, or the value before it. */
		if (!begun && at != first && !add(query, page, before))
			return;
		begun = true;
		if (query->after_us != 0 && at <= query->after_us * sign)
			continue;
		if (ends && at >= last) {
			if (query->bounds)
				(void)add(query, page, value);
			return;
		}
		if (!add(query, page, value))
			return;
	}
	if (!begun && !add(query, page, before))
		return;
	if (query->bounds && ends)
		(void)add(query, page,
		          (struct db_opcua_history_value){ .us = db_opcua_history_last_bound(query),
		                                           .missing = true });
}
