/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <stdlib.h>
#include <string.h>

/* A program of its own: libraries of cryptography are not this one's. */
#define PROGRAM "drivebridge-certificate"

enum db_ctl_status db_ctl_certificate(struct db_ctl *ctl, int count, char **arguments)
{
	char *asked[] = { PROGRAM, "--version", NULL };
	char **words = calloc((size_t)count + 8, sizeof(*words));
	char *task = strdup(strchr(ctl->word, ' ') + 1);
	char *folder = ctl->folder ? strdup(ctl->folder) : NULL;
	char *days = ctl->days ? strdup(ctl->days) : NULL;
	enum db_ctl_status status = DB_CTL_NO;
	size_t at = 0;

	if (!words || !task || (ctl->folder && !folder) || (ctl->days && !days)) {
		status = db_ctl_complain(ctl, DB_CTL_NO, DB_CLIENT_NO_MEMORY, "out of memory");
	} else if (!db_ctl_child_run(asked, true)) {
		status = db_ctl_complain(
			ctl, DB_CTL_NO, "io.drivebridge.Client.Missing",
			"certificates are made by drivebridge-certificate; install the "
			"package drivebridge-tls");
	} else {
		words[at++] = PROGRAM;
		if (folder) {
			words[at++] = "--folder";
			words[at++] = folder;
		}
		if (days) {
			words[at++] = "--days";
			words[at++] = days;
		}
		/* What follows is no option. */
		words[at++] = "--";
		words[at++] = task;
		for (int i = 0; i < count; i++)
			words[at++] = arguments[i];
		status = db_ctl_child_run(words, false) ? DB_CTL_OK : DB_CTL_NO;
	}
	free(days);
	free(folder);
	free(task);
	free(words);
	return status;
}
