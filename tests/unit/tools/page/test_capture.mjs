// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import { test } from "node:test";
import { SAMPLES_MAX, createCapture, readColumns, writeCsv } from "../../../../src/tools/web/page/capture.js";

const POSITION = { name: "position", type: "i32", unit: "counts" };
const START = 1795365575000000;

// Samples at each 10 ms; the position is the sample's number unless it is said.
function samples(count, first = 0, position = (at) => at) {
	return Array.from({ length: count }, (_, at) => ({ drive: "feeder", time_us: START + (first + at) * 10000,
		lost: 0, values: { position: position(first + at) } }));
}

// The server marks the samples in which the position comes above 10.
function run(settings, given) {
	const capture = createCapture({ trigger: true, beforeUs: 50000, durationUs: 30000, ...settings });
	const whole = [];
	let before = null;

	for (const sample of given) {
		const above = sample.values.position > 10;

		if (sample.drive === "feeder" && above && before === false)
			sample.triggers = true;
		if (sample.drive === "feeder")
			before = above;
		if (capture.take(sample))
			whole.push(capture.shown);
	}
	return { capture, whole, positions: whole.map(({ rows }) => rows.map((row) => row.values.position)) };
}

test("single: from before the trigger to behind it, and then it is over", () => {
	const { capture, whole, positions } = run({ mode: "single" }, samples(40));

	assert.deepEqual(positions, [[6, 7, 8, 9, 10, 11, 12, 13, 14]]);
	assert.equal(whole[0].zeroUs, START + 110000);
	assert.equal(capture.state, "stopped");
});

test("normal: one after the other, an edge meanwhile is none", () => {
	const { capture, positions } = run({ mode: "normal" }, samples(60, 0, (at) => at % 20));

	assert.deepEqual(positions.map((each) => each.indexOf(11)), [5, 5, 5]);
	assert.equal(positions[1].length, 9);
	assert.equal(capture.state, "waiting");
	/* It comes in the sample that is behind the one before, and in one of that itself. */
	assert.equal(run({ mode: "normal", durationUs: 0 }, samples(9, 0, (at) => at % 2 * 20)).positions.length, 4);
});

test("auto: also when no trigger comes", () => {
	const { whole } = run({ mode: "auto" }, samples(40, 0, () => 0));

	assert.equal(whole.length, 4);
	assert.ok(whole.every((each) => !each.triggered && each.rows.length === 6));
	assert.ok(run({ mode: "auto" }, samples(14)).capture.state === "triggered");
});

test("without a trigger it begins with the first sample", () => {
	const { positions } = run({ mode: "single", trigger: null }, samples(40));

	assert.deepEqual(positions, [[0, 1, 2, 3]]);
});

test("another drive's samples are in it and trigger nothing", () => {
	const other = samples(40).map((sample) => ({ ...sample, drive: "lift", time_us: sample.time_us + 1 }));

	assert.equal(run({ mode: "single" }, other).whole.length, 0);
	const { whole } = run({ mode: "single" }, samples(40).flatMap((sample, at) => [sample, other[at]]));
	const [x, feeder, lift] = readColumns(whole[0], [{ drive: "feeder", name: "position" },
		{ drive: "lift", name: "position" }]);

	assert.equal(x[feeder.indexOf(11)], 0);
	assert.equal(lift[feeder.indexOf(11)], null);
	assert.ok(x.every((time, at) => at === 0 || time >= x[at - 1]));
});

test("a drive that never answered has no samples, and a stop keeps what there is", () => {
	const { capture, whole } = run({ mode: "single" }, [{ drive: "feeder", time_us: 0, lost: 0, values: {} }, ...samples(13)]);

	assert.equal(whole.length, 0);
	assert.ok(capture.stop());
	assert.deepEqual(capture.shown.rows.map((row) => row.values.position), [6, 7, 8, 9, 10, 11, 12]);
	assert.ok(!capture.take(samples(1, 50)[0]));
});

test("memory is bounded, before a trigger and behind it", () => {
	const { capture } = run({ mode: "single", beforeUs: 1e12, durationUs: 1e12 },
		samples(SAMPLES_MAX + 5000, 0, (at) => at === SAMPLES_MAX + 4000 ? 11 : 0));

	assert.ok(capture.shown.rows.length <= SAMPLES_MAX + 256);
	assert.ok(capture.shown.cut);
	const waiting = run({ mode: "single", beforeUs: 1e12, durationUs: 1e12 }, samples(SAMPLES_MAX + 5000, 0, () => 0));

	waiting.capture.stop();
	assert.equal(waiting.capture.shown, null);
});

test("lost samples are counted", () => {
	const given = samples(20);

	given[3].lost = 2;
	assert.equal(run({ mode: "single" }, given).capture.lost, 2);
});

test("the file has the form of drivebridgectl record, in the users' units", () => {
	const rows = [
		{ drive: "feeder", time_us: START - 20012, values: { position: -5, velocity: 0.10000000149011612, on: true } },
		{ drive: "lift", time_us: START, values: { position: 7, velocity: null, name: 'a "b", c' } },
	];
	const channels = [{ drive: "feeder", name: "position", unit: "mm", show: (value) => value / 320 },
		{ drive: "feeder", name: "velocity", unit: "counts/s" },
		{ drive: "feeder", name: "on", unit: "" }, { drive: "lift", name: "name", unit: "" }];

	assert.equal(writeCsv({ rows, zeroUs: START }, channels),
		"time_s,unix_time_s,feeder.position [mm],feeder.velocity [counts/s],feeder.on,lift.name\r\n" +
		"-0.020012,1795365574.979988,-0.015625,0.100000001,1,\r\n" +
		'0.000000,1795365575.000000,,,,"a ""b"", c"\r\n');
});
