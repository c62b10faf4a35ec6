/* SPDX-License-Identifier: Apache-2.0 */
#include "reader/reader.h"

#include <stdlib.h>
#include <string.h>

enum token_type {
	TOKEN_END,
	TOKEN_WORD,
	TOKEN_STRING, /* in quotes, or a variable */
	TOKEN_OPEN,
	TOKEN_CLOSE,
	TOKEN_EQUALS,
	TOKEN_APPEND,
	TOKEN_COMMA,
	TOKEN_BAD /* reported already, or no memory */
};

struct token {
	enum token_type type;
	const char *begin; /* as it is in the file */
	size_t length;
	unsigned line;
};

struct scan {
	const struct db_reader_rules *rules;
	struct db_reader *reader;
	struct db_messages *messages;
	struct db_source *source;
	const char *at;
	unsigned line;
	struct token token; /* the current one */
	/* The content of a word or string, terminated with a zero byte. */
	char *text;
	size_t length;
	size_t size;
	bool lost; /* there was no memory for a part of it */
};

/* Characters that word processors and copied pages leave in a file. */
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

/* Reports a character here that only looks like an allowed one. False: it is none. */
static bool refuse_misprint(struct scan *scan)
{
	const unsigned char *bytes = (const unsigned char *)scan->at;
	char narrow = 0;

	/* U+FF01 to U+FF5E, which Chinese input methods write for ! to ~. */
	if (bytes[0] == 0xEF && bytes[1] == 0xBC && bytes[2] >= 0x81 && bytes[2] <= 0xBF)
		narrow = (char)(bytes[2] - 0x81 + '!');
	else if (bytes[0] == 0xEF && bytes[1] == 0xBD && bytes[2] >= 0x80 && bytes[2] <= 0x9E)
		narrow = (char)(bytes[2] - 0x80 + '`');
	if (narrow != 0) {
		db_messages_add_error(scan->messages, scan->line,
		                      "here stands a full-width character (U+%04X); "
		                      "write the ordinary %c",
		                      0xFF01u + (unsigned)(narrow - '!'), narrow);
		return true;
	}
	for (size_t i = 0; i < sizeof(MISPRINTS) / sizeof(MISPRINTS[0]); i++) {
		if (strncmp(scan->at, MISPRINTS[i].bytes, strlen(MISPRINTS[i].bytes)) == 0) {
			db_messages_add_error(scan->messages, scan->line, "here stands %s",
			                      MISPRINTS[i].what);
			return true;
		}
	}
	return false;
}

static void put_byte(struct scan *scan, char byte)
{
	if (scan->length == scan->size) {
		size_t size = scan->size > 0 ? 2 * scan->size : 64;
		char *text = realloc(scan->text, size);

		if (!text) {
			scan->lost = true;
			return;
		}
		scan->text = text;
		scan->size = size;
	}
	scan->text[scan->length++] = byte;
}

/* --- tokens ----------------------------------------------------------------------------------- */

/* Moves to the next character that is neither space nor comment. False after a message. */
static bool skip_space(struct scan *scan)
{
	for (;; scan->at++) {
		const char *at = scan->at;

		if (at[0] == '#' || (at[0] == '/' && at[1] == '/')) {
			scan->at += strcspn(at, "\n");
		} else if (at[0] == '/' && at[1] == '*') {
			const char *end = strstr(at + 2, "*/");

			if (!end) {
				db_messages_add_error(scan->messages, scan->line,
				                      "the comment that begins here has no end; "
				                      "close it with */");
				return false;
			}
			for (; at < end; at++)
				scan->line += *at == '\n';
			/* On its last byte. */
			scan->at = end + 1;
			continue;
		}
		if (*scan->at == '\n')
			scan->line++;
		else if (!*scan->at || !strchr(" \t\r", *scan->at))
			return true;
	}
}

