/* SPDX-License-Identifier: Apache-2.0 */
#include "words/language.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAGIC 0x950412deu
#define HEAD_SIZE 28
#define FILE_MAX ((off_t)16 * 1024 * 1024)
/* Values in a text, and texts in texts. */
#define PLACES_MAX 16
#define DEPTH_MAX 3
/* A text with values has so many letters besides these: fewer say nothing. */
#define LETTERS_MIN 4

/* A text with values in it. */
struct pattern {
	const char *english;
	const char *translation;
	size_t letters;
};

struct db_words_language {
	const unsigned char *bytes;
	size_t size;
	uint32_t count;
	uint32_t originals; /* places of the tables in the file */
	uint32_t translations;
	struct pattern *patterns; /* those with the most letters first */
	size_t pattern_count;
};

/* A place for a value in a text: {name}, or a conversion of printf. */
struct place {
	const char *begin;
	size_t size;
	char name[24]; /* of printf: the number, from 1 */
	char kind;     /* the conversion of printf; s for a name in braces, d for {n} and {n1} */
};

/* What was found at a place. */
struct value {
	char name[24];
	const char *begin;
	size_t size;
	bool stays; /* a name, which is the same in each language */
};

const char *db_words_folder(char *(*get)(const char *name))
{
	const char *folder = get("TEXTDOMAINDIR");

	return folder && folder[0] ? folder : DB_LOCALE_FOLDER;
}

/* --- the file --------------------------------------------------------------------------------- */

/* The files are made with the least byte first, for every machine. */
static uint32_t read_number(const struct db_words_language *language, size_t at)
{
	const unsigned char *bytes = language->bytes + at;

	if (at + 4 > language->size)
		return 0;
	return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 |
	       (uint32_t)bytes[3] << 24;
}

/* The text number `i` of a table; null: the file is damaged. */
static const char *read_text(const struct db_words_language *language, size_t table, size_t i)
{
	size_t size = read_number(language, table + 8 * i);
	size_t at = read_number(language, table + 8 * i + 4);

	if (at + size >= language->size || language->bytes[at + size] != '\0')
		return NULL;
	return (const char *)language->bytes + at;
}

static const unsigned char *map_file(const char *path, size_t *size)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC);
	struct stat status;
	void *bytes = MAP_FAILED;

	if (fd < 0)
		return NULL;
	if (fstat(fd, &status) == 0 && S_ISREG(status.st_mode) && status.st_size >= HEAD_SIZE &&
	    status.st_size <= FILE_MAX) {
		*size = (size_t)status.st_size;
		bytes = mmap(NULL, *size, PROT_READ, MAP_PRIVATE, fd, 0);
	} else {
		errno = EINVAL;
	}
	(void)close(fd);
	return bytes == MAP_FAILED ? NULL : bytes;
}

/* The length of a conversion of printf that begins here, 0 if none does. */
static size_t measure_conversion(const char *text)
{
	size_t at = 1;

	if (text[0] != '%')
		return 0;
	at += strspn(text + at, "0123456789$-+#.*");
	at += strspn(text + at, "hlzj");
	return text[at] && strchr("sdiufgcxX", text[at]) ? at + 1 : 0;
}

/* The next place from `text` on; false: there is none. `count` conversions came before. */
static bool find_place(const char *text, size_t *count, struct place *place)
{
	for (; *text; text++) {
		size_t size = measure_conversion(text);

		if (text[0] == '%' && text[1] == '%') {
			text++;
			continue;
		}
		if (size > 0) {
			char *end;
			unsigned long number = strtoul(text + 1, &end, 10);

			number = *end == '$' ? number : ++*count;
			*place = (struct place){ .begin = text,
				                 .size = size,
				                 .kind = text[size - 1] };
			snprintf(place->name, sizeof(place->name), "%lu", number);
			return true;
		}
		if (text[0] != '{')
			continue;
		size = strspn(text + 1,
		              "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_");
		if (size > 0 && size < sizeof(place->name) && text[size + 1] == '}') {
			*place = (struct place){ .begin = text, .size = size + 2, .kind = 's' };
			memcpy(place->name, text + 1, size);
			if (text[1] == 'n' && strspn(text + 2, "0123456789") == size - 1)
				place->kind = 'd';
			return true;
		}
	}
	return false;
}

