/* SPDX-License-Identifier: Apache-2.0 */
/* The form of configuration texts: what becomes of it, with its lines; and messages in their
 * order. */
#include "reader/reader.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const struct db_reader_rules strict = { .sections = "part NAME" };
static const struct db_reader_rules lenient = { .sections = "part NAME", .lenient = true };

struct read {
	struct db_source *source;
	struct db_messages messages;
	struct db_reader reader;
	bool good;
};

static struct read read_text(const struct db_reader_rules *rules, const char *text)
{
	struct read read = { .source = db_sources_of_text("f", text) };

	assert_non_null(read.source);
	read.messages = (struct db_messages){ .sources = read.source, .source_count = 1 };
	read.good = db_reader_read(&read.reader, rules, &read.messages);
	return read;
}

static void done(struct read *read)
{
	db_reader_clear(&read->reader);
	db_messages_clear(&read->messages);
	db_sources_free(read->source, 1);
}

/* --- what is read ----------------------------------------------------------------------------- */

static void sections_keys_and_values_have_their_lines(void **state)
{
	struct read read = read_text(&strict, "outside = 1\n"
	                                      "part a {\n"
	                                      "  /* a\n"
	                                      "  comment */ one = x two = \"y z\"\n"
	                                      "  list = { p, # q\n"
	                                      "    'r s', }\n"
	                                      "}\n"
	                                      "plain { none = {}\n"
	                                      "}\n");
	const struct db_reader *reader = &read.reader;
	const struct db_reader_key *key;

	(void)state;
	assert_true(read.good);
	assert_int_equal(reader->section_count, 2);
	assert_string_equal(reader->sections[0].name, "part");
	assert_string_equal(reader->sections[0].title, "a");
	assert_int_equal(reader->sections[0].line, 2);
	assert_string_equal(reader->sections[1].title, "");
	assert_int_equal(reader->sections[1].line, 8);
	assert_int_equal(reader->key_count, 5);
	key = db_reader_find_key(reader, DB_READER_NO_SECTION, "outside");
	assert_string_equal(key->values, "1");
	assert_int_equal(key->line, 1);
	key = db_reader_find_key(reader, 0, "two");
	assert_string_equal(key->values, "y z");
	assert_int_equal(key->line, 4);
	assert_int_equal(key->count, 1);
	assert_false(key->list);
	key = db_reader_find_key(reader, 0, "list");
	assert_true(key->list);
	assert_int_equal(key->count, 2);
	assert_int_equal(key->size, sizeof("p\0r s"));
	assert_memory_equal(key->values, "p\0r s", sizeof("p\0r s"));
	assert_int_equal(key->line, 5);
	key = db_reader_find_key(reader, 1, "none");
	assert_true(key->list);
	assert_int_equal(key->count, 0);
	assert_null(db_reader_find_key(reader, 1, "one"));
	assert_int_equal(db_reader_find_section(reader, "part", "a"), 0);
	assert_int_equal(db_reader_find_section(reader, "part", "b"), DB_READER_NO_SECTION);
	assert_false(read.source->ended);
	done(&read);
}

static void what_was_refused_is_not_found(void **state)
{
	struct read read = read_text(&strict, "part a { k = 1 k = 2 }\npart a { }\n");

	(void)state;
	assert_true(read.good);
	read.reader.keys[0].refused = true;
	assert_string_equal(db_reader_find_key(&read.reader, 0, "k")->values, "2");
	read.reader.keys[1].refused = true;
	assert_null(db_reader_find_key(&read.reader, 0, "k"));
	read.reader.sections[0].refused = true;
	assert_int_equal(db_reader_find_section(&read.reader, "part", "a"), 1);
	done(&read);
}

