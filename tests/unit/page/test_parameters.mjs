// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import { test } from "node:test";
import { readParameters, writeNumber, writeParameters } from "../../../src/web/page/parameter_file.js";
import { agree, compare, planWrites, takeDefaults } from "../../../src/web/page/parameter_set.js";
import { writeParametersInto } from "../../../src/web/page/parameter_write.js";

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

// As `drivebridgectl params save` writes such a drive.
const FILE = `# Parameters of a drive. Into a drive: drivebridgectl params restore DRIVE FILE

drive "feeder" {
	format   = 1
	family   = vsmd-serial
	identity = "VSMD \\"113\\""
}

parameters {
	cid  = 1          # Device id
	spd  = 12800.5    # pulses/s, Preset speed (运行速度)
	cra  = 0.8        # A, Current
	# zmd: the drive does not tell it: Homing mode
	s1   = 0          # Direction
	low  = 1          # 
	high = 2          # 
}

end
`;

test("a file is written as drivebridgectl writes it", () => {
	assert.equal(writeParameters(drive({ ...HELD, zmd: null })), FILE);
});

test("numbers keep every bit of single precision", () => {
	for (const value of [0, -4000, 0.1, 1 / 3, 1e-7, 3.4028234663852886e38, 16777216.5, 4294967295]) {
		const text = writeNumber(Math.fround(value) === value ? value : Math.fround(value));

		assert.equal(Math.fround(Number(text)), Math.fround(value), text);
		assert.doesNotMatch(text, /\+/);
	}
	assert.equal(writeNumber(4294967295), "4294967295");
});

test("what was written is read again", () => {
	const { set, errors } = readParameters("a.params", FILE, drive({}));

	assert.deepEqual(errors, []);
	assert.deepEqual(set.values, { cid: 1, spd: 12800.5, cra: 0.8, s1: 0, low: 1, high: 2 });
	assert.equal(set.identity, 'VSMD "113"');
	assert.deepEqual(compare(drive({ ...HELD, zmd: null }), set), []);
});

test("comments, quotes and no order are as in configuration files", () => {
	const text = "/* a\n b */ parameters { spd = '5' // c\n s1=1 }\ndrive x { family = vsmd-serial format = 1 }\nend\n";
	const { set, errors } = readParameters("a", text, drive({}));

	assert.deepEqual(errors, []);
	assert.deepEqual(set.values, { spd: 5, s1: 1 });
});

function problems(text) {
	return readParameters("a", text, drive({})).errors.map((error) => `${error.line}: ${error.text}`);
}

function changed(from, to) {
	assert.ok(FILE.includes(from), from);
	return problems(FILE.replace(from, to));
}

test("every mistake in a file is named with its line", () => {
	assert.match(changed("\nend\n", "\n")[0], /the last line is not 'end'/);
	assert.match(changed("\nend\n", "\nend\ndrive y {}\n")[0], /19: end says .* line 20/);
	assert.match(changed("format   = 1", "format   = 2")[0], /4: the format is 2/);
	assert.match(changed("\tformat   = 1\n", "")[0], /3: the drive has no format/);
	assert.match(changed("vsmd-serial", "xyza")[0], /5: these are parameters of xyza, and the drive is vsmd-serial/);
	assert.match(changed("identity", "idendity")[0], /6: a drive has no 'idendity'/);
	assert.match(changed("12800.5 ", "abc")[0], /11: spd: “abc” is no number/);
	assert.match(changed("12800.5 ", "1e9")[0], /11: spd: 1e9 is out of range/);
	assert.match(changed("12800.5 ", "12,5")[0], /11: numbers have a decimal point/);
	assert.match(changed("12800.5 ", "{1, 2}")[0], /11: 'spd' is a list/);
	assert.match(changed("12800.5 ", "\u22125")[0], /11: here stands U\+2212/);
	assert.match(changed("12800.5 ", "+5")[0], /11: the character '\+' cannot stand here/);
	assert.match(changed("12800.5 ", '"5')[0], /11: the text that begins here has no end/);
	assert.match(changed("cra  =", "crx  =")[0], /12: vsmd-serial has no parameter 'crx'/);
	assert.match(changed("cra  =", "code =")[0], /12: 'code' cannot be written from a file/);
	assert.match(changed("cra  =", "spd  =")[0], /12: 'spd' is given twice, first on line 11/);
	assert.match(changed("parameters {", "parametres {")[0], /9: there is no section 'parametres'/);
	assert.match(changed("}\n\nend", "")[0], /the file ends too early/);
	assert.match(changed("# Parameters", "/* Parameters")[0], /1: the comment that begins here has no end/);
	assert.match(problems("")[0], /the last line is not 'end'/);
	assert.match(problems("\0")[0], /zero bytes/);
	assert.match(problems("x = 1")[0], /1: 'x' stands outside/);
});

