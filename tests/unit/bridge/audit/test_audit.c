/* SPDX-License-Identifier: Apache-2.0 */
/* The audit trail with its thread: what is posted is read, also after a start. */
#include "audit/audit_private.h"

#include "drivebridge/command_table.h"
#include "drivebridge/result.h"
#include "log/log_private.h"

#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define OWNER 7
#define NOW DB_NS_PER_S

static char folder[64];
static struct db_log *logged;

static void write_nowhere(void *context, const struct db_log_record *record)
{
	(void)context;
	(void)record;
}

static int begin(void **state)
{
	(void)state;
	strcpy(folder, "/tmp/drivebridge-audit-XXXXXX");
	return mkdtemp(folder) && db_log_new_to(write_nowhere, folder, &logged) == 0 ? 0 : -1;
}

static int end(void **state)
{
	char command[128];

	(void)state;
	db_log_free(logged);
	snprintf(command, sizeof(command), "rm -rf %s", folder);
	return system(command);
}

/* Entries of the past. */
struct past {
	unsigned count;
	struct db_audit_entry last;
	char drive[32];
	char param[32];
};

static void take_past(void *context, const struct db_audit_entry *entry)
{
	struct past *past = context;

	past->count++;
	past->last = *entry;
	snprintf(past->drive, sizeof(past->drive), "%s", entry->drive);
	if (entry->value_count > 0)
		snprintf(past->param, sizeof(past->param), "%s", entry->values[0].name);
}

static struct db_audit *open_audit_in(const char *path, struct past *past)
{
	struct db_audit *audit = NULL;
	const struct db_audit_setup setup = {
		.log = { .log = logged, .level = DB_LOG_INFO },
		.folder = path,
		.on = true,
		.mib = 1,
		.past = past ? take_past : NULL,
		.context = past,
	};

	assert_int_equal(db_audit_new(&setup, NOW, &audit), 0);
	return audit;
}

static struct db_audit *open_audit(struct past *past)
{
	return open_audit_in(folder, past);
}

static struct db_audit_entry command_of(const char *drive, int32_t position)
{
	return (struct db_audit_entry){
		.kind = DB_AUDIT_COMMAND,
		.result = DB_RESULT_PENDING,
		.time_us = UINT64_C(1700000000000000),
		.address = { [10] = 0xFF, 0xFF, 192, 168, 10, 5 },
		.port = 51234,
		.drive = drive,
		.command = DB_CMD_MOVE_ABSOLUTE,
		.id = 17,
		.args = { .target_position = position, .target_velocity = 12.5f },
	};
}

/* All records that the query wants; *checked: lines looked at. */
static json_t *read_records(struct db_audit *audit, struct db_audit_query query, uint64_t *checked)
{
	json_t *all = json_array();
	struct db_audit_page page = { .over = false };

	*checked = 0;
	while (!page.over) {
		char *text = NULL;
		json_t *records;

		assert_true(db_audit_ask(audit, OWNER, &query));
		assert_false(db_audit_ask(audit, OWNER + 1, &query));
		while (!db_audit_take(audit, OWNER, &page))
			usleep(200);
		assert_int_equal(page.broken_count, 0);
		assert_true(asprintf(&text, "[%.*s]", (int)page.length,
		                     page.records ? page.records : "") > 0);
		records = json_loads(text, 0, NULL);
		assert_non_null(records);
		json_array_extend(all, records);
		json_decref(records);
		free(text);
		free(page.records);
		assert_true(page.next >= query.from);
		query.from = page.next;
		*checked += page.checked;
	}
	return all;
}

static const char *text_of(const json_t *records, size_t place, const char *key)
{
	const json_t *record = json_array_get(records, place);
	const char *text = json_string_value(json_object_get(record, key));

	return text ? text : "";
}