/* At ${NAME} or ${NAME:-OTHERWISE}. False: it has no end and is no variable. */
static bool put_variable(struct scan *scan)
{
	const char *name = scan->at + 2;
	const char *end = strchr(name, '}');
	char *whole, *otherwise;
	const char *value;

	if (!end)
		return false;
	whole = strndup(name, (size_t)(end - name));
	otherwise = whole ? strstr(whole, ":-") : NULL;
	if (otherwise) {
		*otherwise = '\0';
		otherwise += 2;
	}
	value = whole ? getenv(whole) : NULL;
	if (!value)
		value = otherwise ? otherwise : "";
	for (; *value; value++)
		put_byte(scan, *value);
	scan->lost |= !whole;
	free(whole);
	scan->at = end + 1;
	return true;
}

/* After a backslash, as in C. False after a message. */
static bool put_escape(struct scan *scan)
{
	static const char letters[] = "ntrabfve";
	static const char bytes[] = "\n\t\r\a\b\f\v\033";
	const char *letter = *scan->at ? strchr(letters, *scan->at) : NULL;
	size_t digits = strspn(scan->at, "0123456789");
	char number[3] = "";

	if (digits > 0) {
		if (digits > 3 || strspn(scan->at, "01234567") < digits) {
			db_messages_add_error(scan->messages, scan->line,
			                      "unknown escape after a backslash; at most three "
			                      "octal digits, or write \\\\ for a backslash");
			return false;
		}
		put_byte(scan, (char)strtoul(scan->at, NULL, 8));
		scan->at += digits;
		return true;
	}
	if (*scan->at == 'x' && (digits = strspn(scan->at + 1, "0123456789abcdefABCDEF")) > 0) {
		memcpy(number, scan->at + 1, digits < 2 ? digits : 2);
		put_byte(scan, (char)strtoul(number, NULL, 16));
		scan->at += 1 + strlen(number);
		return true;
	}
	put_byte(scan, letter ? bytes[letter - letters] : *scan->at);
	scan->at++;
	return true;
}

/* After a backslash: stores the character that it stands for. False after a message. */
static bool scan_escape(struct scan *scan, char quote)
{
	bool plain = *scan->at == quote || *scan->at == '\\';

	if (!plain && !scan->rules->lenient) {
		db_messages_add_error(scan->messages, scan->line,
		                      "unknown escape after a backslash; write \\\\ for a "
		                      "backslash and \\%c for %c",
		                      quote, quote);
		return false;
	}
	if (*scan->at == '\n') {
		scan->line++;
		scan->at++;
		return true;
	}
	if (!plain && quote == '"' && *scan->at)
		return put_escape(scan);
	if (!plain)
		put_byte(scan, '\\');
	if (*scan->at)
		put_byte(scan, *scan->at++);
	return true;
}

/* At its first quote. False after a message. */
static bool scan_string(struct scan *scan)
{
	bool lenient = scan->rules->lenient;
	unsigned start = scan->line;
	char quote = *scan->at++;

	while (*scan->at != quote) {
		bool variable = scan->at[0] == '$' && scan->at[1] == '{';

		if (*scan->at == '\0' || (*scan->at == '\n' && !lenient)) {
			db_messages_add_error(
				scan->messages, start,
				"the text that begins here has no end; close it with %c%s", quote,
				lenient ? "" : " on the same line");
			return false;
		}
		if (variable && !lenient) {
			db_messages_add_error(
				scan->messages, scan->line,
				"environment variables are not filled in; write the value itself");
			return false;
		}
		if (variable && quote == '"' && put_variable(scan))
			continue;
		if (*scan->at == '\\') {
			scan->at++;
			if (!scan_escape(scan, quote))
				return false;
			continue;
		}
		scan->line += *scan->at == '\n';
		put_byte(scan, *scan->at++);
	}
	scan->at++;
	return true;
}

/* Number of bytes of a word here, 0 at its end. A slash counts together with the byte after it,
 * which must not make a comment of it: "a//b" is more often a mistake than a comment. */
static size_t word_bytes(const struct scan *scan)
{
	static const char OTHERS[] = " #\"'\t\n\r={}()+,*";
	const char *at = scan->at;

	if (*at == '\0' || strchr(OTHERS, *at))
		return 0;
	if (*at != '/' || scan->rules->lenient)
		return 1;
	return at[1] == '\0' || at[1] == '/' || strchr(OTHERS, at[1]) ? 0 : 2;
}

