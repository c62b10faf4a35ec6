/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { formatClient, readHistory } from "../../../../src/tools/web/page/commands.js";
import { createScale, indexByName } from "../../../../src/tools/web/page/format.js";

const REGISTERS = indexByName([
	{ name: "target_position", type: "i32", unit: "counts" },
	{ name: "target_velocity", type: "f32", unit: "counts/s" },
	{ name: "output_number", type: "u16", unit: "" },
	{ name: "result", type: "u16", unit: "", codes: { 1: "ok", 10: "latched" } },
	{ name: "history1_command", type: "u16", codes: { 3: "stop", 6: "move_absolute" } },
	{ name: "history1_position", type: "i32", description: "Command 1: its target_position or shake_start_position" },
	{ name: "history1_real", type: "f32", description: "Command 1: its target_velocity or target_current" },
	{ name: "history1_number", type: "u16", description: "Command 1: its output_number or output_mask" },
]);
const COMMANDS = indexByName([{ name: "stop", arguments: [] },
	{ name: "move_absolute", arguments: ["target_position", "target_velocity"] }]);

function read(entry) {
	const values = Object.fromEntries(Object.entries({ timestamp_us: 5, sequence: 7, ipv4: 0, port: 0, command: 3,
		result: 1, duration_us: 10, position: 0, real: 0, number: 0, repeats: 0, ...entry })
		.map(([field, value]) => [`history2_${field}`, value]));

	return readHistory(values, 2, REGISTERS, COMMANDS, createScale("mm", 640));
}

test("an entry has the command's own arguments, in people's units", () => {
	const entry = read({ command: 6, position: 6400, real: 1280, number: 9 });

	assert.equal(entry.command, "move absolute");
	assert.equal(entry.args, "target position 10 mm, target velocity 2 mm/s");
	assert.deepEqual([entry.result, entry.sequence, entry.client], ["ok", 7, "drivebridged"]);
	assert.equal(read({}).args, "");
});

test("parameter writes, unknown codes and empty entries", () => {
	assert.equal(read({ command: 0 }).command, "parameter write");
	assert.equal(read({ result: 99 }).result, "99");
	assert.equal(read({ timestamp_us: 0 }), null);
});

test("clients by address, or by their session", () => {
	assert.equal(formatClient(0xc0a80a05, 49152), "192.168.10.5:49152");
	assert.equal(formatClient(0xffffffff, 7, "control, user anna"), "control, user anna, session 7");
	assert.equal(formatClient(0xffffffff, 7, "control, user drivebridge-web", "anna"),
		"control, user drivebridge-web for anna, session 7");
	assert.equal(formatClient(0xffffffff, 502, "fd00::5"), "fd00::5 port 502");
	assert.equal(formatClient(0xffffffff, 7), "control socket, session 7");
	assert.equal(formatClient(0, 0), "drivebridged");
});