static void test_posted_is_read(void **state)
{
	struct db_audit *audit = open_audit(NULL);
	struct db_audit_entry entry = command_of("feeder", 6400);
	uint64_t checked;
	uint32_t number;
	json_t *records;

	(void)state;
	number = db_audit_post(audit, &entry, NOW);
	assert_int_equal(number, 1);
	db_audit_end(audit, number, "feeder", DB_RESULT_OK, 5000, entry.time_us);
	entry = command_of("lift", 1);
	entry.result = DB_RESULT_LATCHED;
	assert_int_equal(db_audit_post(audit, &entry, NOW), 3);
	records = read_records(audit, (struct db_audit_query){ .from = 0 }, &checked);
	assert_int_equal(json_array_size(records), 3);
	assert_int_equal(checked, 4); /* with the head */
	assert_string_equal(text_of(records, 0, "what"), "move_absolute");
	assert_string_equal(text_of(records, 0, "who"), "192.168.10.5 port 51234");
	assert_string_equal(text_of(records, 0, "result"), "pending");
	assert_int_equal(json_integer_value(json_object_get(
				 json_object_get(json_array_get(records, 0), "arguments"),
				 "target_position")),
	                 6400);
	/* An end says whose it is. */
	assert_string_equal(text_of(records, 1, "kind"), "end");
	assert_string_equal(text_of(records, 1, "drive"), "feeder");
	assert_string_equal(text_of(records, 1, "who"), "192.168.10.5 port 51234");
	json_decref(records);
	/* Only of a drive, only of a client, only what was refused. */
	records = read_records(audit, (struct db_audit_query){ .drive = "feeder" }, &checked);
	assert_int_equal(json_array_size(records), 2);
	json_decref(records);
	records = read_records(audit, (struct db_audit_query){ .who = "10.5 PORT" }, &checked);
	assert_int_equal(json_array_size(records), 3);
	json_decref(records);
	records = read_records(audit, (struct db_audit_query){ .who = "10.6" }, &checked);
	assert_int_equal(json_array_size(records), 0);
	json_decref(records);
	records = read_records(audit, (struct db_audit_query){ .refused = true }, &checked);
	assert_int_equal(json_array_size(records), 1);
	assert_string_equal(text_of(records, 0, "drive"), "lift");
	json_decref(records);
	records = read_records(audit, (struct db_audit_query){ .from = 3 }, &checked);
	assert_int_equal(json_array_size(records), 1);
	json_decref(records);
	records = read_records(audit, (struct db_audit_query){ .since_us = entry.time_us + 1 },
	                       &checked);
	assert_int_equal(json_array_size(records), 0);
	json_decref(records);
	records = read_records(audit, (struct db_audit_query){ .verify = true }, &checked);
	assert_int_equal(json_array_size(records), 0);
	assert_int_equal(checked, 4);
	json_decref(records);
	db_audit_free(audit);
}

/* A disk that is mounted late: the files go on with their numbers and say what they lack. The time
 * of this test is long before the thread's, so that the next try is due at once. */
