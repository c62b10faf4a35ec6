/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/terminal.h"

#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#define PATH_LETTERS 1024

extern char **environ;

bool db_ctl_plot_is_picture(const char *picture)
{
	size_t length = strlen(picture);

	return strcmp(picture, "terminal") == 0 ||
	       (length > 4 && length < PATH_LETTERS && strcmp(picture + length - 4, ".svg") == 0);
}

/* In quotes for gnuplot, which doubles a quote inside. */
static void quote(const char *path, char text[2 * PATH_LETTERS + 3])
{
	size_t used = 0;

	text[used++] = '\'';
	for (size_t i = 0; i < PATH_LETTERS && path[i] != '\0'; i++) {
		if (path[i] == '\'')
			text[used++] = '\'';
		text[used++] = path[i];
	}
	text[used++] = '\'';
	text[used] = '\0';
}

enum db_ctl_status db_ctl_plot(const struct db_ctl *ctl, const char *csv, size_t columns,
                               const char *picture)
{
	char data[2 * PATH_LETTERS + 3];
	char output[2 * PATH_LETTERS + 3];
	char terminal[2 * PATH_LETTERS + 128];
	char script[8 * PATH_LETTERS];
	unsigned lines = 24;
	unsigned width = 80;
	char *arguments[] = { (char[]){ "gnuplot" }, (char[]){ "-e" }, script, NULL };
	int ended = 0;
	pid_t child;
	int error;

	quote(csv, data);
	quote(picture, output);
	db_ctl_terminal_size(&lines, &width);
	if (strcmp(picture, "terminal") == 0)
		snprintf(terminal, sizeof(terminal), "set terminal dumb noenhanced %u %u", width,
		         lines > 1 ? lines - 1 : lines);
	else
		snprintf(terminal, sizeof(terminal),
		         "set terminal svg noenhanced size 1000,600; set output %s", output);
	snprintf(script, sizeof(script),
	         "%s; set datafile separator ','; set key autotitle columnhead below; "
	         "set xlabel 'seconds'; set grid; plot for [i=3:%zu] %s using 1:i with lines",
	         terminal, columns, data);
	(void)fflush(stdout);
	error = posix_spawnp(&child, "gnuplot", NULL, NULL, arguments, environ);
	if (error == ENOENT)
		return db_ctl_complain(
			ctl, DB_CTL_NO, "io.drivebridge.Client.NoGnuplot",
			"gnuplot is not installed, so there is no picture; apt install "
			"gnuplot-nox brings it. The values are in %s",
			csv);
	if (error != 0)
		return db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.NoGnuplot",
		                       "gnuplot does not start: %s", strerror(error));
	while (waitpid(child, &ended, 0) < 0 && errno == EINTR)
		;
	if (!WIFEXITED(ended) || WEXITSTATUS(ended) != 0)
		return db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.NoGnuplot",
		                       "gnuplot made no picture of %s", csv);
	return DB_CTL_OK;
}