test("sets differ by what the drives hold", () => {
	const names = (one, other) => compare(one, other).map((each) => each.name);

	assert.deepEqual(names(drive(HELD), drive({ ...HELD, spd: 5, code: 9, ramp: 9 })), ["spd"]);
	assert.deepEqual(names(drive(HELD), drive({ ...HELD, cra: 0.8 })), []);
	assert.deepEqual(names(drive(HELD), drive({ ...HELD, zmd: null })), ["zmd"]);
	assert.deepEqual(names(drive({ ...HELD, s1: 1 }), takeDefaults(drive(HELD))), ["s1"]);
	assert.ok(!agree(drive({ cid: 4294967295 }), drive({ cid: 4294967294 }), REGISTERS[1]));
});

test("what others rest upon is written first, an address last", () => {
	const plan = planWrites(REGISTERS, new Set(["cid", "spd", "zmd", "s1", "low", "high"]));

	assert.deepEqual(plan.map((group) => group.map((each) => each.name)),
		[["s1"], ["spd"], ["low", "high"], ["zmd"], ["cid"]]);
});

// A drive that obeys, but for what `rules` say by name: a function that may throw, or return what it holds then.
function createDrive(rules = {}) {
	const held = { ...HELD };
	const calls = [];

	async function call(method, { names, values }) {
		calls.push(method === "Write" ? values : names);
		if (method === "Read")
			return { values: Object.fromEntries(names.map((name) => [name, held[name] ?? null])) };
		for (const [name, value] of Object.entries(values))
			held[name] = rules[name] ? rules[name](value, held) : value;
		return { result: "ok" };
	}
	return { held, calls, call };
}

function refuse(name, parameters = {}) {
	throw Object.assign(new Error(`${name} ${parameters.result ?? ""}`), { name, parameters });
}

async function write(rules, wanted, isEnded = () => false) {
	const fake = createDrive(rules);
	const said = [];
	const plan = planWrites(REGISTERS, new Set(Object.keys(wanted)));
	const result = await writeParametersInto("feeder", plan, wanted, { call: fake.call, isEnded,
		report: (one, state, text) => state !== "writing" && said.push(`${one.name} ${state} ${text}`) });

	return { ...result, said, ...fake };
}

test("parameters are written one after the other and read back", async () => {
	const { written, failed, calls, held } = await write({}, { spd: 5, low: 3, high: 4 });

	assert.deepEqual(written, ["spd", "low", "high"]);
	assert.equal(failed.size, 0);
	assert.deepEqual(calls, [{ spd: 5 }, ["spd"], { low: 3, high: 4 }, ["low", "high"]]);
	assert.equal(held.spd, 5);
});

test("what the drive shows otherwise has failed", async () => {
	const { written, failed } = await write({ spd: () => 100, cra: () => null }, { spd: 5, cra: 1, s1: 1 });

	assert.deepEqual(written, ["s1"]);
	assert.match(failed.get("spd"), /the drive shows 100 pulses\/s/);
	assert.match(failed.get("cra"), /does not tell it/);
});

test("what is refused because of another is tried again behind it", async () => {
	const needs = (value, held) => held.zmd === 1 ? value : refuse("Refused", { result: "refused" });
	const { written, failed } = await write({ spd: needs }, { spd: 5, zmd: 1 });

	assert.deepEqual(written, ["zmd", "spd"]);
	assert.equal(failed.size, 0);
});

test("a drive that is gone gets nothing more, and the rest is named", async () => {
	for (const gone of [() => refuse("Refused", { result: "offline" }), () => refuse("NotAllowed"),
		() => refuse("ServiceUnreachable")]) {
		const { written, failed, said, calls } = await write({ spd: gone }, { s1: 1, spd: 5, zmd: 1 });

		assert.deepEqual(written, ["s1"]);
		assert.deepEqual([...failed.keys()], ["spd", "zmd"]);
		assert.match(said.at(-1), /^zmd stopped not tried any more/);
		assert.equal(calls.length, 3);
	}
});

test("who has had enough ends it between two writes", async () => {
	let asked = 0;
	const { written, over } = await write({}, { s1: 1, spd: 5 }, () => asked++ > 0);

	assert.deepEqual(written, ["s1"]);
	assert.equal(over, "it was ended");
});

test("a secret is written and not read back", async () => {
	const { written, calls, said } = await write({}, { code: 9 });

	assert.deepEqual(written, ["code"]);
	assert.equal(calls.length, 1);
	assert.match(said[0], /cannot be read back/);
});
