// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import { test } from "node:test";
import { writeSections } from "../../../src/web/page/configuration_text.js";
import { setUpDrive } from "../../../src/web/page/set_up.js";

const BUS = { name: "line", protocol: "vsmd-serial", can: false, speed: 115200, address_effect: "power_up", speed_effect: "power_up" };

function find(address, fields = {}) {
	return { address, speed: 115200, verdict: "one", identity: "VSMD113", other: "", drives: [], ...fields };
}

test("sections are those of drivebridgectl scan", () => {
	const drives = [{ name: "feeder", unit: 1 }, { name: "line-3", unit: 3 }];
	const finds = [find(1, { drives: ["feeder"] }), find(2), find(3, { identity: "" }), find(4, { verdict: "two" }),
		find(5, { speed: 9600 }), find(6, { speed: 9600 })];

	assert.equal(writeSections(BUS, finds, drives), `drive line-2 {    # VSMD113
    bus = line
    address = 2
    unit = 2
}
drive line-3-b {
    bus = line
    address = 3
    unit = 4
}
# at 9600 bit/s, while bus line is set to 115200: all drives of a bus and its baud must be the same
drive line-5 {    # VSMD113
    bus = line
    address = 5
    unit = 5
}
drive line-6 {    # VSMD113
    bus = line
    address = 6
    unit = 6
}
`);
	assert.match(writeSections({ ...BUS, protocol: "xyza" }, [find(0)], []), /^drive line-0 .*\n {4}bus = line\n {4}axis = x/);
	assert.equal(writeSections(BUS, [find(1, { drives: ["feeder"] })], drives), "");
});

/*
 * A bus whose drives are at `there`, by address; `rules` may say what comes of an answer: tell (throws), says (whether
 * the user says yes to the n-th question), power (what the drives become when it was off and on).
 */
async function run(move, there, rules = {}) {
	const log = [];
	let asked = 0;
	let clock = 0;
	const places = { ...there };
	const effects = [];
	const io = {
		look: async (address, speed) => {
			log.push(`look ${address}${speed ? ` at ${speed}` : ""}`);
			return places[`${address}@${speed || 115200}`] ? [places[`${address}@${speed || 115200}`]] : [];
		},
		setUp: async (address, what, value, speed) => {
			log.push(`set ${address} ${what}${value === undefined ? "" : ` ${value}`}${speed ? ` at ${speed}` : ""}`);
			rules.tell?.(what, places);
		},
		say: (text, configuration) => effects.push(text + (configuration ?? "")),
		ask: async () => {
			log.push("ask");
			return rules.says?.[asked++] ?? true;
		},
		pause: async (ms) => {
			clock += ms;
			rules.power?.(places);
		},
		now: () => clock,
	};

	let problem = "";

	await setUpDrive({ bus: BUS, what: "address", from: 2, to: 9, speed: 0, ...move }, io).catch((error) => {
		problem = error.message;
	});
	return { log, problem, said: effects.at(-1) ?? "" };
}

const ALONE = { "2@115200": find(2) };

function switchOver(places) {
	places["9@115200"] = find(9);
	delete places["2@115200"];
}

test("an address: looked at, asked, told, saved, and looked for behind a power cycle", async () => {
	const { log, problem, said } = await run({}, ALONE, { power: switchOver });

	assert.equal(problem, "");
	assert.deepEqual(log, ["look 2", "look 9", "ask", "set 2 address 9", "look 2", "ask", "set 2 save", "look 9", "look 9", "look 2"]);
	assert.match(said, /^Done: it answers at address 9/);
	const known = await run({}, { "2@115200": find(2, { drives: ["feeder"] }) }, { power: switchOver });

	assert.match(known.said, /drive feeder \{\n {4}address = 9\n/);
});

test("nothing is told when it is not one alone, taken, or not wanted", async () => {
	for (const [there, rules, right] of [[{}, {}, /^no drive answers/],
		[{ "2@115200": find(2, { verdict: "two" }) }, {}, /^more than one drive/],
		[{ ...ALONE, "9@115200": find(9, { verdict: "garbled" }) }, {}, /is taken: .* Nothing was changed/],
		[ALONE, { says: [false] }, /^Nothing was changed/]]) {
		const { log, problem } = await run({}, there, rules);

		assert.match(problem, right);
		assert.ok(!log.some((line) => line.startsWith("set")));
	}
});

test("whatever goes wrong behind that tells where the drive may be", async () => {
	const gone = await run({}, ALONE, { tell: (what, places) => delete places["2@115200"] });

	assert.match(gone.problem, /does not answer to be saved: the drive may be found at address 2 or 9 of line/);
	assert.match((await run({}, ALONE, { says: [true, false] })).problem, /^it was not saved: .*address 2 or 9/);
	assert.match((await run({}, ALONE, {})).problem, /^it does not answer where it should: .*2 or 9/);
	assert.match((await run({}, ALONE, { power: (places) => {
		places["9@115200"] = find(9);
	} })).problem, /^somebody still answers at its former address/);
	assert.match((await run({}, ALONE, { tell: (what) => {
		if (what === "save")
			throw new Error("refused");
	} })).problem, /^it was not saved: refused: .*2 or 9/);
});

test("one that goes by it at once may not have answered", async () => {
	const bus = { ...BUS, address_effect: "at_once" };
	const { log, problem } = await run({ bus }, ALONE, { tell: (what, places) => {
		switchOver(places);
		throw Object.assign(new Error("silent"), { parameters: { why: "silent" } });
	} });

	assert.equal(problem, "");
	assert.deepEqual(log.slice(3), ["set 2 address 9", "look 2", "look 9", "look 9", "look 2"]);
	assert.match((await run({ bus }, ALONE, { tell: () => {
		throw Object.assign(new Error("it moves"), { parameters: { why: "moves" } });
	} })).problem, /^it moves$/);
});

test("a speed is looked for with the bus set aside, once, when somebody says so", async () => {
	const { log, problem, said } = await run({ what: "speed", to: 57600 }, { ...ALONE, "2@57600": find(2) });

	assert.equal(problem, "");
	assert.deepEqual(log, ["look 2", "ask", "set 2 speed 57600", "look 2", "ask", "set 2 save", "ask", "look 2 at 57600"]);
	assert.match(said, /bus line \{\n {4}baud = 57600\n/);
	assert.match((await run({ what: "speed", to: 57600 }, ALONE)).problem, /former speed or at 57600 bit\/s/);
});

test("what a family cannot is said by the service", async () => {
	const { log, problem } = await run({ what: "speed", to: 57600, bus: { ...BUS, speed_effect: "never" } }, ALONE, { tell: () => {
		throw new Error("not over the bus");
	} });

	assert.equal(problem, "not over the bus");
	assert.deepEqual(log, ["set 2 speed 57600"]);
});
