/* SPDX-License-Identifier: Apache-2.0 */
/* Profiles: what a file that others name may say, whose keys win, and that it is one of the configuration's files. */
#include "config/config_private.h"
#include "drivebridge/driver.h"

#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#define BUS "bus can { protocol = servo-can interface = can0 profile = \"p/kind.conf\" }\n"
#define ONE "drive one { bus = can address = 1 unit = 1 }\n"
#define KIND "profile { protocol = servo-can }\n"
#define WORDS \
	"command-word-base = 160 command-word-length = 4 command-word-0-at = 0 command-word-ack = 7 "

/* --- files --------------------------------------------------------------------------------------------- */

struct place {
	char folder[64];
	char file[128];
	char profile[128];
};

static void write_file(const char *path, const char *text)
{
	FILE *file = fopen(path, "we");

	assert_non_null(file);
	assert_int_not_equal(fputs(text, file), EOF);
	assert_int_equal(fclose(file), 0);
}

static struct place make_place(const char *main_text, const char *profile)
{
	struct place place = { .folder = "/tmp/test-profiles-XXXXXX" };
	char folder[96];

	assert_non_null(mkdtemp(place.folder));
	snprintf(place.file, sizeof place.file, "%s/f.conf", place.folder);
	snprintf(folder, sizeof folder, "%s/p", place.folder);
	assert_int_equal(mkdir(folder, 0700), 0);
	snprintf(place.profile, sizeof place.profile, "%s/kind.conf", folder);
	write_file(place.file, main_text);
	if (profile)
		write_file(place.profile, profile);
	return place;
}

static void remove_place(const struct place *place)
{
	char path[128];

	unlink(place->profile);
	unlink(place->file);
	snprintf(path, sizeof path, "%s/copy", place->folder);
	unlink(path);
	snprintf(path, sizeof path, "%s/p", place->folder);
	rmdir(path);
	assert_int_equal(rmdir(place->folder), 0);
}

/* What is said of it; to be freed. *reading is to be cleared. Out of line: gcc 12 takes what comes out of the stream for
 * the variable that holds it. */
__attribute__((noinline)) static char *read_place(const struct place *place,
                                                  struct db_config_reading *reading)
{
	char *messages = NULL;
	size_t size = 0;
	FILE *errors = open_memstream(&messages, &size);

	assert_non_null(errors);
	(void)db_config_read(place->file, NULL, errors, reading);
	fclose(errors);
	return messages;
}

static struct db_config_reading read_good(const struct place *place)
{
	struct db_config_reading reading;
	char *messages = read_place(place, &reading);

	if (!reading.config)
		fail_msg("%s", messages);
	free(messages);
	return reading;
}

static double option_of(const struct db_config *config, size_t drive, const char *name)
{
	const struct db_driver *driver = config->buses[config->drives[drive].bus].driver;

	for (size_t i = 0; i < driver->option_count; i++) {
		if (strcmp(driver->options[i].name, name) == 0)
			return db_option_value(
				&driver->options[i],
				strcmp(driver->options[i].section, "bus") == 0 ?
					config->buses[config->drives[drive].bus].options :
					config->drives[drive].options);
	}
	fail_msg("there is no %s", name);
	return 0;
}

static void assert_option(const struct db_config *config, size_t drive, const char *name,
                          double value)
{
	assert_float_equal(option_of(config, drive, name), value, 0);
}

/* --- whose keys count ------------------------------------------------------------------------------------ */

static void a_profile_of_the_bus_holds_for_it_and_its_drives(void **state)
{
	struct place place = make_place(
		BUS ONE "drive two { bus = can address = 2 unit = 2 counts-per-turn = 500 }\n",
		KIND "bus { " WORDS "bitrate = 250000 }\n"
		     "drive { counts-per-turn = 4000 in-position-window = 20 }\n");
	struct db_config_reading reading = read_good(&place);
	const struct db_config *config = reading.config;

	(void)state;
	assert_int_equal(config->buses[0].bitrate, 250000);
	assert_option(config, 0, "command-word-base", 160);
	assert_option(config, 0, "counts-per-turn", 4000);
	assert_option(config, 1, "counts-per-turn", 500);
	assert_float_equal(config->drives[0].in_position_window, 20, 0);
	assert_float_equal(config->drives[1].in_position_window, 20, 0);
	assert_string_equal(db_config_find_profile(config, false, 0)->path, place.profile);
	assert_string_equal(db_config_find_profile(config, true, 0)->keys,
	                    "counts-per-turn, in-position-window");
	assert_string_equal(db_config_find_profile(config, true, 1)->keys, "in-position-window");
	db_config_reading_clear(&reading);
	remove_place(&place);
}

