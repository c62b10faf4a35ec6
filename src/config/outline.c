/* SPDX-License-Identifier: Apache-2.0 */
#include "config/outline.h"

#include "config/keys.h"
#include "drivebridge/config.h"

#include <stdlib.h>
#include <string.h>

enum token_type {
	TOKEN_END,
	TOKEN_WORD,
	TOKEN_STRING,
	TOKEN_OPEN,
	TOKEN_CLOSE,
	TOKEN_EQUALS,
	TOKEN_COMMA,
	TOKEN_BAD /* reported already */
};

struct token {
	enum token_type type;
	size_t begin;
	size_t end;
	unsigned line;
};

struct scan {
	char *text;
	size_t at;
	unsigned line;
	struct token token; /* the current one */
	struct db_outline *outline;
	struct db_report *report;
	struct db_config_source *source; /* the file that is read; null: a text without one */
};

/* What word processors and copied pages leave in a file. */
static const struct {
	const char *bytes;
	const char *what;
} MISPRINTS[] = {
	{ "\xC2\xA0", "a non-breaking space (U+00A0); put an ordinary space in its place" },
	{ "\xE2\x80\xAF",
	  "a narrow non-breaking space (U+202F); put an ordinary space in its place" },
	{ "\xE2\x80\x8B", "an invisible space (U+200B); remove it" },
	{ "\xEF\xBB\xBF", "an invisible byte order mark (U+FEFF); remove it" },
	{ "\xE2\x80\x9C", "a typographic quote (U+201C); texts stand in plain quotes: \"text\"" },
	{ "\xE2\x80\x9D", "a typographic quote (U+201D); texts stand in plain quotes: \"text\"" },
	{ "\xE2\x80\x9E", "a typographic quote (U+201E); texts stand in plain quotes: \"text\"" },
	{ "\xE2\x80\x98", "a typographic quote (U+2018); texts stand in plain quotes: \"text\"" },
	{ "\xE2\x80\x99", "a typographic quote (U+2019); texts stand in plain quotes: \"text\"" },
	{ "\xC2\xAB", "a typographic quote (U+00AB); texts stand in plain quotes: \"text\"" },
	{ "\xC2\xBB", "a typographic quote (U+00BB); texts stand in plain quotes: \"text\"" },
	{ "\xE2\x80\x93", "a dash (U+2013); a minus or hyphen is the plain -" },
	{ "\xE2\x88\x92", "a minus sign (U+2212); a minus is the plain -" },
};

/* What stands here and only looks like something that may; null. */
static const char *misprint_at(const char *text)
{
	for (size_t i = 0; i < sizeof(MISPRINTS) / sizeof(MISPRINTS[0]); i++) {
		if (strncmp(text, MISPRINTS[i].bytes, strlen(MISPRINTS[i].bytes)) == 0)
			return MISPRINTS[i].what;
	}
	return NULL;
}

static bool blank_comment(struct scan *scan)
{
	char *text = scan->text;
	unsigned start = scan->line;

	if (text[scan->at] == '#' || text[scan->at + 1] == '/') {
		while (text[scan->at] && text[scan->at] != '\n')
			text[scan->at++] = ' ';
		return true;
	}
	text[scan->at++] = ' ';
	text[scan->at++] = ' ';
	for (; text[scan->at]; scan->at++) {
		if (text[scan->at] == '*' && text[scan->at + 1] == '/') {
			text[scan->at++] = ' ';
			text[scan->at++] = ' ';
			return true;
		}
		if (text[scan->at] == '\n')
			scan->line++;
		else
			text[scan->at] = ' ';
	}
	db_report_error(scan->report, start,
	                "the comment that begins here has no end; close it with */");
	return false;
}

static bool starts_comment(const char *text)
{
	return text[0] == '#' || (text[0] == '/' && (text[1] == '/' || text[1] == '*'));
}

static bool skip_space(struct scan *scan)
{
	for (;;) {
		char c = scan->text[scan->at];

		if (starts_comment(scan->text + scan->at)) {
			if (!blank_comment(scan))
				return false;
			continue;
		}
		if (c == '\n')
			scan->line++;
		else if (c != ' ' && c != '\t' && c != '\r')
			return true;
		scan->at++;
	}
}

