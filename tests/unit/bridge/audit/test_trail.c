/* SPDX-License-Identifier: Apache-2.0 */
/* The files of the audit trail: the chain, rotation, torn ends, full disks. */
#include "audit/audit_private.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#define MIB (1024u * 1024u)

static char folder[64];

static int make_folder(void **state)
{
	(void)state;
	strcpy(folder, "/tmp/drivebridge-audit-XXXXXX");
	return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
	char command[128];

	(void)state;
	snprintf(command, sizeof(command), "rm -rf %s", folder);
	return system(command);
}

static struct db_trail *open_trail(struct db_trail_found *found)
{
	struct db_trail *trail = NULL;
	struct db_trail_found here;

	assert_int_equal(db_trail_open(folder, MIB, &trail, found ? found : &here), 0);
	return trail;
}

static int append_at(struct db_trail *trail, uint64_t number, uint64_t time_us)
{
	json_t *object = json_pack(
		"{s:I, s:s, s:s}", "number", (json_int_t)number, "kind", "command", "text",
		"a text that is as long as a usual record of a command, which has a client, "
		"a drive and its arguments");
	int error = db_trail_append(trail, object, number, time_us);

	json_decref(object);
	return error;
}

static int append(struct db_trail *trail, uint64_t number)
{
	return append_at(trail, number, number * 1000);
}

static void append_many(struct db_trail *trail, uint64_t first, uint64_t last)
{
	for (uint64_t number = first; number <= last; number++)
		assert_int_equal(append(trail, number), 0);
}

/* What was read. */
struct seen {
	uint64_t records;
	uint64_t first;
	uint64_t last;
	unsigned broken;
	const char *why; /* of the first broken line */
};

static void see(void *context, const struct db_lines *lines, json_t *object, const char *text,
                size_t length, const char *why)
{
	struct seen *seen = context;

	(void)text;
	(void)length;
	if (why && seen->broken++ == 0)
		seen->why = why;
	if (!object)
		return;
	if (seen->records++ == 0)
		seen->first = lines->number;
	seen->last = lines->number;
}

static struct seen read_all(struct db_trail *trail)
{
	struct seen seen = { 0 };
	struct db_trail_place place;

	db_trail_find(trail, 0, 0, &place);
	while (db_trail_read(trail, &place, 16384, see, &seen))
		continue;
	return seen;
}

static size_t read_file(const char *name, char **bytes)
{
	char path[128];
	struct stat status;
	FILE *file;

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	assert_int_equal(stat(path, &status), 0);
	*bytes = malloc((size_t)status.st_size + 1);
	file = fopen(path, "r");
	assert_non_null(file);
	assert_int_equal(fread(*bytes, 1, (size_t)status.st_size, file), status.st_size);
	fclose(file);
	(*bytes)[status.st_size] = '\0';
	return (size_t)status.st_size;
}

static void write_file(const char *name, const char *bytes, size_t length)
{
	char path[128];
	FILE *file;

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	file = fopen(path, "w");
	assert_non_null(file);
	assert_int_equal(fwrite(bytes, 1, length, file), length);
	fclose(file);
}

static void test_chain_is_whole_over_restarts(void **state)
{
	struct db_trail_found found;
	struct db_trail *trail = open_trail(&found);
	struct seen seen;

	(void)state;
	assert_false(found.fresh_key);
	assert_int_equal(db_trail_newest(trail), 0);
	append_many(trail, 1, 10);
	db_trail_free(trail);
	trail = open_trail(&found);
	assert_int_equal(found.cut, 0);
	assert_false(found.fresh_key);
	assert_int_equal(db_trail_newest(trail), 10);
	append_many(trail, 11, 20);
	seen = read_all(trail);
	assert_int_equal(seen.records, 20);
	assert_int_equal(seen.last, 20);
	assert_int_equal(seen.broken, 0);
	db_trail_free(trail);
}

static void test_key_is_its_owners_alone(void **state)
{
	struct stat status;
	char path[128];

	(void)state;
	db_trail_free(open_trail(NULL));
	snprintf(path, sizeof(path), "%s/key", folder);
	assert_int_equal(stat(path, &status), 0);
	assert_int_equal(status.st_mode & 0777, S_IRUSR | S_IWUSR);
}

