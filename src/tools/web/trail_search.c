/* SPDX-License-Identifier: Apache-2.0 */
#include "web/trail_search.h"
#include "web/trail.h"
#include "web/trail_filter.h"

#include <stdlib.h>

/* Above any number of a record. */
#define NUMBER_MAX ((json_int_t)9007199254740991)

/* Numbers in the first window, and in the largest one, which takes a fraction of a second. */
#define WIDTH_FIRST 256
#define WIDTH_MOST 16384

/* No further window is begun after this time. */
#define WINDOWS_WITHIN (2 * DB_NS_PER_S)
#define ANSWER_WITHIN (30 * DB_NS_PER_S)

struct search {
	struct db_web_trail_reader reader;
	struct db_web_request *request;
	struct db_web_trail_filter filter;
	void (*take)(struct search *search, const json_t *page);
	json_int_t low; /* the window: records from this number on, and below `high` */
	json_int_t high;
	json_int_t width;
	json_t *window; /* the latest ones that are wanted, oldest first */
	json_t *found;  /* of all windows before, newest first */
	json_t *trail;
	bool kept;
	db_time begun;
};

static void end_search(void *job)
{
	struct search *search = job;

	db_web_trail_leave(search->request->server, &search->reader);
	json_decref(search->window);
	json_decref(search->found);
	json_decref(search->trail);
	free(search);
}

static void answer(struct search *search, bool over)
{
	struct db_web_request *request = search->request;

	db_web_trail_leave(request->server, &search->reader);
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:O, s:I, s:b, s:O?}", "records", search->found, "before",
	                                search->high, "over", over, "trail", search->trail));
}

/* --- windows ---------------------------------------------------------------------------------- */

static void begin_window(struct search *search)
{
	search->low = search->high > search->width ? search->high - search->width : 1;
	db_web_trail_ask(search->request->server,
	                 db_web_trail_filter_query(&search->filter, search->low));
}

static void take_window(struct search *search, const json_t *page)
{
	size_t room = DB_WEB_TRAIL_PAGE - json_array_size(search->found);
	json_int_t next = json_integer_value(json_object_get(page, "next"));
	json_t *record;
	size_t count;
	size_t i;

	json_array_foreach(json_object_get(page, "records"), i, record)
	{
		if (json_integer_value(json_object_get(record, "number")) >= search->high ||
		    !db_web_trail_filter_has(&search->filter, record))
			continue;
		if (json_array_size(search->window) == room)
			(void)json_array_remove(search->window, 0);
		(void)json_array_append(search->window, record);
	}
	if (next < search->high && !json_is_true(json_object_get(page, "over"))) {
		db_web_trail_ask(search->request->server,
		                 db_web_trail_filter_query(&search->filter, next));
		return;
	}
	/* The window is read: the latest of it come first. */
	count = json_array_size(search->window);
	for (i = count; i-- > 0;) {
		record = json_array_get(search->window, i);
		db_web_trail_describe(record);
		(void)json_array_append(search->found, record);
	}
	/* It may have more than there was room for. */
	search->high = count > 0 && count == room ?
	                       json_integer_value(json_object_get(json_array_get(search->window, 0),
	                                                          "number")) :
	                       search->low;
	(void)json_array_clear(search->window);
	if (search->width < WIDTH_MOST)
		search->width *= 4;
	if (search->high <= 1 || json_array_size(search->found) == DB_WEB_TRAIL_PAGE ||
	    db_client_now() - search->begun > WINDOWS_WITHIN)
		answer(search, search->high <= 1);
	else
		begin_window(search);
}

/* --- the newest record that is wanted --------------------------------------------------------- */

static void begin_windows(struct search *search)
{
	search->take = take_window;
	if (!search->kept || search->high <= 1)
		answer(search, true);
	else
		begin_window(search);
}

/* The first record after the wanted time, in the order of their numbers. */
static void take_end(struct search *search, const json_t *page)
{
	const json_t *first = json_array_get(json_object_get(page, "records"), 0);

	if (first)
		search->high = json_integer_value(json_object_get(first, "number"));
	if (first || json_is_true(json_object_get(page, "over")))
		begin_windows(search);
	else
		db_web_trail_ask(search->request->server,
		                 json_pack("{s:O, s:I}", "from", json_object_get(page, "next"),
		                           "since_us", search->filter.until_us + 1));
}

static void take_newest(struct search *search, const json_t *page)
{
	(void)page;
	search->high = json_integer_value(json_object_get(search->trail, "newest")) + 1;
	if (search->filter.until_us == 0 || !search->kept) {
		begin_windows(search);
		return;
	}
	search->take = take_end;
	db_web_trail_ask(search->request->server, json_pack("{s:i, s:I}", "from", 0, "since_us",
	                                                    search->filter.until_us + 1));
}

/* --- a search --------------------------------------------------------------------------------- */

static void take_turn(struct db_web_trail_reader *reader)
{
	struct search *search = (struct search *)(void *)reader;

	search->begun = db_client_now();
	if (search->take == take_newest)
		db_web_trail_ask(search->request->server,
		                 json_pack("{s:I, s:b}", "from", NUMBER_MAX, "verify", true));
	else
		begin_window(search);
}

static void take_page(struct db_web_trail_reader *reader, json_t *page,
                      const struct db_client_error *error)
{
	struct search *search = (struct search *)(void *)reader;
	struct db_web_request *request = search->request;

	/* A request that is answered goes on until its connection knows. */
	if (error || request->status != 0) {
		db_web_trail_leave(request->server, reader);
		if (error)
			db_web_request_fail(request, error);
		return;
	}
	json_decref(search->trail);
	search->trail = json_incref(json_object_get(page, "trail"));
	search->kept = json_is_true(json_object_get(search->trail, "kept"));
	search->take(search, page);
}

void db_web_trail_search(struct db_web_request *request)
{
	json_t *before = json_object_get(request->parameters, "before");
	struct search *search = calloc(1, sizeof(*search));

	if (search) {
		search->window = json_array();
		search->found = json_array();
	}
	if (!search || !search->window || !search->found) {
		free(search);
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	*search = (struct search){
		.reader = { .turn = take_turn, .take = take_page },
		.request = request,
		.filter = { .grant = request->grant },
		.take = json_integer_value(before) > 0 ? take_window : take_newest,
		.high = json_integer_value(before),
		.width = WIDTH_FIRST,
		.window = search->window,
		.found = search->found,
	};
	request->job = search;
	request->end_job = end_search;
	if (!db_web_trail_filter_read(&search->filter, request->parameters) ||
	    (before &&
	     (!json_is_integer(before) || search->high < 0 || search->high > NUMBER_MAX))) {
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "right is {\"before\": a number, \"who\", \"drive\", "
		                      "\"kind\", \"through\", \"text\": up to %d bytes, "
		                      "\"since_us\", \"until_us\": times, \"refused\": true}",
		                      DB_WEB_TRAIL_TEXT - 1);
		return;
	}
	request->answer_by = db_client_now() + ANSWER_WITHIN;
	db_web_trail_enter(request->server, &search->reader);
}