/* False after a message. */
static bool scan_word(struct scan *scan)
{
	const char *begin = scan->at;
	size_t bytes;

	while ((bytes = word_bytes(scan)) > 0) {
		if (!scan->rules->lenient && refuse_misprint(scan))
			return false;
		while (bytes-- > 0)
			put_byte(scan, *scan->at++);
	}
	/* "${" begins a variable, which is not part of a word. */
	if (scan->at > begin && *scan->at != '/' && !(scan->at[-1] == '$' && *scan->at == '{'))
		return true;
	db_messages_add_error(scan->messages, scan->line,
	                      "the character '%c' cannot stand here; put texts with special "
	                      "characters in \"quotes\"",
	                      *scan->at);
	return false;
}

static enum token_type scan_token(struct scan *scan)
{
	static const char MARKS[] = "{}=,";
	static const enum token_type TYPES[] = { TOKEN_OPEN, TOKEN_CLOSE, TOKEN_EQUALS,
		                                 TOKEN_COMMA };
	const char *at = scan->at;
	const char *mark = strchr(MARKS, *at);

	if (*at == '\0')
		return TOKEN_END;
	if (mark) {
		scan->at++;
		return TYPES[mark - MARKS];
	}
	if (*at == '"' || *at == '\'')
		return scan_string(scan) ? TOKEN_STRING : TOKEN_BAD;
	if (scan->rules->lenient && at[0] == '+' && at[1] == '=') {
		scan->at += 2;
		return TOKEN_APPEND;
	}
	if (scan->rules->lenient && at[0] == '$' && at[1] == '{' && put_variable(scan))
		return TOKEN_STRING;
	return scan_word(scan) ? TOKEN_WORD : TOKEN_BAD;
}

/* Reads the next token. */
static void read_token(struct scan *scan)
{
	scan->token.type = TOKEN_BAD;
	if (!skip_space(scan))
		return;
	scan->length = 0;
	scan->token.begin = scan->at;
	scan->token.line = scan->line;
	scan->token.type = scan_token(scan);
	scan->token.length = (size_t)(scan->at - scan->token.begin);
	put_byte(scan, '\0');
	if (scan->lost)
		scan->token.type = TOKEN_BAD;
}

/* --- what they make --------------------------------------------------------------------------- */

/* Reports what is not allowed here, unless there was a message about it; returns false. */
static bool refuse_token(struct scan *scan, const char *expected)
{
	size_t length = scan->token.length;

	if (scan->token.type == TOKEN_END)
		db_messages_add_error(scan->messages, scan->token.line,
		                      "the file ends too early; expected %s", expected);
	else if (scan->token.type != TOKEN_BAD)
		db_messages_add_error(scan->messages, scan->token.line,
		                      "'%.*s' cannot stand here; expected %s",
		                      length > 40 ? 40 : (int)length, scan->token.begin, expected);
	return false;
}

static bool is_text(const struct scan *scan)
{
	return scan->token.type == TOKEN_WORD || scan->token.type == TOKEN_STRING;
}

/* Names of sections and keys. */
static bool is_name(const struct scan *scan)
{
	return scan->token.type == TOKEN_WORD || (scan->rules->lenient && is_text(scan));
}

static bool add_value(const struct scan *scan, struct db_reader_key *key)
{
	size_t size = strlen(scan->text) + 1;
	char *values = realloc(key->values, key->size + size);

	if (!values)
		return false;
	memcpy(values + key->size, scan->text, size);
	key->values = values;
	key->size += size;
	key->count++;
	return true;
}

/* After a value that was taken as complete. False after a message. */
static bool refuse_comma(struct scan *scan, struct token value)
{
	unsigned line = scan->token.line;

	if (scan->token.type != TOKEN_COMMA)
		return true;
	read_token(scan);
	if (value.type == TOKEN_WORD && strspn(value.begin, "-0123456789") == value.length &&
	    scan->token.type == TOKEN_WORD)
		db_messages_add_error(scan->messages, line,
		                      "numbers have a decimal point, not a comma; write %.*s.%.*s",
		                      (int)value.length, value.begin, (int)scan->token.length,
		                      scan->token.begin);
	else
		db_messages_add_error(
			scan->messages, line,
			"several values are a list; write them in braces: {\"a\", \"b\"}");
	return false;
}

