/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/process.h"
#include "transport/transport_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/sysmacros.h>
#include <unistd.h>
#include <cmocka.h>

static pid_t find(const char *text, unsigned high, unsigned low, ino_t inode)
{
	FILE *locks = fmemopen((char *)(uintptr_t)text, strlen(text), "r");
	pid_t holder;

	assert_non_null(locks);
	holder = db_port_holder_in(locks, makedev(high, low), inode);
	fclose(locks);
	return holder;
}

static void who_has_it_locked_is_found(void **state)
{
	static const char text[] = "1: POSIX  ADVISORY  READ  4 fd:01:131 128 128\n"
				   "2: FLOCK  ADVISORY  WRITE 1234 00:1a:3 0 EOF\n"
				   "2: -> FLOCK  ADVISORY  WRITE 99 00:1a:4 0 EOF\n"
				   "3: OFDLCK ADVISORY  WRITE -1 00:05:77 0 EOF\n"
				   "what nobody knows\n"
				   "4: FLOCK  ADVISORY  WRITE 5 00:05:88 0 EOF";

	(void)state;
	assert_int_equal(find(text, 0, 0x1a, 3), 1234);
	assert_int_equal(find(text, 0xfd, 1, 131), 4);
	assert_int_equal(find(text, 0, 5, 88), 5);
	/* Who waits for it has it not, nor has a lock of nobody's; another file system has such a number, too. */
	assert_int_equal(find(text, 0, 0x1a, 4), 0);
	assert_int_equal(find(text, 0, 5, 77), 0);
	assert_int_equal(find(text, 1, 0x1a, 3), 0);
	assert_int_equal(find(text, 0, 5, 3), 0);
}

static void a_process_is_named(void **state)
{
	char text[DB_PROCESS_WORDS_MAX];
	char ends[32];

	(void)state;
	db_process_words(getpid(), text);
	(void)snprintf(ends, sizeof ends, " (process %ld)", (long)getpid());
	assert_non_null(strstr(text, ends));
	assert_true(strncmp(text, "transport_test", 14) == 0 ||
	            strncmp(text, "test_holder", 11) == 0);
	db_process_words(0x7ffffff0, text);
	assert_string_equal(text, "process 2147483632");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(who_has_it_locked_is_found),
		cmocka_unit_test(a_process_is_named),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