static void test_a_folder_that_comes_later(void **state)
{
	struct db_audit *audit = open_audit(NULL);
	struct db_audit_entry entry = command_of("feeder", 6400);
	struct db_audit_state now_state;
	char elsewhere[sizeof(folder) + 8];
	uint64_t checked;
	json_t *records;

	(void)state;
	for (unsigned i = 0; i < 5; i++)
		(void)db_audit_post(audit, &entry, NOW);
	assert_true(db_audit_free(audit));
	snprintf(elsewhere, sizeof(elsewhere), "%s.away", folder);
	assert_int_equal(rename(folder, elsewhere), 0);
	assert_int_equal(close(open(folder, O_CREAT | O_WRONLY, 0600)), 0);
	audit = open_audit(NULL);
	db_audit_state(audit, &now_state);
	assert_false(now_state.kept);
	assert_string_not_equal(now_state.trouble, "");
	assert_int_equal(db_audit_post(audit, &entry, NOW), 1);
	assert_int_equal(db_audit_post(audit, &entry, NOW), 2);
	/* At once: the thread would make a folder where there is none. */
	assert_int_equal(renameat2(AT_FDCWD, elsewhere, AT_FDCWD, folder, RENAME_EXCHANGE), 0);
	assert_int_equal(unlink(elsewhere), 0);
	for (unsigned i = 0; i < 10000 && !now_state.kept; i++) {
		usleep(1000);
		/* Wakes the thread. */
		db_audit_change(audit, true, 1);
		db_audit_state(audit, &now_state);
	}
	assert_true(now_state.kept);
	assert_string_equal(now_state.trouble, "");
	/* 6 is the record of what is missing. */
	assert_int_equal(now_state.newest, 6);
	entry.drive = "lift";
	assert_int_equal(db_audit_post(audit, &entry, NOW), 7);
	records = read_records(audit, (struct db_audit_query){ .from = 6 }, &checked);
	assert_int_equal(json_array_size(records), 2);
	assert_string_equal(text_of(records, 0, "kind"), "lost");
	assert_int_equal(json_integer_value(json_object_get(json_array_get(records, 0), "count")),
	                 2);
	assert_string_equal(text_of(records, 1, "drive"), "lift");
	json_decref(records);
	assert_true(db_audit_free(audit));
}

/* However much else happens until a long motion ends, its end says whose it was. */
static void test_a_long_motion_has_an_owner(void **state)
{
	struct db_audit *audit = open_audit(NULL);
	struct db_audit_entry entry = command_of("feeder", 6400);
	uint64_t checked;
	uint32_t motion;
	json_t *records;

	(void)state;
	motion = db_audit_post(audit, &entry, NOW);
	entry = command_of("lift", 1);
	for (unsigned i = 0; i < 300; i++) {
		uint32_t number = db_audit_post(audit, &entry, NOW);

		db_audit_end(audit, number, "lift", DB_RESULT_OK, 1, entry.time_us);
		/* Not faster than they are written: then some would be lost. */
		if (i % 16 == 0)
			json_decref(read_records(audit, (struct db_audit_query){ .from = 10000 },
			                         &checked));
	}
	db_audit_end(audit, motion, "feeder", DB_RESULT_CANCELLED, 1, entry.time_us);
	records = read_records(audit, (struct db_audit_query){ .drive = "feeder" }, &checked);
	assert_int_equal(json_array_size(records), 2);
	assert_string_equal(text_of(records, 1, "result"), "cancelled");
	assert_string_equal(text_of(records, 1, "what"), "move_absolute");
	assert_string_equal(text_of(records, 1, "who"), "192.168.10.5 port 51234");
	json_decref(records);
	/* Read from behind its begin, it is nobody's rather than the service's. */
	records = read_records(audit, (struct db_audit_query){ .from = 602 }, &checked);
	assert_int_equal(json_array_size(records), 1);
	assert_string_equal(text_of(records, 0, "drive"), "feeder");
	json_decref(records);
	assert_true(db_audit_free(audit));
}