/* Only what reads the same for everybody: other escapes and ${VARIABLE} are refused. */
static bool scan_string(struct scan *scan)
{
	const char *text = scan->text;
	char quote = text[scan->at++];

	for (; text[scan->at] != quote; scan->at++) {
		if (text[scan->at] == '\0' || text[scan->at] == '\n') {
			db_report_error(
				scan->report, scan->line,
				"the text that begins here has no end; close it with %c on the same line",
				quote);
			return false;
		}
		if (text[scan->at] == '$' && text[scan->at + 1] == '{') {
			db_report_error(
				scan->report, scan->line,
				"environment variables are not filled in; write the value itself");
			return false;
		}
		if (text[scan->at] != '\\')
			continue;
		scan->at++;
		if (text[scan->at] != quote && text[scan->at] != '\\') {
			db_report_error(
				scan->report, scan->line,
				"unknown escape after a backslash; write \\\\ for a backslash and \\%c for %c",
				quote, quote);
			return false;
		}
	}
	scan->at++;
	return true;
}

static bool is_word_byte(const char *text)
{
	if (*text == '/')
		return text[1] != '\0' && !strchr(" #\"'\t\n\r={}()+,/*", text[1]);
	return *text != '\0' && !strchr(" #\"'\t\n\r={}()+,*", *text);
}

static bool scan_word(struct scan *scan)
{
	size_t begin = scan->at;

	while (is_word_byte(scan->text + scan->at)) {
		const char *misprint = misprint_at(scan->text + scan->at);

		if (misprint) {
			db_report_error(scan->report, scan->line, "here stands %s", misprint);
			return false;
		}
		/* A byte behind a slash was looked at together with the slash. */
		scan->at += scan->text[scan->at] == '/' ? 2 : 1;
	}
	/* "a//b" is a mistake more often than a comment, and "${" is libconfuse's for variables. */
	if (scan->at > begin && scan->text[scan->at] != '/' &&
	    !(scan->text[scan->at - 1] == '$' && scan->text[scan->at] == '{'))
		return true;
	db_report_error(
		scan->report, scan->line,
		"the character '%c' cannot stand here; put texts with special characters in \"quotes\"",
		scan->text[scan->at]);
	return false;
}

static enum token_type scan_token(struct scan *scan)
{
	switch (scan->text[scan->at]) {
	case '\0':
		return TOKEN_END;
	case '{':
		scan->at++;
		return TOKEN_OPEN;
	case '}':
		scan->at++;
		return TOKEN_CLOSE;
	case '=':
		scan->at++;
		return TOKEN_EQUALS;
	case ',':
		scan->at++;
		return TOKEN_COMMA;
	case '"':
	case '\'':
		return scan_string(scan) ? TOKEN_STRING : TOKEN_BAD;
	default:
		return scan_word(scan) ? TOKEN_WORD : TOKEN_BAD;
	}
}

static void advance(struct scan *scan)
{
	scan->token.type = TOKEN_BAD;
	if (!skip_space(scan))
		return;
	scan->token.begin = scan->at;
	scan->token.line = scan->line;
	scan->token.type = scan_token(scan);
	scan->token.end = scan->at;
}

/* The token's text without quotes; to be freed. */
static char *token_text(const struct scan *scan)
{
	size_t quotes = scan->token.type == TOKEN_STRING;

	return strndup(scan->text + scan->token.begin + quotes,
	               scan->token.end - scan->token.begin - 2 * quotes);
}

static bool wrong(struct scan *scan, const char *expected)
{
	int length = (int)(scan->token.end - scan->token.begin);

	if (scan->token.type == TOKEN_END)
		db_report_error(scan->report, scan->token.line,
		                "the file ends too early; expected %s", expected);
	else if (scan->token.type != TOKEN_BAD)
		db_report_error(scan->report, scan->token.line,
		                "'%.*s' cannot stand here; expected %s", length > 40 ? 40 : length,
		                scan->text + scan->token.begin, expected);
	return false;
}

static bool is_text(const struct scan *scan)
{
	return scan->token.type == TOKEN_WORD || scan->token.type == TOKEN_STRING;
}

/* Brackets around a list, as in other languages; [ADDRESS]:PORT is none. */
static bool is_bracket(const struct scan *scan)
{
	const char *word = scan->text + scan->token.begin;
	size_t length = scan->token.end - scan->token.begin;

	return scan->token.type == TOKEN_WORD && word[0] == '[' &&
	       (word[length - 1] == ']' || !memchr(word, ']', length));
}

/* What stands behind a value that was taken for a whole one. */
static bool no_comma(struct scan *scan, struct token value)
{
	const char *text = scan->text + value.begin;
	int length = (int)(value.end - value.begin);
	struct token comma = scan->token;

	if (comma.type != TOKEN_COMMA)
		return true;
	advance(scan);
	if (value.type == TOKEN_WORD && strspn(text, "-0123456789") == (size_t)length &&
	    scan->token.type == TOKEN_WORD)
		db_report_error(scan->report, comma.line,
		                "numbers have a decimal point, not a comma; write %.*s.%.*s",
		                length, text, (int)(scan->token.end - scan->token.begin),
		                scan->text + scan->token.begin);
	else
		db_report_error(scan->report, comma.line,
		                "several values are a list; write them in braces: {\"a\", \"b\"}");
	return false;
}

