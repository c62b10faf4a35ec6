/* SPDX-License-Identifier: Apache-2.0 */
#include "words/value.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SECONDS_MAX 864000.0

const char *db_words_text(const json_t *object, const char *name)
{
	const char *text = json_string_value(json_object_get(object, name));

	return text ? text : "";
}

json_int_t db_words_number(const json_t *object, const char *name)
{
	return json_integer_value(json_object_get(object, name));
}

bool db_words_flag(const json_t *object, const char *name)
{
	return json_is_true(json_object_get(object, name));
}

json_t *db_words_look_up(const json_t *list, const char *name)
{
	size_t i;
	json_t *item;

	json_array_foreach(list, i, item)
	{
		if (strcmp(db_words_text(item, "name"), name) == 0)
			return item;
	}
	return NULL;
}

bool db_words_has_text(const json_t *texts, const char *text)
{
	size_t i;
	const json_t *one;

	json_array_foreach(texts, i, one)
	{
		if (json_is_string(one) && strcmp(json_string_value(one), text) == 0)
			return true;
	}
	return false;
}

static bool has_bits(const json_t *reg)
{
	return strncmp(db_words_text(reg, "type"), "bits", 4) == 0;
}

void db_words_clean(char *text)
{
	for (unsigned char *at = (unsigned char *)text; *at; at++) {
		if (*at < ' ' || *at == 0x7f)
			*at = '?';
		/* Control characters 80 to 9f in two-byte UTF-8. */
		if (at[0] == 0xc2 && at[1] >= 0x80 && at[1] < 0xa0)
			at[0] = at[1] = '?';
		/* What turns the direction of a text: U+200E, U+200F, U+202A to U+202E and U+2066
		 * to U+2069, in UTF-8. */
		if (at[0] == 0xe2 && ((at[1] == 0x80 && ((at[2] >= 0x8e && at[2] <= 0x8f) ||
		                                         (at[2] >= 0xaa && at[2] <= 0xae))) ||
		                      (at[1] == 0x81 && at[2] >= 0xa6 && at[2] <= 0xa9)))
			at[0] = at[1] = at[2] = '?';
	}
}

void db_words_write_time(json_int_t us, char text[DB_WORDS_TIME_MAX])
{
	time_t seconds = (time_t)(us / 1000000);
	char when[32] = "";
	struct tm local;

	if (localtime_r(&seconds, &local))
		(void)strftime(when, sizeof(when), "%Y-%m-%d %H:%M:%S", &local);
	snprintf(text, DB_WORDS_TIME_MAX, "%s.%03d", when, (int)(us / 1000 % 1000));
}

const char *db_words_code_name(const json_t *reg, json_int_t code)
{
	char key[24];

	snprintf(key, sizeof(key), "%lld", (long long)code);
	return json_string_value(json_object_get(json_object_get(reg, "codes"), key));
}

/* Where the next "NUMBER=" begins after white space, or where `from` ends. */
static const char *next_number(const char *from)
{
	for (; *from; from++) {
		if (isspace((unsigned char)from[0]) && isdigit((unsigned char)from[1]) &&
		    from[1 + strspn(from + 1, "0123456789")] == '=')
			return from;
	}
	return from;
}

bool db_words_meaning(const json_t *reg, const char *description, const json_t *value, char *text,
                      size_t size)
{
	char key[24];
	size_t length;
	const char *next = description;
	const char *end;

	if (!json_is_number(value) || has_bits(reg) ||
	    db_words_code_name(reg, (json_int_t)json_number_value(value)))
		return false;
	if (json_is_integer(value))
		snprintf(key, sizeof(key), "%lld=", (long long)json_integer_value(value));
	else
		snprintf(key, sizeof(key), "%.9g=", json_real_value(value));
	length = strlen(key);
	while (*(next = next_number(next))) {
		next++;
		if (strncmp(next, key, length) != 0)
			continue;
		next += length;
		end = next_number(next);
		if (end > next + strcspn(next, ";"))
			end = next + strcspn(next, ";");
		snprintf(text, size, "%.*s", (int)(end - next), next);
		/* "1=s1 ... 6=s6": what lies between is not said. */
		if (strstr(text, " ..."))
			*strstr(text, " ...") = '\0';
		return text[0] != '\0';
	}
	return false;
}

