/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/process.h"

#include <ctype.h>
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

void db_process_words(pid_t process, char text[DB_PROCESS_WORDS_MAX])
{
	char path[40];
	char name[17] = ""; /* the kernel keeps 15 characters */
	ssize_t count = 0;
	int fd;

	snprintf(path, sizeof(path), "/proc/%ld/comm", (long)process);
	fd = open(path, O_RDONLY | O_CLOEXEC);
	if (fd >= 0) {
		count = read(fd, name, sizeof(name) - 1);
		close(fd);
	}
	/* A name may contain any bytes, and ends with a line end. */
	for (ssize_t i = 0; i < count; i++) {
		if (name[i] == '\n')
			name[i] = '\0';
		else if (!isprint((unsigned char)name[i]))
			name[i] = '?';
	}
	if (name[0])
		snprintf(text, DB_PROCESS_WORDS_MAX, "%s (process %ld)", name, (long)process);
	else
		snprintf(text, DB_PROCESS_WORDS_MAX, "process %ld", (long)process);
}
