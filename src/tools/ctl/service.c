/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/say.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum db_ctl_status db_ctl_metrics(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	json_t *answer = db_ctl_call(ctl, "Metrics", NULL, DB_CTL_TIMEOUT_MS, &status);

	(void)count;
	(void)arguments;
	if (answer && ctl->json)
		db_ctl_print_json(answer);
	else if (answer)
		fputs(db_words_text(answer, "text"), stdout);
	json_decref(answer);
	return status;
}

enum db_ctl_status db_ctl_reload(struct db_ctl *ctl, int count, char **arguments)
{
	enum db_ctl_status status;
	json_t *answer = db_ctl_call(ctl, "Reload", NULL, DB_CTL_DRIVE_TIMEOUT_MS, &status);
	json_t *messages = json_object_get(answer, "messages");
	size_t i;
	const json_t *message;

	(void)count;
	(void)arguments;
	if (answer && ctl->json)
		db_ctl_print_json(answer);
	if (answer && !ctl->json) {
		json_array_foreach(messages, i, message)
		{
			db_ctl_translate_lines(stderr, json_string_value(message));
			fputc('\n', stderr);
		}
		if (json_array_size(messages) == 0)
			db_ctl_say_line(stdout, "the configuration is in force");
		else
			fprintf(stderr, "drivebridgectl: %s\n", db_ctl_say("nothing was changed"));
	}
	if (answer && json_array_size(messages) > 0)
		status = DB_CTL_NO;
	json_decref(answer);
	return status;
}

/* --- check: drivebridged itself does the work
 * ------------------------------------------------------ */

/* Where drivebridged is: in this program's folder (a build), in the sbin next to its bin, or where
 * it is installed. */
void db_ctl_find_service(char *path, size_t size)
{
	static const char *const places[] = { "drivebridged", "../sbin/drivebridged" };
	char self[PATH_MAX];
	ssize_t length = readlink("/proc/self/exe", self, sizeof(self) - 1);

	self[length > 0 ? length : 0] = '\0';
	if (strrchr(self, '/'))
		strrchr(self, '/')[1] = '\0';
	for (size_t i = 0; i < sizeof(places) / sizeof(places[0]) && self[0]; i++) {
		if ((size_t)snprintf(path, size, "%s%s", self, places[i]) < size &&
		    access(path, X_OK) == 0)
			return;
	}
	snprintf(path, size, "/usr/sbin/drivebridged");
}

/* Runs the service's check and waits for its end. Returns the lines of its messages, `all`: also of
 * what it prints otherwise. NULL: errno has the reason. */
static json_t *run_check(char *words[], bool all, int *state)
{
	posix_spawn_file_actions_t actions;
	json_t *lines = NULL;
	int ends[2] = { -1, -1 };
	pid_t child = -1;
	FILE *from = NULL;
	char *line = NULL;
	size_t size = 0;
	ssize_t length;
	int error;

	if (pipe2(ends, O_CLOEXEC) != 0)
		return NULL;
	error = posix_spawn_file_actions_init(&actions);
	if (error == 0) {
		error = posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
		if (error == 0 && all)
			error = posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
		if (error == 0)
			error = posix_spawn(&child, words[0], &actions, NULL, words, environ);
		(void)posix_spawn_file_actions_destroy(&actions);
	}
	(void)close(ends[1]);
	if (error == 0)
		from = fdopen(ends[0], "r");
	if (from) {
		lines = json_array();
		while ((length = getline(&line, &size, from)) > 0)
			(void)json_array_append_new(
				lines,
				json_stringn(line, (size_t)length - (line[length - 1] == '\n')));
		free(line);
		(void)fclose(from);
	} else {
		error = error != 0 ? error : errno;
		(void)close(ends[0]);
	}
	if (child > 0)
		(void)waitpid(child, state, 0);
	errno = error;
	return lines;
}

enum db_ctl_status db_ctl_check(struct db_ctl *ctl, int count, char **arguments)
{
	char path[PATH_MAX];
	char check[] = "--check";
	char config[] = "--config";
	char *words[] = { path, check, count > 0 ? config : NULL, count > 0 ? arguments[0] : NULL,
		          NULL };
	int state = 0;
	json_t *lines = NULL;
	const json_t *line;
	size_t i;

	db_ctl_find_service(path, sizeof(path));
	(void)fflush(stdout);
	/* In another language its messages are translated here; the service itself speaks English.
	 */
	if (ctl->json || db_ctl_language())
		lines = run_check(words, ctl->json, &state);
	else
		(void)execv(path, words);
	if (!lines)
		return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_UNREACHABLE, "%s: %s",
		                       path, strerror(errno));
	if (ctl->json) {
		bool right = WIFEXITED(state) && WEXITSTATUS(state) == 0;
		json_t *object = json_pack("{s:O, s:b}", "lines", lines, "right", right);

		db_ctl_print_json(object);
		json_decref(object);
		json_decref(lines);
		return right ? DB_CTL_OK : DB_CTL_NO;
	}
	json_array_foreach(lines, i, line)
	{
		db_ctl_translate_lines(stderr, json_string_value(line));
		fputc('\n', stderr);
	}
	json_decref(lines);
	return WIFEXITED(state) ? (enum db_ctl_status)WEXITSTATUS(state) : DB_CTL_NO;
}