/* Starts at its first token; moves to the token after it. */
static bool read_value(struct scan *scan, struct db_reader_key *key)
{
	struct token value = scan->token;
	/* Brackets around a list, as in other languages; [ADDRESS]:PORT is no such case. */
	const char *word = scan->token.begin;
	size_t length = scan->token.length;

	if (scan->token.type == TOKEN_WORD && word[0] == '[' && !scan->rules->lenient &&
	    (word[length - 1] == ']' || !memchr(word, ']', length))) {
		db_messages_add_error(
			scan->messages, value.line,
			"a list stands in braces, not in brackets; write {\"a\", \"b\"}");
		return false;
	}
	if (value.type != TOKEN_OPEN) {
		char expected[96];

		snprintf(expected, sizeof(expected), "the value of '%.40s'", key->name);
		if (!is_text(scan))
			return refuse_token(scan, expected);
		if (!add_value(scan, key))
			return false;
		read_token(scan);
		return refuse_comma(scan, value);
	}
	key->list = true;
	do {
		read_token(scan);
		if (scan->token.type == TOKEN_CLOSE)
			break;
		if (!is_text(scan))
			return refuse_token(scan, "a value, or } at the end of the list");
		if (!add_value(scan, key))
			return false;
		read_token(scan);
	} while (scan->token.type == TOKEN_COMMA);
	if (scan->token.type != TOKEN_CLOSE)
		return refuse_token(scan, "a comma, or } at the end of the list");
	read_token(scan);
	return true;
}

/* At = or +=; takes over the name. Moves to the token after the value. */
static bool read_key(struct scan *scan, char *name, unsigned line, size_t section)
{
	struct db_reader *reader = scan->reader;
	struct db_reader_key *key = NULL;
	bool append = scan->token.type == TOKEN_APPEND;

	if (scan->rules->lenient)
		key = db_reader_find_key(reader, section, name);
	if (key && append) {
		free(name);
	} else {
		struct db_reader_key *keys;

		if (key)
			key->refused = true;
		keys = realloc(reader->keys, (reader->key_count + 1) * sizeof(*keys));
		if (!keys) {
			free(name);
			return false;
		}
		reader->keys = keys;
		key = &keys[reader->key_count++];
		*key = (struct db_reader_key){ .name = name, .line = line, .section = section };
	}
	key->list = append;
	read_token(scan);
	return read_value(scan, key);
}

/* At what follows a name in a section, and is not =: reports it, or the section that is still open
 * when another one begins; returns false. */
static bool refuse_after_key(struct scan *scan, size_t section, const char *name, unsigned line)
{
	const struct db_reader_section *open = &scan->reader->sections[section];
	struct token token = scan->token;

	if (name[0] == ';') {
		db_messages_add_error(scan->messages, line, "no ; ends a value; remove it");
		return false;
	}
	if (is_text(scan))
		read_token(scan);
	if (scan->token.type != TOKEN_OPEN) {
		scan->token = token;
		return refuse_token(scan, "= after the key");
	}
	db_messages_add_error(scan->messages, line,
	                      "a section begins here, but section '%s' of %s has no } at its end; "
	                      "put it before this line",
	                      open->name, db_messages_name_line(scan->messages, open->line).text);
	return false;
}

/* After its name, which is taken over, at the title or '{'. */
static bool read_section(struct scan *scan, char *name, unsigned line)
{
	struct db_reader *reader = scan->reader;
	size_t index = reader->section_count;
	struct db_reader_section *sections;
	char *title = strdup(is_text(scan) ? scan->text : "");

	sections = realloc(reader->sections, (index + 1) * sizeof(*sections));
	if (sections)
		reader->sections = sections;
	if (!sections || !title) {
		free(name);
		free(title);
		return false;
	}
	sections[index] = (struct db_reader_section){
		.name = name,
		.title = title,
		.line = line,
		.profile = scan->source->profile,
		.base = DB_READER_NO_SECTION,
	};
	reader->section_count++;
	if (is_text(scan))
		read_token(scan);
	if (scan->token.type != TOKEN_OPEN)
		return refuse_token(scan, "{ at the start of a section, or = after a key");
	read_token(scan);
	while (scan->token.type != TOKEN_CLOSE) {
		unsigned place = scan->token.line;
		char *key;

		if (!is_name(scan))
			return refuse_token(scan, "a key, or } at the end of the section");
		key = strdup(scan->text);
		if (!key)
			return false;
		read_token(scan);
		if (scan->token.type != TOKEN_EQUALS && scan->token.type != TOKEN_APPEND) {
			refuse_after_key(scan, index, key, place);
			free(key);
			return false;
		}
		if (!read_key(scan, key, place, index))
			return false;
	}
	read_token(scan);
	return true;
}

