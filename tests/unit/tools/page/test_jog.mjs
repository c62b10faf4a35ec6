/* SPDX-License-Identifier: Apache-2.0 */
import assert from "node:assert/strict";
import { test } from "node:test";
import { createGrips } from "../../../../src/tools/web/page/jog.js";

const HELD = { held: true, why: "", text: "" };

/* A server that a test plays, in made-up time. */
function makeBench(answer = () => HELD) {
	const bench = { first: 0, sent: [], states: [], beats: [], timers: new Map(), next: 1 };

	bench.grips = createGrips({
		send(grip, beat, velocity) {
			/* Presses are numbered through all panels. */
			bench.first ||= grip;
			bench.sent.push([grip - bench.first + 1, beat, velocity]);
			return Promise.resolve().then(() => answer(grip, beat, velocity));
		},
		onChange: (state) => bench.states.push(state),
		timers: {
			setInterval(callback) {
				bench.timers.set(bench.next, callback);
				return bench.next++;
			},
			clearInterval: (number) => bench.timers.delete(number),
		},
	});
	bench.tick = async () => {
		bench.timers.forEach((callback) => callback());
		await bench.settle();
	};
	bench.settle = () => new Promise((resolve) => setImmediate(resolve));
	return bench;
}

test("a press beats with growing numbers until it is let go, then once with 0", async () => {
	const bench = makeBench();

	bench.grips.press(40);
	await bench.settle();
	await bench.tick();
	await bench.tick();
	assert.deepEqual(bench.sent, [[1, 1, 40], [1, 2, 40], [1, 3, 40]]);
	assert.equal(bench.states.at(-1).held, true);
	bench.grips.release();
	await bench.settle();
	assert.deepEqual(bench.sent.at(-1), [1, 4, 0]);
	assert.deepEqual([bench.grips.isPressed(), bench.timers.size, bench.states.at(-1).velocity], [false, 0, 0]);
	await bench.tick();
	assert.equal(bench.sent.length, 4);
});

test("each press has a number of its own, also when one follows without a release", async () => {
	const bench = makeBench();

	bench.grips.press(1);
	bench.grips.press(-1);
	await bench.settle();
	assert.deepEqual(bench.sent, [[1, 1, 1], [1, 2, 0], [2, 1, -1]]);
	assert.equal(bench.timers.size, 1);
});

test("a panel that is shown later goes on with the numbers: the server takes a lower one for an older press", async () => {
	const before = makeBench();
	const later = makeBench();

	before.grips.press(1);
	before.grips.press(1);
	await before.settle();
	before.grips.release();
	later.grips.press(1);
	await later.settle();
	assert.ok(later.first > before.first + 1, `${later.first} is not after ${before.first}`);
	later.grips.release();
	await later.settle();
});

test("a server that has ended the grip ends it here, with its reason, and is not asked again", async () => {
	const bench = makeBench((grip, beat) => (beat < 2 ? HELD : { held: false, why: "late", text: "too late" }));

	bench.grips.press(5);
	await bench.settle();
	await bench.tick();
	assert.deepEqual(bench.states.at(-1), { velocity: 0, held: false, why: "late", text: "too late" });
	await bench.tick();
	assert.equal(bench.sent.length, 2);
	bench.grips.release();
	await bench.settle();
	assert.equal(bench.sent.length, 2);
});

test("beats that are not answered do not pile up, and the release goes past them", async () => {
	const bench = makeBench((grip, beat, velocity) => (velocity === 0 ? HELD : new Promise(() => {})));

	bench.grips.press(5);
	for (let i = 0; i < 10; i++)
		await bench.tick();
	assert.equal(bench.sent.length, 2);
	bench.grips.release();
	await bench.settle();
	assert.deepEqual(bench.sent.at(-1), [1, 3, 0]);
});

test("an answer that comes after the release holds nothing", async () => {
	let reply = null;
	const bench = makeBench((grip, beat, velocity) => (velocity === 0 ? HELD :
		new Promise((resolve) => { reply = resolve; })));

	bench.grips.press(5);
	await bench.settle();
	bench.grips.release();
	reply(HELD);
	await bench.settle();
	assert.deepEqual([bench.states.at(-1).velocity, bench.states.at(-1).held], [0, false]);
});

test("a lost release is sent again, a refused grip says why", async () => {
	const lost = () => Promise.reject(Object.assign(new Error("gone"), { name: "Unreachable" }));
	const bench = makeBench((grip, beat, velocity) => (velocity === 0 ? lost() : HELD));

	bench.grips.press(5);
	await bench.settle();
	bench.grips.release();
	await bench.settle();
	assert.deepEqual(bench.sent.filter(([, , velocity]) => velocity === 0).map(([, beat]) => beat), [2, 3, 4]);

	const refused = makeBench(() => Promise.reject(Object.assign(new Error("log in"), { name: "LoginRequired" })));

	refused.grips.press(5);
	await refused.settle();
	assert.deepEqual([refused.states.at(-1).why, refused.states.at(-1).text], ["LoginRequired", "log in"]);
	assert.equal(refused.grips.isPressed(), false);
});

test("a beat that is lost does not end the press: the server decides", async () => {
	const bench = makeBench((grip, beat) => (beat === 2 ?
		Promise.reject(Object.assign(new Error("gone"), { name: "Unreachable" })) : HELD));

	bench.grips.press(5);
	await bench.settle();
	await bench.tick();
	await bench.tick();
	assert.equal(bench.grips.isPressed(), true);
	assert.equal(bench.sent.length, 3);
});

test("a press waits three beats for the stop of another drive, as long as it is held", async () => {
	const waiting = { held: false, why: "waiting", text: "drive1 is still being stopped" };
	const answers = [waiting, waiting, waiting, HELD];
	const bench = makeBench(() => answers.shift() ?? HELD);

	bench.grips.press(40);
	await bench.settle();
	assert.deepEqual([bench.states.at(-1).held, bench.states.at(-1).velocity], [false, 40]);
	await bench.tick();
	await bench.tick();
	await bench.tick();
	assert.equal(bench.states.at(-1).held, true);
	assert.deepEqual(bench.sent.at(-1), [1, 4, 40]);

	/* Longer than that it is over, and says why. */
	const slow = makeBench(() => waiting);

	slow.grips.press(40);
	await slow.settle();
	for (let beat = 0; beat < 5; beat++)
		await slow.tick();
	assert.deepEqual([slow.sent, slow.states.at(-1).text, slow.grips.isPressed()],
		[[[1, 1, 40], [1, 2, 40], [1, 3, 40], [1, 4, 40], [1, 5, 0]], waiting.text, false]);

	/* Let go meanwhile: nothing but the release follows. */
	const short = makeBench(() => waiting);

	short.grips.press(40);
	await short.settle();
	short.grips.release();
	await short.settle();
	await short.tick();
	assert.deepEqual(short.sent, [[1, 1, 40], [1, 2, 0]]);
});
