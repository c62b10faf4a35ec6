/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { computeSpeeds, cutResponse, findSteady, measureResponse, sayResponse } from "../../../../src/tools/web/page/response.js";

const TIMES = Array.from({ length: 401 }, (_, i) => (i - 100) / 100);

/* A system of second order with this damping, from 10 to 30. */
function answer(damping, speed = 12) {
	const ringing = speed * Math.sqrt(1 - damping ** 2);

	return TIMES.map((t) => (t <= 0 ? 10 : 30 - 20 * Math.exp(-damping * speed * t) *
		(Math.cos(ringing * t) + damping * speed / ringing * Math.sin(ringing * t))));
}

test("overshoot and settling of a known system", () => {
	const { from, to, overshoot, settled } = measureResponse(TIMES, answer(0.4));

	assert.equal(from, 10);
	assert.ok(Math.abs(to - 30) < 0.01, `${to}`);
	/* exp(-pi d / sqrt(1 - d^2)) */
	assert.ok(Math.abs(overshoot - 0.2538) < 0.004, `${overshoot}`);
	/* The envelope is within 2 % after 4 / (d w) at the latest. */
	assert.ok(settled > 0.4 && settled < 0.9, `${settled}`);
});

test("a slow one does not overshoot, and downwards is the same", () => {
	const slow = TIMES.map((t) => (t <= 0 ? 5 : 5 - 8 * (1 - Math.exp(-6 * t))));
	const { overshoot, settled } = measureResponse(TIMES, slow);

	assert.equal(overshoot, 0);
	assert.ok(Math.abs(settled - Math.log(50) / 6) < 0.02, `${settled}`);
	const down = measureResponse(TIMES, answer(0.4).map((value) => -value));

	assert.ok(Math.abs(down.overshoot - 0.2538) < 0.004);
});

test("what is no step, or has no end, is not measured", () => {
	assert.equal(measureResponse(TIMES, TIMES.map(() => 7)), null);
	assert.equal(measureResponse(TIMES, TIMES.map((t) => Math.max(0, t))), null);
	assert.equal(measureResponse([0, 1], [0, 1]), null);
	assert.equal(measureResponse(TIMES, TIMES.map(() => null)), null);
	/* Gaps are left out. */
	const gaps = answer(0.4).map((value, i) => (i % 3 === 0 ? null : value));

	assert.ok(measureResponse(TIMES, gaps).overshoot > 0.2);
});

test("it is said in a sentence", () => {
	assert.equal(sayResponse("feeder.position", { from: 0, to: 1, overshoot: 0.0312, settled: 0.41 }),
		"feeder.position overshoots by 3.1 %, and stays within 2 % of the step after 0.410 s.");
	assert.equal(sayResponse("feeder.position", { from: 0, to: 1, overshoot: 0, settled: 0.41 }),
		"feeder.position does not overshoot, and stays within 2 % of the step after 0.410 s.");
	assert.equal(sayResponse("feeder.position", null), "");
});

test("a record around a move is cut to its begin, and says nothing when nothing moved", () => {
	const samples = Array.from({ length: 200 }, (_, i) => ({ time_us: 5e6 + i * 20000,
		value: Math.min(30, Math.max(10, 10 + (i - 100) * 0.5)) }));
	const { times, values } = cutResponse(samples, 20);

	assert.equal(times[values.findIndex((value) => value > 10) - 1], 0);
	assert.ok(times[0] > -0.25 && times[0] < -0.1, `${times[0]}`);
	assert.equal(values.at(-1), 30);
	const { settled, overshoot } = measureResponse(times, values);

	assert.equal(overshoot, 0);
	assert.ok(Math.abs(settled - 0.78) < 0.03, `${settled}`);
	assert.equal(cutResponse(samples.map((one) => ({ ...one, value: 10 })), 20), null);
	assert.equal(cutResponse([], 20), null);
});

/* Every 20 ms: 0.2 s of standstill, then what shape(seconds since then) says. */
function speeds(shape, count = 200) {
	return Array.from({ length: count }, (_, i) => ({ time_us: 7e6 + i * 20000, value: i < 10 ? 0 : shape((i - 10) / 50) }));
}

/* When it is steady, in seconds from the begin of the motion on, and with which band; null: never. */
function steadyAt(samples, wanted) {
	for (let count = 1; count <= samples.length; count++) {
		const band = findSteady(samples.slice(0, count), wanted);

		if (band > 0)
			return { at: (count - 11) / 50, band };
	}
	return null;
}

test("a speed is steady half a second after its ramp, and not on it", () => {
	assert.deepEqual(steadyAt(speeds((time) => Math.min(600, 1200 * time)), 600), { at: 1, band: 0.02 });
	assert.deepEqual(steadyAt(speeds((time) => -Math.min(600, 1200 * time)), -600), { at: 1, band: 0.02 });
	/* A slow ramp is never steady, nor is a speed that is not the wanted one. */
	assert.equal(steadyAt(speeds((time) => 100 * time, 310), 600), null);
	assert.equal(steadyAt(speeds((time) => Math.min(500, 1200 * time)), 600), null);
	assert.equal(steadyAt(speeds(() => 0), 600), null);
	assert.equal(findSteady(speeds((time) => 10 * time, 3000), 600), 0);
	assert.equal(findSteady([], 600), 0);
});

test("an oscillation is waited for, and noise makes the band wider", () => {
	const ringing = steadyAt(speeds((time) => 600 * (1 - Math.exp(-3 * time) * Math.cos(25 * time))), 600);

	assert.ok(ringing.at > 1.5 && ringing.band === 0.02, JSON.stringify(ringing));
	const noisy = speeds((time) => 600 + 20 * Math.sin(1e4 * time));
	const { at, band } = steadyAt(noisy, 600);

	assert.ok(at < 1.5 && band > 0.05 && band < 0.09, `${at} ${band}`);
	const { times, values } = cutResponse(noisy, 600);

	assert.equal(measureResponse(times, values), null);
	assert.equal(measureResponse(times, values, band).overshoot, 0);
	assert.equal(sayResponse("The speed", measureResponse(times, values, 0.08)).includes("within 8 %"), true);
	/* More than that is no speed. */
	assert.equal(steadyAt(speeds((time) => 600 + 60 * Math.sin(1e4 * time)), 600), null);
});

test("speeds that are computed from positions are over a tenth of a second", () => {
	const positions = Array.from({ length: 60 }, (_, i) => ({ time_us: i * 15000, value: Math.round(i * 15.4) }));
	const found = computeSpeeds(positions);

	assert.ok(found.length > 40);
	assert.ok(found.every(({ value }) => Math.abs(value - 15.4 / 0.015) < 11), JSON.stringify(found));
	assert.equal(found[0].time_us, 52500);
	assert.deepEqual(computeSpeeds(positions.slice(0, 5)), []);
});