static void several_sources_count_as_one(void **state)
{
	struct db_source sources[2] = {
		{ .path = strdup("first"), .text = strdup("part a {\n}\nend") },
		{ .path = strdup("second"), .text = strdup("\npart b {\n k = 1\n}\n") },
	};
	struct db_messages messages = { .sources = sources, .source_count = 2 };
	struct db_reader reader;

	(void)state;
	assert_true(db_reader_read(&reader, &strict, &messages));
	assert_int_equal(sources[1].lines_before, 3);
	assert_int_equal(reader.sections[1].line, 5);
	assert_int_equal(reader.keys[0].line, 6);
	assert_ptr_equal(db_messages_find_source(&messages, 3), &sources[0]);
	assert_ptr_equal(db_messages_find_source(&messages, 4), &sources[1]);
	assert_string_equal(db_messages_name_line(&messages, 5).text, "line 2 of second");
	assert_true(sources[0].ended);
	assert_false(sources[1].ended);
	db_reader_clear(&reader);
	for (size_t i = 0; i < 2; i++) {
		free(sources[i].path);
		free(sources[i].text);
	}
}

/* --- two sets of rules ------------------------------------------------------------------------ */

/* What only simulators' files may say, its value there, and why the service's may not. */
static const struct {
	const char *written;
	const char *value;
	const char *message;
} RULES[] = {
	{ "\"\\n\"", "\n", "unknown escape" },
	{ "'\\n'", "\\n", "unknown escape" },
	{ "\"a\nb\"", "a\nb", "has no end; close it with \" on the same line" },
	{ "\"${READER}\"", "of the environment", "environment variables are not filled in" },
	{ "'${READER}'", "${READER}", "environment variables are not filled in" },
	{ "${READER}", "of the environment", "the character '{' cannot stand here" },
	{ "a//b", "a//b", "the character '/' cannot stand here" },
	{ "[a]", "[a]", "braces, not in brackets" },
	{ "\xE2\x80\x93", "\xE2\x80\x93", "a dash (U+2013)" },
};

static void the_service_takes_less_than_the_simulator(void **state)
{
	(void)state;
	assert_int_equal(setenv("READER", "of the environment", 1), 0);
	for (size_t i = 0; i < sizeof(RULES) / sizeof(RULES[0]); i++) {
		char text[128];
		struct read read;

		snprintf(text, sizeof(text), "part a { k = %s }", RULES[i].written);
		read = read_text(&lenient, text);
		if (!read.good)
			fail_msg("%s: %s", text, read.messages.list[0].text);
		assert_string_equal(read.reader.keys[0].values, RULES[i].value);
		done(&read);
		read = read_text(&strict, text);
		assert_false(read.good);
		assert_int_equal(read.messages.count, 1);
		if (!strstr(read.messages.list[0].text, RULES[i].message))
			fail_msg("%s: %s", text, read.messages.list[0].text);
		done(&read);
	}
}

static void of_two_keys_the_last_counts_where_that_is_allowed(void **state)
{
	static const char text[] = "part a { k = 1 k = 2 } part b { k = 3 }";
	struct read read = read_text(&lenient, text);

	(void)state;
	assert_string_equal(db_reader_find_key(&read.reader, 0, "k")->values, "2");
	assert_string_equal(db_reader_find_key(&read.reader, 1, "k")->values, "3");
	assert_true(read.reader.keys[0].refused);
	done(&read);
	/* Else it is for who reads it to say that there are two. */
	read = read_text(&strict, text);
	assert_int_equal(read.reader.key_count, 3);
	assert_false(read.reader.keys[0].refused);
	done(&read);
}

/* --- broken forms ----------------------------------------------------------------------------- */

