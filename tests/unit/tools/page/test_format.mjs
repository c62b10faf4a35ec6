/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import * as format from "../../../../src/tools/web/page/format.js";
import { createNumbers } from "../../../../src/tools/web/page/numbers.js";

const POSITION = { name: "position", type: "i32", unit: "counts", min: -1000, max: 1000 };
const VELOCITY = { name: "velocity", type: "f32", unit: "counts/s", min: -5000, max: 5000 };
const STATE = { name: "axis_state", type: "u16", unit: "", codes: { 0: "Offline", 2: "Standstill" } };
const STATUS = { name: "status", type: "bits32", unit: "", codes: { 0: "online", 10: "latched", 31: "last" } };

test("values are shown as the service names them", () => {
	assert.deepEqual(format.formatValue(POSITION, -12), { text: "−12", unit: "counts" });
	assert.deepEqual(format.formatValue(VELOCITY, 0.1), { text: "0.1", unit: "counts/s" });
	assert.deepEqual(format.formatValue(VELOCITY, Math.fround(0.1)), { text: "0.1", unit: "counts/s" });
	assert.deepEqual(format.formatValue(STATE, 2), { text: "Standstill", unit: "" });
	assert.deepEqual(format.formatValue(STATE, 9), { text: "9", unit: "" });
	assert.deepEqual(format.formatValue(STATUS, 1 + 1024 + 2 ** 31), { text: "online, latched, last", unit: "" });
	assert.deepEqual(format.formatValue(STATUS, 2), { text: "bit 1", unit: "" });
	assert.deepEqual(format.formatValue(STATUS, 0), { text: "none", unit: "" });
	assert.deepEqual(format.formatValue(POSITION, null), { text: "–", unit: "" });
});

test("a number keeps its decimals and has no sign when it is 0", () => {
	assert.equal(format.formatFixed(1.005, 1), "1.0");
	assert.equal(format.formatFixed(-0.04, 1), "0.0");
	assert.equal(format.formatFixed(-2.5, 2), "−2.50");
	assert.equal(format.formatFixed(null, 2), "–");
	assert.equal(format.formatFixed(NaN, 2), "–");
});

test("times, ages and speeds in words", () => {
	assert.equal(format.formatAge(0xffffffff), "never");
	assert.equal(format.formatAge(null), "never");
	assert.deepEqual([12, 999, 1500, 9999, 61000, 7200000].map(format.formatAge),
		["12 ms", "999 ms", "1.5 s", "10.0 s", "61 s", "2 h"]);
	assert.deepEqual([900, 4100, 2500000, undefined].map(format.formatDuration), ["900 us", "4.1 ms", "2.50 s", "–"]);
	assert.deepEqual([9600, 115200, 500000, 1000000].map(format.formatSpeed),
		["9600 bit/s", "115200 bit/s", "500 kbit/s", "1 Mbit/s"]);
	const noon = new Date(2026, 0, 2, 12, 0, 0, 5);

	assert.equal(format.formatTime(noon.getTime() * 1000, new Date(2026, 0, 2, 18)), "12:00:00.005");
	assert.equal(format.formatTime(noon.getTime() * 1000, new Date(2026, 0, 3)), "2026-01-02 12:00:00.005");
	assert.equal(format.formatTime(0), "–");
	assert.equal(format.formatAddress(0xc0a80a05), "192.168.10.5");
});

test("what is typed is checked against the register", () => {
	const good = [[POSITION, "12", 12], [POSITION, " −1000 ", -1000], [POSITION, "0x10", 16], [VELOCITY, "1e3", 1000],
		[VELOCITY, ".5", 0.5], [STATE, "standstill", 2], [STATE, "0", 0], [STATUS, "online, latched", 1025],
		[STATUS, "none", 0], [STATUS, "3", 3], [{ type: "bool" }, "on", true], [{ type: "bool" }, "0", false],
		[{ type: "text" }, " as it is ", " as it is "], [{ name: "reserved", type: "u16", unit: "" }, "65535", 65535]];
	const bad = [[POSITION, "1.5"], [POSITION, "1001"], [POSITION, "-1001"], [POSITION, ""], [POSITION, "12mm"],
		[VELOCITY, "Infinity"], [VELOCITY, "1,5"], [VELOCITY, "5000.1"], [VELOCITY, "0x10"], [STATE, "moving"],
		[STATUS, "online,nothing"], [{ type: "bool" }, "maybe"], [VELOCITY, "e"], [VELOCITY, "."]];

	for (const [register, text, value] of good)
		assert.deepEqual(format.parseValue(register, text), { value }, text);
	for (const [register, text] of bad) {
		const { value, problem } = format.parseValue(register, text);

		assert.equal(value, undefined, text);
		assert.ok(problem.length > 5, text);
	}
	assert.equal(format.parseValue(POSITION, "2000").problem, "2000 is out of range, −1000 to 1000 counts");
});

