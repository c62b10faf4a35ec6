/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import {
	STEPS, createRecord, listOpen, listWanted, markStep, readRecord, stateOf, takeVerdicts, thin, wantKey
} from "../../../../src/tools/web/page/commission_record.js";
import { roundPosition } from "../../../../src/tools/web/page/commission_limits.js";
import { chooseSide } from "../../../../src/tools/web/page/commission_response.js";
import { sayOutcome } from "../../../../src/tools/web/page/commission_report.js";
import { findTicks, writePath } from "../../../../src/tools/web/page/response_plot.js";

const SCALE = { step: "scale", section: "drive", setting: "counts-per-unit", verdict: "contradicted", now: "32",
	right: "320", how: "it was measured" };

test("a step is open until it is done or left out, and the report until then", () => {
	const record = createRecord("press", 1);

	assert.deepEqual(listOpen(record), STEPS.slice(0, -1));
	assert.equal(stateOf(record, "report"), "open");
	for (const step of STEPS.slice(0, -1))
		markStep(record, step, { state: step === "trials" ? "left" : "done", by: "anna", at: 2 });
	assert.equal(stateOf(record, "trials"), "left");
	assert.equal(stateOf(record, "report"), "done");
	assert.deepEqual(listOpen(record), []);
	/* Values that are tried are neither kept nor back. */
	record.tried = { acc: 64000 };
	assert.deepEqual(listOpen(record), ["response"]);
	assert.equal(stateOf(record, "response"), "wrong");
});

test("what contradicts is to be put right, until it is in the configuration or seen otherwise", () => {
	const record = createRecord("press", 1);

	takeVerdicts(record, "scale", [SCALE], "line");
	markStep(record, "scale", { state: "done", by: "", at: 2 });
	assert.equal(stateOf(record, "scale"), "wrong");
	assert.deepEqual(listWanted(record).map(({ kind, name, key, value }) => [kind, name, key, value]),
		[["drive", "press", "counts-per-unit", "320"]]);
	record.keys[0].at = 3;
	assert.equal(stateOf(record, "scale"), "done");
	assert.deepEqual(listWanted(record), []);
	/* No key turns a motor around: the step is done again. */
	const wires = { step: "motion", section: "", setting: "direction", verdict: "contradicted", right: "swap wires" };

	takeVerdicts(record, "motion", [wires], "line");
	assert.equal(stateOf(record, "direction"), "wrong");
	takeVerdicts(record, "motion", [{ ...wires, verdict: "proven" }], "line");
	assert.notEqual(stateOf(record, "direction"), "wrong");
	assert.equal(record.verdicts.length, 2);
	/* Settings of the bus have the name of the bus; what no step of the path has belongs to the other trials. */
	takeVerdicts(record, "round-trips", [{ ...SCALE, step: "round-trips", section: "bus", setting: "turnaround-us" }], "line");
	assert.equal(listWanted(record)[0].name, "line");
	assert.equal(stateOf(record, "trials"), "wrong");
});

test("a value that is taken again replaces the one of before", () => {
	const record = createRecord("press", 1);

	wantKey(record, { kind: "drive", name: "press", key: "min-position", value: "-3" });
	record.keys[0].at = 5;
	wantKey(record, { kind: "drive", name: "press", key: "min-position", value: "-4" });
	assert.deepEqual(listWanted(record, ["min-position"]).map(({ value }) => value), ["-4"]);
	assert.deepEqual(listWanted(record, ["max-position"]), []);
	assert.equal(record.keys.length, 1);
});

test("what this browser has kept is taken up, and anything else begins anew", () => {
	const record = { ...createRecord("press", 1), identity: "VSMD" };

	markStep(record, "found", { state: "done", by: "anna", at: 2, values: { bus: "line" } });
	assert.deepEqual(readRecord(JSON.stringify(record), "press", 9), record);
	for (const text of ["", "{", "null", "[]", '{"drive":"press"}', JSON.stringify({ ...record, keys: 3 }),
		JSON.stringify({ ...record, steps: null })])
		assert.deepEqual(readRecord(text, "press", 9), createRecord("press", 9));
	assert.equal(readRecord(JSON.stringify(record), "other", 9).begun, 9);
});

test("a position is written with the decimals that it needs", () => {
	assert.equal(roundPosition(-12.500001, 1 / 320), -12.5);
	assert.equal(roundPosition(0.0031251, 1 / 320), 0.003);
	assert.equal(roundPosition(1234, 0), 1234);
});

test("a step goes where there is room", () => {
	const limits = { min_position: -5, max_position: 10 };

	assert.equal(chooseSide(1, 3, 8, limits), -1);
	assert.equal(chooseSide(1, 3, 6, limits), 1);
	assert.equal(chooseSide(-1, 3, -4, limits), 1);
	/* Nowhere: the service says so. */
	assert.equal(chooseSide(1, 30, 0, limits), 1);
	assert.equal(chooseSide(-1, 30, 0, {}), -1);
});

test("a plot keeps its first and last point", () => {
	const times = Array.from({ length: 1001 }, (_, i) => i);
	const kept = thin(times, times);

	assert.ok(kept.times.length <= 302);
	assert.deepEqual([kept.times[0], kept.times.at(-1), kept.values.at(-1)], [0, 1000, 1000]);
});

test("axes have round numbers, and a line has gaps where there is no value", () => {
	assert.deepEqual(findTicks(-0.13, 1.02), [0, 0.5, 1]);
	assert.deepEqual(findTicks(0, 50), [0, 10, 20, 30, 40, 50]);
	assert.equal(writePath([0, 1, 2, 3], [1, null, 3, 4], (x) => x * 10, (y) => y), "M0.0,1.0 M20.0,3.0 L30.0,4.0");
});

test("the report says what a step has found", () => {
	assert.equal(sayOutcome("home", { how: "home", position: "0", unit: "mm" }), "it has found its origin, and stood at 0 mm");
	assert.equal(sayOutcome("home", { how: "set_position", position: -2, unit: "mm" }), "its position was set to −2 mm");
	assert.equal(sayOutcome("limits", { min: -1, max: 2.5, unit: "mm" }), "−1 to 2.5 mm");
	assert.equal(sayOutcome("response", {}), "");
});
