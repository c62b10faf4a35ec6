/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/say.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

bool db_ctl_child_run(char *const words[], bool quiet)
{
	char room[DB_WORDS_TEXT_MAX];
	int state = 0;
	pid_t child;

	(void)fflush(stdout);
	child = fork();
	if (child == 0) {
		int nowhere = quiet ? open("/dev/null", O_WRONLY | O_CLOEXEC) : -1;

		/* It is closed when the program starts, which gcc's analyzer does not see. */
		if (nowhere >= 0)
			(void)dup2(nowhere, STDOUT_FILENO);
		(void)execvp(words[0], words);
		fprintf(stderr, "%s: %s\n", words[0], db_ctl_translate(strerror(errno), room));
		_exit(127);
	}
	while (child > 0 && waitpid(child, &state, 0) < 0 && errno == EINTR)
		;
	return child > 0 && WIFEXITED(state) && WEXITSTATUS(state) == 0;
}