/* After '='. Sets *end behind the value and goes to the token after it. */
static bool scan_value(struct scan *scan, const char *name, bool *list, size_t *end)
{
	struct token value = scan->token;

	*list = scan->token.type == TOKEN_OPEN;
	if (is_bracket(scan)) {
		db_report_error(scan->report, scan->token.line,
		                "a list stands in braces, not in brackets; write {\"a\", \"b\"}");
		return false;
	}
	if (*list) {
		do {
			advance(scan);
			if (scan->token.type == TOKEN_CLOSE)
				break;
			if (!is_text(scan))
				return wrong(scan, "a value, or } at the end of the list");
			advance(scan);
		} while (scan->token.type == TOKEN_COMMA);
		if (scan->token.type != TOKEN_CLOSE)
			return wrong(scan, "a comma, or } at the end of the list");
	} else if (!is_text(scan)) {
		char expected[96];

		snprintf(expected, sizeof(expected), "the value of '%.40s'", name);
		return wrong(scan, expected);
	}
	*end = scan->token.end;
	advance(scan);
	return *list || no_comma(scan, value);
}

static bool add_section(struct db_outline *outline, struct token head, const char *name,
                        const char *title)
{
	struct db_outline_section *sections;
	struct db_outline_section section = {
		.name = strdup(name), .title = strdup(title), .line = head.line, .begin = head.begin
	};

	sections = realloc(outline->sections, (outline->section_count + 1) * sizeof(*sections));
	if (sections)
		outline->sections = sections;
	if (!sections || !section.name || !section.title) {
		free(section.name);
		free(section.title);
		return false;
	}
	sections[outline->section_count++] = section;
	return true;
}

static bool add_key(struct db_outline *outline, const struct db_outline_key *key)
{
	struct db_outline_key *keys;
	char *name = strdup(key->name);

	keys = realloc(outline->keys, (outline->key_count + 1) * sizeof(*keys));
	if (keys)
		outline->keys = keys;
	if (!keys || !name) {
		free(name);
		return false;
	}
	keys[outline->key_count] = *key;
	keys[outline->key_count++].name = name;
	return true;
}

/* At '='; the name was before it. */
static bool scan_key(struct scan *scan, struct token head, char *name, size_t section)
{
	struct db_outline_key key = {
		.name = name, .line = head.line, .section = section, .begin = head.begin
	};

	advance(scan);
	return scan_value(scan, name, &key.list, &key.end) && add_key(scan->outline, &key);
}

/* Behind '{'. */
static bool scan_keys(struct scan *scan, size_t section)
{
	while (scan->token.type != TOKEN_CLOSE) {
		struct token head = scan->token;
		char *name;
		bool good;

		if (head.type != TOKEN_WORD)
			return wrong(scan, "a key, or } at the end of the section");
		name = token_text(scan);
		if (!name)
			return false;
		advance(scan);
		good = scan->token.type == TOKEN_EQUALS ? scan_key(scan, head, name, section) :
		                                          wrong(scan, "= after the key");
		free(name);
		if (!good)
			return false;
	}
	scan->outline->sections[section].end = scan->token.end;
	advance(scan);
	return true;
}

/* Behind the name, at the title or '{'. */
static bool scan_section(struct scan *scan, struct token head, const char *name)
{
	bool titled = is_text(scan);
	char *title = titled ? token_text(scan) : strdup("");
	bool good = title && add_section(scan->outline, head, name, title);

	free(title);
	if (!good)
		return false;
	if (titled)
		advance(scan);
	if (scan->token.type != TOKEN_OPEN)
		return wrong(scan, "{ at the start of a section, or = after a key");
	advance(scan);
	return scan_keys(scan, scan->outline->section_count - 1);
}

static void blank(char *text, size_t begin, size_t end)
{
	for (size_t i = begin; i < end; i++) {
		if (text[i] != '\n')
			text[i] = ' ';
	}
}

/* Behind the word `end`, which is the last one of a file. */
static bool scan_end(struct scan *scan, struct token head)
{
	if (scan->token.type != TOKEN_END) {
		if (scan->token.type != TOKEN_BAD)
			db_report_error(
				scan->report, head.line,
				"end says that the file is complete, but more follows on %s; move it to the last line",
				db_report_place(scan->report, scan->token.line).text);
		return false;
	}
	if (scan->source)
		scan->source->ended = true;
	blank(scan->text, head.begin, head.end);
	return true;
}