static char *line_of(char *bytes, unsigned number)
{
	for (unsigned i = 0; i < number; i++)
		bytes = strchr(bytes, '\n') + 1;
	return bytes;
}

/* The file has a head, and five records behind it. */
static struct seen read_changed(const char *bytes, size_t length)
{
	struct db_trail *trail;
	struct seen seen;

	write_file("trail-00000001.jsonl", bytes, length);
	trail = open_trail(NULL);
	seen = read_all(trail);
	db_trail_free(trail);
	return seen;
}

static void test_changes_are_seen(void **state)
{
	struct db_trail *trail = open_trail(NULL);
	struct seen seen;
	char *bytes;
	char *other;
	char *text;
	size_t length;
	size_t cut;

	(void)state;
	append_many(trail, 1, 5);
	db_trail_free(trail);
	length = read_file("trail-00000001.jsonl", &bytes);
	other = malloc(length + 1024);

	/* Each letter of the third record's text. */
	text = strstr(line_of(bytes, 3), "a text");
	for (unsigned i = 0; i < 6; i++) {
		memcpy(other, bytes, length);
		other[text - bytes + i] ^= 1;
		seen = read_changed(other, length);
		assert_int_equal(seen.broken, 1);
		assert_non_null(strstr(seen.why, "seal"));
	}
	/* Taken out. */
	cut = (size_t)(line_of(bytes, 4) - line_of(bytes, 3));
	memcpy(other, bytes, (size_t)(line_of(bytes, 3) - bytes));
	strcpy(other + (line_of(bytes, 3) - bytes), line_of(bytes, 4));
	seen = read_changed(other, length - cut);
	assert_int_equal(seen.broken, 1);
	assert_int_equal(seen.records, 4);
	/* Put in once more. */
	memcpy(other, bytes, (size_t)(line_of(bytes, 4) - bytes));
	memcpy(other + (line_of(bytes, 4) - bytes), line_of(bytes, 3), cut);
	strcpy(other + (line_of(bytes, 4) - bytes) + cut, line_of(bytes, 4));
	seen = read_changed(other, length + cut);
	assert_true(seen.broken >= 1);
	/* Nothing that is a record. */
	memcpy(other, bytes, length);
	memset(other + (line_of(bytes, 2) - bytes), 'x', 20);
	seen = read_changed(other, length);
	assert_true(seen.broken >= 1);
	/* The head. */
	memcpy(other, bytes, length);
	*strchr(strstr(other, "first"), '1') = '2';
	seen = read_changed(other, length);
	assert_int_equal(seen.broken, 1);

	/* As it was. */
	seen = read_changed(bytes, length);
	assert_int_equal(seen.broken, 0);
	free(other);
	free(bytes);
}

/* Of a trail that has the same key and the same numbers: only what is before it is something else. */
static void test_a_line_fits_its_place_alone(void **state)
{
	struct db_trail *trail = open_trail(NULL);
	struct seen seen;
	char path[128];
	char *other;
	char *bytes;
	char *mixed;
	size_t begin;
	size_t length;

	(void)state;
	append_many(trail, 1, 3);
	db_trail_free(trail);
	length = read_file("trail-00000001.jsonl", &bytes);
	snprintf(path, sizeof(path), "%s/trail-00000001.jsonl", folder);
	assert_int_equal(unlink(path), 0);
	/* Begun at another time. */
	trail = open_trail(NULL);
	assert_int_equal(append_at(trail, 1, 5), 0);
	append_many(trail, 2, 3);
	db_trail_free(trail);
	(void)read_file("trail-00000001.jsonl", &other);
	mixed = malloc(length);
	begin = (size_t)(line_of(bytes, 2) - bytes);
	memcpy(mixed, bytes, length);
	memcpy(mixed + begin, line_of(other, 2), (size_t)(line_of(other, 3) - line_of(other, 2)));
	seen = read_changed(mixed, length);
	assert_int_equal(seen.records, 3);
	assert_true(seen.broken >= 1);
	assert_non_null(strstr(seen.why, "seal"));
	assert_int_equal(read_changed(bytes, length).broken, 0);
	free(mixed);
	free(other);
	free(bytes);
}

