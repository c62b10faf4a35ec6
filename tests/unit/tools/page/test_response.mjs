/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { cutResponse, measureResponse, sayResponse } from "../../../../src/tools/web/page/response.js";

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