static void a_drive_may_have_a_profile_of_its_own(void **state)
{
	struct place place = make_place(
		"bus can { protocol = servo-can interface = can0 }\n"
		"drive one { bus = can address = 1 unit = 1 profile = \"p/kind.conf\" }\n"
		"drive two { bus = can address = 2 unit = 2 }\n",
		KIND "drive { counts-per-turn = 4000 }\n");
	struct db_config_reading reading = read_good(&place);

	(void)state;
	assert_option(reading.config, 0, "counts-per-turn", 4000);
	assert_true(option_of(reading.config, 1, "counts-per-turn") !=
	            option_of(reading.config, 1, "counts-per-turn"));
	assert_null(db_config_find_profile(reading.config, true, 1));
	db_config_reading_clear(&reading);
	remove_place(&place);
}

static void other_families_have_profiles_too(void **state)
{
	struct place place = make_place(
		"bus b { protocol = vsmd-serial device = \"/dev/ttyX\" profile = \"p/kind.conf\" }\n"
		"drive one { bus = b address = 1 unit = 1 }\n",
		"profile { protocol = vsmd-serial }\n"
		"bus { baud = 115200 parity = even }\n"
		"drive { reaction-ms = 400 counts-per-unit = 25.5 unit-name = mm layout = vsmd }\nend\n");
	struct db_config_reading reading = read_good(&place);

	(void)state;
	assert_int_equal(reading.config->buses[0].baud, 115200);
	assert_int_equal(reading.config->buses[0].parity, DB_PARITY_EVEN);
	assert_float_equal(reading.config->drives[0].counts_per_unit, 25.5, 0);
	assert_true(reading.config->drives[0].counts_given);
	assert_true(reading.config->drives[0].vendor_layout);
	assert_string_equal(reading.config->drives[0].unit_name, "mm");
	assert_option(reading.config, 0, "reaction-ms", 400);
	db_config_reading_clear(&reading);
	remove_place(&place);
}

/* --- what is wrong -------------------------------------------------------------------------------------- */

#define OWN "drive one { bus = can address = 1 unit = 1 profile = \"p/kind.conf\" }\n"