static void test_past_is_told(void **state)
{
	const struct db_audit_value value = {
		.name = "acc",
		.type = DB_F32,
		.new.f = 640.5f,
		.known = false,
	};
	struct db_audit_entry entry = command_of("feeder", -3);
	struct db_audit *audit = open_audit(NULL);
	struct past past = { 0 };

	(void)state;
	(void)db_audit_post(audit, &entry, NOW);
	db_audit_free(audit);
	audit = open_audit(&past);
	assert_int_equal(past.count, 1);
	assert_string_equal(past.drive, "feeder");
	assert_int_equal(past.last.kind, DB_AUDIT_COMMAND);
	assert_int_equal(past.last.command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(past.last.args.target_position, -3);
	assert_true(past.last.args.target_velocity > 12.4f &&
	            past.last.args.target_velocity < 12.6f);
	assert_int_equal(past.last.id, 17);
	assert_int_equal(past.last.port, 51234);
	assert_memory_equal(past.last.address, entry.address, sizeof(entry.address));
	entry = (struct db_audit_entry){
		.kind = DB_AUDIT_WRITE,
		.result = DB_RESULT_OK,
		.drive = "lift",
		.values = &value,
		.value_count = 1,
	};
	assert_int_equal(db_audit_post(audit, &entry, NOW), 2);
	db_audit_free(audit);
	memset(&past, 0, sizeof(past));
	audit = open_audit(&past);
	assert_int_equal(past.count, 2);
	assert_string_equal(past.param, "acc");
	db_audit_free(audit);
}

/* Clients on this machine and sessions are found again by what the record has of them. */
static void test_clients_are_found_again(void **state)
{
	const struct db_client_session session = { .user = 998, .actor = 77, .named = true };
	const uint8_t loopback[16] = { [10] = 0xFF, 0xFF, 127, 0, 0, 1 };
	struct db_audit_entry entry = command_of("feeder", 1);
	struct db_audit_entry read;
	struct db_audit_value value;
	json_t *object;
	char *who;

	(void)state;
	entry.number = 1;
	entry.user = "anna";
	entry.from = "page, 10.0.0.5";
	entry.login = "drivebridge-web";
	db_client_address_of_session(&session, entry.address);
	object = db_record_write(&entry);
	assert_true(db_record_read(object, &read, &value));
	assert_memory_equal(read.address, entry.address, sizeof(entry.address));
	assert_string_equal(read.login, "drivebridge-web");
	assert_string_equal(read.user, "anna");
	who = db_record_who(object);
	assert_string_equal(who, "control, user drivebridge-web for anna, page, 10.0.0.5");
	free(who);
	json_decref(object);
	db_client_address_of_user(loopback, 0, entry.address);
	object = db_record_write(&entry);
	assert_true(db_record_read(object, &read, &value));
	assert_memory_equal(read.address, entry.address, sizeof(entry.address));
	json_decref(object);
}

static void test_every_command_is_read_as_written(void **state)
{
	(void)state;
	for (unsigned code = 1; code < DB_CMD_LIMIT; code++) {
		struct db_audit_entry entry = command_of("feeder", 123456);
		struct db_audit_entry read;
		struct db_audit_value value;
		json_t *object;

		if (!db_command_find(code))
			continue;
		entry.number = code;
		entry.command = (uint16_t)code;
		entry.args = (struct db_args){ -5,     0.1f, 2,           3,
			                       0x8001, 6,    -7,          8,
			                       0.25f,  900,  4000000000u, -1.5f,
			                       12,     13,   14,          { 1, 2, 3, 0xFFFF } };
		object = db_record_write(&entry);
		assert_true(db_record_read(object, &read, &value));
		assert_int_equal(read.command, code);
		assert_true(db_command_same_args(code, &read.args, &entry.args));
		json_decref(object);
	}
}

/* Faster than a disk: what is missing is told, and the chain is whole. */
static void test_overrun_is_told(void **state)
{
	struct db_audit *audit = open_audit(NULL);
	struct db_audit_entry entry = command_of("feeder", 1);
	struct db_audit_state told;
	uint64_t lost = 0;
	uint64_t posted = 0;
	uint64_t checked;
	json_t *records;
	json_t *record;
	size_t i;

	(void)state;
	for (unsigned k = 0; k < 3000; k++)
		posted += db_audit_post(audit, &entry, NOW) != 0;
	/* So that the count is in the file. */
	do {
		usleep(1000);
		db_audit_state(audit, &told);
	} while (db_audit_post(audit, &entry, NOW) == 0);
	posted++;
	records = read_records(audit, (struct db_audit_query){ .from = 0 }, &checked);
	json_array_foreach(records, i, record)
	{
		if (strcmp(text_of(records, i, "kind"), "lost") == 0)
			lost += (uint64_t)json_integer_value(json_object_get(record, "count"));
		else
			posted--;
	}
	assert_int_equal(posted, 0);
	db_audit_state(audit, &told);
	assert_int_equal(lost, told.lost);
	json_decref(records);
	db_audit_free(audit);
}

static void *post_some(void *context)
{
	struct db_audit_entry entry = command_of("feeder", 1);

	for (unsigned i = 0; i < 50; i++)
		db_audit_end(context, db_audit_post(context, &entry, NOW), "feeder", DB_RESULT_OK,
		             1, entry.time_us);
	return NULL;
}

static void test_threads(void **state)
{
	struct db_audit *audit = open_audit(NULL);
	pthread_t threads[4];
	uint64_t checked;
	json_t *records;

	(void)state;
	for (unsigned i = 0; i < 4; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, post_some, audit), 0);
	db_audit_change(audit, true, 2);
	for (unsigned i = 0; i < 4; i++)
		pthread_join(threads[i], NULL);
	records = read_records(audit, (struct db_audit_query){ .from = 0 }, &checked);
	assert_true(json_array_size(records) >= 200);
	json_decref(records);
	/* A reader that goes in the middle of a page. */
	assert_true(db_audit_ask(audit, OWNER, &(struct db_audit_query){ .from = 0 }));
	db_audit_forget(audit, OWNER);
	db_audit_free(audit);
}