static void test_another_key_fits_nothing(void **state)
{
	struct db_trail_found found;
	struct db_trail *trail = open_trail(NULL);
	struct seen seen;
	char path[128];

	(void)state;
	append_many(trail, 1, 5);
	db_trail_free(trail);
	snprintf(path, sizeof(path), "%s/key", folder);
	assert_int_equal(unlink(path), 0);
	trail = open_trail(&found);
	assert_true(found.fresh_key);
	append_many(trail, 6, 7);
	seen = read_all(trail);
	assert_int_equal(seen.records, 7);
	/* The head and what was before. */
	assert_int_equal(seen.broken, 6);
	db_trail_free(trail);
}

/* Nobody has to verify for this: it is seen when the service starts. */
static void test_a_changed_end_is_seen_at_once(void **state)
{
	static const char other[] =
		"0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
	struct db_trail_found found;
	struct db_trail *trail = open_trail(&found);

	(void)state;
	append_many(trail, 1, 5);
	db_trail_free(trail);
	db_trail_free(open_trail(&found));
	assert_false(found.wrong_end);
	write_file("key", other, sizeof(other) - 1);
	db_trail_free(open_trail(&found));
	assert_true(found.wrong_end);
	assert_false(found.fresh_key);
}

/* A clock that was wrong for one file hides nothing that came before. */
static void test_a_wrong_clock_hides_nothing(void **state)
{
	struct db_trail *trail = open_trail(NULL);
	struct db_trail_place place;
	uint64_t time = UINT64_C(1700000000000000);
	uint64_t number = 1;

	(void)state;
	/* Three files, of which the second one is of 1970. */
	for (; db_trail_bytes(trail) < MIB * 5 / 16; number++) {
		uint64_t part = db_trail_bytes(trail) * 8 / MIB;

		assert_int_equal(append_at(trail, number, part == 1 ? 1000 : time + number), 0);
	}
	db_trail_find(trail, 0, time, &place);
	assert_int_equal(place.segment, 1);
	db_trail_free(trail);
}

/* As if the power had failed while the last two records were written. */
static void test_torn_end_at_every_byte(void **state)
{
	struct db_trail_found found;
	struct db_trail *trail = open_trail(NULL);
	size_t begin;
	size_t length;
	char *bytes;

	(void)state;
	append_many(trail, 1, 4);
	db_trail_free(trail);
	length = read_file("trail-00000001.jsonl", &bytes);
	begin = (size_t)(line_of(bytes, 3) - bytes);
	for (size_t end = begin; end < length; end++) {
		uint64_t whole = end < (size_t)(line_of(bytes, 4) - bytes) ? 2 : 3;
		size_t kept = whole == 2 ? begin : (size_t)(line_of(bytes, 4) - bytes);
		struct seen seen;

		write_file("trail-00000001.jsonl", bytes, end);
		trail = open_trail(&found);
		assert_int_equal(found.cut, end - kept);
		assert_int_equal(db_trail_newest(trail), whole);
		assert_int_equal(append(trail, whole + 1), 0);
		seen = read_all(trail);
		assert_int_equal(seen.broken, 0);
		assert_int_equal(seen.records, whole + 1);
		db_trail_free(trail);
	}
	/* Blocks that were never written are zero. */
	memset(bytes + length - 60, 0, 60);
	write_file("trail-00000001.jsonl", bytes, length);
	trail = open_trail(&found);
	assert_int_equal(db_trail_newest(trail), 3);
	assert_true(found.cut > 60);
	db_trail_free(trail);
	free(bytes);
}

static void test_files_are_bounded(void **state)
{
	struct db_trail *trail = open_trail(NULL);
	struct db_trail_place place;
	struct seen seen = { 0 };
	char name[32];
	char path[128];

	(void)state;
	for (uint64_t number = 1; number <= 8000; number++) {
		assert_int_equal(append(trail, number), 0);
		assert_true(db_trail_bytes(trail) <= MIB);
	}
	assert_true(db_trail_bytes(trail) > MIB / 2);
	db_trail_name(1, name);
	snprintf(path, sizeof(path), "%s/%s", folder, name);
	assert_int_equal(access(path, F_OK), -1);
	seen = read_all(trail);
	assert_int_equal(seen.broken, 0);
	assert_int_equal(seen.last, 8000);
	assert_int_equal(seen.records, 8000 - seen.first + 1);
	/* Another start finds the same. */
	db_trail_free(trail);
	trail = open_trail(NULL);
	assert_int_equal(db_trail_newest(trail), 8000);
	assert_int_equal(append(trail, 8001), 0);
	assert_int_equal(read_all(trail).broken, 0);
	/* By number, and by time, without what is far before. */
	db_trail_find(trail, 7990, 0, &place);
	memset(&seen, 0, sizeof(seen));
	while (db_trail_read(trail, &place, 16384, see, &seen))
		continue;
	assert_true(seen.first > 6000 && seen.first <= 7990);
	assert_int_equal(seen.broken, 0);
	db_trail_find(trail, 0, 7990 * 1000, &place);
	memset(&seen, 0, sizeof(seen));
	while (db_trail_read(trail, &place, 16384, see, &seen))
		continue;
	assert_true(seen.first > 6000 && seen.first <= 7990);
	/* Less than there is. */
	db_trail_set_bytes(trail, MIB / 4);
	assert_true(db_trail_bytes(trail) <= MIB / 4);
	seen = read_all(trail);
	assert_int_equal(seen.last, 8001);
	assert_int_equal(seen.broken, 0);
	db_trail_free(trail);
}

