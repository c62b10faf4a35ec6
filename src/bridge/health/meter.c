/* SPDX-License-Identifier: Apache-2.0 */
#include "health/health_private.h"

#include <math.h>
#include <string.h>

void db_meter_begin(struct db_meter *meter)
{
	meter->value = (struct db_health_value){ .coldest = DB_HEALTH_NO_TEMPERATURE,
		                                 .hottest = DB_HEALTH_NO_TEMPERATURE };
	meter->answers = 0;
	meter->sum_us = 0;
	meter->offline = 0;
}

void db_meter_sample(struct db_meter *meter, const struct db_snapshot *snapshot,
                     bool has_temperature, db_time now)
{
	const struct db_axis_stats *stats = &snapshot->stats;
	const struct db_axis_stats *last = &meter->last;
	struct db_health_value *value = &meter->value;
	bool online = (snapshot->feedback.status & DB_STATUS_ONLINE) != 0;

	value->known = true;
	if (meter->sampled != 0) {
		/* Counters begin again from 0 after 2^32. */
		value->exchanges += stats->requests - last->requests;
		value->retries += stats->retries - last->retries;
		value->losses += stats->timeouts - last->timeouts;
		value->damaged += stats->bad_frames - last->bad_frames;
		meter->answers += stats->round_trips - last->round_trips;
		meter->sum_us += stats->round_trip_sum_us - last->round_trip_sum_us;
		if (stats->round_trips != last->round_trips &&
		    stats->round_trip_us > value->longest_us)
			value->longest_us = stats->round_trip_us;
		/* The longest of all was between two samples. */
		if (stats->round_trip_max_us > last->round_trip_max_us)
			value->longest_us = stats->round_trip_max_us;
		if (!online)
			meter->offline += now - meter->sampled;
	}
	meter->last = *stats;
	meter->sampled = now;
	if (online && has_temperature && isfinite(snapshot->feedback.temperature)) {
		float rounded = roundf(snapshot->feedback.temperature);
		int8_t degrees = (int8_t)(rounded < -127.0f ? -127.0f :
		                          rounded > 127.0f  ? 127.0f :
		                                              rounded);

		if (value->hottest == DB_HEALTH_NO_TEMPERATURE || degrees > value->hottest)
			value->hottest = degrees;
		if (value->coldest == DB_HEALTH_NO_TEMPERATURE || degrees < value->coldest)
			value->coldest = degrees;
	}
}

void db_meter_read(const struct db_meter *meter, struct db_health_value *value)
{
	*value = meter->value;
	value->mean_us = meter->answers > 0 ? (uint32_t)(meter->sum_us / meter->answers) : 0;
	if (value->longest_us < value->mean_us)
		value->longest_us = value->mean_us;
	value->offline_ms = meter->offline / DB_NS_PER_MS > UINT32_MAX ?
	                            UINT32_MAX :
	                            (uint32_t)(meter->offline / DB_NS_PER_MS);
}
