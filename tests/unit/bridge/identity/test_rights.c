/* SPDX-License-Identifier: Apache-2.0 */
/* What users of this machine may do: by their groups, as the files of the machine have them. */
#include "identity/rights.h"

#include <grp.h>
#include <pwd.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#define NO_GROUP ((char *)"no-such-group")
#define EVERYBODY ((char *)DB_EVERYBODY)
#define NOBODY_AT_ALL 4000000000u /* a number that no user has */

/* Two users of this machine, neither root nor this one, with different first groups; each group has its name. */
static uid_t users[2];
static gid_t gids[2];
static char names[2][64];
static char groups[2][64];

static int find_users(void **state)
{
	const struct passwd *entry;
	size_t count = 0;

	(void)state;
	setpwent();
	while (count < 2 && (entry = getpwent()) != NULL) {
		const struct group *group;

		if (entry->pw_uid == 0 || entry->pw_uid == geteuid() || entry->pw_gid == 0 ||
		    strlen(entry->pw_name) >= DB_CLIENT_PROCESS_USER_MAX ||
		    (count == 1 && entry->pw_gid == gids[0]))
			continue;
		users[count] = entry->pw_uid;
		gids[count] = entry->pw_gid;
		snprintf(names[count], sizeof(names[0]), "%s", entry->pw_name);
		group = getgrgid(entry->pw_gid);
		/* One whom the file of groups names in none is easy to judge. */
		if (!group || group->gr_mem[0])
			continue;
		snprintf(groups[count], sizeof(groups[0]), "%s", group->gr_name);
		count++;
	}
	endpwent();
	return count == 2 ? 0 : -1;
}

static struct db_rights rights_of(char *act, char *read)
{
	const struct db_control_config config = { .act_group = act, .read_group = read };

	return db_rights_of(&config);
}

static void root_and_the_services_own_user_may_act(void **state)
{
	struct db_rights rights = rights_of(NO_GROUP, NO_GROUP);

	(void)state;
	assert_int_equal(db_rights_of_user(&rights, 0), DB_RIGHT_ACT);
	assert_int_equal(db_rights_of_user(&rights, geteuid()), DB_RIGHT_ACT);
	assert_int_equal(db_rights_of_user(&rights, users[0]), DB_RIGHT_NONE);
	assert_int_equal(db_rights_of_user(&rights, NOBODY_AT_ALL), DB_RIGHT_NONE);
}

/* A group that does not exist has no members. */
static void members_of_the_groups_may_act_or_read(void **state)
{
	struct db_rights rights = rights_of(groups[0], groups[1]);

	(void)state;
	assert_int_equal(db_rights_of_user(&rights, users[0]), DB_RIGHT_ACT);
	assert_int_equal(db_rights_of_user(&rights, users[1]), DB_RIGHT_READ);
	assert_int_equal(db_rights_of_user(&rights, NOBODY_AT_ALL), DB_RIGHT_NONE);
	rights = rights_of(NO_GROUP, groups[0]);
	assert_int_equal(db_rights_of_user(&rights, users[0]), DB_RIGHT_READ);
	assert_int_equal(db_rights_of_user(&rights, users[1]), DB_RIGHT_NONE);
	rights = rights_of(groups[1], NO_GROUP);
	assert_int_equal(db_rights_of_user(&rights, users[0]), DB_RIGHT_NONE);
	assert_int_equal(db_rights_of_user(&rights, users[1]), DB_RIGHT_ACT);
}

static void everybody_may_read_where_it_says_so(void **state)
{
	struct db_rights rights = rights_of(groups[0], EVERYBODY);

	(void)state;
	assert_int_equal(db_rights_of_user(&rights, users[0]), DB_RIGHT_ACT);
	assert_int_equal(db_rights_of_user(&rights, users[1]), DB_RIGHT_READ);
	assert_int_equal(db_rights_of_user(&rights, NOBODY_AT_ALL), DB_RIGHT_READ);
	/* That is no group to act. */
	rights = rights_of(EVERYBODY, NO_GROUP);
	assert_int_equal(db_rights_of_user(&rights, users[0]), DB_RIGHT_NONE);
}

/* The kernel says who is at the other end; at no other end there is nobody. */
static void the_other_end_of_a_connection_is_vouched_for(void **state)
{
	struct db_rights rights = rights_of(NO_GROUP, NO_GROUP);
	uid_t user = 12345;
	int ends[2];
	int pipes[2];

	(void)state;
	assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
	assert_int_equal(pipe(pipes), 0);
	assert_int_equal(db_rights_find(&rights, ends[0], &user), DB_RIGHT_ACT);
	assert_int_equal(user, getuid());
	assert_int_equal(db_rights_find(&rights, pipes[0], &user), DB_RIGHT_NONE);
	assert_int_equal(user, (uid_t)-1);
	rights = rights_of(NO_GROUP, EVERYBODY);
	assert_int_equal(db_rights_find(&rights, pipes[0], &user), DB_RIGHT_NONE);
	close(ends[0]);
	close(ends[1]);
	close(pipes[0]);
	close(pipes[1]);
}

static void users_have_names(void **state)
{
	char name[DB_CLIENT_PROCESS_USER_MAX];

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		db_rights_name(users[i], name);
		assert_string_equal(name, names[i]);
	}
	db_rights_name(0, name);
	assert_string_equal(name, "root");
	db_rights_name(NOBODY_AT_ALL, name);
	assert_string_equal(name, "");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(root_and_the_services_own_user_may_act),
		cmocka_unit_test(members_of_the_groups_may_act_or_read),
		cmocka_unit_test(everybody_may_read_where_it_says_so),
		cmocka_unit_test(the_other_end_of_a_connection_is_vouched_for),
		cmocka_unit_test(users_have_names),
	};

	return cmocka_run_group_tests_name("identity: rights", tests, find_users, NULL);
}