static bool scan_text(struct scan *scan)
{
	bool good = true;

	advance(scan);
	while (good && scan->token.type != TOKEN_END) {
		struct token head = scan->token;
		char *name;

		if (head.type != TOKEN_WORD)
			return wrong(scan, "a section: modbus, bus NAME or drive NAME");
		name = token_text(scan);
		if (!name)
			return false;
		advance(scan);
		if (scan->token.type == TOKEN_EQUALS)
			good = scan_key(scan, head, name, DB_OUTLINE_TOP);
		else if (strcmp(name, "end") == 0)
			good = scan_end(scan, head);
		else
			good = scan_section(scan, head, name);
		free(name);
	}
	return good;
}

static bool is_titled(const struct db_outline_section *section)
{
	return strcmp(section->name, "bus") == 0 || strcmp(section->name, "drive") == 0;
}

static bool is_name(const char *text)
{
	static const char ALLOWED[] =
		"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
	size_t length = strspn(text, ALLOWED);

	return length >= 1 && length <= 31 && text[length] == '\0';
}

/* The section modbus of an earlier file, where this one is a section modbus too; else DB_OUTLINE_TOP. */
static size_t earlier_modbus(const struct db_outline *outline, size_t index,
                             const struct db_report *report)
{
	for (size_t i = 0; i < index; i++) {
		if (strcmp(outline->sections[i].name, "modbus") == 0 &&
		    strcmp(outline->sections[index].name, "modbus") == 0 &&
		    db_report_source(report, outline->sections[i].line) !=
		            db_report_source(report, outline->sections[index].line))
			return i;
	}
	return DB_OUTLINE_TOP;
}

/* Several files may share the section modbus: what they say of it is looked for in the first one. */
static void join_modbus(struct db_outline *outline, const struct db_report *report)
{
	for (size_t i = 0; i < outline->key_count; i++) {
		struct db_outline_key *key = &outline->keys[i];
		size_t earlier = key->section == DB_OUTLINE_TOP ?
		                         DB_OUTLINE_TOP :
		                         earlier_modbus(outline, key->section, report);

		if (earlier != DB_OUTLINE_TOP)
			key->section = earlier;
	}
}

/* True when the section may stay. */
static bool check_section(const struct db_outline *outline, size_t index, struct db_report *report)
{
	const struct db_outline_section *section = &outline->sections[index];
	bool titled = is_titled(section);

	if (!titled && strcmp(section->name, "modbus") != 0) {
		db_report_error(
			report, section->line,
			"unknown section '%s'; the sections are modbus, bus NAME and drive NAME",
			section->name);
		return false;
	}
	if (!titled && section->title[0] != '\0') {
		db_report_error(report, section->line,
		                "section modbus has no name, but '%s' was given; write modbus {",
		                section->title);
		return false;
	}
	if (titled && !is_name(section->title)) {
		db_report_error(
			report, section->line,
			"'%s' is no name for a %s; 1 to 31 of the characters A-Z a-z 0-9 _ -",
			section->title, section->name);
		return false;
	}
	for (size_t i = 0; i < index; i++) {
		const struct db_outline_section *other = &outline->sections[i];

		if (strcmp(other->name, section->name) != 0 ||
		    strcmp(other->title, section->title) != 0)
			continue;
		if (db_report_source(report, other->line) !=
		            db_report_source(report, section->line) &&
		    !titled)
			continue;
		db_report_error(
			report, section->line,
			titled ? "there is a %s '%s' on %s already; choose another name" :
				 "there is a section %s%s on %s already; put all keys there",
			section->name, section->title, db_report_place(report, other->line).text);
		return false;
	}
	return true;
}

static void report_unknown_key(const struct db_driver *const *drivers,
                               const struct db_outline_key *key, const char *section,
                               struct db_report *report)
{
	const char *elsewhere = db_config_name_elsewhere(drivers, section, key->name);

	if (elsewhere)
		db_report_error(report, key->line,
		                "unknown key '%s' in section %s; it belongs to section %s",
		                key->name, section, elsewhere);
	else
		db_report_error(report, key->line,
		                "unknown key '%s' in section %s; the nearest one is '%s'",
		                key->name, section,
		                db_config_name_nearest(drivers, section, key->name));
}

/* Families have no options that are lists. */
static bool is_list(const char *section, const char *name)
{
	const struct db_config_key *key = db_config_key_find(section, name);

	return key && key->kind == DB_KEY_NETWORKS;
}

