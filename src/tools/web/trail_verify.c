/* SPDX-License-Identifier: Apache-2.0 */
#include "web/trail_verify.h"
#include "web/call.h"
#include "web/trail.h"

#include <stdlib.h>

/* The largest trail, on a small and busy gateway. */
#define ANSWER_WITHIN (300 * DB_NS_PER_S)

/* Places that the answer names. */
#define BROKEN_MOST 50

struct verification {
	struct db_web_trail_reader reader;
	struct db_web_request *request;
	json_int_t checked;
	json_int_t more_broken;
	json_t *broken;
};

static void end_verification(void *job)
{
	struct verification *verification = job;

	db_web_trail_leave(verification->request->server, &verification->reader);
	json_decref(verification->broken);
	free(verification);
}

static void take_turn(struct db_web_trail_reader *reader)
{
	const struct verification *verification = (struct verification *)(void *)reader;

	db_web_trail_ask(verification->request->server,
	                 json_pack("{s:i, s:b}", "from", 0, "verify", true));
}

static void take_page(struct db_web_trail_reader *reader, json_t *page,
                      const struct db_client_error *error)
{
	struct verification *verification = (struct verification *)(void *)reader;
	struct db_web_request *request = verification->request;
	json_t *broken;
	size_t i;

	if (!error && request->status == 0) {
		verification->checked += json_integer_value(json_object_get(page, "checked"));
		verification->more_broken += json_integer_value(
			json_object_get(page, "more_broken"));
		json_array_foreach(json_object_get(page, "broken"), i, broken)
		{
			if (json_array_size(verification->broken) < BROKEN_MOST)
				(void)json_array_append(verification->broken, broken);
			else
				verification->more_broken++;
		}
		if (!json_is_true(json_object_get(page, "over"))) {
			db_web_trail_ask(
				request->server,
				json_pack("{s:I, s:b}", "from",
			                  json_integer_value(json_object_get(page, "next")),
			                  "verify", true));
			return;
		}
	}
	db_web_trail_leave(request->server, reader);
	if (error)
		db_web_request_fail(request, error);
	else
		db_web_request_answer(request, MHD_HTTP_OK,
		                      json_pack("{s:I, s:O, s:I, s:O?}", "checked",
		                                verification->checked, "broken",
		                                verification->broken, "more_broken",
		                                verification->more_broken, "trail",
		                                json_object_get(page, "trail")));
}

void db_web_trail_verify(struct db_web_request *request)
{
	struct verification *verification = calloc(1, sizeof(*verification));

	if (verification)
		verification->broken = json_array();
	if (!verification || !verification->broken) {
		free(verification);
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	verification->reader.turn = take_turn;
	verification->reader.take = take_page;
	verification->request = request;
	request->job = verification;
	request->end_job = end_verification;
	request->answer_by = db_client_now() + ANSWER_WITHIN;
	db_web_log_action(request, "verifies the audit trail", NULL);
	db_web_trail_enter(request->server, &verification->reader);
}