/* The message begins with the file of these three letters and its line. */
static const struct {
	const char *main_text;
	const char *profile; /* null: the file is not there */
	const char *place;
	const char *message;
} WRONG[] = {
	{ BUS ONE, NULL, "f.conf:1: ", "p/kind.conf: there is no such file" },
	{ BUS ONE, "", "f.conf:1: ", "does not say which drives it is for" },
	{ BUS ONE, "profile {\n}", "p/kind.conf:1: ", "does not say which drives it is for" },
	{ BUS ONE, "profile { protocol = servo-cam }",
	  "p/kind.conf:1: ", "unknown protocol 'servo-cam'" },
	{ BUS ONE, "profile { protocol = xyza }",
	  "f.conf:1: ", "is for xyza, but the protocol of bus 'can' is servo-can" },
	{ BUS ONE, KIND "drive {\n counts-per-turn = x\n}",
	  "p/kind.conf:3: ", "counts-per-turn = x is no number" },
	{ BUS ONE, KIND "drive {\n counts-per-torn = 1\n}",
	  "p/kind.conf:3: ", "the nearest one is 'counts-per-turn'" },
	{ BUS ONE, KIND "drive {\n reaction-ms = 100\n reaction-ms = 200\n}",
	  "p/kind.conf:4: ", "reaction-ms was set on line 3 of" },
	{ BUS ONE, KIND "drive {\n mode = {speed}\n}", "p/kind.conf:3: ", "mode is a list" },
	{ BUS ONE, KIND "drive {\n save-ms = 1\n}",
	  "p/kind.conf:3: ", "save-ms is no key of servo-can" },
	{ BUS ONE, KIND "bus {\n parity = even\n}",
	  "p/kind.conf:3: ", "parity is no key of servo-can" },
	{ BUS ONE, KIND "drive {\n unit = 1\n}",
	  "p/kind.conf:3: ", "unit is no setting of a kind of drives" },
	{ BUS ONE, KIND "drive {\n watchdog-ms = 0\n}",
	  "p/kind.conf:3: ", "watchdog-ms is no setting of a kind of drives" },
	{ BUS ONE, KIND "bus {\n profile = \"q.conf\"\n}",
	  "p/kind.conf:3: ", "profile is no setting of a kind of drives" },
	{ BUS ONE, KIND "drive two {\n}", "p/kind.conf:2: ", "has no name, but 'two' was given" },
	{ BUS ONE, KIND "drive {\n}\ndrive {\n}", "p/kind.conf:4: ", "there is a section drive" },
	{ BUS ONE, KIND "modbus {\n}", "p/kind.conf:2: ", "a profile has no section 'modbus'" },
	{ BUS ONE, KIND "mode = speed", "p/kind.conf:2: ", "outside of a section" },
	{ BUS ONE, KIND "drive {\n", "p/kind.conf:3: ", "the file ends too early" },
	{ BUS ONE, KIND "end\ndrive { }", "p/kind.conf:2: ", "end says that the file is complete" },
	/* What only the family knows is wrong where it was written. */
	{ BUS ONE, KIND "drive {\n ramp-acceleration = 5\n}",
	  "p/kind.conf:3: ", "ramp-acceleration and ramp-deceleration are one frame" },
	{ BUS ONE, KIND "bus {\n ack-base = 64\n}",
	  "p/kind.conf:3: ", "ack-base = 0x40 cannot be" },
	{ BUS "drive one { bus = can address = 1 unit = 1\n max-velocity = 1 }\n", KIND,
	  "f.conf:3: ", "max-velocity is in the user's unit" },
	{ "bus can { protocol = servo-can interface = can0 profile = \"f.conf\" }\n", KIND,
	  "f.conf:1: ", "is a file of the configuration itself" },
	{ "bus can { protocol = servo-can interface = can0 profile = \"\" }\n", KIND,
	  "f.conf:1: ", "profile is no path" },
	{ "bus can { protocol = servo-can interface = can0 }\n" OWN, KIND "bus { padded = yes }",
	  "f.conf:2: ", "has padded = yes for its bus" },
	{ "bus can { protocol = servo-can interface = can0 profile = { \"p/kind.conf\" } }\n", KIND,
	  "f.conf:1: ", "profile is a list" },
};

static unsigned count_errors(const char *messages)
{
	unsigned count = 0;

	while (*messages) {
		size_t length = strcspn(messages, "\n");

		count += !memmem(messages, length, ": warning: ", strlen(": warning: "));
		messages += length;
		messages += *messages == '\n';
	}
	return count;
}

static void what_is_wrong_has_its_place(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof WRONG / sizeof WRONG[0]; i++) {
		struct place place = make_place(WRONG[i].main_text, WRONG[i].profile);
		struct db_config_reading reading;
		char *messages = read_place(&place, &reading);
		char begin[192];

		snprintf(begin, sizeof begin, "%s/%s", place.folder, WRONG[i].place);
		if (reading.config || !strstr(messages, WRONG[i].message) ||
		    strncmp(messages, begin, strlen(begin)) != 0)
			fail_msg("%zu: %s", i, messages);
		/* One fault, however many sections have it. */
		assert_int_equal(count_errors(messages), 1);
		free(messages);
		db_config_reading_clear(&reading);
		remove_place(&place);
	}
}

