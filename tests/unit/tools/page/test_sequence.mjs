/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { readSteps, sayProgress, writeSteps } from "../../../../src/tools/web/page/sequence.js";

const STEP = { drive: "feeder", position: "loading", velocity: 0, wait: 1.5 };

test("what this browser kept is read, and nothing else", () => {
	assert.deepEqual(readSteps(JSON.stringify([STEP])), [STEP]);
	for (const text of ["", "[", "{}", "null", "7", '[{"drive": "feeder"}]',
		JSON.stringify([{ ...STEP, wait: -1 }, { ...STEP, wait: 601 }, { ...STEP, velocity: null }, null])])
		assert.deepEqual(readSteps(text), [], text);
	assert.equal(readSteps(JSON.stringify(Array(40).fill(STEP))).length, 32);
});

test("the server gets whole milliseconds", () => {
	assert.deepEqual(writeSteps([{ ...STEP, wait: 0.1 + 0.2 }]),
		[{ drive: "feeder", position: "loading", velocity: 0, wait_ms: 300 }]);
});

test("it says which step runs, and what it waits for", () => {
	const steps = [STEP, { ...STEP, position: "home" }];

	assert.equal(sayProgress({ step: 2, moves: true, wait_ms: 0 }, steps), "Step 2 of 2: feeder goes to home");
	assert.equal(sayProgress({ step: 2, moves: false, wait_ms: 1240 }, steps), "Step 2 of 2: begins in 1.2 s");
	assert.equal(sayProgress({ step: 1, moves: false, wait_ms: 0 }, steps), "Step 1 of 2: begins");
	assert.equal(sayProgress({ step: 3, moves: false, wait_ms: 0 }, steps), "The last step has ended");
});
