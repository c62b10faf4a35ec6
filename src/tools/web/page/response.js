/* SPDX-License-Identifier: Apache-2.0 */
/* How a value answers to a step: how far it goes beyond, and when it stays. Pure. */
import { t } from "./words.js";

/* It has settled where it stays within this part of the step around its end. */
export const BAND = 0.02;
/* The end is the mean of this part of the record, and has to be calm. */
const END_PART = 0.1;
const SAMPLES_LEAST = 10;

/*
 * times in seconds, ascending, 0: the moment of the step; values with null where there is none. Returns {
 * from, to, overshoot, settled }: overshoot as a part of the step (0: it stays below its end), settled in
 * seconds after 0. null: there is no step, or it has not come to its end. band: the part of the step within which
 * it has settled; wider than BAND where values are noisy, and what is within it is no overshoot then.
 */
export function measureResponse(times, values, band = BAND) {
	const samples = times.map((time, i) => ({ time, value: values[i] }))
		.filter(({ value }) => Number.isFinite(value));
	const end = samples.slice(-Math.max(3, Math.ceil(samples.length * END_PART)));

	if (samples.length < SAMPLES_LEAST)
		return null;
	const before = samples.findLast(({ time }) => time <= 0) ?? samples[0];
	const from = before.value;
	const to = end.reduce((sum, { value }) => sum + value, 0) / end.length;
	const step = to - from;
	const isOff = ({ value }) => Math.abs(value - to) > band * Math.abs(step);

	if (Math.abs(step) < 1e-9 * Math.max(1, Math.abs(to)) || end.some(isOff))
		return null;
	const after = samples.filter(({ time }) => time > 0);
	const beyond = Math.max(0, ...after.map(({ value }) => (value - to) / step));

	return {
		from,
		to,
		/* Less than the band is the last digit of a value that does not overshoot. */
		overshoot: beyond > (band > BAND ? band : BAND / 4) ? beyond : 0,
		settled: after[after.findLastIndex(isOff) + 1]?.time ?? 0,
		band,
	};
}

/* What answered: kind is of a record, "speed", else it was the position. */
export function nameResponse(kind) { return kind === "speed" ? t("The speed") : t("The position"); }

/* As a sentence; "" for null. */
export function sayResponse(name, response) {
	if (!response)
		return "";
	/* Records of former releases have no band. */
	const { overshoot, settled, band = BAND } = response;
	const values = { name, percent: (overshoot * 100).toFixed(1), band: Math.round(band * 100), seconds: settled.toFixed(3) };

	return overshoot > 0 ?
		t("{name} overshoots by {percent} %, and stays within {band} % of the step after {seconds} s.", values) :
		t("{name} does not overshoot, and stays within {band} % of the step after {seconds} s.", values);
}

/* Before a motion, of what is shown, as a part of it. */
const LEAD = 0.1;
/* A motion has begun when this part of the step is done. */
const BEGUN = 0.005;

/*
 * Of a record around a move over `distance`: times in seconds from the begin of the motion on, and the
 * values, with a bit of the stand before it. samples: [{ time_us, value }], ascending; null: nothing moved.
 */
export function cutResponse(samples, distance) {
	const known = samples.filter(({ value }) => Number.isFinite(value));
	const first = known.findIndex(({ value }) => Math.abs(value - known[0].value) > BEGUN * Math.abs(distance));

	if (first < 1)
		return null;
	const zero = known[first - 1].time_us;
	const lead = (known.at(-1).time_us - zero) * LEAD;
	const shown = known.filter(({ time_us: time }) => time >= zero - lead);

	return {
		times: shown.map(({ time_us: time }) => (time - zero) / 1e6),
		values: shown.map(({ value }) => value),
	};
}

/* A speed is steady within these, and within the larger part of the time since its begin. */
const STEADY_US = 500000;
const STEADY_PART = 0.15;
/* Parts of a speed: with more noise than this it is not steady, and one that is so far off is another one. */
const NOISE_MOST = 0.05;
const WAY_OFF = 0.1;
/* Speeds that are computed from positions are those over this time, or the last digit of a position is most of it. */
const COMPUTED_OVER_US = 100000;

const meanOf = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

/* The speeds of [{ time_us, value }], a position, in its units a second: each over COMPUTED_OVER_US around its time. */
export function computeSpeeds(samples) {
	const speeds = [];
	let from = 0;

	samples.forEach(({ time_us: time, value }, i) => {
		while (from + 1 < i && time - samples[from + 1].time_us >= COMPUTED_OVER_US)
			from++;
		const span = time - samples[from].time_us;

		if (span >= COMPUTED_OVER_US)
			speeds.push({ time_us: time - span / 2, value: (value - samples[from].value) / span * 1e6 });
	});
	return speeds;
}

/*
 * Whether [{ time_us, value }], speeds after a step from standstill to `wanted`, have come to their end: the band for
 * measureResponse, at least BAND; 0: not yet.
 */
export function findSteady(samples, wanted) {
	const known = samples.filter(({ value }) => Number.isFinite(value));
	const begin = known.find(({ value }) => Math.abs(value) > BEGUN * Math.abs(wanted))?.time_us;
	const end = known.at(-1)?.time_us;

	if (begin === undefined)
		return 0;
	const span = Math.max(STEADY_US, STEADY_PART * (end - begin));
	const calm = known.filter(({ time_us: time }) => time >= end - span).map(({ value }) => value);
	const mean = meanOf(calm);
	const spread = (values) => Math.max(...values.map((value) => Math.abs(value - mean))) / Math.abs(mean);
	const [early, late] = [calm.slice(0, calm.length / 2), calm.slice(calm.length / 2)];

	if (end - begin < span || calm.length < SAMPLES_LEAST || Math.abs(mean - wanted) > WAY_OFF * Math.abs(wanted))
		return 0;
	const noise = spread(calm);

	/* The end, to which the band belongs, is a part of this: so its own mean may be off by the noise as well. */
	if (noise <= BAND / 2)
		return BAND;
	/* Neither on its way nor a decaying oscillation. */
	const isNoise = noise <= NOISE_MOST && Math.abs(meanOf(early) - meanOf(late)) <= BAND / 2 * Math.abs(mean) &&
		spread(early) < 2 * spread(late);

	return isNoise ? Math.ceil(2 * noise * 100) / 100 : 0;
}