/* The letters besides the places; 0: it has no place, or too many. */
static size_t count_letters(const char *text)
{
	size_t letters = 0;
	size_t places = 0;
	size_t count = 0;
	struct place place;

	for (; find_place(text, &count, &place); text = place.begin + place.size) {
		for (; text < place.begin; text++)
			letters += isalpha((unsigned char)*text) ? 1 : 0;
		places++;
	}
	for (; *text; text++)
		letters += isalpha((unsigned char)*text) ? 1 : 0;
	return places > 0 && places <= PLACES_MAX ? letters : 0;
}

static int compare_patterns(const void *a, const void *b)
{
	const struct pattern *one = a;
	const struct pattern *other = b;

	return one->letters == other->letters ? strcmp(one->english, other->english) :
	       one->letters > other->letters  ? -1 :
	                                        1;
}

/* False: the file is damaged, or there is no memory. */
static bool list_patterns(struct db_words_language *language)
{
	language->patterns = calloc((size_t)language->count + 1, sizeof(*language->patterns));
	for (uint32_t i = 0; language->patterns && i < language->count; i++) {
		const char *english = read_text(language, language->originals, i);
		const char *translation = read_text(language, language->translations, i);
		size_t letters = english ? count_letters(english) : 0;

		if (!english || !translation)
			return false;
		if (letters >= LETTERS_MIN)
			language->patterns[language->pattern_count++] =
				(struct pattern){ english, translation, letters };
	}
	if (language->pattern_count > 0)
		qsort(language->patterns, language->pattern_count, sizeof(*language->patterns),
		      compare_patterns);
	return language->patterns != NULL;
}

struct db_words_language *db_words_open_language(const char *folder, const char *language)
{
	struct db_words_language *opened = calloc(1, sizeof(*opened));
	char path[512];

	snprintf(path, sizeof(path), "%s/%s/LC_MESSAGES/drivebridge.mo", folder, language);
	if (!opened)
		return NULL;
	opened->bytes = map_file(path, &opened->size);
	if (opened->bytes) {
		opened->count = read_number(opened, 8);
		opened->originals = read_number(opened, 12);
		opened->translations = read_number(opened, 16);
	}
	if (opened->bytes && read_number(opened, 0) == MAGIC && read_number(opened, 4) == 0 &&
	    opened->count < opened->size / 16 && opened->originals < opened->size &&
	    opened->translations < opened->size && list_patterns(opened))
		return opened;
	if (opened->bytes)
		errno = EINVAL;
	db_words_close_language(opened);
	return NULL;
}

void db_words_close_language(struct db_words_language *language)
{
	if (!language)
		return;
	if (language->bytes)
		(void)munmap((void *)(uintptr_t)language->bytes, language->size);
	free(language->patterns);
	free(language);
}

/* --- texts ------------------------------------------------------------------------------------ */

/* The number of an English text in the tables, which are sorted; -1: it has no translation. */
static long find_entry(const struct db_words_language *language, const char *english)
{
	uint32_t first = 0;
	uint32_t end = language->count;

	while (first < end) {
		uint32_t middle = first + (end - first) / 2;
		/* All of them were read when the file was opened; gcc's analyzer does not see that.
		 */
		int order = strcmp(english, read_text(language, language->originals, middle));

		if (order == 0)
			return (long)middle;
		if (order < 0)
			end = middle;
		else
			first = middle + 1;
	}
	return -1;
}

/* Null: there is no translation. */
static const char *look_up(const struct db_words_language *language, const char *english)
{
	/* The entry of "" has the file's own data. */
	long entry = english[0] ? find_entry(language, english) : -1;

	return entry < 0 ? NULL : read_text(language, language->translations, (uint32_t)entry);
}

const char *db_words_find_text(const struct db_words_language *language, const char *english)
{
	const char *found = language ? look_up(language, english) : NULL;

	return found && found[0] ? found : english;
}

const char *db_words_find_name(const struct db_words_language *language, const char *name,
                               size_t length)
{
	char words[128];
	const char *found;

	if (!language || length >= sizeof(words))
		return NULL;
	for (size_t i = 0; i < length; i++)
		words[i] = name[i] == '_' ? ' ' : name[i];
	words[length] = '\0';
	found = look_up(language, words);
	return found && found[0] ? found : NULL;
}

