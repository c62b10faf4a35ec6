/* SPDX-License-Identifier: Apache-2.0 */
/* The file of health values in made-up time: rings, clocks, restarts, cuts of the power, full disks. */
#include "health/health_private.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <jansson.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#define US UINT64_C(1000000)
#define MORNING (UINT64_C(1767252600) * US) /* in 2026 */

static char folder[64];

static int make_folder(void **state)
{
	(void)state;
	/* In memory: thousands of intervals are synced. */
	strcpy(folder, access("/dev/shm", W_OK) == 0 ? "/dev/shm/drivebridge-health-XXXXXX" :
	                                               "/tmp/drivebridge-health-XXXXXX");
	return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
	char command[128];

	(void)state;
	snprintf(command, sizeof(command), "rm -rf %s", folder);
	return system(command);
}

static struct db_store *open_store(const char *where)
{
	struct db_store *store = NULL;
	bool damaged;

	assert_int_equal(db_store_open(where, &store, &damaged), 0);
	assert_false(damaged);
	return store;
}

/* A minute of these drives: drive i had `losses` + i. */
static int add_of(struct db_store *store, const char *const *names, size_t count, uint32_t clock_s,
                  uint64_t wall_us, uint32_t losses)
{
	struct db_store_entry entries[DB_HEALTH_DRIVES_MAX] = { 0 };

	for (size_t i = 0; i < count; i++) {
		const struct db_health_value value = { .known = true,
			                               .exchanges = 1000,
			                               .losses = losses + (uint32_t)i,
			                               .mean_us = 900,
			                               .longest_us = 1000 + losses,
			                               .coldest = DB_HEALTH_NO_TEMPERATURE,
			                               .hottest = DB_HEALTH_NO_TEMPERATURE };

		snprintf(entries[i].name, sizeof(entries[i].name), "%s", names[i]);
		entries[i].unit = (uint16_t)(i + 1);
		db_health_value_write(&value, entries[i].value);
	}
	return db_store_add(store, &(struct db_store_interval){ .clock_s = clock_s,
	                                                        .span_s = 60,
	                                                        .wall_us = wall_us,
	                                                        .entries = entries,
	                                                        .count = count });
}

static const char *const two[] = { "left", "right" };

/* So many minutes, the first one of which ends now. */
static void add_minutes(struct db_store *store, unsigned count, uint32_t clock_s, uint64_t wall_us)
{
	for (unsigned i = 0; i < count; i++)
		assert_int_equal(
			add_of(store, two, 2, clock_s + 60 * i, wall_us + 60 * US * i, i % 7), 0);
}

static json_t *read_at(struct db_store *store, const char *drive, uint64_t since_us,
                       uint32_t step_s, uint32_t clock_s, uint64_t wall_us)
{
	struct db_health_query query = { .since_us = since_us, .step_s = step_s };
	struct db_health_page page;
	json_t *values;
	char *text;

	snprintf(query.drive, sizeof(query.drive), "%s", drive);
	db_store_read(store, &query, clock_s, wall_us, &page);
	if (step_s != 0)
		assert_int_equal(page.step_s, step_s);
	if (!page.known)
		return NULL;
	assert_true(asprintf(&text, "[%s]", page.values ? page.values : "") > 0);
	values = json_loads(text, 0, NULL);
	assert_non_null(values);
	free(text);
	free(page.values);
	return values;
}

static uint64_t number_of(const json_t *values, size_t place, const char *key)
{
	return (uint64_t)json_integer_value(json_object_get(json_array_get(values, place), key));
}

static uint64_t sum_of(const json_t *values, const char *key)
{
	uint64_t sum = 0;

	for (size_t i = 0; i < json_array_size(values); i++)
		sum += number_of(values, i, key);
	return sum;
}

/* --- the form --------------------------------------------------------------------------------- */

