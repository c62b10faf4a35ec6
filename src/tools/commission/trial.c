/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/trial.h"

#include <math.h>
#include <stdlib.h>

/* A minute at a cycle of a millisecond. */
#define SAMPLES_MAX 60000

bool db_trial_add(struct db_trial *trial, const struct db_trial_sample *sample)
{
	if (trial->count > 0 && sample->ms <= trial->samples[trial->count - 1].ms)
		return true;
	if (trial->count == trial->room) {
		size_t room = trial->room ? 2 * trial->room : 256;
		struct db_trial_sample *samples = room <= SAMPLES_MAX ?
		                                          realloc(trial->samples,
		                                                  room * sizeof(*samples)) :
		                                          NULL;

		if (!samples)
			return false;
		trial->samples = samples;
		trial->room = room;
	}
	trial->samples[trial->count++] = *sample;
	return true;
}

static int compare(const void *one, const void *other)
{
	double a = *(const double *)one;
	double b = *(const double *)other;

	return (a > b) - (a < b);
}

/* A gap is longer than four usual intervals of samples by at least this. */
#define HOLE_MS 30

double db_trial_find_hole(const struct db_trial *trial)
{
	double *gaps = trial->count >= 5 ? calloc(trial->count - 1, sizeof(*gaps)) : NULL;
	double longest = 0;
	double usual;

	if (!gaps)
		return 0;
	for (size_t i = 1; i < trial->count; i++) {
		gaps[i - 1] = trial->samples[i].ms - trial->samples[i - 1].ms;
		longest = fmax(longest, fmax(gaps[i - 1], trial->samples[i].late_ms));
	}
	qsort(gaps, trial->count - 1, sizeof(*gaps), compare);
	usual = gaps[(trial->count - 1) / 2];
	free(gaps);
	return longest > HOLE_MS + 4 * usual ? longest : 0;
}

void db_trial_clear(struct db_trial *trial)
{
	free(trial->samples);
	*trial = (struct db_trial){ .samples = NULL, .ended_ms = -1 };
}

/* Between the begin and the end, without the first quarter, in which it may still accelerate. */
static void measure_speed(const struct db_trial *trial, struct db_trial_figures *figures)
{
	const struct db_trial_sample *first = NULL;
	const struct db_trial_sample *last = NULL;
	double end = trial->ended_ms >= 0 ? trial->ended_ms : INFINITY;
	double from = figures->began_ms;
	size_t count = 0;

	if (trial->ended_ms >= 0)
		from += (trial->ended_ms - figures->began_ms) / 4;
	for (size_t i = 0; i < trial->count; i++) {
		const struct db_trial_sample *sample = &trial->samples[i];

		if (sample->ms < from || sample->ms > end)
			continue;
		first = first ? first : sample;
		last = sample;
		figures->told += sample->velocity;
		count++;
	}
	if (count > 0)
		figures->told /= (double)count;
	if (count > 1)
		figures->speed = (last->position - first->position) * 1000 / (last->ms - first->ms);
}

static void measure_stop(const struct db_trial *trial, struct db_trial_figures *figures)
{
	const struct db_trial_sample *before = NULL;
	double at_end = NAN;

	for (size_t i = 0; i < trial->count; i++) {
		const struct db_trial_sample *sample = &trial->samples[i];
		double since = sample->ms - trial->ended_ms;

		if (since < 0) {
			before = sample;
			at_end = sample->position;
			continue;
		}
		if (before && sample->position != before->position)
			figures->stood_ms = since;
		/* One slow sample among fast ones comes from the reading, not from the motion. */
		if (before && fabs(sample->position - before->position) * 1000 >=
		                      0.9 * fabs(figures->speed) * (sample->ms - before->ms))
			figures->slowed_ms = -1;
		else if (before && figures->slowed_ms < 0)
			figures->slowed_ms = since;
		if (sample->moving)
			figures->shown_ms = -1;
		else if (figures->shown_ms < 0)
			figures->shown_ms = since;
		before = sample;
	}
	if (before && !isnan(at_end))
		figures->stop_way = before->position - at_end;
}

void db_trial_measure(const struct db_trial *trial, struct db_trial_figures *figures)
{
	double low = INFINITY;
	double high = -INFINITY;
	bool had_power = false;

	*figures = (struct db_trial_figures){ .began_ms = -1,
		                              .shown_moving_ms = -1,
		                              .slowed_ms = -1,
		                              .stood_ms = -1,
		                              .shown_ms = -1 };
	for (size_t i = 0; i < trial->count; i++) {
		const struct db_trial_sample *sample = &trial->samples[i];

		low = fmin(low, sample->position);
		high = fmax(high, sample->position);
		figures->ever_moving = figures->ever_moving || sample->moving;
		had_power = had_power || sample->enabled;
		if (figures->shown_moving_ms < 0 && sample->ms > 0 && sample->moving)
			figures->shown_moving_ms = sample->ms;
		if (figures->began_ms < 0 && sample->ms > 0 &&
		    fabs(sample->position - trial->samples[0].position) > DB_TRIAL_DITHER)
			figures->began_ms = sample->ms;
	}
	if (trial->count == 0)
		return;
	figures->span = high - low;
	figures->lost_power = had_power && !trial->samples[trial->count - 1].enabled;
	figures->way = trial->samples[trial->count - 1].position - trial->samples[0].position;
	if (figures->began_ms >= 0)
		measure_speed(trial, figures);
	if (trial->ended_ms >= 0)
		measure_stop(trial, figures);
}
