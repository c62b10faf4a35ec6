/* SPDX-License-Identifier: Apache-2.0 */
#include "identity/local_user.h"

#include <netinet/in.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#define SOMEBODY_ELSE 65534

/* A listening socket on the loopback, and its address. */
struct rig {
	int listener;
	socklen_t size;
	struct sockaddr_storage address;
};

static void listen_on(struct rig *rig, int family, int only_v6)
{
	struct sockaddr_in v4 = { .sin_family = AF_INET,
		                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
	struct sockaddr_in6 v6 = { .sin6_family = AF_INET6 };

	memset(rig, 0, sizeof *rig);
	rig->listener = socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0);
	assert_true(rig->listener >= 0);
	if (family == AF_INET) {
		rig->size = sizeof v4;
		memcpy(&rig->address, &v4, sizeof v4);
	} else {
		rig->size = sizeof v6;
		if (only_v6)
			v6.sin6_addr = in6addr_loopback;
		memcpy(&rig->address, &v6, sizeof v6);
		assert_int_equal(setsockopt(rig->listener, IPPROTO_IPV6, IPV6_V6ONLY, &only_v6,
		                            sizeof only_v6),
		                 0);
	}
	assert_int_equal(bind(rig->listener, (struct sockaddr *)&rig->address, rig->size), 0);
	assert_int_equal(listen(rig->listener, 4), 0);
	assert_int_equal(getsockname(rig->listener, (struct sockaddr *)&rig->address, &rig->size),
	                 0);
}

static int call(const struct rig *rig)
{
	int fd = socket(rig->address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);

	assert_int_equal(connect(fd, (const struct sockaddr *)&rig->address, rig->size), 0);
	return fd;
}

static void check_own_user(struct rig *rig)
{
	uid_t user = 12345;
	int client = call(rig);
	int fd = accept(rig->listener, NULL, NULL);

	assert_int_equal(db_local_user(fd, &user), DB_LOCAL_USER);
	assert_int_equal(user, geteuid());
	close(client);
	close(fd);
}

static void the_user_of_the_peer(void **state)
{
	struct rig rig;

	(void)state;
	listen_on(&rig, AF_INET, 0);
	check_own_user(&rig);
	close(rig.listener);
	listen_on(&rig, AF_INET6, 1);
	check_own_user(&rig);
	close(rig.listener);
}

/* The server's socket is of IPv6, the client's of IPv4. */
static void ipv4_at_a_socket_for_both(void **state)
{
	struct sockaddr_in v4 = { .sin_family = AF_INET,
		                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
	struct sockaddr_in6 bound;
	struct rig rig;

	(void)state;
	listen_on(&rig, AF_INET6, 0);
	memcpy(&bound, &rig.address, sizeof bound);
	v4.sin_port = bound.sin6_port;
	memset(&rig.address, 0, sizeof rig.address);
	memcpy(&rig.address, &v4, sizeof v4);
	rig.size = sizeof v4;
	check_own_user(&rig);
	close(rig.listener);
}

/* A socket without a process is said to be root's. */
static void a_peer_that_has_gone_has_no_user(void **state)
{
	struct rig rig;
	uid_t user = 12345;
	int fd;

	(void)state;
	listen_on(&rig, AF_INET, 0);
	close(call(&rig));
	fd = accept(rig.listener, NULL, NULL);
	assert_int_equal(db_local_user(fd, &user), DB_LOCAL_UNKNOWN);
	close(fd);
	close(rig.listener);
}

static void another_user(void **state)
{
	struct rig rig;
	uid_t user = 12345;
	int ends[2];
	int status;
	pid_t child;
	int fd;

	(void)state;
	if (geteuid() != 0)
		return; /* only root becomes another user */
	listen_on(&rig, AF_INET, 0);
	assert_int_equal(pipe(ends), 0);
	child = fork();
	if (child == 0) {
		char byte;

		close(ends[1]);
		if (setuid(SOMEBODY_ELSE) == 0)
			(void)call(&rig);
		_exit(read(ends[0], &byte, 1) == 0 ? 0 : 1);
	}
	close(ends[0]);
	fd = accept(rig.listener, NULL, NULL);
	assert_int_equal(db_local_user(fd, &user), DB_LOCAL_USER);
	assert_int_equal(user, SOMEBODY_ELSE);
	close(ends[1]);
	assert_int_equal(waitpid(child, &status, 0), child);
	close(fd);
	close(rig.listener);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_user_of_the_peer),
		cmocka_unit_test(ipv4_at_a_socket_for_both),
		cmocka_unit_test(a_peer_that_has_gone_has_no_user),
		cmocka_unit_test(another_user),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
