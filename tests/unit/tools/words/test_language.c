/* SPDX-License-Identifier: Apache-2.0 */
#include "words/language.h"

#include <errno.h>
#include <limits.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

/* Sorted, as msgfmt writes them. */
static const struct {
	const char *english;
	size_t english_size; /* 0: to its end */
	const char *translation;
	size_t size;
} texts[] = {
	{ "", 0, "Language: de\n", 0 },
	{ "%.1f is no %s", 0, "%.1f ist kein %s", 0 },
	{ "%s answers%s", 0, "%s antwortet%s", 0 },
	{ "%s has no option --%s", 0, "%s hat keine Option --%s", 0 },
	{ "%s knows %s", 0, "%2$s kennt %1$s", 0 },
	{ "%s of %s: %s", 0, "nie", 0 },
	{ "%zu hint\0%zu hints", 18, "%zu Hinweis\0%zu Hinweise", 24 },
	{ "; %s has it: end that", 0, "; %s belegt ihn: beenden", 0 },
	{ "; did you mean {names}?", 0, "; meinten Sie {names}?", 0 },
	{ "State of the axis", 0, "Zustand der Achse", 0 },
	{ "check its power", 0, "Versorgung prüfen", 0 },
	{ "drive %s tells: %s", 0, "Antrieb %s meldet: %s", 0 },
	{ "home", 0, "referenzieren", 0 },
	{ "line %u%s ends", 0, "Zeile %u%s endet", 0 },
	{ "line {n}", 0, "Zeile {n}", 0 },
	{ "no drive is called \"{drive}\"", 0, "kein Antrieb heißt „{drive}“", 0 },
	{ "the part \"%s\"%s", 0, "der Teil „%s“%s", 0 },
	{ "the port of bus {bus} is not open{port}", 0,
	  "der Port von Bus {bus} ist nicht offen{port}", 0 },
	{ "{fault}; then run {drive} clear_fault", 0, "{fault}; dann run {drive} clear_fault", 0 },
};

static char folder[PATH_MAX];

static void put(unsigned char *bytes, size_t at, size_t number)
{
	for (size_t i = 0; i < 4; i++)
		bytes[at + i] = (unsigned char)(number >> (8 * i));
}

static void make_path(const char *language, char path[PATH_MAX])
{
	assert_true(snprintf(path, PATH_MAX, "%s/%s/LC_MESSAGES/drivebridge.mo", folder, language) <
	            PATH_MAX);
}

static void write_file(const char *language, const unsigned char *bytes, size_t size)
{
	char path[PATH_MAX];
	FILE *file;

	make_path(language, path);
	for (char *slash = strstr(path, language); (slash = strchr(slash, '/')); slash++) {
		*slash = '\0';
		(void)mkdir(path, 0700);
		*slash = '/';
	}
	file = fopen(path, "wb");
	assert_non_null(file);
	assert_int_equal(fwrite(bytes, 1, size, file), size);
	assert_int_equal(fclose(file), 0);
}

/* The file of gettext with these texts; its size. */
static size_t make_table(unsigned char *bytes)
{
	size_t head = 28;
	size_t used = head + 16 * COUNT_OF(texts);

	put(bytes, 0, 0x950412de);
	put(bytes, 4, 0);
	put(bytes, 8, COUNT_OF(texts));
	put(bytes, 12, head);
	put(bytes, 16, head + 8 * COUNT_OF(texts));
	for (size_t turn = 0; turn < 2; turn++) {
		for (size_t i = 0; i < COUNT_OF(texts); i++) {
			const char *text = turn ? texts[i].translation : texts[i].english;
			size_t size = turn ? texts[i].size : texts[i].english_size;

			size = size ? size : strlen(text);
			put(bytes, head + 8 * (turn * COUNT_OF(texts) + i), size);
			put(bytes, head + 8 * (turn * COUNT_OF(texts) + i) + 4, used);
			memcpy(bytes + used, text, size + 1);
			used += size + 1;
		}
	}
	return used;
}