static void numbers_keep_three_digits(void **state)
{
	uint8_t bytes[DB_HEALTH_VALUE_BYTES];
	uint8_t again[DB_HEALTH_VALUE_BYTES];
	struct db_health_value read;
	struct db_health_value sum;
	uint32_t largest;

	(void)state;
	for (uint64_t number = 0; number <= UINT32_MAX; number = number * 17 / 16 + 1) {
		const struct db_health_value value = {
			.known = true,
			.exchanges = (uint32_t)number,
			.retries = (uint32_t)number,
			.losses = (uint32_t)number,
			.damaged = (uint32_t)number,
			.mean_us = (uint32_t)number,
			.longest_us = (uint32_t)number,
			.offline_ms = UINT32_MAX,
			.coldest = -40,
			.hottest = 85,
		};

		db_health_value_write(&value, bytes);
		db_health_value_read(bytes, &read);
		assert_true(read.known);
		assert_true(read.exchanges <= number && number - read.exchanges <= number / 1000);
		assert_int_equal(read.retries, read.exchanges);
		assert_int_equal(read.longest_us, read.exchanges);
		assert_true(read.offline_ms > UINT32_MAX - UINT32_MAX / 1000);
		assert_int_equal(read.coldest, -40);
		assert_int_equal(read.hottest, 85);
	}
	/* A file may have a form that means more than 32 bits: the largest number, which stays the same. */
	memset(bytes, 0xFE, sizeof(bytes));
	db_health_value_read(bytes, &read);
	db_health_value_write(&read, again);
	largest = read.exchanges;
	db_health_value_read(again, &read);
	assert_int_equal(read.exchanges, largest);
	assert_int_equal(read.offline_ms, largest);
	/* The mean of the largest ones is one of them. */
	read.losses = 0;
	sum = read;
	db_health_value_add(&sum, &read);
	assert_int_equal(sum.mean_us, largest);
}

static void every_plant_has_a_week_in_one_mebibyte(void **state)
{
	(void)state;
	for (size_t drives = 1; drives <= DB_HEALTH_DRIVES_MAX; drives++) {
		struct db_ring_shape shape;

		db_ring_shape_for(drives, &shape);
		assert_true(shape.columns >= drives);
		assert_true(db_ring_file_bytes(&shape) <= DB_RING_FILE_MAX);
		assert_int_equal(shape.slots[DB_RING_HOURS], 168);
		assert_true(shape.slots[DB_RING_QUARTERS] >= 24);
		/* An hour is made of its minutes. */
		assert_true(shape.slots[DB_RING_MINUTES] >= 60);
		if (drives <= 32)
			assert_int_equal(shape.slots[DB_RING_MINUTES], 1440);
	}
}

/* --- a week ----------------------------------------------------------------------------------- */

static void minutes_become_quarters_and_hours(void **state)
{
	struct db_store *store = open_store(folder);
	json_t *values;

	(void)state;
	add_minutes(store, 130, 1000, MORNING);
	values = read_at(store, "right", 0, 60, 8740, MORNING + 129 * 60 * US);
	assert_int_equal(json_array_size(values), 130);
	assert_int_equal(number_of(values, 0, "end_us"), MORNING);
	assert_int_equal(number_of(values, 9, "losses"), 3);
	json_decref(values);
	values = read_at(store, "right", 0, 900, 8740, MORNING + 129 * 60 * US);
	/* Eight whole quarters and ten minutes. */
	assert_int_equal(json_array_size(values), 9);
	assert_int_equal(number_of(values, 8, "span_s"), 600);
	assert_int_equal(number_of(values, 0, "span_s"), 900);
	assert_int_equal(number_of(values, 0, "exchanges"), 15000);
	assert_int_equal(number_of(values, 0, "end_us"), MORNING + 14 * 60 * US);
	json_decref(values);
	values = read_at(store, "right", 0, 3600, 8740, MORNING + 129 * 60 * US);
	assert_int_equal(json_array_size(values), 3);
	assert_int_equal(number_of(values, 0, "round_trip_longest_us"), 1006);
	assert_int_equal(number_of(values, 0, "round_trip_us"), 900);
	assert_int_equal(sum_of(values, "exchanges"), 130000);
	json_decref(values);
	/* Of each drive one value. */
	values = read_at(store, "", 0, 0, 8740, MORNING + 129 * 60 * US);
	assert_int_equal(json_array_size(values), 2);
	assert_int_equal(number_of(values, 1, "losses"), number_of(values, 0, "losses") + 130);
	json_decref(values);
	assert_null(read_at(store, "nobody", 0, 0, 8740, MORNING));
	db_store_free(store);
}