static void a_fault_is_told_once_for_all_its_drives(void **state)
{
	struct place place = make_place(BUS ONE "drive two { bus = can address = 2 unit = 2 }\n",
	                                KIND "drive {\n mode = fast\n counts-per-turn = x\n}\n");
	struct db_config_reading reading;
	char *messages = read_place(&place, &reading);
	const char *first;

	(void)state;
	assert_null(reading.config);
	first = strstr(messages, "mode = fast");
	assert_ptr_equal(first, messages + strcspn(messages, " ") + 1);
	assert_null(strstr(first + 1, "mode = fast"));
	assert_non_null(strstr(messages, "kind.conf:4: counts-per-turn = x"));
	free(messages);
	db_config_reading_clear(&reading);
	remove_place(&place);
}

/* The same on a bus that says so itself. */
static void a_profile_of_a_drive_may_have_what_its_bus_has(void **state)
{
	struct place place = make_place(
		"bus can { protocol = servo-can interface = can0 padded = yes }\n" OWN,
		KIND "bus { padded = yes }\ndrive { reaction-ms = 77 }\n");
	struct db_config_reading reading = read_good(&place);

	(void)state;
	assert_option(reading.config, 0, "reaction-ms", 77);
	db_config_reading_clear(&reading);
	remove_place(&place);
}

/* --- one of the files ------------------------------------------------------------------------------------ */

static void a_change_of_it_is_a_change(void **state)
{
	struct place place = make_place(BUS ONE, KIND "drive { reaction-ms = 77 }\n");
	struct db_config_reading before = read_good(&place);
	struct db_config_reading after;
	char *messages;

	(void)state;
	assert_string_equal(before.profiles, place.profile);
	assert_int_equal(before.signature, db_config_signature(place.file, before.profiles));
	write_file(place.profile, KIND "drive { reaction-ms = 1234 }\n");
	assert_int_not_equal(before.signature, db_config_signature(place.file, before.profiles));
	after = read_good(&place);
	assert_false(db_config_same(before.config, after.config));
	assert_true(db_config_same_bus(&before.config->buses[0], &after.config->buses[0]));
	db_config_reading_clear(&after);
	/* Wrong ones are watched, too. */
	write_file(place.profile, KIND "drive { reaction-ms = none }\n");
	messages = read_place(&place, &after);
	assert_null(after.config);
	assert_string_equal(after.profiles, place.profile);
	assert_int_equal(after.signature, db_config_signature(place.file, after.profiles));
	free(messages);
	db_config_reading_clear(&after);
	db_config_reading_clear(&before);
	remove_place(&place);
}

static void where_a_setting_stands_is_no_difference(void **state)
{
	struct place with = make_place(BUS ONE, KIND "drive { reaction-ms = 77 }\n");
	struct place without = make_place(
		"bus can { protocol = servo-can interface = can0 }\n"
		"drive one { bus = can address = 1 unit = 1 reaction-ms = 77 }\n",
		NULL);
	struct db_config_reading a = read_good(&with);
	struct db_config_reading b = read_good(&without);

	(void)state;
	assert_true(db_config_same(a.config, b.config));
	db_config_reading_clear(&a);
	db_config_reading_clear(&b);
	remove_place(&with);
	remove_place(&without);
}

static void one_that_was_cut_off_is_seen(void **state)
{
	struct place place = make_place(BUS ONE, KIND "drive { reaction-ms = 77 }\nend\n");
	struct db_config_reading before = read_good(&place);
	struct db_config_reading after;
	char *why;

	(void)state;
	write_file(place.profile, KIND);
	after = read_good(&place);
	assert_true(db_config_is_cut(before.config, after.config, &why));
	assert_non_null(strstr(why, "p/kind.conf: its last line was end"));
	free(why);
	db_config_reading_clear(&before);
	db_config_reading_clear(&after);
	remove_place(&place);
}

/* From the copy alone: the profile is another one by then, and nobody asks it. */
static void the_last_good_configuration_has_it(void **state)
{
	struct place place = make_place(BUS ONE, KIND "drive { reaction-ms = 77 }\n");
	struct db_config_reading reading = read_good(&place);
	struct db_config *config;
	char path[128];

	(void)state;
	assert_non_null(reading.copy);
	snprintf(path, sizeof path, "%s/copy", place.folder);
	write_file(path, reading.copy);
	unlink(place.profile);
	assert_int_equal(db_config_load_copy(path, place.file, stderr, &config), 0);
	assert_true(db_config_same(reading.config, config));
	assert_option(config, 0, "reaction-ms", 77);
	db_config_free(config);
	db_config_reading_clear(&reading);
	remove_place(&place);
}

