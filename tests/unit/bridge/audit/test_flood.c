/* SPDX-License-Identifier: Apache-2.0 */
/* What clients repeat is counted, each client by itself; and the queue of records. */
#include "audit/audit_private.h"

#include "drivebridge/result.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define SECOND DB_NS_PER_S

static struct db_audit_entry refusal_of(unsigned client, enum db_command command)
{
	struct db_audit_entry entry = {
		.kind = DB_AUDIT_COMMAND,
		.result = DB_RESULT_LATCHED,
		.address = { 0xFD, [14] = (uint8_t)(client >> 8), [15] = (uint8_t)client },
		.port = 7,
		.command = (uint16_t)command,
		.drive = "feeder",
	};

	return entry;
}

static unsigned pass_many(struct db_floods *floods, const struct db_audit_entry *entry,
                          unsigned times, db_time now)
{
	struct db_flood *place;
	unsigned passed = 0;

	for (unsigned i = 0; i < times; i++) {
		if (!db_floods_pass(floods, entry, now, &place))
			continue;
		passed++;
		if (place)
			place->last = passed;
	}
	return passed;
}

static void test_same_refusals_are_counted(void **state)
{
	struct db_floods *floods = calloc(1, sizeof(*floods));
	struct db_audit_entry entry = refusal_of(1, DB_CMD_ENABLE);
	struct db_audit_entry count;

	(void)state;
	assert_int_equal(db_floods_next(floods), DB_TIME_NEVER);
	assert_int_equal(pass_many(floods, &entry, 1000, SECOND), DB_FLOOD_FIRST);
	assert_false(db_floods_due(floods, 60 * SECOND, false, &count));
	assert_int_equal(db_floods_next(floods), 61 * SECOND);
	assert_true(db_floods_due(floods, 61 * SECOND, false, &count));
	assert_int_equal(count.kind, DB_AUDIT_REPEATED);
	assert_int_equal(count.count, 1000 - DB_FLOOD_FIRST);
	assert_int_equal(count.of, DB_FLOOD_FIRST);
	assert_int_equal(count.command, DB_CMD_ENABLE);
	assert_int_equal(count.result, DB_RESULT_LATCHED);
	assert_string_equal(count.drive, "feeder");
	assert_memory_equal(count.address, entry.address, sizeof(entry.address));
	assert_false(db_floods_due(floods, 61 * SECOND, false, &count));
	/* As long as it goes on, it is only counted. */
	assert_int_equal(pass_many(floods, &entry, 10, 62 * SECOND), 0);
	assert_true(db_floods_due(floods, 121 * SECOND, false, &count));
	assert_int_equal(count.count, 10);
	/* After a quiet minute it is news. */
	assert_int_equal(pass_many(floods, &entry, 10, 190 * SECOND), DB_FLOOD_FIRST);
	assert_true(db_floods_due(floods, 191 * SECOND, true, &count));
	free(floods);
}

static void test_clients_are_not_merged(void **state)
{
	struct db_floods *floods = calloc(1, sizeof(*floods));
	struct db_audit_entry count;
	unsigned counts = 0;

	(void)state;
	for (unsigned client = 1; client <= 20; client++) {
		struct db_audit_entry entry = refusal_of(client, DB_CMD_ENABLE);

		assert_int_equal(pass_many(floods, &entry, 100 + client, SECOND), DB_FLOOD_FIRST);
	}
	while (db_floods_due(floods, 100 * SECOND, false, &count)) {
		counts++;
		assert_int_equal(count.count, 100 + count.address[15] - DB_FLOOD_FIRST);
	}
	assert_int_equal(counts, 20);
	free(floods);
}

/* Also a client that finds something else to be refused each time. */
static void test_a_client_has_so_many_kinds(void **state)
{
	struct db_floods *floods = calloc(1, sizeof(*floods));
	struct db_audit_entry count;
	uint64_t counted = 0;
	unsigned passed = 0;

	(void)state;
	for (unsigned kind = 0; kind < 1000; kind++) {
		struct db_audit_entry entry = refusal_of(1, (enum db_command)kind);

		passed += pass_many(floods, &entry, 1, SECOND);
	}
	assert_int_equal(passed, DB_FLOOD_CLIENT);
	while (db_floods_due(floods, 100 * SECOND, false, &count))
		counted += count.count;
	assert_int_equal(counted, 1000 - DB_FLOOD_CLIENT);
	free(floods);
}

/* With more clients than places nothing is left out: each count that there is, is told. */
static void test_more_clients_than_places(void **state)
{
	struct db_floods *floods = calloc(1, sizeof(*floods));
	struct db_audit_entry count;
	uint64_t told = 0;

	(void)state;
	for (unsigned client = 1; client <= 1000; client++) {
		struct db_audit_entry entry = refusal_of(client, DB_CMD_ENABLE);

		told += pass_many(floods, &entry, 10, SECOND);
	}
	while (db_floods_due(floods, 2 * SECOND, true, &count))
		told += count.count;
	assert_int_equal(told, 10000);
	free(floods);
}

