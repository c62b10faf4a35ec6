/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
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
		(void)fputs(db_words_text(answer, "text"), stdout);
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
		json_array_foreach(messages, i, message)(void)
			fprintf(stderr, "%s\n", json_string_value(message));
		if (json_array_size(messages) == 0)
			(void)puts("the configuration is in force");
		else
			(void)fputs("drivebridgectl: nothing was changed\n", stderr);
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
	(void)snprintf(path, size, "/usr/sbin/drivebridged");
}

/* The child's lines on both of its outputs. */
static json_t *collect_lines(FILE *from)
{
	json_t *lines = json_array();
	char *line = NULL;
	size_t size = 0;
	ssize_t length;

	while ((length = getline(&line, &size, from)) > 0)
		(void)json_array_append_new(
			lines, json_stringn(line, (size_t)length - (line[length - 1] == '\n')));
	free(line);
	return lines;
}

enum db_ctl_status db_ctl_check(struct db_ctl *ctl, int count, char **arguments)
{
	char path[PATH_MAX];
	char check[] = "--check";
	char config[] = "--config";
	char *words[] = { path, check, count > 0 ? config : NULL, count > 0 ? arguments[0] : NULL,
		          NULL };
	int ends[2] = { -1, -1 };
	int state = 0;
	FILE *from;
	pid_t child;
	json_t *object;

	db_ctl_find_service(path, sizeof(path));
	if (!ctl->json) {
		(void)execv(path, words);
		return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_UNREACHABLE, "%s: %s",
		                       path, strerror(errno));
	}
	if (pipe2(ends, O_CLOEXEC) != 0)
		return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_UNREACHABLE, "%s: %s",
		                       path, strerror(errno));
	child = fork();
	if (child < 0) {
		int error = errno;

		(void)close(ends[0]);
		(void)close(ends[1]);
		return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_UNREACHABLE, "%s: %s",
		                       path, strerror(error));
	}
	if (child == 0) {
		(void)dup2(ends[1], STDOUT_FILENO);
		(void)dup2(ends[1], STDERR_FILENO);
		(void)execv(path, words);
		_exit(127);
	}
	(void)close(ends[1]);
	from = fdopen(ends[0], "r");
	object = json_pack("{s:o}", "lines", from ? collect_lines(from) : json_array());
	if (from)
		(void)fclose(from);
	else
		(void)close(ends[0]);
	(void)waitpid(child, &state, 0);
	(void)json_object_set_new(object, "right",
	                          json_boolean(WIFEXITED(state) && WEXITSTATUS(state) == 0));
	db_ctl_print_json(object);
	json_decref(object);
	return WIFEXITED(state) && WEXITSTATUS(state) == 0 ? DB_CTL_OK : DB_CTL_NO;
}