static void all_drives_are_read_as_rows(void **state)
{
	const struct db_health_query query = { .step_s = 60, .rows = true };
	struct db_store *store = open_store(folder);
	struct db_health_page page;
	json_t *object;
	char *text;
	json_t *lost;

	(void)state;
	/* The second drive comes after two minutes. */
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(
			add_of(store, two, i < 2 ? 1 : 2, 100 + 60 * i, MORNING + 60 * US * i, 5),
			0);
	db_store_read(store, &query, 220, MORNING + 120 * US, &page);
	assert_int_equal(page.step_s, 60);
	assert_true(asprintf(&text, "{%s}", page.values) > 0);
	object = json_loads(text, 0, NULL);
	free(text);
	free(page.values);
	assert_int_equal(json_array_size(json_object_get(object, "times")), 3);
	assert_int_equal(number_of(json_object_get(object, "times"), 0, "end_us"), MORNING);
	assert_int_equal(json_array_size(json_object_get(object, "rows")), 2);
	lost = json_object_get(json_array_get(json_object_get(object, "rows"), 0), "lost_ppm");
	assert_int_equal(json_integer_value(json_array_get(lost, 0)), 5000);
	lost = json_object_get(json_array_get(json_object_get(object, "rows"), 1), "lost_ppm");
	assert_true(json_is_null(json_array_get(lost, 1)));
	assert_int_equal(json_integer_value(json_array_get(lost, 2)), 6000);
	json_decref(object);
	db_store_free(store);
}

static void a_week_stays_and_no_more(void **state)
{
	struct db_store *store = open_store(NULL);
	unsigned minutes = 8 * 24 * 60 + 30;
	uint64_t end = MORNING + (minutes - 1) * 60 * US;
	json_t *values;

	(void)state;
	add_minutes(store, minutes, 0, MORNING);
	values = read_at(store, "left", 0, 3600, (minutes - 1) * 60, end);
	assert_int_equal(json_array_size(values), 169);
	assert_int_equal(number_of(values, 168, "end_us"), end);
	json_decref(values);
	values = read_at(store, "left", 0, 60, (minutes - 1) * 60, end);
	assert_int_equal(json_array_size(values), 1440);
	json_decref(values);
	/* The finest ring that goes back as far: hours, quarters, minutes. */
	values = read_at(store, "left", end - 100 * 3600 * US, 0, (minutes - 1) * 60, end);
	assert_int_equal(number_of(values, 0, "span_s"), 3600);
	json_decref(values);
	values = read_at(store, "left", end - 3 * 3600 * US, 0, (minutes - 1) * 60, end);
	assert_int_equal(number_of(values, 0, "span_s"), 60);
	assert_int_equal(json_array_size(values), 180);
	json_decref(values);
	db_store_free(store);
}

/* --- restarts and clocks ---------------------------------------------------------------------- */

static void numbers_go_on_after_a_restart(void **state)
{
	struct db_store *store = open_store(folder);
	json_t *values;

	(void)state;
	add_minutes(store, 20, 500, MORNING);
	db_store_free(store);
	/* The machine, too: its clock begins anew. */
	store = open_store(folder);
	add_minutes(store, 45, 10, MORNING + 30 * 60 * US);
	values = read_at(store, "left", 0, 60, 10 + 44 * 60, MORNING + 74 * 60 * US);
	assert_int_equal(json_array_size(values), 65);
	assert_int_equal(number_of(values, 19, "end_us"), MORNING + 19 * 60 * US);
	assert_int_equal(number_of(values, 20, "end_us"), MORNING + 30 * 60 * US);
	json_decref(values);
	/* The hour is of both runs. */
	values = read_at(store, "left", 0, 3600, 10 + 44 * 60, MORNING + 74 * 60 * US);
	assert_int_equal(json_array_size(values), 2);
	assert_int_equal(number_of(values, 0, "exchanges"), 60000);
	json_decref(values);
	db_store_free(store);
}

static void hours_without_the_service_are_not_mixed(void **state)
{
	struct db_store *store = open_store(folder);
	json_t *values;

	(void)state;
	add_minutes(store, 20, 500, MORNING);
	db_store_free(store);
	store = open_store(folder);
	add_minutes(store, 3, 10, MORNING + 48 * 3600 * US);
	values = read_at(store, "left", 0, 3600, 130, MORNING + 48 * 3600 * US + 120 * US);
	assert_int_equal(json_array_size(values), 2);
	assert_int_equal(number_of(values, 0, "exchanges"), 20000);
	assert_int_equal(number_of(values, 0, "span_s"), 1200);
	assert_int_equal(number_of(values, 1, "exchanges"), 3000);
	json_decref(values);
	values = read_at(store, "left", 0, 60, 130, MORNING + 48 * 3600 * US + 120 * US);
	assert_int_equal(json_array_size(values), 23);
	json_decref(values);
	db_store_free(store);
}