static int set_up(void **state)
{
	unsigned char bytes[4096];
	size_t size = make_table(bytes);

	(void)snprintf(folder, sizeof(folder), "%s/language-XXXXXX", P_tmpdir);
	if (!mkdtemp(folder))
		return -1;
	write_file("de", bytes, size);
	write_file("zh_CN", bytes, size);
	*state = db_words_open_language(folder, "de");
	return *state ? 0 : -1;
}

static int tear_down(void **state)
{
	static const char *const ends[] = { "/LC_MESSAGES/drivebridge.mo", "/LC_MESSAGES", "" };
	static const char *const languages[] = { "de", "zh_CN", "xx" };
	char path[2 * PATH_MAX];

	db_words_close_language(*state);
	for (size_t i = 0; i < COUNT_OF(languages); i++) {
		for (size_t at = 0; at < COUNT_OF(ends); at++) {
			(void)snprintf(path, sizeof(path), "%s/%s%s", folder, languages[i],
			               ends[at]);
			(void)remove(path);
		}
	}
	return rmdir(folder);
}

static void test_texts_are_found(void **state)
{
	const struct db_words_language *german = *state;
	const char *unknown = "nobody translates this";

	assert_string_equal(db_words_find_text(german, "check its power"), "Versorgung prüfen");
	assert_ptr_equal(db_words_find_text(german, unknown), unknown);
	assert_ptr_equal(db_words_find_text(NULL, unknown), unknown);
	/* What the file says of itself is no translation. */
	assert_string_equal(db_words_find_text(german, ""), "");
	assert_string_equal(db_words_find_count(german, 1, "%zu hint", "%zu hints"), "%zu Hinweis");
	assert_string_equal(db_words_find_count(german, 2, "%zu hint", "%zu hints"),
	                    "%zu Hinweise");
	assert_string_equal(db_words_find_count(german, 2, "check its power", "all"),
	                    "Versorgung prüfen");
	assert_string_equal(db_words_find_count(german, 2, "one", "two"), "two");
	assert_string_equal(db_words_find_count(NULL, 1, "one", "two"), "one");
}

static void test_names_are_found(void **state)
{
	const struct db_words_language *german = *state;
	char longer[200];

	assert_string_equal(db_words_find_name(german, "check_its_power_x", 15),
	                    "Versorgung prüfen");
	assert_null(db_words_find_name(german, "check_its_power_x", 17));
	assert_null(db_words_find_name(german, "", 0));
	assert_null(db_words_find_name(NULL, "check_its_power", 15));
	assert_int_equal(db_words_name_length("age_ms", "ms"), 3);
	assert_int_equal(db_words_name_length("age_ms", ""), 6);
	assert_int_equal(db_words_name_length("_ms", "ms"), 3);
	assert_int_equal(db_words_name_length("forms", "ms"), 5);
	memset(longer, '_', sizeof(longer));
	assert_null(db_words_find_name(german, longer, sizeof(longer)));
}

