/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/trail.h"
#include "opcua/history.h"
#include "words/value.h"

#include <string.h>

/* Numbers in the first window, and in the largest one: most readers want the latest records. */
#define WIDTH_FIRST 256
#define WIDTH_MOST 16384

/* The latest moment that the service takes, in microseconds since 1970. */
#define TIME_MAX INT64_C(9007199254740992)

static struct db_opcua_history_query range_of(const struct db_opcua_trail *trail)
{
	return (struct db_opcua_history_query){ .start_us = trail->query.start_us,
		                                .end_us = trail->query.end_us };
}

static void begin_window(struct db_opcua_trail *trail)
{
	trail->step = DB_OPCUA_TRAIL_WINDOW;
	trail->window_low = trail->high - trail->width;
	if (trail->window_low < trail->low)
		trail->window_low = trail->low;
	trail->from = trail->window_low;
	(void)json_array_clear(trail->window);
}

/* False: without a last bound all records before are in the range. */
static bool begin_low(struct db_opcua_trail *trail)
{
	struct db_opcua_history_query range = range_of(trail);

	if (db_opcua_history_last_bound(&range) == 0)
		return false;
	trail->step = DB_OPCUA_TRAIL_LOW;
	return true;
}

bool db_opcua_trail_begin(struct db_opcua_trail *trail, const struct db_opcua_trail_query *query)
{
	struct db_opcua_history_query range;

	*trail = (struct db_opcua_trail){ .query = *query,
		                          .from = query->after,
		                          .low = 1,
		                          .high = query->after,
		                          .width = WIDTH_FIRST,
		                          .found = json_array(),
		                          .window = json_array() };
	if (trail->query.most == 0 || trail->query.most > DB_OPCUA_TRAIL_PAGE)
		trail->query.most = DB_OPCUA_TRAIL_PAGE;
	range = range_of(trail);
	if (db_opcua_history_is_backward(&range)) {
		trail->from = 0;
		trail->step = DB_OPCUA_TRAIL_HIGH;
		if (query->after != 0 && !begin_low(trail))
			begin_window(trail);
	}
	return trail->found && trail->window;
}

void db_opcua_trail_clear(struct db_opcua_trail *trail)
{
	json_decref(trail->found);
	json_decref(trail->window);
	*trail = (struct db_opcua_trail){ .found = NULL };
}

json_t *db_opcua_trail_question(const struct db_opcua_trail *trail)
{
	struct db_opcua_history_query range = range_of(trail);
	int64_t since_us = 0;
	json_t *question;

	/* The service gives what is of this moment or later. */
	if (trail->step == DB_OPCUA_TRAIL_FORWARD)
		since_us = range.start_us;
	else if (trail->step == DB_OPCUA_TRAIL_HIGH)
		since_us = db_opcua_history_first_bound(&range) + 1;
	else if (trail->step == DB_OPCUA_TRAIL_LOW)
		since_us = db_opcua_history_last_bound(&range) + 1;
	if (since_us > TIME_MAX)
		since_us = TIME_MAX;
	question = json_pack("{s:I, s:I}", "from", (json_int_t)trail->from, "since_us",
	                     (json_int_t)since_us);
	/* Where a range begins and ends any record tells. */
	if (question && trail->query.drive[0] != '\0' && trail->step != DB_OPCUA_TRAIL_HIGH &&
	    trail->step != DB_OPCUA_TRAIL_LOW)
		(void)json_object_set_new(question, "drive", json_string(trail->query.drive));
	return question;
}

static bool take_forward(struct db_opcua_trail *trail, const json_t *answer)
{
	size_t i;
	json_t *record;

	json_array_foreach(json_object_get(answer, "records"), i, record)
	{
		if (trail->query.end_us != 0 &&
		    db_words_number(record, "time_us") >= trail->query.end_us)
			return true;
		if (json_array_size(trail->found) == trail->query.most) {
			trail->after = db_words_number(record, "number");
			return true;
		}
		(void)json_array_append(trail->found, record);
	}
	trail->from = db_words_number(answer, "next");
	return json_is_true(json_object_get(answer, "over"));
}

/* The number of the first record after a bound, or after the last record if none is. True:
 * `*number` is known. */
static bool find_first(struct db_opcua_trail *trail, const json_t *answer, int64_t *number)
{
	const json_t *first = json_array_get(json_object_get(answer, "records"), 0);

	trail->from = db_words_number(answer, "next");
	if (first)
		*number = db_words_number(first, "number");
	else if (json_is_true(json_object_get(answer, "over")))
		*number = db_words_number(json_object_get(answer, "trail"), "newest") + 1;
	else
		return false;
	trail->from = 0;
	return true;
}

/* True: nothing of the range is left. */
static bool take_window(struct db_opcua_trail *trail, const json_t *answer)
{
	struct db_opcua_history_query range = range_of(trail);
	int64_t first = db_opcua_history_first_bound(&range);
	int64_t last = db_opcua_history_last_bound(&range);
	size_t room = trail->query.most - json_array_size(trail->found);
	size_t i;
	json_t *record;

	trail->from = db_words_number(answer, "next");
	json_array_foreach(json_object_get(answer, "records"), i, record)
	{
		int64_t us = db_words_number(record, "time_us");

		/* The clock may have been set back: numbers tell the order. */
		if (db_words_number(record, "number") >= trail->high || us > first || us <= last)
			continue;
		/* A window may have thousands, of which the latest ones are wanted. */
		if (json_array_size(trail->window) == room)
			(void)json_array_remove(trail->window, 0);
		(void)json_array_append(trail->window, record);
	}
	if (trail->from < trail->high && !json_is_true(json_object_get(answer, "over")))
		return false;
	/* The window is read: the latest of it come first. */
	for (i = json_array_size(trail->window); i > 0; i--) {
		record = json_array_get(trail->window, i - 1);
		(void)json_array_append(trail->found, record);
		if (json_array_size(trail->found) == trail->query.most) {
			trail->after = db_words_number(record, "number");
			return true;
		}
	}
	trail->high = trail->window_low;
	if (trail->width < WIDTH_MOST)
		trail->width *= 4;
	if (trail->high <= trail->low)
		return true;
	begin_window(trail);
	return false;
}

bool db_opcua_trail_take(struct db_opcua_trail *trail, const json_t *answer)
{
	trail->kept = json_is_true(json_object_get(json_object_get(answer, "trail"), "kept"));
	if (!trail->kept)
		return true;
	switch (trail->step) {
	case DB_OPCUA_TRAIL_HIGH:
		if (!find_first(trail, answer, &trail->high))
			return false;
		if (begin_low(trail))
			return false;
		break;
	case DB_OPCUA_TRAIL_LOW:
		if (!find_first(trail, answer, &trail->low))
			return false;
		break;
	case DB_OPCUA_TRAIL_WINDOW:
		return take_window(trail, answer);
	case DB_OPCUA_TRAIL_FORWARD:
	default:
		return take_forward(trail, answer);
	}
	begin_window(trail);
	return trail->high <= trail->low;
}
