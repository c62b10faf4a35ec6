/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/axis.h"
#include "drivebridge/result.h"
#include "registers/export.h"
#include "registers/export_st.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define FIELDS_MAX 16

static char *export(int (*document)(FILE *out))
{
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	assert_int_equal(document(out), 0);
	fclose(out);
	return text;
}

/* Takes one record apart in place. Returns where the next begins. */
static char *record(char *at, char **fields, size_t *count)
{
	char *to;

	for (*count = 0;; at++) {
		assert_true(*count < FIELDS_MAX);
		fields[(*count)++] = to = at + (*at == '"');
		if (*at == '"') {
			for (at++; *at != '"' || at[1] == '"'; at++) {
				assert_int_not_equal(*at, '\0');
				at += *at == '"';
				*to++ = *at;
			}
			at++;
		} else {
			/* With a function of the library the sanitizer reads the whole rest each time. */
			while (*at != ',' && *at != '\n') {
				assert_int_not_equal(*at, '\0');
				at++;
			}
			to = at;
		}
		assert_true(*at == ',' || *at == '\n');
		if (*at == '\n') {
			*to = '\0';
			return at + 1;
		}
		*to = '\0';
	}
}

enum column { VIEW, TABLE, ADDRESS, REFERENCE, NAME, TYPE, ACCESS, UNIT, MIN, MAX, FAMILIES, TEXT };

static void registers_parse(void **state)
{
	char *text = export(db_export_csv);
	char *fields[FIELDS_MAX];
	size_t count;
	char *at = record(text, fields, &count);
	unsigned lines = 0;

	(void)state;
	assert_int_equal(count, 12);
	assert_string_equal(fields[REFERENCE], "reference");
	while (*at) {
		unsigned long first = 1;

		at = record(at, fields, &count);
		assert_int_equal(count, 12);
		assert_true(strcmp(fields[VIEW], "drive") == 0 ||
		            strcmp(fields[VIEW], "gateway") == 0 ||
		            strcmp(fields[VIEW], "vsmd") == 0);
		if (strcmp(fields[TABLE], "holding") == 0)
			first = 40001;
		else if (strcmp(fields[TABLE], "discrete") == 0)
			first = 10001;
		else if (strcmp(fields[TABLE], "input") == 0)
			first = 30001;
		else
			assert_string_equal(fields[TABLE], "coil");
		assert_int_equal(strlen(fields[REFERENCE]), 5);
		assert_int_equal(strtoul(fields[REFERENCE], NULL, 10),
		                 strtoul(fields[ADDRESS], NULL, 10) + first);
		assert_true(strcmp(fields[ACCESS], "r") == 0 || strcmp(fields[ACCESS], "rw") == 0 ||
		            strcmp(fields[ACCESS], "w") == 0);
		assert_true(strlen(fields[NAME]) > 0 && strlen(fields[TYPE]) > 0);
		assert_true(strlen(fields[FAMILIES]) > 0 && strlen(fields[TEXT]) > 0);
		assert_int_equal(strlen(fields[MIN]) == 0, strlen(fields[MAX]) == 0);
		lines++;
	}
	assert_true(lines > 200);
	free(text);
}

/* A parameter that is another one on CAN has a row for each. */
static void ranges_are_those_of_the_family(void **state)
{
	static const char *const rows[] = {
		"\ndrive,holding,200,40201,bdr,u32,rw,bit/s,2400,921600,vsmd-serial,",
		"\ndrive,holding,200,40201,bdr,u32,rw,bit/s,20000,1000000,vsmd-can,",
		"\ndrive,holding,202,40203,cid,u16,rw,,1,32,vsmd-serial,",
		"\ndrive,holding,202,40203,cid,u16,rw,,1,110,vsmd-can,",
		"\nvsmd,holding,31,40032,cid,u16,rw,,1,32,vsmd-serial,",
		"\nvsmd,holding,31,40032,cid,u16,rw,,1,110,vsmd-can,",
		"\ndrive,holding,203,40204,mcs,u16,rw,,0,8,vsmd-serial vsmd-can,",
	};
	char *text = export(db_export_csv);

	(void)state;
	for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
		if (!strstr(text, rows[i]))
			fail_msg("no row%s", rows[i]);
	}
	free(text);
}

static void result_lists_its_codes(void **state)
{
	char *text = export(db_export_csv);
	char *line = strstr(text, ",result,");
	char code[64];

	(void)state;
	assert_non_null(line);
	line[strcspn(line, "\n")] = '\0';
	for (unsigned i = 0; i < DB_RESULT_COUNT; i++) {
		snprintf(code, sizeof code, " %u=%s", i, db_result_name((enum db_result)i));
		assert_non_null(strstr(line, code));
	}
	free(text);
}