static void test_finished_texts_are_recognised(void **state)
{
	static const struct {
		const char *english;
		const char *german;
	} cases[] = {
		{ "check its power", "Versorgung prüfen" },
		{ "no drive is called \"feeder\"", "kein Antrieb heißt „feeder“" },
		{ "no drive is called \"\"", "kein Antrieb heißt „“" },
		{ "the port of bus press is not open; mbpoll (12) has it: end that",
		  "der Port von Bus press ist nicht offen; mbpoll (12) belegt ihn: beenden" },
		{ "check its power; then run x clear_fault",
		  "Versorgung prüfen; dann run x clear_fault" },
		{ "one knows two", "two kennt one" },
		/* Names are no words. */
		{ "home has no option --home", "home hat keine Option --home" },
		{ "no drive is called \"home\"", "kein Antrieb heißt „home“" },
		{ "no drive is called \"check its power\"",
		  "kein Antrieb heißt „check its power“" },
		{ "; did you mean home?", "; meinten Sie home?" },
		{ "drive home tells: home", "Antrieb home meldet: referenzieren" },
		{ "check its power has no option --x", "Versorgung prüfen hat keine Option --x" },
		/* A place in a file, or a name, and a text of its own. */
		{ "plant.conf:7: check its power", "plant.conf:7: Versorgung prüfen" },
		{ "plant.conf:7: drive home tells: home",
		  "plant.conf:7: Antrieb home meldet: referenzieren" },
		{ "one two: check its power", "one two: check its power" },
		{ "one: two", "one: two" },
		{ "the part \"home\"; mbpoll has it: end that",
		  "der Teil „home“; mbpoll belegt ihn: beenden" },
		/* A number is one. */
		{ "-1.5 is no home", "-1.5 ist kein referenzieren" },
		{ "that is no home", "that is no home" },
		{ " is no home", " is no home" },
		{ "line 12", "Zeile 12" },
		{ "line 12 of it ends", "Zeile 12 of it endet" },
		{ "line 12 ends", "Zeile 12 endet" },
		/* What says more of the text is taken, of the whole or after the name. */
		{ "plant.conf: no drive is called \"that answers\"",
		  "plant.conf: kein Antrieb heißt „that answers“" },
		{ "plant.conf: it answers", "plant.conf: it antwortet" },
		{ "line x", "line x" },
		{ "State of the axis: 0=Offline 1=Disabled 2=Standstill",
		  "Zustand der Achse: 0=Offline 1=Disabled 2=Standstill" },
		/* Too few words of its own to be known by. */
		{ "a of b: c", "a of b: c" },
		{ "no drive is called \"feeder", "no drive is called \"feeder" },
		{ "", "" },
	};
	char room[DB_WORDS_TEXT_MAX];

	for (size_t i = 0; i < COUNT_OF(cases); i++)
		assert_string_equal(db_words_in(*state, cases[i].english, room), cases[i].german);
	assert_string_equal(db_words_in(NULL, "check its power", room), "check its power");
}

static void test_a_text_that_is_too_long_stays_english(void **state)
{
	char room[DB_WORDS_TEXT_MAX];
	char english[2 * DB_WORDS_TEXT_MAX];

	(void)snprintf(english, sizeof(english), "no drive is called \"%0*d\"",
	               DB_WORDS_TEXT_MAX + 9, 7);
	assert_ptr_equal(db_words_in(*state, english, room), english);
	(void)snprintf(english, sizeof(english), "no drive is called \"%0*d\"",
	               DB_WORDS_TEXT_MAX - 24, 7);
	assert_ptr_equal(db_words_in(*state, english, room), english);
}

static void test_a_text_is_cut_between_characters(void **state)
{
	(void)state;
	assert_int_equal(db_words_fit("äbc", 2), 3);
	assert_int_equal(db_words_fit("abc", 9), 3);
	/* A wide character that has only one column left is left out. */
	assert_int_equal(db_words_fit("a驱动", 4), 4);
	assert_int_equal(db_words_fit("a驱动", 5), 7);
	assert_int_equal(db_words_fit("abc", 0), 0);
}

static void test_a_damaged_file_is_refused(void **state)
{
	unsigned char bytes[4096];
	size_t size = make_table(bytes);

	(void)state;
	for (size_t at = 0; at < 28 + 16 * COUNT_OF(texts); at++) {
		struct db_words_language *language;
		unsigned char kept = bytes[at];
		char room[DB_WORDS_TEXT_MAX];

		/* It is refused, or says what it can: it never reads outside. */
		bytes[at] = 0xff;
		write_file("xx", bytes, size);
		language = db_words_open_language(folder, "xx");
		(void)db_words_in(language, "no drive is called \"feeder\"", room);
		db_words_close_language(language);
		bytes[at] = kept;
	}
	write_file("xx", bytes, size - 1);
	assert_null(db_words_open_language(folder, "xx"));
	assert_int_equal(errno, EINVAL);
	write_file("xx", bytes, 8);
	assert_null(db_words_open_language(folder, "xx"));
	assert_null(db_words_open_language(folder, "fr"));
	assert_int_equal(errno, ENOENT);
}

