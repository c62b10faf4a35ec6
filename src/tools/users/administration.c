/* SPDX-License-Identifier: Apache-2.0 */
#include "users/administration.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

/* A line without its end. False: there is none, or it is too long. */
static bool read_line(const char *prompt, char *line, size_t size)
{
	struct termios before;
	bool terminal = isatty(STDIN_FILENO) && tcgetattr(STDIN_FILENO, &before) == 0;
	bool good;

	if (terminal) {
		struct termios silent = before;

		fputs(prompt, stderr);
		silent.c_lflag &= ~(tcflag_t)ECHO;
		(void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &silent);
	}
	good = fgets(line, (int)size, stdin) && strchr(line, '\n');
	line[strcspn(line, "\r\n")] = '\0';
	if (terminal) {
		(void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &before);
		fputs("\n", stderr);
	}
	return good || (line[0] != '\0' && feof(stdin));
}

static bool read_password(const struct db_users_keeper *keeper, const char *user, unsigned least,
                          char *password, size_t size)
{
	char again[DB_PASSWORD_MAX + 2] = "";
	bool good = read_line("Password: ", password, size);
	const char *wrong = good ? db_password_judge(password, user, least) : "there is none";

	if (wrong) {
		fprintf(stderr, "%s: this password is not taken: %s; %u characters or more\n",
		        keeper->program, wrong, least);
		return false;
	}
	if (isatty(STDIN_FILENO) && (!read_line("The same again: ", again, sizeof(again)) ||
	                             strcmp(password, again) != 0)) {
		fprintf(stderr, "%s: these are two different passwords\n", keeper->program);
		good = false;
	}
	explicit_bzero(again, sizeof(again));
	return good;
}

int db_users_count_tasks(const struct db_users_task *task)
{
	int tasks = (task->add != NULL) + (task->remove != NULL) + task->list + task->move;
	enum db_role role;

	return tasks <= 1 && (task->add != NULL) == (task->role != NULL) &&
	                       (task->add || (!task->drives && !task->pam)) &&
	                       (!task->role || db_role_read(task->role, &role)) ?
	               tasks :
	               -1;
}

static int add(const struct db_users_keeper *keeper, const char *path, unsigned least,
               const struct db_users_task *task)
{
	const char *drives = task->drives ? task->drives : "*";
	char password[DB_PASSWORD_MAX + 2] = "";
	struct db_user user = { .pam = task->pam };
	bool good = true;

	(void)db_role_read(task->role, &user.grant.role);
	if (!db_users_name_is_good(task->add)) {
		fprintf(stderr,
		        "%s: a name has 1 to %d letters, digits, '.', '-' and '_', a letter or "
		        "digit first\n",
		        keeper->program, DB_USERS_NAME_MAX);
		return 2;
	}
	if (!db_drives_are_good(drives)) {
		fprintf(stderr, "%s: drives are * or names with commas between them\n",
		        keeper->program);
		return 2;
	}
	snprintf(user.name, sizeof(user.name), "%s", task->add);
	snprintf(user.grant.drives, sizeof(user.grant.drives), "%s", drives);
	if (!task->pam) {
		good = read_password(keeper, task->add, least, password, sizeof(password));
		if (good && !db_password_hash(password, user.hash)) {
			fprintf(stderr, "%s: no hash: %s\n", keeper->program, strerror(errno));
			good = false;
		}
		explicit_bzero(password, sizeof(password));
	}
	good = good && db_users_put(path, &user, NULL, stderr);
	explicit_bzero(&user, sizeof(user));
	return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

static int list(const struct db_users_keeper *keeper, const char *path)
{
	char former[512];
	struct db_users users;
	bool good = db_users_load(&users, path, keeper, stderr);

	db_users_former(path, keeper, former, sizeof(former));
	for (size_t i = 0; i < users.count; i++) {
		const struct db_user *user = &users.list[i];

		printf("%-*s  %-13s  %s%s%s%s\n", DB_USERS_NAME_MAX, user->name,
		       db_role_name(user->grant.role), user->grant.drives,
		       user->pam ? ", password by PAM" : "", user->former ? ", in " : "",
		       user->former ? former : "");
	}
	db_users_clear(&users);
	return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

static int move(const struct db_users_keeper *keeper, const char *path)
{
	char former[512];
	struct db_users users;
	struct db_users rest;
	size_t moved = 0;
	bool good = db_users_load(&users, path, keeper, stderr);

	db_users_former(path, keeper, former, sizeof(former));
	for (size_t i = 0; good && i < users.count; i++) {
		if (!users.list[i].former)
			continue;
		good = db_users_put(path, &users.list[i], NULL, stderr);
		moved += good;
	}
	db_users_clear(&users);
	if (former[0] == '\0' || access(former, F_OK) != 0) {
		fprintf(stderr, "%s: there is no file of before\n", keeper->program);
		return EXIT_FAILURE;
	}
	if (!good)
		return EXIT_FAILURE;
	/* What is left are users who stand in both. */
	good = db_users_load(&rest, former, keeper, stderr);
	for (size_t i = 0; i < rest.count; i++)
		printf("%s: stands in %s already, with that role and password\n", rest.list[i].name,
		       path);
	db_users_clear(&rest);
	if (good && unlink(former) != 0) {
		fprintf(stderr, "%s: %s\n", former, strerror(errno));
		good = false;
	}
	if (good)
		printf("%zu users are in %s now, and %s is gone\n", moved, path, former);
	return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

int db_users_administer(const struct db_users_keeper *keeper, const char *path, unsigned least,
                        const struct db_users_task *task)
{
	if (task->add)
		return add(keeper, path, least, task);
	if (task->list)
		return list(keeper, path);
	if (task->move)
		return move(keeper, path);
	return db_users_remove(path, task->remove, NULL, stderr) ? EXIT_SUCCESS : EXIT_FAILURE;
}