static void status_lists_its_bits(void **state)
{
	char *text = export(db_export_csv);
	char *line = strstr(text, ",status,");
	char code[64];

	(void)state;
	assert_non_null(line);
	line[strcspn(line, "\n")] = '\0';
	for (unsigned i = 0; i < DB_STATUS_BIT_COUNT; i++) {
		snprintf(code, sizeof code, " %u=%s", i, db_status_bit_name(i));
		assert_non_null(strstr(line, code));
	}
	free(text);
}

static void commands_parse(void **state)
{
	char *text = export(db_export_commands);
	char *fields[FIELDS_MAX];
	size_t count;
	char *at = record(text, fields, &count);
	bool relative = false;

	(void)state;
	assert_string_equal(fields[2], "arguments");
	while (*at) {
		at = record(at, fields, &count);
		assert_int_equal(count, 5);
		if (strcmp(fields[1], "move_relative") != 0)
			continue;
		relative = true;
		assert_string_equal(fields[0], "7");
		assert_string_equal(fields[2], "target_position target_velocity");
	}
	assert_true(relative);
	free(text);
}

static void markdown_accounts_for_every_register(void **state)
{
	char *csv = export(db_export_csv);
	char *markdown = export(db_export_markdown);
	static const char several[] = "likewise 2 to ";
	unsigned lines = 0;
	unsigned rows = 0;

	(void)state;
	for (const char *at = csv; *at; at++)
		lines += *at == '\n';
	for (const char *at = markdown; *at; at++) {
		if (strncmp(at, "\n| ", strlen("\n| ")) == 0)
			rows++;
		/* Where a row stands for several, it says for how many. */
		if (strncmp(at, several, strlen(several)) == 0)
			rows += (unsigned)strtoul(at + strlen(several), NULL, 10) - 1;
	}
	/* Headings: one line there, one for each of six tables here. */
	assert_int_equal(rows - 6, lines - 1);
	free(csv);
	free(markdown);
}

/* Puts a template through. */
static int fill(char *template, char **text)
{
	size_t size = 0;
	FILE *out = open_memstream(text, &size);
	FILE *in = fmemopen(template, strlen(template), "r");
	int error;

	assert_non_null(out);
	assert_non_null(in);
	error = db_export_st(out, in);
	fclose(in);
	fclose(out);
	return error;
}

static void structured_text_has_the_constants(void **state)
{
	char template[] = "before\n@constants@\nafter\n";
	char *text = NULL;

	(void)state;
	assert_int_equal(fill(template, &text), 0);
	assert_int_equal(strncmp(text, "before\n", 7), 0);
	assert_string_equal(text + strlen(text) - 6, "after\n");
	assert_non_null(strstr(text, "\tDB_REG_COMMAND_ID : UINT := 100;\n"));
	assert_non_null(strstr(text, "\tDB_CMD_MOVE_ABSOLUTE : UINT := 6;\n"));
	assert_non_null(strstr(text, "\tDB_STATE_DISCRETE_MOTION : UINT := 3;\n"));
	assert_non_null(strstr(text, "\tDB_STATUS_DONE : DWORD := 16#00008000;\n"));
	/* Type f32 above address 204. */
	assert_non_null(strstr(text, "\tDB_PAR_VSMD_SPD : UDINT := 16#600CC;\n"));
	assert_non_null(strstr(text, "DB_IsStop :=\n\t(Code = DB_CMD_DISABLE) OR\n"));
	assert_non_null(strstr(text, "(Kind = DB_TYPE_BITS32);\nEND_FUNCTION\n"));
	/* From command_id to both registers of target_velocity. */
	assert_non_null(strstr(text, "\tDB_COUNT_MOTION : UINT := 6;\n"));
	free(text);
}

static void structured_text_needs_a_place_for_them(void **state)
{
	char template[] = "before\nafter\n";
	char *text = NULL;

	(void)state;
	assert_int_equal(fill(template, &text), -ENOENT);
	free(text);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(registers_parse),
		cmocka_unit_test(ranges_are_those_of_the_family),
		cmocka_unit_test(result_lists_its_codes),
		cmocka_unit_test(status_lists_its_bits),
		cmocka_unit_test(commands_parse),
		cmocka_unit_test(markdown_accounts_for_every_register),
		cmocka_unit_test(structured_text_has_the_constants),
		cmocka_unit_test(structured_text_needs_a_place_for_them),
	};

	return cmocka_run_group_tests_name("export", tests, NULL, NULL);
}
