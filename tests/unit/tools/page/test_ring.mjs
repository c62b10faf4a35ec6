/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { createRing, formatCsv } from "../../../../src/tools/web/page/ring.js";

const lists = (arrays) => arrays.map((array) => [...array]);

test("a ring keeps the latest, in one piece and in order", () => {
	const ring = createRing(2, 5);

	assert.equal(ring.length, 0);
	assert.deepEqual(lists(ring.range(-Infinity, Infinity, [0])), [[], []]);
	for (let i = 1; i <= 23; i++) {
		assert.equal(ring.push(i, [i * 10, i % 2 === 0]), true);
		const kept = Array.from({ length: Math.min(i, 5) }, (none, k) => Math.max(1, i - 4) + k);

		assert.equal(ring.length, kept.length);
		assert.deepEqual([ring.firstTime(), ring.lastTime(), ring.last(0)], [kept[0], i, i * 10]);
		assert.deepEqual(lists(ring.range(-Infinity, Infinity, [0, 1])),
			[kept, kept.map((k) => k * 10), kept.map((k) => Number(k % 2 === 0))]);
	}
});

test("time goes on, and what is no number is a gap", () => {
	const ring = createRing(1, 4);

	assert.equal(ring.push(5, [1]), true);
	assert.equal(ring.push(5, [2]), false);
	assert.equal(ring.push(4, [2]), false);
	assert.equal(ring.push(6, [null]), true);
	assert.ok(Number.isNaN(ring.last(0)));
});

test("a range has one sample more on each side, for lines that leave the picture", () => {
	const ring = createRing(1, 100);

	for (let i = 0; i < 150; i++)
		ring.push(i, [i]);
	assert.deepEqual(lists(ring.range(60, 63, [0])), [[59, 60, 61, 62, 63], [59, 60, 61, 62, 63]]);
	assert.deepEqual(lists(ring.range(0, 51, []))[0], [50, 51]);
	assert.deepEqual(lists(ring.range(148.5, 999, []))[0], [148, 149]);
});

test("CSV as drivebridgectl record has it", () => {
	assert.equal(formatCsv(["feeder.position [mm]", 'odd "name", this'],
		[[1795365575.467052, 1795365575.487064], [0, 1.5], [NaN, 2]]),
	'time_s,unix_time_s,feeder.position [mm],"odd ""name"", this"\n' +
		"0.000000,1795365575.467052,0,\n0.020012,1795365575.487064,1.5,2\n");
});