/* Each text separately: none of them continues in the next one. */
static bool read_source(struct scan *scan)
{
	bool good = true;

	scan->at = scan->source->text;
	scan->line = scan->source->lines_before + 1;
	read_token(scan);
	while (good && scan->token.type != TOKEN_END) {
		unsigned line = scan->token.line;
		char expected[64];
		char *name;

		snprintf(expected, sizeof(expected), "a section: %s", scan->rules->sections);
		if (!is_name(scan))
			return refuse_token(scan, expected);
		name = strdup(scan->text);
		if (!name)
			return false;
		read_token(scan);
		if (scan->token.type == TOKEN_EQUALS || scan->token.type == TOKEN_APPEND) {
			good = read_key(scan, name, line, DB_READER_NO_SECTION);
		} else if (strcmp(name, "end") == 0) {
			/* The last word of a text. */
			free(name);
			good = scan->token.type == TOKEN_END;
			scan->source->ended = good;
			if (!good && scan->token.type != TOKEN_BAD)
				db_messages_add_error(
					scan->messages, line,
					"end says that the file is complete, but more follows on "
					"%s; move it to the last line",
					db_messages_name_line(scan->messages, scan->token.line)
						.text);
		} else {
			good = read_section(scan, name, line);
		}
	}
	return good;
}

bool db_reader_read_more(struct db_reader *reader, const struct db_reader_rules *rules,
                         struct db_messages *messages, size_t first)
{
	struct scan scan = { .rules = rules, .reader = reader, .messages = messages };
	bool good = true;

	db_sources_count_lines(messages->sources, messages->source_count);
	for (size_t i = first; good && i < messages->source_count; i++) {
		scan.source = &messages->sources[i];
		good = read_source(&scan);
	}
	free(scan.text);
	if (!good && messages->errors == 0)
		db_messages_add_error(messages, 0,
		                      "out of memory while reading it; free some and try again");
	return good;
}

bool db_reader_read(struct db_reader *reader, const struct db_reader_rules *rules,
                    struct db_messages *messages)
{
	*reader = (struct db_reader){ 0 };
	return db_reader_read_more(reader, rules, messages, 0);
}

void db_reader_clear(struct db_reader *reader)
{
	for (size_t i = 0; i < reader->section_count; i++) {
		free(reader->sections[i].name);
		free(reader->sections[i].title);
	}
	for (size_t i = 0; i < reader->key_count; i++) {
		free(reader->keys[i].name);
		free(reader->keys[i].values);
	}
	free(reader->sections);
	free(reader->keys);
	*reader = (struct db_reader){ 0 };
}

size_t db_reader_find_section(const struct db_reader *reader, const char *name, const char *title)
{
	for (size_t i = 0; i < reader->section_count; i++) {
		const struct db_reader_section *section = &reader->sections[i];

		if (!section->refused && strcmp(section->name, name) == 0 &&
		    strcmp(section->title, title) == 0)
			return i;
	}
	return DB_READER_NO_SECTION;
}

struct db_reader_key *db_reader_find_key(const struct db_reader *reader, size_t section,
                                         const char *name)
{
	for (;;) {
		for (size_t i = 0; i < reader->key_count; i++) {
			struct db_reader_key *key = &reader->keys[i];

			if (key->section == section && !key->refused &&
			    strcmp(key->name, name) == 0)
				return key;
		}
		if (section >= reader->section_count)
			return NULL;
		section = reader->sections[section].base;
		/* Keys outside of every section belong to none. */
		if (section == DB_READER_NO_SECTION)
			return NULL;
	}
}
