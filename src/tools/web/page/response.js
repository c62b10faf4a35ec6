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
 * seconds after 0. null: there is no step, or it has not come to its end.
 */
export function measureResponse(times, values) {
	const samples = times.map((time, i) => ({ time, value: values[i] }))
		.filter(({ value }) => Number.isFinite(value));
	const end = samples.slice(-Math.max(3, Math.ceil(samples.length * END_PART)));

	if (samples.length < SAMPLES_LEAST)
		return null;
	const before = samples.findLast(({ time }) => time <= 0) ?? samples[0];
	const from = before.value;
	const to = end.reduce((sum, { value }) => sum + value, 0) / end.length;
	const step = to - from;
	const isOff = ({ value }) => Math.abs(value - to) > BAND * Math.abs(step);

	if (Math.abs(step) < 1e-9 * Math.max(1, Math.abs(to)) || end.some(isOff))
		return null;
	const after = samples.filter(({ time }) => time > 0);
	const beyond = Math.max(0, ...after.map(({ value }) => (value - to) / step));

	return {
		from,
		to,
		/* Less than the band is the last digit of a value that does not overshoot. */
		overshoot: beyond > BAND / 4 ? beyond : 0,
		settled: after[after.findLastIndex(isOff) + 1]?.time ?? 0,
	};
}

/* As a sentence; "" for null. */
export function sayResponse(name, response) {
	if (!response)
		return "";
	const { overshoot, settled } = response;
	const values = { name, percent: (overshoot * 100).toFixed(1), band: BAND * 100, seconds: settled.toFixed(3) };

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