/* True when the key may stay. Its section is a known one. */
static bool check_key(const struct db_driver *const *drivers, const struct db_outline *outline,
                      size_t index, struct db_report *report)
{
	const struct db_outline_key *key = &outline->keys[index];
	const char *section;

	if (key->section == DB_OUTLINE_TOP) {
		db_report_error(
			report, key->line,
			"key '%s' stands outside of a section; the sections are modbus, bus NAME and drive NAME",
			key->name);
		return false;
	}
	section = outline->sections[key->section].name;
	if (!db_config_name_known(drivers, section, key->name)) {
		report_unknown_key(drivers, key, section, report);
		return false;
	}
	if (key->list && !is_list(section, key->name)) {
		db_report_error(report, key->line,
		                "%s is a list; '%s' takes one value without braces", key->name,
		                key->name);
		return false;
	}
	for (size_t i = index; i > 0; i--) {
		/* All keys of a section stand together, but those of modbus may be in several files. */
		if (outline->keys[i - 1].section != key->section && strcmp(section, "modbus") != 0)
			break;
		if (outline->keys[i - 1].section != key->section ||
		    strcmp(outline->keys[i - 1].name, key->name) != 0)
			continue;
		db_report_error(report, key->line, "%s was set on %s already; keep one of them",
		                key->name, db_report_place(report, outline->keys[i - 1].line).text);
		return false;
	}
	return true;
}

/* Keys of a section refused only for its name are checked too, so that one run finds all. */
static void check(const struct db_driver *const *drivers, char *text, struct db_outline *outline,
                  struct db_report *report)
{
	for (size_t i = 0; i < outline->section_count; i++)
		outline->sections[i].refused = !check_section(outline, i, report);
	join_modbus(outline, report);
	for (size_t i = 0; i < outline->key_count; i++) {
		struct db_outline_key *key = &outline->keys[i];
		const char *section = key->section == DB_OUTLINE_TOP ?
		                              "" :
		                              outline->sections[key->section].name;

		if (key->section != DB_OUTLINE_TOP && !db_config_section_known(section))
			continue;
		key->refused = !check_key(drivers, outline, i, report);
		if (key->refused)
			blank(text, key->begin, key->end);
	}
	for (size_t i = 0; i < outline->section_count; i++) {
		if (outline->sections[i].refused)
			blank(text, outline->sections[i].begin, outline->sections[i].end);
	}
}

/* Each file for itself: none of them goes on in the next one. */
static bool scan_files(struct scan *scan)
{
	for (size_t i = 0; i < scan->report->source_count; i++) {
		struct db_config_source *source = &scan->report->sources[i];
		char *end = scan->text + source->begin + source->length;
		char behind = *end;
		bool good;

		scan->source = source;
		scan->at = source->begin;
		scan->line = source->lines_before + 1;
		*end = '\0';
		good = scan_text(scan);
		*end = behind;
		if (!good)
			return false;
	}
	return true;
}

bool db_outline_read(const struct db_driver *const *drivers, char *text, struct db_outline *outline,
                     struct db_report *report)
{
	struct scan scan = { .text = text, .line = 1, .outline = outline, .report = report };

	*outline = (struct db_outline){ 0 };
	if (!(report->source_count > 0 ? scan_files(&scan) : scan_text(&scan))) {
		if (report->errors == 0)
			db_report_error(report, 0,
			                "out of memory while reading it; free some and try again");
		return false;
	}
	check(drivers, text, outline, report);
	return true;
}

void db_outline_clear(struct db_outline *outline)
{
	for (size_t i = 0; i < outline->section_count; i++) {
		free(outline->sections[i].name);
		free(outline->sections[i].title);
	}
	for (size_t i = 0; i < outline->key_count; i++)
		free(outline->keys[i].name);
	free(outline->sections);
	free(outline->keys);
	*outline = (struct db_outline){ 0 };
}

unsigned db_outline_key_line(const struct db_outline *outline, size_t section, const char *name)
{
	for (size_t i = 0; i < outline->key_count; i++) {
		const struct db_outline_key *key = &outline->keys[i];

		if (key->section == section && !key->refused && strcmp(key->name, name) == 0)
			return key->line;
	}
	return 0;
}

size_t db_outline_section_find(const struct db_outline *outline, const char *name,
                               const char *title)
{
	for (size_t i = 0; i < outline->section_count; i++) {
		const struct db_outline_section *section = &outline->sections[i];

		if (!section->refused && strcmp(section->name, name) == 0 &&
		    strcmp(section->title, title) == 0)
			return i;
	}
	return DB_OUTLINE_TOP;
}
