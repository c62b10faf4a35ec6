/* SPDX-License-Identifier: Apache-2.0 */
/* Who knocks while nobody opens is not sent away: its system would try again only after a second, or three. */
#include "server/listener.h"

#include <arpa/inet.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#define KNOCKING 400

/* For every program. */
static long kernel_limit(void)
{
	FILE *file = fopen("/proc/sys/net/core/somaxconn", "re");
	long limit = 0;

	assert_non_null(file);
	assert_int_equal(fscanf(file, "%ld", &limit), 1);
	fclose(file);
	return limit;
}

static int knock(uint16_t port)
{
	struct sockaddr_in address = { .sin_family = AF_INET, .sin_port = htons(port) };
	int fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);

	assert_true(fd >= 0);
	address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
	(void)!connect(fd, (struct sockaddr *)&address, sizeof(address));
	return fd;
}

static void test_many_knock_at_once(void **state)
{
	struct rlimit descriptors;
	int fds[KNOCKING];
	int listener;

	(void)state;
	assert_int_equal(getrlimit(RLIMIT_NOFILE, &descriptors), 0);
	if (kernel_limit() < KNOCKING || descriptors.rlim_cur < KNOCKING + 32)
		skip();
	listener = db_listener_open(NULL, 0, "127.0.0.1:0");
	assert_true(listener >= 0);
	for (size_t i = 0; i < KNOCKING; i++)
		fds[i] = knock(db_listener_port(listener));
	for (size_t i = 0; i < KNOCKING; i++) {
		/* Who was sent away comes again after a second. */
		struct pollfd wait = { .fd = fds[i], .events = POLLOUT };

		assert_int_equal(poll(&wait, 1, 500), 1);
		close(fds[i]);
	}
	close(listener);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_many_knock_at_once),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
