/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { GROUP_NAMES, groupOf, readChoices } from "../../../../src/tools/web/page/parameter_groups.js";

test("a parameter is in the group that its description names", () => {
	for (const [description, unit, group] of [
		["Preset speed; the sign is the direction", "pulses/s", "Motion"],
		["Current while accelerating", "A", "Current and power"],
		["Homing speed; the sign is the direction", "pulses/s", "Homing and origin"],
		["What a falling edge of sensor 1 does: 0=none 1=set origin", "", "Inputs, outputs and limits"],
		["Direction of sensor port 1: 0=input 1=output", "", "Inputs, outputs and limits"],
		["Encoder lines; closed loop only", "lines", "Encoder and control loop"],
		["Bit rate of its bus", "", "Communication"],
		["Printed in an example", "", "Other"],
	])
		assert.equal(groupOf({ description, unit }), group, description);
	assert.equal(groupOf({ description: "Where it is heard", unit: "", traits: ["address"] }), "Communication");
	assert.equal(GROUP_NAMES.length, new Set(GROUP_NAMES).size);
});

test("choices are in words where each value has some", () => {
	const choices = (description, min, max, more = {}) => readChoices({ type: "u16", description, min, max, ...more });

	assert.deepEqual(choices("Microstepping: 0=full 1=1/2 2=1/4", 0, 2), [[0, "full"], [1, "1/2"], [2, "1/4"]]);
	assert.deepEqual(choices("Encoder mode: 0=none 1=A and B 2=A B and Z; closed loop only", 0, 2),
		[[0, "none"], [1, "A and B"], [2, "A B and Z"]]);
	assert.deepEqual(choices("", 0, 9, { codes: { 0: "off", 4: "set_origin" } }), [[0, "off"], [4, "set origin"]]);
	/* Not every value is told, or it is no choice at all. */
	assert.equal(choices("Negative limit sensor: 0=none 1=s1 ... 6=s6", 0, 6), null);
	assert.equal(choices("Retries; 0=without limit", 0, 100), null);
	assert.equal(choices("Preset speed; 0=none 1=some", 0, 1, { type: "f32" }), null);
	assert.equal(choices("Pull resistors: 0=down 1=up", 0, 1, { type: "bits16" }), null);
	assert.equal(choices("", undefined, undefined), null);
});