size_t db_words_name_length(const char *name, const char *unit)
{
	size_t length = strlen(name);
	size_t suffix = strlen(unit);

	if (suffix > 0 && length > suffix + 1 && name[length - suffix - 1] == '_' &&
	    strcmp(name + length - suffix, unit) == 0)
		return length - suffix - 1;
	return length;
}

const char *db_words_find_count(const struct db_words_language *language, size_t count,
                                const char *one, const char *several)
{
	long entry = language ? find_entry(language, one) : -1;
	const char *found;
	size_t length;

	if (entry < 0)
		return count == 1 ? one : several;
	found = read_text(language, language->translations, (uint32_t)entry);
	length = strlen(found);
	/* The forms follow each other; Chinese has only one. */
	if (count == 1 ||
	    length == read_number(language, language->translations + 8 * (size_t)entry))
		return found;
	return found + length + 1;
}

static bool follows(const char *pattern, const char *at, const char *words)
{
	size_t length = strlen(words);

	return (size_t)(at - pattern) >= length && strncmp(at - length, words, length) == 0;
}

/* Whether the value at a place of a pattern is a name: of a drive, a register, an option, or what
 * was typed. */
static bool is_name(const char *pattern, const struct place *place, const char *value, size_t size)
{
	static const char *const names[] = { "name", "drive", "bus", "command", "method" };
	bool braced = place->begin[0] == '{';

	for (size_t i = 0; braced && i < sizeof(names) / sizeof(names[0]); i++) {
		if (strncmp(place->name, names[i], strlen(names[i])) == 0)
			return true;
	}
	if (place->begin > pattern && strchr("\"'", place->begin[-1]) &&
	    place->begin[place->size] == place->begin[-1])
		return true;
	if (memchr(value, ' ', size))
		return false;
	return follows(pattern, place->begin, "--") || follows(pattern, place->begin, "drive ") ||
	       follows(pattern, place->begin, "bus ") || follows(pattern, place->begin, "of ") ||
	       (!braced && place->begin == pattern);
}

/* Whether `text` is this pattern with values, and which. Each value ends where what follows it
 * comes first; only the last one reaches as far as it can. */
static bool match(const char *pattern, const char *text, struct value values[PLACES_MAX],
                  size_t *count)
{
	const char *whole = pattern;
	size_t conversions = 0;
	struct place place;
	bool more = find_place(pattern, &conversions, &place);
	size_t length;

	if (!more)
		return false;
	length = (size_t)(place.begin - pattern);
	if (strncmp(pattern, text, length) != 0)
		return false;
	text += length;
	for (*count = 0; more && *count < PLACES_MAX; ++*count) {
		struct value *value = &values[*count];
		struct place here = place;
		/* What the number at this place consists of. Null: it is none. */
		const char *letters = strchr("diu", here.kind) ? "+-0123456789" :
		                      strchr("xX", here.kind)  ? "0123456789abcdefABCDEF" :
		                      strchr("fg", here.kind)  ? "+-.0123456789einfa" :
		                                                 NULL;
		const char *end;

		memcpy(value->name, place.name, sizeof(value->name));
		value->begin = text;
		pattern = place.begin + place.size;
		more = find_place(pattern, &conversions, &place);
		length = more ? (size_t)(place.begin - pattern) : strlen(pattern);
		end = !more && strlen(text) >= length ? text + strlen(text) - length :
		                                        memmem(text, strlen(text), pattern, length);
		/* Where another value follows at once, a number is as long as it can be. */
		if (more && length == 0 && letters)
			end = text + strspn(text, letters);
		if (!end || strncmp(end, pattern, length) != 0)
			return false;
		value->size = (size_t)(end - text);
		/* The place of a number takes a number, that of a letter one letter. */
		if ((here.kind == 'c' && value->size != 1) ||
		    (letters && (value->size == 0 || strspn(text, letters) < value->size)))
			return false;
		value->stays = is_name(whole, &here, text, value->size);
		text = end + length;
	}
	return !more && !*text;
}

static const char *translate(const struct db_words_language *language, const char *english,
                             char room[DB_WORDS_TEXT_MAX], unsigned depth);

/* Appends; false: it is too long. */
static bool append(char room[DB_WORDS_TEXT_MAX], size_t *used, const char *text, size_t size)
{
	if (*used + size >= DB_WORDS_TEXT_MAX)
		return false;
	memcpy(room + *used, text, size);
	*used += size;
	room[*used] = '\0';
	return true;
}

