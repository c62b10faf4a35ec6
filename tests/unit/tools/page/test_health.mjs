/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { isOpen, listAlarms, readWhom } from "../../../../src/tools/web/page/alarms.js";
import { formatShare, levelOf, makeColumns, readRow, sortRows } from "../../../../src/tools/web/page/health_slots.js";

const NOW_US = 7200e6;
const TIMES = [{ end_us: 3600e6, span_s: 3600 }, { end_us: 7200e6, span_s: 1800 }];

test("a cell is where its interval was, and what is not known has none", () => {
	const row = readRow({ drive: "lift", lost_ppm: [null, 20000], offline_ms: [null, 0] }, TIMES, NOW_US, 7200);

	assert.deepEqual(row.cells, [{ left: 0.75, width: 0.25, level: 3 }]);
	assert.equal(row.worst, 0.02);
	assert.ok(row.known);
	assert.ok(!readRow({ drive: "lift", lost_ppm: [null, null], offline_ms: [null, null] }, TIMES, NOW_US, 7200).known);
});

test("an interval that began before the picture is cut", () => {
	const [cell] = readRow({ drive: "lift", lost_ppm: [0, 0], offline_ms: [0, 0] }, TIMES, NOW_US, 5400).cells;

	assert.deepEqual(cell, { left: 0, width: 1 / 3, level: 0 });
});

test("time offline counts as lost", () => {
	const row = readRow({ drive: "lift", lost_ppm: [0, 0], offline_ms: [0, 1800000] }, TIMES, NOW_US, 7200);

	assert.deepEqual(row.cells.map(({ level }) => level), [0, 4]);
	assert.equal(row.offline, 1800);
	assert.equal(row.worst, 1);
});

test("a short bad interval does not hide hours of losses", () => {
	const rows = [{ drive: "start", known: true, weight: 5 }, { drive: "gone", known: false, weight: 0 },
		{ drive: "plug", known: true, weight: 500 }];

	assert.deepEqual(sortRows(rows).map(({ drive }) => drive), ["plug", "start", "gone"]);
});

test("levels and their words", () => {
	assert.deepEqual([0, 0.0001, 0.001, 0.002, 0.05, 0.2].map(levelOf), [0, 1, 1, 2, 3, 4]);
	assert.deepEqual([0, 0.00021, 0.032, 0.456].map(formatShare), ["0 %", "0.021 %", "3.2 %", "46 %"]);
});

test("a curve has a gap where the service did not run", () => {
	const value = (end, mean) => ({ end_us: end * 1e6, span_s: 60, mean });

	assert.deepEqual(makeColumns([value(60, 2), value(120, 3), value(600, 4)], 60, [({ mean }) => mean]),
		[[60, 120, 360, 600], [2, 3, null, 4]]);
});

test("alarms: open ones, the one that came last first, and who has seen one", () => {
	const alarms = [{ id: 1, present: false, acknowledged_us: 5, came_us: 9 },
		{ id: 2, present: false, acknowledged_us: 0, came_us: 1 }, { id: 3, present: true, acknowledged_us: 5, came_us: 4 }];

	assert.deepEqual(alarms.map(isOpen), [false, true, true]);
	assert.deepEqual(listAlarms(alarms, false).map(({ id }) => id), [3, 2]);
	assert.deepEqual(listAlarms(alarms, true).map(({ id }) => id), [1, 3, 2]);
	assert.equal(readWhom("control, user drivebridge-web for anna, session 3"), "anna");
	assert.equal(readWhom("control, user root"), "user root");
});
