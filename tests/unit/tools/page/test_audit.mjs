/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { createSearch, makeAddress, makeFilter } from "../../../../src/tools/web/page/audit_search.js";

const NOTHING = { who: "", through: "", drive: "", kind: "", text: " ", from: "", to: "", refused: false };

test("what is not chosen is not asked for", () => {
	assert.deepEqual(makeFilter(NOTHING), {});
	assert.deepEqual(makeFilter({ ...NOTHING, who: " anna ", kind: "write", refused: true }),
		{ who: "anna", kind: "write", refused: true });
});

test("times are local, and the last minute is whole", () => {
	const filter = makeFilter({ ...NOTHING, from: "2026-05-01T14:00", to: "2026-05-01T14:00" });
	const minute = new Date(2026, 4, 1, 14, 0).getTime() * 1000;

	assert.deepEqual(filter, { since_us: minute, until_us: minute + 60e6 - 1 });
});

test("a file has the same filter", () => {
	assert.equal(makeAddress("cef", {}), "api/audit.cef");
	assert.equal(makeAddress("jsonl", { who: "a&b", through: "OPC UA", refused: true }),
		"api/audit.jsonl?who=a%26b&through=OPC+UA&refused=true");
});

/* A server with the numbers 1 to `newest`, of which an answer has some. */
function makeServer(newest, each) {
	const asked = [];

	return {
		asked,
		async ask({ before = newest + 1, ...filter }) {
			const numbers = [];

			asked.push({ before, ...filter });
			for (let number = before - 1; number > 0 && numbers.length < each; number--)
				numbers.push(number);
			return { records: numbers.map((number) => ({ number })),
				before: numbers.at(-1) ?? 1, over: before - numbers.length <= 1, trail: { newest } };
		}
	};
}

function numbersOf(search) { return search.records.map(({ number }) => number); }

test("older records come when they are wanted, until there are none", async () => {
	const server = makeServer(25, 10);
	const search = createSearch({ ask: server.ask, filter: { who: "anna" }, most: 100, onChange() {} });

	await search.more(10);
	assert.deepEqual(numbersOf(search), [25, 24, 23, 22, 21, 20, 19, 18, 17, 16]);
	assert.equal(search.over, false);
	await search.more(10);
	await search.more(10);
	await search.more(10);
	assert.equal(numbersOf(search).length, 25);
	assert.equal(search.over, true);
	assert.deepEqual(server.asked.map(({ before }) => before), [26, 16, 6]);
	assert.ok(server.asked.every(({ who }) => who === "anna"));
});

test("a search goes on over answers with nothing wanted", async () => {
	const answers = [[], [], [7], []];
	const search = createSearch({ filter: {}, most: 100, onChange() {},
		ask: async () => ({ records: answers.shift().map((number) => ({ number })),
			before: answers.length + 1, over: answers.length === 0, trail: {} }) });

	await search.more(10);
	assert.deepEqual([numbersOf(search), search.over, answers.length], [[7], true, 0]);
});

test("what is kept is bounded: the newest give way", async () => {
	const search = createSearch({ ask: makeServer(1000, 10).ask, filter: {}, most: 50, onChange() {} });

	for (let i = 0; i < 20; i++)
		await search.more(10);
	assert.deepEqual([search.records.length, search.records[0].number, search.forgotten], [50, 850, 150]);
});

test("an error ends it, and it can go on; what is stopped says nothing", async () => {
	const server = makeServer(30, 10);
	let fails = true;
	let told = 0;
	const search = createSearch({ filter: {}, most: 100, onChange: () => { told++; },
		ask: (parameters) => fails ? Promise.reject(new Error("Busy")) : server.ask(parameters) });

	await search.more(10);
	assert.deepEqual([search.error.message, search.running, search.records.length], ["Busy", false, 0]);
	fails = false;
	await search.more(10);
	assert.deepEqual([search.error, search.records.length], [null, 10]);
	const going = search.more(10);

	told = 0;
	search.stop();
	await going;
	assert.deepEqual([told, search.records.length], [0, 10]);
});
