/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { createStops, UNCONFIRMED_AFTER_MS } from "../../../../src/tools/web/page/stops.js";

const CALL = { method: "Run", parameters: { drive: "lift", command: "stop" } };

function failure(name, message) {
	return Object.assign(new Error(message), { name });
}

/* A gateway that a test plays, in made-up time: each try is answered when the test does. */
function makeBench() {
	const bench = { now: 1000, tries: [], late: [], timers: [], looks: new Set() };

	bench.stops = createStops({
		send: (call) => new Promise((resolve, reject) => bench.tries.push({ call, resolve, reject })),
		onChange(late) { bench.late = late.map(({ name, why }) => [name, why]); },
		clock: () => bench.now,
		timers: {
			setTimeout: (callback, ms) => bench.timers.push({ at: bench.now + ms, callback }),
			setInterval(callback) {
				bench.looks.add(callback);
				return callback;
			},
			clearInterval: (callback) => bench.looks.delete(callback),
		},
	});
	bench.settle = () => new Promise((resolve) => setImmediate(resolve));
	bench.pass = async (ms) => {
		await bench.settle();
		for (const end = bench.now + ms; bench.now < end;) {
			bench.now += 10;
			const due = bench.timers.filter(({ at }) => at <= bench.now);

			bench.timers = bench.timers.filter(({ at }) => at > bench.now);
			due.forEach(({ callback }) => callback());
			bench.looks.forEach((callback) => callback());
			await bench.settle();
		}
	};
	return bench;
}

test("a stop that is confirmed in time shows nothing", async () => {
	const bench = makeBench();
	const done = bench.stops.press("lift", CALL);

	await bench.pass(UNCONFIRMED_AFTER_MS - 20);
	bench.tries[0].resolve({ result: "ok" });
	assert.deepEqual(await done, { result: "ok" });
	await bench.pass(2000);
	assert.deepEqual([bench.tries.length, bench.late, bench.looks.size], [1, [], 0]);
});

test("half a second without a confirmation is shown, and stays so until there is one", async () => {
	const bench = makeBench();
	const done = bench.stops.press("lift", CALL);

	await bench.pass(UNCONFIRMED_AFTER_MS - 10);
	assert.deepEqual(bench.late, []);
	await bench.pass(10);
	assert.deepEqual(bench.late, [["lift", ""]]);
	bench.tries[0].reject(failure("Timeout", "the gateway does not answer in time"));
	await bench.pass(5000);
	assert.equal(bench.tries.length, 2, "a try that is under way is waited for");
	assert.deepEqual(bench.late, [["lift", "the gateway does not answer in time"]]);
	bench.tries[1].resolve({ result: "pending" });
	await bench.pass(250);
	assert.deepEqual([bench.tries.length, bench.late.length], [3, 1], "pending confirms nothing");
	bench.tries[2].resolve({ result: "ok" });
	assert.deepEqual(await done, { result: "ok" });
	assert.deepEqual([bench.late, bench.looks.size], [[], 0]);
});

test("it is sent again as long as it fails, less often where the gateway answers", async () => {
	const bench = makeBench();
	const seen = async (name) => {
		const before = bench.tries.length;

		for (let step = 0; step < 100; step++) {
			bench.tries.slice(before).forEach((one) => one.reject(failure(name, "no")));
			bench.tries.at(-1).reject(failure(name, "no"));
			await bench.pass(100);
		}
		return bench.tries.length - before;
	};

	bench.stops.press("lift", CALL);
	const unanswered = await seen("Unreachable");
	const answered = await seen("Refused");

	assert.ok(unanswered >= 30 && answered >= 9 && answered <= 13, `${unanswered} ${answered}`);
	assert.deepEqual(bench.late, [["lift", "no"]]);
});

test("the same stop pressed again is the same one, and another drive's is another", async () => {
	const bench = makeBench();
	const first = bench.stops.press("lift", CALL);

	assert.equal(bench.stops.press("lift", CALL), first);
	bench.stops.press("belt", CALL);
	await bench.pass(UNCONFIRMED_AFTER_MS);
	assert.deepEqual([bench.tries.length, bench.late], [2, [["lift", ""], ["belt", ""]]]);
	bench.tries[0].resolve({ result: "ok" });
	await bench.pass(100);
	assert.deepEqual(bench.late, [["belt", ""]]);
	/* Confirmed and pressed again it is a new one. */
	assert.notEqual(bench.stops.press("lift", CALL), first);
	assert.equal(bench.tries.length, 3);
});

test("somebody who has seen to it takes it away", async () => {
	const bench = makeBench();
	const done = bench.stops.press("lift", CALL);

	await bench.pass(700);
	bench.stops.giveUp();
	assert.equal(await done, null);
	bench.tries[0].reject(failure("Timeout", ""));
	await bench.pass(3000);
	assert.deepEqual([bench.tries.length, bench.late, bench.looks.size], [1, [], 0]);
});

test("a stop of all that fails is left to each drive's own", async () => {
	const bench = makeBench();
	const asked = [];
	const done = bench.stops.press("all", CALL, (error) => asked.push(error.message) > 0);

	bench.tries[0].reject(failure("Timeout", "silence"));
	await bench.pass(300);
	assert.deepEqual([asked, bench.tries.length], [[], 2], "who does not answer has not failed");
	bench.tries[1].reject(failure("Refused", "lift is offline"));
	assert.equal(await done, null);
	await bench.pass(3000);
	assert.deepEqual([asked, bench.tries.length], [["lift is offline"], 2]);
});
