/* SPDX-License-Identifier: Apache-2.0 */
#include "users/users.h"

#include "users/administration.h"

#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

static const struct db_users_keeper keeper = { .program = "test", .former = DB_USERS_FORMER_WEB };

#define HASH "$y$j7T$abc$0123456789"
#define OTHER "$y$j7T$abc$9876543210"

static struct db_user user_of(const char *name, enum db_role role, const char *drives)
{
	struct db_user user = { .grant = { .role = role }, .hash = HASH };

	(void)snprintf(user.name, sizeof(user.name), "%s", name);
	(void)snprintf(user.grant.drives, sizeof(user.grant.drives), "%s", drives);
	return user;
}

static void test_lines(void **state)
{
	static const char *const bad[] = {
		"anna",
		"anna:operator",
		"anna:operator:",
		"anna:operator:plain password",
		"anna:operator:pam",
		"anna:operator:!" HASH,
		"anna:operator:" HASH ":1",
		"anna:operator:*:" HASH ":1",
		"anna:operator::" HASH,
		"anna:operator:feeder,:" HASH,
		"anna:operator:a b:" HASH,
		"anna:operator:feeder,*:" HASH,
		"anna:operator:*:",
		"anna:chief:" HASH,
		"anna:chief:*:" HASH,
		"anna:engineer:" HASH,
		"anna:none:" HASH,
		"anna:none:*:" HASH,
		":operator:" HASH,
		".anna:operator:" HASH,
		"an na:operator:" HASH,
		"anna-of-a-name-that-is-much-too-long:operator:" HASH,
		"anna:reader:" HASH "\nanna:reader:" HASH,
	};
	struct db_users users;
	const struct db_user *user;
	char *said = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&said, &size);

	(void)state;
	assert_true(db_users_parse(&users,
	                           "# who may\n\n  \nanna:operator:" HASH "\nrudi:reader:" HASH
	                           "\nolga:operator:feeder,lift:" HASH "\nemil:engineer:*:pam\n"
	                           "ada:administrator:*:" HASH "\nota:reader:*:" HASH,
	                           "f", out));
	assert_int_equal(users.count, 6);
	/* Of before: who might do everything may do it still. */
	user = db_users_find(&users, "anna");
	assert_int_equal(user->grant.role, DB_ROLE_ENGINEER);
	assert_true(db_grant_has_all(&user->grant));
	assert_int_equal(db_users_find(&users, "rudi")->grant.role, DB_ROLE_OBSERVER);
	assert_string_equal(db_users_find(&users, "rudi")->hash, HASH);
	user = db_users_find(&users, "olga");
	assert_int_equal(user->grant.role, DB_ROLE_OPERATOR);
	assert_string_equal(user->grant.drives, "feeder,lift");
	assert_false(user->pam);
	user = db_users_find(&users, "emil");
	assert_true(user->pam);
	assert_string_equal(user->hash, "");
	assert_null(db_users_find(&users, "ann"));
	for (size_t i = 1; i < users.count; i++)
		assert_int_not_equal(db_users_digest(&users.list[0]),
		                     db_users_digest(&users.list[i]));
	db_users_clear(&users);
	(void)fflush(out);
	assert_int_equal(size, 0);
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
		assert_false(db_users_parse(&users, bad[i], "file", out));
		assert_true(users.count <= 1);
		db_users_clear(&users);
		(void)fflush(out);
		assert_non_null(strstr(said, "file:"));
		rewind(out);
	}
	(void)fclose(out);
	free(said);
}

