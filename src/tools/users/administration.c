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

		(void)fputs(prompt, stderr);
		silent.c_lflag &= ~(tcflag_t)ECHO;
		(void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &silent);
	}
	good = fgets(line, (int)size, stdin) && strchr(line, '\n');
	line[strcspn(line, "\r\n")] = '\0';
	if (terminal) {
		(void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &before);
		(void)fputs("\n", stderr);
	}
	return good || (line[0] != '\0' && feof(stdin));
}

static bool read_password(const struct db_users_keeper *keeper, char *password, size_t size)
{
	char again[DB_USERS_PASSWORD_MAX + 2] = "";
	bool good = read_line("Password: ", password, size);

	if (!good || strlen(password) < DB_USERS_PASSWORD_MIN) {
		(void)fprintf(stderr, "%s: a password has %d to %d bytes\n", keeper->program,
		              DB_USERS_PASSWORD_MIN, DB_USERS_PASSWORD_MAX);
		return false;
	}
	if (isatty(STDIN_FILENO) && (!read_line("The same again: ", again, sizeof(again)) ||
	                             strcmp(password, again) != 0)) {
		(void)fprintf(stderr, "%s: these are two different passwords\n", keeper->program);
		good = false;
	}
	explicit_bzero(again, sizeof(again));
	return good;
}

bool db_users_task_is_good(const struct db_users_task *task)
{
	enum db_role role;

	return !(task->add && task->remove) && (task->add != NULL) == (task->role != NULL) &&
	       (!task->role || db_role_read(task->role, &role));
}

int db_users_administer(const struct db_users_keeper *keeper, const char *path,
                        const struct db_users_task *task)
{
	char password[DB_USERS_PASSWORD_MAX + 2] = "";
	struct db_user user = { .role = DB_ROLE_NONE };
	const char *add = task->add;
	bool good = true;

	if (task->role)
		(void)db_role_read(task->role, &user.role);
	if (add && !db_users_name_is_good(add)) {
		(void)fprintf(
			stderr,
			"%s: a name has 1 to %d letters, digits, '.', '-' and '_', a letter or "
			"digit first\n",
			keeper->program, DB_USERS_NAME_MAX);
		return 2;
	}
	if (add) {
		good = read_password(keeper, password, sizeof(password));
		if (good && !db_users_hash(password, user.hash, sizeof(user.hash))) {
			(void)fprintf(stderr, "%s: no hash: %s\n", keeper->program,
			              strerror(errno));
			good = false;
		}
		explicit_bzero(password, sizeof(password));
	}
	if (good)
		good = db_users_change(keeper, path, add ? add : task->remove, user.role,
		                       add ? user.hash : NULL, stderr);
	explicit_bzero(&user, sizeof(user));
	return good ? EXIT_SUCCESS : EXIT_FAILURE;
}