/* Who has no right has any number of addresses: on this machine a whole network of them. */
static void test_strangers_push_nothing_out(void **state)
{
	struct db_floods *floods = calloc(1, sizeof(*floods));
	struct db_audit_entry entry = { .kind = DB_AUDIT_DENIED, .port = 7, .what = "write" };
	struct db_audit_entry count;
	uint64_t counted = 0;
	unsigned passed = 0;

	(void)state;
	for (unsigned i = 0; i < 1000; i++) {
		const uint8_t network[16] = { [10] = 0xFF,       0xFF,      127, 9,
			                      (uint8_t)(i >> 8), (uint8_t)i };

		db_client_address_of_user(network, 65534, entry.address);
		passed += pass_many(floods, &entry, 1, SECOND);
	}
	assert_int_equal(passed, DB_FLOOD_FIRST);
	passed = 0;
	for (unsigned i = 0; i < 1000; i++) {
		entry = refusal_of(i, DB_CMD_NONE);
		entry.kind = DB_AUDIT_DENIED;
		passed += pass_many(floods, &entry, 1, SECOND);
	}
	assert_int_equal(passed, DB_FLOOD_DENIED - DB_FLOOD_FIRST);
	while (db_floods_due(floods, 61 * SECOND, false, &count))
		counted += count.count;
	assert_int_equal(counted, 2000 - DB_FLOOD_DENIED);
	/* What clients with the right are refused is not counted with that. */
	entry = refusal_of(7, DB_CMD_ENABLE);
	assert_int_equal(pass_many(floods, &entry, 1, 61 * SECOND), 1);
	free(floods);
}

static void test_queue_cuts_no_character(void **state)
{
	struct db_audit_queue *queue = calloc(1, sizeof(*queue));
	struct db_audit_taken *taken = malloc(sizeof(*taken));
	struct db_audit_entry entry = { .kind = DB_AUDIT_LOGIN };
	char text[900] = "";

	(void)state;
	/* Each has three bytes, and 511 are 170 of them and one byte. */
	for (unsigned i = 0; i < 250; i++)
		strcat(text, "\xE9\xA9\xB1");
	for (unsigned more = 0; more < 3; more++) {
		entry.text = text + 3 - more;
		memmove(text, more == 1 ? "abc" : more == 2 ? "abc" : text, 3);
		assert_true(db_audit_queue_put(queue, &entry));
		assert_true(db_audit_queue_take(queue, taken));
		assert_int_equal(strlen(taken->entry.text) % 3, more == 0 ? 0 : more % 3);
		assert_true(strlen(taken->entry.text) > 500);
	}
	free(taken);
	free(queue);
}

static void test_queue_keeps_all_and_their_order(void **state)
{
	struct db_audit_queue *queue = calloc(1, sizeof(*queue));
	struct db_audit_taken *taken = malloc(sizeof(*taken));
	struct db_audit_value values[DB_SETTINGS_MAX];
	uint64_t in = 0;
	uint64_t out = 0;
	char text[600];

	(void)state;
	for (unsigned i = 0; i < DB_SETTINGS_MAX; i++)
		values[i] = (struct db_audit_value){ .name = "acc", .new.u = i, .known = true };
	srand(1);
	for (unsigned round = 0; round < 20000; round++) {
		size_t length = (size_t)rand() % sizeof(text);
		struct db_audit_entry entry = {
			.number = in + 1,
			.drive = "feeder",
			.text = text,
			.values = values,
			.value_count = (size_t)rand() % 8 ? 0 : (size_t)rand() % DB_SETTINGS_MAX,
		};

		memset(text, 'x', length);
		text[length > 0 ? length - 1 : 0] = '\0';
		/* It is full at times, and empty at others. */
		if (rand() % 100 < (round / 500 % 2 ? 70 : 30)) {
			in += db_audit_queue_put(queue, &entry);
			continue;
		}
		if (!db_audit_queue_take(queue, taken)) {
			assert_int_equal(in, out);
			continue;
		}
		assert_int_equal(taken->entry.number, ++out);
		assert_string_equal(taken->entry.drive, "feeder");
		assert_string_equal(taken->entry.user, "");
		assert_true(strspn(taken->entry.text, "x") == strlen(taken->entry.text));
		for (size_t i = 0; i < taken->entry.value_count; i++)
			assert_int_equal(taken->entry.values[i].new.u, i);
	}
	while (db_audit_queue_take(queue, taken))
		assert_int_equal(taken->entry.number, ++out);
	assert_int_equal(in, out);
	assert_true(in > 5000);
	free(queue);
	free(taken);
}

static void test_full_queue_takes_nothing(void **state)
{
	struct db_audit_queue *queue = calloc(1, sizeof(*queue));
	struct db_audit_taken *taken = malloc(sizeof(*taken));
	struct db_audit_entry entry = { .drive = "feeder" };
	unsigned count = 0;

	(void)state;
	while (db_audit_queue_put(queue, &entry))
		count++;
	assert_true(count > 200);
	assert_false(db_audit_queue_put(queue, &entry));
	assert_true(db_audit_queue_take(queue, taken));
	assert_true(db_audit_queue_put(queue, &entry));
	while (db_audit_queue_take(queue, taken))
		count--;
	assert_int_equal(count, 0);
	free(queue);
	free(taken);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_same_refusals_are_counted),
		cmocka_unit_test(test_clients_are_not_merged),
		cmocka_unit_test(test_a_client_has_so_many_kinds),
		cmocka_unit_test(test_more_clients_than_places),
		cmocka_unit_test(test_strangers_push_nothing_out),
		cmocka_unit_test(test_queue_cuts_no_character),
		cmocka_unit_test(test_queue_keeps_all_and_their_order),
		cmocka_unit_test(test_full_queue_takes_nothing),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