static void a_wrong_clock_is_corrected_and_destroys_nothing(void **state)
{
	struct db_store *store = open_store(folder);
	json_t *values;

	(void)state;
	/* 1970, and NTP comes after ten minutes. */
	add_minutes(store, 10, 30, 40 * US);
	add_minutes(store, 10, 630, MORNING);
	values = read_at(store, "left", 0, 60, 630 + 540, MORNING + 540 * US);
	assert_int_equal(json_array_size(values), 20);
	for (size_t i = 0; i < 20; i++)
		assert_int_equal(number_of(values, i, "end_us"), MORNING + 60 * US * i - 600 * US);
	json_decref(values);
	db_store_free(store);
	/* Another run in 1971, later in the order all the same; the run before keeps its times. */
	store = open_store(folder);
	add_minutes(store, 2, 5, UINT64_C(365) * 86400 * US);
	values = read_at(store, "left", 0, 60, 65, UINT64_C(365) * 86400 * US + 60 * US);
	assert_int_equal(json_array_size(values), 22);
	assert_int_equal(number_of(values, 0, "end_us"), MORNING - 600 * US);
	assert_int_equal(number_of(values, 21, "end_us"), UINT64_C(365) * 86400 * US + 60 * US);
	json_decref(values);
	/* The clock before 1970 plus the monotonic one. */
	values = read_at(store, "left", 0, 60, UINT32_MAX, 0);
	assert_int_equal(json_array_size(values), 22);
	assert_int_equal(number_of(values, 21, "end_us"), 0);
	json_decref(values);
	db_store_free(store);
}

/* --- drives come and go ----------------------------------------------------------------------- */

static void drives_are_known_by_name_and_unit(void **state)
{
	static const char *const other[] = { "right", "left" }; /* with the other's unit */
	static const char *const none[] = { "" };
	struct db_store *store = open_store(folder);
	json_t *values;

	(void)state;
	add_minutes(store, 5, 0, MORNING);
	assert_int_equal(add_of(store, none, 0, 300, MORNING + 300 * US, 0), 0);
	assert_int_equal(add_of(store, two, 2, 360, MORNING + 360 * US, 0), 0);
	values = read_at(store, "left", 0, 60, 360, MORNING + 360 * US);
	assert_int_equal(json_array_size(values), 6);
	json_decref(values);
	assert_int_equal(add_of(store, other, 2, 420, MORNING + 420 * US, 100), 0);
	values = read_at(store, "left", 0, 60, 420, MORNING + 420 * US);
	assert_int_equal(json_array_size(values), 1);
	assert_int_equal(number_of(values, 0, "losses"), 101);
	json_decref(values);
	db_store_free(store);
}

static void a_new_drive_never_gets_values_of_another(void **state)
{
	static const char *const eight[] = { "a", "b", "c", "d", "e", "f", "g", "h" };
	const char *changed[8];
	char names[40][8];
	struct db_store *store = open_store(folder);
	json_t *values;

	(void)state;
	memcpy(changed, eight, sizeof(changed));
	for (unsigned i = 0; i < 40; i++) {
		assert_int_equal(add_of(store, changed, 8, 60 * i, MORNING + 60 * US * i, i), 0);
		snprintf(names[i], sizeof(names[i]), "n%u", i);
		/* A reload: another one in the place of one of them. */
		changed[i % 8] = names[i];
		values = read_at(store, eight[7 - i % 8], 0, 3600, 60 * i, MORNING + 60 * US * i);
		json_decref(values);
	}
	for (unsigned step = 60; step <= 3600; step *= step == 60 ? 15 : 4) {
		values = read_at(store, "n31", 0, step, 60 * 39, MORNING + 60 * US * 39);
		assert_int_equal(sum_of(values, "exchanges"), 8000);
		json_decref(values);
	}
	db_store_free(store);
}

static void more_drives_keep_what_was_there(void **state)
{
	char texts[DB_HEALTH_DRIVES_MAX][8];
	const char *names[DB_HEALTH_DRIVES_MAX] = { "left", "right" };
	struct db_store *store = open_store(folder);
	json_t *values;

	(void)state;
	add_minutes(store, 100, 0, MORNING);
	for (unsigned i = 2; i < DB_HEALTH_DRIVES_MAX; i++) {
		snprintf(texts[i], sizeof(texts[i]), "d%u", i);
		names[i] = texts[i];
	}
	assert_int_equal(add_of(store, names, DB_HEALTH_DRIVES_MAX, 6000, MORNING + 6000 * US, 0),
	                 0);
	db_store_free(store);
	store = open_store(folder);
	values = read_at(store, "left", 0, 3600, 6000, MORNING + 6000 * US);
	assert_int_equal(json_array_size(values), 2);
	assert_int_equal(sum_of(values, "exchanges"), 101000);
	json_decref(values);
	values = read_at(store, "", 0, 0, 6000, MORNING + 6000 * US);
	assert_int_equal(json_array_size(values), DB_HEALTH_DRIVES_MAX);
	json_decref(values);
	db_store_free(store);
}

