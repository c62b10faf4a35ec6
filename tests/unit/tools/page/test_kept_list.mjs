// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import { test } from "node:test";
import { createKeptList } from "../../../../src/tools/web/page/kept_list.js";

function numbers(first, count) {
	return Array.from({ length: count }, (_, at) => first + at);
}

test("the latest are kept, whatever comes", () => {
	const list = createKeptList(100);
	let gone = 0;

	for (let at = 0; at < 1000; at += 7)
		gone += list.add(numbers(at, 7));
	assert.ok(list.all.length >= 100 && list.all.length <= 110);
	assert.equal(list.all.at(-1), 1000);
	assert.equal(gone + list.shown.length, 1001);
	assert.deepEqual(list.shown, list.all);
	list.add(numbers(2000, 5000));
	assert.deepEqual(list.all, numbers(6900, 100));
});

test("a filter shows some of what is kept, and what goes is not shown either", () => {
	const list = createKeptList(100);

	list.add(numbers(0, 50));
	list.filter((number) => number % 10 === 0);
	assert.deepEqual(list.shown, [0, 10, 20, 30, 40]);
	list.add(numbers(50, 50));
	assert.equal(list.add(numbers(100, 20)), 2);
	assert.deepEqual(list.shown, [20, 30, 40, 50, 60, 70, 80, 90, 100, 110]);
	list.filter(null);
	assert.deepEqual(list.shown, list.all);
});

test("what comes in a pause waits, the latest of it", () => {
	const list = createKeptList(100);

	list.add(numbers(0, 10));
	list.pause(true);
	list.add(numbers(10, 300));
	assert.equal(list.all.length, 10);
	assert.ok(list.waiting.length <= 110);
	list.pause(false);
	assert.equal(list.all.at(-1), 309);
	assert.equal(list.waiting.length, 0);
	list.clear();
	assert.deepEqual([list.all, list.shown], [[], []]);
});