static void test_lost_file_is_seen(void **state)
{
	struct db_trail *trail = open_trail(NULL);
	struct seen seen;
	char path[128];

	(void)state;
	append_many(trail, 1, 2500);
	db_trail_free(trail);
	snprintf(path, sizeof(path), "%s/trail-00000002.jsonl", folder);
	assert_int_equal(unlink(path), 0);
	trail = open_trail(NULL);
	seen = read_all(trail);
	assert_true(seen.broken >= 1);
	assert_int_equal(seen.last, 2500);
	db_trail_free(trail);
}

/* The segment was made, and the process ended before its head was in it. */
static void test_begun_file_is_taken_back(void **state)
{
	struct db_trail *trail = open_trail(NULL);

	(void)state;
	append_many(trail, 1, 3);
	db_trail_free(trail);
	write_file("trail-00000002.jsonl", "{\"audit\":", 9);
	trail = open_trail(NULL);
	assert_int_equal(db_trail_newest(trail), 3);
	append_many(trail, 4, 5);
	assert_int_equal(read_all(trail).broken, 0);
	assert_int_equal(read_all(trail).records, 5);
	db_trail_free(trail);
}

static void limit_files(rlim_t bytes)
{
	struct rlimit limit;

	assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
	limit.rlim_cur = bytes;
	assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

/* A limit of the size of files stands for the end of the disk. */
static void test_full_disk(void **state)
{
	struct db_trail *trail = open_trail(NULL);
	uint64_t refused = 0;
	uint64_t number = 0;
	struct seen seen;

	(void)state;
	signal(SIGXFSZ, SIG_IGN);
	limit_files(4096);
	while (refused < 10) {
		int error = append(trail, number + 1);

		if (error == 0) {
			number++;
			assert_int_equal(refused, 0);
		} else {
			refused++;
		}
	}
	assert_true(number > 10);
	seen = read_all(trail);
	assert_int_equal(seen.records, number);
	assert_int_equal(seen.broken, 0);
	limit_files(RLIM_INFINITY);
	append_many(trail, number + 1, number + 5);
	seen = read_all(trail);
	assert_int_equal(seen.records, number + 5);
	assert_int_equal(seen.broken, 0);
	db_trail_free(trail);
}

/* The folder can be read alone, or is none. */
static void test_unusable_folder(void **state)
{
	struct db_trail *trail = NULL;
	struct db_trail_found found;

	(void)state;
	write_file("file", "", 0);
	strcat(folder, "/file");
	assert_int_equal(db_trail_open(folder, MIB, &trail, &found), -ENOTDIR);
	*strrchr(folder, '/') = '\0';
	assert_null(trail);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, make_folder, remove_folder)
	const struct CMUnitTest tests[] = {
		TEST(test_chain_is_whole_over_restarts),
		TEST(test_key_is_its_owners_alone),
		TEST(test_changes_are_seen),
		TEST(test_a_line_fits_its_place_alone),
		TEST(test_another_key_fits_nothing),
		TEST(test_a_changed_end_is_seen_at_once),
		TEST(test_a_wrong_clock_hides_nothing),
		TEST(test_torn_end_at_every_byte),
		TEST(test_files_are_bounded),
		TEST(test_lost_file_is_seen),
		TEST(test_begun_file_is_taken_back),
		TEST(test_full_disk),
		TEST(test_unusable_folder),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