/* --- power cuts and full disks ---------------------------------------------------------------- */

static uint8_t *read_file(const char *name, size_t *size)
{
	uint8_t *bytes = malloc(DB_RING_FILE_MAX);
	char path[96];
	FILE *file;

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	file = fopen(path, "rb");
	assert_non_null(file);
	assert_non_null(bytes);
	*size = fread(bytes, 1, DB_RING_FILE_MAX, file);
	fclose(file);
	return bytes;
}

static void write_file(const char *name, const uint8_t *bytes, size_t size)
{
	char path[96];
	FILE *file;

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	file = fopen(path, "wb");
	assert_non_null(file);
	assert_int_equal(fwrite(bytes, 1, size, file), size);
	assert_int_equal(fclose(file), 0);
}

/* What is there after a cut while minute `last` (from 0) was written: all before it. */
static void must_have(unsigned last)
{
	struct db_store *store = open_store(folder);
	json_t *values = read_at(store, "right", 0, 60, 0, MORNING);
	size_t count = json_array_size(values);

	assert_true(count == last || count == last + 1);
	json_decref(values);
	/* And the next interval makes everything whole again. */
	assert_int_equal(add_of(store, two, 2, 60 * last, MORNING + 60 * US * (last + 1), 0), 0);
	values = read_at(store, "right", 0, 3600, 0, MORNING);
	assert_int_equal(sum_of(values, "exchanges"), (count + 1) * 1000);
	json_decref(values);
	db_store_free(store);
}

/* Every prefix of what one interval writes; for the last one of an hour that is three slots, in any
 * order, of which a disk may have some. */
static void a_cut_costs_the_last_interval_at_most(void **state)
{
	static const unsigned lasts[] = { 1, 14, 59 };

	(void)state;
	for (size_t c = 0; c < sizeof(lasts) / sizeof(lasts[0]); c++) {
		unsigned last = lasts[c];
		struct db_store *store;
		uint8_t *before;
		uint8_t *after;
		uint8_t *torn;
		size_t size;
		size_t changed = 0;

		assert_int_equal(remove_folder(NULL), 0);
		assert_int_equal(mkdir(folder, 0700), 0);
		store = open_store(folder);
		add_minutes(store, last, 0, MORNING);
		before = read_file("values", &size);
		assert_int_equal(add_of(store, two, 2, 60 * last, MORNING + 60 * US * last, 0), 0);
		after = read_file("values", &size);
		db_store_free(store);
		torn = malloc(size);
		assert_non_null(torn);
		for (size_t i = 0; i < size; i++) {
			bool written = before[i] != after[i];

			if (!written && i + 1 < size)
				continue;
			changed += written;
			/* What comes before it is written, and what comes behind it. */
			memcpy(torn, before, size);
			memcpy(torn, after, i);
			write_file("values", torn, size);
			must_have(last);
			memcpy(torn, after, size);
			memcpy(torn, before, i);
			write_file("values", torn, size);
			must_have(last);
		}
		assert_true(changed > 20);
		free(torn);
		free(after);
		free(before);
	}
}

static void a_new_file_is_whole_or_not_there(void **state)
{
	static const char *const more[] = { "left", "right", "c", "d", "e", "f", "g", "h", "i" };
	struct db_store *store = open_store(folder);
	uint8_t *whole;
	size_t size;
	json_t *values;

	(void)state;
	add_minutes(store, 5, 0, MORNING);
	assert_int_equal(add_of(store, more, 9, 300, MORNING + 300 * US, 0), 0);
	db_store_free(store);
	whole = read_file("values", &size);
	for (size_t part = 0; part < size; part += size / 50) {
		/* Before it got the name, a part of it was there under another one. */
		write_file("values.new", whole, part);
		store = open_store(folder);
		values = read_at(store, "left", 0, 60, 300, MORNING + 300 * US);
		assert_int_equal(json_array_size(values), 6);
		json_decref(values);
		db_store_free(store);
	}
	free(whole);
}

