/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { readNumber, readOrder } from "../../../../src/tools/web/page/commission_trial.js";
import { createNumbers } from "../../../../src/tools/web/page/numbers.js";

const english = createNumbers("en"), german = createNumbers("de");

test("a measured distance is no thousandth or thousandfold", () => {
	assert.deepEqual(readNumber(" 12.5 ", english), { value: 12.5 });
	assert.deepEqual(readNumber("12,5", german), { value: 12.5 });
	assert.deepEqual(readNumber("1,000", german), { value: 1 });
	for (const [typed, numbers] of [["1,000", english], ["1.000", german], ["1.000,5", german], ["", english]])
		assert.ok(readNumber(typed, numbers).problem, typed);
});

test("a trial has the velocity that was typed, or does not begin", () => {
	assert.deepEqual(readOrder("feeder", { step: "", velocity: "", seconds: " " }, english), { order: { drive: "feeder" } });
	assert.deepEqual(readOrder("feeder", { step: "speed", velocity: "0,5", seconds: "1,5" }, german),
		{ order: { drive: "feeder", step: "speed", velocity: 0.5, seconds: 1.5 } });
	for (const [velocity, numbers] of [["0,5", english], ["1.000", german], ["fast", german]])
		assert.ok(readOrder("feeder", { step: "", velocity, seconds: "" }, numbers).problem, velocity);
});