/* Writes the translation of a pattern with these values. False: it is too long. */
static bool fill_in(const struct db_words_language *language, const char *translation,
                    const struct value *values, size_t count, char room[DB_WORDS_TEXT_MAX],
                    unsigned depth)
{
	size_t used = 0;
	size_t conversions = 0;
	struct place place;

	room[0] = '\0';
	for (; find_place(translation, &conversions, &place);
	     translation = place.begin + place.size) {
		const struct value *value = values;
		char text[DB_WORDS_TEXT_MAX];
		char other[DB_WORDS_TEXT_MAX];
		const char *words;

		if (!append(room, &used, translation, (size_t)(place.begin - translation)))
			return false;
		while (value < values + count && strcmp(value->name, place.name) != 0)
			value++;
		if (value == values + count || value->size >= sizeof(text))
			return false;
		memcpy(text, value->begin, value->size);
		text[value->size] = '\0';
		words = value->stays ? text : translate(language, text, other, depth + 1);
		if (!append(room, &used, words, strlen(words)))
			return false;
	}
	return append(room, &used, translation, strlen(translation));
}

/* Where a list of codes at the end begins: ": 0=closed 1=open 2=..."; these are names. Null: there
 * is none. */
static const char *find_codes(const char *text)
{
	const char *codes = NULL;
	const char *word = text + strlen(text);
	size_t count = 0;

	while (word > text) {
		const char *end = word;
		const char *equals;

		while (word > text && word[-1] != ' ')
			word--;
		equals = memchr(word, '=', (size_t)(end - word));
		if (!equals || equals == word || equals + 1 == end || word == text)
			break;
		count++;
		word--;
		codes = word;
	}
	if (count < 3)
		return NULL;
	return codes > text && codes[-1] == ':' ? codes - 1 : codes;
}

/* Translates what begins at `rest`. */
static const char *translate_rest(const struct db_words_language *language, const char *english,
                                  const char *rest, char room[DB_WORDS_TEXT_MAX], unsigned depth)
{
	char other[DB_WORDS_TEXT_MAX];
	const char *words = translate(language, rest, other, depth + 1);
	size_t used = 0;

	return words != rest && append(room, &used, english, (size_t)(rest - english)) &&
	                       append(room, &used, words, strlen(words)) ?
	               room :
	               english;
}

static const char *translate(const struct db_words_language *language, const char *english,
                             char room[DB_WORDS_TEXT_MAX], unsigned depth)
{
	const char *found = look_up(language, english);
	const char *codes = found ? NULL : find_codes(english);
	/* "plant.conf:7: no such key": what is after a name and a colon is a text of its own. */
	const char *rest = strstr(english, ": ");

	/* gcc's analyzer forgets the first condition. */
	rest = rest && rest > english && rest[2] &&
	                       !memchr(english, ' ', (size_t)(rest - english)) ?
	               rest + 2 :
	               NULL;
	if (found || !english[0] || depth > DEPTH_MAX)
		return found && found[0] ? found : english;
	if (codes && codes - english < DB_WORDS_TEXT_MAX) {
		char head[DB_WORDS_TEXT_MAX];
		char other[DB_WORDS_TEXT_MAX];
		const char *words;
		size_t used = 0;

		memcpy(head, english, (size_t)(codes - english));
		head[codes - english] = '\0';
		words = translate(language, head, other, depth + 1);
		return append(room, &used, words, strlen(words)) &&
		                       append(room, &used, codes, strlen(codes)) ?
		               room :
		               english;
	}
	for (size_t i = 0; i < language->pattern_count && !(rest && look_up(language, rest)); i++) {
		const struct pattern *pattern = &language->patterns[i];
		struct value values[PLACES_MAX];
		size_t count = 0;

		if (match(pattern->english, english, values, &count))
			return fill_in(language, pattern->translation, values, count, room, depth) ?
			               room :
			               english;
		if (rest && match(pattern->english, rest, values, &count))
			break;
	}
	return rest ? translate_rest(language, english, rest, room, depth) : english;
}

const char *db_words_in(const struct db_words_language *language, const char *english,
                        char room[DB_WORDS_TEXT_MAX])
{
	return language ? translate(language, english, room, 0) : english;
}

/* --- choosing --------------------------------------------------------------------------------- */

