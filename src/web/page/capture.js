/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An oscilloscope's memory: samples from some time before a trigger on, for some time behind it. As
 * src/ctl/rows.c does for a record, with what an oscilloscope has beyond that: the next one by
 * itself, and one without a trigger when none comes. Pure; times are those of the data, in
 * microseconds.
 */
import { writeField } from "./plain.js";

/* Samples of one capture; what is more is cut off. */
export const SAMPLES_MAX = 50000;

/*
 * Settings: mode (single: one, and then it is over; normal: one after the other; auto: likewise,
 * also when no trigger comes), trigger (of createTrigger(), or null: from the first sample on),
 * beforeUs, durationUs.
 *
 * state is waiting, triggered or stopped; shown the latest whole one, { rows, zeroUs, triggered,
 * cut }, or null; count how many there were; lost how many samples did not come.
 */
export function createCapture({ mode, trigger, beforeUs, durationUs }) {
	const capture = { state: "waiting", shown: null, count: 0, lost: 0 };
	let held = [];
	let zeroUs = 0; /* of the trigger that came */
	let sinceUs = 0; /* since when it waits; 0: since the next sample */

	/*
	 * What is too old to be before a trigger, in blocks: to move all that stays for each sample
	 * would cost too much.
	 */
	function forget(timeUs) {
		let gone = 0;

		while (gone < held.length && held[gone].time_us < timeUs - beforeUs)
			gone++;
		gone = Math.max(gone, held.length - SAMPLES_MAX);
		if (gone >= 256 || gone === held.length)
			held.splice(0, gone);
	}

	function finish(triggered, timeUs) {
		const fromUs = trigger ? zeroUs - beforeUs : zeroUs;

		capture.shown = {
			rows: held.filter((row) => row.time_us >= fromUs),
			zeroUs,
			triggered,
			cut: held.length >= SAMPLES_MAX
		};
		capture.count++;
		capture.state = mode === "single" ? "stopped" : "waiting";
		sinceUs = timeUs;
		forget(timeUs);
	}

	/* A sample of the interface's type Sample. Whether a capture became whole. */
	capture.take = (sample) => {
		const timeUs = sample.time_us;

		/* A drive that never answered has no values. */
		if (capture.state === "stopped" || timeUs === 0)
			return false;
		capture.lost += sample.lost;
		const whole =
			capture.state === "triggered" &&
			(timeUs - zeroUs > durationUs || held.length >= SAMPLES_MAX);

		if (whole)
			finish(true, timeUs);
		if (capture.state === "stopped")
			return whole;
		sinceUs ||= timeUs;
		held.push(sample);
		/* An edge is one also while the capture before is filled. */
		const comes =
			!trigger || (sample.drive === trigger.drive && trigger.take(sample.values));

		if (capture.state === "triggered")
			return whole;
		if (comes) {
			capture.state = "triggered";
			zeroUs = timeUs;
			return whole;
		}
		forget(timeUs);
		if (mode !== "auto" || timeUs - sinceUs < beforeUs + durationUs)
			return whole;
		zeroUs = timeUs;
		finish(false, timeUs);
		return true;
	};

	/*
	 * Nothing more comes of drives that fell silent: a part is whole with that. Whether there
	 * was one.
	 */
	capture.flush = () => {
		const partly = capture.state === "triggered";

		if (partly)
			finish(true, zeroUs);
		return partly;
	};

	capture.stop = () => {
		const partly = capture.flush();

		capture.state = "stopped";
		return partly;
	};

	return capture;
}

/*
 * Seconds from the trigger, and an array of values for each channel { drive, name }: numbers, null
 * where a sample is of another drive or says nothing.
 */
export function readColumns({ rows, zeroUs }, channels) {
	const ordered = [...rows].sort((one, other) => one.time_us - other.time_us);

	return [
		ordered.map((row) => (row.time_us - zeroUs) / 1e6),
		...channels.map(({ drive, name }) =>
			ordered.map((row) => {
				const value =
					row.drive === drive ? (row.values[name] ?? null) : null;

				return value === null || typeof value === "string"
					? null
					: Number(value);
			})
		)
	];
}

function writeSeconds(us) {
	const digits = String(Math.abs(us)).padStart(7, "0");

	return `${us < 0 ? "-" : ""}${digits.slice(0, -6)}.${digits.slice(-6)}`;
}

/*
 * The file that `drivebridgectl record` writes. Channels with their registers: { drive, name,
 * register }.
 */
export function writeCsv({ rows, zeroUs }, channels) {
	const lines = [
		[
			"time_s",
			"unix_time_s",
			...channels.map(({ drive, name, register }) =>
				writeField(
					`${drive}.${name}${register.unit ? ` [${register.unit}]` : ""}`
				)
			)
		]
	];

	for (const row of rows)
		lines.push([
			writeSeconds(row.time_us - zeroUs),
			writeSeconds(row.time_us),
			...channels.map(({ drive, name }) =>
				row.drive === drive ? writeField(row.values[name]) : ""
			)
		]);
	return lines.map((fields) => `${fields.join(",")}\r\n`).join("");
}
