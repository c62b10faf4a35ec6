// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import { test } from "node:test";
import { agree, compare, takeDefaults } from "../../../../src/tools/web/page/parameter_set.js";
import { parseValue } from "../../../../src/tools/web/page/format.js";
import { writeTyped } from "../../../../src/tools/web/page/parameter_table.js";

function register(name, fields = {}) {
	return { name, type: "u16", writable: true, unit: "", min: 0, max: 65535, parameter: true, description: "", ...fields };
}

const REGISTERS = [
	register("axis_state", { parameter: false }),
	register("cid", { traits: ["address"], min: 1, max: 32, description: "Device id; effective later" }),
	register("spd", { type: "f32", unit: "pulses/s", min: -192000, max: 192000, description: "Preset speed (运行速度); signed" }),
	register("cra", { type: "f32", unit: "A", max: 10, description: "Current" }),
	register("zmd", { traits: ["last"], max: 7, description: "Homing mode" }),
	register("s1", { traits: ["first"], max: 1, default: 0, description: "Direction" }),
	register("low", { traits: ["together"] }),
	register("high", { traits: ["together"] }),
	register("code", { traits: ["secret"] }),
	register("reset", { traits: ["action"] }),
	register("ramp", { traits: ["derived"] }),
];

function drive(values, name = "feeder") {
	return { name, family: "vsmd-serial", identity: 'VSMD "113"', registers: REGISTERS, values, missing: [] };
}

const HELD = { cid: 1, spd: 12800.5, cra: 0.800000011920929, zmd: 3, s1: 0, low: 1, high: 2, code: 0, ramp: 7, axis_state: 1 };

test("what is typed for a value is that value again", () => {
	const real = register("spd", { type: "f32", min: null, max: null });

	for (const value of [0, -4000, 0.1, 1 / 3, 1e-7, 3.4028234663852886e38, 16777216.5, -0.25]) {
		const typed = writeTyped(real, Math.fround(value));

		assert.equal(Math.fround(parseValue(real, typed).value), Math.fround(value), typed);
		assert.match(typed, /^[-+.e0-9]+$/);
	}
	assert.equal(writeTyped(register("cid"), 4294967295), "4294967295");
	assert.equal(writeTyped(register("cid"), null), "");
	assert.equal(writeTyped(register("cid", { codes: { 3: "limit_switch" } }), 3), "limit switch");
});

test("sets differ by what the drives hold", () => {
	const names = (one, other) => compare(one, other).map((each) => each.name);

	assert.deepEqual(names(drive(HELD), drive({ ...HELD, spd: 5, code: 9, ramp: 9 })), ["spd"]);
	assert.deepEqual(names(drive(HELD), drive({ ...HELD, cra: 0.8 })), []);
	assert.deepEqual(names(drive(HELD), drive({ ...HELD, zmd: null })), ["zmd"]);
	assert.deepEqual(names(drive({ ...HELD, s1: 1 }), takeDefaults(drive(HELD))), ["s1"]);
	assert.ok(!agree(drive({ cid: 4294967295 }), drive({ cid: 4294967294 }), REGISTERS[1]));
});