static const struct {
	const char *text;
	unsigned line;
	const char *message;
} BROKEN[] = {
	{ "1 {", 1, "the file ends too early; expected a key, or } at the end of the section" },
	{ "part a {\nk 1\n}", 2, "'1' cannot stand here; expected = after the key" },
	{ "part a\nb", 2, "'b' cannot stand here; expected { at the start of a section" },
	{ "part a {\nk =\n}", 3, "'}' cannot stand here; expected the value of 'k'" },
	{ "part a {\nk = {1 2} }", 2, "'2' cannot stand here; expected a comma, or }" },
	{ "part a { k = {,} }", 1, "',' cannot stand here; expected a value, or }" },
	{ "}", 1, "'}' cannot stand here; expected a section: part NAME" },
	{ "part a {\nk = 1\n\nother b {\nk = 1\n}", 4,
	  "a section begins here, but section 'part' of line 1 has no } at its end" },
	{ "part a {\nother {\n}", 2, "section 'part' of line 1 has no }" },
	{ "part a { k = \"x\"; }", 1, "no ; ends a value; remove it" },
	{ "part a { k = \"x\";\nl = 1 }", 1, "no ; ends a value; remove it" },
	{ "part a { k \xEF\xBC\x9D 1 }", 1,
	  "here stands a full-width character (U+FF1D); write the ordinary =" },
	{ "part a \xEF\xBD\x9B k = 1 }", 1, "(U+FF5B); write the ordinary {" },
	{ "\n\n/"
	  "* x",
	  3, "the comment that begins here has no end" },
	{ "\npart a { k = \"x\n\" }", 2, "has no end" },
	{ "end\nx", 1, "more follows on line 2" },
	{ "part a { k = 0,5 }", 1, "write 0.5" },
	{ "part a { k = \"a\", b }", 1, "write them in braces" },
	{ "part a { k = aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa b }", 1,
	  "expected = after the key" },
};

static void a_broken_form_is_one_error_with_its_line(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof(BROKEN) / sizeof(BROKEN[0]); i++) {
		struct read read = read_text(&strict, BROKEN[i].text);

		assert_false(read.good);
		assert_int_equal(read.messages.errors, 1);
		assert_int_equal(read.messages.list[0].line, BROKEN[i].line);
		if (!strstr(read.messages.list[0].text, BROKEN[i].message))
			fail_msg("%s: %s", BROKEN[i].text, read.messages.list[0].text);
		done(&read);
	}
}

/* --- messages --------------------------------------------------------------------------------- */

static void messages_come_in_the_order_of_their_lines(void **state)
{
	struct db_source *source = db_sources_of_text("f", "\n\n\n\n");
	struct db_messages messages = { .sources = source, .source_count = 1 };
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);

	(void)state;
	assert_non_null(source);
	assert_non_null(out);
	db_sources_count_lines(source, 1);
	db_messages_add_error(&messages, 3, "c%s", "\033[2J");
	db_messages_add_warning(&messages, 1, "w");
	db_messages_add_error(&messages, 2, "a");
	db_messages_add_error(&messages, 2, "b");
	db_messages_add_error(&messages, 0, "all");
	assert_int_equal(messages.errors, 4);
	db_messages_print(&messages, out);
	fclose(out);
	assert_string_equal(text, "f: all\nf:2: a\nf:2: b\nf:3: c?[2J\nf:1: warning: w\n");
	free(text);
	db_messages_clear(&messages);
	db_sources_free(source, 1);
}

static void only_the_first_twenty_are_printed(void **state)
{
	struct db_source *source = db_sources_of_text("f", "");
	struct db_messages messages = { .sources = source, .source_count = 1 };
	char *text = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&text, &size);

	(void)state;
	assert_non_null(source);
	assert_non_null(out);
	for (unsigned i = 1; i <= 21; i++)
		db_messages_add_error(&messages, i, "x");
	for (unsigned i = 1; i <= 23; i++)
		db_messages_add_warning(&messages, i, "y");
	db_messages_print(&messages, out);
	fclose(out);
	assert_non_null(strstr(text, "f:20: x\nf: 1 more error; mend these first\n"));
	assert_non_null(strstr(text, "f:20: warning: y\nf: warning: 3 more warnings\n"));
	assert_null(strstr(text, "f:21"));
	free(text);
	db_messages_clear(&messages);
	db_sources_free(source, 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(sections_keys_and_values_have_their_lines),
		cmocka_unit_test(what_was_refused_is_not_found),
		cmocka_unit_test(several_sources_count_as_one),
		cmocka_unit_test(the_service_takes_less_than_the_simulator),
		cmocka_unit_test(of_two_keys_the_last_counts_where_that_is_allowed),
		cmocka_unit_test(a_broken_form_is_one_error_with_its_line),
		cmocka_unit_test(messages_come_in_the_order_of_their_lines),
		cmocka_unit_test(only_the_first_twenty_are_printed),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