static const char *set_language, *set_all, *set_lang;

static char *get(const char *name)
{
	const char *value = strcmp(name, "LANGUAGE") == 0 ? set_language :
	                    strcmp(name, "LC_ALL") == 0   ? set_all :
	                    strcmp(name, "LANG") == 0     ? set_lang :
	                                                    NULL;

	return (char *)(uintptr_t)value;
}

static const char *set_folder;

static char *get_folder(const char *name)
{
	return strcmp(name, "TEXTDOMAINDIR") == 0 ? (char *)(uintptr_t)set_folder : NULL;
}

static void test_the_environment_names_a_folder(void **state)
{
	const char *installed = db_words_folder(get_folder);

	(void)state;
	assert_int_equal(installed[0], '/');
	set_folder = "";
	assert_string_equal(db_words_folder(get_folder), installed);
	set_folder = "/elsewhere";
	assert_string_equal(db_words_folder(get_folder), "/elsewhere");
}

static void test_the_environment_chooses(void **state)
{
	static const struct {
		const char *language;
		const char *all;
		const char *lang;
		const char *chosen;
	} cases[] = {
		{ NULL, NULL, NULL, "" },
		{ NULL, NULL, "de_DE.UTF-8", "de" },
		{ NULL, NULL, "de_AT.utf8", "de" },
		{ NULL, NULL, "zh_CN.UTF-8", "zh_CN" },
		{ NULL, NULL, "zh_SG.UTF-8", "zh_CN" },
		{ NULL, NULL, "zh_TW.UTF-8", "" },
		{ NULL, NULL, "fr_FR.UTF-8", "" },
		{ NULL, "C", "de_DE.UTF-8", "" },
		{ "de", "C", NULL, "" },
		{ "de", "POSIX", NULL, "" },
		{ "de", NULL, "C.UTF-8", "de" },
		{ "fr:zh_CN:de", NULL, "en_GB.UTF-8", "zh_CN" },
		{ "fr:en:de", NULL, "de_DE.UTF-8", "" },
		{ "en_GB", NULL, "de_DE.UTF-8", "" },
		{ "../..", NULL, "de_DE.UTF-8", "" },
		{ NULL, NULL, "de_DE@euro", "" },
		{ NULL, NULL, "de_DE.ISO-8859-1", "" },
		{ NULL, NULL, "de_DE", "" },
	};
	char language[DB_WORDS_LANGUAGE_MAX];

	(void)state;
	for (size_t i = 0; i < COUNT_OF(cases); i++) {
		set_language = cases[i].language;
		set_all = cases[i].all;
		set_lang = cases[i].lang;
		assert_int_equal(db_words_choose_language(folder, get, language),
		                 cases[i].chosen[0] != '\0');
		assert_string_equal(language, cases[i].chosen);
	}
}

static void test_chinese_takes_two_columns(void **state)
{
	(void)state;
	assert_int_equal(db_words_columns("abc", 3), 3);
	assert_int_equal(db_words_columns("für", strlen("für")), 3);
	assert_int_equal(db_words_columns("驱动器，", strlen("驱动器，")), 8);
	assert_int_equal(db_words_columns("驱动器", 3), 2);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_texts_are_found),
		cmocka_unit_test(test_names_are_found),
		cmocka_unit_test(test_finished_texts_are_recognised),
		cmocka_unit_test(test_a_text_that_is_too_long_stays_english),
		cmocka_unit_test(test_a_text_is_cut_between_characters),
		cmocka_unit_test(test_a_damaged_file_is_refused),
		cmocka_unit_test(test_the_environment_chooses),
		cmocka_unit_test(test_the_environment_names_a_folder),
		cmocka_unit_test(test_chinese_takes_two_columns),
	};

	return cmocka_run_group_tests(tests, set_up, tear_down);
}