/* A row for what is done, a column for each role; "-": not, "o": of its drives, "a": with all. */
static void test_rights(void **state)
{
	static const struct {
		enum db_may may;
		const char *rights; /* observer, administrator, operator, engineer */
	} rows[] = {
		{ DB_MAY_NOTHING, "xxxx" }, { DB_MAY_LOOK, "xxxx" },     { DB_MAY_STOP, "xxxx" },
		{ DB_MAY_MOVE, "--oo" },    { DB_MAY_ENGINEER, "---o" }, { DB_MAY_MANAGE, "---a" },
		{ DB_MAY_APPOINT, "-x--" }, { DB_MAY_AUDIT, "-o-o" },
	};
	char text[256];

	(void)state;
	assert_int_equal(sizeof(rows) / sizeof(rows[0]), DB_MAYS);
	for (size_t i = 0; i < DB_MAYS; i++) {
		for (enum db_role role = DB_ROLE_OBSERVER; role < DB_ROLES; role++) {
			char right = rows[i].rights[role - DB_ROLE_OBSERVER];
			struct db_grant all = { .role = role, .stops = true, .drives = "*" };
			struct db_grant some = { .role = role,
				                 .stops = true,
				                 .drives = "feeder,lift" };
			bool any = right != '-';

			assert_int_equal(db_grant_has(&all, rows[i].may, "press"), any);
			assert_int_equal(db_grant_has(&all, rows[i].may, ""), any);
			assert_int_equal(db_grant_has(&all, rows[i].may, NULL), any);
			assert_int_equal(db_grant_has(&some, rows[i].may, NULL),
			                 any && right != 'a');
			assert_int_equal(db_grant_has(&some, rows[i].may, "feeder"),
			                 any && right != 'a');
			assert_int_equal(db_grant_has(&some, rows[i].may, "lift"),
			                 any && right != 'a');
			assert_int_equal(db_grant_has(&some, rows[i].may, "lif"), right == 'x');
			assert_int_equal(db_grant_has(&some, rows[i].may, "feeder,lift"),
			                 right == 'x');
			assert_int_equal(db_grant_has(&some, rows[i].may, "press"), right == 'x');
			assert_int_equal(db_grant_has(&some, rows[i].may, ""), right == 'x');
			/* Where readers may not stop, operators do. */
			all.stops = false;
			assert_int_equal(db_grant_has(&all, DB_MAY_STOP, "feeder"),
			                 role >= DB_ROLE_OPERATOR);
		}
	}
	db_grant_explain(&(struct db_grant){ .role = DB_ROLE_OPERATOR, .drives = "lift" },
	                 DB_MAY_MOVE, "press", text, sizeof(text));
	assert_string_equal(text, "press is not among this user's drives: lift");
	db_grant_explain(&(struct db_grant){ .role = DB_ROLE_OPERATOR, .drives = "lift" },
	                 DB_MAY_ENGINEER, "lift", text, sizeof(text));
	assert_string_equal(text, "this needs the role engineer");
	db_grant_explain(&(struct db_grant){ .role = DB_ROLE_OPERATOR, .drives = "*" },
	                 DB_MAY_AUDIT, NULL, text, sizeof(text));
	assert_string_equal(text, "this needs the role engineer or administrator");
}

