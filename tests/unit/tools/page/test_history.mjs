/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { completeEntry, formatClient, fromBits, readHistory } from "../../../../src/tools/web/page/history.js";
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
	assert.deepEqual([entry.result, entry.sequence, entry.client], ["ok", 7, "the service itself"]);
	assert.equal(read({}).args, "");
});

test("parameter writes, unknown codes and empty entries", () => {
	assert.equal(read({ command: 0 }).command, "parameter write");
	assert.equal(read({ result: 99 }).result, "99");
	assert.equal(read({ timestamp_us: 0 }), null);
});

test("a written parameter has its name and its new value, and from the trail the one before", () => {
	const registers = new Map([...REGISTERS, ["acc", { name: "acc", type: "f32", unit: "pulses/s^2", parameter: true,
		address: 206 }], ["key", { name: "key", type: "u16", parameter: true, address: 9, traits: ["secret"] }]]);
	const write = (number, value) => readHistory({ history1_timestamp_us: 1e15, history1_command: 0,
		history1_number: number, history1_value: value, history1_ipv4: 0xffffffff, history1_port: 4,
		history1_address: "control, user drivebridge-web", history1_user: "anna" }, 1, registers, COMMANDS,
	createScale("mm", 640));
	const bits = new DataView(new ArrayBuffer(4));

	bits.setFloat32(0, 99000);
	const entry = write(206, bits.getUint32(0));

	assert.deepEqual([entry.command, entry.args], ["write acc", "99000 pulses/s^2"]);
	assert.deepEqual([write(9, 1234).command, write(9, 1234).args], ["write key", ""]);
	const record = (more) => ({ kind: "write", time_us: 1e15 + 100, values: { acc: [64000, 99000] }, user: "anna",
		from: "page, 10.0.0.5", ...more });
	const complete = (...records) => completeEntry(entry, records);

	assert.deepEqual([complete(record({})).args, complete(record({})).client],
		["64000 pulses/s^2 → 99000 pulses/s^2", "anna (page, 10.0.0.5)"]);
	/* The nearest in time; none that is too far, or of another parameter. */
	assert.match(complete(record({ time_us: 1e15 - 2e6, values: { acc: [1, 2] } }), record({})).args, /^64000/);
	for (const other of [record({ time_us: 1e15 + 6e6 }), record({ values: { dec: [1, 2] } })])
		assert.deepEqual(complete(other), entry);
	assert.equal(complete(record({ values: { acc: [null, 99000] } })).args, "99000 pulses/s^2");
});

test("a value is what its bits say", () => {
	assert.equal(fromBits({ type: "i32" }, 0xffffffff), -1);
	assert.equal(fromBits({ type: "i16" }, 0xffff), -1);
	assert.equal(fromBits({ type: "u16" }, 0xffff), 65535);
	assert.equal(fromBits({ type: "f32" }, 0x3f800000), 1);
	assert.equal(fromBits({ type: "u32" }, 7), 7);
});

test("by whom, in words", () => {
	assert.equal(formatClient(0xc0a80a05, 49152), "192.168.10.5 (Modbus, port 49152)");
	assert.equal(formatClient(0xffffffff, 7, "control, user anna"), "user anna of the gateway (session 7)");
	assert.equal(formatClient(0xffffffff, 7, "control, user drivebridge-web", "anna"), "anna (page, session 7)");
	assert.equal(formatClient(0xffffffff, 7, "control, user root", "anna"), "anna (through root, session 7)");
	assert.equal(formatClient(0xffffffff, 502, "fd00::5"), "fd00::5 (Modbus, port 502)");
	assert.equal(formatClient(0xffffffff, 7), "control socket (session 7)");
	assert.equal(formatClient(0, 0), "the service itself");
});