/* --- in words ---------------------------------------------------------------------------------------------- */

static void check_prints_what_comes_from_it(void **state)
{
	struct place place = make_place(BUS ONE,
	                                KIND "bus { padded = yes }\ndrive { reaction-ms = 77 }\n");
	struct db_config_reading reading = read_good(&place);
	char expected[256];
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);

	(void)state;
	assert_non_null(out);
	db_config_describe(reading.config, out);
	fclose(out);
	snprintf(expected, sizeof expected, "  profile       %s: padded\n", place.profile);
	assert_non_null(strstr(text, expected));
	snprintf(expected, sizeof expected, "    from profile %s: reaction-ms\n", place.profile);
	assert_non_null(strstr(text, expected));
	free(text);
	db_config_reading_clear(&reading);
	remove_place(&place);
}

/* Written out with every key it says the same, without the profile. */
static void a_written_configuration_needs_no_profile(void **state)
{
	struct place place = make_place(BUS ONE,
	                                KIND "bus { padded = yes }\ndrive { reaction-ms = 77 }\n");
	struct db_config_reading reading = read_good(&place);
	struct db_config *again;
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);

	(void)state;
	assert_non_null(out);
	db_config_write(reading.config, out);
	fclose(out);
	assert_null(strstr(text, "profile"));
	assert_int_equal(db_load_text(&db_load_built_in, text, "written", stderr, &again), 0);
	assert_true(db_config_same(reading.config, again));
	db_config_free(again);
	free(text);
	db_config_reading_clear(&reading);
	remove_place(&place);
}

/* Those that come with the package. */
static void each_example_loads(void **state)
{
	static const char folder[] = DRIVEBRIDGE_SOURCE_DIR "/conf/profiles";
	DIR *open = opendir(folder);
	const struct dirent *entry;
	unsigned count = 0;

	(void)state;
	assert_non_null(open);
	while ((entry = readdir(open)) != NULL) {
		bool servo = strncmp(entry->d_name, "servo-can", strlen("servo-can")) == 0;
		struct db_config_reading reading;
		struct place place;
		char text[512];

		if (entry->d_name[0] == '.')
			continue;
		count++;
		snprintf(text, sizeof text,
		         "bus b { protocol = %s %s profile = \"%s/%s\" }\n"
		         "drive one { bus = b address = 1 unit = 1 }\nend\n",
		         servo ? "servo-can" : "vsmd-serial",
		         servo ? "interface = can0" : "device = \"/dev/ttyX\"", folder,
		         entry->d_name);
		place = make_place(text, NULL);
		reading = read_good(&place);
		assert_non_null(db_config_find_profile(reading.config, false, 0));
		assert_non_null(db_config_find_profile(reading.config, true, 0));
		if (servo)
			assert_true(db_driver_commands(&reading.config->buses[0],
			                               &reading.config->drives[0]) &
			            DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE));
		db_config_reading_clear(&reading);
		remove_place(&place);
	}
	closedir(open);
	assert_true(count >= 3);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_profile_of_the_bus_holds_for_it_and_its_drives),
		cmocka_unit_test(a_drive_may_have_a_profile_of_its_own),
		cmocka_unit_test(other_families_have_profiles_too),
		cmocka_unit_test(what_is_wrong_has_its_place),
		cmocka_unit_test(a_fault_is_told_once_for_all_its_drives),
		cmocka_unit_test(a_profile_of_a_drive_may_have_what_its_bus_has),
		cmocka_unit_test(a_change_of_it_is_a_change),
		cmocka_unit_test(where_a_setting_stands_is_no_difference),
		cmocka_unit_test(one_that_was_cut_off_is_seen),
		cmocka_unit_test(the_last_good_configuration_has_it),
		cmocka_unit_test(check_prints_what_comes_from_it),
		cmocka_unit_test(a_written_configuration_needs_no_profile),
		cmocka_unit_test(each_example_loads),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
