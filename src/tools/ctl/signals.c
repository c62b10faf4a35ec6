/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"

#include <poll.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

static void list_signals(sigset_t *set)
{
	static const int ours[] = { SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP, SIGWINCH };

	(void)sigemptyset(set);
	for (unsigned i = 0; i < sizeof(ours) / sizeof(ours[0]); i++)
		(void)sigaddset(set, ours[i]);
}

int db_ctl_signals_open(void)
{
	sigset_t set;

	list_signals(&set);
	if (sigprocmask(SIG_BLOCK, &set, NULL) != 0)
		return -1;
	return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

void db_ctl_signals_close(int fd)
{
	sigset_t set;

	list_signals(&set);
	if (fd >= 0)
		(void)close(fd);
	(void)sigprocmask(SIG_UNBLOCK, &set, NULL);
}

int db_ctl_signals_read(int fd)
{
	struct signalfd_siginfo info;

	return read(fd, &info, sizeof(info)) == (ssize_t)sizeof(info) ? (int)info.ssi_signo : 0;
}

int db_ctl_follow(struct db_ctl *ctl, int signals, int timeout_ms)
{
	struct pollfd fds[2] = { db_client_poll_fd(ctl->client),
		                 { .fd = signals, .events = POLLIN } };
	int ready = poll(fds, 2, timeout_ms);
	int number = db_ctl_signals_read(signals);

	if (number != 0 && number != SIGWINCH && number != SIGTSTP)
		return -1;
	(void)db_client_handle(ctl->client);
	return ready == 0 ? 0 : 1;
}
