/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_numbers.h"

#include "codec/vsmd_serial.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define EXPONENT_MAX 60.0 /* no value of a drive lies beyond it */

bool vsmd_parse_number(const char *text, size_t length, double *number, bool *whole)
{
	double scale = 1.0;
	double value = 0.0;
	bool negative = false;
	bool fraction = false;
	size_t digits = 0;
	size_t i = 0;

	*whole = true;
	if (i < length && (text[i] == '-' || text[i] == '+'))
		negative = text[i++] == '-';
	for (; i < length; i++) {
		if (text[i] == '.' && !fraction) {
			fraction = true;
			continue;
		}
		if (text[i] < '0' || text[i] > '9')
			return false;
		value = value * 10.0 + (text[i] - '0');
		if (fraction)
			scale *= 10.0;
		if (fraction && text[i] != '0')
			*whole = false;
		digits++;
	}
	/* Beyond this, doubles do not hold every digit; no documented value has that many. */
	if (digits == 0 || digits > 60)
		return false;
	*number = negative ? -(value / scale) : value / scale;
	return true;
}

bool vsmd_parse_value(enum db_type type, const char *text, size_t length, union db_value *value)
{
	size_t mantissa = 0;
	double exponent = 0.0;
	double number;
	bool plain;
	bool whole;

	/* As vsmd_parse_number(), in the form that drives send: an exponent is allowed. */
	while (mantissa < length && text[mantissa] != 'e' && text[mantissa] != 'E')
		mantissa++;
	if (!vsmd_parse_number(text, mantissa, &number, &whole))
		return false;
	if (mantissa < length) {
		if (!vsmd_parse_number(text + mantissa + 1, length - mantissa - 1, &exponent,
		                       &plain) ||
		    !plain || fabs(exponent) > EXPONENT_MAX)
			return false;
		number *= pow(10.0, exponent);
		whole = floor(number) == number;
	}
	/* A fraction too small for a double is still a fraction. */
	return (whole || type == DB_F32) && db_value_from_number(type, number, value);
}

static int format_float(float number, char *text, size_t size)
{
	char shortest[128];
	int length = 0;

	if (!isfinite(number))
		return VSMD_ERR_RANGE;
	for (int decimals = 0; decimals <= 60; decimals++) {
		union db_value back;

		length = snprintf(shortest, sizeof(shortest), "%.*f", decimals, (double)number);
		if (length < 0 || (size_t)length >= sizeof(shortest))
			return VSMD_ERR_SPACE;
		/* A locale may have written another decimal separator. */
		for (int i = 0; i < length; i++) {
			if (shortest[i] == ',')
				shortest[i] = '.';
		}
		if (vsmd_parse_value(DB_F32, shortest, (size_t)length, &back) && back.f == number)
			break;
	}
	if ((size_t)length >= size)
		return VSMD_ERR_SPACE;
	memcpy(text, shortest, (size_t)length + 1);
	return length;
}

/* Written by hand: with the C library, formatting the number takes most of the time of a line, and
 * each poll has one. */
static int format_whole(bool negative, uint32_t magnitude, char *text, size_t size)
{
	char digits[11]; /* sign and ten digits; from the end */
	size_t first = sizeof(digits);
	size_t length;

	do {
		digits[--first] = (char)('0' + magnitude % 10);
		magnitude /= 10;
	} while (magnitude > 0);
	if (negative)
		digits[--first] = '-';
	length = sizeof(digits) - first;
	if (length >= size)
		return VSMD_ERR_SPACE;
	memcpy(text, digits + first, length);
	text[length] = '\0';
	return (int)length;
}

int vsmd_format_value(enum db_type type, union db_value value, char *text, size_t size)
{
	switch (type) {
	case DB_F32:
		return format_float(value.f, text, size);
	case DB_I16:
	case DB_I32:
		return format_whole(value.i < 0,
		                    value.i < 0 ? 0 - (uint32_t)value.i : (uint32_t)value.i, text,
		                    size);
	default:
		return format_whole(false, value.u, text, size);
	}
}