bool db_words_has_bit(const json_t *reg, const json_t *value, const char *name)
{
	uint64_t bits = (uint64_t)json_integer_value(value);
	const char *called;

	for (unsigned bit = 0; bit < 64; bit++) {
		called = bits >> bit & 1 ? db_words_code_name(reg, bit) : NULL;
		if (called && strcmp(called, name) == 0)
			return true;
	}
	return false;
}

static void write_bits(const json_t *reg, uint64_t bits, char *text, size_t size)
{
	size_t used = (size_t)snprintf(text, size, "%s", bits == 0 ? "none" : "");
	const char *name;

	for (unsigned bit = 0; bit < 64 && used < size; bit++) {
		if (!(bits >> bit & 1))
			continue;
		name = db_words_code_name(reg, bit);
		if (name)
			used += (size_t)snprintf(text + used, size - used, "%s%s",
			                         used > 0 ? ", " : "", name);
		else
			used += (size_t)snprintf(text + used, size - used, "%sbit %u",
			                         used > 0 ? ", " : "", bit);
	}
}

void db_words_write_bare_value(const json_t *reg, const json_t *value, char *text, size_t size)
{
	const char *name;

	switch (value ? json_typeof(value) : JSON_NULL) {
	case JSON_STRING:
		snprintf(text, size, "%s", json_string_value(value));
		break;
	case JSON_TRUE:
	case JSON_FALSE:
		snprintf(text, size, "%s", json_is_true(value) ? "on" : "off");
		break;
	case JSON_REAL:
		/* As few digits as distinguish it from its neighbours: registers hold single
		 * precision. */
		for (int digits = 6; digits <= 9; digits++) {
			snprintf(text, size, "%.*g", digits, json_real_value(value));
			if (strtof(text, NULL) == (float)json_real_value(value))
				break;
		}
		break;
	case JSON_INTEGER:
		name = has_bits(reg) ? NULL : db_words_code_name(reg, json_integer_value(value));
		if (name)
			snprintf(text, size, "%s", name);
		else if (has_bits(reg))
			write_bits(reg, (uint64_t)json_integer_value(value), text, size);
		else
			snprintf(text, size, "%lld", (long long)json_integer_value(value));
		break;
	default:
		snprintf(text, size, "-");
	}
	db_words_clean(text);
}

void db_words_write_value(const json_t *reg, const json_t *value, char *text, size_t size)
{
	const char *unit = json_string_value(json_object_get(reg, "unit"));
	size_t used;

	db_words_write_bare_value(reg, value, text, size);
	used = strlen(text);
	if (!unit || unit[0] == '\0' || !json_is_number(value) || has_bits(reg) ||
	    (json_is_integer(value) && db_words_code_name(reg, json_integer_value(value))))
		return;
	snprintf(text + used, size - used, " %s", unit);
	db_words_clean(text + used);
}

/* --- from words ------------------------------------------------------------------------------- */

/* Upper and lower case are the same, and so are an underscore and a space. */
static bool is_name(const char *name, const char *typed, size_t length)
{
	for (size_t i = 0; i < length; i++) {
		if (tolower((unsigned char)name[i]) != tolower((unsigned char)typed[i]) &&
		    !(name[i] == '_' && typed[i] == ' '))
			return false;
	}
	return true;
}

/* The number of a code's or a bit's name, -1 when there is none. */
static json_int_t find_code(const json_t *reg, const char *name, size_t length)
{
	json_t *codes = json_object_get(reg, "codes");
	const char *key;
	json_t *called;

	json_object_foreach(codes, key, called)
	{
		const char *text = json_string_value(called);

		if (text && strlen(text) == length && is_name(text, name, length))
			return strtoll(key, NULL, 10);
	}
	return -1;
}

