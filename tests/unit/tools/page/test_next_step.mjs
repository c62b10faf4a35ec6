/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { isUnusual } from "../../../../src/tools/web/page/lamps.js";
import { partOf } from "../../../../src/tools/web/page/limit_bar.js";
import { groupReasons, nextStep, whyNotNow } from "../../../../src/tools/web/page/next_step.js";

const judgement = (state, more = {}) => ({ state, shape: state === "ErrorStop" ? "error" : "", cause: "", ...more });

test("one step comes next, if the drive has it", () => {
	const all = new Set(["enable", "clear_fault", "home"]);

	for (const [state, more, next] of [["Disabled", {}, "enable"], ["ErrorStop", {}, "clear_fault"],
		["Standstill", {}, ""], ["Standstill", { cause: "origin_lost" }, "home"],
		["ContinuousMotion", { cause: "origin_lost" }, ""], ["Disabled", { shape: "error" }, "clear_fault"],
		["Offline", { shape: "error" }, ""], ["", {}, ""]])
		assert.equal(nextStep(judgement(state, more), all), next, `${state} ${JSON.stringify(more)}`);
	assert.equal(nextStep(judgement("Standstill", { cause: "origin_lost" }), new Set(["enable"])), "");
});

test("what cannot be done now says why, and what ends a motion is never withheld", () => {
	const why = (command, state, more = {}) => whyNotNow(command, { judgement: judgement(state), ...more });

	assert.equal(why("move_velocity", "Disabled"), "enable the drive first");
	assert.equal(why("home", "ErrorStop"), "clear the fault first");
	assert.equal(why("set_position", "Disabled"), "");
	assert.equal(why("enable", "Standstill"), "it is enabled already");
	assert.equal(why("clear_fault", "Standstill"), "there is no fault");
	assert.equal(why("clear_fault", "ErrorStop"), "");
	assert.equal(why("move_relative", "Standstill", { old: "late by 4 s" }), "what you see is old (late by 4 s)");
	assert.equal(why("move_relative", "Standstill"), "");
	for (const command of ["stop", "quick_stop", "disable", "home_stop", "shake_stop", "end_program"])
		for (const state of ["Offline", "ErrorStop", "Disabled", "Standstill", ""])
			assert.equal(why(command, state, { old: "late by 4 s", gone: true }), "", command);
	assert.deepEqual(groupReasons([["home", "no"], ["enable", ""], ["move_preset", "no"]]),
		["home, move preset: no"]);
});

test("lamps are those that are not as usual", () => {
	assert.equal(isUnusual({ name: "online" }, true), false);
	assert.equal(isUnusual({ name: "online" }, false), true);
	assert.equal(isUnusual({ name: "moving" }, true), false);
	assert.equal(isUnusual({ name: "latched" }, true), true);
	assert.equal(isUnusual({ name: "flt", description: "Hardware fault: bit 6", own: true }, true), true);
	assert.equal(isUnusual({ name: "flt", description: "Hardware fault: bit 6", own: true }, false), false);
	assert.equal(isUnusual({ name: "s1", description: "Level of sensor port 1", own: true }, true), false);
});

test("a position is somewhere between its limits", () => {
	assert.deepEqual([[5, 0, 10], [-1, 0, 10], [11, 0, 10], [null, 0, 10], [5, 10, 10]].map((one) => partOf(...one)),
		[0.5, 0, 1, null, null]);
});
