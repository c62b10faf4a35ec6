/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/moment.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define US_PER_S INT64_C(1000000)
/* The years 1970 to 9999: no clock shows others. */
#define SECONDS_MAX INT64_C(253402300799)

json_t *db_mqtt_moment_describe(int64_t us)
{
	char text[40];
	time_t seconds = us / US_PER_S;
	struct tm utc;
	size_t used;

	if (us < 0 || seconds > SECONDS_MAX || !gmtime_r(&seconds, &utc)) {
		seconds = 0;
		us = 0;
		(void)gmtime_r(&seconds, &utc);
	}
	used = strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%S", &utc);
	snprintf(text + used, sizeof(text) - used, ".%06dZ", (int)(us % US_PER_S));
	return json_string(text);
}

/* Exactly this number of digits, at most four; false for anything else. */
static bool read_digits(const char **at, unsigned count, int *number)
{
	*number = 0;
	for (unsigned i = 0; i < count; i++, (*at)++) {
		if (!isdigit((unsigned char)**at))
			return false;
		*number = *number * 10 + (**at - '0');
	}
	return true;
}

static bool read_mark(const char **at, char mark)
{
	return *(*at)++ == mark;
}

/* The digits after the point; those after the sixth are ignored. */
static bool read_fraction(const char **at, int64_t *us)
{
	int64_t worth = US_PER_S / 10;

	*us = 0;
	if (**at != '.')
		return true;
	(*at)++;
	if (!isdigit((unsigned char)**at))
		return false;
	for (; isdigit((unsigned char)**at); (*at)++, worth /= 10)
		*us += worth * (**at - '0');
	return true;
}

/* Seconds by which the clock is ahead of UTC. */
static bool read_offset(const char **at, int64_t *offset)
{
	int sign = **at == '-' ? -1 : 1;
	int hours, minutes;

	*offset = 0;
	if (**at == 'Z') {
		(*at)++;
		return true;
	}
	if (**at != '+' && **at != '-')
		return false;
	(*at)++;
	if (!read_digits(at, 2, &hours) || !read_mark(at, ':') || !read_digits(at, 2, &minutes) ||
	    hours > 14 || minutes > 59)
		return false;
	*offset = (int64_t)sign * (hours * 3600 + minutes * 60);
	return true;
}

bool db_mqtt_moment_read(const char *text, int64_t *us)
{
	struct tm utc = { .tm_year = 0 };
	const char *at = text;
	int64_t fraction, offset;
	time_t seconds;

	if (!read_digits(&at, 4, &utc.tm_year) || !read_mark(&at, '-') ||
	    !read_digits(&at, 2, &utc.tm_mon) || !read_mark(&at, '-') ||
	    !read_digits(&at, 2, &utc.tm_mday) || !read_mark(&at, 'T') ||
	    !read_digits(&at, 2, &utc.tm_hour) || !read_mark(&at, ':') ||
	    !read_digits(&at, 2, &utc.tm_min) || !read_mark(&at, ':') ||
	    !read_digits(&at, 2, &utc.tm_sec) || !read_fraction(&at, &fraction) ||
	    !read_offset(&at, &offset) || *at != '\0')
		return false;
	if (utc.tm_year < 1970 || utc.tm_mon < 1 || utc.tm_mon > 12 || utc.tm_mday < 1 ||
	    utc.tm_mday > 31 || utc.tm_hour > 23 || utc.tm_min > 59 || utc.tm_sec > 60)
		return false;
	utc.tm_year -= 1900;
	utc.tm_mon -= 1;
	seconds = timegm(&utc);
	*us = ((int64_t)seconds - offset) * US_PER_S + fraction;
	return *us >= 0;
}