test("people's units go to counts and back", () => {
	const scale = format.createScale("mm", 640);

	assert.equal(scale.unit(POSITION), "mm");
	assert.equal(scale.unit(VELOCITY), "mm/s");
	assert.equal(scale.show(POSITION, 320), 0.5);
	assert.equal(scale.take(POSITION, 0.501), 321);
	assert.equal(scale.take(VELOCITY, 0.501), 0.501 * 640);
	assert.equal(scale.decimals(POSITION), 3);
	assert.equal(scale.show(POSITION, null), null);
	assert.deepEqual(format.parseValue(scale.typed(POSITION), "1.5"), { value: 1.5 });
	assert.match(format.parseValue(scale.typed(POSITION), "1.6").problem, /out of range, −1.5625 to 1.5625 mm/);
	/* A drive that counts the other way round. */
	const turned = format.createScale("deg", -10).typed(POSITION);

	assert.deepEqual([turned.min, turned.max], [-100, 100]);
	/* Others stay as they are: rpm of a servo, and all without counts per unit. */
	assert.equal(scale.unit({ type: "f32", unit: "rpm" }), "rpm");
	assert.equal(scale.take({ type: "f32", unit: "rpm" }, 30), 30);
	for (const plain of [format.createScale("", 640), format.createScale("mm", 0), format.createScale("mm", null)]) {
		assert.equal(plain.unit(POSITION), "counts");
		assert.equal(plain.take(POSITION, 7), 7);
		assert.equal(plain.isScaled(POSITION), false);
	}
});

test("a label has no unit that stands beside it", () => {
	assert.equal(format.labelOf({ name: "watchdog_ms", unit: "ms" }), "Watchdog");
	assert.equal(format.labelOf({ name: "target_position", unit: "counts" }), "Target position");
	assert.equal(format.labelOf({ name: "items", unit: "" }), "Items");
});

test("a position has no more digits than the drive's counts", () => {
	const scale = format.createScale("deg", 8888.8889);
	const counts = { unit: "counts", type: "i32" };
	const ninety = Math.round(90 * 8888.8889);

	assert.equal(format.formatFine(scale.show(counts, ninety), scale.step(counts)), "90");
	/* The next count is another number. */
	assert.equal(format.formatFine(scale.show(counts, ninety + 1), scale.step(counts)), "90.0001");
	assert.equal(format.formatFine(-0.5, 0), "−0.5");
	assert.equal(scale.step({ unit: "ms", type: "u16" }), 0);
});

test("a number is read as its language writes it, and never a thousandfold", () => {
	const german = createNumbers("de");
	const read = (typed) => format.parseValue(VELOCITY, typed, german);

	assert.deepEqual(["1.5", "-0.001", "1000"].map(german.write), ["1,5", "-0,001", "1000"]);
	assert.deepEqual(["1.5", "1000.125"].map(createNumbers("zh-CN").write), ["1.5", "1000.125"]);
	for (const [typed, value] of [["1,5", 1.5], ["1.5", 1.5], ["−1,000", -1], ["0.125", 0.125], ["1000.125", 1000.125],
		["1.0005", 1.0005], ["1,5e3", 1500], [",5", 0.5], ["1000", 1000]])
		assert.deepEqual(read(typed), { value }, typed);
	assert.equal(read("1.000").problem, "“1.000” can be read in two ways: write 1,000 or 1000");
	assert.equal(read(" −1.250 ").problem, "“-1.250” can be read in two ways: write -1,250 or -1250");
	assert.equal(read("1.250e1").problem, "“1.250e1” can be read in two ways: write 1,250e1 or 1250e1");
	/* Both signs, and a whole number with a fraction, are no numbers. */
	for (const typed of ["1.234,5", "1,234.5", "1.234.567", "1,2,3", "1.000,"])
		assert.ok(read(typed).problem, typed);
	for (const typed of ["1.000", "1,5", "1.5"])
		assert.ok(format.parseValue(POSITION, typed, german).problem, typed);
	/* A point begins the fraction where nobody writes a comma for it. */
	assert.deepEqual(format.parseValue(VELOCITY, "1.000", createNumbers("en")), { value: 1 });
	assert.ok(format.parseValue(VELOCITY, "1,000", createNumbers("en")).problem);
});