static void test_what_is_done(void **state)
{
	static const struct {
		const char *command;
		enum db_may may;
		const char *drive;
	} commands[] = {
		{ "stop", DB_MAY_STOP, "lift" },
		{ "quick_stop", DB_MAY_STOP, "lift" },
		{ "disable", DB_MAY_MOVE, "lift" },
		{ "enable", DB_MAY_MOVE, "lift" },
		{ "move_absolute", DB_MAY_MOVE, "lift" },
		{ "clear_fault", DB_MAY_MOVE, "lift" },
		{ "sync_start", DB_MAY_MOVE, "" },
		{ "set_position", DB_MAY_ENGINEER, "lift" },
		{ "raw_frame", DB_MAY_ENGINEER, "" },
		{ "save_parameters", DB_MAY_ENGINEER, "lift" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(commands) / sizeof(commands[0]); i++) {
		const char *drive = "lift";

		assert_int_equal(db_may_of_command(commands[i].command, &drive), commands[i].may);
		assert_string_equal(drive, commands[i].drive);
	}
	assert_int_equal(db_may_of_write("", "group_stop", 1), DB_MAY_STOP);
	assert_int_equal(db_may_of_write("", "group_stop_units", 2), DB_MAY_STOP);
	assert_int_equal(db_may_of_write("", "group_units7", 65535), DB_MAY_STOP);
	/* A load may fall. */
	assert_int_equal(db_may_of_write("", "group_stop", 3), DB_MAY_MOVE);
	assert_int_equal(db_may_of_write("", "group_start", 1), DB_MAY_MOVE);
	assert_int_equal(db_may_of_write("lift", "group_stop", 1), DB_MAY_ENGINEER);
	assert_int_equal(db_may_of_write("lift", "target_position", 1), DB_MAY_MOVE);
	assert_int_equal(db_may_of_write("lift", "control_request", 1), DB_MAY_MOVE);
	assert_int_equal(db_may_of_write("lift", "command", 3), DB_MAY_MANAGE);
	assert_int_equal(db_may_of_write("lift", "watchdog_ms", 0), DB_MAY_ENGINEER);
	assert_int_equal(db_may_of_write("lift", "spd", 1), DB_MAY_ENGINEER);
}

static void test_passwords_are_judged(void **state)
{
	static const char *const bad[] = {
		"",
		"short",
		"eleven char",
		"annaannaanna",
		"Anna-anna-12",
		"aaaaaaaaaaaa",
		"abcabcabcabc",
		"letmeinletmein",
		"abcdefghijkl",
		"123456789012",
		"987654321098",
		"Password1234",
		"P@ssw0rd2026!!",
		"drivebridge2026",
		"1q2w3e4r5t6y",
		"qwertzuiop12",
		"Administrator1",
		"\xC3\xA4\xC3\xA4\xC3\xB6\xC3\xB6\xC3\xBC\xC3\xBC", /* six characters, twelve bytes */
	};
	static const char *const good[] = {
		"the operator's word",
		"grease the lift on mondays",
		"annas-lieblingstier",
		"turns-motors",
		"qqwweerrttyz7",
		"xK4#pT9!vQ2z",
		"turns-motorsturns-motors", /* one of them would do */
		("\xE4\xBD\xA0\xE5\xA5\xBD\xE4\xB8\x96\xE7\x95\x8C\xE6\x9C\xBA\xE5\x99\xA8\xE7\x94\xB5"
		 "\xE6\x9C\xBA\xE6\x9C\xBA\xE5\x81\x9C\xE6\xAD\xA2\xE8\xA1\x8C"),
	};

	(void)state;
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
		assert_non_null(db_password_judge(bad[i], "anna", 12));
	for (size_t i = 0; i < sizeof(good) / sizeof(good[0]); i++)
		assert_null(db_password_judge(good[i], "anna", 12));
	assert_null(db_password_judge("eight ok", "anna", 8));
	assert_non_null(db_password_judge("eight ok", "anna", 12));
	assert_non_null(db_password_judge("test1234", "anna", 8));
}

/* A folder with a file of all programs and the one of before. */
struct plant {
	char folder[40];
	char path[80];
	char former[80];
};

static void make_plant(struct plant *plant, const char *former)
{
	FILE *file;
	char folder[80];

	(void)strcpy(plant->folder, "/tmp/drivebridge-users-XXXXXX");
	assert_non_null(mkdtemp(plant->folder));
	(void)snprintf(folder, sizeof(folder), "%s/access", plant->folder);
	assert_int_equal(mkdir(folder, 0750), 0);
	(void)snprintf(plant->path, sizeof(plant->path), "%s/access/users", plant->folder);
	(void)snprintf(plant->former, sizeof(plant->former), "%s/web-users", plant->folder);
	file = fopen(plant->former, "w");
	assert_non_null(file);
	(void)fputs(former, file);
	(void)fclose(file);
	assert_int_equal(chmod(plant->former, 0640), 0);
}

static void remove_plant(struct plant *plant)
{
	char folder[80];

	(void)snprintf(folder, sizeof(folder), "%s/access", plant->folder);
	(void)unlink(plant->path);
	(void)unlink(plant->former);
	assert_int_equal(rmdir(folder), 0);
	assert_int_equal(rmdir(plant->folder), 0);
}

static void test_users_of_before_count(void **state)
{
	struct db_user anna = user_of("anna", DB_ROLE_OBSERVER, "*");
	struct db_users users;
	struct plant plant;
	uint64_t stamp;

	(void)state;
	make_plant(&plant, "anna:operator:" OTHER "\nrudi:reader:" OTHER "\n");
	assert_true(db_users_load(&users, plant.path, &keeper, stderr));
	assert_int_equal(users.count, 2);
	assert_int_equal(users.former, 2);
	assert_int_equal(db_users_find(&users, "anna")->grant.role, DB_ROLE_ENGINEER);
	db_users_clear(&users);
	stamp = db_users_stamp(plant.path, &keeper);
	assert_int_not_equal(stamp, 0);

	/* Who is in the new file is that one, and his old line is gone: it cannot come back. */
	assert_true(db_users_put(plant.path, &anna, NULL, stderr));
	assert_int_not_equal(db_users_stamp(plant.path, &keeper), stamp);
	assert_true(db_users_load(&users, plant.path, &keeper, stderr));
	assert_int_equal(users.count, 2);
	assert_int_equal(users.former, 1);
	assert_int_equal(db_users_find(&users, "anna")->grant.role, DB_ROLE_OBSERVER);
	db_users_clear(&users);
	assert_true(db_users_remove(plant.path, "anna", NULL, stderr));
	assert_true(db_users_remove(plant.path, "rudi", NULL, stderr));
	assert_true(db_users_load(&users, plant.path, &keeper, stderr));
	assert_int_equal(users.count, 0);
	db_users_clear(&users);
	remove_plant(&plant);
}

static void test_users_of_before_move(void **state)
{
	struct db_users users;
	struct plant plant;

	(void)state;
	make_plant(&plant, "# of before\nanna:operator:" OTHER "\nrudi:reader:" OTHER "\n");
	assert_int_equal(db_users_administer(&keeper, plant.path, 12,
	                                     &(struct db_users_task){ .move = true }),
	                 EXIT_SUCCESS);
	assert_int_not_equal(access(plant.former, F_OK), 0);
	assert_true(db_users_load(&users, plant.path, &keeper, stderr));
	assert_int_equal(users.count, 2);
	assert_int_equal(users.former, 0);
	assert_int_equal(db_users_find(&users, "anna")->grant.role, DB_ROLE_ENGINEER);
	assert_string_equal(db_users_find(&users, "rudi")->hash, OTHER);
	db_users_clear(&users);
	/* Once is enough. */
	assert_int_equal(db_users_administer(&keeper, plant.path, 12,
	                                     &(struct db_users_task){ .move = true }),
	                 EXIT_FAILURE);
	remove_plant(&plant);
}

static void test_a_file_is_changed_as_a_whole(void **state)
{
	struct db_user anna = user_of("anna", DB_ROLE_OPERATOR, "*");
	struct db_user ann = user_of("ann", DB_ROLE_OBSERVER, "lift");
	struct db_user rudi = user_of("rudi", DB_ROLE_OBSERVER, "*");
	char folder[] = "/tmp/drivebridge-users-XXXXXX";
	char path[64];
	struct db_users users;
	struct stat status;
	FILE *file;

	(void)state;
	assert_non_null(mkdtemp(folder));
	(void)snprintf(path, sizeof(path), "%s/users", folder);
	/* None is there: nobody is in it. */
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_int_equal(users.count, 0);
	db_users_clear(&users);
	assert_true(db_users_put(path, &anna, NULL, stderr));
	assert_true(db_users_put(path, &ann, NULL, stderr));
	anna.grant.role = DB_ROLE_OBSERVER;
	assert_true(db_users_put(path, &anna, NULL, stderr));
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_int_equal(users.count, 2);
	assert_int_equal(db_users_find(&users, "anna")->grant.role, DB_ROLE_OBSERVER);
	assert_string_equal(db_users_find(&users, "ann")->grant.drives, "lift");
	db_users_clear(&users);
	assert_int_equal(stat(path, &status), 0);
	assert_int_equal(status.st_mode & 0777, 0640);
	assert_true(db_users_remove(path, "anna", NULL, stderr));
	/* Lines of others, comments too, stay; the mode as well. */
	file = fopen(path, "a");
	assert_non_null(file);
	(void)fputs("# the end", file);
	(void)fclose(file);
	assert_int_equal(chmod(path, 0600), 0);
	assert_true(db_users_put(path, &rudi, NULL, stderr));
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_int_equal(users.count, 2);
	db_users_clear(&users);
	assert_int_equal(stat(path, &status), 0);
	assert_int_equal(status.st_mode & 0777, 0600);
	assert_int_equal(chmod(path, 0604), 0);
	assert_false(db_users_load(&users, path, &keeper, NULL));
	assert_int_equal(users.count, 0);
	db_users_clear(&users);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(rmdir(folder), 0);
}

/* The end of what is said about a change; "": it was made. */
static const char *try_put(const struct plant *plant, const struct db_user *user,
                           const struct db_users_terms *terms)
{
	static char said[256];
	FILE *out = fmemopen(said, sizeof(said), "w");
	bool done;

	assert_non_null(out);
	memset(said, 0, sizeof(said));
	done = user->hash[0] || user->pam ? db_users_put(plant->path, user, terms, out) :
	                                    db_users_remove(plant->path, user->name, terms, out);
	(void)fclose(out);
	assert_int_equal(done, said[0] == '\0');
	return done ? "" : strstr(said, ": ") + 2;
}

static void test_a_change_has_terms(void **state)
{
	static const char last[] = "no administrator who can log in would be left\n";
	struct db_user ada = user_of("ada", DB_ROLE_ADMINISTRATOR, "*");
	struct db_user bea = user_of("bea", DB_ROLE_ADMINISTRATOR, "*");
	struct db_user egon = user_of("egon", DB_ROLE_ENGINEER, "*");
	struct db_user fresh = user_of("egon", DB_ROLE_OPERATOR, "*");
	struct db_user gone = { .name = "bea" };
	struct db_user former = { .name = "rudi" };
	struct db_users_terms terms = { .keeper = &keeper, .by = "bea" };
	struct db_users users;
	struct plant plant;

	(void)state;
	make_plant(&plant, "rudi:reader:" OTHER "\n");
	assert_true(db_users_put(plant.path, &ada, NULL, stderr));
	assert_true(db_users_put(plant.path, &bea, NULL, stderr));
	assert_true(db_users_put(plant.path, &egon, NULL, stderr));
	/* Only who stands there as he was seen. */
	assert_string_equal(try_put(&plant, &fresh, &terms),
	                    "the user egon was changed meanwhile\n");
	terms.before = &egon;
	assert_string_equal(try_put(&plant, &fresh, &terms), "");
	assert_string_equal(try_put(&plant, &fresh, &terms),
	                    "the user egon was changed meanwhile\n");
	/* Also one of before. */
	assert_true(db_users_load(&users, plant.path, &keeper, stderr));
	terms.before = db_users_find(&users, "rudi");
	assert_string_equal(try_put(&plant, &former, &terms), "");
	assert_string_equal(try_put(&plant, &former, &terms),
	                    "the user rudi was changed meanwhile\n");
	db_users_clear(&users);
	/* Two administrators remove each other, or themselves: one is left. */
	terms.before = &bea;
	terms.by = "ada";
	assert_string_equal(try_put(&plant, &gone, &terms), "");
	terms.before = &ada;
	terms.by = "bea";
	(void)strcpy(gone.name, "ada");
	assert_string_equal(try_put(&plant, &gone, &terms), "bea is no administrator any more\n");
	terms.by = "ada";
	assert_string_equal(try_put(&plant, &gone, &terms), last);
	fresh = user_of("ada", DB_ROLE_OBSERVER, "*");
	assert_string_equal(try_put(&plant, &fresh, &terms), last);
	/* One whose password nothing can check is none; whoever does not change that may. */
	fresh = (struct db_user){ .name = "ada", .grant = ada.grant, .pam = true };
	assert_string_equal(try_put(&plant, &fresh, &terms), last);
	bea.hash[0] = '\0';
	bea.pam = true;
	assert_true(db_users_put(plant.path, &bea, NULL, stderr));
	assert_string_equal(try_put(&plant, &gone, &terms), last);
	terms.pam = true;
	assert_string_equal(try_put(&plant, &gone, &terms), "");
	terms = (struct db_users_terms){ .keeper = &keeper, .by = "bea" };
	fresh = user_of("otto", DB_ROLE_OBSERVER, "*");
	assert_string_equal(try_put(&plant, &fresh, &terms), "");
	remove_plant(&plant);
}

static void test_a_lock_is_not_waited_for_for_ever(void **state)
{
	struct db_user ada = user_of("ada", DB_ROLE_ADMINISTRATOR, "*");
	struct timespec begin;
	struct timespec end;
	char folder[80];
	struct plant plant;
	int lock;

	(void)state;
	make_plant(&plant, "");
	(void)snprintf(folder, sizeof(folder), "%s/access", plant.folder);
	lock = open(folder, O_RDONLY | O_DIRECTORY);
	assert_true(lock >= 0);
	assert_int_equal(flock(lock, LOCK_EX), 0);
	(void)clock_gettime(CLOCK_MONOTONIC, &begin);
	assert_string_equal(try_put(&plant, &ada, NULL),
	                    "another program is changing it; try again\n");
	(void)clock_gettime(CLOCK_MONOTONIC, &end);
	assert_true(end.tv_sec - begin.tv_sec >= 1);
	(void)close(lock);
	assert_string_equal(try_put(&plant, &ada, NULL), "");
	remove_plant(&plant);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_lines),
		cmocka_unit_test(test_rights),
		cmocka_unit_test(test_what_is_done),
		cmocka_unit_test(test_passwords_are_judged),
		cmocka_unit_test(test_users_of_before_count),
		cmocka_unit_test(test_users_of_before_move),
		cmocka_unit_test(test_a_file_is_changed_as_a_whole),
		cmocka_unit_test(test_a_change_has_terms),
		cmocka_unit_test(test_a_lock_is_not_waited_for_for_ever),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