static json_t *parse_bits(const json_t *reg, const char *text, char *problem, size_t size)
{
	uint64_t bits = 0;

	while (strcmp(text, "none") != 0 && *text) {
		size_t length = strcspn(text += strspn(text, " "), ",");
		json_int_t bit = find_code(reg, text, length);

		if (bit < 0 || bit > 63) {
			snprintf(problem, size, "no bit is called \"%.*s\"", (int)length, text);
			return NULL;
		}
		bits |= UINT64_C(1) << bit;
		text += length;
		text += *text == ',' ? 1 : 0;
	}
	return json_integer((json_int_t)bits);
}

static void write_range(const json_t *reg, char *text, size_t size)
{
	const json_t *min = json_object_get(reg, "min");
	const json_t *max = json_object_get(reg, "max");
	const char *unit = json_string_value(json_object_get(reg, "unit"));
	char low[32] = "";
	char high[32] = "";

	/* Limits of integers have more digits than single precision. */
	if (json_is_number(min))
		snprintf(low, sizeof(low), "%.10g", json_number_value(min));
	if (json_is_number(max))
		snprintf(high, sizeof(high), "%.10g", json_number_value(max));
	snprintf(text, size, "%s%s%s%s%s%s", low[0] && !high[0] ? "at least " : low,
	         low[0] && high[0] ? " to " :
	         high[0]           ? "at most " :
	                             "",
	         high[0] ? high : low, unit && unit[0] ? " " : "", unit && unit[0] ? unit : "",
	         low[0] || high[0] ? "" : "any");
}

static json_t *parse_number(const json_t *reg, const char *text, char *problem, size_t size)
{
	const json_t *min = json_object_get(reg, "min");
	const json_t *max = json_object_get(reg, "max");
	const char *type = db_words_text(reg, "type");
	bool whole = strcmp(type, "f32") != 0 && type[0] != '\0';
	char *end = NULL;
	char range[128];
	double value;
	long long number = 0;

	errno = 0;
	if (whole)
		number = strtoll(text, &end, strncmp(text, "0x", 2) == 0 ? 16 : 10);
	value = whole ? (double)number : strtod(text, &end);
	if (errno == 0 && *text && *end == '\0' && isfinite(value) &&
	    !(json_is_number(min) && value < json_number_value(min)) &&
	    !(json_is_number(max) && value > json_number_value(max)))
		return whole ? json_integer(number) : json_real(value);
	write_range(reg, range, sizeof(range));
	if (!*text || *end != '\0')
		snprintf(problem, size, "\"%s\" is no %s; right is %s%s", text,
		         whole ? "whole number" : "number", range,
		         json_object_size(json_object_get(reg, "codes")) > 0 ?
		                 ", or a name of its codes" :
		                 "");
	else
		snprintf(problem, size, "%s is out of range, %s", text, range);
	return NULL;
}

json_t *db_words_parse_value(const json_t *reg, const char *text, char *problem, size_t size)
{
	static const char *const on[] = { "on", "true", "1", "yes" };
	static const char *const off[] = { "off", "false", "0", "no" };
	const char *type = db_words_text(reg, "type");
	json_int_t code = has_bits(reg) ? -1 : find_code(reg, text, strlen(text));

	if (strcmp(type, "text") == 0)
		return json_string(text);
	if (strcmp(type, "bool") == 0) {
		for (size_t i = 0; i < sizeof(on) / sizeof(on[0]); i++) {
			if (strcmp(text, on[i]) == 0 || strcmp(text, off[i]) == 0)
				return json_boolean(strcmp(text, on[i]) == 0);
		}
		snprintf(problem, size, "\"%s\" is neither on nor off", text);
		return NULL;
	}
	if (code >= 0)
		return json_integer(code);
	if (has_bits(reg) && (text[0] < '0' || text[0] > '9'))
		return parse_bits(reg, text, problem, size);
	return parse_number(reg, text, problem, size);
}

bool db_words_parse_seconds(const char *text, double *seconds)
{
	char *end;

	*seconds = strtod(text, &end);
	return end != text && *end == '\0' && *seconds > 0.0 && *seconds <= SECONDS_MAX;
}
