/* SPDX-License-Identifier: Apache-2.0 */
#include "health/health_private.h"

#include <inttypes.h>

/* A number of 16 bits: eleven of it, and how often they are to be doubled. */
#define DIGITS 11
#define DIGITS_MASK ((1u << DIGITS) - 1)
/* The largest number that can be written. */
#define MOST (DIGITS_MASK << (32 - DIGITS))
/* No number has this form. */
#define UNKNOWN 0xFFFF

static void put(uint8_t **at, uint32_t number)
{
	unsigned doubled = 0;

	while (number >> doubled > DIGITS_MASK)
		doubled++;
	db_bytes_put(*at, doubled << DIGITS | number >> doubled, 2);
	*at += 2;
}

static uint32_t get(const uint8_t **at)
{
	uint32_t code = (uint32_t)db_bytes_get(*at, 2);
	uint64_t number = (uint64_t)(code & DIGITS_MASK) << (code >> DIGITS);

	*at += 2;
	return number > MOST ? MOST : (uint32_t)number;
}

void db_health_value_write(const struct db_health_value *value,
                           uint8_t bytes[DB_HEALTH_VALUE_BYTES])
{
	uint8_t *at = bytes;

	put(&at, value->exchanges);
	put(&at, value->retries);
	put(&at, value->losses);
	put(&at, value->damaged);
	put(&at, value->mean_us);
	put(&at, value->longest_us);
	put(&at, value->offline_ms);
	at[0] = (uint8_t)value->coldest;
	at[1] = (uint8_t)value->hottest;
	if (!value->known)
		db_bytes_put(bytes, UNKNOWN, 2);
}

void db_health_value_read(const uint8_t bytes[DB_HEALTH_VALUE_BYTES], struct db_health_value *value)
{
	const uint8_t *at = bytes;

	if (db_bytes_get(bytes, 2) == UNKNOWN) {
		*value = (struct db_health_value){ .coldest = DB_HEALTH_NO_TEMPERATURE,
			                           .hottest = DB_HEALTH_NO_TEMPERATURE };
		return;
	}
	value->known = true;
	value->exchanges = get(&at);
	value->retries = get(&at);
	value->losses = get(&at);
	value->damaged = get(&at);
	value->mean_us = get(&at);
	value->longest_us = get(&at);
	value->offline_ms = get(&at);
	value->coldest = (int8_t)at[0];
	value->hottest = (int8_t)at[1];
}

static uint32_t add(uint32_t a, uint32_t b)
{
	return a > UINT32_MAX - b ? UINT32_MAX : a + b;
}

/* Exchanges that had an answer in time. */
static uint64_t answers_of(const struct db_health_value *value)
{
	return value->mean_us == 0              ? 0 :
	       value->exchanges > value->losses ? value->exchanges - value->losses :
	                                          1;
}

void db_health_value_add(struct db_health_value *sum, const struct db_health_value *value)
{
	uint64_t before = answers_of(sum);
	uint64_t more = answers_of(value);

	if (!value->known)
		return;
	if (!sum->known) {
		*sum = *value;
		return;
	}
	/* So that the products below have room in 64 bits. */
	if (before + more > UINT32_MAX) {
		before /= 2;
		more /= 2;
	}
	if (before + more > 0)
		sum->mean_us = (uint32_t)((before * sum->mean_us + more * value->mean_us) /
		                          (before + more));
	sum->exchanges = add(sum->exchanges, value->exchanges);
	sum->retries = add(sum->retries, value->retries);
	sum->losses = add(sum->losses, value->losses);
	sum->damaged = add(sum->damaged, value->damaged);
	sum->offline_ms = add(sum->offline_ms, value->offline_ms);
	if (value->longest_us > sum->longest_us)
		sum->longest_us = value->longest_us;
	if (value->hottest == DB_HEALTH_NO_TEMPERATURE)
		return;
	if (sum->hottest == DB_HEALTH_NO_TEMPERATURE || value->coldest < sum->coldest)
		sum->coldest = value->coldest;
	if (value->hottest > sum->hottest)
		sum->hottest = value->hottest;
}

void db_health_value_print(const struct db_health_value *value, const char *drive, uint64_t end_us,
                           uint64_t span_s, FILE *out)
{
	/* Names have no letters that JSON would write in another way. */
	fprintf(out,
	        "{\"drive\":\"%s\",\"end_us\":%" PRIu64 ",\"span_s\":%" PRIu64
	        ",\"exchanges\":%" PRIu32 ",\"retries\":%" PRIu32 ",\"losses\":%" PRIu32
	        ",\"damaged\":%" PRIu32 ",\"round_trip_us\":%" PRIu32
	        ",\"round_trip_longest_us\":%" PRIu32 ",\"offline_ms\":%" PRIu32,
	        drive, end_us, span_s, value->exchanges, value->retries, value->losses,
	        value->damaged, value->mean_us, value->longest_us, value->offline_ms);
	if (value->hottest == DB_HEALTH_NO_TEMPERATURE)
		fputs(",\"coldest\":null,\"hottest\":null}", out);
	else
		fprintf(out, ",\"coldest\":%d,\"hottest\":%d}", value->coldest, value->hottest);
}
