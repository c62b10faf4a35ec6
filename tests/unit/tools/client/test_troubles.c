/* SPDX-License-Identifier: Apache-2.0 */
#include "client/troubles.h"
#include "words/value.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdlib.h>
#include <cmocka.h>

static json_t *parse(const char *text)
{
	json_t *json = json_loads(text, 0, NULL);

	assert_non_null(json);
	return json;
}

static void take(struct db_client_troubles *troubles, const char *text)
{
	json_t *answer = parse(text);

	db_client_troubles_take(troubles, answer);
	json_decref(answer);
}

static const char *cause_of(const json_t *records, const char *name)
{
	return db_words_text(json_object_get(records, name), "cause");
}

static void what_did_not_change_is_kept(void **state)
{
	struct db_client_troubles troubles = { .told = false };

	(void)state;
	take(&troubles,
	     "{\"drives\": [{\"drive\": \"a\", \"cause\": \"late\"}, {\"drive\": \"b\", \"cause\": \"none\"}],"
	     "\"buses\": [{\"bus\": \"line\", \"cause\": \"none\"}],"
	     "\"configuration\": {\"cause\": \"refused\"}, \"well\": false}");
	assert_true(troubles.told);
	assert_false(troubles.well);
	take(&troubles,
	     "{\"drives\": [{\"drive\": \"a\", \"cause\": \"none\"}, {\"cause\": \"of nobody\"}], \"buses\": [],"
	     "\"configuration\": {\"cause\": \"none\"}, \"well\": true}");
	assert_true(troubles.well);
	assert_string_equal(cause_of(troubles.drives, "a"), "none");
	assert_string_equal(cause_of(troubles.drives, "b"), "none");
	assert_string_equal(cause_of(troubles.buses, "line"), "none");
	assert_string_equal(db_words_text(troubles.configuration, "cause"), "none");
	db_client_troubles_clear(&troubles);
	assert_false(troubles.told);
	assert_null(troubles.drives);
	/* A service that answers anything does no harm. */
	take(&troubles, "{\"drives\": 3, \"buses\": [4], \"configuration\": null}");
	assert_false(troubles.well);
	db_client_troubles_clear(&troubles);
}

static void a_record_in_words(void **state)
{
	static const struct {
		const char *record;
		enum db_client_need need;
		const char *words;
	} cases[] = {
		{ "{\"cause\": \"none\", \"need\": \"nothing\", \"detail\": \"\"}", DB_CLIENT_FINE,
		  "" },
		{ "{\"cause\": \"params_unsaved\", \"need\": \"hint\"}", DB_CLIENT_HINT,
		  "params_unsaved" },
		{ "{\"cause\": \"fault\", \"need\": \"act\", \"detail\": \"over_current\"}",
		  DB_CLIENT_ACT, "over_current" },
		{ "{\"cause\": \"port\", \"need\": \"act\", \"detail\": \"Permission denied\"}",
		  DB_CLIENT_ACT, "port (Permission denied)" },
		{ "{\"cause\": \"aside\", \"need\": \"look\", \"detail\": \"\"}", DB_CLIENT_LOOK,
		  "aside" },
		{ "{\"cause\": \"of_tomorrow\", \"need\": \"unheard_of\"}", DB_CLIENT_ACT,
		  "of_tomorrow" },
	};
	char text[DB_CLIENT_TROUBLE_WORDS_MAX];

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		json_t *record = parse(cases[i].record);

		assert_int_equal(db_client_trouble_need(record), cases[i].need);
		db_client_trouble_words(record, text);
		assert_string_equal(text, cases[i].words);
		json_decref(record);
	}
	assert_int_equal(db_client_trouble_need(NULL), DB_CLIENT_FINE);
	db_client_trouble_words(NULL, text);
	assert_string_equal(text, "");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_did_not_change_is_kept),
		cmocka_unit_test(a_record_in_words),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
