/* SPDX-License-Identifier: Apache-2.0 */
#include "upgrade/upgrade.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define PROGRAM                                                                                \
	"55d0c0a00000-55d0c0a20000 r--p 00000000 fe:00 4711    /usr/sbin/drivebridged\n"       \
	"55d0c0a20000-55d0c0ac0000 r-xp 00020000 fe:00 4711    /usr/sbin/drivebridged%s\n"     \
	"55d0c0b00000-55d0c0b21000 rw-p 00000000 00:00 0       [heap]\n"                       \
	"7f0000000000-7f0000021000 rw-p 00000000 00:00 0 \n"                                   \
	"7f1000000000-7f1000021000 r-xp 00000000 fe:00 4712    /usr/lib/x/libjansson.so.4%s\n" \
	"7ffc00000000-7ffc00021000 r-xp 00000000 00:00 0       [vdso]\n"

/* What is found in these maps, with texts behind the names of program and library. */
static void expect(const char *program, const char *library, const char *more, const char *found)
{
	char text[2048];
	FILE *maps;
	char *path;
	int length = snprintf(text, sizeof text, PROGRAM "%s", program, library, more);

	maps = fmemopen(text, (size_t)length, "r");
	assert_non_null(maps);
	path = db_upgrade_find(maps, "/usr/sbin/named");
	fclose(maps);
	if (found)
		assert_string_equal(path, found);
	else
		assert_null(path);
	free(path);
}

static void what_was_replaced_is_found(void **state)
{
	(void)state;
	expect("", "", "", NULL);
	expect(" (deleted)", "", "", "/usr/sbin/drivebridged");
	expect("", " (deleted)", "", "/usr/lib/x/libjansson.so.4");
	expect(" (deleted)", " (deleted)", "", "/usr/sbin/drivebridged");
}

static void what_is_no_code_or_has_no_file_is_not(void **state)
{
	(void)state;
	expect("", "", "7f2000000000-7f2000021000 rw-s 00000000 00:01 5 /dev/shm/x (deleted)\n",
	       NULL);
	expect("", "", "7f2000000000-7f2000021000 r--p 00000000 fe:00 5 /var/cache/x (deleted)\n",
	       NULL);
	expect("", "", "7f2000000000-7f2000021000 r-xp 00000000 00:01 5 /memfd:x (deleted)\n",
	       NULL);
	expect("", "", "7f2000000000-7f2000021000 r-xp 00000000 00:01 5 anon (deleted)\n", NULL);
	expect("", "", "7f2000000000-7f2000021000 r-xp\n\n(deleted)\n", NULL);
	/* A name may have what it likes. */
	expect("", "", "7f2000000000-7f2000021000 r-xp 00000000 fe:00 5 /a (deleted) b\n", NULL);
	expect("", "", "7f2000000000-7f2000021000 r-xp 00000000 fe:00 5 /a b (deleted)\n", "/a b");
}

/* ExecPaths= of a unit mounts the program's file by itself, and that goes with the name. */
static void what_has_lost_its_path_is_the_program(void **state)
{
	(void)state;
	expect("", "", "7f2000000000-7f2000021000 r-xp 00000000 fe:00 5 / (deleted)\n",
	       "/usr/sbin/named");
	expect("", "", "7f2000000000-7f2000021000 r-xp 00000000 fe:00 5 /\n", NULL);
}

static void this_program_is_as_on_the_disk(void **state)
{
	char *path = db_upgrade_look();

	(void)state;
	assert_null(path);
	free(path);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_was_replaced_is_found),
		cmocka_unit_test(what_is_no_code_or_has_no_file_is_not),
		cmocka_unit_test(what_has_lost_its_path_is_the_program),
		cmocka_unit_test(this_program_is_as_on_the_disk),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