/* What is before the first record that a reader wants takes several pages, and another one reads in between. */
static void test_readers_take_turns(void **state)
{
	struct db_audit *audit = open_audit(NULL);
	struct db_audit_query queries[] = { { .from = 490 }, { .from = 491 } };
	struct db_audit_page page = { .records = NULL };
	struct db_audit_entry entry = command_of("feeder", 1);
	uint64_t checked;
	char found[2] = "";

	(void)state;
	/* Larger files than a page. */
	db_audit_change(audit, true, 8);
	for (unsigned i = 0; i < 500; i++) {
		db_audit_post(audit, &entry, NOW);
		if (i % 32 == 0)
			json_decref(read_records(audit, (struct db_audit_query){ .from = 10000 },
			                         &checked));
	}
	for (unsigned turn = 0; turn < 40 && !(found[0] && found[1]); turn++) {
		struct db_audit_query *query = &queries[turn % 2];
		uint32_t reader = OWNER + turn % 2;

		assert_true(db_audit_ask(audit, reader, query));
		while (!db_audit_take(audit, reader, &page))
			usleep(200);
		query->from = page.next;
		found[turn % 2] = found[turn % 2] || page.length > 0;
		free(page.records);
	}
	assert_true(found[0] && found[1]);
	assert_true(db_audit_free(audit));
}

static void test_off(void **state)
{
	struct db_audit *audit = open_audit(NULL);
	struct db_audit_entry entry = command_of("feeder", 1);
	uint64_t checked;
	json_t *records;

	(void)state;
	db_audit_change(audit, false, 1);
	assert_int_equal(db_audit_post(audit, &entry, NOW), 0);
	db_audit_change(audit, true, 1);
	assert_int_equal(db_audit_post(audit, &entry, NOW), 1);
	records = read_records(audit, (struct db_audit_query){ .from = 0 }, &checked);
	assert_int_equal(json_array_size(records), 1);
	json_decref(records);
	assert_int_equal(db_audit_post(NULL, &entry, NOW), 0);
	db_audit_free(audit);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)
	const struct CMUnitTest tests[] = {
		TEST(test_posted_is_read),
		TEST(test_a_folder_that_comes_later),
		TEST(test_a_long_motion_has_an_owner),
		TEST(test_past_is_told),
		TEST(test_clients_are_found_again),
		TEST(test_every_command_is_read_as_written),
		TEST(test_overrun_is_told),
		TEST(test_threads),
		TEST(test_readers_take_turns),
		TEST(test_off),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