static void a_file_that_is_none_is_put_aside(void **state)
{
	struct db_store *store = open_store(folder);
	bool damaged = false;
	uint8_t *bytes;
	size_t size;

	(void)state;
	add_minutes(store, 5, 0, MORNING);
	db_store_free(store);
	bytes = read_file("values", &size);
	bytes[40] ^= 1; /* the name of a drive */
	write_file("values", bytes, size);
	assert_int_equal(db_store_open(folder, &store, &damaged), 0);
	assert_true(damaged);
	add_minutes(store, 1, 0, MORNING);
	db_store_free(store);
	free(bytes);
	free(read_file("values.damaged", &size));
	store = open_store(folder);
	db_store_free(store);
}

static void without_a_folder_it_goes_on_in_memory(void **state)
{
	struct db_store *store = open_store(NULL);
	json_t *values;

	(void)state;
	add_minutes(store, 70, 0, MORNING);
	values = read_at(store, "left", 0, 3600, 69 * 60, MORNING + 69 * 60 * US);
	assert_int_equal(json_array_size(values), 2);
	json_decref(values);
	db_store_free(store);
}

static void what_was_in_memory_gets_into_the_file(void **state)
{
	char inside[80];
	struct db_store *store;
	json_t *values;

	(void)state;
	/* A file is where the folder would be. */
	snprintf(inside, sizeof(inside), "%s/there", folder);
	write_file("there", (const uint8_t *)"", 0);
	store = open_store(inside);
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(add_of(store, two, 2, 60 * i, MORNING + 60 * US * i, 0), -ENOTDIR);
	assert_int_equal(unlink(inside), 0);
	assert_int_equal(add_of(store, two, 2, 180, MORNING + 180 * US, 0), 0);
	db_store_free(store);
	store = open_store(inside);
	values = read_at(store, "left", 0, 60, 180, MORNING + 180 * US);
	assert_int_equal(json_array_size(values), 4);
	json_decref(values);
	db_store_free(store);
}

static void a_slot_that_was_changed_is_left_out(void **state)
{
	struct db_store *store = open_store(folder);
	struct db_ring_shape shape;
	uint8_t *bytes;
	size_t size;
	json_t *values;

	(void)state;
	add_minutes(store, 70, 0, MORNING);
	db_store_free(store);
	bytes = read_file("values", &size);
	db_ring_shape_for(2, &shape);
	/* One bit of a number, in every other minute and in the hour. */
	for (unsigned i = 0; i < 70; i += 2)
		bytes[db_ring_place(&shape, DB_RING_MINUTES, i) + DB_RING_SLOT_HEAD] ^= 1;
	bytes[db_ring_place(&shape, DB_RING_HOURS, 0) + DB_RING_SLOT_HEAD] ^= 1;
	write_file("values", bytes, size);
	store = open_store(folder);
	values = read_at(store, "left", 0, 60, 69 * 60, MORNING + 69 * 60 * US);
	assert_int_equal(json_array_size(values), 35);
	assert_int_equal(sum_of(values, "exchanges"), 35000);
	json_decref(values);
	values = read_at(store, "left", 0, 3600, 69 * 60, MORNING + 69 * 60 * US);
	assert_int_equal(json_array_size(values), 1);
	assert_int_equal(sum_of(values, "exchanges"), 5000);
	json_decref(values);
	db_store_free(store);
	free(bytes);
}

int main(void)
{
#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(numbers_keep_three_digits),
		cmocka_unit_test(every_plant_has_a_week_in_one_mebibyte),
		IN_FOLDER(minutes_become_quarters_and_hours),
		IN_FOLDER(all_drives_are_read_as_rows),
		cmocka_unit_test(a_week_stays_and_no_more),
		IN_FOLDER(numbers_go_on_after_a_restart),
		IN_FOLDER(hours_without_the_service_are_not_mixed),
		IN_FOLDER(a_wrong_clock_is_corrected_and_destroys_nothing),
		IN_FOLDER(drives_are_known_by_name_and_unit),
		IN_FOLDER(a_new_drive_never_gets_values_of_another),
		IN_FOLDER(more_drives_keep_what_was_there),
		IN_FOLDER(a_cut_costs_the_last_interval_at_most),
		IN_FOLDER(a_new_file_is_whole_or_not_there),
		IN_FOLDER(a_file_that_is_none_is_put_aside),
		cmocka_unit_test(without_a_folder_it_goes_on_in_memory),
		IN_FOLDER(what_was_in_memory_gets_into_the_file),
		IN_FOLDER(a_slot_that_was_changed_is_left_out),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
