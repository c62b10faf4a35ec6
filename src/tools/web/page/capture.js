/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The memory of an oscilloscope: samples from some time before a trigger to some time after it. As
 * src/tools/ctl/rows.c does for a record, with additional modes: repeated captures, and captures
 * without a trigger when none occurs. Pure; times are those of the data, in microseconds.
 */
import { writeField } from "./plain.js";

/* Most samples of one capture; further ones are cut off. */
export const SAMPLES_MAX = 50000;

/*
 * Settings: mode (single: one capture; normal: one after the other; auto: the same, also without a
 * trigger), trigger (true: the samples that trigger have `triggers`; false: from the first sample on), beforeUs, durationUs.
 *
 * state is waiting, triggered or stopped; shown the latest complete capture, { rows, zeroUs,
 * triggered, cut }, or null; count the number of captures; lost the number of samples that did not
 * arrive.
 */
export function createCapture({ mode, trigger, beforeUs, durationUs }) {
	const capture = { state: "waiting", shown: null, count: 0, lost: 0 };
	const held = [];
	let zeroUs = 0; /* time of the current trigger */
	let sinceUs = 0; /* begin of the wait for a trigger; 0: the next sample */

	/*
	 * Drops samples that are too old for the time before a trigger, in blocks: to move all
	 * others for each sample would cost too much.
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

	/* Takes a sample of the interface's type Sample. Returns whether it completes a capture. */
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
		/* An edge also counts while the former capture is being filled. */
		const comes = !trigger || sample.triggers === true;

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
	 * Silent drives send no more samples: this completes a partial capture. Returns whether
	 * there was one.
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
 * Seconds from the trigger, and an array of values for each channel { drive, name, show }: numbers as
 * show() makes them of the drive's own (without it: these), null where a sample is of another drive or
 * has no such value.
 */
export function readColumns({ rows, zeroUs }, channels) {
	const ordered = [...rows].sort((one, other) => one.time_us - other.time_us);

	return [
		ordered.map((row) => (row.time_us - zeroUs) / 1e6),
		...channels.map(({ drive, name, show = Number }) =>
			ordered.map((row) => {
				const value =
					row.drive === drive ? (row.values[name] ?? null) : null;

				return value === null || typeof value === "string"
					? null
					: show(Number(value));
			})
		)
	];
}

function writeSeconds(us) {
	const digits = String(Math.abs(us)).padStart(7, "0");

	return `${us < 0 ? "-" : ""}${digits.slice(0, -6)}.${digits.slice(-6)}`;
}

/* With ten digits, as formatCsv() of ring.js. */
function writeValue(value, show) {
	return writeField(typeof value === "number" && show
		? Number(show(value).toPrecision(10))
		: value);
}

/*
 * The file in the format of `drivebridgectl record`, in the users' units. Channels: { drive, name, unit, show },
 * show as above.
 */
export function writeCsv({ rows, zeroUs }, channels) {
	const lines = [
		[
			"time_s",
			"unix_time_s",
			...channels.map(({ drive, name, unit }) =>
				writeField(`${drive}.${name}${unit ? ` [${unit}]` : ""}`)
			)
		]
	];

	for (const row of rows)
		lines.push([
			writeSeconds(row.time_us - zeroUs),
			writeSeconds(row.time_us),
			...channels.map(({ drive, name, show }) =>
				row.drive === drive ? writeValue(row.values[name], show) : ""
			)
		]);
	return lines.map((fields) => `${fields.join(",")}\r\n`).join("");
}