static bool exists(const char *folder, const char *language)
{
	char path[512];

	snprintf(path, sizeof(path), "%s/%s/LC_MESSAGES/drivebridge.mo", folder, language);
	return access(path, R_OK) == 0;
}

/* Fills in the language that there is for a name such as de_AT, de for it. */
static bool find_language(const char *folder, const char *wanted, size_t size,
                          char language[DB_WORDS_LANGUAGE_MAX])
{
	if (size == 0 || size >= DB_WORDS_LANGUAGE_MAX || memchr(wanted, '/', size) ||
	    wanted[0] == '.')
		return false;
	snprintf(language, DB_WORDS_LANGUAGE_MAX, "%.*s", (int)size, wanted);
	if (exists(folder, language))
		return true;
	/* In Singapore it is written as in China, elsewhere with other characters. */
	if (strcmp(language, "zh") == 0 || strcmp(language, "zh_SG") == 0)
		snprintf(language, DB_WORDS_LANGUAGE_MAX, "zh_CN");
	else if (strncmp(language, "zh", 2) != 0)
		language[strcspn(language, "_")] = '\0';
	return exists(folder, language);
}

bool db_words_choose_language(const char *folder, char *(*get)(const char *name),
                              char language[DB_WORDS_LANGUAGE_MAX])
{
	static const char *const names[] = { "LC_ALL", "LC_MESSAGES", "LANG" };
	const char *locale = NULL;
	const char *list = get("LANGUAGE");
	const char *set;
	size_t size;

	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]) && !(locale && locale[0]); i++)
		locale = get(names[i]);
	language[0] = '\0';
	/* C means the untranslated texts, whatever LANGUAGE says; C.UTF-8 does not. */
	if (!locale || !locale[0] || strcmp(locale, "C") == 0 || strcmp(locale, "POSIX") == 0)
		return false;
	set = strchr(locale, '.');
	if (!set || (strncasecmp(set, ".UTF-8", 6) != 0 && strncasecmp(set, ".utf8", 5) != 0))
		return false;
	if (!list || !list[0])
		list = locale;
	for (; *list; list += size + (list[size] ? 1 : 0)) {
		size_t letters = strcspn(list, ":.@");

		size = strcspn(list, ":");
		if (letters >= 2 && strncmp(list, "en", 2) == 0 && !isalpha((unsigned char)list[2]))
			break;
		if (find_language(folder, list, letters < size ? letters : size, language))
			return true;
	}
	language[0] = '\0';
	return false;
}

/* --- width ------------------------------------------------------------------------------------ */

/* Whether a character takes two columns: those of Chinese, Japanese and Korean with their
 * punctuation. */
static bool is_wide(uint32_t letter)
{
	return (letter >= 0x1100 && letter <= 0x115f) || (letter >= 0x2e80 && letter <= 0xa4cf) ||
	       (letter >= 0xac00 && letter <= 0xd7a3) || (letter >= 0xf900 && letter <= 0xfaff) ||
	       (letter >= 0xfe30 && letter <= 0xfe6f) || (letter >= 0xff00 && letter <= 0xff60) ||
	       (letter >= 0xffe0 && letter <= 0xffe6) || (letter >= 0x20000 && letter <= 0x3fffd);
}

unsigned db_words_columns(const char *text, size_t bytes)
{
	unsigned columns = 0;

	for (size_t i = 0; i < bytes;) {
		unsigned char first = (unsigned char)text[i++];
		uint32_t letter = first < 0x80 ? first :
		                  first < 0xe0 ? first & 0x1fu :
		                  first < 0xf0 ? first & 0x0fu :
		                                 first & 0x07u;

		while (i < bytes && ((unsigned char)text[i] & 0xc0) == 0x80)
			letter = letter << 6 | ((unsigned char)text[i++] & 0x3fu);
		columns += is_wide(letter) ? 2 : 1;
	}
	return columns;
}

int db_words_fit(const char *text, unsigned columns)
{
	size_t bytes = 0;
	unsigned used = 0;

	while (text[bytes]) {
		size_t next = bytes + 1;

		while (((unsigned char)text[next] & 0xc0) == 0x80)
			next++;
		used += db_words_columns(text + bytes, next - bytes);
		if (used > columns)
			break;
		bytes = next;
	}
	return (int)bytes;
}
